"""Figures of a comparison: contact timelines, forces and world lines of both engines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from os import PathLike
from textwrap import fill
from typing import Any

import numpy as np

from granular import _files, edmd, md
from granular._check import Array
from granular._optional import optional
from granular.comparison.numbers import Compared
from granular.comparison.verdict import verdict
from granular.trajectory import Status, Trajectory, points
from granular.until import Separated

HARD, SOFT = "#c1440e", "#1f4e79"
"""Colours of hard and soft spheres, told apart also in grey print."""
THIN = 1.5
"""Least width in points of what marks a contact, however short it is beside the span that is drawn."""
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
OF_FORCE = ((1e6, "M"), (1e3, "k"), *PREFIXES[:3])
"""Multiples of a unit: of the second and the metre, and of the newton."""
COLUMNS = 300
"""Number of spans of time in a force map; each shows the largest force in it, so that no contact is lost."""
PAD = 0.015
"""Share of the time axis that is left free at its ends, lest a mark there be cut."""
LONE = 0.01
"""Late contacts with up to this share of the impulse may be left out of the time axis, and are told of at its edge."""
FEW = 6
"""Up to this many pairs forces are drawn as curves, beyond as a map over pairs and time."""


def plot(report: Compared, path: str | PathLike[str] | None = None) -> Any:
    """Draw contact timelines of both engines, forces and world lines; return the figure, or save it to `path`."""
    figure_class = optional("matplotlib.figure", "plot").Figure
    begin, end = window(report)
    soft = resolved(report, "soft", _moments(report, begin, end))
    unit, name = unit_of(end - begin, "s")
    n = report.scene.n_pairs
    heights = [0.22 * min(n, 12) + 0.5, *([0.9] * n if n <= FEW else [0.25 * min(n, 12) + 1.2]), 2.8]
    figure = figure_class(figsize=(7.0, sum(heights) + 1.4), layout="constrained")
    axes = figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights})
    figure.suptitle(fill(verdict(report), 110), fontsize=9, ha="left", x=0.02)
    clock = (soft.time - begin) / unit
    _timeline(axes[0], report, begin, end, unit)
    if n <= FEW:
        for axis, c in zip(axes[1 : n + 1], reversed(range(n)), strict=True):
            _force_curve(axis, clock, soft, c)
    else:
        _force_map(figure, axes[1], _largest_forces(report, soft, begin, end), (end - begin) / unit)
    _world_lines(axes[-1], report, soft, begin, end, unit)
    axes[-1].set(xlabel=f"time since t = {begin:.6g} s, {name}" if begin else f"time, {name}",
                 xlim=(-PAD * (end - begin) / unit, (1.0 + PAD) * (end - begin) / unit))
    figure.align_ylabels(axes)
    return _files.write_figure(path, figure, dpi=200)


def window(report: Compared) -> tuple[float, float]:
    """Span of time in s worth drawing: from the first contact that counts to the end of the last, with a margin.

    A few late contacts of next to no impulse are left out if the others would fill less than a third of the span.
    """
    start = float(report.soft.time[0])
    if not any(len(run.contacts) for run in report.counted):
        return start, max(float(report.soft.time[-1]), start + 1.0)
    ends, share = _ends(report)
    first = float(min(run.contacts["t_begin"].min(initial=math.inf) for run in report.counted))
    last = float(ends.max())
    while True:
        bulk = ends[3.0 * (ends - first) < last - first]
        if not len(bulk) or share[ends > bulk.max()].sum() > LONE:
            break
        last = float(bulk.max())
    margin = 0.06 * (last - first) or 1e-3 * abs(first) or 1.0
    return max(first - margin, start), last + margin


def _ends(report: Compared) -> tuple[Array, Array]:
    """When contacts of both runs end in s, and the share of the impulse of its run that each has."""
    ends, shares = [], []
    for run in (report.counted[0], report.followed):
        log = run.contacts
        over = np.where(np.isnan(log["t_end"]), np.maximum(log["t_begin"], float(run.time[-1])), log["t_end"])
        ends.append(over)
        shares.append(log["impulse"] / (float(log["impulse"].sum()) or 1.0))
    return np.concatenate(ends), np.concatenate(shares)


def unit_of(span: float, si: str, prefixes: Sequence[tuple[float, str]] = PREFIXES) -> tuple[float, str]:
    """The multiple of the SI unit `si` that writes `span` with few digits, and its name."""
    scale, prefix = next((one for one in prefixes if span >= 2.0 * one[0]), prefixes[-1])
    return scale, prefix + si


def resolved(report: Compared, engine: str, times: Array) -> Trajectory:
    """One of the two runs again with rows at `times` in s, sorted; beyond its end too if free flight follows."""
    run = report.hard if engine == "hard" else report.soft
    free = run.status is Status.quiet or (run.status is Status.until and (
        engine == "hard" or isinstance(report.until, Separated)))  # fmt: skip
    stop = float(times[-1]) if free else min(float(times[-1]), float(run.time[-1]))
    rows: dict[str, Any] = {"t_end": stop, "samples": np.unique(np.minimum(times, stop)), "log": False}
    if engine == "hard":
        return edmd.simulate(report.scene, report.rule, **(dict(report.hard_options) | rows | {"until": None}))
    return md.simulate(report.scene, report.law, **report.soft_options, **rows)


def _moments(report: Compared, begin: float, end: float) -> Array:
    """Times in s to draw at: evenly spread, and within each soft contact (of very many, evenly chosen ones)."""
    log = report.counted[1].contacts
    log = log[:: max(1, len(log) // 500)]
    finish = np.where(np.isnan(log["t_end"]), end, log["t_end"])
    within = np.linspace(log["t_begin"], finish, 17).ravel()
    times: Array = np.union1d(np.linspace(begin, end, 1500), within[(within >= begin) & (within <= end)])
    return times


def _timeline(axis: Any, report: Compared, begin: float, end: float, unit: float) -> None:
    """Bars where soft contacts last, marks where hard collisions happen; one line a pair."""
    hard, soft = (run.contacts for run in report.counted)
    finish = np.where(np.isnan(soft["t_end"]), end, soft["t_end"])
    start = (soft["t_begin"] - begin) / unit
    width = (finish - soft["t_begin"]) / unit
    n = report.scene.n_pairs
    for c in range(n):
        bars = np.column_stack([start, width])[soft["pair"] == c]
        axis.broken_barh(bars, (c - 0.31, 0.3), color=SOFT, lw=0, label="" if c else "soft")
    axis.vlines(start + 0.5 * width, soft["pair"] - 0.31, soft["pair"] - 0.01, color=SOFT, lw=THIN)
    axis.scatter((hard["t_begin"] - begin) / unit, hard["pair"] + 0.22, marker="|", s=60, color=HARD, label="hard")
    _tell_of_later(axis, report, end, (end - begin) / unit)
    axis.set(ylim=(-0.6, n - 0.3), yticks=range(n) if n <= 12 else np.linspace(0, n - 1, 6).astype(int),
             ylabel="contacts\nof pair")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)


def _tell_of_later(axis: Any, report: Compared, end: float, right: float) -> None:
    """Say how many contacts come after the end of the axis, and mark their pairs."""
    later = [run.contacts[run.contacts["t_begin"] > end] for run in report.counted]
    pairs, count = np.unique(np.concatenate([log["pair"] for log in later])), sum(map(len, later))
    if not count:
        return
    last = max(float(log["t_begin"].max(initial=end)) for log in later)
    unit, name = unit_of(last, "s")
    axis.plot(np.full(len(pairs), right), pairs, ls="", marker=">", ms=5, color=SOFT, clip_on=False)
    axis.set_title(f"{count} later contact{'s' * (count > 1)}, the last at t = {last / unit:.4g} {name} ▸", fontsize=8,
                   loc="right")  # fmt: skip


def _force_curve(axis: Any, clock: Array, soft: Trajectory, c: int) -> None:
    assert soft.force is not None
    unit, name = unit_of(float(soft.force[:, c].max(initial=0.0)) or 2.0, "N", OF_FORCE)
    axis.fill_between(clock, soft.force[:, c] / unit, color=SOFT, alpha=0.25, lw=0)
    axis.plot(clock, soft.force[:, c] / unit, color=SOFT, lw=1.0)
    axis.set_ylim(bottom=0.0)
    lower, upper = soft.scene.bodies(c)
    axis.set_ylabel(f"$F_{{{lower},{upper}}}$, {name}")


def _largest_forces(report: Compared, soft: Trajectory, begin: float, end: float) -> Array:
    """Largest force in N in each column of a map and on each pair: from samples, and from the log of short contacts."""
    assert soft.force is not None
    largest = np.zeros((COLUMNS, report.scene.n_pairs))

    def columns(times: Array) -> Any:
        return np.clip(((times - begin) * (COLUMNS / (end - begin))).astype(int), 0, COLUMNS - 1)

    np.maximum.at(largest, columns(soft.time), soft.force)
    log = report.counted[1].contacts
    log = log[log["duration"] * COLUMNS < end - begin]
    np.maximum.at(largest, (columns(log["t_begin"]), log["pair"]), log["force_max"])
    return largest


def _force_map(figure: Any, axis: Any, largest: Array, span: float) -> None:
    peak, n = float(largest.max()), largest.shape[1]
    unit, name = unit_of(peak or 2.0, "N", OF_FORCE)
    image = axis.imshow(
        largest.T / unit, origin="lower", aspect="auto", cmap="Blues", interpolation="nearest",
        extent=(0.0, span, -0.5, n - 0.5), vmin=0.0, vmax=peak / unit or 1.0,
    )  # fmt: skip
    figure.colorbar(image, ax=axis, label=f"force, {name}", pad=0.01)
    axis.set_ylabel("pair")


def _world_lines(axis: Any, report: Compared, soft: Trajectory, begin: float, end: float, unit: float) -> None:
    """Positions with the radii taken out, so that lines meet where balls touch and cross where they overlap."""
    runs = {"soft": (soft, SOFT, "-")}
    if len(report.hard.contacts) < 100_000:
        runs["hard"] = (resolved(report, "hard", _moments(report, begin, end)), HARD, "--")
    lines = {label: (run.time, points(run), colour, dash) for label, (run, colour, dash) in runs.items()}
    size, name = unit_of(max(float(np.ptp(lines["soft"][1])), 1e-300), "m")
    for label, (t, height, colour, dash) in lines.items():
        axis.plot((t - begin) / unit, height / size, color=colour, ls=dash, lw=1.0)
        axis.plot([], [], color=colour, ls=dash, label=label)
    low, high = lines["soft"][1].min() / size, lines["soft"][1].max() / size
    bottom, top = axis.get_ylim()
    room = 0.5 * (high - low)  # for hard balls; faster ones may leave the picture
    axis.set(ylim=(max(bottom, low - room), min(top, high + room)), ylabel=f"position, radii taken out, {name}")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)


