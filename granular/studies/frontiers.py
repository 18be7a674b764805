"""`frontier`: error and run time of many methods at many settings, for one scene."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granular import md
from granular._engine import check, signature
from granular._engine.progress import ProgressCallback, progress_callback
from granular._engine.reports import machine
from granular.laws.kinds import checked
from granular.run import until as stop
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene, checked as a_scene
from granular.studies.frontier_methods import (
    FRONTIER_METHODS,
    SCIPY_METHODS,
    Method,
    Task,
    contacts_of,
    errors,
    expected_orders,
    package_method,
    scipy_method,
)
from granular.studies.frontier_result import Frontier, Row, floor
from granular.studies.reference import Reference, solve

__all__ = ["Frontier", "Row", "frontier"]

MAX_REFERENCE_DIFFERENCE = 1e-3
"""Maximum difference of a reference from the default method.

It is in units of the impact speed. If the difference is larger, the reference belongs to another scene.
"""
REPEAT_SECONDS = 0.05
"""Total time in s after which a run is not repeated."""


@signature.face
def frontier(
    scene: Scene,
    law: Any,
    *,
    until: stop.Until | None = None,
    t_end: float | None = None,
    methods: Sequence[str] | None = None,
    repeats: int = 3,
    reference: Reference | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
) -> Frontier:
    """Measure error against run time of every method on one scene.

    Parameters
    ----------
    scene : Scene
        The initial state.
    law : force law or sequence of force laws
        Force law, one for all pairs or one per pair from the bottom up.
    until, t_end : stop condition, float, optional
        End of the run, as in `granular.md.simulate`.
    methods : sequence of str, optional
        Methods to measure, from located, verlet, symplectic-euler, rk4, gear5, edmd, dop853, lsoda, radau,
        dop853+events, lsoda+events, radau+events. Defaults to all. The last six are methods of SciPy.
    repeats : int
        Maximum number of runs of each setting, of which the fastest counts. Defaults to 3. A setting is not repeated
        after a total time of 0.05 s. Each method first runs once at its cheapest setting, which is not timed.
    reference : Reference, optional
        Solution of the same scene, law and stop condition. Defaults to `granular.studies.reference.solve`: SciPy's
        DOP853 restarted at events, whose reported error is 4e-12 to 7e-10 of the impact speed. Smaller errors are not
        resolved unless a more accurate reference is given.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called after each setting of a method, with the fraction of finished settings
        and their number.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.

    Returns
    -------
    Frontier
        Rows of error and run time, measured orders, and a figure.

    Raises
    ------
    TypeError, ValueError
        For misuse, and for a scene in which no contact ends. Also for a scene that comes to rest, if neither `t_end`
        nor `reference` is given.

    Notes
    -----
    Errors are identical in repeated calls. Run times are not. They are processor times on one core. Number and values
    of the settings are determined by the reference, not by measured times.

    Examples
    --------
    >>> import granular as gr
    >>> scene = gr.scenes.three_balls(gap=1e-3)
    >>> law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    >>> found = gr.frontier(scene, law, until=gr.until.contact(pair=0, nth=2), methods=["located", "verlet"])
    >>> found.fastest(1e-9).method
    'located'
    """
    laws = checked(law, a_scene(scene)).given
    stop.refuse_levels(stop.checked(until, scene), "frontier")
    chosen = FRONTIER_METHODS if methods is None else check.choices("methods", methods, FRONTIER_METHODS, 1)
    check.of_kind("reference", reference, Reference | None, "a Reference, as granular.studies.reference.solve returns")
    count = check.integer("repeats", repeats, at_least=1)
    with progress_callback(progress, on_progress, "settings") as tell:
        run = md.simulate(scene, laws, until=until, t_end=t_end)
        if reference is None:
            check.raise_if_true({
                _no_contact_message(scene): np.isnan(run.contacts["t_end"]).all(),
                "`t_end` or `until` must be given if the balls come to rest, got None. The reference solution would "
                "not end.": run.status is Status.resting and t_end is None,
            })
        truth = reference or solve(scene, laws, until=until, t_end=t_end)
        if not truth.durations:
            raise ValueError(_no_contact_message(scene) if reference is None else (
                f"`reference` must have a contact that ends, got none up to t = {float(truth.t_stop):g} s. Compute it "
                "with the same `t_end` and `until`."))
        task = Task(scene, laws, until, t_end, truth)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # coarse steps and wide tolerances are tried on purpose
            level = rounding_level(task)
            _check_reference(truth, run, level)
            compared = [*filter(None, (scipy_method(task, name) if name in SCIPY_METHODS else package_method(task, name)
                                       for name in chosen))]
            rows = _measured_rows(task, compared, count, level, tell)
    return Frontier(
        scene, laws, until, t_end, reference=truth, rows=rows,
        dials={method.name: method.setting_name for method in compared}, orders=expected_orders(task, chosen),
        rounding_level=level, machine=machine(),
    )


def _check_reference(truth: Reference, run: Trajectory, level: float) -> None:
    """Raise `ValueError` if a reference belongs to another scene, law or end.

    `level` is the rounding level. If rounding errors can explain any difference, no error is raised.
    """
    error, _, wrong = errors(truth, contacts_of(run), run.scene.n_pairs)
    matches = (
        not wrong
        and error <= MAX_REFERENCE_DIFFERENCE
        and math.isclose(truth.t_stop, run.time[-1], rel_tol=MAX_REFERENCE_DIFFERENCE)
    )
    if level < MAX_REFERENCE_DIFFERENCE and not matches:
        raise ValueError(f"`reference` must belong to this scene, law and end, with {len(run.contacts)} contacts until "
                         f"{run.time[-1]:g} s, got {len(truth.contacts)} contacts until {float(truth.t_stop):g} s.")


def _no_contact_message(scene: Scene) -> str:
    return (f"`scene` must have a contact that ends within the run, got none for {scene}. Choose a later end, or balls "
            "that meet.")


def _measured_rows(
    task: Task, methods: Sequence[Method], repeats: int, level: float, report_progress: ProgressCallback | None
) -> tuple[Row, ...]:
    """Run all methods at all their settings, and return errors and run times."""
    rows, count = list[Row](), sum(len(method.settings) for method in methods)
    for method in methods:
        for setting in method.settings[:1]:  # warms up, at the cheapest setting
            method.run(setting)
        for setting in method.settings:
            rows.append(_row(task, method, setting, repeats, level))
            if report_progress is not None:
                report_progress(len(rows) / count, len(rows))
    return tuple(rows)


def _row(task: Task, method: Method, setting: float, repeats: int, level: float) -> Row:
    """Run one method at one setting, repeatedly, and return its error and run time."""
    times: list[float] = []
    while len(times) < repeats and sum(times) <= REPEAT_SECONDS:
        begin = time.thread_time()
        outcome = method.run(setting)
        times.append(time.thread_time() - begin)
    v_error, t_error, wrong = errors(task.truth, outcome.contacts(), task.scene.n_pairs)
    return Row(method=method.name, setting=setting, velocity_error=v_error, time_error=t_error, wrong_count=wrong,
               rounding=v_error <= floor(task.truth, level) and not wrong, seconds=min(times), work=outcome.work,
               unit=outcome.unit, status=outcome.status)


def rounding_level(task: Task) -> float:
    """Return the change of velocities if inputs change by one unit in the last digit.

    It is in units of the impact speed, and at least the machine epsilon. All gaps and velocities change, in two
    different patterns of signs.
    """
    unchanged, *changed = (contacts_of(md.simulate(scene, task.laws, until=task.until, t_end=task.t_end))
                     for scene in _scenes_within_rounding(task.scene))
    truth = Reference(unchanged, task.truth.t_stop, "", "")
    changes = (errors(truth, contacts, task.scene.n_pairs)[0] for contacts in changed)
    return max([float(np.finfo(float).eps), *(change for change in changes if not math.isnan(change))])


def _scenes_within_rounding(scene: Scene) -> list[Scene]:
    """Return the scene, and two with the next larger or smaller gaps and velocities."""
    sign = np.where(np.arange(scene.n) % 2, -math.inf, math.inf)
    sides = ((scene.sides(direction)[0], direction) for direction in (sign, -sign))
    return [scene, *(scene.replace(gap=_next_number(scene.gap, below), velocity=_next_number(scene.velocity, direction))
                     for below, direction in sides)]


def _next_number(numbers: check.Array, direction: check.Array) -> check.Array:
    """Return the next floating-point numbers in `direction`: inf is up, -inf is down.

    The number 0 does not change.
    """
    return np.where(numbers == 0.0, 0.0, np.nextafter(numbers, direction))
