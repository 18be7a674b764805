"""Numbers of a comparison that further runs give: the ε with which hard spheres have another outcome; and how high the
top ball rises, as granular/page/physics/apex.mjs defines it.
May be skipped: rarer, and one more number of a comparison.

It rises to the first apex of its free flight after it has been touched, all hits before that included, a run that stops
earlier being carried on. A ball that comes to rest instead rises 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from granular import edmd, md
from granular._check import Array
from granular.scene import Scene
from granular.trajectory import Status, Trajectory

ROUNDING = 1e-14
"""Values below this part of the largest are zero: one that jumps just beside its root may have no other sign there."""
MERGED = 1e-4
"""Hard spheres that collide at less than this share of the impact speed stick together once the run has stopped."""
LONGEST = 1000.0
"""Falls after which a rise is given up."""
MOST = 3000
"""Events of each run."""
STEPS = 10 * MOST
"""Steps of each soft run: of a pile that settles, hours may pass before so many events."""
Flight = tuple[float, float, float]
Runs = Callable[[float, Array | None], Trajectory]


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


def soft_rise(scene: Scene, law: Any, start: float) -> float:
    """Return the rise in m of the top ball of soft spheres, sought from the time `start` on; nan if it has none."""

    def simulate(t_end: float, samples: Array | None) -> Trajectory:
        return md.simulate(scene, law, t_end=t_end, samples=samples, max_events=MOST, max_steps=STEPS)

    return _carried_on(simulate, scene, start, None) if scene.gravity else math.nan


def hard_rise(hard: Trajectory, rule: Any, options: Mapping[str, Any], impact: float) -> float:
    """Return the rise in m of the top ball of hard spheres, whose run has stopped; nan if it cannot be told."""
    scene = hard.scene
    elastic = options["tc"] > 0.0 or options["elastic_below"] > 0.0  # for a while, and no run is that is carried on
    if not scene.gravity or elastic or options["ties"] in ("newton", "poisson", "reflect"):
        return math.nan
    if any(0.0 < v <= scene.gravity * lasting for _, v, lasting in _flights(hard, float(hard.time[-1]))):
        return math.nan  # the apex is before the stop: rare, and not sought here
    rest = scene.replace(gap=hard.gap[-1], velocity=hard.velocity[-1], origin=0.0)

    def simulate(t_end: float, samples: Array | None) -> Trajectory:
        return edmd.simulate(rest, rule, t_end=t_end, samples=samples, max_events=MOST, collapse="merge",
                             merge_below=MERGED * impact)

    return _carried_on(simulate, rest, 0.0, float(hard.velocity[-1][-1]) if hard.count(scene.n - 2) else None)


def _carried_on(simulate: Runs, scene: Scene, start: float, leaving: float | None) -> float:
    """The first apex of the top ball of a run that is made longer until there is one; it may begin `leaving`."""
    fall = math.sqrt(2.0 * max(float(scene.gap[0]), 0.05) / scene.gravity)
    for t_end in start + fall * 4.0 ** np.arange(-3, math.log(LONGEST) / math.log(4.0)):
        run = simulate(float(t_end), None)
        end = float(run.time[-1])
        free = list(_flights(run, end))
        if leaving is not None:
            free.insert(0, (0.0, leaving, float(_of_top(run)["t_begin"].min(initial=end))))
        for begin, v, lasting in free:
            if 0.0 < v <= scene.gravity * lasting:
                half = begin + 0.5 * v / scene.gravity
                at = simulate(half, np.array([half]))
                return max(0.0, float(at.gap[-1].sum()) + (0.5 * v) ** 2 / (2.0 * scene.gravity))
        if run.status is not Status.time:
            return 0.0 if run.status is Status.resting else math.nan
    return math.nan


def _flights(run: Trajectory, end: float) -> Iterator[Flight]:
    """Begin, velocity and duration of the free flights of the top ball after its contacts, in order of time."""
    rows = _of_top(run)
    rows = rows[np.argsort(rows["t_end"], kind="stable")]
    for k, row in enumerate(rows[~np.isnan(rows["t_end"])]):
        t = float(row["t_end"])
        pressed = ((rows["t_begin"] < t) & ~(rows["t_end"] <= t)).any()
        later = rows["t_begin"][k + 1 :][rows["t_begin"][k + 1 :] >= t]
        if not pressed:
            yield t, float(row["v_out"][1]), float(later.min(initial=end)) - t


def _of_top(run: Trajectory) -> Any:
    """Contacts of the top ball."""
    return run.contacts[run.contacts["pair"] == run.scene.n - 2]
