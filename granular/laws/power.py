"""Any power of the overlap: F = k ξ^n, elastic.
May be skipped: one more law, like those of the spheres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular import _check
from granular.scene import Pair


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
        _check.number("k", self.k, above=0.0)
        _check.number("exponent", self.exponent, at_least=1.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m."""
        return self.k * math.pow(xi, self.exponent)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Stiffness and exponent, damping and exponent: F = k ξ^n."""
        return self.k, self.exponent, 0.0, 0.0

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy k ξ^(n+1) / (n+1) in J."""
        return self.k * math.pow(xi, self.exponent + 1.0) / (self.exponent + 1.0)
