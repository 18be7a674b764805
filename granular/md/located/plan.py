"""Computing the next piece of an island: its clock, its series, how far they hold, and the event that ends it.

`laws` is None when every law is a power form; else it is the `Collocation` that knows them, and the run is
interpreted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.clock import elapsed
from granular.md.located.events import locate
from granular.md.located.linear import expand_linear
from granular.md.located.modes import confirm, judge
from granular.md.located.resting import LONG
from granular.md.located.series import expand
from granular.md.located.steps import (
    REACH,
    choose_clock,
    fastest_rate,
    growth,
    is_linear,
    left_out,
    measure,
    scale,
    trusted,
    within_range,
)


@kernel
def plan(run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, laws: Any) -> bool:
    """Compute the next piece of the island that starts with `lo`, and its end; false if the run is to stop at once."""
    block, hi, worst = pool[pairs[lo].slot], pairs[lo].hi, -math.inf
    run.steps += 1
    if is_linear(pairs, pool, lo, hi):
        block.clock, block.h, block.linear, span = 1, REACH / fastest_rate(pairs, pool, lo, hi), 1, 1.0
        settle_series(run, pairs, pool, lo, laws)
    else:
        measure(pairs, pool, lo, hi)
        block.clock, block.linear = choose_clock(pairs, pool, lo, hi), 0
        block.h = scale(block, block.clock)
        if block.clock == 1 and laws is None:
            block.h = within_range(pairs, pool, lo, hi, block.h)
        settle_series(run, pairs, pool, lo, laws)
        span = 1.0
        if laws is None:
            worst = growth(pairs, pool, lo, hi, run.tol)
            span = trusted(worst, run.tol)
            if block.clock == 1:
                block.stride = block.h * span
    if not confirm(run, pairs, pool, bodies, lo, hi):
        return False
    if laws is None:
        locate(pairs, pool, lo, hi, span, work)
    else:
        laws.locate(pairs, pool, lo, work)
    run.error += left_out(worst, block.tau)
    block.wait = elapsed(block.h, block.clock, block.tau)
    pairs[lo].due = block.t + (block.wait + block.tail)
    if block.h >= LONG:  # it lies still
        pairs[lo].due = math.inf
        if lo == 0 and hi == run.pairs:
            run.rests = 1
    return True


@kernel
def settle_series(run: Any, pairs: Any, pool: Any, lo: int, laws: Any) -> None:
    """Compute the series; where pairs touch at rest, until it agrees with who is taken to push."""
    block, hi = pool[pairs[lo].slot], pairs[lo].hi
    for _ in range(2 * (hi - lo) + 2):
        if laws is not None:
            run.error += laws.fill(pairs, pool, lo, run.tol)
        elif block.linear == 1:
            expand_linear(pairs, pool, lo, hi, block.h)
        else:
            expand(pairs, pool, lo, hi, block.h, block.clock)
        if not judge(pairs, pool, lo, hi):
            break
