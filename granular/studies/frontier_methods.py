"""Methods for `frontier`, with their settings, and the errors of their results.

The methods are the methods of this package, and programs that a user would write with scipy. These programs solve the
same equations with clipped forces, with or without event location.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np

from granular import edmd, md
from granular._engine.check import Array
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, resolved
from granular.md.binary import restitution_of
from granular.md.fixed.integrators import INTEGRATORS
from granular.run import until as stop
from granular.run.trajectory import Trajectory
from granular.scene import Scene
from granular.studies.reference import (
    Newton,
    Reference,
    ReferenceContact,
    TooMuchWork,
    solve_with,
)
from granular.studies.reference_events import Logbook

LOCATED_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
COARSEST_STEPS, STEP_RATIO, STEP_COUNT = 8, 4, 8
"""Steps per shortest contact: first value, factor, and number of values.

Each value gives one time step of a fixed-step method.
"""
MAX_STEPS_BY_ENGINE = {"compiled": 3_000_000, "plain": 100_000}
SCIPY_SOLVERS = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}
SCIPY_METHODS = (*(f"{name}+events" for name in SCIPY_SOLVERS), *SCIPY_SOLVERS)
FRONTIER_METHODS = ("located", *INTEGRATORS, "edmd", *SCIPY_METHODS)
RELATIVE_TOLERANCES = {"DOP853": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14), "LSODA": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
        "Radau": (1e-4, 1e-6, 1e-8, 1e-10)}
MAX_EVALUATIONS = 60_000
"""Maximum number of force evaluations of a scipy solver."""
SAMPLES_PER_STEP = 8
"""Samples per step at which contacts of a solver without events are detected."""
EXTRA_CONTACT_SHARE = 0.05
"""Fraction of the longest contact by which a solver without events continues.

The end of the last contact is then inside its solution.
"""


@dataclass(frozen=True)
class Outcome:
    """Result of one run of a method."""

    contacts: Callable[[], Sequence[ReferenceContact]]
    """Return the contacts. Their extraction is not part of the run time."""
    work: int
    unit: str
    status: str


@dataclass(frozen=True)
class Method:
    """A way to solve the scene: `run(setting)` for each of `settings`.

    The settings are values of `setting_name`, such as "dt" in s, "tol" or "rtol".
    """

    name: str
    setting_name: str
    settings: tuple[float, ...]
    run: Callable[[float], Outcome]


@dataclass(frozen=True)
class Task:
    """The problem that every method solves, and its reference solution."""

    scene: Scene
    laws: tuple[Any, ...]
    until: stop.Until | None
    t_end: float | None
    truth: Reference

    @cached_property
    def resolved(self) -> SceneLaws:
        """The laws of all pairs with their properties."""
        return resolved(self.laws, self.scene)


def package_method(task: Task, name: str) -> Method:
    """Return the method of this package with that name, with its settings."""
    end: dict[str, Any] = {"until": task.until, "t_end": task.t_end}
    if name == "edmd":
        rule = restitution_of(task.laws, task.scene)
        return Method(name, "", (math.nan,), lambda _: _outcome(edmd.simulate(task.scene, rule, **end), "events"))
    setting_name, unit, engine = "tol", "steps", _engine(task, name)
    settings: tuple[float, ...] = LOCATED_TOLERANCES
    if name in INTEGRATORS:
        setting_name, unit, settings = "dt", "evaluations", _steps(task.truth, MAX_STEPS_BY_ENGINE[engine])
    elif all(law.is_linear for law in task.resolved.each):
        setting_name, settings = "", (math.nan,)

    def run(setting: float) -> Outcome:
        options: dict[str, Any] = {setting_name: setting} if setting_name else {}
        return _outcome(md.simulate(task.scene, task.laws, **end, method=name, engine=engine, **options), unit)

    return Method(name, setting_name, settings, run)


def _steps(truth: Reference, max_steps: int) -> tuple[float, ...]:
    """Return time steps in s: the shortest contact divided by 8, 32, 128, …

    Time steps are left out if all contacts of the reference together take more than `max_steps` steps.
    """
    shortest = min(truth.durations)
    ends = [truth.t_stop if row.t_end is None else float(row.t_end) for row in truth.contacts]
    latest_end = accumulate([-math.inf, *ends], max)
    contact_time = sum(max(0.0, end - max(float(row.t_begin), previous_end))
                 for row, end, previous_end in zip(truth.contacts, ends, latest_end, strict=False))
    steps = [COARSEST_STEPS * STEP_RATIO**k for k in range(STEP_COUNT)]
    return tuple(shortest / n for n in steps if n * contact_time / shortest <= max_steps)


def _engine(task: Task, name: str) -> str:
    """Return "compiled" if the method can run compiled on `task`, otherwise "plain"."""
    options: dict[str, Any] = {"dt": min(task.truth.durations)} if name in INTEGRATORS else {}
    try:
        md.simulate(task.scene, task.laws, t_end=0.0, method=name, engine="compiled", **options)
    except (ImportError, TypeError):
        return "plain"
    return "compiled"


def _outcome(run: Trajectory, unit: str) -> Outcome:
    work = run.stats.get(unit, run.stats.get("events", 0))
    return Outcome(lambda: contacts_of(run), int(work), unit, run.status.name)


def expected_orders(task: Task, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return for each fixed-step method its textbook order p, and min(p, 1+s).

    The force of a contact begins as t^s. The smallest s of all laws counts, and the second value is nan if s is
    unknown.
    """
    min_power = float(np.min([_onset_power(law) for law in task.resolved.each]))  # nan if one is
    orders = {name: INTEGRATORS[name].order for name in names if name in INTEGRATORS}
    return {name: (order, float(np.minimum(order, 1.0 + min_power))) for name, order in orders.items()}


