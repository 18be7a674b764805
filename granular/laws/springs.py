"""Laws without a rate, contacts under a static force, and the end of a chain that absorbs waves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check
from granular.laws.contact_law import PairLaw, finite
from granular.scene import Pair

__all__ = ["MatchedEnd", "PowerLaw", "WaltonBraun"]
SHARE = 0.1
"""Overlap, in effective radii, of a contact whose law gives the force asked for at every overlap."""

SAME = 1e-12
"""Forces that differ by no more of themselves are the same."""


@check.face
@dataclass(frozen=True)
class PowerLaw:
    """F = k ξ^n, elastic (overlap potential; *not* an inverse power of the distance).

    Parameters
    ----------
    k : float
        Stiffness in N/m^n, positive.
    exponent : float
        n ≥ 1: 1 is a linear spring, 3/2 Hertz, 2 a cone on a plane.
    """

    k: float
    exponent: float

    rate_dependent = False

    def __post_init__(self) -> None:
        check.number("k", self.k, above=0.0)
        check.number("exponent", self.exponent, at_least=1.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m."""
        return self.k * math.pow(xi, self.exponent)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Stiffness and exponent, damping and exponent: F = k ξ^n."""
        return self.k, self.exponent, 0.0, 0.0

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy k ξ^(n+1) / (n+1) in J."""
        return self.k * math.pow(xi, self.exponent + 1.0) / (self.exponent + 1.0)


@check.face
@dataclass(frozen=True)
class WaltonBraun:
    """F = min(k_load ξ, k_load ξ_max - k_unload (ξ_max - ξ)): plastic loss without a rate (Walton & Braun 1986).

    Loading follows k_load ξ; unloading and reloading follow the steeper line through the largest overlap ξ_max so
    far, until ξ exceeds it. An isolated contact ends at ξ = (1 - k_load/k_unload) ξ_max with restitution
    ε = √(k_load/k_unload) after t_c = (π/2) (√(m_eff/k_load) + √(m_eff/k_unload)).

    Parameters
    ----------
    k_load, k_unload : float
        Stiffness in N/m while loading and while unloading, 0 < k_load ≤ k_unload.
    """

    k_load: float
    k_unload: float

    memory = True
    exponent = 1.0
    rate_dependent = False

    def __post_init__(self) -> None:
        check.number("k_load", self.k_load, above=0.0)
        check.number("k_unload", self.k_unload, at_least=self.k_load,
                      fix="unloading must be at least as stiff as loading, or energy would be created")

    @classmethod
    def from_restitution(cls, restitution: float, k_load: float) -> WaltonBraun:
        """Return the law with loading stiffness `k_load` and the given restitution in (0, 1]: k_load / ε²."""
        eps = check.number("restitution", restitution, above=0.0, at_most=1.0)
        return cls(k_load, check.number("k_load", k_load, above=0.0) / (eps * eps))

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        """Force in N at overlap `xi` in m, given the largest overlap `xi_max` ≥ `xi` since the bodies last parted."""
        return min(self.k_load * xi, self.k_load * xi_max - self.k_unload * (xi_max - xi))

    def restitution(self) -> float:
        """√(k_load / k_unload)."""
        return math.sqrt(self.k_load / self.k_unload)

    def isolated(self, pair: Pair, speed: float) -> tuple[float, float, float, float, float]:
        """ε, t_c in s, largest overlap in m and force in N, and the overlap in m at the end of an isolated contact."""
        eps, omega = self.restitution(), math.sqrt(self.k_load / pair.m_eff)
        deepest = speed / omega
        return eps, 0.5 * math.pi * (1.0 + eps) / omega, deepest, self.k_load * deepest, (1.0 - eps * eps) * deepest


@check.face
@dataclass(frozen=True)
class MatchedEnd:
    """F = F₀ + √(K m) ξ̇ between the last ball of a chain, of mass m, and a wall, for waves that are not to come back.

    √(K m) is the resistance of an endless chain to slow waves. It is clipped only where √(K m) |ξ̇| > F₀; a dashpot
    alone would be half of the time. A wave of frequency ω comes back with tan(θ/4) of its amplitude, where θ is its
    phase from ball to ball, ω = ω_c sin(θ/2) with the cut-off ω_c.

    Parameters
    ----------
    load : float
        F₀ in N, positive: the static force in the chain.
    stiffness : float
        Stiffness K of its contacts under that force, in N/m, see `granular.waves.stiffness`.

    Notes
    -----
    It bears F₀ at every overlap: nothing brings the last ball back to where it was.
    """

    load: float
    stiffness: float

    def __post_init__(self) -> None:
        check.number("load", self.load, above=0.0, fix="a chain that is not pressed has no slow waves")
        check.number("stiffness", self.stiffness, above=0.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m and overlap rate `xi_dot` in m/s, before the engine clips it at 0."""
        return self.load + math.sqrt(self.stiffness * pair.m_eff) * xi_dot

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy F₀ ξ in J."""
        return self.load * xi


def overlap_under(law: PairLaw, force: float) -> float:
    """Return the overlap in m at which a contact at rest pushes with `force` in N.

    (F/k)^(1/p) of a power law, by bisection to the last digit of any other; a tenth of r_eff where the overlap does not
    matter, as at a `MatchedEnd`.

    Raises
    ------
    ValueError
        If no overlap gives that force.
    """
    if force == 0.0:
        return 0.0
    if law.form is not None:
        return math.pow(force / law.form[0], 1.0 / law.form[1]) if law.form[0] > 0.0 else _none(law, force)
    size = law.pair.r_eff if 0.0 < law.pair.r_eff < math.inf else 1.0
    if all(abs(at_rest(law, share * size) - force) <= SAME * force for share in (1e-9, SHARE)):
        return SHARE * size
    high = size
    while not at_rest(law, high) >= force:
        high = 2.0 * high if high < 1e100 * size else _none(law, force)
    low = high
    while at_rest(law, low) >= force:
        low = 0.5 * low if low > 1e-100 * size else _none(law, force)
    while (middle := low + 0.5 * (high - low)) not in (low, high):
        low, high = (low, middle) if at_rest(law, middle) >= force else (middle, high)
    return high


def stiffness_at(law: PairLaw, xi: float) -> float:
    """Return the stiffness dF/dξ in N/m of a contact at overlap `xi` in m and rest; 0 without an overlap.

    Of a law with memory, that of the unloading which begins there: it is what small swings meet.
    """
    if not xi > 0.0:
        return 0.0
    if law.form is not None:
        k, p = law.form[:2]
        return k * p * math.pow(xi, p - 1.0)
    if law.memory:
        return law.tangent(xi)[0]
    h = 1e-3 * xi  # central differences of order 4: wrong by 4e-12 of the stiffness, for forces like powers of ξ
    near, far = (at_rest(law, xi + j * h) - at_rest(law, xi - j * h) for j in (1, 2))
    return (8.0 * near - far) / (12.0 * h)


def at_rest(law: PairLaw, xi: float) -> float:
    """Return the force in N at overlap `xi` in m and rest, at first loading, or raise if it is no number."""
    return finite(law, xi, 0.0)


def _none(law: PairLaw, force: float) -> float:
    raise ValueError(f"force is {force!r}: no overlap of pair {law.pair.index} gives it under {law.law!r}; a force "
                     "that the law can bear at rest is needed.")
