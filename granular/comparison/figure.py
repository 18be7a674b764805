"""The figure of a comparison: contact timelines, forces and world lines of both engines, each in a panel of its own.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from textwrap import fill
from typing import Any

import numpy as np

from granular import _files
from granular._check import Array
from granular.comparison.numbers import Compared
from granular.comparison.verdict import verdict
from granular.comparison.view import View, window, with_rows
from granular.drawing import HARD, SOFT, canvas
from granular.tables import PREFIXES, unit_of
from granular.trajectory import Trajectory, points

THIN = 1.5
"""Least width in points of what marks a contact, however short it is beside the span that is drawn."""
OF_FORCE = ((1e6, "M"), (1e3, "k"), *PREFIXES[:3])
"""Multiples of the newton."""
COLUMNS = 300
"""Number of spans of time in a force map; each shows the largest force in it, so that no contact is lost."""
PAD = 0.015
"""Share of the time axis that is left free at its ends, lest a mark there be cut."""
FEW = 6
"""Up to this many pairs forces are drawn as curves, beyond as a map over pairs and time."""
BESIDE: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "frameon": False, "fontsize": 8}
"""Where a legend stands."""


def plot(report: Compared, path: str | PathLike[str] | None = None) -> Any:
    """Draw contact timelines of both engines, forces and world lines; return the figure, or save it to `path`."""
    view, n = window(report), report.scene.n_pairs
    heights = [0.22 * min(n, 12) + 0.5, *([0.9] * n if n <= FEW else [0.25 * min(n, 12) + 1.2]), 2.8]
    figure, panels = canvas(7.0, sum(heights) + 1.4, len(heights), sharex=True, height_ratios=heights)
    axes = panels[:, 0]
    figure.suptitle(fill(verdict(report), 110), fontsize=9, ha="left", x=0.02)
    runs = {"soft": with_rows(report, "soft", view.moments)}
    if len(report.hard.contacts) < 100_000:
        runs["hard"] = with_rows(report, "hard", view.moments)
    timeline(axes[0], view)
    _forces(figure, axes[1:-1], view, runs["soft"])
    world_lines(axes[-1], view, runs)
    for axis in axes[[0, -1]]:
        axis.legend(**BESIDE)
    axes[-1].set_xlabel(f"time since t = {view.begin:.6g} s, {view.unit[1]}" if view.begin else f"time, {view.unit[1]}")
    figure.align_ylabels(axes)
    return _files.write_figure(path, figure, dpi=200)


def timeline(axis: Any, view: View) -> None:
    """Bars where soft contacts last, marks where hard collisions happen; one line a pair."""
    (hard, soft), n = (run.contacts for run in view.report.counted), view.report.scene.n_pairs
    start = view.clock(soft["t_begin"])
    width = view.clock(np.nan_to_num(soft["t_end"], nan=view.end)) - start
    for c in range(n):
        bars = np.column_stack([start, width])[soft["pair"] == c]
        axis.broken_barh(bars, (c - 0.31, 0.3), color=SOFT, lw=0, label="" if c else "soft")
    axis.vlines(start + 0.5 * width, soft["pair"] - 0.31, soft["pair"] - 0.01, color=SOFT, lw=THIN)
    axis.scatter(view.clock(hard["t_begin"]), hard["pair"] + 0.22, marker="|", s=60, color=HARD, label="hard")
    _tell_of_later(axis, view)
    axis.set(ylim=(-0.6, n - 0.3), yticks=range(n) if n <= 12 else np.linspace(0, n - 1, 6).astype(int),
             xlim=(-PAD * view.span, (1.0 + PAD) * view.span), ylabel="contacts\nof pair")  # fmt: skip


def _tell_of_later(axis: Any, view: View) -> None:
    """Say how many contacts come after the end of the axis, and mark their pairs."""
    later = np.concatenate([run.contacts[run.contacts["t_begin"] > view.end] for run in view.report.counted])
    if not len(later):
        return
    pairs, last = np.unique(later["pair"]), float(later["t_begin"].max())
    unit, name = unit_of(last, "s")
    axis.plot(np.full(len(pairs), view.span), pairs, ls="", marker=">", ms=5, color=SOFT, clip_on=False)
    axis.set_title(f"{len(later)} later contact{'s' * (len(later) > 1)}, the last at t = {last / unit:.4g} {name} ▸",
                   fontsize=8, loc="right")  # fmt: skip


def _forces(figure: Any, axes: Any, view: View, soft: Trajectory) -> None:
    """Forces in a unit of their own: of few pairs as curves, the uppermost on top, of many as a map."""
    force = np.asarray(soft.force)
    if soft.scene.n_pairs > FEW:
        _force_map(figure, axes[0], view, soft)
        return
    for axis, c in zip(axes[::-1], range(soft.scene.n_pairs), strict=True):
        unit, name = unit_of(float(force[:, c].max(initial=0.0)) or 2.0, "N", prefixes=OF_FORCE)
        force_curve(axis, view.clock(soft.time), force[:, c] / unit)
        axis.set_ylabel("$F_{{{},{}}}$, {}".format(*soft.scene.bodies(c), name))


def force_curve(axis: Any, clock: Array, force: Array) -> None:
    """A force that pushes, filled down to zero."""
    axis.fill_between(clock, force, color=SOFT, alpha=0.25, lw=0)
    axis.plot(clock, force, color=SOFT, lw=1.0)
    axis.set_ylim(bottom=0.0)


def _force_map(figure: Any, axis: Any, view: View, soft: Trajectory) -> None:
    """The largest force in each column and on each pair: from samples, and from the log of short contacts."""
    largest = np.zeros((COLUMNS, soft.scene.n_pairs))

    def columns(times: Array) -> Any:
        return np.clip((view.clock(times) * (COLUMNS / view.span)).astype(int), 0, COLUMNS - 1)

    np.maximum.at(largest, columns(soft.time), np.asarray(soft.force))
    log = view.report.counted[1].contacts
    log = log[log["duration"] * COLUMNS < view.end - view.begin]
    np.fmax.at(largest, (columns(log["t_begin"]), log["pair"]), log["force_max"])  # nan at thermal walls
    peak = float(largest.max())
    unit, name = unit_of(peak or 2.0, "N", prefixes=OF_FORCE)
    image = axis.imshow(
        largest.T / unit, origin="lower", aspect="auto", cmap="Blues", interpolation="nearest",
        extent=(0.0, view.span, -0.5, soft.scene.n_pairs - 0.5), vmin=0.0, vmax=peak / unit or 1.0,
    )  # fmt: skip
    figure.colorbar(image, ax=axis, label=f"force, {name}", pad=0.01)
    axis.set_ylabel("pair")


def world_lines(axis: Any, view: View, runs: Mapping[str, Trajectory]) -> None:
    """Positions with the radii taken out, so that lines meet where balls touch and cross where they overlap."""
    low, high = points(runs["soft"]).min(), points(runs["soft"]).max()
    unit, name = unit_of(max(float(high - low), 1e-300), "m")
    for label, run in runs.items():
        colour, dash = {"soft": (SOFT, "-"), "hard": (HARD, "--")}[label]
        lines = axis.plot(view.clock(run.time), points(run) / unit, color=colour, ls=dash, lw=1.0)
        lines[0].set_label(label)
    bottom, top = axis.get_ylim()
    room = 0.5 * (high - low) / unit  # for hard balls; faster ones may leave the picture
    axis.set(ylim=(max(bottom, low / unit - room), min(top, high / unit + room)),
             ylabel=f"position, radii taken out, {name}")  # fmt: skip
