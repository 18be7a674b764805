"""Force laws as users write them, without traits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.scene import Pair


@dataclass(frozen=True)
class PlainPower:
    """F = k ξ^p."""

    k: float
    p: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * math.pow(xi, self.p)


@dataclass(frozen=True)
class PlainHertz:
    """F = k ξ^(3/2)."""

    k: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi * math.sqrt(xi)


@dataclass(frozen=True)
class PlainDashpot:
    """F = k ξ + γ ξ̇."""

    k: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + self.gamma * xi_dot


@dataclass(frozen=True)
class PlainViscoelastic:
    """F = √ξ (k ξ + γ ξ̇)."""

    k: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return math.sqrt(xi) * (self.k * xi + self.gamma * xi_dot)


@dataclass(frozen=True)
class TwoStiffnesses:
    """Spring with stiffness k2 instead of k beyond the overlap xi1, where it kinks."""

    k: float
    k2: float
    xi1: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        if xi <= self.xi1:
            return self.k * xi
        return self.k * self.xi1 + self.k2 * (xi - self.xi1)


@dataclass(frozen=True)
class TwoDampings:
    """Dashpot with different damping in loading and unloading, a kink in the rate."""

    k: float
    loading: float
    unloading: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + (self.loading if xi_dot > 0.0 else self.unloading) * xi_dot


@dataclass(frozen=True)
class Hysteresis:
    """Loading with F = k ξ, and straight unloading to zero at rest · ξ_max."""

    k: float
    rest: float

    memory = True
    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        if xi >= xi_max:
            return self.k * xi
        return self.k * (xi - self.rest * xi_max) / (1.0 - self.rest)
