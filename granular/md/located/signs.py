"""Events of laws that are functions: the force vanishes or returns where the law itself changes sign.

An interpolant says where to look, but near ξ = 0, where every force is small, it errs to either side; so the law is
asked, and the place is found by bisection. A pair whose force stays positive up to ξ = 0 parts there and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._roots import first_up_crossing
from granular.md.located.pieces import value
from granular.md.located.system import ACTIVE, BEGIN, END, PART, RELOAD, TURN

Sign = Callable[..., bool]
"""Whether the law pushes at τ; with a second argument true, surely so, beyond rounding."""
LOOKS = 26
"""Places at which a law is tried before its pair parts, each a quarter as far from there as the last: 4⁻²⁶ = 2⁻⁵²."""
PARTS = 16
"""Places at which a law is tried before its force returns."""


def next_event(pair: Any, pushes: Sign, idles: Sign, doubt: float, span: float, work: Any) -> tuple[float, int]:
    """Return the τ of the first event of a pair that overlaps within [0, span], inf without, and which it is.

    `idles` says whether the force is 0 at a τ and all about; `doubt` in N is that of g.
    """
    parts = first_up_crossing(pair.x, span, work, -1.0)
    tau, what, span = parts, PART, min(parts, span)
    if pair.mode != ACTIVE:
        again = regains(pair, pushes, doubt, span, work)
        return (tau, what) if again is None else (again, BEGIN)
    end = loses(pair, pushes, doubt, span, parts < math.inf, work)
    end = pauses(pair, pushes, idles, span, work) if end is None else end
    if end is not None:
        tau, what, span = end, END, end
    if pair.memory:
        zero = pair.x[0]
        pair.x[0] -= pair.top
        branch = first_up_crossing(pair.e, span, work, -1.0) if pair.loading else first_up_crossing(pair.x, span, work)
        pair.x[0] = zero
        if branch <= span:
            return branch, TURN if pair.loading else RELOAD
    return tau, what


def loses(pair: Any, pushes: Sign, doubt: float, span: float, parts: bool, work: Any) -> float | None:
    """Return the first τ up to `span` where the law no longer pushes; None if it always does.

    Just before the pair `parts` its force is smaller than any doubt; there the law is tried at ever smaller distances.
    """
    before, found = 0.0, crossing(pair, -1.0, doubt, span, work)
    if (found is None or pushes(found)) and not parts:
        found = span  # a force that is zero from some overlap on never crosses zero
    if found is not None and not pushes(found):
        return bisected(pushes, *last_push(pushes, found))
    for j in range(1, LOOKS if parts else 0):
        tau = span * (1.0 - 0.25**j)
        if value(pair.x, tau) > 0.0:
            if not pushes(tau):
                return bisected(pushes, before, tau)
            before = tau
    return None


def pauses(pair: Any, pushes: Sign, idles: Sign, span: float, work: Any) -> float | None:
    """Return the first τ up to `span` where the law idles for an instant: tried where the overlap is least."""
    least = first_up_crossing(pair.e, span, work) if pair.e[0] < 0.0 else math.inf
    return bisected(pushes, *last_push(pushes, least)) if least <= span and idles(least) else None


def last_push(pushes: Sign, tau: float) -> tuple[float, float]:
    """Return an interval that ends at or before `tau` in which the law stops to push; (0, 0) if it never did."""
    low, high = 0.0, tau
    for _ in range(LOOKS):
        if pushes(low):
            return low, high
        high *= 0.25  # a contact that begins has no force at its first instant
        if pushes(high):
            return high, 4.0 * high
    return 0.0, 0.0


def regains(pair: Any, pushes: Sign, doubt: float, span: float, work: Any) -> float | None:
    """Return the first τ up to `span` where a clipped law pushes again, beyond rounding; None if it does not.

    The law is tried at places spread up to where the interpolant says that it pushes; after a kink that may be too
    early, so beyond it too.
    """
    found = crossing(pair, 1.0, doubt, span, work)
    if found is None and not pushes(span, True):
        return None
    found, clipped = span if found is None else found, None
    for first, last in ((0.0, found), (found, span)):
        for j in range(PARTS + 1):
            tau = last if j == PARTS else first + (last - first) * j / PARTS
            if pushes(tau, True):
                return 0.0 if clipped is None else bisected(lambda at: not pushes(at), clipped, tau)
            if not pushes(tau):
                clipped = tau
    return None


def crossing(pair: Any, way: float, doubt: float, span: float, work: Any) -> float | None:
    """Return where the interpolated force is beyond doubt above (`way` 1) or below (-1) zero first; None if nowhere."""
    zero = pair.g[0]
    pair.g[0] = zero - way * doubt
    tau = first_up_crossing(pair.g, span, work, way)
    pair.g[0] = zero
    return tau if tau <= span else None


def bisected(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return where what holds at `low` ceases to hold, before `high`."""
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if holds(middle):
            low = middle
        else:
            high = middle
