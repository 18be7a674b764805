"""Stability limit of a fixed time step, before and after a run.

Before a run it gives the default step and a warning, after the run the step required by its contacts. Explicit methods
follow a contact only if dt·λ is well below a limit. The limit is 2, and 1.05 for Gear's five-value method, whose
spectral radius is 1 + 6e-8 at dt·λ = 0.1 and 1.01 at 1, and increases steeply from there. For the closed pairs of an
assembly, row sums of M⁻¹K and M⁻¹C bound its sharpest rate λ = ½ (b + √(b² + 4a)). This is ω₀ for one pair, and 2√(k/m)
inside a chain of equal balls. For pendula a increases by Ω².
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, number_distinct_rows
from granular.scene import Scene, speed_scale

DOUBTFUL_DT_LAMBDA = 0.2
"""dt·λ above which results are doubtful."""


def sharpest_rate(scene: Scene, laws: SceneLaws, overlap: Any, beside: Any = True) -> float:
    """Return an upper bound of λ in 1/s for all pairs with the given overlaps in m.

    An overlap of at most 0 denotes an open pair. The bound is 0 if all pairs are open. `beside` states for every pair
    whether it and the next one are ever closed simultaneously. By default all are.
    """
    overlap = np.array(overlap, np.float64)
    for c, wall in zip((0, -1), scene.heat, strict=True):
        overlap[c] *= wall is None  # a thermal wall has no force
    slope = _slopes(laws, overlap)
    w, (below, above) = scene.inverse_mass, scene.neighbours
    shared, together = w[scene.bodies(above)[0]], np.broadcast_to(np.asarray(beside, np.bool_), len(laws))[below]
    with np.errstate(all="ignore"):
        rate = slope * sum(scene.sides(w))
        rate[:, above] += np.where(together, slope[:, below] * shared, 0.0)
        rate[:, below] += np.where(together, slope[:, above] * shared, 0.0)
        a, b = rate
        a = a + np.where(a > 0.0, scene.pendulum**2, 0.0)
        return float(np.fmax.reduce(0.5 * (b + np.sqrt(b * b + 4.0 * a)), initial=0.0))


def expected_rate(scene: Scene, laws: SceneLaws) -> float:
    """Return the sharpest rate λ in 1/s of any single contact.

    Overlaps are estimated from the speeds of the scene.
    """
    speed = speed_scale(scene)
    depth = laws.column(lambda law: law.overlap_at(speed))
    return sharpest_rate(scene, laws, np.maximum(np.maximum(depth, -scene.gap), 1e-30), False)


def _slopes(laws: SceneLaws, overlap: Array) -> Array:
    """Return stiffness in N/m and damping in kg/s of all pairs at their overlaps.

    The shape is (2, n-1), and open pairs have 0.
    """
    slope, closed = np.zeros((2, len(overlap))), np.flatnonzero(overlap > 0.0)
    if len(closed):
        of_pair, each = laws.in_pairs
        kind, first = number_distinct_rows(of_pair[closed], overlap[closed])
        tangents = [_tangent(each[of_pair[c]], float(overlap[c])) for c in closed[first].tolist()]
        slope[:, closed] = np.array(tangents).T[:, kind]
    return slope


def _tangent(law: PairLaw, xi: float) -> tuple[float, float]:
    try:
        return law.tangent(xi)
    except OverflowError:  # an overlap far outside the range of the law
        return math.inf, 0.0
