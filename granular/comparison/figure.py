"""Figure of a comparison: contacts, forces and paths, and an enlarged view."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine import files
from granular._engine.check import Array
from granular._engine.reports import (
    GREY_COLOUR,
    HARD_COLOUR,
    SOFT_COLOUR,
    UNIT_PREFIXES,
    add_letters,
    canvas,
    style,
    unit_of,
)
from granular.comparison.further import repeat_with_samples
from granular.comparison.view import Closeup, View, closeup, draw_closeup, parameters, window
from granular.run.figures import MAX_LABELS, SMALL_FONT, draw_world_lines, write_titles
from granular.run.trajectory import EARLY_STATUSES, Trajectory, points

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

MIN_MARK_WIDTH = 1.5
"""Line width in points of the mark in the middle of a contact.

It keeps short contacts visible.
"""
FORCE_PREFIXES = ((1e6, "M"), (1e3, "k"), *UNIT_PREFIXES[:3])
"""Multiples of the newton."""
FORCE_MAP_COLUMNS = 300
"""Number of time intervals of a force map. Each shows its largest force."""
MAX_FORCE_CURVES = 6
"""Maximum number of pairs whose forces are drawn as curves. More pairs get a map."""


@style()
def plot(report: ComparisonWithAnswer, path: str | PathLike[str] | None = None) -> Any:
    """Draw the figure of a comparison, see `Comparison.plot`."""
    view, n = window(report), report.scene.n_pairs
    detail = closeup(view)
    heights = [0.2 * min(n, 12) + 0.4, *([0.75] * n if n <= MAX_FORCE_CURVES else [0.2 * min(n, 12) + 1.0]), 2.4]
    figure, panels = canvas(7.0, sum(heights) + 1.4 + 2.2 * bool(detail), len(heights) + bool(detail),
                            height_ratios=heights + [1.9] * bool(detail))
    axes = panels[: len(heights), 0]
    write_titles(figure, report.verdict, parameters(report))
    runs = repeat_both_runs(report, view.moments if detail is None else np.union1d(view.moments, detail.moments))
    draw_contacts(axes[0], view, runs)
    _forces(figure, axes[1:-1], view, runs["soft"])
    draw_runs(axes[-1], view, runs)
    if detail is not None:
        draw_closeup(panels[-1, 0], detail, runs)
        shade_detail(axes[0], view, detail)
    shared = panels[:, 0] if detail is None or detail.view is view else axes
    for axis in shared:
        axis.set_xlim(view.limits)
        axis.tick_params(labelbottom=axis is shared[-1])
    shared[-1].set_xlabel(view.named)
    axes[0].legend(*axes[-1].get_legend_handles_labels(), loc="lower left", bbox_to_anchor=(0.04, 1.0), ncols=3,
                   frameon=False, borderaxespad=0.2, **SMALL_FONT)
    figure.align_ylabels(panels[:, 0])
    add_letters(panels[:, 0])
    return files.write_figure(path, figure, dpi=200)


def repeat_both_runs(report: ComparisonWithAnswer, times: Array) -> dict[str, Trajectory]:
    """Repeat both runs with samples at `times` in s, by engine "soft" and "hard".

    A hard run with at least 100 000 collisions is left out.
    """
    draws_hard = len(report.hard.contacts) < 100_000
    return {engine: repeat_with_samples(report, engine, times)
            for engine in ("soft", "hard") if engine == "soft" or draws_hard}


def shade_detail(axis: Any, view: View, detail: Closeup) -> None:
    """Shade the interval of the enlarged view.

    Nothing is shaded if it covers at least 80 % of the figure.
    """
    begin, end = detail.view.begin, detail.view.end
    if end - begin < 0.8 * (view.end - view.begin):
        axis.axvspan(view.clock(begin), view.clock(end), color=GREY_COLOUR, alpha=0.2, lw=0, zorder=0)


def draw_contacts(axis: Any, view: View, runs: Mapping[str, Trajectory], named: int = MAX_LABELS) -> None:
    """Draw bars for soft contacts and marks for hard collisions, one line per pair.

    `runs` are the runs of the other panels, see `repeat_both_runs`. Contacts after the end of a compared run, or that
    last beyond it, are taken from them. If there are more than `named` pairs, the axis shows their numbers instead of
    their names.
    """
    from matplotlib.ticker import MaxNLocator

    hard, soft = (_shown_contacts(run, runs.get(engine))
                  for engine, run in zip(("hard", "soft"), view.report.counted, strict=True))
    n, start = view.report.scene.n_pairs, view.clock(soft["t_begin"])
    width = view.clock(np.nan_to_num(soft["t_end"], nan=view.end)) - start
    for c in range(n):
        axis.broken_barh(np.column_stack([start, width])[soft["pair"] == c], (c - 0.31, 0.3), color=SOFT_COLOUR, lw=0)
    axis.vlines(start + 0.5 * width, soft["pair"] - 0.31, soft["pair"] - 0.01, color=SOFT_COLOUR, lw=MIN_MARK_WIDTH)
    axis.scatter(view.clock(hard["t_begin"]), hard["pair"] + 0.22, marker="|", s=60, color=HARD_COLOUR)
    _mark_later_contacts(axis, view)
    axis.set(ylim=(-0.6, n - 0.3), xlim=view.limits, ylabel="contacts" if n <= named else "contacts\nof pair")
    if n <= named:
        axis.set_yticks(range(n), [f"pair {c}: {view.report.scene.pairs.name(c)}" for c in range(n)], **SMALL_FONT)
    else:
        axis.yaxis.set_major_locator(MaxNLocator("auto", integer=True))


def _shown_contacts(run: Trajectory, drawn: Trajectory | None) -> Any:
    """Return the contacts of a compared run and the later contacts of its drawn run."""
    log, end = run.contacts, run.time[-1]
    if drawn is None or drawn.time[-1] <= end:
        return log
    return np.concatenate([log[log["t_end"] <= end], drawn.contacts[~(drawn.contacts["t_end"] <= end)]])


def _mark_later_contacts(axis: Any, view: View) -> None:
    """Print how many contacts follow after the end of the axis, and mark their pairs."""
    later = np.concatenate([run.contacts[run.contacts["t_begin"] > view.end] for run in view.report.counted])
    if not len(later):
        return
    pairs, last = np.unique(later["pair"]), float(later["t_begin"].max())
    unit, name = unit_of(last, "s")
    axis.plot(np.full(len(pairs), view.shown[1]), pairs, ls="", marker=">", ms=5, color=SOFT_COLOUR, clip_on=False)
    axis.set_title(f"{len(later)} later contact{'s' * (len(later) > 1)}, the last at t = {last / unit:.4g} {name} ▸",
                   fontsize=8, loc="right")


def _forces(figure: Any, axes: Any, view: View, soft: Trajectory) -> None:
    """Draw the forces of soft spheres as curves, or as a map for many pairs.

    Each curve has its own panel and unit.
    """
    force = np.asarray(soft.force)
    if soft.scene.n_pairs > MAX_FORCE_CURVES:
        _force_map(figure, axes[0], view, soft)
        return
    for axis, c in zip(axes[::-1], range(soft.scene.n_pairs), strict=True):
        unit, name = unit_of(float(force[:, c].max(initial=0.0)) or 2.0, "N", prefixes=FORCE_PREFIXES)
        force_curve(axis, view.clock(soft.time), force[:, c] / unit)
        axis.set_ylabel(f"force of\n{soft.scene.pairs.name(c)} ({name})")


def force_curve(axis: Any, clock: Array, force: Array) -> None:
    """Draw a force over time, filled down to zero.

    Parameters
    ----------
    clock : array
        Times in the unit of the axis.
    force : array
        Force in the unit of the axis.
    """
    axis.fill_between(clock, force, color=SOFT_COLOUR, alpha=0.25, lw=0)
    axis.plot(clock, force, color=SOFT_COLOUR, lw=1.0)
    axis.set_ylim(0.0, 1.12 * float(force.max(initial=0.0)) or 1.0)


def _force_map(figure: Any, axis: Any, view: View, soft: Trajectory) -> None:
    """Draw the largest force of each pair in each time interval.

    It is found from the samples. For contacts shorter than an interval, the largest force in the contact log is used
    too.
    """
    from matplotlib.colors import PowerNorm
    from matplotlib.ticker import MaxNLocator

    largest = np.zeros((FORCE_MAP_COLUMNS, soft.scene.n_pairs))
    left, right = view.shown

    def columns(times: Array) -> Any:
        return np.clip(
            ((view.clock(times) - left) * (FORCE_MAP_COLUMNS / (right - left))).astype(int), 0, FORCE_MAP_COLUMNS - 1
        )

    np.maximum.at(largest, columns(soft.time), np.asarray(soft.force))
    log = view.report.counted[1].contacts
    log = log[log["duration"] * FORCE_MAP_COLUMNS < view.end - view.begin]
    np.fmax.at(largest, (columns(log["t_begin"]), log["pair"]), log["force_max"])  # nan at thermal walls
    peak = float(largest.max())
    unit, name = unit_of(peak or 2.0, "N", prefixes=FORCE_PREFIXES)
    image = axis.imshow(
        largest.T / unit, origin="lower", aspect="auto", cmap="Blues", interpolation="nearest",
        extent=(left, right, -0.5, soft.scene.n_pairs - 0.5),
        norm=PowerNorm(0.4, 0.0, peak / unit or 1.0),  # makes forces of a few per cent visible
    )
    figure.colorbar(image, cax=axis.inset_axes((1.012, 0.0, 0.014, 1.0)), label=f"force ({name})")
    axis.set_ylabel("pair")
    axis.yaxis.set_major_locator(MaxNLocator("auto", integer=True))


def draw_runs(axis: Any, view: View, runs: Mapping[str, Trajectory]) -> None:
    """Draw the paths of all balls in both runs.

    If the hard run ended early, a cross marks each ball at that time.
    """
    paths = {label: (run.time, np.asarray(points(run))) for label, run in runs.items()}
    unit = draw_world_lines(axis, view, view.report.scene, paths)
    for t, y in (paths["hard"],) if "hard" in paths else ():
        status_name = next(
            (run.status.name for run in (view.report.hard, runs["hard"]) if run.status in EARLY_STATUSES), "")
        if status_name and t[-1] < view.end:
            axis.plot(np.full(y.shape[1], view.clock(t[-1])), y[-1] / unit, "x", color=HARD_COLOUR, ms=5,
                      label=f"end of the hard run: {status_name}")
