"""Hertz contact of spheres: elastic, viscoelastic, or with Tsuji damping.

Three kinds of damping are often confused:

* **Viscoelastic** damping γ √ξ ξ̇ follows from the bulk viscosity of the spheres (Kuwabara & Kono 1987; Brilliantov,
  Spahn, Hertzsch & Pöschel 1996). Its ε decreases with speed.
* **Tsuji** damping α √(m_eff k) ξ^¼ ξ̇ (Tsuji, Tanaka & Ishida 1992) was constructed so that ε does *not* depend on
  speed.
* A **linear dashpot** (`LinearDashpot`) is different from both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granular._engine import check, signature
from granular.laws.dashpot import _duration_instead_of_k, _StiffAndDamped, damping_ratio, reduced_duration
from granular.scene import Pair, checked_pair

Each = float | Sequence[float]
"""Type of a property of both bodies: one number, or (lower, upper)."""
WEAK_DAMPING_RATIO, DURATION_NODE_COUNT = 0.3, 60
"""Constants of `_tsuji_duration`, sufficient for an error of rounding size.

They are the damping ratio below which a contact ends close to a zero of z, and the number of Gauss points per half."""


class _Spheres(_StiffAndDamped):
    """Base of laws for spheres, whose force begins with k ξ^(3/2)."""

    exponent = 1.5

    def potential(self, xi: float, pair: Pair) -> float:
        """Return the elastic energy (2/5) k ξ^(5/2) in J."""
        return 0.4 * self.k * xi * xi * math.sqrt(xi)


@signature.face
@dataclass(frozen=True)
class Hertz(_Spheres):
    """Elastic Hertz contact, F = k ξ^(3/2).

    Parameters
    ----------
    k : float
        Stiffness in N/m^(3/2), positive: (4/3) E* √r_eff.
    """

    k: float

    @classmethod
    def from_material(cls, young: Each, poisson: Each, pair: Pair) -> Hertz:
        """Return the Hertz contact of two bodies from their materials.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa and Poisson's ratio, one for both bodies or one for each, see `hertz_stiffness`.
        pair : Pair
            Pair with the effective radius.

        Returns
        -------
        Hertz
        """
        return cls(hertz_stiffness(young, poisson, pair))

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N at overlap `xi` in m."""
        return self.k * xi * math.sqrt(xi)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇: (k, 3/2, 0, 0)."""
        return self.k, 1.5, 0.0, 0.0


@signature.face
@dataclass(frozen=True)
class ViscoelasticHertz(_Spheres):
    """Viscoelastic spheres, F = k ξ^(3/2) + γ √ξ ξ̇ (Müller & Pöschel 2011).

    Parameters
    ----------
    k : float
        Stiffness in N/m^(3/2), positive.
    gamma : float
        Damping γ = (3/2) A k in kg/(s √m), not negative, with the dissipative constant A in s.
        (Müller & Pöschel 2011 divide k and γ by m_eff.)
    """

    k: float
    gamma: float

    @classmethod
    def from_material(
        cls, young: Each, poisson: Each, dissipation: float | None = None, pair: Pair | None = None, *,
        restitution: float | None = None, speed: float | None = None,
    ) -> ViscoelasticHertz:
        """Return the law for two bodies of given materials.

        The damping follows either from `dissipation`, or from `restitution` and `speed`.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa and Poisson's ratio, one for both bodies or one for each, see `hertz_stiffness`.
        dissipation : float
            Dissipative constant A in s: F = k (ξ^(3/2) + (3/2) A √ξ ξ̇).
        pair : Pair
            Required. r_eff determines k. m_eff is used only with `restitution`.
        restitution, speed : float
            Alternative to `dissipation`: ε in (0, 1] at an impact speed in m/s. Slower impacts have a larger ε.

        Returns
        -------
        ViscoelasticHertz

        Raises
        ------
        ValueError
            If the damping is not given in exactly one of these two ways.
        """
        k = hertz_stiffness(young, poisson, pair)
        are_given = dissipation is not None, restitution is not None, speed is not None
        if are_given == (False, True, True):
            return cls.from_restitution(restitution, speed, k, pair)  # type: ignore[arg-type]
        if are_given != (True, False, False):
            raise ValueError("Either `dissipation`, or `restitution` with the `speed` at which it holds, must be "
                             f"given, got dissipation = {dissipation!r}, restitution = {restitution!r} and "
                             f"speed = {speed!r}.")
        return cls(k, 1.5 * check.number("dissipation", dissipation, at_least=0.0) * k)

    @classmethod
    def from_restitution(
        cls, restitution: float, speed: float, k: float | None = None, pair: Pair | None = None, *,
        duration: float | None = None,
    ) -> ViscoelasticHertz:
        """Return the law with a given restitution *at one impact speed*.

        Either the stiffness or the contact duration t_c at this speed is given. With b(ε) and the dimensionless
        duration D(b) of `granular.laws.viscoelastic_restitution`, k = m_eff (D / t_c)^(5/2) v^(-1/2) and
        γ = b k^(3/5) m_eff^(2/5) v^(-1/5).

        Parameters
        ----------
        restitution : float
            ε in (0, 1].
        speed : float
            Impact speed v in m/s.
        k : float
            Stiffness in N/m^(3/2), positive.
        pair : Pair
            Pair with the effective mass. Required.
        duration : float
            Instead of `k`: contact duration t_c in s at this speed, from the touch until the force is zero.

        Returns
        -------
        ViscoelasticHertz

        Raises
        ------
        ValueError
            If both or neither of `k` and `duration` are given.
        """
        from granular.laws import viscoelastic_restitution as viscoelastic

        v, b = check.number("speed", speed, above=0.0), viscoelastic.damping(restitution)
        if (contact_duration := _duration_instead_of_k(k, duration)) is not None:
            k = _stiffness_of_duration(viscoelastic.duration(b), contact_duration, v, pair)
        stiffness = check.number("k", k, above=0.0)
        return cls(k, b * stiffness**0.6 * checked_pair(pair).m_eff**0.4 / v**0.2)  # type: ignore[arg-type]

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N before it is clipped at 0 by the engine.

        Parameters
        ----------
        xi : float
            Overlap in m.
        xi_dot : float
            Rate of the overlap in m/s.
        pair : Pair
            Not used.
        """
        return math.sqrt(xi) * (self.k * xi + self.gamma * xi_dot)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇: (k, 3/2, γ, 1/2)."""
        return self.k, 1.5, self.gamma, 0.5


@signature.face
@dataclass(frozen=True)
class TsujiHertz(_Spheres):
    """Hertz contact with Tsuji damping, whose restitution does not depend on speed.

    F = k ξ^(3/2) + α √(m_eff k) ξ^(1/4) ξ̇. An isolated contact maps exactly onto the clipped linear dashpot with
    damping ratio ζ = α / √5.

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
    def from_restitution(
        cls, restitution: float, k: float | None = None, *, duration: float | None = None, speed: float | None = None,
        pair: Pair | None = None,
    ) -> TsujiHertz:
        """Return the law with a given restitution at any speed: α = √5 ζ(ε).

        Either the stiffness is given, or the contact duration t_c at one impact speed v. With the dimensionless
        duration D(ζ) = v^(1/5) (k / m_eff)^(2/5) t_c, k = m_eff (D / t_c)^(5/2) v^(-1/2).

        Parameters
        ----------
        restitution : float
            ε in (0, 1].
        k : float
            Stiffness in N/m^(3/2), positive.
        duration : float
            Instead of `k`: contact duration t_c in s at the impact speed `speed`, from the touch until the force is
            zero. It is proportional to v^(-1/5).
        speed, pair : float, Pair
            Impact speed in m/s, and pair with the effective mass. They are used only with `duration`.

        Returns
        -------
        TsujiHertz

        Raises
        ------
        ValueError
            If both or neither of `k` and `duration` are given.
        """
        zeta = damping_ratio(restitution)
        if (contact_duration := _duration_instead_of_k(k, duration)) is not None:
            k = _stiffness_of_duration(
                _tsuji_duration(zeta), contact_duration, check.number("speed", speed, above=0.0), pair)
        return cls(k, math.sqrt(5.0) * zeta)  # type: ignore[arg-type]

    @classmethod
    def from_material(cls, young: Each, poisson: Each, restitution: float, pair: Pair) -> TsujiHertz:
        """Return the law for two materials and a given restitution at any speed.

        Parameters
        ----------
        young, poisson : float or (lower, upper)
            Young's modulus in Pa and Poisson's ratio, one for both bodies or one for each, see `hertz_stiffness`.
        restitution : float
            ε in (0, 1], the same at any speed.
        pair : Pair
            Pair with the effective radius.

        Returns
        -------
        TsujiHertz
        """
        return cls.from_restitution(restitution, hertz_stiffness(young, poisson, pair))

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N before it is clipped at 0 by the engine.

        Parameters
        ----------
        xi : float
            Overlap in m.
        xi_dot : float
            Rate of the overlap in m/s.
        pair : Pair
            Pair with the effective mass.
        """
        root = math.sqrt(xi)
        return self.k * xi * root + self.alpha * math.sqrt(pair.m_eff * self.k) * math.sqrt(root) * xi_dot

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇: (k, 3/2, α √(m_eff k), 1/4)."""
        return self.k, 1.5, self.alpha * math.sqrt(pair.m_eff * self.k), 0.25


