"""Spheres: Hertz contact without damping, with viscoelastic damping, and with Tsuji's.

Three rivals often confused: **viscoelastic** damping γ √ξ ξ̇ follows from the bulk viscosity of the spheres
(Kuwabara & Kono 1987; Brilliantov, Spahn, Hertzsch & Pöschel 1996) and makes ε fall with speed; **Tsuji** damping
α √(m_eff k) ξ^¼ ξ̇ (Tsuji, Tanaka & Ishida 1992) was chosen so that ε does *not* depend on speed; a **linear
dashpot** (`LinearDashpot`) is neither.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from granular._engine import check
from granular.laws.dashpot import _StiffAndDamped, damping_ratio
from granular.scene import Pair, checked_pair

Each = float | Sequence[float]
"""A number for both bodies of a pair, or (lower, upper)."""


class _Spheres(_StiffAndDamped):
    """What the contacts of spheres share: they begin with k ξ^(3/2)."""

    exponent = 1.5

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy (2/5) k ξ^(5/2) in J."""
        return 0.4 * self.k * xi * xi * math.sqrt(xi)


@check.face
@dataclass(frozen=True)
class Hertz(_Spheres):
    """F = k ξ^(3/2), elastic.

    Parameters
    ----------
    k : float
        Stiffness in N/m^(3/2), positive: (4/3) E* √r_eff.
    """

    k: float

    @classmethod
    def from_material(cls, young: Each, poisson: Each, pair: Pair) -> Hertz:
        """Return the contact of two bodies of known material, see `hertz_stiffness`.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa, Poisson's ratio; two numbers for bodies of two materials.
        """
        return cls(hertz_stiffness(young, poisson, pair))

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m."""
        return self.k * xi * math.sqrt(xi)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Stiffness and exponent, damping and exponent: F = k ξ^(3/2)."""
        return self.k, 1.5, 0.0, 0.0


@check.face
@dataclass(frozen=True)
class ViscoelasticHertz(_Spheres):
    """F = k ξ^(3/2) + γ √ξ ξ̇, the paper's law for spheres.

    Parameters
    ----------
    k : float
        Stiffness in N/m^(3/2), positive.
    gamma : float
        Damping γ = (3/2) A k in kg/(s √m), not negative, with the dissipative constant A in s. (The paper
        divides both by m_eff.)
    """

    k: float
    gamma: float

    @classmethod
    def from_material(
        cls, young: Each, poisson: Each, dissipation: float | None = None, pair: Pair | None = None, *,
        restitution: float | None = None, speed: float | None = None,
    ) -> ViscoelasticHertz:
        """Return the contact of two bodies of known material, damped in one of two ways.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa, Poisson's ratio; two numbers for bodies of two materials, see `hertz_stiffness`.
        dissipation : float
            Dissipative constant A in s: F = k (ξ^(3/2) + (3/2) A √ξ ξ̇).
        pair : Pair
            Supplies m_eff and r_eff.
        restitution, speed : float
            In place of `dissipation`: ε in (0, 1] at an impact speed in m/s. It is larger for slower impacts.

        Raises
        ------
        ValueError
            Unless there is either `dissipation`, or `restitution` and `speed`.
        """
        k = hertz_stiffness(young, poisson, pair)
        ways = dissipation is not None, restitution is not None, speed is not None
        if ways == (False, True, True):
            return cls.from_restitution(restitution, speed, k, pair)  # type: ignore[arg-type]
        if ways != (True, False, False):
            raise ValueError(f"dissipation is {dissipation!r}, restitution is {restitution!r} and speed is {speed!r}: "
                             "either dissipation, or restitution with the speed at which it holds, is needed.")
        return cls(k, 1.5 * check.number("dissipation", dissipation, at_least=0.0) * k)

    @classmethod
    def from_restitution(cls, restitution: float, speed: float, k: float, pair: Pair) -> ViscoelasticHertz:
        """Return the law of stiffness `k` with the given restitution in (0, 1] *at impact speed* `speed` in m/s."""
        from granular.laws.viscoelastic_restitution import damping

        v, stiffness = check.number("speed", speed, above=0.0), check.number("k", k, above=0.0)
        return cls(k, damping(restitution) * stiffness**0.6 * checked_pair(pair).m_eff**0.4 / v**0.2)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m and overlap rate `xi_dot` in m/s, before the engine clips it at 0."""
        return math.sqrt(xi) * (self.k * xi + self.gamma * xi_dot)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Stiffness and exponent, damping and exponent: F = k ξ^(3/2) + γ ξ^(1/2) ξ̇."""
        return self.k, 1.5, self.gamma, 0.5


