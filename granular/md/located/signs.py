"""Events of laws that are functions: the force vanishes or returns where the law itself changes sign.
May be skipped: rarer, laws that are no powers.

An interpolant says where to look, but near ξ = 0, where every force is small, it errs to either side; so the law is
asked, and the place is found by bisection. A pair whose force stays positive up to ξ = 0 parts there and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._roots import first_up_crossing
from granular.md.located.events import shifted
from granular.md.located.pieces import value
from granular.md.located.records import ACTIVE, BEGIN, END, PART, RELOAD, TURN

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
    until = min(parts, span)
    if pair.mode != ACTIVE:
        again = regains(pair, pushes, doubt, until, work)
        return (again, BEGIN) if again < math.inf else (parts, PART)
    end = loses(pair, pushes, doubt, until, parts < math.inf, work)
    if end == math.inf:
        end = pauses(pair, pushes, idles, until, work)
    branch, until = math.inf, min(end, until)
    if pair.memory and pair.loading:
        branch = first_up_crossing(pair.e, until, work, -1.0)
    elif pair.memory:
        branch = shifted(pair.x, -pair.top, until, work, 1.0)
    if branch < math.inf:
        return branch, TURN if pair.loading else RELOAD
    return (end, END) if end < math.inf else (parts, PART)


def loses(pair: Any, pushes: Sign, doubt: float, span: float, parts: bool, work: Any) -> float:
    """Return the first τ up to `span` where the law no longer pushes; inf if it always does.

    Just before the pair `parts` its force is smaller than any doubt; there the law is tried at ever smaller distances.
    """
    before, found = 0.0, shifted(pair.g, doubt, span, work, -1.0)
    if not parts and (found == math.inf or pushes(found)):
        found = span  # a force that is zero from some overlap on never crosses zero
    if found < math.inf and not pushes(found):
        return bisected(pushes, *last_push(pushes, found))
    for j in range(1, LOOKS if parts else 0):
        tau = span * (1.0 - 0.25**j)
        if value(pair.x, tau) > 0.0:
            if not pushes(tau):
                return bisected(pushes, before, tau)
            before = tau
    return math.inf


def pauses(pair: Any, pushes: Sign, idles: Sign, span: float, work: Any) -> float:
    """Return the first τ up to `span` where the law idles for an instant: tried where the overlap is least."""
    least = first_up_crossing(pair.e, span, work) if pair.e[0] < 0.0 else math.inf
    return bisected(pushes, *last_push(pushes, least)) if least < math.inf and idles(least) else math.inf


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


def regains(pair: Any, pushes: Sign, doubt: float, span: float, work: Any) -> float:
    """Return the first τ up to `span` where a clipped law pushes again, beyond rounding; inf if it does not.

    The law is tried at places spread up to where the interpolant says that it pushes; after a kink that may be too
    early, so beyond it too.
    """
    found = shifted(pair.g, -doubt, span, work, 1.0)
    if found == math.inf and not pushes(span, True):
        return math.inf
    found, clipped = min(found, span), math.inf
    for first, last in ((0.0, found), (found, span)):
        for j in range(PARTS + 1):
            tau = last if j == PARTS else first + (last - first) * j / PARTS
            if pushes(tau, True):
                return 0.0 if clipped == math.inf else bisected(lambda at: not pushes(at), clipped, tau)
            if not pushes(tau):
                clipped = tau
    return math.inf


def bisected(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return where what holds at `low` ceases to hold, before `high`."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if holds(middle) else (low, middle)
    return high
