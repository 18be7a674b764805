"""A threshold in words: where hard spheres hold, said of nothing but what was scanned, and every crossing.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import TYPE_CHECKING

from granular.tables import aligned
from granular.thresholds.criteria import CRITERIA, FAILS, HOLDS, UNDECIDED, Value

if TYPE_CHECKING:
    from granular.thresholds.result import Interval, Threshold

MOST = 20
"""Crossings that are shown."""


def table(report: Threshold) -> str:
    """The report a person reads."""
    low, high = report.between
    tried = len(report.values)
    lines = [
        f"{report.title}",
        f"scanned: {report.over} from {low:g} to {high:g}{_unit(report)}, {report.points} values ({report.spacing}), "
        f"then every change bisected to {report.within:g} of its value; {tried} runs",
        *_crossings(report), "", sentence(report),
    ]  # fmt: skip
    return "\n".join(lines)


def sentence(report: Threshold) -> str:
    """Where hard spheres hold, in one or two sentences."""
    if not report.undecided:
        return _decided(report)
    first = next(one for one in report.values if one.verdict == UNDECIDED)
    doubt = (f"Undecided {_spans(report, report.undecided)}; at {report.over} = {first.value:.4g}{_unit(report)}: "
             f"{first.why.rstrip('.')}.")
    return f"{_decided(report)} {doubt}" if report.holds or report.fails else doubt


def _decided(report: Threshold) -> str:
    """The first sentence."""
    low, high = report.between
    asked, scan = CRITERIA[report.criterion], f"{report.over} from {low:g} to {high:g}{_unit(report)}"
    how = asked.how.format(error=report.limit)
    if not report.holds:
        return f"Nowhere is {asked.what} {how}: {scan} was scanned."
    said = f"{asked.what[0].upper()}{asked.what[1:]} is {how}"
    if report.holds == (report.between,):
        return f"{said} everywhere: {scan} was scanned."
    reaches = report.holds[0][0] == low, report.holds[-1][1] == high
    scanned = {(True, False): f"from {low:g}{_unit(report)} on", (False, True): f"up to {high:g}{_unit(report)}"}
    within = scanned.get(reaches, f"from {low:g} to {high:g}{_unit(report)}")
    return f"{said} {_spans(report, report.holds)} (scanned {within})."


def _spans(report: Threshold, spans: tuple[Interval, ...]) -> str:
    """Intervals in words, each rounded to its inside."""
    words = [_span(report, *span) for span in spans]
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def _span(report: Threshold, low: float, high: float) -> str:
    unit, (first, last) = _unit(report), report.between
    if low == high:
        return f"at {report.over} = {low:.6g}{unit}"
    if (low, high) == (first, last):
        return f"everywhere from {report.over} = {first:g} to {last:g}{unit}"
    below, above = _rounded(low, report.within, ROUND_CEILING), _rounded(high, report.within, ROUND_FLOOR)
    if high == last:
        return f"from {report.over} = {below}{unit} on"
    return f"up to {report.over} = {above}{unit}" if low == first else f"from {report.over} = {below} to {above}{unit}"


def _rounded(value: float, within: float, way: str) -> str:
    """A number with as many digits as are known, and one more, rounded up or down."""
    digits = max(3, 2 + math.ceil(-math.log10(within)))
    return f"{float(Context(prec=digits, rounding=way).create_decimal(repr(value))):.{digits}g}"


def _crossings(report: Threshold) -> Iterator[str]:
    """Every crossing: between which values, which verdicts, and what is wrong on the bad side."""
    found = report.crossings
    if not found:
        return
    rows = [[f"{report.over}{f' / {report.units}' if report.units != '1' else ''}", "below", "above", "because"]]
    digits = 3 + math.ceil(-math.log10(report.within))
    for crossing in found[:MOST]:
        low, high = crossing.low, crossing.high
        rows.append([f"{low.value:.{digits}g} … {high.value:.{digits}g}", _name(report, low), _name(report, high),
                     next((one.why for one in (low, high) if one.verdict != HOLDS), "")])  # fmt: skip
    yield ""
    yield aligned(rows, "<")
    if len(found) > MOST:
        yield f"({len(found) - MOST} more crossings not shown; all are in the JSON)"


def _name(report: Threshold, one: Value) -> str:
    """A verdict in the words of the criterion."""
    good, bad = CRITERIA[report.criterion].words
    return {HOLDS: good, FAILS: bad}.get(one.verdict, one.verdict)


def _unit(report: Threshold) -> str:
    return "" if report.units == "1" else f" {report.units}"