@check.face
@dataclass(frozen=True)
class TsujiHertz(_Spheres):
    """F = k ξ^(3/2) + α √(m_eff k) ξ^(1/4) ξ̇, whose restitution does not depend on speed.

    An isolated contact maps exactly onto the clipped linear dashpot with damping ratio ζ = α / √5.

    Parameters
    ----------
    k : float
        Stiffness in N/m^(3/2), positive.
    alpha : float
        Damping, dimensionless, not negative.
    """

    k: float
    alpha: float

    @classmethod
    def from_restitution(cls, restitution: float, k: float) -> TsujiHertz:
        """Return the law of stiffness `k` with the given restitution in (0, 1], at any speed: α = √5 ζ(ε)."""
        return cls(k, math.sqrt(5.0) * damping_ratio(restitution))

    @classmethod
    def from_material(cls, young: Each, poisson: Each, restitution: float, pair: Pair) -> TsujiHertz:
        """Return the contact of two bodies of known material with the given restitution in (0, 1], at any speed.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa, Poisson's ratio; two numbers for bodies of two materials, see `hertz_stiffness`.
        restitution : float
            ε in (0, 1].
        """
        return cls.from_restitution(restitution, hertz_stiffness(young, poisson, pair))

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m and overlap rate `xi_dot` in m/s, before the engine clips it at 0."""
        root = math.sqrt(xi)
        return self.k * xi * root + self.alpha * math.sqrt(pair.m_eff * self.k) * math.sqrt(root) * xi_dot

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Stiffness and exponent, damping and exponent: F = k ξ^(3/2) + γ ξ^(1/4) ξ̇, γ = α √(m_eff k)."""
        return self.k, 1.5, self.alpha * math.sqrt(pair.m_eff * self.k), 0.25


@check.face
def hertz_stiffness(young: Each, poisson: Each, pair: Pair | None) -> float:
    """(4/3) E* √r_eff in N/m^(3/2) with 1/E* = Σ (1 - ν²)/Y: the contact of two bodies.

    Parameters
    ----------
    young : float or (lower, upper)
        Young's modulus Y in Pa, positive; two numbers for bodies of two materials.
    poisson : float or (lower, upper)
        Poisson's ratio ν in [0, 0.5].
    pair : Pair
        Supplies r_eff in m, which must be finite and positive.
    """
    modulus, nu = _of_both("young", young, above=0.0), _of_both("poisson", poisson, at_least=0.0, at_most=0.5)
    at = checked_pair(pair)
    r_eff = check.number(f"r_eff of pair {at.index}", at.r_eff, above=0.0, fix="point particles have no curvature")
    lower, upper = zip(modulus, nu, strict=True)
    if lower == upper:
        return 2.0 / 3.0 * lower[0] * math.sqrt(r_eff) / (1.0 - lower[1] * lower[1])
    softness = sum((1.0 - each[1] * each[1]) / each[0] for each in (lower, upper))
    return 4.0 / 3.0 * math.sqrt(r_eff) / softness


def _of_both(name: str, value: Each, **limits: float) -> list[float]:
    """What is said of both bodies of a pair, or of each."""
    if check.is_one(value):
        return [check.number(name, value, **limits)] * 2  # type: ignore[arg-type]
    both = check.array(name, value, (2,), fix="one for both bodies, or (lower, upper)")
    return [check.number(f"{name}[{i}]", one, **limits) for i, one in enumerate(both.tolist())]  # type: ignore[arg-type]
