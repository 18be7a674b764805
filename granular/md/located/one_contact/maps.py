"""Isolated contacts in closed form: duration, final speeds, peaks of the force.

Two bodies of effective mass m touch at time 0 with the approach speed v > 0. Apart from the contact force they only
have a constant acceleration G towards each other, such as gravity for a ball and a wall:

    ξ̈ = G - F(ξ, ξ̇)/m,   ξ(0) = 0,   ξ̇(0) = v.

The force falls to zero at t1, when the bodies separate with speed v1. The remaining overlap decreases in free flight,
and is zero at t2 ≥ t1, with the separation speed v2. The *map* of the contact is (t1, t2, v1, v2). For every law, the
contact force changes the relative position at t2 by v t2 + G t2²/2, and its impulse is m (v + G t2 + v2).

| law and constant acceleration         | map |
|---------------------------------------|-----|
| dashpot F = kξ + γη, G = 0            | ω t1 = 2 f(ζ), v1 = v2 = ε v, t2 = t1 + γ/k |
| dashpot, G ≠ 0, ζ < 1                 | the same, corrected by Newton's method; no map if v ω < 10 G |
| powers, elastic or d = (p-1)/2, G = 0 | constants of the law (`power_form`) |
| viscoelastic, p = 3/2, d = 1/2, G = 0 | table of b = γ k^-0.6 m^-0.4 v^0.2, t2 = t1 + γ/k |

Here η = ξ̇ and ω² = k/m. For other laws and states t1 is nan. A dashpot between pendula whose surfaces are a distance d
apart at rest, ξ̈ = -Ω² (ξ + d) - F/m, also has a map (`map_of_pendula`). Its overlap oscillates with the squared
frequency k/m + Ω², and its force ends where kξ + γη = 0.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.laws.viscoelastic_restitution import duration, peaks as viscoelastic_peaks, restitution
from granular.md.located.records import DASHPOT, SELF_SIMILAR, VISCOELASTIC

MIN_SPEED_PER_PULL = 10.0
"""Smallest v ω, relative to G, at which a dashpot with acceleration G has a map.

At lower speeds balls come to rest.
"""
NEWTON_TOL = 1e-9
"""Newton's method ends when the next step, in units of 1/ω, is below this number."""
NEARLY_CRITICAL = 1.0 - 2.0**-30
"""Damping ratio from which a dashpot with an acceleration G ≠ 0 has no map.

Its oscillation, sin(Ωt)/Ω, becomes 0/0 at a damping ratio of 1.
"""
NO_CLOSED_FORM = (math.nan, math.nan, math.nan, math.nan)
"""Map (t1, t2, v1, v2) of a contact without a closed form."""


