"""Figure of one run, and parts shared by all figures of runs.

The shared parts are the time span with its clock, paths between the rows of a run, and titles.
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
from granular._engine.reports import HARD_COLOUR, SOFT_COLOUR, canvas, unit_of
from granular.scene import Scene
from granular.scene.places import points

FAR_SPAN_LENGTHS = 3.0
"""Lengths of a span from t = 0 to its start above which its clock is shifted.

The clock then starts with the first contact of the span.
"""
AXIS_PAD, CONTACTS_MARGIN = 0.015, 0.06
"""Shares of the time axis.

PAD is left free at its ends so that marks are not cut. MARGIN is shown before and after the contacts.
"""
SHORT_SPAN_SHARE = 0.2
"""Share of a run below which its contacts are drawn again in a panel of their own."""
MIN_PATH_ROWS, BRIEF_CONTACT_SHARE = 100, 0.01
"""Number of rows in a span that define the paths.

With fewer rows, contacts may last at most the share BRIEF of the span.
"""
MAX_LABELS = 12
"""Largest number of pairs or balls that are labelled."""
MANY_CONTACTS, MAX_MARKS = 500, 2000
"""Numbers of contacts above which marks are small, and only some are drawn.

The drawn contacts are evenly spaced in the log.
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
        """Unit of the clock in s, and its name."""
        return unit_of(self.end - self.begin, "s")

    @property
    def shown(self) -> tuple[float, float]:
        """Values of the clock at `begin` and `end`."""
        return float(self.clock(self.begin)), float(self.clock(self.end))

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the time axis, with free space at both ends."""
        left, right = self.shown
        return left - AXIS_PAD * (right - left), right + AXIS_PAD * (right - left)

    def clock(self, time: Any) -> Any:
        """Return the values of the clock at times in s."""
        return (time - self.zero) / self.unit[0]

    @property
    def named(self) -> str:
        """Label of the time axis."""
        since = f"time since the first contact at t = {self.zero:.6g} s" if self.zero else "time"
        return f"{since}, {self.unit[1]}"

    def times(self, touches: Array, evenly: int) -> Array:
        """Return `evenly` equidistant times in s, and 17 times within each contact.

        `touches` contains onset and end of each contact.
        """
        within = np.linspace(touches[:, 0], touches[:, 1], 17).ravel()
        within = within[(within >= self.begin) & (within <= self.end)]
        return np.asarray(np.union1d(np.linspace(self.begin, self.end, evenly), within))


def plot(run: Any, path: str | PathLike[str] | None = None) -> Any:
    """Draw the paths of a run, see `Trajectory.plot`."""
    spans = spans_of(run)
    figure, panels = canvas(7.0, 0.9 + 2.6 * len(spans), len(spans))
    head(figure, *words(run))
    for axis, span in zip(panels[:, 0], spans, strict=True):
        draw_paths(axis, run, span)
        axis.set_xlabel(span.named)
    return files.write_figure(path, figure, dpi=200)


def words(run: Any) -> tuple[str, str]:
    """Return two titles: the number of contacts with the message, and the scene."""
    return f"{engine(run)} spheres, {len(run.contacts)} contacts: {run.message}", str(run.scene)


def engine(run: Any) -> str:
    """Return "hard" or "soft", the kind of spheres of a run."""
    return "hard" if run.law is None else "soft"


def spans_of(run: Any) -> list[Span]:
    """Return the span of the run, and the span of its contacts if it is a small part."""
    begin, end, touches = float(run.time[0]), float(run.time[-1]), _touches(run)
    first, last = float(touches.min(initial=end)), float(touches.max(initial=begin))
    late = len(touches) > 0 and first > FAR_SPAN_LENGTHS * (end - begin)
    whole = Span(begin, end if end > begin else begin + 1.0, first if late else 0.0)
    margin = CONTACTS_MARGIN * (last - first)
    near = Span(max(first - margin, begin), min(last + margin, end), first)
    small = 0.0 < near.end - near.begin < SHORT_SPAN_SHARE * (end - begin)
    spans = [span for span in [whole, near][: 1 + small] if _known(run, span, touches)]
    if not spans:
        raise ValueError(f"`run` must have more samples to draw its paths, got {len(run.time)}. Simulate with "
                         f"samples=np.linspace({begin:.6g}, {end:.6g}, 1000).")
    return spans


def _known(run: Any, span: Span, touches: Array) -> bool:
    """Return whether the paths in a span are determined by rows or by the contact log.

    The log suffices for short contacts with constant accelerations between them.
    """
    even = not run.scene.driven and run.scene.pendulum == 0.0
    logged = len(touches) > 0 or run.stats.get("contacts", run.stats.get("events", 0)) == 0
    lasts = float((touches[:, 1] - touches[:, 0]).max(initial=0.0))
    rows = np.count_nonzero((run.time >= span.begin) & (run.time <= span.end))
    return bool(rows >= MIN_PATH_ROWS or (even and logged and lasts < BRIEF_CONTACT_SHARE * (span.end - span.begin)))


def _touches(run: Any) -> Array:
    """Return onsets and ends of contacts in s, shape (count, 2).

    Contacts that have not ended are given the end of the run.
    """
    log = run.contacts
    return np.column_stack([log["t_begin"], np.nan_to_num(log["t_end"], nan=float(run.time[-1]))])


def paths(run: Any, times: Array) -> Array:
    """Return positions (len(times), n) in m without radii, at times in s within a run.

    Accelerations are assumed constant between successive rows and ends of contacts. This is exact for hard spheres in
    uniform gravity.
    """
    scene, log, rows = run.scene, run.contacts, points(run.scene, run.gap, run.position)
    n, count = scene.n, len(run.time)
    body = np.stack([log["pair"], (log["pair"] + 1) % n], 1)
    body = np.concatenate([np.repeat(body, 2, axis=1).ravel(), np.tile(np.arange(n), count)])
    time = np.concatenate([np.tile(np.stack([log["t_begin"], log["t_end"]], 1), 2).ravel(), np.repeat(run.time, n)])
    velocity = np.concatenate([np.stack([log["v_in"], log["v_out"]], 2).ravel(), run.velocity.ravel()])
    known = np.flatnonzero(np.isfinite(time + velocity))
    order = known[np.lexsort((time[known], body[known]))]
    edge = np.searchsorted(body[order], np.arange(n + 1))
    found = np.empty((len(times), n))
    for i in range(n):
        mine = order[edge[i] : edge[i + 1]]
        found[:, i] = _path(time[mine], velocity[mine], mine >= 4 * len(log), rows[:, i], times)
    return found


def _path(knots: Array, velocity: Array, is_row: Any, rows: Array, times: Array) -> Array:
    """Return positions in m of one body at `times` in s.

    They follow from velocities in m/s at `knots` in s. `rows` contains the positions in m at the knots that are rows.
    """
    # integrate piecewise linear velocities, then correct the drift at the rows
    step, change = np.diff(knots, append=knots[-1]), np.diff(velocity, append=velocity[-1])
    place = np.append(0.0, np.cumsum((velocity + 0.5 * change) * step)[:-1])
    place += np.interp(knots, knots[is_row], rows - place[is_row])
    k = np.maximum(np.searchsorted(knots, times, side="right") - 1, 0)
    share = np.divide(times - knots[k], step[k], out=np.zeros(len(times)), where=step[k] > 0.0)
    return place[k] + share * (np.diff(place, append=place[-1])[k] - 0.5 * (1.0 - share) * (change * step)[k])


def draw_paths(axis: Any, run: Any, span: Span) -> None:
    """Draw the paths of one run, and a mark at the onset of each contact."""
    touches, name = _touches(run), engine(run)
    every = 1 + len(touches) // MAX_MARKS
    seen = np.flatnonzero((touches[:, 1] >= span.begin) & (touches[:, 0] <= span.end))[::every]
    times, onset = span.times(touches[seen], 1500), touches[seen, 0].clip(span.begin)
    unit = world_lines(axis, span, run.scene, {name: (times, paths(run, times))})
    met = paths(run, onset)[range(len(seen)), run.contacts["pair"][seen]]
    axis.plot(span.clock(onset), met / unit, ".", ms=4 if len(seen) < MANY_CONTACTS else 2, color=INK_COLOUR, zorder=3,
              label="a contact begins" + f" (one of {every} shown)" * (every > 1) if len(seen) else "_")
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.2, **SMALL_FONT)


def world_lines(axis: Any, span: Span, scene: Scene, of: Mapping[str, tuple[Array, Array]]) -> float:
    """Draw positions against time without radii, and return the unit of the axis in m.

    `of` contains times in s and positions in m of soft and hard spheres. Lines meet where balls touch, and cross where
    they overlap.
    """
    shown = {label: y[(t >= span.begin) & (t <= span.end)] for label, (t, y) in of.items()}
    first = next(iter(shown.values()))
    low, high = first.min(), first.max()
    # guard for balls that do not move
    unit, name = unit_of(max(float(high - low), 1e-300), "m")
    for label, (t, y) in of.items():
        dash = {"soft": "-", "hard": "--"}[label] if len(of) > 1 else "-"
        lines = axis.plot(
            span.clock(t), y / unit, color=LINE_COLOURS[label], ls=dash, lw=min(1.0, 0.3 + 20.0 / scene.n)
        )
        lines[0].set_label(f"{label} spheres")
    room = 0.5 * (high - low)  # for hard balls; faster balls can leave the picture
    bottom = max(min(float(y.min()) for y in shown.values()), low - room)
    top = min(max(float(y.max()) for y in shown.values()), high + room)
    pad = 0.04 * (top - bottom) or 1.0
    if scene.n <= MAX_LABELS:
        name_balls(axis, span, scene, first[-1] / unit, (top - bottom) / unit, LINE_COLOURS[next(iter(of))])
    axis.set(xlim=span.limits, ylabel=f"paths, radii\ntaken out, {name}",
             ylim=((bottom - pad) / unit, (top + pad) / unit))
    return unit


def name_balls(axis: Any, span: Span, scene: Scene, places: Array, height: float, colour: str = SOFT_COLOUR) -> None:
    """Number the balls at the ends of their paths, with one label for close balls."""
    balls = [body for body in np.argsort(places, kind="stable").tolist() if not scene.is_wall[body]]
    starts = [i for i in range(len(balls)) if i == 0 or places[balls[i]] - places[balls[i - 1]] > 0.05 * height]
    for begin, end in zip(starts, [*starts[1:], len(balls)], strict=True):
        some = sorted(balls[begin:end])
        # consecutive numbers are shown as a range
        together = len(some) > 2 and some[-1] - some[0] == len(some) - 1
        said = f"{some[0]}–{some[-1]}" if together else ", ".join(map(str, some))
        axis.annotate(said, (span.shown[1], places[some].mean()), (10, 0),
                      textcoords="offset points", va="center", color=colour, annotation_clip=False, **SMALL_FONT)


def head(figure: Any, said: str, more: str, size: float = 9.0) -> None:
    """Write a bold title, and smaller lines below it."""
    width, height = 72.0 * figure.get_size_inches()
    titles = wrap(said, int(1.64 * width / size))
    small = [line for part in more.split("\n") for line in wrap(part, int(2.1 * width / size))]
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - 1.45 * size * len(titles + small) / height))
    for row, line in enumerate(titles + small):
        how = ({"weight": "bold", "fontsize": size} if row < len(titles)
               else {"color": "#555555", "fontsize": 0.88 * size})
        figure.text(0.015, 1.0 - (0.6 + 1.4 * row) * size / height, line, va="top", ha="left", **how)
