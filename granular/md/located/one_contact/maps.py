"""Isolated contacts in closed form: delay, speeds and peaks.

Two bodies of effective mass m meet at time 0 with speed v > 0. Apart from their force they only feel gravity, which can
pull them together with acceleration G (a ball and a wall): ξ̈ = G - F(ξ, ξ̇)/m, ξ(0) = 0, ξ̇(0) = v. The force falls to
zero at t1, when the bodies move apart with speed v1. The remaining overlap then decreases in free flight, until ξ is
zero at t2 ≥ t1, with speed v2. For every law, the pair has moved by v t2 + G t2²/2 less at t2 than without the force.
Its impulse was m (v + G t2 + v2).

| law, by its kind and pull           | map |
|-------------------------------------|-----|
| dashpot F = kξ + γη, G = 0          | ω t1 = 2 f(ζ), v1 = v2 = ε v, t2 = t1 + γ/k |
| dashpot, G ≠ 0, ζ < 1               | Newton's method from there, except if gravity nearly balances (v ω < 10 G) |
| powers, elastic or d = (p-1)/2, G = 0 | constants of the law (`power_form`) |
| viscoelastic, p = 3/2, d = 1/2, G = 0 | table of b = γ k^-0.6 m^-0.4 v^0.2, t2 = t1 + γ/k |

Other laws and states do not have a map: t1 is nan. A dashpot between pendula that hang apart by d, ξ̈ = -Ω² (ξ + d) -
F/m, also has a map (`of_pendula`). It is an oscillation of squared frequency k/m + Ω², whose force alone ends at kξ +
γη = 0.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.laws.viscoelastic_restitution import duration, peaks as tops, restitution
from granular.md.located.records import DASHPOT, SELF_SIMILAR, VISCOELASTIC

MIN_SPEED_PER_PULL = 10.0
"""Smallest v ω, relative to G, at which a dashpot under a pull G has a map.

Below it, balls come to rest."""
NEWTON_TOL = 1e-9
"""Newton's method ends when the next step, in units of 1/ω, is below this."""
NEARLY_CRITICAL = 1.0 - 2.0**-30
"""Damping ratio from which a dashpot under a pull has no map.

Its oscillation, sin(Ωt)/Ω, becomes 0/0 at 1."""
NO_CLOSED_FORM = (math.nan, math.nan, math.nan, math.nan)


