"""Compare runs of other programs, and recordings, with both models.

The clock of a recording or of another program rarely begins with the scene. Its offset minimizes the mean square root
of the absolute differences from a model. Samples at which both agree therefore determine the offset, and samples after
a collision with another outcome have little weight. The first sample, positions and free flights are also checked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.reports import abridged_rows, aligned
from granular.comparison.answer import Answer
from granular.comparison.further import apexes, repeat_with_samples
from granular.comparison.outcome import ERROR_LIMIT
from granular.run.trajectory import Trajectory
from granular.scene import speed_scale

ENGINES = "hard", "soft"
MAX_PRINTED_BALLS = 12
"""Maximum number of printed balls. The largest differences are printed."""
SAME_STATE = 1e-6
"""Largest difference of two equal states.

Differences of gaps are divided by the extent of the line, differences of their rates by the unit. Numbers of single
precision, or with seven printed digits, are within this limit.
"""
MEANINGS = {
    Answer.no: "Hard and soft spheres differ: a difference from one of them is not an error of the other run.",
    Answer.not_unique: "Hard spheres have several outcomes: a difference from them is not an error of the other run.",
    Answer.not_ball_by_ball: "Rounding decides single velocities: a difference is not an error of the other run.",
}
"""Meaning of a difference for some answers of a report."""


@dataclass(frozen=True, eq=False)
class Against:
    """A third run next to the runs of both engines.

    Attributes
    ----------
    report : Comparison
        The comparison of both engines.
    notes : tuple of str
        Sentences on clock, first sample, positions and free flights of the third run.
    offset : float
        Time in s on the clock of the third run at the time 0 of the scene.
    time : (T,) array
        Times in s of the samples of the third run, on the clock of the scene.
    unit : (n,) array
        Unit in m/s of each ball: the unit U of its component. For balls without contacts it is the largest unit.
    hard, soft : (T, n) arrays
        Velocity of the third run minus the velocity of the hard or the soft run, in these units. nan for walls, and
        where one of the velocities is unknown.
    velocity, gap : (3, T, n) and (3, T, n-1) arrays
        Velocities in m/s and gaps in m of the third run, of hard and of soft spheres. Values of hard and soft spheres
        are nan before the start of the scene, and after the end of a run that stopped early.
    """

    report: Any
    notes: tuple[str, ...]
    offset: float
    time: check.Array
    unit: check.Array
    hard: check.Array
    soft: check.Array
    velocity: check.Array
    gap: check.Array

    def __str__(self) -> str:
        scene, engines = self.report.scene, {"hard": np.abs(self.hard), "soft": np.abs(self.soft)}
        balls, largest = np.flatnonzero(~scene.is_wall), np.nan_to_num(np.fmax.reduce(engines["soft"]))
        shown = np.sort(balls[np.argsort(-largest[balls], kind="stable")][:MAX_PRINTED_BALLS]).tolist()
        pairs = sorted({c for i in shown for c in (i - 1, i) if 0 <= c < scene.n_pairs})
        values = [["last common sample", "t, s", "theirs", "hard", "soft"],
                  *([f"velocity of ball {i}, m/s", *self._last(self.velocity[..., i])] for i in shown),
                  *([f"gap {scene.pairs.name(c)}, m", *self._last(self.gap[..., c])] for c in pairs)]
        rows = [["velocity difference from", "U, m/s", "last, U", "largest, U", f"beyond {ERROR_LIMIT} U"],
                *([f"ball {i}, {engine}", f"{self.unit[i]:.3g}", *self._differences(apart[:, i])]
                  for i in shown for engine, apart in engines.items())]
        hidden = len(balls) - len(shown)
        return "\n".join([
            *_first_lines(self.report, self.offset, *self.notes), "", aligned(values, "<>"), "", aligned(rows, "<>>><"),
            *[f"({hidden} balls with smaller differences not shown)"] * bool(hidden)])

    def _last(self, values: check.Array) -> list[str]:
        """Time and values of the last sample at which most of `values` (3, T) are known."""
        known = np.isfinite(values).sum(axis=0)[::-1]
        k = len(known) - 1 - int(known.argmax())
        return [f"{number:.6g}" for number in (self.time[k], *values[:, k])]

    def _differences(self, apart: check.Array) -> list[str]:
        """Last and largest difference of a ball, and time above the limit, as text.

        The limit is `ERROR_LIMIT`. If the ball agrees until a run stopped early, the text contains the time of the last
        compared sample.

        Parameters
        ----------
        apart : (T,) array
            Absolute differences of the ball in its unit.
        """
        known, since = np.flatnonzero(np.isfinite(apart)).tolist(), "not known"
        if known:
            off, end = self.time[apart > ERROR_LIMIT].tolist(), self.time[known[-1]]
            agrees = "never" if known[-1] == len(apart) - 1 else f"not up to {end:.6g} s"
            since = f"from t = {off[0]:.9g} s" if off else agrees
        return [*(f"{value:.3g}" for value in (apart[(known or [-1])[-1]], np.fmax.reduce(apart))), since]


def _first_lines(report: Any, offset: float, *notes: str) -> list[str]:
    """Lines with the verdict, the meaning of differences, the clock, and `notes`."""
    clock = f"Clock: their t = {offset:.9g} s is t = 0 of the scene, to which the times below refer."
    texts = report.verdict, MEANINGS.get(report.answer, ""), clock * bool(offset), *notes
    return [line for text in texts for line in wrap(text, 80, subsequent_indent="  ")]


def against(report: Any, run: Trajectory) -> Against:
    """Implement `Comparison.against`."""
    check.of_kind("run", run, Trajectory, "a granular.Trajectory",
                  "Create one with granular.Trajectory.from_arrays.")
    scene = report.scene
    for name in ("mass", "radius"):
        expected, got = getattr(scene, name), getattr(run.scene, name)
        if expected.shape != got.shape or not np.allclose(expected, got, rtol=1e-9, atol=0.0):
            raise ValueError(f"`run` must be of the same scene: its {name} must be "
                             f"{np.array2string(expected, threshold=6)}, got {np.array2string(got, threshold=6)}.")
    other_unit = report.units.max(initial=0.0) or speed_scale(scene) or 1.0  # unit of balls that touch nothing
    unit = np.append(report.units, other_unit)[report.components.of_ball]
    offset = _clock_offset(report, run, other_unit)
    run = replace(run, time=run.time - offset)
    engines = [_states(report, engine, run.time) for engine in ENGINES]
    gap, velocity = (np.array(arrays) for arrays in zip((run.gap, run.velocity), *engines, strict=True))
    hard, soft = np.where(scene.is_wall, math.nan, (velocity[0] - velocity[1:]) / unit)
    notes = *_sample_notes(report, run, gap, velocity, unit), *_flight_notes(report, run)
    return Against(report, notes, offset, run.time, unit, hard, soft, velocity, gap)


def _states(report: Any, engine: str, times: check.Array) -> tuple[check.Array, check.Array]:
    """Gaps in m and velocities in m/s of an engine at given times, from a further run.

    They are nan before the start of the scene, and after the end of a run that stopped early.
    """
    start = report.soft.time[0]
    run = repeat_with_samples(report, engine, np.unique(np.append(times[times >= start], start)), further=True)
    row = np.searchsorted(run.time, times).clip(max=len(run.time) - 1)
    known = (run.time[row] == times)[:, None]
    return np.where(known, run.gap[row], math.nan), np.where(known, run.velocity[row], math.nan)


def _clock_offset(report: Any, run: Trajectory, unit: float) -> float:
    """Time in s on the clock of `run` at the time 0 of the scene.

    If the first sample is the initial state of the scene, the offset is its time. Otherwise the offset is fitted. It is
    0 if a model agrees at 0, if nothing moves, or if no offset halves the misfit. Half of the misfit corresponds to a
    quarter of the differences.

    Parameters
    ----------
    unit : float
        Largest unit in m/s.
    """
    scene = report.scene
    size = SAME_STATE * np.abs([run.position[0], scene.offsets(scene.gap)]).max()
    rate = np.abs(scene.across(run.velocity[0] - scene.velocity)).max()
    if not (np.fmax.reduce(run.gap) - np.fmin.reduce(run.gap) > size).any():
        return 0.0
    if np.abs(run.gap[0] - scene.gap).max() <= size and rate <= SAME_STATE * unit:  # False for nan
        return float(run.time[0] - report.soft.time[0])
    misfits, offsets, at_zero = zip(*(_fitted_offset(report, engine, run) for engine in ENGINES), strict=True)
    is_better = min(at_zero) > SAME_STATE**0.5 and min(misfits) < 0.5 * min(at_zero)
    return offsets[int(np.argmin(misfits))] if is_better else 0.0


def _fitted_offset(report: Any, engine: str, run: Trajectory) -> tuple[float, float, float]:
    """Smallest misfit of an engine, its offset in s, and the misfit at the offset 0.

    The misfit is the mean square root of the absolute differences of gaps, divided by the range of the recorded gaps.
    Samples without a state of the engine count as 1. Interpolation by cubic polynomials is exact in free flight. Before
    its start the scene is in its initial state, as for a ball that is held.
    """
    from scipy.interpolate import CubicHermiteSpline

    start, length, some = report.soft.time[0], np.ptp(run.time), slice(None, None, len(run.time) // 300 + 1)
    end = max(report.hard.time[-1], report.soft.time[-1])
    # a fraction of the time between two contacts; the limit keeps the search below about a second
    count = min(max(20 * len(getattr(report, engine).contacts), 2000), 20_000)
    knots = np.linspace(start, end if report.scene.fed else end + length, count)
    ours = repeat_with_samples(report, engine, knots, further=True)
    spline = CubicHermiteSpline(ours.time, ours.gap, report.scene.across(ours.velocity), extrapolate=False)
    time, recorded = run.time[some], run.gap[some]
    extent = float(np.fmax.reduce(recorded, axis=None) - np.fmin.reduce(recorded, axis=None))
    offsets = time[0] - np.linspace(end, start - length, count)
    for _ in range(12):  # each grid is 20 times finer, down to rounding errors
        step, offsets = offsets[1] - offsets[0], np.append(offsets, 0.0)
        misfits = [float(np.nan_to_num(np.sqrt(np.abs(recorded - spline(np.maximum(time - offset, start))) / extent),
                                       nan=1.0).mean()) for offset in offsets.tolist()]
        best = float(offsets[np.argmin(misfits)])
        offsets = best + step * np.linspace(-1.0, 1.0, 41)
    return min(misfits), best, misfits[-1]


def _sample_notes(
    report: Any, run: Trajectory, gap: check.Array, velocity: check.Array, unit: check.Array
) -> Iterator[str]:
    """Yield sentences on shifted positions and on a wrong first sample.

    The tolerance of the first sample is 1 % of the unit for velocities. For gaps it is 1 % of the sum of the gap in the
    scene and the path since the start, plus rounding errors.
    """
    scene, start = report.scene, float(report.soft.time[0])
    elapsed = max(0.0, float(run.time[0]) - start)
    size = SAME_STATE * np.abs(run.position[0]).max()
    if scene._wall is not None and abs(shift := run.position[0, scene._wall] - scene.anchor(elapsed, start)) > size:
        yield f"Positions: the wall is shifted by {shift:.4g} m. Only gaps are compared."
    for values, limit, name, unit_name in (
            (gap[:, 0], size + ERROR_LIMIT * (scene.gap + unit.max() * elapsed), "gap {} is", "m"),
            (np.where(scene.is_wall, 0.0, velocity[:, 0]), ERROR_LIMIT * unit, "velocity of ball {} is", "m/s")):
        apart = np.nan_to_num(np.abs(values[0] - values[1:]).min(axis=0) / limit)
        if apart[k := int(apart.argmax())] > 1.0:
            theirs, hard, soft = (f"{value:.6g}" for value in values[:, k])
            what = name.format(scene.pairs.name(k) if unit_name == "m" else k)
            yield (f"The first sample contradicts the scene: at t = {run.time[0]:.6g} s the {what} {theirs} "
                   f"{unit_name}, not {hard} (hard) or {soft} (soft).")


def _flight_notes(report: Any, run: Trajectory) -> Iterator[str]:
    """Yield a sentence on the first ball whose flight is not a parabola of the scene.

    The longest flight of each ball is tested. It consists of samples between which the ball cannot have touched a
    neighbour, at twice the largest speed of any run. A polynomial of third degree is fitted to the deviation from the
    parabola. Its quadratic or cubic coefficient must exceed ten standard errors, 3e-5 of the height of the flight, and
    three times the smallest step between recorded positions. An acceleration that is wrong by 0.1 % causes a deviation
    of 1e-4 of the height.
    """
    size = SAME_STATE * np.fmax.reduce(np.abs(run.position), axis=None)
    scene, rows = report.scene, np.unique(run.time.clip(min=report.soft.time[0]), return_index=True)[1]
    time, gap, step = run.time[rows], run.gap[rows], np.diff(run.time[rows])[:, None]
    if scene.fed or scene.ring or scene.pendulum:
        return
    speeds = scene.across(run.velocity), np.diff(gap, axis=0) / step, *(
        np.diff(each.contacts["v_in"]) for each in (report.hard, report.soft))
    reach = 2.0 * max(float(np.nanmax(np.abs(values), initial=0.0)) for values in speeds) * step
    gap = gap - np.fmin.reduce(gap).clip(min=0.0)  # positions can be shifted
    free = (gap[1:] > 0.0) & (gap[:-1] > 0.0) & (gap[1:] + gap[:-1] > reach)
    for ball in np.flatnonzero(~scene.is_wall).tolist():
        edges = np.flatnonzero(np.diff(np.pad(free[:, max(ball - 1, 0) : ball + 1].all(axis=1), 1).astype(int)))
        begin, end = max(edges.reshape(-1, 2).tolist(), key=lambda edge: edge[1] - edge[0], default=(0, 0))
        if end - begin < 10:
            continue
        part, fall = slice(begin, end + 1), float(scene.fall[ball])
        t, place = time[part] - time[begin], run.position[rows[part], ball]
        fit, covariance = np.polyfit(2.0 * t / t[-1] - 1.0, place - 0.5 * fall * t**2, 3, cov=True)
        levels = np.unique(np.round(run.position[:, ball] / size))  # positions can be rounded to pixels or digits
        floor = max(3e-5 * np.ptp(place), 3.0 * size * np.fmin.reduce(np.diff(levels), initial=math.inf))
        if (np.abs(fit[:2]) > np.maximum(floor, 10.0 * np.sqrt(np.diag(covariance)[:2]))).any():
            first, last = (fall + 8.0 * (fit[1] + 3.0 * u * fit[0]) / t[-1] ** 2 for u in (-1.0, 1.0))
            yield (f"A free flight of ball {ball} is not the parabola of {fall:.4g} m/s²: in {t[-1]:.3g} s its "
                   f"acceleration changes from {first:.4g} to {last:.4g} m/s². Neither model has drag.")
            return


@dataclass(frozen=True, eq=False)
class Bounces:
    """Recorded bounces next to the bounces of both engines.

    Attributes
    ----------
    report : Comparison
        The comparison of both engines.
    offset : float
        Time in s on the clock of the recording at the time 0 of the scene.
    times : (3, K) array
        Onsets of the bounces in s, of the recording, of hard and of soft spheres, on the clock of the scene.
    heights : (3, L) array
        Heights in m of the apexes after the bounces, in the same order of rows. Unknown times and heights are nan.
    """

    report: Any
    offset: float
    times: check.Array
    heights: check.Array

    def __str__(self) -> str:
        tables = [[[f"bounce, {name}", "theirs", "hard", "soft", "minus hard", "minus soft"],
                   *([str(k + 1), *(f"{value:.6g}" for value in row), *(f"{row[0] - value:.3g}" for value in row[1:])]
                     for k, row in enumerate(values.T))]
                  for name, values in (("t in s", self.times), ("height in m", self.heights)) if values.size]
        return "\n".join([*_first_lines(self.report, self.offset),
                          *("\n" + aligned(abridged_rows(table, 40), "<>") for table in tables)])


def against_bounces(report: Any, times: Any, heights: Any, ball: int) -> Bounces:
    """Implement `Comparison.against_bounces`."""
    if times is None and heights is None:
        raise ValueError("One of `times` and `heights` must be given, got neither.")
    recorded = np.zeros(0) if times is None else check.increasing_array("times", times, "a finite time in s")
    tops = check.array("heights", () if heights is None else heights, finite="a finite height in m")
    check.every("heights", tops, tops >= 0.0, "a height in m of at least 0")
    body = check.integer("ball", ball, at_least=1, at_most=report.scene.n - 1)
    onsets = [np.sort(run.of(0)["t_begin"])[: len(recorded)] for run in (report.hard, report.soft)]
    # one bounce fits any clock, so an engine with one bounce does not decide about it
    least = min(2, max(1, *map(len, onsets)))
    late = [recorded[: len(hits)] - hits for hits in onsets if len(hits) >= least]
    misfits = {float(shift): min(float(np.sqrt(np.abs(each - shift)).mean()) for each in late)
               for shift in (0.0, *map(np.median, late))} if late else {0.0: 0.0}
    best = min(misfits, key=misfits.__getitem__)
    offset = best if misfits[best] < 0.5 * misfits[0.0] else 0.0
    hits = [np.pad(each, (0, len(recorded) - len(each)), constant_values=math.nan) for each in onsets]
    # only the lowest ball surely flies between two bounces; another ball can fly during several
    rises = [[apexes(report, engine, [body], k + 1, before_next=body == 1)[0, 1] for k in range(len(tops))]
             for engine in ENGINES]
    return Bounces(report, offset, np.array([recorded - offset, *hits]), np.array([tops, *rises]))
