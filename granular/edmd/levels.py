"""Observables of a hard-sphere run as functions of time between two events.

`granular.run.levels` uses them to find the time at which an observable reaches a level.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from granular._engine.records import plain
from granular.edmd.motion import velocities
from granular.edmd.zoom import next_collision
from granular.run.levels import observable_value
from granular.run.until import Level, Speed


def calm(run: Any) -> tuple[float, float]:
    """Return the current time and the time of the next event of a run, both in s."""
    state, queue = run.state, run.queue
    if state.near is None:
        return run.time(), float(state.time(queue.soonest()))
    r, (pairs, _) = state.run, state.slices()  # in relative coordinates
    dt = queue.fit(next_collision)(r, plain(state.near), plain(pairs))[1]
    outside = queue.soonest(r.first, r.first + len(pairs) - 1)
    return run.time(), float(state.time(min(r.began + r.elapsed + dt, outside)))


def watched(run: Any, level: Level) -> Callable[[float], float]:
    """Return the observable of `level` as a function of the time in s.

    The function is valid from the current time to the next event. A velocity is computed from the record of its ball
    alone.
    """
    state = run.state
    if not isinstance(level, Speed) or run.scene.driven:
        return partial(observable_at, run, level)
    (body,), velocities_of, g = (
        plain(state.bodies[level.ball : level.ball + 1]), run.queue.fit(velocities), state.run["gravity"])

    def velocity(time: float) -> float:
        tau = state.tau(time)
        return float(velocities_of(body, body, float(g), tau)[0] - (run.fall * state.elapsed(tau) - run.drift))

    return velocity


def observable_at(run: Any, level: Level, time: float) -> float:
    """Return the value of the observable of `level` at `time` (s).

    `time` must not be later than the next event. The run is not advanced.
    """
    r = run.state.run
    now, r["now"] = r["now"], run.state.tau(time)
    value = observable_value(run, level, time)
    r["now"] = now
    return value
