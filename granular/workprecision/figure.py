"""The figure of a frontier: error over run time, one line a method, readable in grey print.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

import math
from itertools import cycle
from os import PathLike
from textwrap import fill
from typing import Any

from granular import _files
from granular.drawing import canvas
from granular.md.integrators import INTEGRATORS
from granular.workprecision.result import NEAR, Measured
from granular.workprecision.table import laws


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
}  # fmt: skip
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
               for head, members in FAMILIES.items()}  # fmt: skip
    if any(row.wrong_count for row in report.rows):
        columns[""].append(entry(CROSS | {"label": "wrong number of contacts"}))
    columns = {head: entries for head, entries in columns.items() if entries}
    depth, handles = max(map(len, columns.values())), []
    for head, entries in columns.items():
        handles += [Line2D([], [], ls="none", label=head), *entries]
        handles += [Line2D([], [], ls="none", label="")] * (depth - len(entries))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(columns), fontsize=7, frameon=False,
                  handlelength=2.4, columnspacing=1.0)  # fmt: skip


def _title(report: Measured) -> str:
    on, truth = report.machine, report.reference
    return (
        f"{fill(f'{report.scene!r}; {laws(report)}', 110)}\n"
        f"{len(truth.contacts)} contacts; reference: {truth.solver}, error {max(truth.velocity_error, 1e-99):.0e}\n"
        f"{on.get('processor')}, one core; Python {on.get('python')}, NumPy {on.get('numpy')}, "
        f"SciPy {on.get('scipy')}, numba {on.get('numba')}"
    )
