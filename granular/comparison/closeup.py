"""A lens on one pair of a comparison: the distance of its balls, on its own scale, while contacts overlap in time.
May be skipped: pictures, no physics.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._check import Array
from granular._drawing import GREY, HARD, SOFT
from granular._tables import unit_of
from granular.comparison.caption import pair_name
from granular.comparison.view import View
from granular.trajectory import Trajectory

MOST = 20  # with more pairs than these, contacts somewhere else would always be found to last
MUCH = 0.6  # a lens that would show this share of the time axis has the same one
NUMBERED = 12  # so many touches are numbered, and hops measured
ROOM = 0.05  # share of the width that two numbers stand apart at least


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
    places, found = np.unique(np.array([-spell, log["pair"]])[:, looked_at], axis=1, return_counts=True)
    minus_spell, pair = max(zip(found.tolist(), places[1].tolist(), places[0].tolist(), strict=True))[:0:-1]
    inside = spell == -minus_spell
    mine = inside & (log["pair"] == pair)
    touches = np.column_stack([onset, until])[mine]
    first, last = float(onset[inside].min()), float(min(until[inside].max(), end))
    if last - first > MUCH * (end - view.begin):
        return Closeup(pair, view, touches)
    margin = 0.06 * (last - first)
    return Closeup(pair, View(report, max(first - margin, view.begin), min(last + margin, end), first), touches)


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
    for number, x in apart(view.clock(look.touches[:NUMBERED].mean(axis=1)), least):
        axis.annotate(str(number + 1), (x, 0.965), xycoords=("data", "axes fraction"), ha="center", va="top",
                      color=SOFT, fontsize=8, bbox={"boxstyle": "circle,pad=0.2", "fc": "white", "ec": SOFT, "lw": 0.6})
    for number, x in apart(view.clock(np.array([t for t, _ in hops[:NUMBERED]])), 1.8 * least):
        size, of = unit_of(hops[number][1], "m", 1.0)
        axis.annotate(f"{float(f'{hops[number][1] / size:.2g}'):g} {of}", (x, hops[number][1] / unit), (0, 2),
                      textcoords="offset points", ha="center", va="bottom", color=SOFT, fontsize=8)


def apart(places: Array, least: float) -> list[tuple[int, float]]:
    """Those places, with their numbers, that are at least so far from the last one kept."""
    kept: list[tuple[int, float]] = []
    for number, place in enumerate(np.asarray(places).tolist()):
        if not kept or place - kept[-1][1] >= least:
            kept.append((number, place))
    return kept
