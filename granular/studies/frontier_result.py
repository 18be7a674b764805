"""Result of `frontier`: errors, run times, measured orders, and a figure.

The figure shows error over run time, one line per method, readable in grey print.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import cycle
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import files, signature
from granular._engine.reports import (
    GREY_COLOUR,
    HARD_COLOUR,
    PAGE_WIDTH,
    SOFT_COLOUR,
    Report,
    add_letters,
    aligned,
    canvas,
    duration,
    number,
    problem,
    rough_text,
    short_text,
    style,
)
from granular.md.fixed.integrators import INTEGRATORS
from granular.run import until as stop
from granular.scene import Scene
from granular.studies.reference import Reference

MIN_ORDER_POINTS = 3
"""Minimum number of points for the measurement of an order."""
ROUNDING_MULTIPLE = 8.0
"""Errors up to this multiple of the rounding level are rounding errors."""
ERROR_GOALS = (1e-3, 1e-6, 1e-9, 1e-12)
"""Errors for which the fastest methods are listed."""
CONTACT_FIELDS = ("t_begin", "t_end", "v_in", "v_out")
SOLVER_MARKERS = {"dop853": ("v", "DOP853"), "lsoda": ("P", "LSODA"), "radau": ("h", "Radau")}
OPEN_MARKER: dict[str, Any] = {"ls": "none", "mfc": "white", "zorder": 6}
MIN_DRAWN_ERROR = 2e-17
"""Smallest error in the figure. Smaller errors are drawn here."""


@dataclass(frozen=True, slots=True)
class Row:
    """One method at one setting.

    Attributes
    ----------
    method : str
        Name of the method.
    setting : float
        Value that controls the accuracy of the method, nan if there is none.
    velocity_error : float
        Largest error of the velocities of both bodies at the end of each pair's last contact, in units of the impact
        speed. nan if a pair has an ended contact in only one of the two runs.
    time_error : float
        Largest error of onset or end of a contact, in units of the longest contact, nan if contact counts differ.
    wrong_count : bool
        Whether a pair has a wrong number of contacts.
    rounding : bool
        Whether the error of velocities is not resolved, because it is at most `Frontier.floor`.
    seconds : float
        Shortest processor time of the repeated runs in s, after a first run that is ignored.
    work, unit : int, str
        Amount of work, in "steps", "evaluations" or "events".
    status : str
        Status of the run.
    """

    method: str
    setting: float
    velocity_error: float
    time_error: float
    wrong_count: bool
    rounding: bool
    seconds: float
    work: int
    unit: str
    status: str

    @property
    def good(self) -> bool:
        """Whether all contact counts are right and the velocity error is finite."""
        return not self.wrong_count and math.isfinite(self.velocity_error)


@signature.face
@dataclass(frozen=True, repr=False)
class Frontier(Report):
    """Error against run time. Draw it with `plot`, save it with `to_json`.

    Attributes
    ----------
    scene, law, until, t_end
        The problem.
    reference : Reference
        Reference solution with its own error.
    rows : tuple of Row
        Errors and run times, ordered by method, from coarse to fine settings.
    dials : mapping
        Name of the setting of each method: "dt" in s, "tol", "rtol", or "" if it has none.
    orders : mapping
        For fixed-step methods: textbook order p, and min(p, 1+s) for a force that begins as t^s.
    rounding_level : float
        Change of the velocities, in units of the impact speed, if the gaps and velocities of the scene change by one
        unit in the last digit.
    machine : mapping
        Machine on which run times were measured.
    """

    scene: Scene
    law: tuple[Any, ...]
    until: stop.Until | None
    t_end: float | None
    reference: Reference
    rows: tuple[Row, ...]
    dials: Mapping[str, str]
    orders: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rounding_level: float = 0.0
    machine: Mapping[str, Any] = field(default_factory=dict)

    @property
    def floor(self) -> float:
        """Smallest resolved error of velocities, in units of the impact speed.

        It is the larger value of eight times the rounding level and the estimated error of the reference.
        """
        return floor(self.reference, self.rounding_level)

    @cached_property
    def clock_digit(self) -> float:
        """One unit in the last digit of the end time, divided by the longest contact.

        It limits the accuracy of contact times.
        """
        return math.ulp(self.reference.t_stop) / max(self.reference.durations)

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, in order."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    def of(self, method: str) -> tuple[Row, ...]:
        """Return the rows of one method."""
        return tuple(row for row in self.rows if row.method == method)

    def order(self, method: str) -> float:
        """Return the measured order: slope of log(velocity error) over log(setting).

        The slope is computed by regression, without errors below the floor, wrong contact counts and the coarsest
        quarter. It is nan if fewer than three points remain, or if the method has no setting.
        """
        rows = [row for row in self.of(method) if row.good and not row.rounding and row.velocity_error > 0.0]
        rows = rows[len(rows) // 4 :] if len(rows) > MIN_ORDER_POINTS else rows
        if len(rows) < MIN_ORDER_POINTS or math.isnan(rows[0].setting):
            return math.nan
        setting, error = (np.log([getattr(row, name) for row in rows]) for name in ("setting", "velocity_error"))
        return float(np.polyfit(setting, error, 1)[0])

    def fastest(self, error: float, *, without: tuple[str, ...] = ()) -> Row | None:
        """Return the fastest good row with a velocity error of at most `error`, or None.

        The numbers of contacts of a good row are right. `error` is in units of the impact speed. The methods named in
        `without` are ignored.
        """
        rows = [row for row in self.rows if row.good and row.velocity_error <= error and row.method not in without]
        return min(rows, key=lambda row: row.seconds, default=None)

    def __str__(self) -> str:
        orders = [["order in", "", "measured", "min(p, 1+s)", "textbook p"], *_orders(self)]
        return f"{self.scene}, {laws(self)}\n{_origin(self)}\n\n" + "\n\n".join([
            aligned([["method", "setting", "error of v", "error of t", "contacts", "run time", "work"],
                     *(_row(row, self.dials[row.method]) for row in self.rows)], "<>>><><"),
            *([aligned(orders, "<>")] if len(orders) > 1 else []),
            aligned([["error of v below", "located", "fastest other"],
                     *(_goal(self, goal) for goal in ERROR_GOALS if goal >= self.floor)], "<><"),
        ])

    def _numbers(self) -> dict[str, Any]:
        """All numbers of the report for JSON."""
        truth = self.reference
        return {
            "provenance": files.provenance() | {"run_on": dict(self.machine)},
            "seed": None,  # no random numbers are used; the scene is here in full
            **problem(self),
            "reference": {
                "solver": truth.solver, "velocity_error": truth.velocity_error, "time_error": truth.time_error,
                "impact_speed": truth.impact_speed, "status": truth.status, "t_stop": truth.t_stop,
                "contacts": [{"pair": row.pair} | {name: _digits(getattr(row, name)) for name in CONTACT_FIELDS}
                             for row in truth.contacts],
            },
            "rounding_level": self.rounding_level, "floor": self.floor,
            "rows": [asdict(row) | {"dial": self.dials[row.method]} for row in self.rows],
            "orders": {name: dict(zip(("textbook", "expected"), self.orders.get(name, (None, None)), strict=True))
                       | {"measured": self.order(name)} for name in self.methods},
        }

    @style()
    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw errors over run time. Return the figure, or save it to `path`.

        Open markers show runs with a wrong number of contacts. Errors in the grey region are not resolved.
        """
        figure, ((left, right),) = canvas(PAGE_WIDTH, 4.0, 1, 2, sharex=True, sharey=True)
        _errors(left, self, "velocity_error", "error of velocities (units of the impact speed)")
        _errors(right, self, "time_error", "error of times (units of the longest contact)")
        _shade(left, self.floor)
        _shade(right, np.fmax(self.clock_digit, self.reference.time_error))
        _legend(figure, self)
        add_letters((left, right))
        return files.write_figure(path, figure, dpi=200)


