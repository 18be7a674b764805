"""Methods for `frontier`, with their settings, and the errors of their results.

They are the methods of this package, and programs that a user would write with scipy: the same equations, with clipped
forces, with and without events.
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
"""Steps per shortest contact at first, factor per point, and number of points."""
MAX_STEPS_BY_ENGINE = {"compiled": 3_000_000, "plain": 100_000}
SCIPY_SOLVERS = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}
SCIPY_METHODS = (*(f"{name}+events" for name in SCIPY_SOLVERS), *SCIPY_SOLVERS)
FRONTIER_METHODS = ("located", *INTEGRATORS, "edmd", *SCIPY_METHODS)
RELATIVE_TOLERANCES = {"DOP853": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14), "LSODA": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
        "Radau": (1e-4, 1e-6, 1e-8, 1e-10)}
MAX_EVALUATIONS = 60_000
"""Maximum number of force evaluations of a solver."""
SAMPLES_PER_STEP = 8
"""Samples per step in which a solver without events finds contacts."""
EXTRA_CONTACT_SHARE = 0.05
"""Share of the longest contact by which a solver without events continues.

It then finds the end of the last contact.
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

    The settings are values of `setting_name`.
    """

    name: str
    setting_name: str
    settings: tuple[float, ...]
    run: Callable[[float], Outcome]


@dataclass(frozen=True)
class Task:
    """The problem that every method solves."""

    scene: Scene
    laws: tuple[Any, ...]
    until: stop.Until | None
    t_end: float | None
    truth: Reference

    @cached_property
    def resolved(self) -> SceneLaws:
        """The laws with their properties."""
        return resolved(self.laws, self.scene)


def own(task: Task, name: str) -> Method:
    """Return the method of this package of that name."""
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


def _steps(truth: Reference, most: int) -> tuple[float, ...]:
    """Return time steps in s for given numbers of steps per contact time."""
    shortest = min(truth.durations)
    ends = [truth.t_stop if row.t_end is None else float(row.t_end) for row in truth.contacts]
    reached = accumulate([-math.inf, *ends], max)
    closed = sum(max(0.0, end - max(float(row.t_begin), before))
                 for row, end, before in zip(truth.contacts, ends, reached, strict=False))
    steps = [COARSEST_STEPS * STEP_RATIO**k for k in range(STEP_COUNT)]
    return tuple(shortest / n for n in steps if n * closed / shortest <= most)


def _engine(task: Task, name: str) -> str:
    """Return "compiled" if possible, otherwise "plain"."""
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
    """Return the textbook order p of fixed-step methods, and min(p, 1+s).

    s is the power of time with which forces begin.
    """
    least = float(np.min([_first_power(law) for law in task.resolved.each]))  # nan if one is
    orders = {name: INTEGRATORS[name].order for name in names if name in INTEGRATORS}
    return {name: (order, float(np.minimum(order, 1.0 + least))) for name, order in orders.items()}


def _first_power(law: PairLaw) -> float:
    """Return the power of time with which the force of a contact begins, or nan."""
    if law.form is not None:
        return law.form[3] if law.form[2] else law.form[1]
    return math.nan if law.exponent is None or law.rate_dependent else float(law.exponent)


def peer(task: Task, name: str) -> Method | None:
    """Return the method of scipy of that name.

    Without events there is none for laws with memory, because xi_max is unknown inside a step, and none for thermal
    walls, where velocities jump.
    """
    short, _, events = name.partition("+")
    if not events and (task.scene.heated or any(law.memory for law in task.resolved.each)):
        return None
    way, solver = _with_events if events else _without_events, SCIPY_SOLVERS[short]

    def run(rtol: float) -> Outcome:
        try:
            return way(task, solver, rtol)
        except TooMuchWork:
            return Outcome(tuple, MAX_EVALUATIONS, "evaluations", "stopped")

    return Method(name, "rtol", RELATIVE_TOLERANCES[solver], run)


def _with_events(task: Task, solver: str, rtol: float) -> Outcome:
    done, work = solve_with(task.scene, task.resolved, task.until, task.t_end, solver, rtol, MAX_EVALUATIONS)
    return Outcome(lambda: done.contacts, work, "evaluations", done.status)


def _without_events(task: Task, solver: str, rtol: float) -> Outcome:
    from scipy.integrate import solve_ivp

    truth, newton = task.truth, Newton(task.scene, task.resolved, MAX_EVALUATIONS)
    end = truth.t_stop + (0.0 if truth.status == "time" else EXTRA_CONTACT_SHARE * max(truth.durations))
    done = solve_ivp(newton, (0.0, end), newton.start(), dense_output=True, method=solver, rtol=rtol,
                     atol=rtol * newton.scales())
    return Outcome(lambda: _read(task, newton, done), newton.evaluations, "evaluations",
                   "time" if done.success else "failed")


def _read(task: Task, newton: Newton, done: Any) -> tuple[ReferenceContact, ...]:
    """Return contacts from a continuous solution: sign changes, then zeros."""
    knots = np.unique(np.linspace(done.t[:-1], done.t[1:], SAMPLES_PER_STEP + 1))
    log, changes = Logbook(task.until), []

    def seen(t: float) -> Array:
        """Return overlaps in m and rates in m/s at a time in s."""
        return np.asarray(newton.driven_by(newton.zero + t, done.sol(t)))

    states = [seen(t) for t in knots.tolist()] if newton.paths else done.sol(knots).T
    for c in range(newton.pairs):
        on = [False] + [newton.force(c, float(y[c]), float(y[newton.pairs + c])) > 0.0 for y in states]
        changes += [(_zero(task, newton, seen, c, knots[max(i - 1, 0)], knots[i]), c, on[i + 1])
                    for i in range(len(knots)) if on[i] != on[i + 1]]
    for t, c, begins in sorted(changes):
        lower, upper = newton.velocities(done.sol(t), t)[list(task.scene.bodies(c))].tolist()
        speeds = lower, upper
        if begins and log.begin(c, t, speeds):
            break
        if not begins:
            log.end(c, t, speeds)
    return log.contacts()


def _zero(task: Task, newton: Newton, state: Any, c: int, a: float, b: float) -> float:
    """Return the time between `a` and `b` at which the force of pair c begins or ends."""
    from scipy.optimize import brentq

    crosses = not task.resolved[c].rate_dependent or (state(a)[c] > 0.0) != (state(b)[c] > 0.0)

    def function(t: float) -> float:
        y: Array = state(t)
        return float(y[c]) if crosses else newton.bracket(c, float(y[c]), float(y[newton.pairs + c]))

    same = (function(a) > 0.0) == (function(b) > 0.0)
    return a if same else float(brentq(function, a, b, xtol=1e-300, rtol=1e-15))


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
    """Return errors of velocities and times, and whether a contact count is wrong.

    `granular.studies.frontier_result.Row` defines their units.
    """
    each = [(truth.of(c), [row for row in contacts if row.pair == c]) for c in range(pairs)]
    velocity = float(np.max([_velocity_error(true, got) for true, got in each])) / truth.impact_speed  # nan if one is
    if any(len(true) != len(got) for true, got in each):
        return velocity, math.nan, True
    time = max((_time_error(a, b) for true, got in each for a, b in zip(true, got, strict=True)), default=0.0)
    return velocity, time / max(truth.durations, default=math.nan), False


def _velocity_error(true: Sequence[ReferenceContact], got: Sequence[ReferenceContact]) -> float:
    """Return the largest difference in m/s after the last contact that ended, or nan.

    nan if only one of the two runs has such a contact.
    """
    last = [next((row.v_out for row in reversed(rows) if row.v_out is not None), None) for rows in (true, got)]
    if None in last:
        return 0.0 if last[0] is last[1] else math.nan
    return max(float(abs(a - b)) for a, b in zip(*last, strict=True))


def _time_error(true: ReferenceContact, got: ReferenceContact) -> float:
    return max(float(abs(a - b)) for a, b in ((true.t_begin, got.t_begin), (true.t_end, got.t_end))
               if a is not None and b is not None)
