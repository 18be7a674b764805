"""When a speed, a place or a force first passes a level: `granular.until.speed` and its like, for runs that go from
event to event.

Between two events all motion is smooth, so what is watched is a few Chebyshev polynomials. Where their bound is below
the level nothing is met; where they only rise, the two ends decide, and halving finds the moment to the last bit. Any
other stretch is cut in two. So no crossing is missed that is higher than rounding.
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

DEGREE = 8
PLACES = 0.5 * (1.0 + np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE))
"""Where a stretch is looked at, as a part of it; the first is its end, the last its begin."""
FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * PLACES - 1.0, DEGREE))
"""Chebyshev coefficients from values there."""
SLOPES = np.arange(2, DEGREE + 1) ** 2
"""The steepest that polynomials from the second on are."""
ROUNDING = 2.0**-48
"""Part of the values below which they say nothing."""
FARTHEST, WINDOW = 2.0**300, 1.0
"""Time in s up to which free flight that never ends is followed; and how far the path of a wall, at a time."""


def first_above(watched: Callable[[float], float], sign: float, level: float, begin: float, end: float) -> float:
    """Return the first time from `begin` to `end` at which sign·watched - level is positive; inf if it never is."""
    def above(t: float) -> bool:
        return sign * watched(t) > level

    stretches = [(begin, end)]
    while stretches:
        a, b = stretches.pop()
        if above(a):
            return a
        values = sign * np.array([watched(min(b, a + part * (b - a))) for part in PLACES.tolist()]) - level
        c = FIT @ values
        noise = ROUNDING * (float(np.abs(values).max()) + abs(level))
        if not c[0] + np.abs(c[1:]).sum() + 2.0 * np.abs(c[-2:]).sum() > noise:
            continue
        rises = c[1] > np.abs(c[2:]) @ SLOPES + SLOPES[-1] * np.abs(c[-2:]).sum()
        middle = 0.5 * (a + b)
        if not a < middle < b or rises:
            if above(b):
                return halved(above, a, b)
        else:
            stretches += [(middle, b), (a, middle)]
    return math.inf


def halved(above: Callable[[float], bool], low: float, high: float) -> float:
    """Return the first number at which `above` holds, from `low`, where it does not, to `high`, where it does."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if above(middle) else (middle, high)
    return high


def first_met(
    watched: Callable[[float], float], level: stop.Level, scene: Scene, begin: float, end: float
) -> float:
    """Return when what is watched passes the level, from `begin` to `end` in s; inf if it does not."""
    if scene.pendulum > 0.0:  # which after a period swings as before
        end = min(end, begin + 2.0 * math.pi / scene.pendulum)
    below = level.below if isinstance(level, stop.Position) else None
    sides = [(-1.0, -below)] if below is not None else [(1.0, level.above or 0.0)]
    sides += [(-1.0, level.above)] if isinstance(level, stop.Speed) else []
    seen, span = cache(watched), WINDOW
    while True:
        until = begin + span if end == math.inf else end
        found = min(first_above(seen, sign, high, begin, until) for sign, high in sides)
        if found < math.inf or until == end or span > FARTHEST:
            return found
        begin, span = until, 2.0 * span


def shown(run: Any, level: stop.Level, time: float) -> float:
    """Return what is watched as a row shows it, at a time up to the next event."""
    row = run.row(time)
    if isinstance(level, stop.Force):
        return float(row.force[level.pair])
    elapsed = np.array([row.elapsed])
    if isinstance(level, stop.Position):
        return float(positions(run.scene, row.gap[None], elapsed, run.start)[0, level.ball])
    speeds = row.velocity if row.rate is None else velocities(run.scene, row.rate[None], elapsed, run.start)[0]
    return float(speeds[level.ball])


class Watched:
    """A `granular.run.drive.Run` that ends where a level is passed: the run itself, one event at a time.

    The module `between` says up to when nothing happens to it (`calm`), and what is watched until then (`watched`).
    """

    def __init__(self, run: Any, between: Any) -> None:
        self.run, self.between = run, between

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)

    def to(self, time: float, last: bool) -> Pause:
        """Go on towards `time`, to the next event or to where the level is passed."""
        run, level, (begin, due) = self.run, self.run.request.until, self.between.calm(self.run)
        if run.scene.driven and due == math.inf:
            due = begin + WINDOW
        goal = min(math.nextafter(due, math.inf), time)
        met = first_met(self.between.watched(run, level), level, run.scene, begin, min(due, time))
        if met == math.inf:
            pause: Pause = run.to(goal, last or goal < time)
            return Pause.full if pause is Pause.reached and goal < time else pause
        pause = Pause.reached if met == begin else run.to(met, True)
        run.row(met)  # the last that is read
        return Pause.until if pause is Pause.reached else pause
