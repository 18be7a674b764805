"""Figure of one run, and parts that all figures of runs share.

The shared parts are the time span and its clock, the paths of the balls between the samples of a run, and titles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from textwrap import wrap
from typing import Any

import numpy as np

from granular._engine import files
from granular._engine.check import Array
from granular._engine.reports import HARD_COLOUR, SOFT_COLOUR, add_letters, canvas, scene_text, style, unit_of
from granular.scene import Scene
from granular.scene.places import point_positions

FAR_SPAN_LENGTHS = 3.0
"""Maximum start time of a clock that starts at 0, in lengths of the run.

If the first contact begins later, the clock starts at this contact.
"""
AXIS_PAD, CONTACTS_MARGIN = 0.015, 0.06
"""Fractions of the time axis.

`AXIS_PAD` is free at both ends, so that marks are not cut. `CONTACTS_MARGIN` is shown before and after the contacts.
"""
SHORT_SPAN_RATIO = 0.2
"""Fraction of a run below which the span of its contacts gets a second panel."""
MIN_PATH_ROWS, BRIEF_CONTACT_RATIO = 100, 0.01
"""Number of samples in a span from which paths can be drawn.

With fewer samples, paths can be drawn only if each contact takes at most the fraction `BRIEF_CONTACT_RATIO` of the
span.
"""
MAX_LABELS = 12
"""Maximum number of pairs or balls that are labelled."""
MANY_CONTACTS, MAX_MARKS = 500, 2000
"""Number of contacts above which marks are small, and maximum number of marks.

With more contacts, every second, third, … contact of the log is marked.
"""
INK_COLOUR, LINE_COLOURS = "#1d1c1a", {"hard": HARD_COLOUR, "soft": SOFT_COLOUR}
SMALL_FONT: dict[str, Any] = {"fontsize": 8}


@dataclass(frozen=True)
class Span:
    """Time interval from `begin` to `end` in s, with a clock that is 0 at `zero`."""

    begin: float
    end: float
    zero: float

    @cached_property
    def unit(self) -> tuple[float, str]:
        """Unit of the clock in s, and its symbol."""
        return unit_of(self.end - self.begin, "s")

    @property
    def shown(self) -> tuple[float, float]:
        """Values of the clock at `begin` and `end`, in its unit."""
        return float(self.clock(self.begin)), float(self.clock(self.end))

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the time axis in the unit of the clock, with a margin at both ends."""
        left, right = self.shown
        return left - AXIS_PAD * (right - left), right + AXIS_PAD * (right - left)

    def clock(self, time: Any) -> Any:
        """Return the values of the clock at times in s, in its unit."""
        return (time - self.zero) / self.unit[0]

    @property
    def named(self) -> str:
        """Label of the time axis."""
        label = f"time since the first contact at t = {self.zero:.6g} s" if self.zero else "time"
        return f"{label} ({self.unit[1]})"

    def times(self, touches: Array, evenly: int) -> Array:
        """Return times in s at which paths are drawn.

        They are `evenly` equidistant times, and 17 times within each contact. `touches` contains onset and end of each
        contact in s, shape (count, 2).
        """
        within = np.linspace(touches[:, 0], touches[:, 1], 17).ravel()
        within = within[(within >= self.begin) & (within <= self.end)]
        return np.asarray(np.union1d(np.linspace(self.begin, self.end, evenly), within))


@style()
def plot(run: Any, path: str | PathLike[str] | None = None) -> Any:
    """Draw the paths of a run in one or two panels, see `Trajectory.plot`."""
    spans = spans_of(run)
    figure, panels = canvas(7.0, 0.9 + 2.6 * len(spans), len(spans))
    write_titles(figure, *run_titles(run))
    for axis, span in zip(panels[:, 0], spans, strict=True):
        draw_paths(axis, run, span)
        axis.set_xlabel(span.named)
    add_letters(panels[:, 0] if len(spans) > 1 else ())
    return files.write_figure(path, figure, dpi=200)


def run_titles(run: Any) -> tuple[str, str]:
    """Return title and subtitle of a run.

    The title contains the number of contacts and the message, and the subtitle the scene.
    """
    return f"{kind_of_spheres(run)} spheres, {len(run.contacts)} contacts: {run.message}", scene_text(run.scene)


def kind_of_spheres(run: Any) -> str:
    """Return "hard" or "soft", the kind of spheres of a run."""
    return "hard" if run.law is None else "soft"


