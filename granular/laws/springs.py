"""Laws without a rate: any power of the overlap, and a spring that is stiffer while the bodies part."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check
from granular.scene import Pair


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
