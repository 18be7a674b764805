"""Free flight of one gap under constant acceleration: when it closes, and how far it has got.

The gap's acceleration is ``-a``: a = g above a floor, 0 between two balls, -g below a ceiling (`Scene.pull`).
`rate` is the gap's rate of change, negative when closing. Forms are chosen so that no digits cancel.
"""

from __future__ import annotations

import math

from granular._kernels import kernel


@kernel
def time_to_contact(gap: float, rate: float, a: float) -> float:
    """Return the time until a non-negative `gap` closes, inf if it never does.

    With s = √(rate² + 2·a·gap): 2·gap/(s - rate) while closing, (rate + s)/a while opening. (The textbook root
    -(rate - s)/a without branches loses half its digits after every bounce.)
    """
    if a == 0.0:
        return gap / -rate if rate < 0.0 else math.inf
    if a > 0.0:
        s = math.sqrt(rate * rate + 2.0 * a * gap)
        if rate > 0.0:
            return (rate + s) / a
        return 2.0 * gap / (s - rate) if s > 0.0 else math.inf  # gap = rate = 0: at rest on the wall
    square = rate * rate + 2.0 * a * gap
    if rate >= 0.0 or square < 0.0:
        return math.inf
    return 2.0 * gap / (math.sqrt(square) - rate)


@kernel
def gap_after(gap: float, rate: float, a: float, dt: float) -> float:
    """Return the gap after a flight of `dt`; rounding may make a closing gap negative, so callers clamp at 0."""
    return gap + rate * dt if a == 0.0 else gap + dt * (rate - 0.5 * a * dt)


@kernel
def rate_at_contact(gap: float, rate: float, a: float) -> float:
    """Return the (negative) rate with which the gap closes, from the state and not from the rounded time.

    A bounce so low that the time of the next one rounds to the current one would otherwise seem to recede.
    """
    if a == 0.0:
        return rate
    square = rate * rate + 2.0 * a * gap
    return -math.sqrt(square) if square > 0.0 else 0.0
