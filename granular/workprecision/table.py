"""A frontier in words and numbers: the table in the terminal, and JSON with provenance."""

from __future__ import annotations

import math
from dataclasses import asdict, fields, is_dataclass
from os import PathLike
from typing import Any

from granular import _files
from granular._describe import scene_to_json
from granular.workprecision.result import NEAR, Measured, Row

GOALS = (1e-3, 1e-6, 1e-9, 1e-12)
"""Errors for which the fastest methods are named."""


def table(report: Measured) -> str:
    """The report a person reads."""
    lines = [f"{report.scene!r}, {laws(report)}", *_reference_lines(report), "", *_row_lines(report), ""]
    lines += [*_order_lines(report), "", *_goal_lines(report)]
    return "\n".join(lines)


def duration(seconds: float) -> str:
    """A run time with three digits and its unit."""
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 1e-9:.3g} ns"


def as_dict(report: Measured) -> dict[str, Any]:
    """All numbers with provenance, ready for JSON (nan and inf become None)."""
    truth = report.reference
    numbers: dict[str, Any] = _files.plain(
        {
            "provenance": _files.provenance() | {"run_on": dict(report.machine)},
            "seed": None,  # no random numbers are used; the scene is here in full
            "scene": scene_to_json(report.scene),
            "law": [repr(law) for law in report.law],
            "until": repr(report.until),
            "t_end": report.t_end,
            "reference": {
                "solver": truth.solver, "velocity_error": truth.velocity_error, "time_error": truth.time_error,
                "impact_speed": truth.impact_speed, "status": truth.status, "t_stop": truth.t_stop,
                "contacts": [_contact(row) for row in truth.contacts],
            },
            "rounding_level": report.rounding_level,
            "rows": [asdict(row) | {"dial": report.dials[row.method]} for row in report.rows],
            "orders": {
                name: {"measured": report.order(name), "textbook": report.orders.get(name, (None, None))[0],
                       "expected": report.orders.get(name, (None, None))[1]}
                for name in report.methods
            },
        }
    )  # fmt: skip
    return numbers


def to_json(report: Measured, path: str | PathLike[str]) -> None:
    """Write `to_dict` to a file, whole or not at all."""
    _files.write_json(path, as_dict(report))


def laws(report: Measured) -> str:
    """The force laws in few words."""
    shown = list(dict.fromkeys(_short(law) for law in report.law))
    return shown[0] if len(shown) == 1 else f"{shown[0]} … {shown[-1]}"


def _short(law: Any) -> str:
    """A law with four digits of its numbers."""
    if not is_dataclass(law):
        return repr(law)
    return f"{type(law).__name__}({', '.join(f'{f.name}={getattr(law, f.name):.4g}' for f in fields(law))})"


def _reference_lines(report: Measured) -> list[str]:
    truth, on = report.reference, report.machine
    return [
        f"reference: {truth.solver}; its error {truth.velocity_error:.1g} of the impact speed, "
        f"{truth.time_error:.1g} of the longest contact; {len(truth.contacts)} contacts",
        f"errors below {report.rounding_level:.1g} × {NEAR:g} are rounding: the scene's numbers have no more digits",
        f"run on {on.get('processor')}, {on.get('cores')} cores, Python {on.get('python')}, numpy {on.get('numpy')}, "
        f"scipy {on.get('scipy')}, numba {on.get('numba')}",
    ]


def _row_lines(report: Measured) -> list[str]:
    head = f"{'method':17}{'setting':>14}{'error of v':>12}{'error of t':>12}  {'contacts':9}{'run time':>10}  work"
    return [head, *(_row_line(row, report.dials[row.method]) for row in report.rows)]


def _row_line(row: Row, dial: str) -> str:
    setting = f"{dial} {row.setting:.1e}" if dial else "-"
    count = "WRONG" if row.wrong_count else "right"
    notes = [row.status] * (row.status in ("stopped", "failed", "unstable")) + ["rounding"] * row.rounding
    note = f"  ({', '.join(notes)})" if notes else ""
    return (
        f"{row.method:17}{setting:>14}{_number(row.velocity_error):>12}{_number(row.time_error):>12}  {count:9}"
        f"{duration(row.seconds):>10}  {row.work} {row.unit}{note}"
    )


def _order_lines(report: Measured) -> list[str]:
    lines = [f"{'order in':17}{'':>8}{'measured':>10}{'min(p, 1+s)':>13}{'textbook p':>12}"]
    for name in report.methods:
        if math.isnan(order := report.order(name)):
            continue
        textbook, expected = (_number(p, ".2f", "") for p in report.orders.get(name, (math.nan, math.nan)))
        lines.append(f"{name:17}{report.dials[name]:>8}{order:>10.2f}{expected:>13}{textbook:>12}")
    return lines


def _goal_lines(report: Measured) -> list[str]:
    lines = [f"{'error of v below':17}{'located':>10}   fastest other"]
    for goal in GOALS:
        mine = report.fastest(goal, without=tuple(m for m in report.methods if m != "located"))
        other = report.fastest(goal, without=("located",))
        ratio = f" ({other.seconds / mine.seconds:.2g} × as long)" if mine and other else ""
        shown = f"{other.method}: {duration(other.seconds)}{ratio}" if other else "none of those tried"
        lines.append(f"{goal:<17.0e}{duration(mine.seconds) if mine else 'none':>10}   {shown}")
    return lines


def _number(x: float, form: str = ".1e", none: str = "-") -> str:
    return none if math.isnan(x) else format(x, form)


def _contact(row: Any) -> dict[str, Any]:
    numbers = {"t_begin": row.t_begin, "t_end": row.t_end, "v_in": row.v_in, "v_out": row.v_out}
    return {"pair": row.pair} | {name: _digits(value) for name, value in numbers.items()}


def _digits(value: Any) -> Any:
    """Numbers of the reference with all their digits, as text."""
    if isinstance(value, tuple):
        return [_digits(v) for v in value]
    return str(value) if hasattr(value, "_mpf_") else value
