"""The report of a frontier in words and as a figure: error over run time, one line a method, readable in grey print.
May be skipped: words and pictures of what is computed elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, fields, is_dataclass
from itertools import cycle
from os import PathLike
from textwrap import fill
from typing import Any

from granular import _files
from granular._drawing import canvas
from granular._tables import aligned, duration, number, problem
from granular.frontiers.result import NEAR, Measured, Row
from granular.md.fixed.integrators import INTEGRATORS

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
    ])


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
    }


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
    ]


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


def _look(colour: str, line: str, marker: str, label: str, width: float = 0.9, size: float = 4.2) -> dict[str, Any]:
    inside = colour if line in ("-", "none") else "white"
    return {"color": colour, "ls": line, "marker": marker, "label": label, "lw": width, "ms": size, "mfc": inside}


MARKERS = {"dop853": ("v", "DOP853"), "lsoda": ("P", "LSODA"), "radau": ("h", "Radau")}
FAMILIES = {
    "": {"located": _look("#0b3c6f", "-", "*", "located (default)", 1.8, 11.0) | {"zorder": 5},
         "edmd": _look("#000000", "none", "p", "event-driven (hard spheres)", size=8.0)},
    "fixed step (dt)": {x.name: _look("#c1440e", "--", marker, x.label)
                        for x, marker in zip(INTEGRATORS.values(), cycle("os^D"), strict=False)},
    "SciPy, restarted at events (rtol)": {f"{name}+events": _look("#3f8f5f", "-", marker, f"{label}, events")
                                          for name, (marker, label) in MARKERS.items()},
    "SciPy, no events (rtol)": {name: _look("#8a8a8a", ":", *look) for name, look in MARKERS.items()},
}
"""How each method looks: families by colour and line, members by marker."""
LOOKS = {name: look for members in FAMILIES.values() for name, look in members.items()}
CROSS = {"ls": "none", "marker": "x", "color": "black", "mew": 1.2, "zorder": 6}
LEAST = 2e-17
"""Errors below are drawn here: a double has no more digits."""


def plot(report: Measured, path: str | PathLike[str] | None = None) -> Any:
    """Draw errors over run time; return the figure, or save it to `path` (format by the file's ending)."""
    figure, ((left, right),) = canvas(7.1, 4.4, 1, 2, sharex=True, sharey=True)
    _errors(left, report, "velocity_error", "impact speed")
    left.set_title("velocities after the last contacts", fontsize=8.5)
    _shade(left, NEAR * report.rounding_level, "rounding")
    _errors(right, report, "time_error", "longest contact")
    right.set_title("onset and end of contacts", fontsize=8.5)
    _shade(right, report.clock_digit, "last digit of the clock")
    _legend(figure, report)
    figure.suptitle(_title(report), fontsize=8, x=0.01, ha="left")
    return _files.write_figure(path, figure, dpi=130)


def _errors(axis: Any, report: Measured, quantity: str, unit: str) -> None:
    """One line a method; wrong contact counts are crossed out."""
    for method in report.methods:
        points = [(1e3 * row.seconds, max(getattr(row, quantity), LEAST), row.wrong_count) for row in report.of(method)]
        points = [point for point in points if math.isfinite(point[1])]
        times, errors, _ = zip(*points, strict=True) if points else ((), (), ())
        axis.plot(times, errors, **LOOKS[method] | {"mew": 0.8})
        for time, error, wrong in points:
            if wrong:
                axis.plot(time, error, ms=9, **CROSS)
    axis.set(xscale="log", yscale="log", axisbelow=True)
    axis.set_xlabel("run time, ms", fontsize=8)
    axis.set_ylabel(f"error / {unit}", fontsize=8)
    axis.grid(which="major", color="0.9", lw=0.5)
    axis.tick_params(labelsize=7.5, which="both", labelleft=True)


def _shade(axis: Any, top: float, name: str) -> None:
    """Shade errors that are due to the digits of a double."""
    axis.axhspan(LEAST / 2.0, top, color="0.93", lw=0, zorder=0)
    axis.text(0.98, top, name, transform=axis.get_yaxis_transform(), ha="right", va="top", fontsize=7, color="0.35")
    axis.set_ylim(bottom=LEAST / 2.0)


def _legend(figure: Any, report: Measured) -> None:
    """Methods by family, and what a cross means."""
    from matplotlib.lines import Line2D

    def entry(look: dict[str, Any]) -> Any:
        return Line2D([], [], **look | {"lw": 1.2, "ms": 9.0 if look["marker"] in "*x" else 4.5})

    columns = {head: [entry(look) for name, look in members.items() if name in report.methods]
               for head, members in FAMILIES.items()}
    if any(row.wrong_count for row in report.rows):
        columns[""].append(entry(CROSS | {"label": "wrong number of contacts"}))
    columns = {head: entries for head, entries in columns.items() if entries}
    depth, handles = max(map(len, columns.values())), []
    for head, entries in columns.items():
        handles += [Line2D([], [], ls="none", label=head), *entries]
        handles += [Line2D([], [], ls="none", label="")] * (depth - len(entries))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(columns), fontsize=7, frameon=False,
                  handlelength=2.4, columnspacing=1.0)


def _title(report: Measured) -> str:
    on, truth = report.machine, report.reference
    return (
        f"{fill(f'{report.scene!r}; {laws(report)}', 110)}\n"
        f"{len(truth.contacts)} contacts; reference: {truth.solver}, error {max(truth.velocity_error, 1e-99):.0e}\n"
        f"{on.get('processor')}, one core; Python {on.get('python')}, NumPy {on.get('numpy')}, "
        f"SciPy {on.get('scipy')}, numba {on.get('numba')}"
    )