@signature.face
def hertz_stiffness(young: Each, poisson: Each, pair: Pair | None) -> float:
    """Return the Hertz stiffness (4/3) E* √r_eff of a pair in N/m^(3/2).

    The effective modulus E* of the two bodies follows from 1/E* = Σ (1 - ν²)/Y.

    Parameters
    ----------
    young : float or (lower, upper)
        Young's modulus Y in Pa, positive, one for both bodies or one for each.
    poisson : float or (lower, upper)
        Poisson's ratio ν in [0, 0.5], one for both bodies or one for each.
    pair : Pair
        Pair whose r_eff in m must be finite and positive.
    """
    modulus, nu = _both_bodies("young", young, above=0.0), _both_bodies("poisson", poisson, at_least=0.0, at_most=0.5)
    known = checked_pair(pair)
    r_eff = check.number(
        f"`r_eff` of pair {known.name}", known.r_eff, above=0.0, fix="Point particles have no curvature.")
    lower, upper = zip(modulus, nu, strict=True)
    if lower == upper:
        return 2.0 / 3.0 * lower[0] * math.sqrt(r_eff) / (1.0 - lower[1] * lower[1])
    softness = sum((1.0 - each[1] * each[1]) / each[0] for each in (lower, upper))
    return 4.0 / 3.0 * math.sqrt(r_eff) / softness


