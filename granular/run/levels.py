"""First time at which a speed, a position or a force passes a level.

This implements the stop conditions `granular.until.speed`, `position` and `force`.

Between two events all motion is smooth, so the speed, position or force is approximated by a Chebyshev polynomial in an
interval of time. If an upper bound of the polynomial is below the level, the level is not reached. If
the polynomial is proved to increase, its values at both ends show whether the level is passed. A bisection then finds
the time to the last bit. Any other interval is halved. Every crossing that exceeds the rounding error is found.
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
"""Chebyshev nodes as fractions of an interval, from its end to its start."""
FIT_MATRIX = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * FIT_NODES - 1.0, FIT_DEGREE))
"""Matrix that converts values at the nodes to Chebyshev coefficients."""
MAX_SLOPES = np.arange(2, FIT_DEGREE + 1) ** 2
"""Largest slopes of the Chebyshev polynomials of degree 2 to `FIT_DEGREE`."""
LEVEL_ROUNDING = 2.0**-48
"""Relative rounding error of the values of an observable."""
MAX_FLIGHT_TIME, FIRST_WINDOW = 2.0**300, 1.0
"""Limits of the search in a run without end time, in s.

A free flight without a next event is searched up to `MAX_FLIGHT_TIME`. `FIRST_WINDOW` is the length of the first
interval that is searched, and of each interval at a driven wall.
"""


def first_above(watched: Callable[[float], float], sign: float, level: float, begin: float, end: float) -> float:
    """Return the first time in s at which sign·watched(time) exceeds `level`, or inf.

    `watched` is a smooth function of the time. The search is from `begin` to `end` in s.
    """
    def is_above(t: float) -> bool:
        return sign * watched(t) > level

    intervals = [(begin, end)]
    while intervals:
        a, b = intervals.pop()
        if is_above(a):
            return a
        values = sign * np.array([watched(min(b, a + node * (b - a))) for node in FIT_NODES.tolist()]) - level
        c = FIT_MATRIX @ values
        rounding_error = LEVEL_ROUNDING * (float(np.abs(values).max()) + abs(level))
        # Σ |c| bounds the polynomial; twice the last two coefficients estimate the truncation error
        if not c[0] + np.abs(c[1:]).sum() + 2.0 * np.abs(c[-2:]).sum() > rounding_error:
            continue
        # the linear term exceeds the largest slope of all other terms
        rises = c[1] > np.abs(c[2:]) @ MAX_SLOPES + MAX_SLOPES[-1] * np.abs(c[-2:]).sum()
        middle = 0.5 * (a + b)
        if not a < middle < b or rises:
            if is_above(b):
                return halved(is_above, a, b)
        else:
            # the last interval of the list is searched first: the earlier half
            intervals += [(middle, b), (a, middle)]
    return math.inf


def halved(is_above: Callable[[float], bool], low: float, high: float) -> float:
    """Return the first float at which the condition `is_above` is true, by bisection.

    The condition is false at `low` and true at `high`.
    """
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if is_above(middle) else (middle, high)
    return high


def first_crossing(
    watched: Callable[[float], float], level: stop.Level, scene: Scene, begin: float, end: float
) -> float:
    """Return the first time in s at which a stop condition on a level is met, or inf.

    `watched` is the observable as a function of the time. The search is from `begin` to `end` in s, between which no
    event occurs.
    """
    if scene.pendulum > 0.0:  # free pendula are periodic
        end = min(end, begin + 2.0 * math.pi / scene.pendulum)
    below = level.below if isinstance(level, stop.Position) else None
    sides = [(-1.0, -below)] if below is not None else [(1.0, level.above or 0.0)]
    # a speed exceeds the level with either sign of the velocity
    sides += [(-1.0, level.above)] if isinstance(level, stop.Speed) else []
    cached_watched, span = cache(watched), FIRST_WINDOW
    while True:
        until = begin + span if end == math.inf else end
        crossing = min(first_above(cached_watched, sign, value, begin, until) for sign, value in sides)
        if crossing < math.inf or until == end or span > MAX_FLIGHT_TIME:
            return crossing
        begin, span = until, 2.0 * span


def observable_value(run: Any, level: stop.Level, time: float) -> float:
    """Return the observable of the stop condition `level` at `time` in s.

    It is a force in N, a position in m or a velocity in m/s. `time` must not be after the next event of the run.
    """
    row = run.row(time)
    if isinstance(level, stop.Force):
        return float(row.force[level.pair])
    elapsed = np.array([row.elapsed])
    if isinstance(level, stop.Position):
        return float(positions(run.scene, row.gap[None], elapsed, run.start)[0, level.ball])
    speeds = row.velocity if row.rate is None else velocities(run.scene, row.rate[None], elapsed, run.start)[0]
    return float(speeds[level.ball])


class LevelStop:
    """Wrapper of a `granular.run.drive.Run` that ends the run when a level is passed.

    The run advances one event at a time.

    Parameters
    ----------
    run : Run
        Run of an event-driven engine.
    between : module
        Module `levels` of the engine. Its function `calm` returns the current time and the time of the next event, and
        its function `watched` the observable between them.
    """

    def __init__(self, run: Any, between: Any) -> None:
        self.run, self.between = run, between

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)

    def to(self, time: float, last: bool) -> Pause:
        """Advance towards `time` in s, and return the reason for the pause.

        The run pauses at the next event, or at the time at which the level is passed.
        """
        run, level, (now, next_event) = self.run, self.run.request.until, self.between.calm(self.run)
        if run.scene.driven and next_event == math.inf:
            # without a next event, the path of a driven wall is searched in windows, because it can be infinite
            next_event = now + FIRST_WINDOW
        # one float after the event, so that the run processes it
        target_time = min(math.nextafter(next_event, math.inf), time)
        crossing = first_crossing(self.between.watched(run, level), level, run.scene, now, min(next_event, time))
        if crossing == math.inf:
            pause: Pause = run.to(target_time, last or target_time < time)
            return Pause.full if pause is Pause.reached and target_time < time else pause
        pause = Pause.reached if crossing == now else run.to(crossing, True)
        run.row(crossing)  # no later state is requested
        return Pause.until if pause is Pause.reached else pause