@kernel
def closed_form_map(law: Any, inverse: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return the map (t1, t2, v1, v2) of a contact with approach speed `v`.

    The module docstring defines the map. All entries are nan without a closed form. `inverse` is 1/m in 1/kg, and
    `pull` is G in m/s².
    """
    if law.map == DASHPOT:
        if pull == 0.0:
            t1, eps = dashpot_contact(law, inverse)
            return t1, t1 + law.gamma / law.k, eps * v, eps * v
        return dashpot_contact_under_pull(law, inverse, pull, v)
    if pull != 0.0:
        return NO_CLOSED_FORM
    if law.map == SELF_SIMILAR:
        unit, v1 = overlap_scale(law, inverse, v) / v, law.restitution * v
        return law.force_ends * unit, law.parts * unit, v1, v1
    if law.map == VISCOELASTIC:
        length = overlap_scale(law, inverse, v)
        b = law.gamma / law.k * (v / length)
        t1, v1 = length / v * duration(b), restitution(b) * v
        return t1, t1 + law.gamma / law.k, v1, v1
    return NO_CLOSED_FORM


@kernel
def half_duration(zeta: float) -> float:
    """Return f(ζ), half the duration of the contact of a dashpot in units of 1/ω.

    Here ω² = k/m, and the force is clipped at zero.
    """
    root = math.sqrt(abs(1.0 - zeta)) * math.sqrt(1.0 + zeta)
    # both formulas below become 0/0 at critical damping
    if root == 0.0:
        return 1.0
    return math.atan2(root, zeta) / root if zeta < 1.0 else math.asinh(root) / root


@kernel
def dashpot_contact(law: Any, inverse: float) -> tuple[float, float]:
    """Return duration t1 in s and restitution of a dashpot without acceleration G.

    `inverse` is 1/m in 1/kg.
    """
    omega = math.sqrt(law.k * inverse)
    zeta = 0.5 * law.gamma * omega / law.k
    half = half_duration(zeta)
    return 2.0 * half / omega, math.exp(-2.0 * zeta * half)


@kernel
def overlap_scale(law: Any, inverse: float, v: float) -> float:
    """Return the length scale X = (m v²/k)^(1/(p+1)) of a contact in m.

    It is about the largest overlap of an impact at speed `v`. `inverse` is 1/m in 1/kg.
    """
    return math.pow(v * v / (law.k * inverse), 1.0 / (law.p + 1.0))


@kernel
def dashpot_contact_under_pull(law: Any, inverse: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return the map (t1, t2, v1, v2) of a dashpot with an acceleration G.

    The module docstring defines the map. All entries are nan without a closed form. `pull` is G. The acceleration
    a = ξ̈ oscillates as exp(-λt) (cos, sin)(Ωt) about 0. The force φ = kξ + γη vanishes where a has increased to G.
    """
    omega = math.sqrt(law.k * inverse)
    relax = law.gamma / law.k  # s
    zeta = 0.5 * relax * omega
    if v * omega < MIN_SPEED_PER_PULL * abs(pull) or zeta >= NEARLY_CRITICAL:
        return NO_CLOSED_FORM
    if zeta == 0.0:  # the motion is symmetric about the largest overlap
        t = (math.pi + 2.0 * math.atan(pull / (omega * v))) / omega
        return t, t, v, v
    t, dt, xi, eta, acceleration = state_before_end(omega, zeta, relax, pull, v)
    if dt == math.inf:
        return NO_CLOSED_FORM
    # the last Newton step is taken by Taylor's formula, which is exact to rounding for |dt| ω < `NEWTON_TOL`
    jerk = -omega * omega * (eta + relax * acceleration)
    xi += dt * (eta + 0.5 * dt * acceleration)
    eta += dt * (acceleration + 0.5 * dt * jerk)
    square = eta * eta - 2.0 * pull * xi
    if not (eta < 0.0 and square > 0.0):
        return NO_CLOSED_FORM
    v2 = math.sqrt(square)
    if not v2 > relax * pull:  # the force would return during the residual contact
        return NO_CLOSED_FORM
    return t + dt, t + dt + 2.0 * xi / (v2 - eta), -eta, v2


@kernel
def state_before_end(
    omega: float, zeta: float, relax: float, pull: float, v: float,
) -> tuple[float, float, float, float, float]:
    """Return a time next to the end of a dashpot's force, and the state at that time.

    The contact starts with the approach speed `v` in m/s under the constant closing acceleration `pull` (G) in m/s².
    The force is proportional to ξ + relax·ξ̇, with relax = γ/k in s.

    Returns
    -------
    t, dt, xi, eta, acceleration : float
        Time t in s next to the end of the force, time dt from t to this end, and overlap, rate and acceleration at t.
        If the force ends, |dt| ω is less than `NEWTON_TOL`. If the force does not end, dt is inf.
    """
    t, dt, xi, eta, acceleration = 2.0 * half_duration(zeta) / omega, 0.0, 0.0, 0.0, 0.0
    # Newton's method ends earlier by `NEWTON_TOL`, and 20 is a guard
    for _ in range(20):
        xi, eta, acceleration = dashpot_state(omega, zeta, pull, v, t)
        rise = eta + relax * acceleration
        if not rise < 0.0:
            return t, math.inf, xi, eta, acceleration
        dt = -(xi + relax * eta) / rise
        if abs(dt) * omega < NEWTON_TOL:
            break
        t += dt
    return t, dt, xi, eta, acceleration


@kernel
def map_of_pendula(law: Any, inverse: float, square: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return the map (t1, t2, v1, v2) of a dashpot contact between two pendula.

    The module docstring defines the map. All entries are nan without a closed form: for another law, strong damping, or
    a small approach speed `v`. `square` is Ω² in 1/s², and `pull` is -Ω² d, where d is the gap at rest. `inverse` is
    1/m.
    """
    stiff = law.k * inverse + square
    omega, relax = math.sqrt(stiff), law.gamma / law.k
    zeta = 0.5 * law.gamma * inverse / omega
    if law.map != DASHPOT or v * omega < MIN_SPEED_PER_PULL * abs(pull) or zeta >= NEARLY_CRITICAL:
        return NO_CLOSED_FORM
    t, dt, xi, eta, acceleration = state_before_end(omega, zeta, relax, pull, v)
    if dt == math.inf:
        return NO_CLOSED_FORM
    # the rest of Newton's method is shorter than `NEWTON_TOL`: a Taylor step to the end of the force
    jerk = -stiff * eta - law.gamma * inverse * acceleration
    xi = max(0.0, xi + dt * (eta + 0.5 * dt * acceleration))
    eta += dt * (acceleration + 0.5 * dt * jerk)
    # free swing from there: η² + Ω² ξ² - 2 pull ξ is constant, so `root` is the separation speed v2 at ξ = 0
    root = math.sqrt(eta * eta + (square * xi - 2.0 * pull) * xi)
    if not eta < 0.0:
        return NO_CLOSED_FORM
    frequency = math.sqrt(square)
    # time of this swing: tan(Ω (t2 - t1)/2) = Ω ξ / (v2 - η)
    return t + dt, t + dt + 2.0 / frequency * math.atan(frequency * xi / (root - eta)), -eta, root


@kernel
def dashpot_state(omega: float, zeta: float, pull: float, v: float, t: float) -> tuple[float, float, float]:
    """Return overlap, rate and acceleration of a dashpot at time t after its touch.

    The contact began with approach speed v. The force is not clipped at zero.
    """
    root = math.sqrt((1.0 - zeta) * (1.0 + zeta))
    lean, angle = zeta * omega, root * omega * t
    fade, cosine, sine = math.exp(-lean * t), math.cos(angle), math.sin(angle) / root
    rest = pull / (omega * omega)
    # y = ξ - rest: y(0) = -rest, y'(0) = v
    inner = v / omega - zeta * rest
    y = fade * (inner * sine - rest * cosine)
    rate = fade * (v * cosine - (zeta * v - omega * rest) * sine)
    return y + rest, rate, -omega * (omega * y + 2.0 * zeta * rate)


@kernel
def closed_form_peaks(law: Any, inverse: float, pull: float, v: float, t1: float, v1: float) -> tuple[float, float]:
    """Return the largest overlap and force of a contact of `closed_form_map`.

    They are in m and N. `t1` and `v1` are the results of `closed_form_map`.
    """
    if law.map == SELF_SIMILAR:
        length = overlap_scale(law, inverse, v)
        return law.deepest * length, law.strongest * v * v / (inverse * length)
    if law.map == VISCOELASTIC:
        length = overlap_scale(law, inverse, v)
        xi, force = viscoelastic_peaks(law.gamma / law.k * (v / length))
        return xi * length, force * law.k * length * math.sqrt(length)
    omega = math.sqrt(law.k * inverse)
    zeta = 0.5 * law.gamma * omega / law.k
    if pull == 0.0:
        return peaks_of_dashpot(law, omega, zeta, v, 0.5 * omega * t1, v1)
    return peaks_under_pull(law, omega, zeta, pull, v, t1)


@kernel
def peaks_of_pendula(law: Any, inverse: float, square: float, pull: float, v: float, t1: float) -> tuple[float, float]:
    """Return the largest overlap in m and force in N of a dashpot between pendula.

    `square` and `pull` are as in `map_of_pendula`, and `t1` is its result.
    """
    omega = math.sqrt(law.k * inverse + square)
    return peaks_under_pull(law, omega, 0.5 * law.gamma * inverse / omega, pull, v, t1)


@kernel
def peaks_of_dashpot(law: Any, omega: float, zeta: float, v: float, half: float, v1: float) -> tuple[float, float]:
    """Return the largest overlap and the largest force of a dashpot for G = 0.

    They are in m and N. `half` is f = ω t1/2. The overlap is largest at ωt = f, where it has decayed by the factor √ε.
    The force is largest at ωt = 3f - π/√(1-ζ²), with F = k (v/ω) exp(ζ (π/√(1-ζ²) - 3f)). For ζ ≥ ½ it is largest at
    the touch, with F = γ v.
    """
    xi = v / omega * math.sqrt(v1 / v)
    if zeta >= 0.5:
        return xi, law.gamma * v
    if zeta == 0.0:
        return xi, law.k * xi
    root = math.sqrt((1.0 - zeta) * (1.0 + zeta))
    return xi, law.k * v / omega * math.exp(zeta * (math.pi / root - 3.0 * half))


@kernel
def peaks_under_pull(law: Any, omega: float, zeta: float, pull: float, v: float, t1: float) -> tuple[float, float]:
    """Return the largest overlap in m and force in N of a dashpot with acceleration G.

    `pull` is G. Newton's method starts from the times of both maxima without G.
    """
    t = 0.5 * t1
    # the start is off by about pull/(v ω) < 1/`MIN_SPEED_PER_PULL`, so four quadratic steps reach rounding
    for _ in range(4):
        xi, eta, acceleration = dashpot_state(omega, zeta, pull, v, t)
        t -= eta / acceleration
    deep = dashpot_state(omega, zeta, pull, v, t)[0]
    if law.gamma == 0.0:
        return deep, law.k * deep
    relax, t = law.gamma / law.k, 0.0
    if zeta < 0.5:
        t = (3.0 * math.acos(zeta) - math.pi) / (omega * math.sqrt((1.0 - zeta) * (1.0 + zeta)))
    for _ in range(6):
        xi, eta, acceleration = dashpot_state(omega, zeta, pull, v, t)
        bend = acceleration - relax * omega * omega * (eta + relax * acceleration)
        # the force is not concave here: its maximum is at the touch
        if not bend < 0.0:
            break
        t = max(0.0, t - (eta + relax * acceleration) / bend)
    xi, eta, acceleration = dashpot_state(omega, zeta, pull, v, t)
    return deep, max(law.gamma * v, law.k * xi + law.gamma * eta)

