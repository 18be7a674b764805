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
    """A spring that is k2 in place of k beyond the overlap xi1: a kink."""

    k: float
    k2: float
    xi1: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        if xi <= self.xi1:
            return self.k * xi
        return self.k * self.xi1 + self.k2 * (xi - self.xi1)


@dataclass(frozen=True)
class TwoDampings:
    """A dashpot that damps differently while loading and while unloading: a kink in the rate."""

    k: float
    loading: float
    unloading: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + (self.loading if xi_dot > 0.0 else self.unloading) * xi_dot


@dataclass(frozen=True)
class Hysteresis:
    """Loading k ξ; unloading straight to zero at rest · ξ_max."""

    k: float
    rest: float

    memory = True
    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        if xi >= xi_max:
            return self.k * xi
        return self.k * (xi - self.rest * xi_max) / (1.0 - self.rest)
