"""Free flight of one gap without contact: time to contact, gap and rate.

The acceleration of the gap is -a, where a (m/s²) is `Scene.closing_acceleration`: g above a floor, 0 between two balls,
-g below a ceiling. Between two pendula it is Ω² (d - gap), where d is the gap at rest. Functions whose names contain
``hung`` are for pendula. `rate` is the rate of change of the gap in m/s, negative while it closes. All formulas avoid
the cancellation of digits.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel


@kernel
def time_to_contact(gap: float, rate: float, a: float) -> float:
    """Return the time in s until a non-negative `gap` closes, or inf.

    With s = √(rate² + 2·a·gap) it is 2·gap/(s - rate) if the gap closes, and (rate + s)/a if it opens. (The textbook
    root (rate + s)/a for both cases would lose half of its digits after every bounce.)
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
    """Return the gap in m after a free flight of `dt` s.

    Rounding can make a closing gap negative, so callers clamp it at 0.
    """
    return gap + rate * dt if a == 0.0 else gap + dt * (rate - 0.5 * a * dt)


@kernel
def rate_at_contact(gap: float, rate: float, a: float) -> float:
    """Return the rate of the gap in m/s, not positive, when it closes.

    It is computed from the current gap and rate, not from the rounded time of contact. If the time of a very low bounce
    rounds to the current time, a rate at this time would be positive.
    """
    if a == 0.0:
        return rate
    square = rate * rate + 2.0 * a * gap
    return -math.sqrt(square) if square > 0.0 else 0.0


@kernel
def hung_time_to_contact(gap: float, rate: float, omega: float, d: float) -> float:
    """Return the time t (s) until a non-negative `gap` between pendula closes, or inf.

    With u = rate/Ω, a = 2d - gap and τ = tan(Ωt/2) the gap closes where aτ² + 2uτ + gap = 0. The form of the root
    without cancellation is used. Formulas with atan2 or acos lose digits for small gaps. If the balls touch at rest
    (d = 0), the angle Ωt is computed directly.
    """
    if d == 0.0 and rate != 0.0:
        angle = math.atan(omega * gap / -rate)
        return (math.pi + angle if rate > 0.0 else angle) * (1.0 / omega)
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
    """Return gap (m) and rate (m/s) between pendula after a free flight of `dt` s.

    With τ, u and a of `hung_time_to_contact` the gap is (gap + 2uτ + aτ²) / (1 + τ²), which needs one tangent
    instead of two sines and a cosine. Rounding can make a closing gap negative, so callers clamp it at 0.
    """
    t = math.tan(0.5 * omega * dt)
    scale = 1.0 / (1.0 + t * t)
    scaled_gap = gap + t * (2.0 * rate / omega + (2.0 * d - gap) * t)
    return scaled_gap * scale, (rate * (1.0 - t * t) + 2.0 * omega * (d - gap) * t) * scale


@kernel
def hung_rate_at_contact(gap: float, rate: float, omega: float, d: float) -> float:
    """Return the rate of a gap between pendula in m/s, not positive, when it closes.

    It is computed from the current gap and rate, not from the rounded time of contact.
    """
    square = rate * rate - omega * omega * (2.0 * d - gap) * gap
    return -math.sqrt(square) if square > 0.0 else 0.0


@kernel
def swing_after(body: Any, omega: float, dt: float) -> tuple[float, float]:
    """Return velocity (m/s) and `fall` (m/s²) of a free pendulum after `dt` s.

    `fall` is the acceleration towards smaller x, Ω² y at the displacement y. `body` has `v` and `fall` at the start.
    """
    cosine, sine = math.cos(omega * dt), math.sin(omega * dt)
    return body.v * cosine - body.fall / omega * sine, body.fall * cosine + body.v * omega * sine
