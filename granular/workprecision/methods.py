"""The methods of this package that are put to the test, each with the settings to try."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from granular import edmd, md
from granular import until as stop
from granular.binary import restitution_of
from granular.laws.kinds import SceneLaws, resolved
from granular.md.integrators import INTEGRATORS
from granular.reference import Reference, ReferenceContact
from granular.scene import Scene
from granular.trajectory import Trajectory
from granular.workprecision.judge import contacts_of

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
COARSEST, FINER, POINTS = 8, 4, 8
"""Steps in the shortest contact at first, how many times more at each next point, and number of points."""
MOST_STEPS = {"compiled": 3_000_000, "plain": 100_000}


@dataclass(frozen=True)
class Outcome:
    """What one run of a method gave."""

    contacts: Callable[[], Sequence[ReferenceContact]]
    """Reads the contacts out, which is not part of the run time."""
    work: int
    unit: str
    status: str


@dataclass(frozen=True)
class Method:
    """A way to solve the scene: `run(setting)` for each of `settings`, which are values of its `dial`."""

    name: str
    dial: str
    settings: tuple[float, ...]
    run: Callable[[float], Outcome]


@dataclass(frozen=True)
class Task:
    """What every method has to solve."""

    scene: Scene
    laws: tuple[Any, ...]
    until: stop.Until | None
    t_end: float | None
    truth: Reference

    @cached_property
    def resolved(self) -> SceneLaws:
        """The laws, asked what they are."""
        return resolved(self.laws, self.scene)


def own(task: Task, names: Sequence[str]) -> list[Method]:
    """The methods of this package among `names`."""
    found = []
    for name in names:
        if name == "located":
            found.append(_located(task))
        elif name in INTEGRATORS:
            found.append(_fixed(task, name))
        elif name == "edmd":
            found.append(_edmd(task))
    return found


def _located(task: Task) -> Method:
    linear, engine = all(law.is_linear for law in task.resolved.each), _engine(task, "located")

    def run(tol: float) -> Outcome:
        options: dict[str, Any] = {"engine": engine} | ({} if linear else {"tol": tol})
        return _outcome(md.simulate(task.scene, task.laws, until=task.until, t_end=task.t_end, **options), "steps")

    return Method("located", "" if linear else "tol", (math.nan,) if linear else TOLERANCES, run)


def _fixed(task: Task, name: str) -> Method:
    engine = _engine(task, name, dt=min(task.truth.durations))
    shortest, contact = min(task.truth.durations), _closed_time(task.truth)
    steps = [COARSEST * FINER**k for k in range(POINTS)]
    settings = tuple(shortest / n for n in steps if n * contact / shortest <= MOST_STEPS[engine])

    def run(dt: float) -> Outcome:
        end: dict[str, Any] = {"until": task.until, "t_end": task.t_end}
        return _outcome(
            md.simulate(task.scene, task.laws, **end, method=name, dt=dt, engine=engine), "evaluations"
        )

    return Method(name, "dt", settings, run)


def _engine(task: Task, name: str, **options: Any) -> str:
    """ "compiled" if that is possible, else "plain"."""
    try:
        md.simulate(task.scene, task.laws, t_end=0.0, method=name, engine="compiled", **options)
    except (ImportError, TypeError):
        return "plain"
    return "compiled"


def _closed_time(truth: Reference) -> float:
    """Time in s during which at least one pair is in contact: that is what takes steps."""
    total, reached = 0.0, -math.inf
    for row in truth.contacts:
        begin, end = float(row.t_begin), truth.t_stop if row.t_end is None else float(row.t_end)
        total += max(0.0, end - max(begin, reached))
        reached = max(reached, end)
    return total


def _edmd(task: Task) -> Method:
    rule = restitution_of(task.laws, task.scene)

    def run(setting: float) -> Outcome:
        return _outcome(edmd.simulate(task.scene, rule, until=task.until, t_end=task.t_end), "events")

    return Method("edmd", "", (math.nan,), run)


def _outcome(run: Trajectory, unit: str) -> Outcome:
    work = run.stats.get(unit, run.stats.get("events", 0))
    return Outcome(lambda: contacts_of(run), int(work), unit, run.status.name)


def expected_order(task: Task, name: str) -> tuple[float, float]:
    """Textbook order p of a fixed-step method, and min(p, 1+s), s the power of time with which forces begin."""
    starts = []
    for law in task.resolved.each:
        if law.form is not None:
            starts.append(law.form[3] if law.form[2] else law.form[1])
        elif law.exponent is None or law.rate_dependent:
            starts.append(math.nan)
        else:
            starts.append(float(law.exponent))
    least = math.nan if any(map(math.isnan, starts)) else min(starts)
    order = INTEGRATORS[name].order
    return order, min(order, 1.0 + least) if not math.isnan(least) else math.nan
