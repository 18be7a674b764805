"""The figure of a frontier: error over run time, one line a method, readable in grey print."""

from __future__ import annotations

import math
from os import PathLike
from textwrap import fill
from typing import Any

from granular import _files
from granular._optional import optional
from granular.md.integrators import INTEGRATORS
from granular.workprecision.result import NEAR, Measured, Row
from granular.workprecision.table import laws

STYLE = {
    "located": ("#0b3c6f", "-", "*", "located (default)"),
    **{x.name: ("#c1440e", "--", marker, x.label) for x, marker in zip(INTEGRATORS.values(), "os^D", strict=True)},
    "edmd": ("#000000", "none", "p", "event-driven (hard spheres)"),
    "dop853+events": ("#3f8f5f", "-", "v", "DOP853, events"),
    "lsoda+events": ("#3f8f5f", "-", "P", "LSODA, events"),
    "radau+events": ("#3f8f5f", "-", "h", "Radau, events"),
    "dop853": ("#8a8a8a", ":", "v", "DOP853"),
    "lsoda": ("#8a8a8a", ":", "P", "LSODA"),
    "radau": ("#8a8a8a", ":", "h", "Radau"),
}
"""Colour, line, marker and name of each method: families by colour and line, members by marker."""
GROUPS = {"fixed step (dt)": tuple(INTEGRATORS),
          "SciPy, restarted at events (rtol)": ("dop853+events", "lsoda+events", "radau+events"),
          "SciPy, no events (rtol)": ("dop853", "lsoda", "radau")}  # fmt: skip
LEAST = 2e-17
"""Errors below are drawn here: a double has no more digits."""


def plot(report: Measured, path: str | PathLike[str] | None = None) -> Any:
    """Draw errors over run time; return the figure, or save it to `path` (format by the file's ending)."""
    figure_class = optional("matplotlib.figure", "plot").Figure
    figure = figure_class(figsize=(7.1, 4.4), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    quantities = ("velocity_error", "time_error")
    titles = ("velocities after the last contacts", "begin and end of contacts")
    units = ("impact speed", "longest contact")
    for axis, name, title, unit in zip(axes, quantities, titles, units, strict=True):
        for method in report.methods:
            _draw(axis, report.of(method), name)
        axis.set(xscale="log", yscale="log", axisbelow=True)
        axis.set_xlabel("run time, ms", fontsize=8)
        axis.set_ylabel(f"error / {unit}", fontsize=8)
        axis.set_title(title, fontsize=8.5)
        axis.grid(which="major", color="0.9", lw=0.5)
        axis.tick_params(labelsize=7.5, which="both", labelleft=True)
    _rounding(axes[0], NEAR * report.rounding_level, "rounding")
    _rounding(axes[1], report.clock_digit, "last digit of the clock")
    _legend(figure, report)
    figure.suptitle(_title(report), fontsize=8, x=0.01, ha="left")
    return _files.write_figure(path, figure, dpi=130)


def _draw(axis: Any, rows: tuple[Row, ...], quantity: str) -> None:
    """One line of a method; wrong contact counts are crossed out."""
    colour, line, marker, _ = STYLE[rows[0].method]
    points = [(1e3 * row.seconds, max(getattr(row, quantity), LEAST), row.wrong_count) for row in rows]
    points = [point for point in points if math.isfinite(point[1])]
    if not points:
        return
    bold = rows[0].method == "located"
    size = {"located": 11.0, "edmd": 8.0}.get(rows[0].method, 4.2)
    fill = colour if line in ("-", "none") else "white"
    axis.plot(
        [p[0] for p in points], [p[1] for p in points], color=colour, ls=line, lw=1.8 if bold else 0.9, marker=marker,
        ms=size, mfc=fill, mew=0.8, zorder=5 if bold else 3,
    )  # fmt: skip
    crosses = [p[:2] for p in points if p[2]]
    for x, y in crosses:
        axis.plot(x, y, ls="none", marker="x", color="black", ms=9, mew=1.2, zorder=6)


def _rounding(axis: Any, top: float, name: str) -> None:
    """Shade errors that are due to the digits of a double."""
    axis.axhspan(LEAST / 2.0, top, color="0.93", lw=0, zorder=0)
    height = axis.get_yaxis_transform()
    axis.text(0.98, top, name, transform=height, ha="right", va="top", fontsize=7, color="0.35")
    axis.set_ylim(bottom=LEAST / 2.0)


def _legend(figure: Any, report: Measured) -> None:
    """Methods by family, and what a cross means."""
    from matplotlib.lines import Line2D

    def entry(method: str) -> Any:
        colour, line, marker, name = STYLE[method]
        fill = colour if line in ("-", "none") else "white"
        size = 9.0 if method == "located" else 4.5
        return Line2D([], [], color=colour, ls=line, marker=marker, mfc=fill, ms=size, lw=1.2, label=name)

    alone = [entry(method) for method in ("located", "edmd") if method in report.methods]
    columns = [alone] + [[entry(m) for m in members if m in report.methods] for members in GROUPS.values()]
    heads = ["", *GROUPS]
    if any(row.wrong_count for row in report.rows):
        columns[0].append(Line2D([], [], color="black", ls="none", marker="x", ms=8, label="wrong number of contacts"))
    shown = [(head, column) for head, column in zip(heads, columns, strict=True) if column]
    depth = max(len(column) for _, column in shown) + 1
    handles = []
    for head, column in shown:
        blank = Line2D([], [], ls="none", label=head)
        handles += [blank, *column] + [Line2D([], [], ls="none", label="")] * (depth - 1 - len(column))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(shown), fontsize=7, frameon=False,
                  handlelength=2.4, columnspacing=1.0)  # fmt: skip


def _title(report: Measured) -> str:
    on, truth = report.machine, report.reference
    return (
        f"{fill(f'{report.scene!r}; {laws(report)}', 110)}\n"
        f"{len(truth.contacts)} contacts; reference: {truth.solver}, error {max(truth.velocity_error, 1e-99):.0e}\n"
        f"{on.get('processor')}, one core; Python {on.get('python')}, NumPy {on.get('numpy')}, "
        f"SciPy {on.get('scipy')}, numba {on.get('numba')}"
    )
