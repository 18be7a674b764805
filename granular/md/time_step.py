"""Highest rate λ of contacts, which limits a fixed time step.

Before a run, λ gives the default time step. After the run, it shows whether the time step was short enough. An explicit
method integrates a contact accurately only if dt·λ is well below its stability limit. The limit is 2, and 1.05 for
Gear's five-value method. The spectral radius of Gear's method is 1 + 6e-8 at dt·λ = 0.1 and 1.01 at 1, and increases
steeply from there.

For pairs that overlap simultaneously, λ is the largest value of ½ (b + √(b² + 4a)), an upper bound. a and b are row
sums of M⁻¹K and M⁻¹C, with one row per pair. M, K and C are the matrices of masses, stiffnesses and damping. For one
undamped pair λ is ω₀, and inside a chain of equal balls 2√(k/m). For pendula a increases by Ω².
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, number_distinct_rows
from granular.scene import Scene, speed_scale

MAX_EXACT_PAIRS = 1000
"""Number of pairs up to which the slopes of all are computed by differences."""
LOAD_ITERATIONS = 12
"""Iterations for the overlap under a load.

Each reduces the error of ln(speed) by a factor of 2 or more.
"""
DOUBTFUL_DT_LAMBDA = 0.2
"""dt·λ above which errors are visible, so that a run issues a warning."""


def highest_rate_bound(scene: Scene, laws: SceneLaws, overlap: Any, beside: Any = True) -> float:
    """Return an upper bound of λ in 1/s for all pairs of a scene.

    Parameters
    ----------
    overlap : (p,) array
        Largest overlap of each pair in m. Pairs without a positive overlap do not contribute.
    beside : bool or (p,) array of bool
        Whether each pair and the next pair overlap simultaneously. Defaults to True for all pairs.

    Returns
    -------
    float
        λ, or 0 if no overlap is positive.
    """
    overlap = np.array(overlap, np.float64)
    for c, wall in zip((0, -1), scene.thermal_walls, strict=True):
        overlap[c] *= wall is None  # a thermal wall has no force
    overlap[~_can_be_highest(scene, laws, overlap, beside)] = 0.0
    return float(np.fmax.reduce(_rate_bounds(scene, _slopes(laws, overlap), beside), initial=0.0))


def _rate_bounds(scene: Scene, slope: Array, beside: Any) -> Array:
    """Return an upper bound of λ in 1/s for each pair, (p,).

    Parameters
    ----------
    slope : (2, p) array
        Stiffness in N/m and damping in kg/s of each pair.
    beside : bool or (p,) array of bool
        See `highest_rate_bound`.
    """
    inverse_mass, (below, above) = scene.inverse_mass, scene.neighbours
    common, together = (
        inverse_mass[scene.bodies(above)[0]], np.broadcast_to(np.asarray(beside, np.bool_), slope.shape[1])[below])
    with np.errstate(all="ignore"):
        rate = slope * sum(scene.sides(inverse_mass))
        rate[:, above] += np.where(together, slope[:, below] * common, 0.0)
        rate[:, below] += np.where(together, slope[:, above] * common, 0.0)
        a, b = rate
        a = a + np.where(a > 0.0, scene.pendulum**2, 0.0)
        return np.asarray(0.5 * (b + np.sqrt(b * b + 4.0 * a)))


def _can_be_highest(scene: Scene, laws: SceneLaws, overlap: Array, beside: Any) -> Any:
    """Whether each pair, or a neighbour, can have the highest rate, (p,).

    For laws F = k ξ^p + γ ξ^d ξ̇, the closed forms k p ξ^(p-1) and γ ξ^d of the slopes agree with their differences
    within a relative 1e-6 p. All pairs of small scenes, and of scenes with other laws, are kept.
    """
    kept = np.ones(len(overlap), np.bool_)
    kind, each = laws.in_pairs
    forms = [law.form for law in each]
    if len(overlap) <= MAX_EXACT_PAIRS or None in forms:
        return kept
    k, p, gamma, d = np.array(forms, np.float64).T[:, kind]
    with np.errstate(all="ignore"):
        slope = np.where(overlap > 0.0, [k * p * overlap ** (p - 1.0), gamma * overlap**d], 0.0)
        rate = _rate_bounds(scene, slope, beside)
    if np.isfinite(rate).all():
        near = rate >= (1.0 - 2e-6 * max(1.0, float(p.max()))) * rate.max()
        kept, (below, above) = near.copy(), scene.neighbours
        kept[below] |= near[above]
        kept[above] |= near[below]
    return kept


def expected_rate(scene: Scene, laws: SceneLaws) -> float:
    """Return the highest expected rate λ in 1/s of any single contact of a scene.

    The overlaps are estimated from the typical speed of the scene, or from the load on balls that touch at rest.
    Simultaneous contacts are ignored.
    """
    speed = speed_scale(scene)
    depth = laws.column(lambda law: law.overlap_at(speed))
    if speed == 0.0 and scene.fall.any():
        load = float(np.abs(np.where(scene.is_wall, 0.0, scene.mass) @ np.abs(scene.fall)))
        depth = laws.column(lambda law: _overlap_under(law, load))
    return highest_rate_bound(scene, laws, np.maximum(np.maximum(depth, -scene.gap), 1e-30), False)


def _overlap_under(law: PairLaw, load: float) -> float:
    """Return the largest overlap in m of a pair under a sudden load in N.

    The load is put on the pair at zero overlap. Its work equals the elastic energy at the overlap ξ, as after an impact
    at the speed √(2 F ξ/m_eff).
    """
    speed, overlap = 1.0, 0.0
    for _ in range(LOAD_ITERATIONS):
        overlap = law.overlap_at(speed)
        speed = math.sqrt(2.0 * load * overlap / law.pair.m_eff)
    return overlap


def _slopes(laws: SceneLaws, overlap: Array) -> Array:
    """Return tangent stiffness in N/m and damping in kg/s of all pairs.

    They are evaluated at the overlaps in m. The shape is (2, p), with zeros for pairs without a positive overlap.
    """
    slope, closed = np.zeros((2, len(overlap))), np.flatnonzero(overlap > 0.0)
    if len(closed):
        of_pair, each = laws.in_pairs
        of_row, first = number_distinct_rows(of_pair[closed], overlap[closed])
        tangents = [_tangent_or_inf(each[of_pair[c]], float(overlap[c])) for c in closed[first].tolist()]
        slope[:, closed] = np.array(tangents).T[:, of_row]
    return slope


def _tangent_or_inf(law: PairLaw, xi: float) -> tuple[float, float]:
    """Return tangent stiffness in N/m and damping in kg/s at the overlap `xi` in m.

    They are inf and 0 if the law overflows.
    """
    try:
        return law.tangent(xi)
    except OverflowError:  # an overlap far outside the range of the law
        return math.inf, 0.0
