"""What is drawn of a comparison: which span of time, both runs again with enough rows, a lens on one pair, the
distance of its balls on its own scale while contacts overlap in time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import GREY, HARD, SOFT, unit_of
from granular.comparison.captions import pair_name
from granular.run.figures import FAR, MARGIN, Span
from granular.run.trajectory import Status, Trajectory

if TYPE_CHECKING:
    from granular.comparison.answer import Judged

LONE = 0.01  # late contacts with up to this share of the impulse may be left out, and are told of at the axis' edge
MOST = 20  # with more pairs than these, contacts somewhere else would always be found to last
MUCH = 0.6  # a lens that would show this share of the time axis has the same one
NUMBERED = 12  # so many touches are numbered, and hops measured
ROOM = 0.05  # share of the width that two numbers stand apart at least


@dataclass(frozen=True)
class View(Span):
    """A comparison over a span of time."""

    report: Judged

    @cached_property
    def moments(self) -> Array:
        """Times in s to draw at: evenly spread, and within each soft contact (of very many, evenly chosen ones)."""
        log = self.report.counted[1].contacts
        log = log[:: max(1, len(log) // 500)]
        return self.times(np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=self.end)]), 1500)


def window(report: Judged) -> View:
    """The span of time worth drawing: from the first contact that counts to the end of the last, with a margin.

    A few late contacts of next to no impulse are left out if the others would fill less than a third of the span.
    """
    start = float(report.soft.time[0])
    runs = report.levelled
    if not any(len(run.contacts) for run in report.counted):
        return View(start, max(float(report.soft.time[-1]), start + 1.0), 0.0, report)
    share = np.concatenate([run.contacts["impulse"] / (float(run.contacts["impulse"].sum()) or 1.0) for run in runs])
    ends = np.concatenate([np.where(np.isnan(log["t_end"]), np.maximum(log["t_begin"], time), log["t_end"])
                           for log, time in ((run.contacts, float(run.time[-1])) for run in runs)])
    first = float(min(run.contacts["t_begin"].min(initial=math.inf) for run in report.counted))
    last = float(ends.max())
    while len(bulk := ends[3.0 * (ends - first) < last - first]) and share[ends > bulk.max()].sum() <= LONE:
        last = float(bulk.max())
    margin = MARGIN * (last - first) or 1e-3 * abs(first) or 1.0
    begin, end = max(first - margin, start), last + margin
    if report.hard.status is report.soft.status is Status.time:
        end = min(end, max(last, float(report.soft.time[-1])))
    return View(begin, end, first if first > FAR * (end - begin) else 0.0, report)


@dataclass(frozen=True)
class Closeup:
    """One pair, and the span of time in which it is looked at.

    Attributes
    ----------
    pair : int
        The pair of balls that soft spheres make touch most often while a neighbouring contact lasts, the upper of
        equals.
    view : View
        The spell of contacts that overlap in time, with a margin.
    touches : (count, 2) array
        Onset and end in s of the soft contacts in it.
    """

    pair: int
    view: View
    touches: Array

    @property
    def moments(self) -> Array:
        """Times in s to draw at."""
        return self.view.times(self.touches, 800)

    def path(self, run: Trajectory) -> tuple[Array, Array]:
        """Times in s within the span, and the distances in m of the pair."""
        inside = (run.time >= self.view.begin) & (run.time <= self.view.end)
        return run.time[inside], run.gap[inside, self.pair]

    def hops(self, soft: Trajectory) -> list[tuple[float, float]]:
        """Time in s and height in m of the highest point between one contact and the next."""
        time, gap = self.path(soft)
        found = []
        for end, begin in zip(self.touches[:-1, 1], self.touches[1:, 0], strict=True):
            inside = np.flatnonzero((time > end) & (time < begin))
            if len(inside) and gap[top := inside[gap[inside].argmax()]] > 0.0:
                found.append((float(time[top]), float(gap[top])))
        return found


def closeup(view: View) -> Closeup | None:
    """What is worth a lens of what is drawn; None where no contacts of neighbouring pairs overlap in time."""
    report, end = view.report, view.end
    scene, log = report.scene, report.counted[1].contacts
    between = ~np.logical_or(*scene.sides(scene.is_wall))
    shared = np.zeros(len(log), bool)
    shared[[row for overlap in report.overlaps for row in (overlap.lower, overlap.upper)]] = True
    shared &= log["t_begin"] <= end
    if not shared.any() or scene.n_pairs > MOST:
        return None
    onset, until = log["t_begin"], np.nan_to_num(log["t_end"], nan=end)
    spell = np.cumsum(np.append(True, onset[1:] > np.maximum.accumulate(until)[:-1]))
    looked_at = between[log["pair"]] & np.isin(spell, spell[shared])
    if not looked_at.any():
        return None
    (spells, pairs), count = np.unique(np.array([spell, log["pair"]])[:, looked_at], axis=1, return_counts=True)
    best = np.lexsort((-spells, pairs, count))[-1]  # most touches; of equals the upper pair, in its first spell
    pair, inside = int(pairs[best]), spell == spells[best]
    touches = np.column_stack([onset, until])[inside & (log["pair"] == pair)]
    first, last = float(onset[inside].min()), float(min(until[inside].max(), end))
    if last - first > MUCH * (end - view.begin):
        return Closeup(pair, view, touches)
    margin = MARGIN * (last - first)
    return Closeup(pair, View(max(first - margin, view.begin), min(last + margin, end), first, report), touches)


def draw_closeup(axis: Any, look: Closeup, runs: Mapping[str, Trajectory]) -> None:
    """Distances over time, drawn so large that every hop can be seen; touches are numbered, hops measured."""
    view, (time, gap), hops = look.view, look.path(runs["soft"]), look.hops(runs["soft"])
    depth = -float(gap.min(initial=0.0))
    to_see = max(0.4 * depth, 0.1 * float(gap[:1].max(initial=0.0)), 1e-15)  # overlap or approach, without hops
    height = max((hop for _, hop in hops), default=to_see)
    bottom = 1.2 * min(depth, 2.0 * height if hops else depth)
    unit, name = unit_of(1.3 * height, "m")
    axis.axhline(0.0, color=GREY, lw=0.6)
    for label, run in runs.items():
        colour, dash = {"soft": (SOFT, "-"), "hard": (HARD, "--")}[label]
        t, y = look.path(run)
        axis.plot(view.clock(t), y / unit, color=colour, ls=dash, lw=1.2)
    axis.fill_between(view.clock(time), np.minimum(gap, 0.0) / unit, color=SOFT, alpha=0.25, lw=0)
    axis.set(xlim=view.limits, ylim=(-bottom / unit, (1.45 * height + 0.2 * bottom) / unit),
             xlabel=view.named, ylabel=f"distance of\n{pair_name(view.report.scene, look.pair)}, {name}")
    least = ROOM * (view.shown[1] - view.shown[0])
    for i, x in apart(view.clock(look.touches[:NUMBERED].mean(axis=1)), least):
        axis.annotate(str(i + 1), (x, 0.965), xycoords=("data", "axes fraction"), ha="center", va="top",
                      color=SOFT, fontsize=8, bbox={"boxstyle": "circle,pad=0.2", "fc": "white", "ec": SOFT, "lw": 0.6})
    for i, x in apart(view.clock(np.array([t for t, _ in hops[:NUMBERED]])), 1.8 * least):
        size, of = unit_of(hops[i][1], "m", 1.0)
        axis.annotate(f"{float(f'{hops[i][1] / size:.2g}'):g} {of}", (x, hops[i][1] / unit), (0, 2),
                      textcoords="offset points", ha="center", va="bottom", color=SOFT, fontsize=8)


def apart(places: Array, least: float) -> list[tuple[int, float]]:
    """Those places, with their numbers, that are at least so far from the last one kept."""
    kept: list[tuple[int, float]] = []
    for i, place in enumerate(np.asarray(places).tolist()):
        if not kept or place - kept[-1][1] >= least:
            kept.append((i, place))
    return kept
