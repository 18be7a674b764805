"""What an island does at the start of a piece: the next piece is computed, and where it ends.

`laws` is None when every law is a power form; else it is the `Collocation` that knows them, and the run is interpreted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import entry, inlined, kernel
from granular._tournament import play
from granular.md.located.alone import goes_on, has_piece
from granular.md.located.contacts import confirm
from granular.md.located.driven import foresee_walls
from granular.md.located.events import locate
from granular.md.located.near_rest import may_creep
from granular.md.located.pieces import piece_time, power
from granular.md.located.records import ASKS, DRIVEN, EDGE, HUNG, LONG, LOOKED, MOVES, NOTHING, RING
from granular.md.located.series import expand, expand_linear, expand_two
from granular.md.located.step_size import (
    REACH,
    choose_clock,
    fastest_rate,
    growth,
    left_out,
    measure,
    run_off_time,
    scale,
    trusted,
)
from granular.md.located.touching import judge


@entry
@kernel
def planned(s: Any, laws: Any) -> bool:
    """Plan all that waits for it, once in the code: a contact followed alone, piece after piece, or blocks formed anew,
    due at -inf; false if the run is to stop at once."""
    run, pairs, stays = s.run[0], s.pairs, True
    while True:
        if run.alone >= 0 and not has_piece(s, laws):
            run.alone = -1
        lo = run.alone
        if lo < 0:
            if s.queue[1].due > -math.inf:
                return stays
            lo = s.queue[1].key
        goes = plan(run, pairs, s.pool, s.bodies, s.work, lo, laws, s.walls)
        if run.alone < 0:
            stays = stays and goes
            play(s.queue, lo, pairs[lo].due)
        elif not goes_on(s, laws):
            run.alone = -1


@inlined
@kernel
def plan(run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, laws: Any, walls: Any) -> bool:
    """Compute the next piece of the island that starts with `lo`, and its end; false if the run is to stop at once."""
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    worst, span = -math.inf, 1.0
    if block.manner == LOOKED:  # and it does not creep
        block.manner = MOVES
    else:
        run.steps += 1
        if not (HUNG or RING) and laws is None and run.alone < 0 and may_creep(pairs, pool, bodies, lo):
            wait(pairs, pool, lo)
            return True
    reach = foresee_walls(walls, pairs, pool, lo) if DRIVEN else math.inf
    fastest = fastest_rate(pairs, pool, lo, hi, walls.square if HUNG else 0.0)
    block.linear, block.clock = 1 if fastest >= 0.0 else 0, 1
    if block.linear == 1:
        if DRIVEN and fastest == 0.0 and reach == math.inf:
            reach = run_off_time(pairs, pool, lo, hi)
        block.h = REACH / fastest if fastest * reach > REACH else reach
    else:
        measure(pairs, pool, lo, hi)
        block.clock = choose_clock(pairs, pool, lo, hi, run.tol)
        block.h = scale(pairs, pool, lo, hi)
        if DRIVEN:
            block.h = min(block.h, power(reach, 1.0 / block.clock))
    settle_series(run, pairs, pool, lo, laws, walls, reach)
    if block.linear == 0 and laws is None:
        worst = growth(pairs, pool, lo, hi, run.tol)
        span = trusted(worst, run.tol)
        if block.clock == 1:
            block.stride = block.h * span
    last = math.inf
    if DRIVEN and reach < math.inf:
        last = power(reach, 1.0 / block.clock) / block.h
        span = min(span, last)
    if not confirm(run, pairs, pool, bodies, lo, hi):
        block.fired, block.what, block.tau = -1, NOTHING, 0.0  # to be planned anew, if it goes on
        pairs[lo].due = block.t + block.tail
        return False
    locate(pairs, pool, lo, hi, span, work, laws)
    run.error += left_out(worst, block.tau)
    if DRIVEN and block.tau == last and block.fired < 0 and block.what == NOTHING and reach == block.holds:
        block.what = EDGE
    pairs[lo].due = block.t + (piece_time(block) + block.tail)
    if block.h >= LONG:  # it lies still
        pairs[lo].due = math.inf
    return True


@kernel
def wait(pairs: Any, pool: Any, lo: int) -> None:
    """Let a block be due at once, without a piece: it is to be looked at whether it creeps."""
    block = pool[pairs[lo].slot]
    block.manner, block.fired, block.what, block.tau = ASKS, -1, NOTHING, 0.0
    pairs[lo].due = block.t + block.tail
    for c in range(lo, pairs[lo].hi):
        member = pool[pairs[c].slot]
        member.x[0], member.e[0] = member.xi, member.eta


@kernel
def settle_series(run: Any, pairs: Any, pool: Any, lo: int, laws: Any, walls: Any, reach: float) -> None:
    """Compute the series; where pairs touch at rest, until it agrees with who is taken to push. `reach` and the paths
    of driven walls are those of `foresee_walls`."""
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    for _ in range(2 * (hi - lo) + 2):
        if laws is not None:
            run.error += laws.fill(pairs, pool, lo, run.tol, walls, reach)
        elif block.linear == 1 and hi == lo + 2 and reach == math.inf and not (HUNG or RING):
            expand_two(block, pool[pairs[lo + 1].slot], block.h)
        elif block.linear == 1:
            expand_linear(pairs, pool, lo, hi, block.h, 1, walls)
        else:
            expand(pairs, pool, lo, hi, block.h, block.clock, walls)
        if not judge(pairs, pool, lo, hi):
            break
