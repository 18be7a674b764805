"""The methods of this package that are put to the test, each with the settings to try.
May be skipped: it measures ourselves.
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
from granular import until as stop
from granular.binary import restitution_of
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws, resolved
from granular.md.integrators import INTEGRATORS
from granular.reference import Reference, ReferenceContact
from granular.scene import Scene
from granular.trajectory import Trajectory
from granular.workprecision.result import contacts_of

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


def own(task: Task, name: str) -> Method:
    """The method of this package of that name."""
    end: dict[str, Any] = {"until": task.until, "t_end": task.t_end}
    if name == "edmd":
        rule = restitution_of(task.laws, task.scene)
        return Method(name, "", (math.nan,), lambda _: _outcome(edmd.simulate(task.scene, rule, **end), "events"))
    dial, unit, engine = "tol", "steps", _engine(task, name)
    settings: tuple[float, ...] = TOLERANCES
    if name in INTEGRATORS:
        dial, unit, settings = "dt", "evaluations", _steps(task.truth, MOST_STEPS[engine])
    elif all(law.is_linear for law in task.resolved.each):
        dial, settings = "", (math.nan,)

    def run(setting: float) -> Outcome:
        options: dict[str, Any] = {dial: setting} if dial else {}
        return _outcome(md.simulate(task.scene, task.laws, **end, method=name, engine=engine, **options), unit)

    return Method(name, dial, settings, run)


def _steps(truth: Reference, most: int) -> tuple[float, ...]:
    """Fixed steps in s with which the time during which a pair is in contact takes at most so many steps."""
    shortest = min(truth.durations)
    ends = [truth.t_stop if row.t_end is None else float(row.t_end) for row in truth.contacts]
    reached = accumulate([-math.inf, *ends], max)
    closed = sum(max(0.0, end - max(float(row.t_begin), before))
                 for row, end, before in zip(truth.contacts, ends, reached, strict=False))  # fmt: skip
    steps = [COARSEST * FINER**k for k in range(POINTS)]
    return tuple(shortest / n for n in steps if n * closed / shortest <= most)


def _engine(task: Task, name: str) -> str:
    """ "compiled" if that is possible, else "plain"."""
    options: dict[str, Any] = {"dt": min(task.truth.durations)} if name in INTEGRATORS else {}
    try:
        md.simulate(task.scene, task.laws, t_end=0.0, method=name, engine="compiled", **options)
    except (ImportError, TypeError):
        return "plain"
    return "compiled"


def _outcome(run: Trajectory, unit: str) -> Outcome:
    work = run.stats.get(unit, run.stats.get("events", 0))
    return Outcome(lambda: contacts_of(run), int(work), unit, run.status.name)


def expected_order(task: Task, name: str) -> tuple[float, float]:
    """Textbook order p of a fixed-step method, and min(p, 1+s), s the power of time with which forces begin."""
    least = np.min([_first_power(law) for law in task.resolved.each])  # nan if one is
    order = INTEGRATORS[name].order
    return order, float(np.minimum(order, 1.0 + least))


def _first_power(law: PairLaw) -> float:
    """The power of time with which the force of a contact begins; nan if unknown."""
    if law.form is not None:
        return law.form[3] if law.form[2] else law.form[1]
    return math.nan if law.exponent is None or law.rate_dependent else float(law.exponent)
