"""Quantities of a comparison that need further runs.

They are the effective ε of hard spheres, heights and times of apexes, and the fraction of the impulse on the floor that
is exchanged while balls 1 and 2 touch each other.

The apex of a ball is the first highest point of a flight that it reaches before its next contact. With a bounce number
above 1, only flights after that contact with the floor count. If the run stops before the apex, it is continued, with
all further collisions. A run with fixed steps is repeated with a later end instead. A ball that comes to rest first has
the height 0, or no apex above a driven floor. A ball that hits a ceiling first has no apex.
(granular/app/page/physics/apex.mjs has the same definition, for scenes without a ceiling.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular import edmd, md
from granular._engine import check
from granular.comparison.outcome import energy_between_surfaces
from granular.edmd.physics import GROUP, TIE_ORDERS
from granular.run.trajectory import EARLY_STATUSES, Status, Trajectory
from granular.run.until import Separated
from granular.scene import Scene, speed_scale

ROOT_ROUNDING_ERROR = 1e-14
"""Fraction of the largest value below which a value counts as zero.

A function that jumps near its root need not change its sign there.
"""
MERGING_SPEED_FACTOR = 1e-4
"""Speed below which hard spheres stick, relative to the impact speed."""
MAX_FALL_TIMES = 1000.0
"""Limit on the time to an apex, in fall times."""
MAX_EVENTS_PER_RUN = 3000
"""Limit on the events of each run."""
MAX_STEPS_PER_RUN = 10 * MAX_EVENTS_PER_RUN
"""Limit on the steps of each soft run. A pile that settles has few events."""
MAX_FIXED_STEPS = 10 * MAX_STEPS_PER_RUN
"""Limit on the additional steps of a run with fixed steps.

