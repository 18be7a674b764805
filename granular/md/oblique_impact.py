"""Oblique impact of two frictionless spheres, integrated in its plane.

With the distance r of the centres, l = R₁ + R₂, the overlap ξ = l - r and the tangential speed v_t at first touch:
m_eff ξ̈ = -max(0, F(ξ, ξ̇)) - m_eff (l v_t)²/r³. The line of centres turns at the rate l v_t/r². The contact ends when F
returns to 0. Scipy's DOP853 integrates elastic forces, damped forces and forces with memory, first to the largest
overlap and then to the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine import signature
from granular._engine.check import Array
from granular.laws.contact_law import PairLaw, no_number

RELATIVE_TOLERANCE = 1e-13
"""Tolerance of DOP853 relative to the scale of each variable."""
STEPS_PER_PHASE = 8
"""Minimum number of steps of approach, and of separation.

Longer steps could miss the end of a short contact.
"""
LONGEST_DURATION = 1e3
"""Maximum duration of a contact, in durations of the head-on impact."""


@signature.face
@dataclass(frozen=True)
class Oblique:
    """Result of an oblique impact.

    Hard spheres have `rotation` = 0 and `tangential` = 1.

    Attributes
    ----------
    rotation : float
        Angle α in rad by which the line of centres turns during the contact.
    duration : float
        Time in s from the first touch to the end of the force.
    restitution : float
        ε_n = -(v'·n₀)/(v·n₀), with the relative velocities v before and v' after the contact, and the unit vector n₀
        along the line of centres at first touch. It can be negative.
    tangential : float
        ε_t = (v'·t₀)/(v·t₀), with the unit tangent t₀ at first touch. For a head-on impact it is the limit for small
        tangential speeds.
    radial : float
        Separation speed along the line of centres at the end of the contact, over the normal speed at first touch.
    deviation : float
        |v' - v'_hard|/|v|, where v'_hard is the velocity after a hard collision with the restitution of the head-on
        impact at the same normal speed.
    estimate : float
        Estimate (2 v_t/(ω l)) atan(ω l v_n/v_t²) of `rotation` in rad. v_n and v_t are the normal and tangential speed
        in m/s at first touch, l = R₁ + R₂ in m, and ω = π/t_c with the duration t_c in s of the head-on impact. It is
        valid for undamped springs and small overlaps.
    xi_max : float
        Largest overlap in m.
    """

    rotation: float
    duration: float
    restitution: float
    tangential: float
    radial: float
    deviation: float
    estimate: float
    xi_max: float


def oblique_impact(law: PairLaw, hit: Any, distance: float, normal: float, tangential: float) -> Oblique:
    """Compute an oblique impact from its head-on impact.

    Parameters
    ----------
    law : PairLaw
        Law of the pair.
    hit : Collision
        Head-on impact at the same normal speed.
    distance : float
        R₁ + R₂ in m.
    normal, tangential : float
        Normal and tangential speed in m/s at first touch.
    """
    omega = math.pi / hit.duration
    estimate = 2.0 * tangential / (omega * distance) * math.atan2(omega * distance * normal, tangential * tangential)
    expected = estimate * distance / tangential if tangential > 0.0 else hit.duration
    units = hit.xi_max, normal, hit.duration / distance
    approach = _phase(law, (0.0, 0.0, normal, 0.0), distance * tangential, distance, units, expected, None)
    deepest = float(approach[1])
    end = _phase(law, approach, distance * tangential, distance, units, expected, deepest)
    time, xi, rate, swept = map(float, end)
    angle, turned = tangential * swept, tangential * distance / (distance - xi)
    normal_after = rate * math.cos(angle) + turned * math.sin(angle)
    # sin(α)/v_t, which has a limit for a head-on impact
    tangential_ratio = distance / (distance - xi) * math.cos(angle) - rate * swept * float(np.sinc(angle / math.pi))
    hard_error = normal_after + hit.restitution * normal, tangential * (tangential_ratio - 1.0)
    return Oblique(angle, time, -normal_after / normal, tangential_ratio, -rate / normal,
                   math.hypot(*hard_error) / math.hypot(normal, tangential), estimate, deepest)


def _phase(law: PairLaw, start: Any, spin: float, distance: float, units: tuple[float, ...], expected: float,
           deepest: float | None) -> Array:
    """Integrate to the largest overlap, or from there to the end of the force.

    The state is time in s, overlap in m, its rate in m/s, and ∫ l/r² dt in s/m.

    Parameters
    ----------
    start : sequence of float
        Initial state, including the time.
    spin : float
        l v_t in m²/s, the angular momentum per effective mass.
    distance : float
        R₁ + R₂ in m.
    units : tuple of float
        Scales of the overlap in m, its rate in m/s, and ∫ l/r² dt in s/m.
    expected : float
        Estimated duration in s of the contact.
    deepest : float or None
        Largest overlap in m, or None for the approach.
    """
    from scipy.integrate import solve_ivp

    def force(xi: float, rate: float) -> float:
        value = law.force(xi, rate, xi if deepest is None else deepest)
        if not math.isfinite(value):
            raise no_number(law, xi, rate, value)
        return value

    def derivative(_: float, state: Array) -> tuple[float, float, float]:
        xi, rate, r = float(state[0]), float(state[1]), distance - float(state[0])
        return rate, -max(0.0, force(max(xi, 0.0), rate)) / law.pair.m_eff - spin * spin / r**3, distance / r**2

    def end(_: float, state: Array) -> float:
        xi, rate = float(state[0]), float(state[1])
        # continue the force by a negative number without overlap, so that elastic contacts also end at a change of sign
        return rate if deepest is None else force(xi, rate) if xi > 0.0 else xi

    end.terminal, end.direction = True, -1.0  # type: ignore[attr-defined]
    solution = solve_ivp(derivative, (start[0], LONGEST_DURATION * units[2] * distance), start[1:], method="DOP853",
                         rtol=RELATIVE_TOLERANCE, atol=RELATIVE_TOLERANCE * np.array(units), events=end,
                         max_step=expected / STEPS_PER_PHASE)
    if not len(solution.t_events[0]):
        raise ValueError(f"`law` must let the bodies separate, got {law.law!r}. The oblique contact does not end.")
    return np.array([solution.t_events[0][0], *solution.y_events[0][0]])
