"""Hard spheres between two events, for whom watches a ball: when the next event is, and how fast it is until then."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from granular._engine.records import plain
from granular.edmd.motion import velocities
from granular.edmd.zoom import soonest
from granular.run.levels import shown
from granular.run.until import Level, Speed


def calm(run: Any) -> tuple[float, float]:
    """Return the time in s up to which a run has got, and that of the next event."""
    state, queue = run.state, run.queue
    if state.near is None:
        return run.time(), float(state.time(queue.soonest()))
    r, (pairs, _) = state.run, state.slices()  # a closer look
    dt = queue.fit(soonest)(r, plain(state.near), plain(pairs))[1]
    outside = queue.soonest(r.first, r.first + len(pairs) - 1)
    return run.time(), float(state.time(min(r.began + r.elapsed + dt, outside)))


def watched(run: Any, level: Level) -> Callable[[float], float]:
    """Return what is watched as a function of the time in s up to the next event; a velocity from the ball alone."""
    state = run.state
    if not isinstance(level, Speed) or run.scene.driven:
        return partial(ahead, run, level)
    (body,), show, g = plain(state.bodies[level.ball : level.ball + 1]), run.queue.fit(velocities), state.run["gravity"]

    def velocity(time: float) -> float:
        tau = state.tau(time)
        return float(show(body, body, float(g), tau)[0] - (run.fall * state.elapsed(tau) - run.drift))

    return velocity


def ahead(run: Any, level: Level, time: float) -> float:
    """Return what is watched as a row shows it, at a time up to the next event; the run stays where it is."""
    r = run.state.run
    now, r["now"] = r["now"], run.state.tau(time)
    value = shown(run, level, time)
    r["now"] = now
    return value
