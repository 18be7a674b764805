"""An independent solution of a scene, against which engines are measured, with an estimate of its own error.

SciPy's DOP853 is restarted at every event. It shares no code with the methods of `granular.md`: a driven wall is read
here as the sine or the polynomials that define it. Each scene is solved with two tolerances, and the difference is the
reported error. In the six scenes of `docs/frontier.md` it is 4e-12 to 7e-10 of the impact speed, 3 to 40 times the true
error (4e-13 to 6e-11).

A first reader may skip: `driven`, `events`, `restarted`, `verification`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

from granular._engine import check
from granular.laws.kinds import SceneLaws, checked
from granular.run import until as stop
from granular.scene import Scene, checked as a_scene
from granular.scene.places import Closing, fitted
from granular.studies.reference import restarted
from granular.studies.reference.events import Reference, ReferenceContact, distance

__all__ = ["Reference", "ReferenceContact", "solve"]

TOLERANCES = (3e-14, 1e-12)
"""Relative tolerances of the two solutions by DOP853."""


class Problem(NamedTuple):
    """Checked inputs of a reference solution; times in s."""

    scene: Scene
    laws: SceneLaws
    until: stop.Until | None
    t_end: float | None
    t_start: float


def solve(
    scene: Scene, law: Any, *, until: stop.Until | None = None, t_end: float | None = None, t_start: float = 0.0,
) -> Reference:
    """Solve a scene of soft spheres independently of the engines, and estimate the error of the solution.

    Parameters
    ----------
    scene : Scene
        Initial state.
    law : force law or sequence of them
        One for all pairs, or one per pair from the bottom up.
    until, t_end : stop condition, float, optional
        When to stop. A scene that never comes to an end requires one of them.
    t_start : float
        Time in s of the initial state.

    Returns
    -------
    Reference
        Contacts with estimated errors.

    Raises
    ------
    ValueError
        If the scene does not come to an end, the path of a wall ends before, or walls meet.

    Notes
    -----
    A `Sine` wall is evaluated in closed form, a `Motion` by its panels. Each period of a driven wall, and each piece of
    its path, is integrated in at least twenty steps. Shorter contacts can be missed.
    """
    problem = checked_problem(scene, law, until, t_end, t_start)
    best, other = (restarted.solve(*problem[:4], "DOP853", rtol, t_start=problem.t_start)[0] for rtol in TOLERANCES)
    v_error, t_error = distance(best, other)
    return replace(best, velocity_error=v_error, time_error=t_error)


def checked_problem(scene: Scene, law: Any, until: stop.Until | None, t_end: float | None, t_start: float) -> Problem:
    """Check the inputs of a reference solution and fit the walls' paths to its duration."""
    start = check.number("t_start", t_start)
    stop.without_levels(stop.checked(until, a_scene(scene)), "the reference")
    end = None if t_end is None else check.number("t_end", t_end, at_least=start)
    scene = fitted(scene, start, math.inf if end is None else end)
    if end is not None:
        Closing(scene, start, flattened=True).refuse(end, end)
    return Problem(scene, checked(law, scene), until, end, start)