def floor(reference: Reference, rounding_level: float) -> float:
    """Return the value of `Frontier.floor`. A reference error of nan is ignored."""
    return float(np.fmax(ROUNDING_MULTIPLE * rounding_level, reference.velocity_error))


def laws(report: Frontier) -> str:
    """Return a short description of the force laws in one line."""
    shown = list(dict.fromkeys(short_text(repr(law)) for law in report.law))
    return shown[0] if len(shown) == 1 else f"{shown[0]} … {shown[-1]}"


def _origin(report: Frontier) -> str:
    """Return the lines on the reference solution, the resolution and the machine."""
    truth, machine = report.reference, report.machine
    return (
        f"reference: {truth.solver}; its error {truth.velocity_error:.1g} of the impact speed, "
        f"{truth.time_error:.1g} of the longest contact; {len(truth.contacts)} contacts\n"
        f"errors below {report.floor:.1g} are not resolved: rounding of the scene's numbers is "
        f"{report.rounding_level:.1g} × {ROUNDING_MULTIPLE:g}\n"
        f"run on {machine.get('processor')}, {machine.get('cores')} cores, Python {machine.get('python')}, "
        f"numpy {machine.get('numpy')}, scipy {machine.get('scipy')}, numba {machine.get('numba')}"
    )


def _row(row: Row, dial: str) -> list[str]:
    """Return the table cells of a row, whose setting is named `dial`."""
    notes = [row.status] * (row.status in ("stopped", "failed", "unstable")) + ["not resolved"] * row.rounding
    return [
        row.method, f"{dial} {row.setting:.1e}" if dial else "-",
        *(number(x, ".1e", "-") for x in (row.velocity_error, row.time_error)),
        "WRONG" if row.wrong_count else "right", duration(row.seconds),
        f"{row.work} {row.unit}" + (f"  ({', '.join(notes)})" if notes else ""),
    ]


