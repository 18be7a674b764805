"""Criteria of `threshold`, and its result as value, text and figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby, pairwise
from os import PathLike
from textwrap import fill
from typing import Any

from granular._engine import check, files
from granular._engine.reports import GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, Report, aligned, canvas, rounded
from granular.cases import Case
from granular.comparison.answer import Answer as Judgement
from granular.comparison.outcome import ERROR_LIMIT
from granular.md import isolation
from granular.run.trajectory import EARLY_STATUSES, Status
from granular.studies.sweeps.schedule import Answer

HOLDS, FAILS, UNDECIDED = ("holds", "fails", "undecided")
NO_TOUCH, CONTACT_CUT_OFF = "nothing touches", "a contact is cut off by the end time"
"""Reasons why all contacts of a value are trivially isolated."""
Interval = tuple[float, float]
MAX_PRINTED_CROSSINGS = 20
"""Maximum number of crossings that are printed."""
VERDICT_MARKERS: dict[str, dict[str, Any]] = {
    HOLDS: {"color": SOFT_COLOUR, "marker": "o", "mfc": SOFT_COLOUR}, FAILS: {"color": HARD_COLOUR, "marker": "x"},
    UNDECIDED: {"color": GREY_COLOUR, "marker": "s", "mfc": "none"},
}


@dataclass(frozen=True, slots=True)
class Value:
    """One value of the parameter.

    Attributes
    ----------
    value : float
        Value in SI units.
    verdict : str
        "holds", "fails", or "undecided" if a run did not end.
    measure : float
        Quantity that decides: the error in units of the fastest impact, or the time in s up to which every contact was
        isolated, nan for the whole run.
    why : str
        Reason of the verdict.
    """

    value: float
    verdict: str
    measure: float
    why: str


@dataclass(frozen=True)
class Criterion:
    """Criterion for a case.

    Attributes
    ----------
    judge : callable
        Function of a case and a limit that returns verdict, measure and reason.
    what, how : str
        Statement that holds where hard spheres are valid: `what` is `how`.
    words : (2,) strs
        Short form of the statement, and of its contrary.
    """

    judge: Callable[[Case, float], tuple[str, float, str]]
    what: str
    how: str
    words: tuple[str, str]


def isolated(case: Case, limit: float) -> tuple[str, float, str]:
    """Whether every contact of the soft run is isolated.

    The run stops at the first contact that is not.
    """
    run = case.simulate("md", disturbed="stop", log=False)
    time, pair = run.first_disturbed
    if pair >= 0:
        return FAILS, time, f"first disturbed: {isolation.first_disturbed(run)}"
    if run.status in EARLY_STATUSES:
        return UNDECIDED, math.nan, f"{run.status.name}: {run.message}"
    cut = run.status is Status.time and run.force is not None and run.force[-1].any()
    return HOLDS, math.nan, (isolation.sentence(run) or NO_TOUCH) + (f"; {CONTACT_CUT_OFF}" if cut else "")


def error(case: Case, limit: float) -> tuple[str, float, str]:
    """Whether the error of hard spheres is at most `limit`.

    See `granular.Comparison.error`. Any other reason for "no" also counts.
    """
    report = Answer(case).report
    if report.answer is Judgement.undecided:
        return UNDECIDED, math.nan, report.verdict
    if report.error <= ERROR_LIMIT and report.answer is not Judgement.yes:  # small, but for another reason it is no yes
        return FAILS, report.error, report.verdict
    return HOLDS if report.error <= limit else FAILS, report.error, f"error {report.error:.3g}"


THRESHOLD_CRITERIA = {
    "isolated": Criterion(isolated, "every contact", "isolated", ("isolated", "disturbed")),
    "error": Criterion(error, "the error of hard spheres", "at most {error:g} of the fastest impact",
                       ("small error", "large error")),
}


@dataclass(frozen=True, slots=True)
class Crossing:
    """A change of the verdict.

    Attributes
    ----------
    low, high : Value
        Neighbouring values between which it lies. Both were tried.
    """

    low: Value
    high: Value

    @property
    def value(self) -> float:
        """Midpoint of the two values."""
        return 0.5 * self.low.value + 0.5 * self.high.value


@check.face
@dataclass(frozen=True, repr=False)
class Threshold(Report):
    """Validity of hard spheres along one parameter. Draw it with `plot`.

    The result holds between the first and the last value of the scan. Intervals between two neighbours of the scan with
    the same verdict may be missed. Print it, or save it with `to_json`.

    Attributes
    ----------
    title : str
        The scene.
    over, units : str
        The parameter, and its unit.
    between : (2,) floats
        Interval of the scan.
    criterion, limit : str, float
        "isolated", or "error" with the largest error that is allowed.
    within : float
        Relative width to which crossings are known.
    points, spacing : int, str
        The grid: number of values; "log" or "linear".
    fixed : mapping
        Other parameters that were given.
    values : tuple of Value
        All values that were tried, ascending, with verdict and reason.
    """

    title: str
    over: str
    units: str
    between: Interval
    criterion: str
    limit: float
    within: float
    points: int
    spacing: str
    fixed: Mapping[str, Any]
    values: tuple[Value, ...]

    def __str__(self) -> str:
        low, high = self.between
        return "\n".join([
            self.title,
            f"scanned: {self.over} from {low:g} to {high:g}{_unit(self)}, {self.points} values ({self.spacing}), "
            f"then every change bisected to {self.within:g} of its value; {len(self.values)} runs",
            *_crossings(self), "", self.sentence,
        ])

    @property
    def sentence(self) -> str:
        """Statement where hard spheres are valid, in one or two sentences."""
        if not self.undecided:
            return _decided(self) + "".join(_little(self))
        first = next(one for one in self.values if one.verdict == UNDECIDED)
        doubt = (f"Undecided {_spans(self, self.undecided)}; at {self.over} = {first.value:.4g}{_unit(self)}: "
                 f"{first.why.rstrip('.')}.")
        return f"{_decided(self)}{''.join(_little(self))} {doubt}" if self.holds or self.fails else doubt

    _headline = sentence

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw error, or time of the first disturbed contact, over the values.

        Return the figure, or save it to `path`.
        """
        figure, ((axis,),) = canvas(5.2, 3.2)
        for low, high in self.holds:
            axis.axvspan(low, high, color=SOFT_COLOUR, alpha=0.12, lw=0)
        for crossing in self.crossings:
            axis.axvline(crossing.value, color="black", lw=0.7, ls=":")
        for verdict, look in VERDICT_MARKERS.items():
            shown = [one for one in self.values if one.verdict == verdict]
            known = [one for one in shown if math.isfinite(one.measure)]
            axis.plot([one.value for one in known], [one.measure for one in known], ls="none", ms=4, mew=0.9, **look)
            others = [one.value for one in shown if not math.isfinite(one.measure)]
            axis.plot(others, [0.97] * len(others), ls="none", ms=4, transform=axis.get_xaxis_transform(), **look)
            if shown:
                axis.plot([], [], ls="none", ms=4, label=_name(self, verdict), **look)
        _axes(axis, self)
        figure.suptitle(fill(self.sentence, 80), fontsize=8.5, x=0.02, ha="left")
        return files.write_figure(path, figure, dpi=150)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """All changes of the verdict that were found, ascending."""
        return tuple(Crossing(a, b) for a, b in pairwise(self.values) if a.verdict != b.verdict)

    @cached_property
    def holds(self) -> tuple[Interval, ...]:
        """Intervals in which hard spheres are valid, between values that were tried."""
        return self._intervals(HOLDS)

    @cached_property
    def fails(self) -> tuple[Interval, ...]:
        """Intervals in which hard spheres are not valid."""
        return self._intervals(FAILS)

    @cached_property
    def undecided(self) -> tuple[Interval, ...]:
        """Intervals in which a run did not end, or was refused."""
        return self._intervals(UNDECIDED)

    def _intervals(self, verdict: str) -> tuple[Interval, ...]:
        groups = [(name, list(group)) for name, group in groupby(self.values, lambda one: one.verdict)]
        return tuple((group[0].value, group[-1].value) for name, group in groups if name == verdict)

    def _numbers(self) -> dict[str, Any]:
        told = ("title", "over", "units", "between", "criterion", "limit", "within", "points", "spacing")
        return {
            **{name: getattr(self, name) for name in told},
            "fixed": {name: repr(value) for name, value in self.fixed.items()},
            "sentence": self.sentence,
            "crossings": [asdict(crossing) for crossing in self.crossings],
            "holds": self.holds, "fails": self.fails, "undecided": self.undecided,
            "values": [asdict(one) for one in self.values],
        }