The steps take about 2 s if interpreted. A ball at rest needs many of them.
"""
Flight = tuple[float, float, float, int]


def roots(function: Callable[[float], float], grid: check.Array, scale: float) -> tuple[float, ...]:
    """Return the zeros of a function that can jump, in ascending order.

    Zeros are searched at the grid points and between grid points with opposite signs. Values at rounding level are
    zero. A jump across zero is not a root.

    Parameters
    ----------
    function : callable
        Function of one number.
    grid : array
        Increasing arguments at which the function is computed.
    scale : float
        Magnitude of the terms that cancel at a zero. It sets the rounding level.
    """
    from scipy.optimize import brentq

    values = np.array([function(x) for x in grid.tolist()])
    values[np.abs(values) <= ROOT_ROUNDING_ERROR * (scale + np.nanmax(np.abs(values), initial=0.0))] = 0.0
    zeros = grid[values == 0.0].tolist()
    for k in np.flatnonzero(np.multiply(values[:-1], values[1:]) < 0.0):
        root = float(brentq(function, grid[k], grid[k + 1], xtol=1e-14))
        if abs(function(root)) < 1e-6 * (scale + abs(values[k]) + abs(values[k + 1])):
            zeros.append(root)
    return tuple(sorted(zeros))


def repeat_with_samples(report: Any, engine: str, times: check.Array, further: bool = False) -> Trajectory:
    """Repeat the hard or the soft run of a comparison with samples at given times.

    By default, the samples stop at the end of the original run. They extend beyond it if only free flight follows.

    Parameters
    ----------
    engine : str
        "hard" or "soft".
    times : array
        Sorted times of the samples in s.
    further : bool
        Whether to continue the run to the last of `times` in any case.
    """
    hard = engine == "hard"
    run = report.hard if hard else report.soft
    has_separated = run.status is Status.until and (hard or isinstance(report.until, Separated))
    continues_freely = has_separated or run.status in (Status.quiet, Status.resting, Status.time)
    continues_freely = continues_freely and not report.scene.driven  # a path can end with the run
    stop = float(times[-1]) if continues_freely or further else min(float(times[-1]), float(run.time[-1]))
    sampling: dict[str, Any] = {"t_end": stop, "samples": np.unique(np.minimum(times, stop))}
    if hard:
        return edmd.simulate(report.scene, report.rule, **(dict(report.hard_options) | sampling | {"until": None}))
    return md.simulate(report.scene, report.law, **report.soft_options, **sampling)


@dataclass(frozen=True, eq=False)
class Continuation:
    """Continuation of the hard or the soft run of a comparison beyond its end.

    In the continuation, hard spheres that collide slowly stick together. A soft run with fixed steps has no checkpoint.
    It is repeated with the same steps and a later end.

    Parameters
    ----------
    engine : str
        "hard" or "soft".
    """

    report: Any
    engine: str

    @property
    def before(self) -> Trajectory:
        """The original run."""
        run: Trajectory = self.report.hard if self.engine == "hard" else self.report.soft
        return run

    @property
    def repeats(self) -> bool:
        """Whether the run is repeated from its start, because it has no checkpoint."""
        return self.engine == "soft" and "origin" not in self.before.state

    def contacts(self, later: Trajectory) -> Any:
        """Contacts from the start of the original run to the end of `later`.

        `later` is a result of `run`.
        """
        log = self.before.contacts
        return later.contacts if self.repeats else np.concatenate([log[~np.isnan(log["t_end"])], later.contacts])

    def run(self, t_end: float, samples: check.Array | None = None) -> Trajectory:
        """Continue the run up to `t_end` in s, with `samples` at the given times."""
        run, start = self.before, float(self.before.time[-1])
        if self.repeats:
            return md.simulate(
                run.scene, run.law, t_start=float(run.time[0]), t_end=t_end, samples=samples,
                max_events=len(run.contacts) + MAX_EVENTS_PER_RUN,
                max_steps=run.stats.get("steps", 0) + MAX_FIXED_STEPS, **self.report.soft_options)
        if self.engine == "soft":
            return md.resume(
                run, t_end=t_end, samples=samples, max_events=MAX_EVENTS_PER_RUN, max_steps=MAX_STEPS_PER_RUN
            )
        # bodies that have merged, and draws of thermal walls, continue only from a checkpoint
        if self.report.hard_options["collapse"] == "merge" or run.scene.heated:
            return edmd.resume(run, t_end=t_end, samples=samples, max_events=MAX_EVENTS_PER_RUN)
        speed = self.report.impact_speed  # nan before the first collision
        velocity = np.where(run.scene.is_wall, run.scene.velocity, run.velocity[-1])  # the scene adds motions of walls
        return edmd.simulate(
            run.scene.replace(gap=run.gap[-1], velocity=velocity, origin=0.0), self.report.rule, t_start=start,
            t_end=t_end, samples=samples, max_events=MAX_EVENTS_PER_RUN, collapse="merge",
            merge_below=MERGING_SPEED_FACTOR * (speed if speed > 0.0 else speed_scale(run.scene) or 1.0))

    def heights(self, times: check.Array, further: Trajectory | None = None) -> check.Array:
        """Heights in m above the lowest body, with radii subtracted, (len(times), n).

        A driven floor counts without its motion m(t) - m(t_start). `times` in s increase. The heights are nan at times
        after the run stopped at a limit. `further` is a continuation, whose last sample is used if its time is the only
        time.
        """
        early = times <= self.before.time[-1]
        gaps = [repeat_with_samples(self.report, self.engine, times[early]).gap] if early.any() else []
        if further is not None and times.tolist() == [further.time[-1]]:
            gaps = [further.gap[-1:]]
        elif not early.all():
            run = self.run(float(times[-1]), times[~early])
            gaps.append(run.gap[run.time.searchsorted(times[~early][times[~early] <= run.time[-1]])])
        known = np.pad(np.cumsum(np.concatenate(gaps), axis=1), ((0, 0), (1, 0)))
        start = float(self.before.time[0])
        known[:, 1:] += np.reshape(self.report.scene._moved(0, times[: len(known)] - start, start)[0], (-1, 1))
        return np.pad(known, ((0, len(times) - len(known)), (0, 0)), constant_values=math.nan)


class Rises(tuple[float, float]):
    """Height in m to which the top ball rises: the pair (hard, soft).

    Call the object to get the heights after a later bounce.
    """

    report: Any

    def __call__(self, bounce: int = 1) -> Rises:
        """Return the heights after contact number `bounce` with the floor, from 1."""
        first: Rises = self.report.rises
        return first if check.integer("bounce", bounce, at_least=1) == 1 else rises(self.report, bounce)


def rises(report: Any, bounce: int = 1) -> Rises:
    """Heights to which the top ball rises after floor contact number `bounce`."""
    top = int(np.flatnonzero(~report.scene.is_wall)[-1])
    heights = Rises(float(apexes(report, engine, [top], bounce)[0, 1]) for engine in ("hard", "soft"))
    heights.report = report
    return heights


def apexes(
    report: Any, engine: str, bodies: Sequence[int], bounce: int = 1, before_next: bool = False
) -> check.Array:
    """Time in s and height in m of the apex of each body after a bounce, (count, 2).

    A ball that comes to rest has the time nan and the height 0. Both are nan if the apex does not exist or cannot be
    determined.

    Parameters
    ----------
    engine : str
        "hard" or "soft".
    bounce : int
        Number of the contact with the floor after which the apex is searched. 1 includes apexes before this contact.
    before_next : bool
        Whether the flight to the apex must begin before the next contact with the floor. Defaults to False.
    """
    scene, continuation, options = report.scene, Continuation(report, engine), report.hard_options
    result = np.full((len(bodies), 2), math.nan)
    # `Continuation` continues without these options, and needs a checkpoint for the draws of thermal walls
    not_continuable = engine == "hard" and (TIE_ORDERS[options["ties"]] == GROUP
                                          or options["tc"] > 0.0 or options["elastic_below"] > 0.0
                                          or (scene.heated and report.hard.status in EARLY_STATUSES))
    if (report.settled.status in EARLY_STATUSES or report.soft.status in EARLY_STATUSES or not scene.gravity
            or not scene.is_wall[0] or not_continuable):
        return result
    original = continuation.before
    if list(bodies) == [scene.n - 1] and (known := _apex_of_last_flight(original, bounce)):
        return np.array([known])

    def times_in(log: Any) -> list[float]:
        return [0.0 if scene.is_wall[body] else _apex(scene, log, body, bounce, before_next) for body in bodies]

    fall, apex_times = math.sqrt(2.0 * max(float(scene.gap[0]), 0.05) / scene.gravity), result[:, 0]
    start = float(original.time[-1])
    undisturbed = max(times_in(original.contacts[~np.isnan(original.contacts["t_end"])]), default=0.0)
    durations = fall * np.minimum(16.0 ** np.arange(-1.5, 5.0), MAX_FALL_TIMES)
    if 0.0 < undisturbed - start < durations[-1]:  # False for nan
        durations = np.append(undisturbed - start, durations[durations > undisturbed - start])
    for duration in durations:
        end = float(np.fmin(start + duration, apex_times.max()))
        run = continuation.run(end)
        apex_times[:] = times_in(continuation.contacts(run))
        # the apexes lie within the run, or nothing can follow
        is_at_rest = not (run.gap[-1].any() or np.ptp(run.velocity[-1])) or run.stats.get("resting", False)
        if is_at_rest or run.status is not Status.time or ((apex_times <= end) | np.isinf(apex_times)).all():
            break
    # a driven floor can throw balls up again; a ball that forces press onto another one flies with it
    has_none = np.isinf(apex_times) | scene.driven | (scene.closing_acceleration[1:] > 0.0).any()
    apex_times[apex_times > run.time[-1]] = math.nan
    times, index = np.unique(np.nan_to_num(apex_times, nan=start), return_inverse=True)
    least = -math.inf if scene.driven else 0.0
    tops = np.maximum(least, continuation.heights(times, run)[index, list(bodies)])
    result[:, 1] = np.where(np.isfinite(apex_times), tops, np.where(is_at_rest & ~has_none, 0.0, math.nan))
    return result


def _apex_of_last_flight(run: Trajectory, bounce: int) -> tuple[float, float] | None:
    """Time in s and height in m of the apex of the top ball's current flight, or None.

    At the end of the run, the ball is at height y and has the velocity v. The apex of its flight is at H = y + v²/(2
    g). If the apex is after the end of the run, the ball below must not reach the top ball before. This is certain if
    all bodies below together have less energy than 0.9 m g H, where m is the mass of the ball below. The margin is
    required because bodies with overlaps can have a slightly negative energy. The result is None if this condition is
    violated, if an earlier flight determines the apex, or if other forces act.
    """
    scene, log, top = run.scene, run.contacts, run.scene.n - 1
    if scene._flags or scene.is_wall.tolist() != [True] + [False] * top or scene.velocity[0] or top < 2:
        return None
    time = _apex(scene, log, top, bounce)
    last = _contacts_of(log, top)[-1:]["t_end"]
    if not (len(last) and time > float(last[0])):  # False for nan
        return None
    y, v = float(run.gap[-1].sum()), float(run.velocity[-1, top])
    height = y + 0.5 * v * v / scene.gravity
    energy_below = float(energy_between_surfaces(run)[-1]) - float(scene.mass[top]) * scene.gravity * height
    if time <= run.time[-1]:
        return time, height
    return (time, height) if energy_below < 0.9 * float(scene.mass[top - 1]) * scene.gravity * height else None


def _apex(scene: Scene, log: Any, body: int, bounce: int, before_next: bool = False) -> float:
    """Time in s of the first apex of a body after a bounce, or nan or inf.

    nan means that the log ends before, inf that the body has no apex. An apex is the highest point above a floor of
    constant velocity. It counts if the ball reaches it before its next contact. A ball that hits a ceiling first, or
    that forces drive upwards, has none.

    Parameters
    ----------
    body, bounce : int
        Number of the body, and number of the contact with the floor.
    before_next : bool
        Whether only flights that begin before the next contact with the floor count.
    """
    floor = np.append(np.sort(log["t_begin"][log["pair"] == 0]), [math.inf] * (bounce + 1))
    since, until = floor[bounce - 1] if bounce > 1 else -math.inf, floor[bounce] if before_next else math.inf
    floor_velocity, deceleration = float(scene.velocity[0]), -float(scene.fall[body])
    for begin, velocity, hit, pair in _flights(log, body, since):
        speed = velocity - floor_velocity
        if begin >= until or not deceleration > 0.0:
            return math.inf
        if speed > 0.0 and (time := begin + speed / deceleration) <= hit:
            return time
        if speed > 0.0 and pair == body and scene.is_wall[body + 1]:
            return math.inf
    return math.nan


def _flights(log: Any, body: int, since: float) -> Iterator[Flight]:
    """Yield start, initial velocity, end and next pair of each flight of a body.

    The next pair ends the flight. The flights are in time order. Flights after contacts that begin before `since` are
    left out. Times are in s, and the velocity in m/s. The last flight ends at inf, with pair -1.
    """
    rows = _contacts_of(log, body)
    rows = rows[np.argsort(rows["t_end"], kind="stable")]
    for k, row in enumerate(rows[~np.isnan(rows["t_end"])]):
        t = float(row["t_end"])
        in_contact = ((rows["t_begin"] < t) & ~(rows["t_end"] <= t)).any()
        later = rows[k + 1 :][rows["t_begin"][k + 1 :] >= t]
        following = later[int(later["t_begin"].argmin())] if len(later) else None
        if not in_contact and row["t_begin"] >= since:
            hit, pair = (math.inf, -1) if following is None else (float(following["t_begin"]), int(following["pair"]))
            yield t, float(row["v_out"][int(row["pair"] < body)]), hit, pair


def _contacts_of(log: Any, body: int) -> Any:
    """Contacts that change the velocity of a body.

    They are the contacts of its pairs, and collisions after which hard spheres stick, if all bodies between this pair
    and the body stick to it already.
    """
    pair, is_own = log["pair"], (log["pair"] == body) | (log["pair"] == body - 1)
    sticks = (log["t_begin"] == log["t_end"]) & (log["v_out"][:, 0] == log["v_out"][:, 1])
    for row in np.flatnonzero(sticks & ~is_own).tolist():
        between = range(pair[row] + 1, body) if pair[row] < body else range(body, pair[row])
        is_own[row] = all(sticks[:row][pair[:row] == k][-1:].any() for k in between)
    return log[is_own]


def floor_share(report: Any) -> float:
    """Fraction of the soft impulse on the floor during contacts of ball 1 with ball 2.

    The impulse of the floor between two times is Σ m (Δv + g Δt). The fraction is nan without a floor, with a ceiling,
    with forces in addition to weight, and for an unstable run.
    """
    scene, log, total = report.scene, report.counted[1].contacts, report.soft.of(0)["impulse"].sum()
    if (scene._flags or scene.is_wall.tolist() != [True] + [False] * (scene.n - 1) or not total > 0.0
            or report.soft.status is Status.unstable):
        return math.nan
    spans = np.array([2 * (report.soft.time[-1],), *((o.begin, o.end) for o in report.overlaps
                                                     if log["pair"][o.lower] == 0)])  # there can be none
    run = repeat_with_samples(report, "soft", np.unique(spans))
    momentum = run.momentum() + scene.gravity * float(scene.mass[1:].sum()) * run.time
    return float(np.diff(momentum[np.searchsorted(run.time, spans)], axis=1).sum() / total)