def spans_of(run: Any) -> list[Span]:
    """Return the time spans to draw: the whole run, and the span of its contacts.

    The span of the contacts is included only if it is a small fraction of the run. Raises `ValueError` if the run has
    too few samples.
    """
    begin, end, contacts = float(run.time[0]), float(run.time[-1]), _contact_times(run)
    first, last = float(contacts.min(initial=end)), float(contacts.max(initial=begin))
    is_late = len(contacts) > 0 and first > FAR_SPAN_LENGTHS * (end - begin)
    whole_run = Span(begin, end if end > begin else begin + 1.0, first if is_late else 0.0)
    margin = CONTACTS_MARGIN * (last - first)
    around_contacts = Span(max(first - margin, begin), min(last + margin, end), first)
    is_short = 0.0 < around_contacts.end - around_contacts.begin < SHORT_SPAN_RATIO * (end - begin)
    spans = [span for span in [whole_run, around_contacts][: 1 + is_short] if _are_paths_known(run, span, contacts)]
    if not spans:
        raise ValueError(f"`run` must have more samples to draw its paths, got {len(run.time)}. Simulate with "
                         f"samples=np.linspace({begin:.6g}, {end:.6g}, 1000).")
    return spans


def _are_paths_known(run: Any, span: Span, touches: Array) -> bool:
    """Return whether samples or the contact log determine the paths in a span.

    The log suffices if contacts are short and accelerations between them are constant. `touches` contains onset and end
    of each contact in s.
    """
    is_uniform = not run.scene.driven and run.scene.pendulum == 0.0
    is_logged = len(touches) > 0 or run.stats.get("contacts", run.stats.get("events", 0)) == 0
    longest = float((touches[:, 1] - touches[:, 0]).max(initial=0.0))
    rows = np.count_nonzero((run.time >= span.begin) & (run.time <= span.end))
    return bool(rows >= MIN_PATH_ROWS or (
        is_uniform and is_logged and longest < BRIEF_CONTACT_RATIO * (span.end - span.begin)))


def _contact_times(run: Any) -> Array:
    """Return onset and end of each contact in s, shape (count, 2).

    The end of a contact that has not ended is the end of the run.
    """
    log = run.contacts
    return np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=float(run.time[-1]))])


def paths(run: Any, times: Array) -> Array:
    """Return positions in m with radii subtracted, at times in s within a run.

    The shape is (len(times), n). Accelerations are assumed to be constant between successive samples, onsets and ends
    of contacts. This is exact for hard spheres in uniform gravity.
    """
    scene, log, rows = run.scene, run.contacts, point_positions(run.scene, run.gap, run.position)
    n, count = scene.n, len(run.time)
    body = np.stack([log["pair"], (log["pair"] + 1) % n], 1)
    body = np.concatenate([np.repeat(body, 2, axis=1).ravel(), np.tile(np.arange(n), count)])
    time = np.concatenate([np.tile(np.stack([log["t_begin"], log["t_end"]], 1), 2).ravel(), np.repeat(run.time, n)])
    velocity = np.concatenate([np.stack([log["v_in"], log["v_out"]], 2).ravel(), run.velocity.ravel()])
    finite = np.flatnonzero(np.isfinite(time + velocity))
    order = finite[np.lexsort((time[finite], body[finite]))]
    starts = np.searchsorted(body[order], np.arange(n + 1))
    positions = np.empty((len(times), n))
    for i in range(n):
        entries = order[starts[i] : starts[i + 1]]
        positions[:, i] = _path(time[entries], velocity[entries], entries >= 4 * len(log), rows[:, i], times)
    return positions


def _path(knots: Array, velocity: Array, is_row: Any, rows: Array, times: Array) -> Array:
    """Return positions in m of one body at `times` in s.

    They are integrated from velocities in m/s at `knots` in s. `is_row` marks the knots that are samples, and `rows`
    contains the positions in m at these knots.
    """
    # integrate piecewise linear velocities, then correct the drift at the samples
    step, change = np.diff(knots, append=knots[-1]), np.diff(velocity, append=velocity[-1])
    x = np.append(0.0, np.cumsum((velocity + 0.5 * change) * step)[:-1])
    x += np.interp(knots, knots[is_row], rows - x[is_row])
    k = np.maximum(np.searchsorted(knots, times, side="right") - 1, 0)
    fraction = np.divide(times - knots[k], step[k], out=np.zeros(len(times)), where=step[k] > 0.0)
    return x[k] + fraction * (np.diff(x, append=x[-1])[k] - 0.5 * (1.0 - fraction) * (change * step)[k])