# --- in words: nothing is said but of what was scanned


def _decided(report: Threshold) -> str:
    """Return the first sentence."""
    low, high = report.between
    asked, scan = THRESHOLD_CRITERIA[report.criterion], f"{report.over} from {low:g} to {high:g}{_unit(report)}"
    how = asked.how.format(error=report.limit)
    if not report.holds:
        return f"Nowhere is {asked.what} {how}: {scan} was scanned."
    said = f"{asked.what[0].upper()}{asked.what[1:]} is {how}"
    if all(one.why == NO_TOUCH for one in report.values):
        return f"No contact begins: {scan} was scanned."
    if report.holds == (report.between,):
        return f"{said} everywhere: {scan} was scanned."
    reaches = report.holds[0][0] == low, report.holds[-1][1] == high
    scanned = {(True, False): f"from {low:g}{_unit(report)} on", (False, True): f"up to {high:g}{_unit(report)}"}
    within = scanned.get(reaches, f"from {low:g} to {high:g}{_unit(report)}")
    return f"{said} {_spans(report, report.holds)} (scanned {within})."


def _little(report: Threshold) -> Iterator[str]:
    """Return the sentence on values with few contacts or none."""
    for what in (NO_TOUCH, CONTACT_CUT_OFF):
        many = sum(what in one.why for one in report.values)
        if 0 < many < len(report.values) or (many and what == CONTACT_CUT_OFF):
            yield f" At {many} of {len(report.values)} values {what}."


