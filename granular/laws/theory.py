"""Closed forms for independent, instantaneous collisions.

The *independent-collision model* (ICM) of Müller & Pöschel (PRE 83, 041304, 2011) describes two balls that fall on a
floor. The lower ball bounces first and then meets the upper ball, and no two collisions overlap in time. Further
functions describe stacks, tapered chains and the bouncing ball under the same assumption. Velocities are positive
upwards. No formula suffers from cancellation, except where its value passes through zero.

`obtained` applies to soft spheres: it returns the ε that results from the ε given to a DEM code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular.laws import dashpot

__all__ = [
    "TwoBallDrop",
    "best_chain",
    "best_masses",
    "bouncing_ball",
    "chain_velocity",
    "effective_restitution",
    "most_collisions",
    "obtained",
    "rise",
    "stack_limit",
    "stack_velocities",
    "two_ball_drop",
]
__dir__ = __all__.copy

@signature.face
@dataclass(frozen=True, slots=True)
class TwoBallDrop:
    """Prediction of the independent-collision model for two balls dropped on a floor.

    It is returned by `two_ball_drop`.

    Attributes
    ----------
    t10, v10 : float
        Time in s and velocity in m/s (negative) of the impact of the lower ball on the floor. The upper ball has the
        same velocity.
    v10_after : float
        Velocity of the lower ball in m/s after this impact, ε01 |v10|.
    t12, delay : float
        Time in s of the collision of the two balls, and ``t12 - t10`` with all its digits.
    v1, v2 : float
        Velocities in m/s of the lower and the upper ball just before that collision.
    v1_after, v2_after : float
        Velocities v1′, v2′ in m/s just after that collision.
    v_rel_after : float
        v_r′ = v2′ - v1′ = ε12 (1 + ε01) |v10| in m/s. It does not depend on the gap, g and the masses.
    """

    t10: float
    v10: float
    v10_after: float
    t12: float
    delay: float
    v1: float
    v2: float
    v1_after: float
    v2_after: float
    v_rel_after: float


@signature.face
def two_ball_drop(
    mass_ratio: float,
    restitution: float | Sequence[float],
    drop: float,
    gap: float,
    gravity: float = 9.81,
    speed: float = 0.0,
) -> TwoBallDrop:
    """Return the independent-collision model of two balls dropped on a floor.

    Parameters
    ----------
    mass_ratio : float
        μ = m2/m1, upper over lower mass; 0 is the limit of a light upper ball.
    restitution : float or two floats
        ε in [0, 1] of both contacts, or (ε01, ε12) with the floor first.
    drop : float
        Height of the lowest point of the lower ball above the floor in m.
    gap : float
        Distance Δh between the surfaces of the balls in m.
    gravity : float
        g ≥ 0 in m/s². Defaults to 9.81.
    speed : float
        Speed in m/s with which both balls are thrown down. Defaults to 0.

    Returns
    -------
    TwoBallDrop

    Notes
    -----
    |v10| = √(speed² + 2 g drop), t12 - t10 = Δh / ((1 + ε01) |v10|), and with μ = m2/m1

        v1′ = |v10| (ε01 - μ (1 + ε12 + ε01 ε12)) / (1 + μ) - g (t12 - t10)
        v2′ = |v10| (ε01 + ε12 + ε01 ε12 - μ) / (1 + μ) - g (t12 - t10).

    The formulas hold for g Δh ≤ 2 ε01 (1 + ε01) v10². Otherwise the lower ball reaches the floor again before it meets
    the upper ball. This condition is not checked.
    """
    mu = check.number("mass_ratio", mass_ratio, at_least=0.0)
    e01, e12 = _restitutions(restitution, 2).tolist()
    g = check.number("gravity", gravity, at_least=0.0)
    h = check.number("drop", drop, at_least=0.0)
    v0 = check.number("speed", speed, at_least=0.0, fix="It always points downwards.")
    impact = math.sqrt(v0 * v0 + 2.0 * g * h)
    if impact == 0.0:
        raise ValueError(f"`drop` (with gravity) or `speed` must be positive, got drop = {drop!r}, speed = {speed!r} "
                         f"and gravity = {gravity!r}. Otherwise the balls never meet the floor.")
    t10 = 2.0 * h / (v0 + impact)
    delay = check.number("gap", gap, at_least=0.0) / ((1.0 + e01) * impact)
    fall = g * delay
    return TwoBallDrop(
        t10=t10,
        v10=-impact,
        v10_after=e01 * impact,
        t12=t10 + delay,
        delay=delay,
        v1=e01 * impact - fall,
        v2=-impact - fall,
        v1_after=impact * (e01 - mu * (1.0 + e12 + e01 * e12)) / (1.0 + mu) - fall,
        v2_after=impact * (e01 + e12 + e01 * e12 - mu) / (1.0 + mu) - fall,
        v_rel_after=e12 * (1.0 + e01) * impact,
    )


@signature.face
def effective_restitution(v_rel_after: float, impact_speed: float) -> float:
    """Return ε_eff, the ε of both contacts that gives the relative velocity v_r′.

    ε_eff = (√(1 + 4x) - 1)/2 = 2x / (1 + √(1 + 4x)) with x = v_r′/|v10|. It inverts v_r′ = ε (1 + ε) |v10| of the
    independent-collision model, which holds exactly for any gap, g and masses.

    Parameters
    ----------
    v_rel_after : float
        Velocity difference v_r′ = v2′ - v1′ ≥ 0 in m/s with which the two balls separate.
    impact_speed : float
        Speed |v10| > 0 in m/s of the lower ball when it meets the floor.
    """
    v10 = check.number("impact_speed", impact_speed, above=0.0)
    x = check.number("v_rel_after", v_rel_after, at_least=0.0, fix="Balls that still approach have no ε_eff.") / v10
    return 2.0 * x / (1.0 + math.sqrt(1.0 + 4.0 * x))


@signature.face
def stack_velocities(masses: ArrayLike, restitution: float | Sequence[float]) -> check.Array:
    """Return the velocity of each ball of a stack just after the hit from below.

    The velocities are in units of the speed at which the stack meets the floor. The last entry is the launch velocity
    of the top ball,

        v_N = (1 + ε)^N / Π (1 + m[k+1]/m[k]) - 1        (ε → 1, light upper balls: 2^N - 1).

    The formula holds for small gaps without gravity, as long as no ball is hit twice from below before it has hit the
    ball above. If m[k+1]/m[k] = μ for all balls, the condition is μ ≤ ε (Harter 1971, Kerwin 1972; re-derived).

    Parameters
    ----------
    masses : (N,) array
        Masses in kg, bottom to top.
    restitution : float or (N,) array
        ε in [0, 1], one for all contacts or one per contact, floor first.

    Returns
    -------
    (N,) array
    """
    m = check.positive("masses", masses, "mass")
    eps = _restitutions(restitution, len(m))
    w = [float(eps[0])]
    for mu, e in zip(m[1:] / m[:-1], eps[1:], strict=True):
        w.append(float((w[-1] * (1.0 + e) + e - mu) / (1.0 + mu)))
    return np.array(w)


@signature.face
def stack_limit(n: int, restitution: float = 1.0) -> float:
    """Return v_N/v of a stack of `n` balls, each much lighter than the ball below.

    The limit is (1 + ε)^N - 1, at most 2^N - 1. `restitution` is ε in [0, 1] of all contacts and defaults to 1.
    """
    count = check.integer("n", n, at_least=1)
    return float((1.0 + check.number("restitution", restitution, at_least=0.0, at_most=1.0)) ** count) - 1.0


@signature.face
def rise(velocity_ratio: float) -> float:
    """Return the rise of a ball in units of the drop height h, (v′/v)².

    `velocity_ratio` is v′/v: velocity after the collisions, upwards positive, over impact speed. The result is 0 if the
    ball moves downwards. A ball that leaves at 3 v rises to 9 h, and at 7 v to 49 h. These are the limits of stacks of
    two and three balls.
    """
    ratio = max(0.0, check.number("velocity_ratio", velocity_ratio))
    return ratio * ratio


@signature.face
def chain_velocity(masses: ArrayLike, restitution: float = 1.0) -> float:
    """Return the velocity of the last ball of a chain hit by a striker.

    It is in units of the velocity of the striker. All other balls are at rest, and the collisions are successive. The
    velocity is therefore Π (1 + ε)/(1 + m[k+1]/m[k]). For a geometric taper, μ = m[k+1]/m[k], it is
    ((1 + ε)/(1 + μ))^(N-1).

    Parameters
    ----------
    masses : (N,) array
        Masses in kg, the striker first.
    restitution : float
        ε in [0, 1] of all contacts. Defaults to 1.
    """
    m = check.positive("masses", masses, "mass")
    eps = check.number("restitution", restitution, at_least=0.0, at_most=1.0)
    return float(np.prod((1.0 + eps) / (1.0 + m[1:] / m[:-1])))


@signature.face
def best_masses(first: float, last: float, n: int) -> check.Array:
    """Return the `n` masses of a chain that make the last ball fastest.

    The masses form a geometric progression from `first` to `last`, both in kg and included. This holds for stacks and
    for chains at rest, for every ε, because each factor 1/(1 + m[k+1]/m[k]) is log-concave in ln m.
    """
    a = check.number("first", first, above=0.0)
    b = check.number("last", last, above=0.0)
    count = check.integer("n", n, at_least=2)
    masses: check.Array = a * np.power((b / a) ** (1.0 / (count - 1)), np.arange(count, dtype=np.float64))
    masses[-1] = b
    return masses


@signature.face
def best_chain(total_ratio: float, restitution: float) -> tuple[int, float]:
    """Return the number of collisions and the velocity of the best geometric chain.

    In the best chain the last ball is fastest. More balls between the two ends improve the transfer until their losses
    dominate. For ε = 1 an optimal number does not exist, and the velocity tends to √R, the bound by energy
    conservation.

    Parameters
    ----------
    total_ratio : float
        R = (striker's mass)/(last mass) > 1.
    restitution : float
        ε in (0, 1) of all contacts.

    Returns
    -------
    n, ratio : int, float
        Number of collisions, and velocity of the last ball in units of the velocity of the striker.

    Raises
    ------
    ValueError
        If an argument is out of its range, such as `restitution` = 1.
    """
    half = 0.5 * math.log(check.number("total_ratio", total_ratio, above=1.0))
    eps = check.number("restitution", restitution, above=0.0, at_most=1.0)
    if eps == 1.0:
        raise ValueError("`restitution` must be below 1, got 1.0. With 1 the velocity grows with every ball, to √R.")
    lost = -math.log1p(-0.5 * (1.0 - eps))  # ln 2 - ln(1 + ε) per collision, plus ln cosh x of unequal masses

    def gain(n: int) -> float:
        return half - n * (_log_cosh(half / n) + lost)

    low, high = 0.0, half
    while (x := 0.5 * (low + high)) not in (low, high):  # root of x tanh x - ln cosh x = lost
        low, high = (x, high) if x * math.tanh(x) - _log_cosh(x) < lost else (low, x)
    n = max(1, int(half / high))
    # for large n the gains differ by less than rounding: compare with √(n (n + 1)) instead
    n += gain(n + 1) > gain(n) if n < 1000 else (half / high) ** 2 > n * (n + 1)
    return n, math.exp(gain(n))


def _log_cosh(x: float) -> float:
    # ln cosh x without cancellation near 0
    """Return ln cosh x without cancellation near 0."""
    return math.log1p(2.0 * math.sinh(0.5 * x) ** 2)


@signature.face
def bouncing_ball(height: float, restitution: float, gravity: float = 9.81) -> tuple[float, float]:
    """Return (time in s, path in m) until a ball dropped on a floor is at rest.

    T = √(2h/g) (1 + ε)/(1 - ε), path = h (1 + ε²)/(1 - ε²), for a drop `height` h in m, ε in [0, 1) and `gravity` g in
    m/s² (9.81 by default). The number of bounces is infinite, but the time is finite.
    """
    h = check.number("height", height, at_least=0.0)
    g = check.number("gravity", gravity, above=0.0)
    eps = check.number("restitution", restitution, at_least=0.0, at_most=1.0)
    if eps == 1.0:
        raise ValueError("`restitution` must be below 1, got 1.0. An elastic ball bounces forever.")
    return math.sqrt(2.0 * h / g) * (1.0 + eps) / (1.0 - eps), h * (1.0 + eps * eps) / ((1.0 - eps) * (1.0 + eps))


@signature.face
def most_collisions(masses: Sequence[float]) -> int:
    """Return the largest number of collisions of three elastic balls on a line.

    It is ⌈π/θ⌉ with tan θ = √(m2 (m1 + m2 + m3) / (m1 m3)), from a billiard in a wedge of angle θ (Galperin 1981).

    Parameters
    ----------
    masses : (3,) array
        Masses in kg, left to right.
    """
    m1, m2, m3 = check.positive("masses", masses, "mass", shape=(3,)).tolist()
    turns = math.pi / math.atan(math.sqrt(m2 / m1 * ((m1 + m2 + m3) / m3)))
    # an integer π/θ must not be rounded up because of its last digit
    return round(turns) if abs(turns - round(turns)) < 1e-12 * turns else math.ceil(turns)


@signature.face
def obtained(convention: str, restitution: float, *, clipped: bool) -> float:
    """Return the ε of a contact that results from the ε given to a DEM code.

    DEM codes differ in the formula by which they compute the damping from the given ε.

    Parameters
    ----------
    convention : str
        Name of such a formula, according to documentation or source of a code, see Notes.
    restitution : float
        The ε given to the code, in (0, 1].
    clipped : bool
        True if attractive forces are cut off (``limit_damping`` of LAMMPS, ``limitForce`` of LIGGGHTS). False if the
        force can be attractive until the overlap is 0.

    Returns
    -------
    float
        ε of an isolated contact at any speed: exp(-2 ζ f(ζ)) if clipped (`granular.laws.dashpot`), else
        exp(-πζ/√(1-ζ²)), or 0 for ζ ≥ 1. Damping α √(m_eff k) ξ^¼ ξ̇ with a force k ξ^(3/2) has ζ = α/√5.

    Notes
    -----
    With ℓ(e) = |ln e|/√(π² + ln² e), Marshall's polynomial p and Thornton's fit h (the manual and the source of each):

    * lammps/tsuji, released until July 2026: α = p(e) = 1.2728 - 4.2783 e + 11.087 e² - 22.348 e³ + 27.467 e⁴
      - 18.022 e⁵ + 4.8218 e⁶
    * lammps/tsuji-2026: α = √2 p(e)
    * lammps/coeff_restitution, for hooke and hertz: ζ = ℓ(e), from η = -2 √(5/6) ln e/√(π² + ln² e) √((3/2) k m) and
      √(4 m k/(1 + (π/ln e)²))
    * lethe and liggghts/hertz: also ζ = ℓ(e), from 2 √(5/6) ℓ √(S m), S = 2 E* √(R ξ)
    * mfix/hertz: η = 2 √(m k) ℓ(e) ξ^¼, so that ζ = 2 ℓ/√5
    * yade/hertz-mindlin, since merge request 919: c = 2 β √(m S), β² = 1/(1 - (1 + e)² exp h(e)) - 1, so that
      ζ = √(6/5) β (Thornton, Cummins & Cleary, Powder Technol. 233, 30 (2013), eqs. B6 and B7)

    The α that gives exactly ε under clipped forces is √5 ζ(ε), see `TsujiHertz.from_restitution`.
    """
    zeta = DAMPING_CONVENTIONS[check.choice("convention", convention, list(DAMPING_CONVENTIONS))](
        check.number("restitution", restitution, above=0.0, at_most=1.0))
    return dashpot.restitution(zeta) if check.boolean("clipped", clipped) else dashpot.restitution_pulling(zeta)


def _logarithmic_ratio(eps: float) -> float:
    """Return ζ = |ln ε|/√(π² + ln² ε), exact if the force can be attractive."""
    return abs(math.log(eps)) / math.hypot(math.pi, math.log(eps))


def _marshall_ratio(eps: float) -> float:
    """Return ζ = α/√5 for a coefficient of restitution, by Marshall's polynomial."""
    return _polynomial(eps, 1.2728, -4.2783, 11.087, -22.348, 27.467, -18.022, 4.8218) / math.sqrt(5.0)


def _thornton_ratio(eps: float) -> float:
    """Return ζ = √(6/5) β of Thornton's fit for a coefficient of restitution.

    β is set to 0 at ε = 1, where the fit gives 0.0045.
    """
    h = _polynomial(eps, 0.0, -6.918798, -16.41105, 146.8049, -796.4559, 2928.711, -7206.864, 11494.29, -11342.18,
                    6276.757, -1489.915)
    return math.sqrt(1.2) / math.sqrt(math.expm1(-h - 2.0 * math.log1p(eps))) if eps < 1.0 else 0.0


def _polynomial(x: float, *coefficients: float) -> float:
    """Return Σ c_i x^i, with the coefficients c_i from i = 0 upwards."""
    return float(np.polynomial.polynomial.polyval(x, coefficients))


DAMPING_CONVENTIONS: dict[str, Callable[[float], float]] = {
    "lammps/tsuji": _marshall_ratio, "lammps/tsuji-2026": lambda eps: math.sqrt(2.0) * _marshall_ratio(eps),
    "lammps/coeff_restitution": _logarithmic_ratio, "lethe": _logarithmic_ratio, "liggghts/hertz": _logarithmic_ratio,
    "mfix/hertz": lambda eps: 2.0 / math.sqrt(5.0) * _logarithmic_ratio(eps), "yade/hertz-mindlin": _thornton_ratio,
}
"""Damping ratio ζ as a function of the ε given to a code, see `obtained`."""


def _restitutions(restitution: float | Sequence[float], n: int) -> check.Array:
    """Return `n` coefficients of restitution in [0, 1] from one number or from `n`."""
    eps = check.array("restitution", np.full(n, restitution) if check.is_single(restitution) else restitution, (n,))
    check.every("restitution", eps, (eps >= 0.0) & (eps <= 1.0), "a number in [0, 1]")
    return eps