def _orders(report: Frontier) -> Iterator[list[str]]:
    for name in report.methods:
        textbook, expected = report.orders.get(name, (math.nan, math.nan))
        if not math.isnan(order := report.order(name)):
            yield [name, report.dials[name], *(number(p, ".2f", "") for p in (order, expected, textbook))]


def _goal(report: Frontier, goal: float) -> list[str]:
    located = report.fastest(goal, without=tuple(m for m in report.methods if m != "located"))
    fastest_other = report.fastest(goal, without=("located",))
    ratio = f" ({rough_text(fastest_other.seconds / located.seconds)} × as long)" if located and fastest_other else ""
    method = f"{fastest_other.method}: {duration(fastest_other.seconds)}{ratio}" if fastest_other else "none"
    return [f"{goal:.0e}", duration(located.seconds) if located else "none", method]


def _digits(value: Any) -> Any:
    """Return numbers of the reference as strings with all their digits."""
    return [_digits(v) for v in value] if isinstance(value, tuple) else (
        str(value) if hasattr(value, "_mpf_") else value)


def _line_style(colour: str, line: str, marker: str, label: str, size: float = 4.5) -> dict[str, Any]:
    """Return the keyword arguments of matplotlib for the line of one method."""
    return {"color": colour, "ls": line, "marker": marker, "label": label, "lw": 0.9, "ms": size, "mew": 0.8}


STYLE_FAMILIES = {
    "": {"located": _line_style(SOFT_COLOUR, "-", "*", "located (default)", 9.0) | {"zorder": 5},
         "edmd": _line_style(HARD_COLOUR, "none", "p", "event-driven (hard)", 7.0)},
    "fixed step (dt)": {x.name: _line_style("#2a8a6a", "--", marker, x.label)
                        for x, marker in zip(INTEGRATORS.values(), cycle("os^D"), strict=False)},
    "SciPy, events (rtol)": {f"{name}+events": _line_style("#8e5ea2", "-.", marker, f"{label}, events")
                             for name, (marker, label) in SOLVER_MARKERS.items()},
    "SciPy, no events (rtol)": {name: _line_style(GREY_COLOUR, ":", *look) for name, look in SOLVER_MARKERS.items()},
}
"""Line style of each method. Methods of a family have the same colour and line."""
METHOD_STYLES = {name: look for members in STYLE_FAMILIES.values() for name, look in members.items()}


def _errors(axis: Any, report: Frontier, quantity: str, label: str) -> None:
    """Draw one line of errors per method, with open markers at wrong contact counts."""
    for method in report.methods:
        rows = [row for row in report.of(method) if math.isfinite(getattr(row, quantity))]
        for shown, more in ((rows, {}), ([row for row in rows if row.wrong_count], OPEN_MARKER)):
            axis.plot([1e3 * row.seconds for row in shown],
                      [max(getattr(row, quantity), MIN_DRAWN_ERROR) for row in shown], **METHOD_STYLES[method] | more)
    axis.set(xscale="log", yscale="log", axisbelow=True, xlabel="run time (ms)", ylabel=label)
    axis.grid(which="major", color="0.9", lw=0.5)
    axis.tick_params(labelleft=True)


def _shade(axis: Any, top: float) -> None:
    """Shade errors below `top`, which are not resolved."""
    axis.axhspan(MIN_DRAWN_ERROR / 2.0, top, color="0.92", lw=0, zorder=0)
    axis.set_ylim(bottom=MIN_DRAWN_ERROR / 2.0)


def _legend(figure: Any, report: Frontier) -> None:
    """Draw a legend of the methods by family, and of open markers and the grey region."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    columns: dict[str, list[Any]] = {
        head: [Line2D([], [], **look) for name, look in members.items() if name in report.methods]
        for head, members in STYLE_FAMILIES.items()}
    if any(row.wrong_count for row in report.rows):
        columns[""].append(Line2D([], [], marker="o", color="black", label="open: wrong number of contacts", ms=4.5,
                                  **OPEN_MARKER))
    columns[""].append(Patch(color="0.92", label="not resolved"))
    columns = {head: entries for head, entries in columns.items() if entries}
    depth, handles = max(map(len, columns.values())), []
    for head, entries in columns.items():
        handles += [Line2D([], [], ls="none", label=head), *entries,
                    *[Line2D([], [], ls="none", label="")] * (depth - len(entries))]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(columns), handlelength=2.8)
