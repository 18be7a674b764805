"""The end of a chain under pressure that swallows waves: a wall that moves as the chain beyond it would.
May be skipped: chains under pressure only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular import _check
from granular.scene import Pair


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
        _check.number("load", self.load, above=0.0, fix="a chain that is not pressed has no slow waves")
        _check.number("stiffness", self.stiffness, above=0.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m and overlap rate `xi_dot` in m/s, before the engine clips it at 0."""
        return self.load + math.sqrt(self.stiffness * pair.m_eff) * xi_dot

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy F₀ ξ in J."""
        return self.load * xi