def _onset_power(law: PairLaw) -> float:
    """Return s if the force of a contact begins as t^s, or nan if s is unknown."""
    if law.form is not None:
        return law.form[3] if law.form[2] else law.form[1]
    return math.nan if law.exponent is None or law.rate_dependent else float(law.exponent)


def scipy_method(task: Task, name: str) -> Method | None:
    """Return the scipy method of that name, with its settings.

    The result is None for a method without events if a law has memory, because xi_max is unknown inside a step. It is
    also None if a wall is thermal, because velocities jump there.
    """
    solver_name, _, events = name.partition("+")
    if not events and (task.scene.heated or any(law.memory for law in task.resolved.each)):
        return None
    integrate, solver = _with_events if events else _without_events, SCIPY_SOLVERS[solver_name]

    def run(rtol: float) -> Outcome:
        try:
            return integrate(task, solver, rtol)
        except TooMuchWork:
            return Outcome(tuple, MAX_EVALUATIONS, "evaluations", "stopped")

    return Method(name, "rtol", RELATIVE_TOLERANCES[solver], run)


def _with_events(task: Task, solver: str, rtol: float) -> Outcome:
    solution, work = solve_with(task.scene, task.resolved, task.until, task.t_end, solver, rtol, MAX_EVALUATIONS)
    return Outcome(lambda: solution.contacts, work, "evaluations", solution.status)


def _without_events(task: Task, solver: str, rtol: float) -> Outcome:
    """Solve a task with one call of `solve_ivp`, without events."""
    from scipy.integrate import solve_ivp

    truth, newton = task.truth, Newton(task.scene, task.resolved, MAX_EVALUATIONS)
    end = truth.t_stop + (0.0 if truth.status == "time" else EXTRA_CONTACT_SHARE * max(truth.durations))
    solution = solve_ivp(newton, (0.0, end), newton.start(), dense_output=True, method=solver, rtol=rtol,
                     atol=rtol * newton.scales())
    return Outcome(lambda: _contacts_of_solution(task, newton, solution), newton.evaluations, "evaluations",
                   "time" if solution.success else "failed")