def _spans(report: Threshold, spans: tuple[Interval, ...]) -> str:
    """Return intervals as text, each rounded towards its inside."""
    words = [_span(report, *span) for span in spans]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def _span(report: Threshold, low: float, high: float) -> str:
    unit, (first, last) = _unit(report), report.between
    if low == high:
        return f"at {report.over} = {low:.6g}{unit}"
    if (low, high) == (first, last):
        return f"everywhere from {report.over} = {first:g} to {last:g}{unit}"
    digits = max(3, 2 + math.ceil(-math.log10(report.within)))  # as many as are known, and one more
    below, above = rounded(low, digits, up=True), rounded(high, digits, up=False)
    if high == last:
        return f"from {report.over} = {below}{unit} on"
    return f"up to {report.over} = {above}{unit}" if low == first else f"from {report.over} = {below} to {above}{unit}"


def _crossings(report: Threshold) -> Iterator[str]:
    """Yield a table of the crossings, and a line if some of them are not shown."""
    found = report.crossings
    if not found:
        return
    rows = [[f"{report.over}{f' / {report.units}' if report.units != '1' else ''}", "below", "above", "because"]]
    digits = 3 + math.ceil(-math.log10(report.within))
    for crossing in found[:MAX_PRINTED_CROSSINGS]:
        low, high = crossing.low, crossing.high
        rows.append([f"{low.value:.{digits}g} … {high.value:.{digits}g}", _name(report, low.verdict),
                     _name(report, high.verdict),
                     next((one.why for one in (low, high) if one.verdict != HOLDS), "")])
    yield "\n" + aligned(rows, "<")
    if len(found) > MAX_PRINTED_CROSSINGS:
        yield f"({len(found) - MAX_PRINTED_CROSSINGS} more crossings not shown; all are in the JSON)"


def _name(report: Threshold, verdict: str) -> str:
    """Return the text of a verdict for the criterion."""
    good, bad = THRESHOLD_CRITERIA[report.criterion].words
    return {HOLDS: good, FAILS: bad}.get(verdict, verdict)


def _unit(report: Threshold) -> str:
    return "" if report.units == "1" else f" {report.units}"


# --- as a figure: what decides, over the values; where hard spheres hold is shaded


def _axes(axis: Any, report: Threshold) -> None:
    if report.criterion == "error":
        axis.axhline(report.limit, color="black", lw=0.6, ls="--")
        axis.set(yscale="log", ylabel="error, of the fastest impact")
    else:
        axis.set_ylabel("first disturbed at t, s")
    axis.set(xscale=report.spacing, xlim=report.between,
             xlabel=report.over + (f", {report.units}" if report.units != "1" else ""))
    axis.margins(y=0.15)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
