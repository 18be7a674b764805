"""Remedies for inelastic collapse, compared with soft spheres in one table."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from granular import edmd
from granular._engine import check
from granular._engine.callables import callback
from granular._engine.reports import Report, aligned, number, problem
from granular.comparison import align, measures
from granular.comparison.outcome import ERROR_LIMIT, energy_left
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Status, Trajectory

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

__all__ = ["Remedies", "Remedy"]
SLOW_SPEED_FACTOR = 0.01
"""Default speed of merging and elastic cut-off, relative to the fastest approach."""
MAX_TC_DURATIONS, TC_STEP_FACTOR, TC_COUNT, TC_HALVINGS = 10.0, 10.0**0.5, 9, 11
"""Search for tc: it starts at ten contact durations and decreases by a factor √10.

There are `TC_COUNT` values, down to a thousandth of a duration. The interval is then halved `TC_HALVINGS` times on a
logarithmic scale, to a relative width below 1e-3.
"""


@dataclass(frozen=True)
class Remedy:
    """One row of the table of remedies: a run of the scene.

    Attributes
    ----------
    name : str
        Name of the remedy.
    setting : float
        Parameter of the remedy: tc in s, or a speed in m/s. 0 for rows without a parameter.
    value : float
        Value of the observable of the run. nan if the engine refused the remedy.
    error : float
        Largest error of all components, see `granular.Comparison.error`. 0 for the soft run, and nan for a run that
        was refused or stopped at a limit.
    contacts : int
        Number of collisions, or of contacts of soft spheres.
    status : str
        Status of the run, or the message of the refusal.
    """

    name: str
    setting: float
    value: float
    error: float
    contacts: int
    status: str


@dataclass(frozen=True, repr=False)
class Remedies(Report):
    """Remedies for inelastic collapse, compared with soft spheres.

    Save with `to_json`.

    Attributes
    ----------
    what : str
        The observable.
    rows : tuple of Remedy
        Soft spheres, hard spheres without a remedy, and hard spheres with each remedy. If hard spheres are not right
        without a remedy, the last row is the TC model with the value of tc that comes nearest to soft spheres.
    tc : float
        A value of tc in s with which the TC model is right: its observable differs from the value of soft spheres by at
        most 0.01 for E/E0, otherwise by at most 0.01 of the value. It is searched between a thousandth of the shortest
        contact duration and ten of them. 0 if hard spheres are right without it. nan if no value is right, for example
        because the observable jumps with tc.
    """

    report: ComparisonWithAnswer
    what: str
    rows: tuple[Remedy, ...]
    tc: float

    def __str__(self) -> str:
        return f"{self._headline}\n\n{aligned(self._table(), '<>>>><')}"

    def _table(self) -> list[list[str]]:
        return [["", "s, m/s", self.what, "worst error", "contacts", "status"],
                *([row.name, f"{row.setting:.3g}" if row.setting else "", number(row.value, ".4g"),
                   number(row.error, ".2g"), str(row.contacts), row.status] for row in self.rows)]

    @property
    def _headline(self) -> str:
        """Results of the soft spheres and of the remedy nearest to them."""
        newton, *others = self.rows
        near, last = min(others[:5], key=lambda row: float(f"{_distance_from_soft(row, newton):.3g}")), others[-1]
        right = "is right" if self.tc == last.setting else "comes nearest, but none is right"
        return (f"Soft spheres have {self.what} = {number(newton.value, '.4g')}; nearest: {near.name}, "
                f"{number(near.value, '.4g')}. " + (f"Of all tc, {last.setting:.3g} s {right}." if self.tc else
                                                    "No tc is required."))

    def _numbers(self) -> dict[str, Any]:
        return {**problem(self.report), "what": self.what, "rows": list(map(asdict, self.rows)), "tc": self.tc}


def remedies_table(
    report: ComparisonWithAnswer, observable: Callable[[Trajectory], float] | None, given: Mapping[str, float | None]
) -> Remedies:
    """Run all remedies and return their table, see `Comparison.remedies`.

    Parameters
    ----------
    observable : callable or None
        Function of a trajectory. None is the fraction of the energy that is left.
    given : mapping
        Values of "tc", "merge_below" and "elastic_below", or None for their defaults.
    """
    measure, soft = callback("observable", observable, "run") or energy_left, report.soft
    duration = float(measures.durations(report.hard, report.law).min(initial=math.inf))
    slow = SLOW_SPEED_FACTOR * measures.fastest_approach(report.hard)
    tc, merge, elastic = (
        report.hard_options[name] or default if given[name] is None else check.number(name, given[name], above=0.0)
        for name, default in (("tc", duration), ("merge_below", slow), ("elastic_below", slow)))

    def row(name: str, setting: float = 0.0, rule: Any = report.rule, **remedy: Any) -> Remedy:
        """Return the row of one remedy, with nan if its run is refused."""
        try:
            run = _run_with_remedy(report, rule, remedy)
        except ValueError as refusal:
            return Remedy(name, setting, math.nan, math.nan, 0, f"refused: {refusal}")
        as_stopped = replace(run, stats={key: run.stats[key] for key in run.stats if key != "verdict"})
        errors = replace(report, hard=as_stopped).errors
        error = math.nan if run.status is Status.max_events else float(errors.max(initial=0.0))
        return Remedy(name, setting, float(measure(run)), error, len(run.contacts), run.status.name)

    newton = Remedy("soft spheres", 0.0, float(measure(soft)), 0.0, len(soft.contacts), soft.status.name)
    hard, tolerance = row("hard spheres"), ERROR_LIMIT * (1.0 if observable is None else abs(newton.value))
    rows = [hard, row("merge", merge, collapse="merge", merge_below=merge), row("TC model", tc, tc=tc),
            row("elastic cut-off", elastic, elastic_below=elastic), row("sticky", rule=ConstantRestitution(0.0))]
    best = hard if _distance_from_soft(hard, newton) <= tolerance else _best(
        lambda tc_trial: row("TC model at its best", tc_trial, tc=tc_trial), newton, duration)
    what = "E/E0" if observable is None else str(getattr(observable, "__name__", "observable"))
    right = best.setting if _distance_from_soft(best, newton) <= tolerance else math.nan
    return Remedies(report, what, (newton, *rows, *[best] * (best is not hard)), right)


def _run_with_remedy(report: ComparisonWithAnswer, rule: Any, remedy: Mapping[str, Any]) -> Trajectory:
    """Run the hard spheres with one remedy, without the remedies of the comparison.

    The number of collisions is limited to ten times the events, soft contacts and bodies of the comparison.

    Parameters
    ----------
    remedy : mapping
        Options of `granular.edmd.simulate` for the remedy.
    """
    no_remedy = {"collapse": "stop", "merge_below": None, "tc": 0.0, "elastic_below": 0.0}
    options = {**report.hard_options, **no_remedy, **remedy}
    if options == report.hard_options and rule is report.rule:
        return report.hard
    limit = align.COLLISION_LIMIT_FACTOR * (report.hard.stats["events"] + len(report.soft.contacts) + report.scene.n)
    return edmd.simulate(report.scene, rule, **options | {"max_events": min(options["max_events"], limit)})


def _distance_from_soft(row: Remedy, newton: Remedy) -> float:
    """Difference of the observable between a row and soft spheres (`newton`).

    It is inf if the value or the error of the row is not finite.
    """
    off = abs(row.value - newton.value)
    return off if math.isfinite(off + row.error) else math.inf


def _best(at: Callable[[float], Remedy], newton: Remedy, duration: float) -> Remedy:
    """Return the row of the TC model whose observable is nearest to soft spheres.

    tc decreases until the observable crosses the value of soft spheres. This interval is then bisected.

    Parameters
    ----------
    at : callable
        Function of tc in s that returns a row of the table.
    newton : Remedy
        Row of the soft spheres.
    duration : float
        Contact duration in s from which the search starts, see `MAX_TC_DURATIONS`.
    """
    rows = [at(MAX_TC_DURATIONS * duration / TC_STEP_FACTOR**k) for k in range(TC_COUNT)]
    starts_above = rows[0].value > newton.value
    low = next((row.setting for row in rows if (row.value > newton.value) is not starts_above), rows[-1].setting)
    high = TC_STEP_FACTOR * low
    for _ in range(TC_HALVINGS):
        rows.append(middle := at(math.sqrt(low * high)))
        low, high = (low, middle.setting) if (middle.value > newton.value) is starts_above else (middle.setting, high)
    return min(rows, key=lambda row: _distance_from_soft(row, newton))
