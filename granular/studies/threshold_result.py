"""Criteria of `threshold`, and its result as values, text and figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby, pairwise
from os import PathLike
from textwrap import fill
from typing import Any

from granular._engine import files, signature
from granular._engine.reports import (
    GREY_COLOUR,
    HARD_COLOUR,
    SOFT_COLOUR,
    Report,
    aligned,
    axis_label,
    canvas,
    rounded_bound,
    style,
)
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
"""Style of each verdict. Orange crosses show where hard spheres fail."""


@dataclass(frozen=True, slots=True)
class Value:
    """One value of the parameter.

    Attributes
    ----------
    value : float
        Value in SI units.
    verdict : str
        "holds" if hard spheres are valid, "fails" if not, "undecided" if a run did not end or raised an exception.
    measure : float
        Quantity that determines the verdict. Criterion "error": the error in units of the fastest impact. Criterion
        "isolated": the time in s up to which every contact was isolated, nan for the whole run.
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
        Subject and predicate of the statement that hard spheres are valid, such as "every contact" and "isolated".
    words : (2,) strs
        Short names of the verdicts "holds" and "fails".
    """

    judge: Callable[[Case, float], tuple[str, float, str]]
    what: str
    how: str
    words: tuple[str, str]


def isolated(case: Case, limit: float) -> tuple[str, float, str]:
    """Return verdict, measure and reason of the criterion "isolated".

    The soft run stops at the first contact that is not isolated. `limit` is ignored.
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
    """Return verdict, measure and reason of the criterion "error".

    It fails if `granular.Comparison.error` is larger than `limit`. It also fails if the comparison has an answer other
    than "yes" although its error is small.
    """
    report = Answer(case).report
    if report.answer is Judgement.undecided:
        return UNDECIDED, math.nan, report.verdict
    # a small error, but another reason against "yes"
    if report.error <= ERROR_LIMIT and report.answer is not Judgement.yes:
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
        Neighbouring values that were tried and have different verdicts. The change lies between them.
    """

    low: Value
    high: Value

    @property
    def value(self) -> float:
        """Midpoint of the parameter values of `low` and `high`."""
        return 0.5 * self.low.value + 0.5 * self.high.value


@signature.face
@dataclass(frozen=True, repr=False)
class Threshold(Report):
    """Validity of hard spheres along one parameter. Draw it with `plot`.

    The result holds between the first and the last value of the scan. An interval with another verdict is missed if
    it lies between two neighbouring values of the scan. Print it, or save it with `to_json`.

    Attributes
    ----------
    title : str
        The scene.
    over, units : str
        The parameter, and its unit.
    between : (2,) floats
        Interval of the scan.
    criterion : str
        "isolated" or "error".
    limit : float
        Maximum error of the criterion "error", otherwise nan.
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
        """Statement for which values hard spheres are valid, in one or two sentences."""
        if not self.undecided:
            return _result_sentence(self) + "".join(_few_contact_sentences(self))
        first = next(value for value in self.values if value.verdict == UNDECIDED)
        remark = (f"Undecided {_spans(self, self.undecided)}; at {self.over} = {first.value:.4g}{_unit(self)}: "
                  f"{first.why.rstrip('.')}.")
        return (f"{_result_sentence(self)}{''.join(_few_contact_sentences(self))} {remark}"
                if self.holds or self.fails else remark)

    _headline = sentence

    @style()
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
            shown = [point for point in self.values if point.verdict == verdict]
            finite = [point for point in shown if math.isfinite(point.measure)]
            axis.plot([point.value for point in finite], [point.measure for point in finite], ls="none", ms=4, mew=0.9,
                      clip_on=False, **look)
            others = [point.value for point in shown if not math.isfinite(point.measure)]
            axis.plot(others, [0.97] * len(others), ls="none", ms=4, transform=axis.get_xaxis_transform(),
                      clip_on=False, **look)
            if shown:
                axis.plot([], [], ls="none", ms=4, label=_name(self, verdict), **look)
        _axes(axis, self)
        figure.suptitle(fill(self.sentence, 80), fontsize=8.5, x=0.02, ha="left")
        return files.write_figure(path, figure, dpi=200)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """All changes of the verdict, in ascending order."""
        return tuple(Crossing(a, b) for a, b in pairwise(self.values) if a.verdict != b.verdict)

    @cached_property
    def holds(self) -> tuple[Interval, ...]:
        """Intervals in which hard spheres are valid.

        Each interval begins and ends at values that were tried.
        """
        return self._intervals(HOLDS)

    @cached_property
    def fails(self) -> tuple[Interval, ...]:
        """Intervals in which hard spheres are not valid."""
        return self._intervals(FAILS)

    @cached_property
    def undecided(self) -> tuple[Interval, ...]:
        """Intervals in which a run did not end or raised an exception."""
        return self._intervals(UNDECIDED)

    def _intervals(self, verdict: str) -> tuple[Interval, ...]:
        groups = [(name, list(group)) for name, group in groupby(self.values, lambda value: value.verdict)]
        return tuple((group[0].value, group[-1].value) for name, group in groups if name == verdict)

    def _numbers(self) -> dict[str, Any]:
        """All numbers of the report for JSON."""
        field_names = ("title", "over", "units", "between", "criterion", "limit", "within", "points", "spacing")
        return {
            **{name: getattr(self, name) for name in field_names},
            "fixed": {name: repr(value) for name, value in self.fixed.items()},
            "sentence": self.sentence,
            "crossings": [asdict(crossing) for crossing in self.crossings],
            "holds": self.holds, "fails": self.fails, "undecided": self.undecided,
            "values": [asdict(value) for value in self.values],
        }


