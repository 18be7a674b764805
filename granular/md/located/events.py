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

from typing import Any

from granular._kernels import kernel
from granular._roots import first_up_crossing
from granular.md.located.piece import value
from granular.md.located.records import ACTIVE, DORMANT, ELASTIC, LINEAR, OPEN

DOUBT = 1e4
"""A pair at rest is taken to part at so many times the overlap at which it wakes: the first forces beside it, far below
rounding, may err to either side."""
ALL_BUT = 0.1
"""Part of its overlap at which a pair that turns round had all but parted."""
GRAZE = 1e-15
"""Part of the typical overlap at which it has parted, but for rounding."""
NOTHING, BEGIN, END, PART, TURN, RELOAD = range(6)


@kernel
def locate(pairs: Any, pool: Any, lo: int, hi: int, span: float, work: Any) -> None:
    """Find the event that ends the piece of block lo … hi-1 on τ in [0, span]; it ends at `span` if there is none."""
    block = pool[pairs[lo].slot]
    block.tau, block.fired, block.what = span, -1, NOTHING
    for c in range(lo, hi):
        tau, what = next_event(pool[pairs[c].slot], block.tau, work)
        if tau <= block.tau and what != NOTHING:
            block.tau, block.fired, block.what = tau, c, what
            if tau == 0.0:
                return
        tau, what = rebound(pool[pairs[c].slot], block.tau, work)
        if tau < block.tau:
            block.tau, block.fired, block.what = tau, c if what == PART else -1, what


@kernel
def rebound(pair: Any, span: float, work: Any) -> tuple[float, int]:
    """Return the τ at which a pair that all but parts turns round, or parts by rounding; `span` if it does neither.

    There its series has to end: a ball that falls from a touch at rest comes back to it with ξ = g (t - t0)²/2, and
    ξ^1.5 ∝ |t - t0|³ goes on as (t - t0)³, with no sign of it in the coefficients.
    """
    if pair.mode != ACTIVE or pair.kind == LINEAR or not (pair.e[0] < 0.0 < value(pair.e, span)):
        return span, NOTHING
    tau = first_up_crossing(pair.e, span, work)
    if tau >= span:
        return span, NOTHING
    least = value(pair.x, tau)
    if least <= GRAZE * pair.own_length:
        return tau, PART
    return (tau, NOTHING) if least < ALL_BUT * pair.x[0] else (span, NOTHING)


@kernel
def next_event(pair: Any, span: float, work: Any) -> tuple[float, int]:
    """Return the τ of the first event of a pair within [0, span], and which it is."""
    if pair.mode == OPEN:
        return named(first_up_crossing(pair.x, span, work), span, BEGIN)
    if pair.mode == ACTIVE:
        asleep = DOUBT * pair.wake if pair.xi <= pair.wake and pair.kind == LINEAR else 0.0
        if pair.kind == ELASTIC or (pair.kind == LINEAR and pair.gamma == 0.0):
            return named(falls(pair.x, asleep, span, work), span, PART)
        if pair.kind == LINEAR:
            return named(falls(pair.f, pair.k * asleep, span, work), span, END)
        return named(falls(pair.g, 0.0, span, work), span, END)
    if pair.mode == DORMANT:
        return next_of_dormant(pair, span, work)
    tau, what = named(first_up_crossing(pair.x, span, work, -1.0), span, PART)
    again, begin = named(first_up_crossing(pair.g, tau, work), tau, BEGIN)
    return (again, begin) if begin == BEGIN else (tau, what)


@kernel
def next_of_dormant(pair: Any, span: float, work: Any) -> tuple[float, int]:
    """Return when a pair that touches at rest has been pressed enough to wake, or parts. (Linear ones never sleep.)"""
    if pair.kind == LINEAR:
        return span, NOTHING
    xi = pair.x[0]
    tau, what = named(falls(pair.x, DOUBT * pair.wake, span, work), span, PART)
    pair.x[0] = xi - pair.wake
    again, begin = named(first_up_crossing(pair.x, tau, work), tau, BEGIN)
    pair.x[0] = xi
    return (again, begin) if begin == BEGIN else (tau, what)


@kernel
def falls(row: Any, margin: float, span: float, work: Any) -> float:
    """Return the first τ where a row, its sign in doubt by `margin`, goes from positive to negative."""
    first = row[0]
    row[0] = first + margin
    tau: float = first_up_crossing(row, span, work, -1.0)
    row[0] = first
    return tau


@kernel
def named(tau: float, span: float, what: int) -> tuple[float, int]:
    """Return the event if it lies within the piece."""
    if tau <= span:
        return tau, what
    return span, NOTHING