@kernel
def encounter(law: Any, inverse: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return (t1, t2, v1, v2) of a contact at speed `v`, nan without a map.

    `inverse` is 1/m.
    """
    if law.map == DASHPOT:
        if pull == 0.0:
            t1, eps = of_dashpot(law, inverse)
            return t1, t1 + law.gamma / law.k, eps * v, eps * v
        return under_pull(law, inverse, pull, v)
    if pull != 0.0:
        return NO_CLOSED_FORM
    if law.map == SELF_SIMILAR:
        unit, v1 = reach(law, inverse, v) / v, law.restitution * v
        return law.force_ends * unit, law.parts * unit, v1, v1
    if law.map == VISCOELASTIC:
        length = reach(law, inverse, v)
        b = law.gamma / law.k * (v / length)
        t1, v1 = length / v * duration(b), restitution(b) * v
        return t1, t1 + law.gamma / law.k, v1, v1
    return NO_CLOSED_FORM


@kernel
def half_duration(zeta: float) -> float:
    """Return f(ζ), half the duration of a dashpot's contact in units of 1/ω.

    Here ω² = k/m.
    """
    root = math.sqrt(abs(1.0 - zeta)) * math.sqrt(1.0 + zeta)
    # both formulas below become 0/0 at critical damping
    if root == 0.0:
        return 1.0
    return math.atan2(root, zeta) / root if zeta < 1.0 else math.asinh(root) / root


@kernel
def of_dashpot(law: Any, inverse: float) -> tuple[float, float]:
    """Return duration and restitution of a dashpot without pull."""
    omega = math.sqrt(law.k * inverse)
    zeta = 0.5 * law.gamma * omega / law.k
    half = half_duration(zeta)
    return 2.0 * half / omega, math.exp(-2.0 * zeta * half)


@kernel
def reach(law: Any, inverse: float, v: float) -> float:
    """Return the length X = (m v²/k)^(1/(p+1)), the scale of a contact."""
    return math.pow(v * v / (law.k * inverse), 1.0 / (law.p + 1.0))


@kernel
def under_pull(law: Any, inverse: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return the contact of a dashpot under gravity.

    The acceleration a = ξ̈ oscillates as exp(-λt) (cos, sin)(Ωt) about 0, and φ = kξ + γη = 0 where it has increased to
    G.
    """
    omega = math.sqrt(law.k * inverse)
    relax = law.gamma / law.k  # s
    zeta = 0.5 * relax * omega
    if v * omega < MIN_SPEED_PER_PULL * abs(pull) or zeta >= NEARLY_CRITICAL:
        return NO_CLOSED_FORM
    if zeta == 0.0:  # the motion is symmetric about the largest overlap
        t = (math.pi + 2.0 * math.atan(pull / (omega * v))) / omega
        return t, t, v, v
    t, dt, xi, eta, push = state_before_end(omega, zeta, relax, pull, v)
    if dt == math.inf:
        return NO_CLOSED_FORM
    # the last Newton step is taken by Taylor's formula, which is exact to rounding for |dt| ω < CLOSE
    jerk = -omega * omega * (eta + relax * push)
    xi += dt * (eta + 0.5 * dt * push)
    eta += dt * (push + 0.5 * dt * jerk)
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
    """Return a time close to the end of a dashpot's force, and the state then.

    The force ξ + relax·ξ̇ falls to 0. The other values are the difference to its end (inf if it does not end), and
    overlap, rate and acceleration.
    """
    t, dt, xi, eta, push = 2.0 * half_duration(zeta) / omega, 0.0, 0.0, 0.0, 0.0
    # Newton's method ends earlier by `NEWTON_TOL`, and 20 is a guard
    for _ in range(20):
        xi, eta, push = swing(omega, zeta, pull, v, t)
        rise = eta + relax * push
        if not rise < 0.0:
            return t, math.inf, xi, eta, push
        dt = -(xi + relax * eta) / rise
        if abs(dt) * omega < NEWTON_TOL:
            break
        t += dt
    return t, dt, xi, eta, push


@kernel
def of_pendula(law: Any, inverse: float, square: float, pull: float, v: float) -> tuple[float, float, float, float]:
    """Return the contact of a dashpot between pendula.

    Ω² is `square`, and the pull is -Ω² d.
    """
    stiff = law.k * inverse + square
    omega, relax = math.sqrt(stiff), law.gamma / law.k
    zeta = 0.5 * law.gamma * inverse / omega
    if law.map != DASHPOT or v * omega < MIN_SPEED_PER_PULL * abs(pull) or zeta >= NEARLY_CRITICAL:
        return NO_CLOSED_FORM
    t, dt, xi, eta, push = state_before_end(omega, zeta, relax, pull, v)
    if dt == math.inf:
        return NO_CLOSED_FORM
    jerk = -stiff * eta - law.gamma * inverse * push
    xi = max(0.0, xi + dt * (eta + 0.5 * dt * push))
    eta += dt * (push + 0.5 * dt * jerk)
    root = math.sqrt(eta * eta + (square * xi - 2.0 * pull) * xi)
    if not eta < 0.0:
        return NO_CLOSED_FORM
    own = math.sqrt(square)
    return t + dt, t + dt + 2.0 / own * math.atan(own * xi / (root - eta)), -eta, root


@kernel
def swing(omega: float, zeta: float, pull: float, v: float, t: float) -> tuple[float, float, float]:
    """Return overlap, rate and acceleration of a dashpot at time t.

    The contact began at time 0 with speed v, and the force is not clipped.
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
def peaks(law: Any, inverse: float, pull: float, v: float, t1: float, v1: float) -> tuple[float, float]:
    """Return the largest overlap and force of a contact solved by `encounter`."""
    if law.map == SELF_SIMILAR:
        length = reach(law, inverse, v)
        return law.deepest * length, law.strongest * v * v / (inverse * length)
    if law.map == VISCOELASTIC:
        length = reach(law, inverse, v)
        xi, force = tops(law.gamma / law.k * (v / length))
        return xi * length, force * law.k * length * math.sqrt(length)
    omega = math.sqrt(law.k * inverse)
    zeta = 0.5 * law.gamma * omega / law.k
    if pull == 0.0:
        return peaks_of_dashpot(law, omega, zeta, v, 0.5 * omega * t1, v1)
    return peaks_under_pull(law, omega, zeta, pull, v, t1)


@kernel
def peaks_of_pendula(law: Any, inverse: float, square: float, pull: float, v: float, t1: float) -> tuple[float, float]:
    """Return the largest overlap and force of a dashpot between pendula."""
    omega = math.sqrt(law.k * inverse + square)
    return peaks_under_pull(law, omega, 0.5 * law.gamma * inverse / omega, pull, v, t1)


@kernel
def peaks_of_dashpot(law: Any, omega: float, zeta: float, v: float, half: float, v1: float) -> tuple[float, float]:
    """Return the largest overlap and force of a dashpot without pull.

    ξ peaks half way, at ωt = f, where it has decayed by √ε. F peaks at ωt = 3f - π/√(1-ζ²), or at the touch for ζ ≥ ½.
    So F = k (v/ω) exp(ζ (π/√(1-ζ²) - 3f)).
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
    """Return the largest overlap and force of a dashpot under gravity.

    Newton's method starts from the times without gravity.
    """
    t = 0.5 * t1
    # the start is off by about pull/(v ω) < 1/WEIGHTLESS, so four quadratic steps reach rounding
    for _ in range(4):
        xi, eta, push = swing(omega, zeta, pull, v, t)
        t -= eta / push
    deep = swing(omega, zeta, pull, v, t)[0]
    if law.gamma == 0.0:
        return deep, law.k * deep
    relax, t = law.gamma / law.k, 0.0
    if zeta < 0.5:
        t = (3.0 * math.acos(zeta) - math.pi) / (omega * math.sqrt((1.0 - zeta) * (1.0 + zeta)))
    for _ in range(6):
        xi, eta, push = swing(omega, zeta, pull, v, t)
        bend = push - relax * omega * omega * (eta + relax * push)
        # the force is not concave here: its maximum is at the touch
        if not bend < 0.0:
            break
        t = max(0.0, t - (eta + relax * push) / bend)
    xi, eta, push = swing(omega, zeta, pull, v, t)
    return deep, max(law.gamma * v, law.k * xi + law.gamma * eta)