# --- sentences: each states the scanned interval, because the verdict holds inside it only


def _result_sentence(report: Threshold) -> str:
    """Return the sentence that states for which values hard spheres are valid."""
    low, high = report.between
    criterion, scan = THRESHOLD_CRITERIA[report.criterion], f"{report.over} from {low:g} to {high:g}{_unit(report)}"
    how = criterion.how.format(error=report.limit)
    if not report.holds:
        return f"Nowhere is {criterion.what} {how}: {scan} was scanned."
    statement = f"{criterion.what[0].upper()}{criterion.what[1:]} is {how}"
    if all(value.why == NO_TOUCH for value in report.values):
        return f"No contact begins: {scan} was scanned."
    if report.holds == (report.between,):
        return f"{statement} everywhere: {scan} was scanned."
    reaches = report.holds[0][0] == low, report.holds[-1][1] == high
    scanned = {(True, False): f"from {low:g}{_unit(report)} upwards", (False, True): f"up to {high:g}{_unit(report)}"}
    within = scanned.get(reaches, f"from {low:g} to {high:g}{_unit(report)}")
    return f"{statement} {_spans(report, report.holds)} (scanned {within})."


def _few_contact_sentences(report: Threshold) -> Iterator[str]:
    """Yield sentences on values without contacts, and with unfinished contacts."""
    for reason in (NO_TOUCH, CONTACT_CUT_OFF):
        count = sum(reason in value.why for value in report.values)
        if 0 < count < len(report.values) or (count and reason == CONTACT_CUT_OFF):
            yield f" At {count} of {len(report.values)} values {reason}."


def _spans(report: Threshold, spans: tuple[Interval, ...]) -> str:
    """Return intervals as text. Limits are rounded towards the inside of the interval."""
    phrases = [_span(report, *span) for span in spans]
    return phrases[0] if len(phrases) == 1 else ", ".join(phrases[:-1]) + " and " + phrases[-1]


def _span(report: Threshold, low: float, high: float) -> str:
    """Return the phrase for the interval from `low` to `high` of the parameter."""
    unit, (first, last) = _unit(report), report.between
    if low == high:
        return f"at {report.over} = {low:.6g}{unit}"
    if (low, high) == (first, last):
        return f"everywhere from {report.over} = {first:g} to {last:g}{unit}"
    digits = max(3, 2 + math.ceil(-math.log10(report.within)))  # as many as are known, and one more
    below, above = rounded_bound(low, digits, up=True), rounded_bound(high, digits, up=False)
    if high == last:
        return f"from {report.over} = {below}{unit} upwards"
    return f"up to {report.over} = {above}{unit}" if low == first else f"from {report.over} = {below} to {above}{unit}"


def _crossings(report: Threshold) -> Iterator[str]:
    """Yield a table of the crossings, and a line if some of them are not printed."""
    crossings = report.crossings
    if not crossings:
        return
    rows = [[f"{report.over}{f' / {report.units}' if report.units != '1' else ''}", "below", "above", "because"]]
    digits = 3 + math.ceil(-math.log10(report.within))
    for crossing in crossings[:MAX_PRINTED_CROSSINGS]:
        low, high = crossing.low, crossing.high
        rows.append([f"{low.value:.{digits}g} … {high.value:.{digits}g}", _name(report, low.verdict),
                     _name(report, high.verdict),
                     next((value.why for value in (low, high) if value.verdict != HOLDS), "")])
    yield "\n" + aligned(rows, "<")
    if len(crossings) > MAX_PRINTED_CROSSINGS:
        yield f"({len(crossings) - MAX_PRINTED_CROSSINGS} more crossings not shown; all are in the JSON)"


def _name(report: Threshold, verdict: str) -> str:
    """Return the text for a verdict, which depends on the criterion."""
    holds_name, fails_name = THRESHOLD_CRITERIA[report.criterion].words
    return {HOLDS: holds_name, FAILS: fails_name}.get(verdict, verdict)


def _unit(report: Threshold) -> str:
    return "" if report.units == "1" else f" {report.units}"


# --- figure: the deciding quantity over the values; intervals in which hard spheres are valid are shaded


def _axes(axis: Any, report: Threshold) -> None:
    """Set scales, labels, limits and legend of the figure."""
    if report.criterion == "error":
        axis.axhline(report.limit, color="black", lw=0.6, ls="--")
        axis.set(yscale="log", ylabel="error (units of the fastest impact)")
    else:
        axis.set_ylabel("time of the first disturbed contact (s)")
    axis.set(xscale=report.spacing, xlim=report.between,
             xlabel=axis_label(report.over, report.units))
    axis.margins(y=0.15)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
