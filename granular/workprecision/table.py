"""A frontier in words and numbers: the table in the terminal, and what JSON has of it.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, fields, is_dataclass
from typing import Any

from granular import _files
from granular.tables import aligned, duration, number, problem
from granular.workprecision.result import NEAR, Measured, Row

GOALS = (1e-3, 1e-6, 1e-9, 1e-12)
"""Errors for which the fastest methods are named."""
OF_A_CONTACT = ("t_begin", "t_end", "v_in", "v_out")


def table(report: Measured) -> str:
    """The report a person reads."""
    return f"{report.scene!r}, {laws(report)}\n{_origin(report)}\n\n" + "\n\n".join([
        aligned([["method", "setting", "error of v", "error of t", "contacts", "run time", "work"],
                 *(_row(row, report.dials[row.method]) for row in report.rows)], "<>>><><"),
        aligned([["order in", "", "measured", "min(p, 1+s)", "textbook p"], *_orders(report)], "<>"),
        aligned([["error of v below", "located", "fastest other"], *(_goal(report, goal) for goal in GOALS)], "<><"),
    ])  # fmt: skip


def numbers(report: Measured) -> dict[str, Any]:
    """All numbers, with the machine they were measured on."""
    truth = report.reference
    return {
        "provenance": _files.provenance() | {"run_on": dict(report.machine)},
        "seed": None,  # no random numbers are used; the scene is here in full
        **problem(report),
        "reference": {
            "solver": truth.solver, "velocity_error": truth.velocity_error, "time_error": truth.time_error,
            "impact_speed": truth.impact_speed, "status": truth.status, "t_stop": truth.t_stop,
            "contacts": [{"pair": row.pair} | {name: _digits(getattr(row, name)) for name in OF_A_CONTACT}
                         for row in truth.contacts],
        },
        "rounding_level": report.rounding_level,
        "rows": [asdict(row) | {"dial": report.dials[row.method]} for row in report.rows],
        "orders": {name: dict(zip(("textbook", "expected"), report.orders.get(name, (None, None)), strict=True))
                   | {"measured": report.order(name)} for name in report.methods},
    }  # fmt: skip


def laws(report: Measured) -> str:
    """The force laws in few words."""
    shown = list(dict.fromkeys(_short(law) for law in report.law))
    return shown[0] if len(shown) == 1 else f"{shown[0]} … {shown[-1]}"


def _short(law: Any) -> str:
    """A law with four digits of its numbers."""
    if not is_dataclass(law):
        return repr(law)
    return f"{type(law).__name__}({', '.join(f'{f.name}={getattr(law, f.name):.4g}' for f in fields(law))})"


def _origin(report: Measured) -> str:
    truth, on = report.reference, report.machine
    return (
        f"reference: {truth.solver}; its error {truth.velocity_error:.1g} of the impact speed, "
        f"{truth.time_error:.1g} of the longest contact; {len(truth.contacts)} contacts\n"
        f"errors below {report.rounding_level:.1g} × {NEAR:g} are rounding: the scene's numbers have no more digits\n"
        f"run on {on.get('processor')}, {on.get('cores')} cores, Python {on.get('python')}, numpy {on.get('numpy')}, "
        f"scipy {on.get('scipy')}, numba {on.get('numba')}"
    )


def _row(row: Row, dial: str) -> list[str]:
    notes = [row.status] * (row.status in ("stopped", "failed", "unstable")) + ["rounding"] * row.rounding
    return [
        row.method, f"{dial} {row.setting:.1e}" if dial else "-",
        *(number(x, ".1e", "-") for x in (row.velocity_error, row.time_error)),
        "WRONG" if row.wrong_count else "right", duration(row.seconds),
        f"{row.work} {row.unit}" + (f"  ({', '.join(notes)})" if notes else ""),
    ]  # fmt: skip


def _orders(report: Measured) -> Iterator[list[str]]:
    for name in report.methods:
        textbook, expected = report.orders.get(name, (math.nan, math.nan))
        if not math.isnan(order := report.order(name)):
            yield [name, report.dials[name], *(number(p, ".2f", "") for p in (order, expected, textbook))]


def _goal(report: Measured, goal: float) -> list[str]:
    mine = report.fastest(goal, without=tuple(m for m in report.methods if m != "located"))
    other = report.fastest(goal, without=("located",))
    ratio = f" ({other.seconds / mine.seconds:.2g} × as long)" if mine and other else ""
    shown = f"{other.method}: {duration(other.seconds)}{ratio}" if other else "none of those tried"
    return [f"{goal:.0e}", duration(mine.seconds) if mine else "none", shown]


def _digits(value: Any) -> Any:
    """Numbers of the reference with all their digits, as text."""
    if isinstance(value, tuple):
        return [_digits(v) for v in value]
    return str(value) if hasattr(value, "_mpf_") else value
