"""Data of the figures and films of a comparison.

The time interval to draw, both runs with enough samples, an enlarged view of one pair while contacts overlap in time,
and the texts for the scene: pairs, parameters, and numbers with units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, UNIT_PREFIXES, shortened, unit_of
from granular.laws.kinds import resolved
from granular.md.isolation import Durations
from granular.run.figures import CONTACTS_MARGIN, FAR_SPAN_LENGTHS, Span
from granular.run.trajectory import Status, Trajectory

if TYPE_CHECKING:
    from granular.comparison.answer import Judged

# late contacts with up to this share of the impulse may be left out, and are told of at the axis' edge
NEGLIGIBLE_IMPULSE_SHARE = 0.01
MAX_PAIRS_FOR_CLOSEUP = 20  # with more pairs than these, contacts somewhere else would always be found to last
MAX_CLOSEUP_SHARE = 0.6  # a lens that would show this share of the time axis has the same one
MAX_NUMBERED_TOUCHES = 12  # so many touches are numbered, and hops measured
MIN_LABEL_DISTANCE = 0.05  # share of the width that two numbers stand apart at least
EQUAL_NUMBER_TOLERANCE = 1e-9
"""Relative difference below which two numbers are equal."""
SUPERSCRIPT_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MASS_PREFIXES = ((1e3, "k"), *UNIT_PREFIXES)
"""Multiples of the gram."""


@dataclass(frozen=True)
class View(Span):
    """A comparison over a time interval."""

    report: Judged

    @cached_property
    def moments(self) -> Array:
        """Times in s to draw: evenly spaced, and within each soft contact.

        For more than 500 contacts, evenly chosen contacts are used.
        """
        log = self.report.counted[1].contacts
        log = log[:: max(1, len(log) // 500)]
        return self.times(np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=self.end)]), 1500)


def window(report: Judged) -> View:
    """Return the interval to draw: from the first to the last contact, with a margin.

    A few late contacts of negligible impulse are left out if the others would fill less than a third of the interval.
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
    while (
        len(bulk := ends[3.0 * (ends - first) < last - first])
        and share[ends > bulk.max()].sum() <= NEGLIGIBLE_IMPULSE_SHARE
    ):
        last = float(bulk.max())
    margin = CONTACTS_MARGIN * (last - first) or 1e-3 * abs(first) or 1.0
    begin, end = max(first - margin, start), last + margin
    if report.hard.status is report.soft.status is Status.time:
        end = min(end, max(last, float(report.soft.time[-1])))
    return View(begin, end, first if first > FAR_SPAN_LENGTHS * (end - begin) else 0.0, report)


@dataclass(frozen=True)
class Closeup:
    """One pair of balls in a short time interval.

    Attributes
    ----------
    pair : int
        Pair of balls whose soft spheres touch most often while a neighbouring contact lasts, the upper one of equals.
    view : View
        Interval of the contacts that overlap in time, with a margin.
    touches : (count, 2) array
        Onset and end in s of the soft contacts in it.
    """

    pair: int
    view: View
    touches: Array

    @property
    def moments(self) -> Array:
        """Times in s to draw."""
        return self.view.times(self.touches, 800)

    def path(self, run: Trajectory) -> tuple[Array, Array]:
        """Times in s within the interval, and the distances in m of the pair."""
        inside = (run.time >= self.view.begin) & (run.time <= self.view.end)
        return run.time[inside], run.gap[inside, self.pair]

    def hops(self, soft: Trajectory) -> list[tuple[float, float]]:
        """Time in s and height in m of the highest point between consecutive contacts."""
        time, gap = self.path(soft)
        found = []
        for end, begin in zip(self.touches[:-1, 1], self.touches[1:, 0], strict=True):
            inside = np.flatnonzero((time > end) & (time < begin))
            if len(inside) and gap[top := inside[gap[inside].argmax()]] > 0.0:
                found.append((float(time[top]), float(gap[top])))
        return found


