"""The event loop: take the block that is due first, advance it, let its event happen, form blocks anew."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular._tournament import leaf, play, replay
from granular.md.located.clock import elapsed
from granular.md.located.flight import arrive
from granular.md.located.islands import FULL, STOP, bring, join, regroup, settle
from granular.md.located.modes import act, activate
from granular.md.located.plan import plan, settle_series
from granular.md.located.records import ACTIVE, FREE, OPEN
from granular.md.located.resting import NOT_YET, RESTS, is_still, lie, verdict

REACHED, MORE, STOPPED, QUIET, WORK, REST, BINDING, CRAMPED = range(8)
"""Why `advance` returned: time limit, pause or log full, stop condition, nothing can follow, work limit,
every ball rests for good, every ball is bound in contact for ever, no room in the pool."""


@kernel
def advance(s: Any, limit: float, chunk: int, laws: Any) -> int:
    """Work off what is due up to time `limit`, at most `chunk` pieces."""
    run, pairs, pool, bodies, queue, log, work = s.run[0], s.pairs, s.pool, s.bodies, s.queue, s.log, s.work
    for _ in range(chunk):
        if run.waits == 0:
            lo = queue[1].key
            if queue[1].due > limit:
                return REACHED
            if queue[1].due == math.inf:
                return QUIET
            if run.begun >= run.max_events or run.steps >= run.max_steps:
                return WORK
            if run.rows >= len(log) or run.steps >= run.pause:
                return MORE
            if pairs[lo].slot < 0:
                if run.members == len(pool):
                    return CRAMPED
                arrive(pairs[lo])
                join(run, pairs, pool, s.kinds, bodies, lo)
            block, hi = pool[pairs[lo].slot], pairs[lo].hi
            if block.clock != FREE:
                settle(run, pairs, pool, bodies, work, lo, block.tau, elapsed(block.h, block.clock, block.tau))
            run.t, run.tail, run.stride, run.lo, run.hi = block.t, block.tail, block.stride, lo, hi
            if block.fired < 0:
                proved = verdict(run, pairs, pool, bodies, hi) if lo == 0 else NOT_YET
                if proved != NOT_YET and limit == math.inf:
                    return REST if proved == RESTS else BINDING
                if proved == RESTS and is_still(run, pairs, pool, bodies):
                    lie(run, pairs, pool, bodies, hi, bodies[0].v - bodies[hi].v)
                elif not plan(run, pairs, pool, bodies, work, lo, laws):
                    return STOPPED
                play(queue, lo, pairs[lo].due)
                continue
            if not act(run, pairs, pool, bodies, log, block, laws):
                return STOPPED
        outcome = regroup(s, laws)
        run.waits = 1 if outcome == FULL else 0
        if outcome == FULL:
            return CRAMPED
        if outcome == STOP or (run.separated == 1 and run.begun > 0 and all_recede(pairs, run.pairs)):
            return STOPPED
    return MORE


@kernel
def all_recede(pairs: Any, n: int) -> bool:
    """Return whether every pair is open and none approaches."""
    for c in range(n):
        if pairs[c].slot >= 0 or pairs[c].xi > 0.0:
            return False
    t = 0.0
    for c in range(n):
        t = max(t, pairs[c].t)
    for c in range(n):
        if pairs[c].eta + pairs[c].pull * (t - pairs[c].t) > 0.0:
            return False
    return True


@kernel
def launch(s: Any, laws: Any) -> bool:
    """Form the first blocks of a run from pairs that are open or overlap; false if it stops at once."""
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    for c in range(run.pairs):
        pair = pairs[c]
        pair.hi, pair.first, pair.slot, pair.due = c + 1, c, -1, math.inf
        leaf(s.queue, c).due = math.inf
    replay(s.queue, 0, run.pairs - 1)
    for c in range(run.pairs):
        if pairs[c].mode == ACTIVE:
            pairs[c].mode = OPEN
            join(run, pairs, pool, s.kinds, bodies, c)
            if not activate(run, pairs, pool, bodies, c):
                return False
    for c in range(run.pairs):
        if pairs[c].first == c:
            if pairs[c].slot < 0:
                join(run, pairs, pool, s.kinds, bodies, c)
            run.lo, run.hi, run.stride = c, pairs[c].hi, pool[pairs[c].slot].stride
            if regroup(s, laws) == STOP:
                return False
    return True


@kernel
def gather(s: Any, t: float, laws: Any) -> None:
    """Advance every block to time t, the end of the run, with its series from there on."""
    run, pairs, pool = s.run[0], s.pairs, s.pool
    for c in range(run.pairs):
        pair = pairs[c]
        if pair.first == c:
            bring(run, pairs, pool, s.bodies, s.work, c, t, 0.0)
            if pair.slot >= 0 and pool[pair.slot].clock != FREE:
                if pair.due < math.inf:
                    settle_series(run, pairs, pool, c, laws)
                else:
                    stay(pairs, pool, c)


@kernel
def stay(pairs: Any, pool: Any, lo: int) -> None:
    """Let the rows of a pile that lies still, with a wall that may move on, begin now."""
    for c in range(lo, pairs[lo].hi):
        member = pool[pairs[c].slot]
        member.x[0], member.e[0] = member.xi, member.eta


@kernel
def is_begun(s: Any, c: int) -> int:
    """Return 1 if a contact of pair `c` is under way, else 0."""
    slot = s.pairs[c].slot
    return int(s.pool[slot].begun) if slot >= 0 else 0


@kernel
def pause_later(s: Any) -> None:
    """Let the run pause next when it has taken twice as many steps."""
    s.run[0].pause *= 2


@kernel
def clear_log(s: Any) -> None:
    """Empty the log buffer."""
    s.run[0].rows = 0
