"""Data of the figures and films of a comparison.

This module selects the time interval to draw and the samples that it needs. It draws the enlarged view of one pair
during contacts that overlap in time, and formats the parameters of the scene with units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, UNIT_PREFIXES, short_text, unit_of
from granular.laws.kinds import resolved
from granular.md.isolation import Durations
from granular.run.figures import CONTACTS_MARGIN, FAR_SPAN_LENGTHS, Span
from granular.run.trajectory import Status, Trajectory

if TYPE_CHECKING:
    from granular.comparison.answer import ComparisonWithAnswer

# late contacts can be left out up to this fraction of the impulse; a note at the edge of the axis counts them
NEGLIGIBLE_IMPULSE_FRACTION = 0.01
MAX_PAIRS_FOR_CLOSEUP = 20  # with more pairs, some distant contact would nearly always last
MAX_CLOSEUP_FRACTION = 0.6  # an enlarged view of more than this fraction shows the whole time axis
MAX_NUMBERED_TOUCHES = 12  # number of contacts that are numbered, and of separations that are labelled
MIN_LABEL_DISTANCE = 0.05  # smallest distance of two labels, as a fraction of the width
EQUAL_NUMBER_TOLERANCE = 1e-9
"""Relative difference below which two numbers are equal."""
SUPERSCRIPT_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
PLAIN_DIGITS = {power: digit for digit, power in SUPERSCRIPT_DIGITS.items()}
SUPERSCRIPTS = re.compile(f"[{''.join(map(chr, PLAIN_DIGITS))}]+")
MASS_PREFIXES = ((1e3, "k"), *UNIT_PREFIXES)
"""Multiples of the gram."""


@dataclass(frozen=True)
class View(Span):
    """A comparison over a time interval."""

    report: ComparisonWithAnswer

    @cached_property
    def moments(self) -> Array:
        """Times in s to draw: evenly spaced in the interval and within each soft contact.

        If there are more than 500 contacts, every k-th contact is used.
        """
        log = self.report.counted[1].contacts
        log = log[:: max(1, len(log) // 500)]
        return self.times(np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=self.end)]), 1500)


def window(report: ComparisonWithAnswer) -> View:
    """Return the interval to draw: from the first to the last contact, with a margin.

    Late contacts are left out if they have a negligible part of the impulse, and if the remaining contacts would
    otherwise fill less than a third of the interval.
    """
    start = float(report.soft.time[0])
    runs = report.continued
    if not any(len(run.contacts) for run in report.counted):
        end = float(report.soft.time[-1])
        return View(start, end if end > start else start + 1.0, 0.0, report)
    impulse_part = np.concatenate(
        [run.contacts["impulse"] / (float(run.contacts["impulse"].sum()) or 1.0) for run in runs])
    ends = np.concatenate([np.where(np.isnan(log["t_end"]), np.maximum(log["t_begin"], time), log["t_end"])
                           for log, time in ((run.contacts, float(run.time[-1])) for run in runs)])
    first = float(min(run.contacts["t_begin"].min(initial=math.inf) for run in report.counted))
    last = float(ends.max())
    while (
        len(main_ends := ends[3.0 * (ends - first) < last - first])
        and impulse_part[ends > main_ends.max()].sum() <= NEGLIGIBLE_IMPULSE_FRACTION
    ):
        last = float(main_ends.max())
    margin = CONTACTS_MARGIN * (last - first) or 1e-3 * abs(first) or 1.0
    begin, end = max(first - margin, start), last + margin
    if report.hard.status is report.soft.status is Status.time:
        end = min(end, max(last, float(report.soft.time[-1])))
    return View(begin, end, first if first > FAR_SPAN_LENGTHS * (end - begin) else 0.0, report)


@dataclass(frozen=True)
class Closeup:
    """One pair of balls in a short time interval, for the enlarged view.

    Attributes
    ----------
    pair : int
        Pair of balls whose soft spheres touch most often while contacts overlap in time. Among pairs with equally many
        contacts it is the upper one.
    view : View
        Interval of the contacts that overlap in time, with a margin.
    touches : (count, 2) array
        Onset and end in s of the soft contacts of the pair in this interval.
    """

    pair: int
    view: View
    touches: Array

    @property
    def moments(self) -> Array:
        """Times in s to draw."""
        return self.view.times(self.touches, 800)

    def path(self, run: Trajectory) -> tuple[Array, Array]:
        """Times in s of the samples within the interval, and gaps in m of the pair."""
        inside = (run.time >= self.view.begin) & (run.time <= self.view.end)
        return run.time[inside], run.gap[inside, self.pair]

    def hops(self, soft: Trajectory) -> list[tuple[float, float]]:
        """Time in s and gap in m of the largest separation between consecutive contacts."""
        time, gap = self.path(soft)
        result = []
        for end, begin in zip(self.touches[:-1, 1], self.touches[1:, 0], strict=True):
            inside = np.flatnonzero((time > end) & (time < begin))
            if len(inside) and gap[top := inside[gap[inside].argmax()]] > 0.0:
                result.append((float(time[top]), float(gap[top])))
        return result


def closeup(view: View) -> Closeup | None:
    """Return the enlarged view, or None if no contacts of neighbouring pairs overlap.

    None is also returned for more than `MAX_PAIRS_FOR_CLOSEUP` pairs.
    """
    report, end = view.report, view.end
    scene, log = report.scene, report.counted[1].contacts
    is_ball_pair = ~np.logical_or(*scene.sides(scene.is_wall))
    overlaps_in_time = np.zeros(len(log), bool)
    overlaps_in_time[[row for overlap in report.overlaps for row in (overlap.lower, overlap.upper)]] = True
    overlaps_in_time &= log["t_begin"] <= end
    if not overlaps_in_time.any() or scene.n_pairs > MAX_PAIRS_FOR_CLOSEUP:
        return None
    onset, end_times = log["t_begin"], np.nan_to_num(log["t_end"], nan=end)
    group = np.cumsum(np.append(True, onset[1:] > np.maximum.accumulate(end_times)[:-1]))
    is_candidate = is_ball_pair[log["pair"]] & np.isin(group, group[overlaps_in_time])
    if not is_candidate.any():
        return None
    (groups, pairs), count = np.unique(np.array([group, log["pair"]])[:, is_candidate], axis=1, return_counts=True)
    best = np.lexsort((-groups, pairs, count))[-1]  # most touches; among equals the upper pair, at its first occurrence
    pair, inside = int(pairs[best]), group == groups[best]
    touches = np.column_stack([onset, end_times])[inside & (log["pair"] == pair)]
    first, last = float(onset[inside].min()), float(min(end_times[inside].max(), end))
    if last - first > MAX_CLOSEUP_FRACTION * (end - view.begin):
        return Closeup(pair, view, touches)
    margin = CONTACTS_MARGIN * (last - first)
    return Closeup(pair, View(max(first - margin, view.begin), min(last + margin, end), first, report), touches)


def draw_closeup(axis: Any, detail: Closeup, runs: Mapping[str, Trajectory]) -> None:
    """Draw the gap of a pair over time, with numbered contacts.

    The scale shows each separation between contacts, labelled with the largest gap.

    Parameters
    ----------
    runs : mapping of str to Trajectory
        The runs "soft" and "hard", with samples in the interval.
    """
    view, (time, gap), hops = detail.view, detail.path(runs["soft"]), detail.hops(runs["soft"])
    depth = -float(gap.min(initial=0.0))
    visible_depth = max(0.4 * depth, 0.1 * float(gap[:1].max(initial=0.0)), 1e-15)  # overlap or approach, without hops
    height = max((hop for _, hop in hops), default=visible_depth)
    bottom = 1.2 * min(depth, 2.0 * height if hops else depth)
    unit, name = unit_of(1.3 * height, "m")
    axis.axhline(0.0, color=GREY_COLOUR, lw=0.6)
    for label, run in runs.items():
        colour, dash = {"soft": (SOFT_COLOUR, "-"), "hard": (HARD_COLOUR, "--")}[label]
        t, y = detail.path(run)
        axis.plot(view.clock(t), y / unit, color=colour, ls=dash, lw=1.2)
    axis.fill_between(view.clock(time), np.minimum(gap, 0.0) / unit, color=SOFT_COLOUR, alpha=0.25, lw=0)
    axis.set(xlim=view.limits, ylim=(-bottom / unit, (1.45 * height + 0.2 * bottom) / unit),
             xlabel=view.named, ylabel=f"gap of\n{view.report.scene.pairs.name(detail.pair)} ({name})")
    least = MIN_LABEL_DISTANCE * (view.shown[1] - view.shown[0])
    for i, x in well_separated(view.clock(detail.touches[:MAX_NUMBERED_TOUCHES].mean(axis=1)), least):
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
    for i, x in well_separated(view.clock(np.array([t for t, _ in hops[:MAX_NUMBERED_TOUCHES]])), 1.8 * least):
        size, unit_name = unit_of(hops[i][1], "m", 1.0)
        axis.annotate(f"{float(f'{hops[i][1] / size:.2g}'):g} {unit_name}", (x, hops[i][1] / unit), (0, 2),
                      textcoords="offset points", ha="center", va="bottom", color=SOFT_COLOUR, fontsize=8)


def well_separated(places: Array, least: float) -> list[tuple[int, float]]:
    """Indices and values of places that keep at least the distance `least`.

    Places are in ascending order. A place too close to the last one that was kept is left out.
    """
    kept: list[tuple[int, float]] = []
    for i, place in enumerate(np.asarray(places).tolist()):
        if not kept or place - kept[-1][1] >= least:
            kept.append((i, place))
    return kept


def parameters(report: ComparisonWithAnswer) -> str:
    """Return two lines with the parameters of a comparison: the scene, and the laws."""
    return f"{_scene_text(report)}\n{_laws_text(report)}"


def _scene_text(report: ComparisonWithAnswer) -> str:
    """Return balls, masses, gaps, speeds and walls of a scene as a string."""
    scene, balls = report.scene, ~report.scene.is_wall
    inner = scene.gap[~np.logical_or(*scene.sides(scene.is_wall))]
    ratio = report.groups["mass_ratio"]
    return ", ".join(
        [
            f"{balls.sum()} balls" if balls.sum() > 1 else "1 ball",
            *["on a ring"] * scene.ring,
            *[f"pendula of Ω = {number(scene.pendulum)} rad/s"] * (scene.pendulum > 0.0),
            f"m = {_range_text(1e3 * scene.mass[balls], 'g', MASS_PREFIXES)}"
            + f" ({number(ratio)} : 1)" * (ratio > 1.0 + EQUAL_NUMBER_TOLERANCE),
            *[f"gap {_range_text(inner, 'm')}" if inner.any() else "touching"] * bool(len(inner)),
            *[f"first impact at {number(report.impact_speed)} m/s"] * (report.impact_speed > 0.0),
            *[f"g = {number(scene.gravity)} m/s²"] * (scene.gravity > 0.0),
            *["constant forces"] * (scene.external_force is not None),
            *(f"{name} {short_text(repr(wall))}" for name, wall in (("floor", scene.floor), ("ceiling", scene.ceiling))
              if wall is not None),
        ]
    )


def _laws_text(report: ComparisonWithAnswer) -> str:
    """Text with the laws, their constants, ε and the isolated duration.

    ε and the duration are those at the speed of the first impact. If pairs differ, the range of each number is shown.
    """
    kinds = list(dict.fromkeys(type(law).__name__ for law in report.law))
    numbers = {name: np.array([getattr(law, name) for law in report.law])
               for name in (_constant_names(report.law) if len(kinds) == 1 else ())}
    soft, hard = (np.array(eps) for eps in (report.law_restitution, report.restitution_spec))
    durations = _isolated_durations(report)
    text = ", ".join([
        " and ".join(kinds),
        *(f"{name} = {_range_text(x)}{_stiffness_unit(report) if name == 'k' else ''}" for name, x in numbers.items()),
        f"ε = {_range_text(soft)}" + f" (hard spheres {_range_text(hard)})" * bool((np.abs(soft - hard) > 1e-6).any()),
        *[f"an isolated contact lasts {_range_text(durations, 's', digits=3)}"] * bool(np.isfinite(durations).any()),
    ])
    # matplotlib draws a text with a "$" in fonts without the superscripts 4 to 9
    return text if "$" not in text else SUPERSCRIPTS.sub(
        lambda power: f"$^{{{power[0].translate(PLAIN_DIGITS)}}}$", text)


def _stiffness_unit(report: ComparisonWithAnswer) -> str:
    """Return the unit of k in F = k ξ^p, or an empty string for other laws."""
    form = resolved(report.law, report.scene)[0].form
    return "" if form is None else " N/m" if form[1] == 1.0 else f" N/m$^{{{form[1]:g}}}$"


def _constant_names(laws: Sequence[Any]) -> list[str]:
    """Names of the constants of a law. Its damping is left out because ε describes it."""
    named = [field.name for field in fields(laws[0])] if is_dataclass(laws[0]) else []
    return [name for name in named if name not in ("gamma", "alpha") and isinstance(getattr(laws[0], name), float)]


def _isolated_durations(report: ComparisonWithAnswer) -> Any:
    """Isolated duration in s of each pair at the first impact speed, inf without end."""
    n = report.scene.n_pairs
    return Durations(report.law, report.scene)(np.arange(n), np.full(n, report._speed))


def _range_text(values: Any, unit: str = "", prefixes: Any = UNIT_PREFIXES, digits: int = 4) -> str:
    """Format finite values with a unit: one number, "a and b", or "low … high"."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "–"
    low, high = float(finite.min()), float(finite.max())
    if high - low <= EQUAL_NUMBER_TOLERANCE * abs(high):
        return _value_with_unit(high, unit, prefixes, digits)
    between = " and " if len(values) == 2 else " … "
    ends = (float(finite[0]), float(finite[-1])) if len(values) == 2 else (low, high)
    return between.join(dict.fromkeys(_value_with_unit(value, unit, prefixes, digits) for value in ends))


def _value_with_unit(value: float, unit: str, prefixes: Any, digits: int) -> str:
    if not unit or value == 0.0:
        return f"{number(value, digits)} {unit}".strip()
    scale, name = unit_of(abs(value), unit, 1.0, prefixes)
    return f"{number(value / scale, digits)} {name}"


def number(value: float, digits: int = 4) -> str:
    """Format a number with `digits` digits and a power of ten in superscripts."""
    factor, _, power = f"{value:.{digits}g}".partition("e")
    if not power:
        return factor
    return f"{factor}·" * (factor != "1") + f"10{str(int(power)).translate(SUPERSCRIPT_DIGITS)}"
