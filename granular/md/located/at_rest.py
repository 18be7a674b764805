"""What a block does that may be at rest: whether that is proved, and its piece where it lies still or creeps.
May be skipped: rarer, piles that come to rest.

The event loop stops for it (`WANTS_LOOK`), so that what is here is compiled only where it is wanted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel, worth
from granular._tournament import play
from granular.md.located.equilibrium import NOT_YET, RESTS
from granular.md.located.events import locate
from granular.md.located.overdamped import expand_slowly
from granular.md.located.pieces import piece_time
from granular.md.located.plan import planned, settle_series
from granular.md.located.records import ASKS, BINDING, CREEPS, LIES, LONG, LOOKED, MOVES, REST, STOPPED, WANTS_LOOK
from granular.md.located.resting import lie, settles, verdict, whole_verdict
from granular.md.located.step_size import growth, left_out, trusted
from granular.md.located.system import readable

LOOKS = 20, 1500
"""Looks at blocks that may rest or creep, of some milliseconds each, after which machine code pays for them too."""


@kernel
def look_at(s: Any, limit: float) -> int:
    """Return what is proved of the scene if that ends a run up to time `limit`: RESTS, BOUND; else NOT_YET.

    It is about the block under way. Its next piece is written, or it is to be planned.
    """
    run, pairs, pool, bodies, lo = s.run[0], s.pairs, s.pool, s.bodies, s.run[0].lo
    block = pool[pairs[lo].slot]
    if block.manner != ASKS:
        proved = RESTS if run.rests == 1 else verdict(pairs, pool, bodies, lo)
        if proved != NOT_YET and run.rests == 0:
            whole = whole_verdict(run, pairs, pool, bodies)
            if whole != NOT_YET and limit == math.inf:
                return whole
        if proved == RESTS and block.manner != LIES:
            settles(pairs, pool, bodies, lo)
        run.steps += 1
    if block.manner != LIES:
        block.manner = CREEPS if expand_slowly(pairs, pool, bodies, lo) else LOOKED
    pairs[lo].due = -math.inf
    if block.manner != LOOKED:
        write_piece(s, lo)
    play(s.queue, lo, pairs[lo].due)
    return NOT_YET


@kernel
def write_piece(s: Any, lo: int) -> None:
    """Write the piece of a block that lies still, or has been found to creep, and where it ends."""
    run, pairs, pool, worst, span = s.run[0], s.pairs, s.pool, -math.inf, 1.0
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    block.linear, block.clock = 1 if block.manner == LIES else 0, 1
    if block.manner == LIES:
        lie(pairs, pool, s.bodies, lo)
    else:
        worst = growth(pairs, pool, lo, hi, run.tol)
        span = trusted(worst, run.tol)
    locate(pairs, pool, lo, hi, span, s.work, None)
    run.error += left_out(worst, block.tau)
    pairs[lo].due = block.t + (piece_time(block) + block.tail)
    if block.h >= LONG:
        pairs[lo].due = math.inf


@kernel
def first_asking(s: Any) -> bool:
    """Let the first block that asks whether it creeps be the one under way; false if none does."""
    for c in range(len(s.pairs)):
        pair = s.pairs[c]
        if pair.first == c and pair.slot >= 0 and s.pool[pair.slot].manner == ASKS:
            s.run[0].lo = c
            return True
    return False


@kernel
def gather_slowly(s: Any) -> None:
    """Give all blocks that lie still or creep their series from where they are, at the end of the run."""
    run, pairs, pool = s.run[0], s.pairs, s.pool
    for c in range(len(pairs)):
        pair = pairs[c]
        if pair.first == c and pair.slot >= 0 and pair.due < math.inf and pool[pair.slot].h > 0.0:
            block = pool[pair.slot]
            if block.manner == LIES:
                lie(pairs, pool, s.bodies, c)
            elif block.manner == CREEPS and not expand_slowly(pairs, pool, s.bodies, c):
                block.manner = MOVES
                settle_series(run, pairs, pool, c, None, s.walls, math.inf)


def looked_at(s: Any, limit: float, kernels: Any, seldom: Any) -> int:
    """Look at the block under way, by `kernels` and by those that are called `seldom`; return why a run up to time
    `limit` ends, or WANTS_LOOK if it goes on."""
    found = seldom(look_at)(s, limit)
    if found != NOT_YET:
        return REST if found == RESTS else BINDING
    return WANTS_LOOK if kernels(planned)(s, None) else STOPPED


def seldom(kernel: Any, looks: int, kernels: Any) -> Any:
    """Return a kernel of a compiled run that is called seldom: interpreted, until after so many `looks` machine code,
    which `kernels` makes, pays."""
    if worth(kernel, looks, *LOOKS):
        return kernels(kernel)
    return lambda s, *more: kernel(readable(s), *more)
