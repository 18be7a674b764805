"""The ε with which hard spheres give what soft spheres gave: none, one, or several."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from granular import edmd
from granular.comparison.numbers import Compared
from granular.measures import counted
from granular.outcome import separations
from granular.rules import ConstantRestitution
from granular.trajectory import Trajectory


def effective_restitution(
    report: Compared, observable: Callable[[Trajectory], float] | None = None, resolution: int = 41
) -> tuple[float, ...]:
    """All common ε in [0, 1] with which EDMD gives the soft run's value of an observable.

    Parameters
    ----------
    observable : callable, optional
        Trajectory → float; default: the separation speed of the last pair after its last contact.
    resolution : int
        Number of ε at which EDMD is run to find changes of sign.

    Returns
    -------
    tuple of float
        Empty: no ε does it. Several: it is not unique. EDMD is not continuous in ε where the number of collisions
        changes; a jump across the value is not a root and is left out.
    """
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
