"""Laws as users write them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class OwnDashpot:
    k: float
    gamma: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi + self.gamma * xi_dot


@dataclass(frozen=True)
class Shell:
    """F = k (ξ - ξ₀) + γ ξ̇: nothing pushes before it is as deep as ξ₀."""

    k: float
    free: float
    gamma: float = 0.0

    def force(self, xi, xi_dot, pair):
        return self.k * (xi - self.free) + self.gamma * xi_dot


@dataclass(frozen=True)
class Holed:
    """F = k ξ, but none from ξ = 0.01 m to 0.02 m."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi if xi < 0.01 or xi > 0.02 else 0.0
