"""First time at which a speed, a position or a force exceeds a level.

This implements `granular.until.speed`, `position` and `force` for event-driven runs.

Between two events all motion is smooth, so the observable is represented by Chebyshev polynomials. Where their bound is
below the level, the level is not reached. Where they increase monotonically, the two ends decide, and a bisection finds
the time to the last bit. Any other interval is cut in two. Every crossing that exceeds rounding is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from granular.run import until as stop
from granular.run.drive import Pause
from granular.scene import Scene
from granular.scene.places import positions, velocities

FIT_DEGREE = 8
FIT_NODES = 0.5 * (1.0 + np.cos(np.pi * np.arange(FIT_DEGREE + 1) / FIT_DEGREE))
"""Nodes of an interval as shares of its length, from its end to its begin."""
FIT_MATRIX = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * FIT_NODES - 1.0, FIT_DEGREE))
"""Matrix from values at the nodes to Chebyshev coefficients."""
MAX_SLOPES = np.arange(2, FIT_DEGREE + 1) ** 2
"""Largest slopes of the Chebyshev polynomials of degree 2 and higher."""
LEVEL_ROUNDING = 2.0**-48
"""Relative rounding error of the values."""
MAX_FLIGHT_TIME, FIRST_WINDOW = 2.0**300, 1.0
"""Largest time in s up to which endless free flight is followed.

WINDOW is the time in s that is searched first, and the step in which the path of a wall is followed.
"""


def first_above(watched: Callable[[float], float], sign: float, level: float, begin: float, end: float) -> float:
    """Return the first time at which sign·watched - level is positive.

    The search is from `begin` to `end`. The result is inf if the value is never positive.
    """
    def above(t: float) -> bool:
        return sign * watched(t) > level

    stretches = [(begin, end)]
    while stretches:
        a, b = stretches.pop()
        if above(a):
            return a
        values = sign * np.array([watched(min(b, a + part * (b - a))) for part in FIT_NODES.tolist()]) - level
        c = FIT_MATRIX @ values
        noise = LEVEL_ROUNDING * (float(np.abs(values).max()) + abs(level))
        # Σ |c| bounds the polynomial; twice the last two coefficients estimate the truncation error
        if not c[0] + np.abs(c[1:]).sum() + 2.0 * np.abs(c[-2:]).sum() > noise:
            continue
        # the linear term exceeds the largest slope of all other terms
        rises = c[1] > np.abs(c[2:]) @ MAX_SLOPES + MAX_SLOPES[-1] * np.abs(c[-2:]).sum()
        middle = 0.5 * (a + b)
        if not a < middle < b or rises:
            if above(b):
                return halved(above, a, b)
        else:
            # a stack: the earlier half is searched first
            stretches += [(middle, b), (a, middle)]
    return math.inf


def halved(above: Callable[[float], bool], low: float, high: float) -> float:
    """Return the first float at which `above` holds, by bisection.

    It does not hold at `low`, and holds at `high`.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if above(middle) else (middle, high)
    return high


def first_met(
    watched: Callable[[float], float], level: stop.Level, scene: Scene, begin: float, end: float
) -> float:
    """Return the time in s at which an observable first passes the level.

    The search is from `begin` to `end`. The result is inf if the level is not passed.
    """
    if scene.pendulum > 0.0:  # free pendula are periodic
        end = min(end, begin + 2.0 * math.pi / scene.pendulum)
    below = level.below if isinstance(level, stop.Position) else None
    sides = [(-1.0, -below)] if below is not None else [(1.0, level.above or 0.0)]
    # a speed exceeds the level with either sign of the velocity
    sides += [(-1.0, level.above)] if isinstance(level, stop.Speed) else []
    seen, span = cache(watched), FIRST_WINDOW
    while True:
        until = begin + span if end == math.inf else end
        found = min(first_above(seen, sign, high, begin, until) for sign, high in sides)
        if found < math.inf or until == end or span > MAX_FLIGHT_TIME:
            return found
        begin, span = until, 2.0 * span


def shown(run: Any, level: stop.Level, time: float) -> float:
    """Evaluate the observable at `time` from a row of the run.

    The time must not be after the next event.
    """
    row = run.row(time)
    if isinstance(level, stop.Force):
        return float(row.force[level.pair])
    elapsed = np.array([row.elapsed])
    if isinstance(level, stop.Position):
        return float(positions(run.scene, row.gap[None], elapsed, run.start)[0, level.ball])
    speeds = row.velocity if row.rate is None else velocities(run.scene, row.rate[None], elapsed, run.start)[0]
    return float(speeds[level.ball])


class Watched:
    """Wrapper of a `granular.run.drive.Run` that ends it when a level is passed.

    The run advances one event at a time. The module `between` provides the time up to which no event occurs (`calm`),
    and the observable until then (`watched`).
    """

    def __init__(self, run: Any, between: Any) -> None:
        self.run, self.between = run, between

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)

    def to(self, time: float, last: bool) -> Pause:
        """Advance towards `time`, up to the next event or to the crossing of the level."""
        run, level, (begin, due) = self.run, self.run.request.until, self.between.calm(self.run)
        if run.scene.driven and due == math.inf:
            # the path of a driven wall is followed in windows, because it can be endless
            due = begin + FIRST_WINDOW
        # one float beyond the event, so that it takes place
        goal = min(math.nextafter(due, math.inf), time)
        met = first_met(self.between.watched(run, level), level, run.scene, begin, min(due, time))
        if met == math.inf:
            pause: Pause = run.to(goal, last or goal < time)
            return Pause.full if pause is Pause.reached and goal < time else pause
        pause = Pause.reached if met == begin else run.to(met, True)
        run.row(met)  # the last row that is read
        return Pause.until if pause is Pause.reached else pause
