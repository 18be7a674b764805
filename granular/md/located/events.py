"""Events of a pair: which of them comes first within a piece, located as the first root of a polynomial.

| mode     | event                                  | goes through zero |
|----------|----------------------------------------|-------------------|
| open     | BEGIN, the balls touch                 | ξ upwards         |
| active   | END, the force falls to zero           | φ downwards       |
|          | PART (elastic), the balls part         | ξ downwards       |
| residual | BEGIN, the force rises again           | φ upwards         |
|          | PART, the balls part                   | ξ downwards       |
| active, with memory | TURN, unloading begins | ξ̇ downwards |
|          | RELOAD, the old maximum is passed      | ξ - top upwards   |
| dormant  | BEGIN, the force is no longer rounding | ξ - wake upwards  |
|          | PART, the balls part                   | ξ downwards       |
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular._roots import first_up_crossing
from granular.md.located.pieces import value
from granular.md.located.system import ACTIVE, BEGIN, DORMANT, ELASTIC, END, LINEAR, NOTHING, OPEN, PART

DOUBT = 1e4
"""A pair at rest is taken to part at so many times the overlap at which it wakes: the first forces beside it, far below
rounding, may err to either side."""
ALL_BUT = 0.1
"""Part of its overlap at which a pair that turns round had all but parted."""
GRAZE = 1e-15
"""Part of the typical overlap at which it has parted, except for rounding."""


@kernel
def locate(pairs: Any, pool: Any, lo: int, hi: int, span: float, work: Any, laws: Any) -> None:
    """Find the event that ends the piece of block lo … hi-1 on τ in [0, span]; it ends at `span` if there is none."""
    block = pool[pairs[lo].slot]
    block.tau, block.fired, block.what = span, -1, NOTHING
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        tau, what = next_event(pair, block.tau, work, laws)
        if tau <= block.tau:
            block.tau, block.fired, block.what = tau, c, what
            if tau == 0.0:
                return
        if laws is None:
            tau, what = rebound(pair, block.tau, work)
            if tau < block.tau:
                block.tau, block.fired, block.what = tau, c if what == PART else -1, what


@kernel
def rebound(pair: Any, span: float, work: Any) -> tuple[float, int]:
    """Return the τ at which a pair that all but parts turns round, or parts by rounding; inf if it does neither.

    There its series has to end: a ball that falls from a touch at rest comes back to it with ξ = g (t - t0)²/2, and
    ξ^1.5 ∝ |t - t0|³ goes on as (t - t0)³, with no sign of it in the coefficients.
    """
    if pair.mode != ACTIVE or pair.kind == LINEAR or not (pair.e[0] < 0.0 < value(pair.e, span)):
        return math.inf, NOTHING
    tau = first_up_crossing(pair.e, span, work)
    least = value(pair.x, min(tau, span))
    if least <= GRAZE * pair.own_length:
        return tau, PART
    return (tau, NOTHING) if least < ALL_BUT * pair.x[0] else (math.inf, NOTHING)


@kernel
def next_event(pair: Any, span: float, work: Any, laws: Any) -> tuple[float, int]:
    """Return the τ of the first event of a pair within [0, span], inf without, and which it is."""
    if pair.mode == OPEN:
        return first_up_crossing(pair.x, span, work), BEGIN
    if pair.mode == DORMANT:
        return next_of_dormant(pair, span, work)
    if laws is not None:
        return laws.next_event(pair, span, work)  # type: ignore[no-any-return]
    if pair.mode == ACTIVE:
        asleep = DOUBT * pair.wake if pair.xi <= pair.wake and pair.kind == LINEAR else 0.0
        if pair.kind == ELASTIC or (pair.kind == LINEAR and pair.gamma == 0.0):
            return falls(pair.x, asleep, span, work), PART
        if pair.kind == LINEAR:
            return falls(pair.f, pair.k * asleep, span, work), END
        return falls(pair.g, 0.0, span, work), END
    return first_of(first_up_crossing(pair.x, span, work, -1.0), pair.g, span, work)


@kernel
def next_of_dormant(pair: Any, span: float, work: Any) -> tuple[float, int]:
    """Return when a pair that touches at rest has been pressed enough to wake, or parts. (Linear ones never sleep.)"""
    if pair.kind == LINEAR:
        return math.inf, NOTHING
    xi, parts = pair.x[0], falls(pair.x, DOUBT * pair.wake, span, work)
    pair.x[0] = xi - pair.wake
    first = first_of(parts, pair.x, span, work)
    pair.x[0] = xi
    return first


@kernel
def first_of(parts: float, row: Any, span: float, work: Any) -> tuple[float, int]:
    """Return whether a pair parts first, at a τ `parts`, or a row rises above zero and its force returns."""
    again = first_up_crossing(row, min(parts, span), work)
    return (again, BEGIN) if again < math.inf else (parts, PART)


@kernel
def falls(row: Any, margin: float, span: float, work: Any) -> float:
    """Return the first τ where a row, its sign in doubt by `margin`, goes from positive to negative."""
    first = row[0]
    row[0] = first + margin
    tau: float = first_up_crossing(row, span, work, -1.0)
    row[0] = first
    return tau
