"""Laws as users write them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class OwnDashpot:
    k: float
    gamma: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi + self.gamma * xi_dot