def _stiffness_of_duration(dimensionless: float, duration: float, speed: float, pair: Pair | None) -> float:
    """Return k of a Hertz contact with the duration t_c at the impact speed v.

    t_c is in s and v in m/s. With the dimensionless duration D = v^(1/5) (k / m_eff)^(2/5) t_c,
    k is m_eff (D / t_c)^(5/2) v^(-1/2).
    """
    return checked_pair(pair).m_eff * math.pow(dimensionless / duration, 2.5) / math.sqrt(speed)


def _tsuji_duration(zeta: float) -> float:
    """Return the dimensionless contact duration D(ζ) under Tsuji damping.

    It is in units of (m_eff / k)^(2/5) v^(-1/5). With z = √(4/5) ξ^(5/4) and the time ds = (√5/2) ξ^(1/4) dt, the
    contact becomes a contact of a dashpot with damping ratio ζ, in units of k, m_eff and v: z = exp(-ζ s) sin(w s) / w,
    w = √(1 - ζ²). Therefore D = (4/5)^(3/5) ∫ z^(-1/5) ds. The second half of weakly damped contacts is integrated from
    the next zero of z, at π/w.
    """
    w, half = complex((1.0 - zeta) * (1.0 + zeta)) ** 0.5, 0.5 * reduced_duration(zeta)
    zero = math.pi / w.real if zeta < WEAK_DAMPING_RATIO else 0.0
    # s = r^5 removes the singularity s^(-1/5)
    start, end = np.array([(0.0, half), (2.0 * math.asin(zeta) / w.real, zero - half) if zero else (half, 2.0 * half)]
                          ).T[:, :, None] ** 0.2
    nodes, weights = np.polynomial.legendre.leggauss(DURATION_NODE_COUNT)
    r = start + 0.5 * (end - start) * (nodes + 1.0)
    z = r**5 * np.exp(-zeta * np.abs([[0.0], [zero]] - r**5)) * np.sinc(r**5 * w / math.pi).real
    return float(0.8**0.6 * 2.5 * np.sum((end - start) * weights * r**4 * z**-0.2))


def _both_bodies(name: str, value: Each, **limits: float) -> list[float]:
    """Return a material property of both bodies, checked, from one number or two."""
    if check.is_single(value):
        return [check.number(name, value, **limits)] * 2  # type: ignore[arg-type]
    both = check.array(name, value, (2,), fix="Give one for both bodies, or (lower, upper).")
    return [check.number(f"{name}[{i}]", x, **limits) for i, x in enumerate(both.tolist())]  # type: ignore[arg-type]
