"""Free flight of one gap: time to contact, gap and rate.

The acceleration of the gap is ``-a``: a = g above a floor, 0 between two balls, -g below a ceiling (`Scene.pull`).
Between two pendula with the gap d at rest it is Ω² (d - gap). These flights are called hung. `rate` is the rate of
change of the gap in m/s, negative while it closes. All formulas avoid the cancellation of digits.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel


@kernel
def time_to_contact(gap: float, rate: float, a: float) -> float:
    """Return the time in s until a non-negative `gap` closes, or inf.

    With s = √(rate² + 2·a·gap) it is 2·gap/(s - rate) while closing, and (rate + s)/a while opening. (The textbook root
    -(rate - s)/a without cases loses half of its digits after every bounce.)
    """
    if a == 0.0:
        return gap / -rate if rate < 0.0 else math.inf
    if a > 0.0:
        s = math.sqrt(rate * rate + 2.0 * a * gap)
        if rate > 0.0:
            return (rate + s) / a
        return 2.0 * gap / (s - rate) if s > 0.0 else math.inf  # gap = rate = 0: the ball rests on the wall
    square = rate * rate + 2.0 * a * gap
    if rate >= 0.0 or square < 0.0:  # opening, or the apex is below contact
        return math.inf
    return 2.0 * gap / (math.sqrt(square) - rate)


@kernel
def gap_after(gap: float, rate: float, a: float, dt: float) -> float:
    """Return the gap in m after a flight of `dt` s.

    Rounding can make a closing gap negative, so that callers clamp it at 0.
    """
    return gap + rate * dt if a == 0.0 else gap + dt * (rate - 0.5 * a * dt)


@kernel
def rate_at_contact(gap: float, rate: float, a: float) -> float:
    """Return the (negative) rate in m/s with which the gap closes.

    It follows from the state, not from the rounded time. Otherwise a bounce so low that its time rounds to the current
    time would seem to recede.
    """
    if a == 0.0:
        return rate
    square = rate * rate + 2.0 * a * gap
    return -math.sqrt(square) if square > 0.0 else 0.0


@kernel
def hung(gap: float, rate: float, omega: float, d: float) -> float:
    """Return the time in s until a non-negative `gap` between pendula closes, or inf.

    With u = rate/Ω, a = 2d - gap and τ = tan(Ωt/2) the gap closes where aτ² + 2uτ + gap = 0. The root without
    cancellation is used, whereas atan2 and acos would cancel for small gaps. For balls that touch at rest, d = 0, the
    angle is Ωt.
    """
    if d == 0.0 and rate != 0.0:
        turn = math.atan(omega * gap / -rate)
        return (math.pi + turn if rate > 0.0 else turn) * (1.0 / omega)
    u, a = rate / omega, 2.0 * d - gap
    square = u * u - a * gap
    if not square > 0.0:
        return math.inf
    s = math.sqrt(square)
    if u <= 0.0:
        return 2.0 / omega * math.atan(gap / (s - u))
    if a < 0.0:
        return 2.0 / omega * math.atan((u + s) / -a)
    return 2.0 / omega * (math.pi - math.atan((u + s) / a)) if a > 0.0 else math.pi / omega


@kernel
def hung_after(gap: float, rate: float, omega: float, d: float, dt: float) -> tuple[float, float]:
    """Return gap and rate after a flight of `dt` s between pendula.

    With τ, u and a of `hung` the gap is (gap + 2uτ + aτ²) / (1 + τ²), which takes one tangent instead of two sines and
    a cosine. Rounding can make a closing gap negative, so that callers clamp it at 0.
    """
    t = math.tan(0.5 * omega * dt)
    share = 1.0 / (1.0 + t * t)
    after = gap + t * (2.0 * rate / omega + (2.0 * d - gap) * t)
    return after * share, (rate * (1.0 - t * t) + 2.0 * omega * (d - gap) * t) * share


@kernel
def hung_rate_at_contact(gap: float, rate: float, omega: float, d: float) -> float:
    """Return the (negative) rate with which a gap between pendula closes.

    It follows from the state, not from the rounded time.
    """
    square = rate * rate - omega * omega * (2.0 * d - gap) * gap
    return -math.sqrt(square) if square > 0.0 else 0.0


@kernel
def swung(body: Any, omega: float, dt: float) -> tuple[float, float]:
    """Return velocity and `fall` of a pendulum after a free swing of `dt` s."""
    cosine, sine = math.cos(omega * dt), math.sin(omega * dt)
    return body.v * cosine - body.fall / omega * sine, body.fall * cosine + body.v * omega * sine
