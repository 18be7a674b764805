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
from granular.md.located.around import nth
from granular.md.located.pieces import value
from granular.md.located.records import ACTIVE, BEGIN, DORMANT, ELASTIC, END, LINEAR, NOTHING, OPEN, PART

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
            block.tau, block.fired, block.what = tau, nth(pairs, c), what
            if tau == 0.0:
                return
        if laws is None:
            tau, what = rebound(pair, block.tau, work)
            if tau < block.tau:
                block.tau, block.fired, block.what = tau, nth(pairs, c) if what == PART else -1, what


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
    row, doubt, wake = pair.g, 0.0, 0.0
    if pair.mode == OPEN:
        return first_up_crossing(pair.x, span, work), BEGIN
    if pair.mode == DORMANT:  # pressed enough to wake, or parted; linear ones never sleep
        if pair.kind == LINEAR:
            return math.inf, NOTHING
        row, doubt, wake = pair.x, DOUBT * pair.wake, pair.wake
    elif laws is not None:
        return laws.next_event(pair, span, work)  # type: ignore[no-any-return]
    elif pair.mode == ACTIVE:
        asleep = DOUBT * pair.wake if pair.xi <= pair.wake and pair.kind == LINEAR else 0.0
        if pair.kind == ELASTIC or (pair.kind == LINEAR and pair.gamma == 0.0):
            return shifted(pair.x, asleep, span, work, -1.0), PART
        if pair.kind == LINEAR:
            return shifted(pair.f, pair.k * asleep, span, work, -1.0), END
        return shifted(pair.g, 0.0, span, work, -1.0), END
    parts = shifted(pair.x, doubt, span, work, -1.0)
    again = shifted(row, -wake, min(parts, span), work, 1.0)
    return (again, BEGIN) if again < math.inf else (parts, PART)


@kernel
def shifted(row: Any, by: float, span: float, work: Any, way: float) -> float:
    """Return the first τ where a row, shifted by so much, goes up through zero (`way` 1) or down (-1); inf without."""
    first = row[0]
    row[0] = first + by
    tau: float = first_up_crossing(row, span, work, way)
    row[0] = first
    return tau