def _contacts_of_solution(task: Task, newton: Newton, solution: Any) -> tuple[ReferenceContact, ...]:
    """Return the contacts of a solution without events.

    Changes between force and no force are detected at samples. Their times are then computed by root finding.
    """
    knots = np.unique(np.linspace(solution.t[:-1], solution.t[1:], SAMPLES_PER_STEP + 1))
    log, changes = Logbook(task.until), []

    def overlaps_and_rates(t: float) -> Array:
        """Return overlaps in m and rates in m/s at a time in s."""
        return np.asarray(newton.driven_by(newton.zero + t, solution.sol(t)))

    states = [overlaps_and_rates(t) for t in knots.tolist()] if newton.paths else solution.sol(knots).T
    for c in range(newton.pairs):
        has_force = [False] + [newton.force(c, float(y[c]), float(y[newton.pairs + c])) > 0.0 for y in states]
        changes += [(_force_change_time(task, newton, overlaps_and_rates, c, knots[max(i - 1, 0)], knots[i]), c,
                     has_force[i + 1])
                    for i in range(len(knots)) if has_force[i] != has_force[i + 1]]
    for t, c, begins in sorted(changes):
        lower, upper = newton.velocities(solution.sol(t), t)[list(task.scene.bodies(c))].tolist()
        speeds = lower, upper
        if begins and log.begin(c, t, speeds):
            break
        if not begins:
            log.end(c, t, speeds)
    return log.contacts()


def _force_change_time(task: Task, newton: Newton, state: Any, c: int, a: float, b: float) -> float:
    """Return the time in s in [`a`, `b`] at which the force of pair c begins or ends.

    Without a sign change in the interval, `a` is returned. `state` is a function of time that returns overlaps in m and
    their rates in m/s.
    """
    from scipy.optimize import brentq

    crosses = not task.resolved[c].rate_dependent or (state(a)[c] > 0.0) != (state(b)[c] > 0.0)

    def value(t: float) -> float:
        y: Array = state(t)
        return float(y[c]) if crosses else newton.bracket(c, float(y[c]), float(y[newton.pairs + c]))

    no_sign_change = (value(a) > 0.0) == (value(b) > 0.0)
    return a if no_sign_change else float(brentq(value, a, b, xtol=1e-300, rtol=1e-15))


def contacts_of(run: Trajectory) -> tuple[ReferenceContact, ...]:
    """Return the contact log of a trajectory in the form of the reference."""
    rows = []
    for row in run.contacts:
        ended = not math.isnan(float(row["v_out"][0]))
        v_in, v_out = ((float(v[0]), float(v[1])) for v in (row["v_in"], row["v_out"]))
        out = (float(row["t_end"]), v_out) if ended else (None, None)
        rows.append(ReferenceContact(int(row["pair"]), float(row["t_begin"]), v_in, *out))
    return tuple(rows)


def errors(truth: Reference, contacts: Sequence[ReferenceContact], pairs: int) -> tuple[float, float, bool]:
    """Return the errors of velocities and times, and whether a contact count is wrong.

    `granular.studies.frontier_result.Row` defines the units. `pairs` is the number of pairs.
    """
    contacts_of_pairs = [(truth.of(c), [row for row in contacts if row.pair == c]) for c in range(pairs)]
    velocity = float(np.max([  # nan if one is
        _velocity_error(expected, computed) for expected, computed in contacts_of_pairs
    ])) / truth.impact_speed
    if any(len(expected) != len(computed) for expected, computed in contacts_of_pairs):
        return velocity, math.nan, True
    time = max((_time_error(a, b) for expected, computed in contacts_of_pairs
                for a, b in zip(expected, computed, strict=True)), default=0.0)
    return velocity, time / max(truth.durations, default=math.nan), False


def _velocity_error(expected: Sequence[ReferenceContact], computed: Sequence[ReferenceContact]) -> float:
    """Return the largest velocity difference in m/s after the last contact that ended.

    It is nan if only one of the two sequences has a contact that ended, and 0 if neither has one.
    """
    last = [next((row.v_out for row in reversed(rows) if row.v_out is not None), None) for rows in (expected, computed)]
    if None in last:
        return 0.0 if last[0] is last[1] else math.nan
    return max(float(abs(a - b)) for a, b in zip(*last, strict=True))


def _time_error(expected: ReferenceContact, computed: ReferenceContact) -> float:
    return max(float(abs(a - b)) for a, b in ((expected.t_begin, computed.t_begin), (expected.t_end, computed.t_end))
               if a is not None and b is not None)
