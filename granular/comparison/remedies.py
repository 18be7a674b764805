"""Remedies for an inelastic collapse beside Newton: what each makes of one scene, in one table.
May be skipped: further runs of hard spheres, each with another option.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from granular import _check, edmd, end_time
from granular._reports import Report, aligned, html, number, problem
from granular.comparison.answer import Judged
from granular.isolation import Durations
from granular.outcome import SAME
from granular.rules import ConstantRestitution
from granular.trajectory import EARLY, Status, Trajectory

LONGEST, SHORTEST, STEP = 10.0, 1e-3, 10.0**0.5
"""Between these multiples of a contact a right tc is sought, from long to short, in such steps; then by bisection."""
SLOW = 0.01
"""Below this share of the speed of the first collision balls merge, or are elastic, if nothing else is said."""
WITHIN = 1e-3
"""Relative width to which that is bisected."""
NONE: Mapping[str, Any] = {"collapse": "stop", "merge_below": None, "tc": 0.0, "elastic_below": 0.0}


@dataclass(frozen=True)
class Remedy:
    """One way to run the scene.

    Attributes
    ----------
    name : str
        What it is.
    setting : float
        Its tc in s, or its speed in m/s; nan where there is none to choose.
    value : float
        What the run has of the observable, as it stops; nan if the engine refused the remedy.
    error : float
        Largest error of a velocity, in units of the largest closing speed of its component, as
        `granular.Comparison.error`, of a run that is not carried on; nan where a run was cut off.
    contacts : int
        Collisions, or contacts of soft spheres.
    status : str
        How the run ended; what is wrong where it was refused.
    """

    name: str
    setting: float
    value: float
    error: float
    contacts: int
    status: str


@dataclass(frozen=True, repr=False)
class Remedies(Report):
    """Remedies for an inelastic collapse beside Newton; print it, save it with `to_json`.

    Attributes
    ----------
    report : Comparison
        What was compared.
    what : str
        The observable.
    rows : tuple of Remedy
        Newton first, then hard spheres as they stop, and with each remedy.
    duration : float
        Shortest isolated contact of the force laws in s, at the speed of the first collision.
    tc : float
        With this tc, in s, the TC model has Newton's value within 0.01 (of 1 for an energy left, else of the value):
        the largest such one from ten contacts down to a thousandth; 0 if hard spheres have it without a remedy, nan if
        none was found.
    """

    report: Judged
    what: str
    rows: tuple[Remedy, ...]
    duration: float
    tc: float

    def __str__(self) -> str:
        return f"{self._headline}\n\n{aligned(self._table(), '<>>>><')}"

    def _table(self) -> list[list[str]]:
        head = ["", "s, m/s", self.what, "worst error", "contacts", "status"]
        return [head, *([row.name, number(row.setting, ".3g", ""), number(row.value, ".4g"), number(row.error, ".2g"),
                         str(row.contacts), row.status] for row in self.rows)]

    @property
    def _headline(self) -> str:
        newton, *others = self.rows
        known = [row for row in others if math.isfinite(row.value - newton.value)]
        if not known:
            return f"Newton has {self.what} = {number(newton.value, '.4g')}: there is nothing to compare it with."
        best = min(known, key=lambda row: abs(row.value - newton.value))
        right = ("No tc has that." if math.isnan(self.tc) else "No tc is needed for that." if self.tc == 0.0 else
                 f"A tc that has it is {self.tc:.3g} s, {self.tc / self.duration:.2g} of the shortest contact.")
        return f"Newton has {self.what} = {newton.value:.4g}; nearest: {best.name}, {best.value:.4g}. {right}"

    def _numbers(self) -> dict[str, Any]:
        return {**problem(self.report), "what": self.what, "rows": [asdict(row) for row in self.rows],
                "duration": self.duration, "tc": self.tc}

    def _repr_html_(self) -> str:
        return html(self._headline, self._table())


def table(report: Judged, observable: Callable[[Trajectory], float] | None, given: Mapping[str, float | None]
          ) -> Remedies:
    """See `Comparison.remedies`."""
    _check.callback("observable", observable, "run")
    measure, soft = observable or energy_left, report.soft
    at_impact = np.full(report.scene.n_pairs, report.impact_speed)
    duration = float(Durations(report.law, report.scene)(np.arange(report.scene.n_pairs), at_impact).min())
    slow = SLOW * report.impact_speed
    tc, merge, elastic = (
        report.hard_options[name] or usual if given[name] is None else _check.number(name, given[name], above=0.0)
        for name, usual in (("tc", duration), ("merge_below", slow), ("elastic_below", slow)))
    none, stick = {}, ConstantRestitution(0.0)
    ways: tuple[tuple[str, float, Mapping[str, Any], Any], ...] = (
        ("hard spheres", math.nan, none, report.rule),
        ("merge", merge, {"collapse": "merge", "merge_below": merge}, report.rule),
        ("TC model", tc, {"tc": tc}, report.rule),
        ("elastic cut-off", elastic, {"elastic_below": elastic}, report.rule),
        ("sticky", math.nan, none, stick),
    )
    target = float(measure(soft))
    rows = [Remedy("Newton, soft spheres", math.nan, target, 0.0, len(soft.contacts), soft.status.name)]
    for name, setting, remedy, rule in ways:
        try:
            run = _run(report, remedy, rule)
            rows.append(Remedy(name, setting, float(measure(run)), _error(report, run), len(run.contacts),
                               run.status.name))
        except ValueError as refused:
            rows.append(Remedy(name, setting, math.nan, math.nan, 0, f"refused: {refused}"))

    def miss(of: float) -> float:
        with suppress(ValueError):
            run = _run(report, {"tc": of}, report.rule)
            return math.nan if run.status in EARLY else float(measure(run)) - target
        return math.nan

    what = "E/E0" if observable is None else str(getattr(observable, "__name__", "observable"))
    within = SAME * (1.0 if observable is None else abs(target))
    return Remedies(report, what, tuple(rows), duration, right_tc(miss, duration, within))


def _run(report: Judged, remedy: Mapping[str, Any], rule: Any) -> Trajectory:
    """Run the hard spheres with this remedy and no other; it is given up like another tie rule."""
    options = {**report.hard_options, **NONE, **remedy}
    if options == report.hard_options and rule is report.rule:
        return report.hard
    most = end_time.MOST_OF_OTHERS * (report.hard.stats["events"] + len(report.soft.contacts) + report.scene.n)
    return edmd.simulate(report.scene, rule, **options | {"max_events": min(options["max_events"], most)})


def _error(report: Judged, run: Trajectory) -> float:
    """The error of a hard run as it stops, which `Judged` would carry on beyond a collapse."""
    as_it_stops = replace(run, stats={name: value for name, value in run.stats.items() if name != "verdict"})
    errors = replace(report, hard=as_it_stops).errors
    return math.nan if run.status is Status.max_events else float(errors.max(initial=0.0))


def right_tc(miss: Callable[[float], float], duration: float, within: float) -> float:
    """Return a tc in s at which `miss` is at most `within`: 0 if it is so there, nan if there seems to be none.

    From long to short where it changes its sign, then by bisection: it may jump, and change its sign more than once.
    """
    tried = {0.0: miss(0.0)}
    if abs(tried[0.0]) <= within or not math.isfinite(duration):
        return 0.0 if abs(tried[0.0]) <= within else math.nan
    low = high = LONGEST * duration
    tried[low] = miss(low)
    while low > SHORTEST * duration and not tried[low] * tried[high] < 0.0:
        low, high = low / STEP, low
        tried[low] = miss(low)
    while tried[low] * tried[high] < 0.0 and high > (1.0 + WITHIN) * low:
        middle = math.sqrt(low * high)
        tried[middle] = miss(middle)
        low, high = (low, middle) if tried[middle] * tried[high] > 0.0 else (middle, high)
    best = min(tried, key=lambda tc: abs(np.nan_to_num(tried[tc], nan=math.inf)))
    return best if abs(tried[best]) <= within else math.nan


def energy_left(run: Trajectory) -> float:
    """E/E0 at the end of a run; nan where there was none at its start."""
    energy = run.energy()
    return float(energy[-1] / energy[0]) if energy[0] > 0.0 else math.nan
