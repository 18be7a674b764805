"""The event loop: take the block that is due first, advance it, let its event happen, form blocks anew."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular._tournament import play
from granular.md.located.islands import bring, finish_piece, go_on, regroup
from granular.md.located.modes import act, activate
from granular.md.located.plan import settle_series
from granular.md.located.records import ACTIVE, FREE, OPEN
from granular.md.located.resting import NOT_YET, RESTS, is_still, lie, verdict

REACHED, MORE, STOPPED, QUIET, WORK, REST, BINDING = range(7)
"""Why `advance` returned: time limit, pause or log full, stop condition, nothing can follow, work limit,
every ball rests for good, every ball is bound in contact for ever."""


@kernel
def advance(s: Any, limit: float, chunk: int, laws: Any) -> int:
    """Work off what is due up to time `limit`, at most `chunk` pieces."""
    run, pairs, bodies, queue, log, work = s.run[0], s.pairs, s.bodies, s.queue, s.log, s.work
    for _ in range(chunk):
        lo = queue[1].key
        block = pairs[lo]
        if block.due > limit:
            return REACHED
        if block.due == math.inf:
            return QUIET
        if run.begun >= run.max_events or run.steps >= run.max_steps:
            return WORK
        if run.rows >= len(log) or run.steps >= run.pause:
            return MORE
        finish_piece(run, pairs, bodies, work, lo)
        run.t = block.t
        if block.fired >= 0 and not act(run, pairs, bodies, log, block.fired, block.what, block, laws):
            return STOPPED
        if block.fired < 0:
            proved = verdict(run, pairs, bodies, block.hi) if lo == 0 else NOT_YET
            if proved != NOT_YET and limit == math.inf:
                return REST if proved == RESTS else BINDING
            if proved == RESTS and is_still(pairs, run.piled):
                lie(pairs, run.piled, block.hi, bodies[0].v - bodies[block.hi].v)
                play(queue, lo, pairs[lo].due)
            elif not go_on(run, pairs, bodies, queue, work, lo, laws):
                return STOPPED
        elif not regroup(run, pairs, bodies, queue, work, lo, laws):
            return STOPPED
        if run.separated == 1 and run.begun > 0 and all_recede(pairs, run.pairs):
            return STOPPED
    return MORE


@kernel
def all_recede(pairs: Any, n: int) -> bool:
    """Return whether every pair is open and none approaches."""
    c = 0
    while c < n:
        if pairs[c].clock != FREE or pairs[c].xi > 0.0:
            return False
        c = pairs[c].hi
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
    run, pairs, bodies = s.run[0], s.pairs, s.bodies
    n = run.pairs
    for c in range(n):
        pair = pairs[c]
        pair.hi, pair.first, pair.clock, pair.due = c + 1, c, FREE, math.inf
        play(s.queue, c, pairs[c].due)
    for c in range(n):
        pair = pairs[c]
        if pair.mode == ACTIVE:
            pair.mode = OPEN
            if not activate(run, pairs, bodies, c, pair):
                return False
    for c in range(n):
        if pairs[c].first == c and not regroup(run, pairs, bodies, s.queue, s.work, c, laws):
            return False
    return True


@kernel
def gather(s: Any, t: float, laws: Any) -> None:
    """Advance every block to time t, the end of the run, with its series from there on."""
    c = 0
    while c < s.run[0].pairs:
        block = s.pairs[c]
        bring(s.run[0], s.pairs, s.bodies, s.work, c, t, 0.0)
        if block.clock != FREE and block.due < math.inf:
            settle_series(s.pairs, c, block.hi, laws, s.run[0])
        c = block.hi


@kernel
def pause_later(s: Any) -> None:
    """Let the run pause next when it has taken twice as many steps."""
    s.run[0].pause *= 2


@kernel
def clear_log(s: Any) -> None:
    """Empty the log buffer."""
    s.run[0].rows = 0
