"""The ε with which hard spheres give what soft spheres gave: none, one, or several."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from granular import edmd
from granular.measures import counted
from granular.outcome import separations
from granular.rules import ConstantRestitution
from granular.trajectory import Trajectory

if TYPE_CHECKING:
    from granular.comparison import Comparison


def effective_restitution(
    report: Comparison, observable: Callable[[Trajectory], float] | None, resolution: int
) -> tuple[float, ...]:
    """Roots in ε of the difference of an observable; see `granular.comparison.Comparison.effective_restitution`."""
    measure = observable or (lambda run: float(separations(counted(run, report.soft)[0])[0][-1]))
    target = measure(report.soft) if observable else report.pairs[-1].soft_v_rel

    def miss(eps: float) -> float:
        return measure(edmd.simulate(report.scene, ConstantRestitution(eps), **report.hard_options)) - target

    grid = np.linspace(0.0, 1.0, resolution)[1:]
    values = [miss(float(eps)) for eps in grid]
    roots = [float(eps) for eps, value in zip(grid, values, strict=True) if value == 0.0]
    for a, b, fa, fb in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if fa * fb < 0.0:
            roots += _root(miss, float(a), float(b), abs(target) + abs(fa) + abs(fb))
    return tuple(sorted(roots))


def _root(miss: Callable[[float], float], a: float, b: float, scale: float) -> list[float]:
    """The root of `miss` between a and b as a list; empty if it jumps across zero instead."""
    from scipy.optimize import brentq

    root = float(brentq(miss, a, b, xtol=1e-14))
    return [root] if abs(miss(root)) < 1e-6 * scale else []