def draw_paths(axis: Any, run: Any, span: Span) -> None:
    """Draw the paths of the balls of one run, and a mark at the onset of each contact."""
    touches, name = _contact_times(run), kind_of_spheres(run)
    stride = 1 + len(touches) // MAX_MARKS
    selected = np.flatnonzero((touches[:, 1] >= span.begin) & (touches[:, 0] <= span.end))[::stride]
    times, onset = span.times(touches[selected], 1500), touches[selected, 0].clip(span.begin)
    unit = draw_world_lines(axis, span, run.scene, {name: (times, paths(run, times))})
    marks = paths(run, onset)[range(len(selected)), run.contacts["pair"][selected]]
    axis.plot(span.clock(onset), marks / unit, ".", ms=4 if len(selected) < MANY_CONTACTS else 2, color=INK_COLOUR,
              zorder=3, label="a contact begins" + f" (one of {stride} shown)" * (stride > 1) if len(selected) else "_")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.2, **SMALL_FONT)


def draw_world_lines(axis: Any, span: Span, scene: Scene, of: Mapping[str, tuple[Array, Array]]) -> float:
    """Draw positions against time, and return the unit of the position axis in m.

    `of` contains times in s and positions in m with radii subtracted, with the key "soft" or "hard". Lines meet where
    balls touch, and cross where balls overlap.
    """
    visible = {label: y[(t >= span.begin) & (t <= span.end)] for label, (t, y) in of.items()}
    first = next(iter(visible.values()))
    low, high = first.min(), first.max()
    # guard for balls that do not move
    unit, name = unit_of(max(float(high - low), 1e-300), "m")
    for label, (t, y) in of.items():
        line_style = {"soft": "-", "hard": "--"}[label] if len(of) > 1 else "-"
        lines = axis.plot(
            span.clock(t), y / unit, color=LINE_COLOURS[label], ls=line_style, lw=min(1.0, 0.3 + 20.0 / scene.n)
        )
        lines[0].set_label(f"{label} spheres")
    margin = 0.5 * (high - low)  # for the second run; its faster balls can leave the axes
    bottom = max(min(float(y.min()) for y in visible.values()), low - margin)
    top = min(max(float(y.max()) for y in visible.values()), high + margin)
    pad = 0.04 * (top - bottom) or 1.0
    if scene.n <= MAX_LABELS:
        label_balls(axis, span, scene, first[-1] / unit, (top - bottom) / unit, LINE_COLOURS[next(iter(of))])
    axis.set(xlim=span.limits, ylabel=f"position without\nradii ({name})",
             ylim=((bottom - pad) / unit, (top + pad) / unit))
    return unit


def label_balls(axis: Any, span: Span, scene: Scene, places: Array, height: float, colour: str = SOFT_COLOUR) -> None:
    """Write the numbers of the balls at the ends of their paths.

    Balls close to each other get a common label. `places` are the final positions and `height` is the height of the
    axis, in the unit of the axis.
    """
    balls = [body for body in np.argsort(places, kind="stable").tolist() if not scene.is_wall[body]]
    starts = [i for i in range(len(balls)) if i == 0 or places[balls[i]] - places[balls[i - 1]] > 0.05 * height]
    for begin, end in zip(starts, [*starts[1:], len(balls)], strict=True):
        group = sorted(balls[begin:end])
        # consecutive numbers are shown as a range
        is_range = len(group) > 2 and group[-1] - group[0] == len(group) - 1
        label = f"{group[0]}–{group[-1]}" if is_range else ", ".join(map(str, group))
        axis.annotate(label, (span.shown[1], places[group].mean()), (10, 0),
                      textcoords="offset points", va="center", color=colour, annotation_clip=False, **SMALL_FONT)


def write_titles(figure: Any, title: str, subtitle: str, size: float = 9.0) -> None:
    """Write a bold title and smaller subtitles below it, with line breaks.

    `size` is the font size of the title in points.
    """
    width, height = 72.0 * figure.get_size_inches()
    titles = wrap(title, int(1.64 * width / size))
    subtitles = [line for part in subtitle.split("\n") for line in wrap(part, int(2.1 * width / size))]
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - 1.45 * size * len(titles + subtitles) / height))
    for row, line in enumerate(titles + subtitles):
        style = ({"weight": "bold", "fontsize": size} if row < len(titles)
               else {"color": "#555555", "fontsize": 0.88 * size})
        figure.text(0.015, 1.0 - (0.6 + 1.4 * row) * size / height, line, va="top", ha="left", **style)