def closeup(view: View) -> Closeup | None:
    """Return the enlarged view, or None if no neighbouring contacts overlap in time."""
    report, end = view.report, view.end
    scene, log = report.scene, report.counted[1].contacts
    between = ~np.logical_or(*scene.sides(scene.is_wall))
    shared = np.zeros(len(log), bool)
    shared[[row for overlap in report.overlaps for row in (overlap.lower, overlap.upper)]] = True
    shared &= log["t_begin"] <= end
    if not shared.any() or scene.n_pairs > MAX_PAIRS_FOR_CLOSEUP:
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
    if last - first > MAX_CLOSEUP_SHARE * (end - view.begin):
        return Closeup(pair, view, touches)
    margin = CONTACTS_MARGIN * (last - first)
    return Closeup(pair, View(max(first - margin, view.begin), min(last + margin, end), first, report), touches)


def draw_closeup(axis: Any, look: Closeup, runs: Mapping[str, Trajectory]) -> None:
    """Draw the distance of a pair over time, with numbered contacts.

    The scale shows every separation between contacts, which are labelled with their heights.
    """
    view, (time, gap), hops = look.view, look.path(runs["soft"]), look.hops(runs["soft"])
    depth = -float(gap.min(initial=0.0))
    to_see = max(0.4 * depth, 0.1 * float(gap[:1].max(initial=0.0)), 1e-15)  # overlap or approach, without hops
    height = max((hop for _, hop in hops), default=to_see)
    bottom = 1.2 * min(depth, 2.0 * height if hops else depth)
    unit, name = unit_of(1.3 * height, "m")
    axis.axhline(0.0, color=GREY_COLOUR, lw=0.6)
    for label, run in runs.items():
        colour, dash = {"soft": (SOFT_COLOUR, "-"), "hard": (HARD_COLOUR, "--")}[label]
        t, y = look.path(run)
        axis.plot(view.clock(t), y / unit, color=colour, ls=dash, lw=1.2)
    axis.fill_between(view.clock(time), np.minimum(gap, 0.0) / unit, color=SOFT_COLOUR, alpha=0.25, lw=0)
    axis.set(xlim=view.limits, ylim=(-bottom / unit, (1.45 * height + 0.2 * bottom) / unit),
             xlabel=view.named, ylabel=f"distance of\n{view.report.scene.pairs.name(look.pair)}, {name}")
    least = MIN_LABEL_DISTANCE * (view.shown[1] - view.shown[0])
    for i, x in apart(view.clock(look.touches[:MAX_NUMBERED_TOUCHES].mean(axis=1)), least):
        axis.annotate(
            str(i + 1),
            (x, 0.965),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            color=SOFT_COLOUR,
            fontsize=8,
            bbox={"boxstyle": "circle,pad=0.2", "fc": "white", "ec": SOFT_COLOUR, "lw": 0.6},
        )
    for i, x in apart(view.clock(np.array([t for t, _ in hops[:MAX_NUMBERED_TOUCHES]])), 1.8 * least):
        size, of = unit_of(hops[i][1], "m", 1.0)
        axis.annotate(f"{float(f'{hops[i][1] / size:.2g}'):g} {of}", (x, hops[i][1] / unit), (0, 2),
                      textcoords="offset points", ha="center", va="bottom", color=SOFT_COLOUR, fontsize=8)


def apart(places: Array, least: float) -> list[tuple[int, float]]:
    """Return the places, with their numbers, at least `least` from the last one kept."""
    kept: list[tuple[int, float]] = []
    for i, place in enumerate(np.asarray(places).tolist()):
        if not kept or place - kept[-1][1] >= least:
            kept.append((i, place))
    return kept


def parameters(report: Judged) -> str:
    """Return two lines with the parameters of a comparison: the scene, and the laws."""
    return f"{_scene(report)}\n{_laws(report)}"


