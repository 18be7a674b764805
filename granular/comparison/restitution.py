"""ε of a comparison: the collision rule that force laws make, and the ε that gives hard spheres another outcome.
May be skipped: rarer, ε as the answer of a comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granular._check import Array
from granular.binary import LawRestitution, restitution_of
from granular.scene import Pair, Scene

ROUNDING = 1e-14
"""Values below this part of the largest are zero: one that jumps just beside its root may have no other sign there."""


class LawRule(LawRestitution):
    """The rule that a comparison makes out of force laws: it speaks of the law where that gives no ε in [0, 1]."""

    def __call__(self, speed: float, pair: Pair) -> float:
        eps = super().__call__(speed, pair)
        if not 0.0 <= eps <= 1.0 + 1e-9:  # rounding is the engine's business
            law = self.laws[pair.index]
            raise ValueError(
                f"law of pair {pair.index} is {law!r}: its restitution at {speed:g} m/s is {eps:.6g}, so no hard-sphere"
                " rule can be made of it; a law that repels and gives no energy is needed, or a rule of yours, rule=..."
            )
        return eps


def rule_of(laws: tuple[Any, ...], scene: Scene) -> Any:
    """The rule that the laws make."""
    rule = restitution_of(laws, scene)
    return LawRule(laws) if isinstance(rule, LawRestitution) else rule


def roots(function: Callable[[float], float], grid: Array, scale: float) -> tuple[float, ...]:
    """Where a function that may jump is zero: on the grid, but for rounding, or between two of its points; a jump
    across is left out."""
    from scipy.optimize import brentq

    values = np.array([function(x) for x in grid.tolist()])
    values[np.abs(values) <= ROUNDING * (scale + np.nanmax(np.abs(values), initial=0.0))] = 0.0
    found = grid[values == 0.0].tolist()
    for k in np.flatnonzero(np.multiply(values[:-1], values[1:]) < 0.0):
        root = float(brentq(function, grid[k], grid[k + 1], xtol=1e-14))
        if abs(function(root)) < 1e-6 * (scale + abs(values[k]) + abs(values[k + 1])):
            found.append(root)
    return tuple(sorted(found))