def _scene(report: Judged) -> str:
    scene, balls = report.scene, ~report.scene.is_wall
    inner = scene.gap[~np.logical_or(*scene.sides(scene.is_wall))]
    ratio = report.groups["mass_ratio"]
    return ", ".join(
        [
            f"{balls.sum()} balls" if balls.sum() > 1 else "1 ball",
            *["on a ring"] * scene.ring,
            *[f"pendula of Ω = {number(scene.pendulum)} rad/s"] * (scene.pendulum > 0.0),
            f"m = {_span(1e3 * scene.mass[balls], 'g', MASS_PREFIXES)}"
            + f" ({number(ratio)} : 1)" * (ratio > 1.0 + EQUAL_NUMBER_TOLERANCE),
            *[f"gap {_span(inner, 'm')}" if inner.any() else "touching"] * bool(len(inner)),
            *[f"first impact at {number(report.impact_speed)} m/s"] * (report.impact_speed > 0.0),
            *[f"g = {number(scene.gravity)} m/s²"] * (scene.gravity > 0.0),
            *(shortened(repr(wall)) for wall in (scene.floor, scene.ceiling) if wall is not None),
        ]
    )


def _laws(report: Judged) -> str:
    """Law, constants, ε and t_c at the speed of the first impact, with ranges."""
    kinds = list(dict.fromkeys(type(law).__name__ for law in report.law))
    numbers = {name: np.array([getattr(law, name) for law in report.law])
               for name in (_constants(report.law) if len(kinds) == 1 else ())}
    soft, hard = (np.array(eps) for eps in (report.law_restitution, report.restitution_spec))
    lasts = _durations(report)
    return ", ".join([
        " and ".join(kinds),
        *(f"{name} = {_span(of)}{_stiffness(report) if name == 'k' else ''}" for name, of in numbers.items()),
        f"ε = {_span(soft)}" + f" (hard spheres {_span(hard)})" * bool((np.abs(soft - hard) > 1e-6).any()),
        *[f"a contact alone lasts {_span(lasts, 's', digits=3)}"] * bool(np.isfinite(lasts).any()),
    ])


def _stiffness(report: Judged) -> str:
    """Return the unit of k in F = k ξ^p, or an empty string for other laws."""
    form = resolved(report.law, report.scene)[0].form
    return "" if form is None else " N/m" if form[1] == 1.0 else f" N/m$^{{{form[1]:g}}}$"


def _constants(laws: Sequence[Any]) -> list[str]:
    """Constants of a law except for its damping, which ε describes."""
    named = [field.name for field in fields(laws[0])] if is_dataclass(laws[0]) else []
    return [name for name in named if name not in ("gamma", "alpha") and isinstance(getattr(laws[0], name), float)]


def _durations(report: Judged) -> Any:
    """Isolated duration in s of each pair at the first impact speed, inf without end."""
    n = report.scene.n_pairs
    return Durations(report.law, report.scene)(np.arange(n), np.full(n, report._speed))


def _span(values: Any, unit: str = "", prefixes: Any = UNIT_PREFIXES, digits: int = 4) -> str:
    """Format finite values with a unit: one number, "a and b", or "low … high"."""
    known = values[np.isfinite(values)]
    if not len(known):
        return "–"
    low, high = float(known.min()), float(known.max())
    if high - low <= EQUAL_NUMBER_TOLERANCE * abs(high):
        return _one(high, unit, prefixes, digits)
    between = " and " if len(values) == 2 else " … "
    ends = (float(known[0]), float(known[-1])) if len(values) == 2 else (low, high)
    return between.join(_one(value, unit, prefixes, digits) for value in ends)


def _one(value: float, unit: str, prefixes: Any, digits: int) -> str:
    if not unit or value == 0.0:
        return f"{number(value, digits)} {unit}".strip()
    scale, name = unit_of(abs(value), unit, 1.0, prefixes)
    return f"{number(value / scale, digits)} {name}"


def number(value: float, digits: int = 4) -> str:
    """Return a number with `digits` digits and a power of ten in superscripts."""
    factor, _, power = f"{value:.{digits}g}".partition("e")
    if not power:
        return factor
    return f"{factor}·" * (factor != "1") + f"10{str(int(power)).translate(SUPERSCRIPT_DIGITS)}"
