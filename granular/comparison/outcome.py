"""Outcomes of a run, from its contact log, and differences between two runs.

Outcomes are the numbers of contacts, the separation speeds of pairs, and the velocities of balls after their last
contacts. Balls that touch each other in either run form a component. Each component is compared separately.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, TypeVar
from zlib import crc32

import numpy as np

from granular._engine.callables import check_argument_types
from granular._engine.check import Array, of_kind
from granular.md.isolation import isolated_durations
from granular.run.trajectory import Trajectory

ERROR_LIMIT = 0.01
"""Largest error, in the unit U of the component, at which two runs agree."""
SIMULTANEITY_TOLERANCE = 1e-12
"""Largest delay of simultaneous collisions, relative to the time since the start.

Rounding errors decide the order of such collisions.
"""
MIN_CONTACT_STRENGTH = 1e-12
"""Contacts weaker than this fraction of the fastest approach speed are ignored.

Rounding errors of the velocities are about 1e-15 of this speed after one contact, and 1e-12 after a thousand contacts.
"""
VELOCITY_ROUNDING_ERROR = 1e-13
"""Rounding error of a velocity difference, relative to the largest velocity."""
MAX_WEIGHT_ITERATIONS = 100
"""Limit on the iterations that solve v = a t_c(v).

For F = k ξ^p the error decreases by the factor (p - 1)/(p + 1) per iteration, 1/5 for Hertz spheres.
"""

_Result = TypeVar("_Result")


def _once_per_run(function: Callable[[Trajectory], _Result]) -> Callable[[Trajectory], _Result]:
    """Decorator that caches the result of a function of a run in the run.

    Cached arrays are read-only. An argument that is not a `Trajectory` raises `TypeError`.
    """
    name, argument = f"_{function.__name__}", function.__code__.co_varnames[0]

    @wraps(function)
    def with_cache(run: Trajectory) -> _Result:
        if not isinstance(run, Trajectory):
            of_kind(argument, run, Trajectory, "a granular.Trajectory")
        stored = vars(run)
        if name not in stored:
            result = stored[name] = function(run)
            for array in result if isinstance(result, tuple) else (result,):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
        return stored[name]  # type: ignore[no-any-return]

    return with_cache


@dataclass(frozen=True)
class PairOutcome:
    """Outcome of one pair in the hard run and in the soft run, after its last contact.

    Attributes
    ----------
    pair : int
        Number of the pair.
    hard_contacts, soft_contacts : int
        Number of contacts above rounding level, see `granular.comparison.outcome.without_weak_contacts`.
    hard_v_rel, soft_v_rel : float
        Separation speed v[c+1] - v[c] in m/s at the end of the pair's last contact. nan without contacts, and for a
        contact without end.
    hard_t_f, soft_t_f : float
        Time in s at which the pair's last contact ends. nan in the same cases.
    ongoing : bool
        Whether a soft contact of the pair had not ended when the soft run stopped. The comparison continues such a run
        until the contact has ended. If the pair comes to rest instead, `soft_v_rel` is nan.
    """

    pair: int
    hard_contacts: int
    soft_contacts: int
    hard_v_rel: float
    soft_v_rel: float
    hard_t_f: float
    soft_t_f: float
    ongoing: bool


def pair_outcomes(hard: Trajectory, soft: Trajectory, cut: Trajectory) -> tuple[PairOutcome, ...]:
    """Return the outcome of every pair of two runs with equal contact counts.

    Parameters
    ----------
    hard, soft : Trajectory
        The two runs, continued by `granular.comparison.align.equalize_counts`.
    cut : Trajectory
        The soft run before it was continued. Its contacts without end determine `PairOutcome.ongoing`.
    """
    ongoing = np.zeros(soft.scene.n_pairs, dtype=np.bool_)
    ongoing[cut.contacts["pair"][np.isnan(cut.contacts["t_end"])]] = True
    columns = [counts(hard), counts(soft), *separations(hard), *separations(soft), ongoing]
    n_hard, n_soft, hard_v, hard_t, soft_v, soft_t, ongoing_ = (column.tolist() for column in columns)
    return tuple(map(PairOutcome, range(len(n_hard)), n_hard, n_soft, hard_v, soft_v, hard_t, soft_t, ongoing_))


@_once_per_run
def touching_bodies(run: Trajectory) -> Any:
    """Indices of the lower and the upper body of each contact in the log, (m, 2)."""
    return np.stack(run.scene.bodies(run.contacts["pair"]), axis=1)


@_once_per_run
def counts(run: Trajectory) -> Any:
    """Number of contacts of every pair, shape (n-1,)."""
    return np.diff(run.by_pair[1])


@_once_per_run
def separation_speeds(run: Trajectory) -> Array:
    """Separation speed in m/s after the last contact of every pair, (n-1,).

    It is nan for a pair without contacts, and after a contact without end.
    """
    return separations(run)[0]


@_once_per_run
def sticking_speed(run: Trajectory) -> float:
    """Largest separation speed in m/s at which two hard spheres count as stuck.

    It is the option `merge_below` of the run. Without this option it is 0 if balls of the run merged or came to rest,
    and otherwise -1, so that no pair counts as stuck. Two balls that only leave an instant with equal velocities do
    not stick.
    """
    has_rested = run.stats.get("merged", 0) + run.stats.get("settled", 0) > 0
    return float(run.stats.get("merge_below", 0.0 if has_rested else -1.0))


@_once_per_run
def separations(run: Trajectory) -> tuple[Array, Array]:
    """Separation speed in m/s and end time in s of the last contact of every pair.

    Both arrays have shape (n-1,). They are nan for a pair without contacts, and after a contact without end.
    """
    order, starts = run.by_pair
    touching = np.flatnonzero(np.diff(starts))
    last = run.contacts[order[starts[touching + 1] - 1]]
    speed, time = np.full((2, len(starts) - 1), math.nan)
    speed[touching], time[touching] = last["v_out"][:, 1] - last["v_out"][:, 0], last["t_end"]
    return speed, time


@_once_per_run
def leaving_velocities_and_times(run: Trajectory) -> tuple[Array, Array]:
    """Velocity in m/s of each body after its last contact, and the time in s.

    Both arrays have shape (n,). For a body without contacts they contain its initial velocity and the start of the run.
    They are nan if the last contact has no end. The time is the end of that contact.
    """
    u, end = run.scene.velocity.copy(), np.full(run.scene.n, float(run.time[0]))
    # all contacts are in group 0, so the keys are the numbers of the bodies
    body, row, side = last_contacts(
        run, rows=np.arange(len(run.contacts)), group=np.zeros(len(run.contacts), np.int64))
    u[body], end[body] = run.contacts["v_out"][row, side], run.contacts["t_end"][row]
    return u, end


def last_contacts(run: Trajectory, rows: Any, group: Any) -> tuple[Any, Any, Any]:
    """Find the contact that ends last, for each body in each group of contacts.

    A contact without end is the last one.

    Parameters
    ----------
    run : Trajectory
        The run whose contact log is used.
    rows : (m,) array of int
        Rows of the contact log.
    group : (m,) array of int
        Number of the group to which each row belongs.

    Returns
    -------
    key, row, side : arrays of int
        For each body with a contact in a group: the number ``group * n + body``, the row of the contact, and the side
        of the body in its pair (0 for the lower one, 1 for the upper one).
    """
    key = (group[:, None] * run.scene.n + touching_bodies(run)[rows]).ravel()
    order = np.lexsort((run.contacts["t_end"][rows].repeat(2), key))
    key = key[order]
    is_last = np.ones(len(key), np.bool_)
    np.not_equal(key[1:], key[:-1], out=is_last[:-1])
    last = order[is_last]
    return key[is_last], rows[last // 2], last % 2


def leaving_velocities(run: Trajectory) -> Array:
    """Velocity u in m/s of each body after its last contact, (n,)."""
    return leaving_velocities_and_times(run)[0]


def combine_simultaneous(hard: Trajectory) -> Trajectory:
    """Combine simultaneous collisions of a pair of hard spheres into one contact.

    The tie rule determines the order of simultaneous collisions, which has no physical meaning. The combined contact
    ends with the velocities of the two bodies after all their collisions at this time. Collisions are simultaneous if
    they differ by at most `SIMULTANEITY_TOLERANCE` times the time since the start.
    """
    log = hard.contacts
    if len(log) < 2:
        return hard
    time, rows, is_later = log["t_begin"], np.arange(len(log)), np.zeros(len(log), np.bool_)
    is_later[1:] = time[1:] - time[:-1] > SIMULTANEITY_TOLERANCE * (time[1:] - hard.time[0])
    if is_later[1:].all():
        return hard
    instant = np.cumsum(is_later)
    after = log["v_out"].copy()
    body, k = np.column_stack(hard.scene.bodies(log["pair"])).ravel(), np.repeat(rows, 2)
    by_body = np.lexsort((k, instant[k], body))
    ends = np.append((np.diff(body[by_body]) != 0) | (np.diff(instant[k][by_body]) != 0), True)
    # the last collision of its body at this time
    final = by_body[np.flatnonzero(ends)[np.cumsum(np.append(False, ends[:-1]))]]
    after.ravel()[by_body] = log["v_out"].ravel()[final]
    order = np.lexsort((rows, instant, log["pair"]))
    is_repeated = np.append(False, (np.diff(log["pair"][order]) == 0) & (np.diff(instant[order]) == 0))
    if not is_repeated.any() and (after == log["v_out"]).all():
        return hard
    log = log.copy()
    log["v_out"] = after
    return replace(hard, contacts=log[np.sort(order[~is_repeated])])


def energy_between_surfaces(run: Trajectory) -> Array:
    """Energy in J of every sample, with heights between surfaces, (T,).

    It is `Trajectory.energy` with heights above the initial position of body 0, from which the radii are subtracted as
    in `granular.measures.height`. Balls that lie on a floor therefore have no potential energy.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    start_height = (run.position[0] - np.append(0.0, run.gap[0].cumsum())[: scene.n])[balls]  # a ring has one more gap
    fixed = scene.gravity * (scene.mass[balls] @ start_height)
    if scene.external_force is not None:
        fixed -= scene.external_force[balls] @ start_height
    return np.asarray(run.energy() - fixed)


def energy_left(run: Trajectory) -> float:
    """Fraction E/E0 of the energy that is left at the end of a run.

    E is the energy of `energy_between_surfaces`. nan if the initial energy E0 is not positive.
    """
    energy = energy_between_surfaces(run)
    return float(energy[-1] / energy[0]) if energy[0] > 0.0 else math.nan


@_once_per_run
def strengths(run: Trajectory) -> Array:
    """Strength in m/s of each contact in the log, (m,).

    It is the larger of the approach speed and of impulse / m_eff. Balls that touch at rest have no approach speed. It
    is 0 for a contact that ended without any force, as at the onset of a law whose attraction is clipped to 0.
    """
    log = run.contacts
    strength = np.maximum(approach(run), log["impulse"] / run.scene.pairs.m_eff[log["pair"]])
    strength[(log["impulse"] == 0.0) & ~np.isnan(log["t_end"])] = 0.0
    return np.asarray(strength)


@_once_per_run
def approach(run: Trajectory) -> Array:
    """Approach speed in m/s of each contact in the log at its onset, (m,).

    It is negative for balls that separate at the onset.
    """
    return np.asarray(run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1])


@dataclass(frozen=True, eq=False)
class Components:
    """Components of the contact graph of two runs.

    Attributes
    ----------
    count : int
        Number of components.
    of_pair, of_ball : (n-1,), (n,) arrays of int
        Component of each pair and of each body. The value is `count` for pairs that never touch, for balls that never
        touch anything, and for walls.
    """

    count: int
    of_pair: Any
    of_ball: Any

    def largest(self, of_pairs: Array, of_balls: Array | None = None) -> Array:
        """Largest value over the pairs and balls of each component, (count,), at least 0.

        nan is ignored.
        """
        result = np.zeros(self.count + 1)
        np.fmax.at(result, self.of_pair, of_pairs)
        if of_balls is not None:
            np.fmax.at(result, self.of_ball, of_balls)
        return result[:-1]

    def total(self, of_balls: Array) -> Array:
        """Sum of a quantity over the balls of each component, (count,). nan is ignored."""
        return np.asarray(np.bincount(self.of_ball, np.nan_to_num(of_balls), self.count + 1)[:-1], float)

    def weight(self, soft: Trajectory) -> Array:
        """Speed v_g = a·t_c(v_g) in m/s that weight gives a ball in a contact, (n-1,).

        a is the largest |closing acceleration| of a pair of the component by weight and constant forces: g at a floor
        or ceiling, 0 if all balls fall together. v_g is at most a times the length of the run. All pairs of a component
        get the largest v_g of its pairs, and pairs that never touch get 0.
        """
        # `of_pair` is `count` for pairs that never touch: the appended 0
        closing = np.append(self.largest(np.abs(soft.scene.closing_acceleration)), 0.0)[self.of_pair]
        limit = closing * float(soft.time[-1] - soft.time[0])
        return np.asarray(np.append(self.largest(np.fmin(_sagging(soft, closing), limit)), 0.0)[self.of_pair])


def components(hard: Trajectory, soft: Trajectory) -> Components:
    """Divide the balls of two runs into components.

    Neighbouring pairs belong to the same component if each has a contact in at least one of the runs.
    """
    scene, touches = hard.scene, (counts(hard) + counts(soft)) > 0
    # number the sequences of consecutive pairs with contacts: a pair counts only if the pair before has no contact
    of_pair = touches.cumsum() - 1
    of_pair[1:] -= (touches[1:] & touches[:-1]).cumsum()
    count = int(of_pair[-1]) + 1
    if scene.ring and count > 1 and touches[0] and touches[-1]:  # first and last are one component, around the ring
        count -= 1
        of_pair[of_pair == count] = 0
    of_pair[~touches] = count  # the number `count` means: in no component
    of_ball = np.full(scene.n, count)
    for of_body in scene.bodies(np.flatnonzero(touches)):
        of_ball[of_body] = of_pair[touches]
    of_ball[scene.is_wall] = count
    return Components(count, of_pair, of_ball)


def units(hard: Trajectory, soft: Trajectory, parts: Components, weight: Array) -> Array:
    """Unit U of the error in m/s of each component, (count,).

    U is the largest approach speed at the onset of a contact in either run. A contact that does not begin with an
    approach, such as a contact of touching balls, contributes its separation speed instead. U is at least the speed
    that weight gives a ball during a contact (`weight`, see `Components.weight`), and larger than rounding errors.
    """
    speed = weight.copy()
    for run in (hard, soft):
        log = run.contacts
        parting = log["v_out"][:, 1] - log["v_out"][:, 0]
        parting[(approach(run) > 0.0) | ~np.isfinite(parting)] = 0.0
        np.maximum.at(speed, log["pair"], np.maximum(approach(run), parting))
    scale = max([float(np.abs(run.contacts["v_in"]).max(initial=0.0)) for run in (hard, soft)])
    return np.maximum(parts.largest(speed), max(VELOCITY_ROUNDING_ERROR * scale, np.finfo(float).tiny))


def _sagging(soft: Trajectory, acceleration: Array) -> Array:
    """Speed v in m/s that a ball gains by `acceleration` during a contact, (n-1,).

    It is the solution of v = a·t_c(v), found by iteration. It is 0 where t_c is not finite.

    Parameters
    ----------
    soft : Trajectory
        Soft run, whose force laws determine the contact duration t_c.
    acceleration : (n-1,) array
        Acceleration a of each pair in m/s².
    """
    if not acceleration.any():
        return acceleration
    speed, isolated_duration = acceleration, isolated_durations(soft)
    # the first guess has another unit, so only the limit does not depend on units
    for _ in range(MAX_WEIGHT_ITERATIONS):
        before, duration = speed, isolated_duration(np.arange(len(speed)), speed)
        speed = acceleration * np.where(np.isfinite(duration), duration, 0.0)
        if (np.abs(speed - before) <= np.finfo(float).resolution * speed).all():
            break
    return speed


def differences(one: Trajectory, other: Trajectory) -> Array:
    """Difference in m/s of each ball's final velocity between two runs, (n,).

    The final velocity is the velocity after the last contact. If the last contacts of a ball end at different times,
    gravity alone changes its velocity. The velocity in the first run is therefore also computed for the time of the
    second run, in free flight, and the smaller difference is used. The difference is nan for walls, and for contacts
    without end.

    Parameters
    ----------
    one, other : Trajectory
        The runs. `one` is a run of hard spheres.
    """
    (u, end), (v, other_end) = leaving_velocities_and_times(one), leaving_velocities_and_times(other)
    difference = np.fmin(np.abs(u - v), np.abs(velocities_after_flight(one, u, np.arange(len(u)), other_end - end) - v))
    difference[one.scene.is_wall] = math.nan
    return np.asarray(difference)


def velocities_after_flight(hard: Trajectory, u: Array, ball: Any, elapsed: Array, contact: Any = None) -> Array:
    """Velocity in m/s of hard balls after a free flight.

    Parameters
    ----------
    u : (m,) array
        Velocity of each ball in m/s at the start of the flight, when a contact ends.
    elapsed : (m,) array
        Duration of the flight in s. It can be negative.
    contact : tuple of arrays, optional
        Rows and sides of the contacts from which the balls leave, for pendula. Defaults to their last contacts.
    """
    scene, omega = hard.scene, hard.scene.pendulum
    if omega == 0.0:
        return np.asarray(u + scene.fall[ball] * elapsed)
    of_contacts, angle = np.zeros((len(hard.contacts), 2)), omega * elapsed
    y, v, now = scene.displacement.copy(), scene.velocity.copy(), np.full(scene.n, float(hard.time[0]))
    for row, at_onset in zip(hard.contacts, of_contacts, strict=True):
        for k, body in enumerate(scene.bodies(row["pair"])):
            phase = omega * (row["t_begin"] - now[body])
            at_onset[k] = y[body] = y[body] * np.cos(phase) + v[body] * np.sin(phase) / omega
            v[body], now[body] = row["v_out"][k], row["t_begin"]
    return np.asarray(
        u * np.cos(angle) - omega * (y[ball] if contact is None else of_contacts[contact]) * np.sin(angle))


def stuck_differences(one: Trajectory, other: Trajectory, weight: Array) -> Array:
    """Differences in m/s between two hard runs, for pairs that stick in both, (n-1,).

    The difference of a pair is the largest difference of its approach and separation speeds, contact by contact. A
    contact that only one run has contributes its full speeds. Pairs that do not stick in both runs have the difference
    0.

    Parameters
    ----------
    weight : (n-1,) array
        Approach speed in m/s up to which a contact belongs to balls that settle. Such contacts are ignored.
    """
    difference, runs = np.zeros(one.scene.n_pairs), (one, other)
    stuck = [(separation_speeds(run) == 0.0) & (sticking_speed(run) >= 0.0) for run in runs]
    for c in np.flatnonzero(np.logical_and(*stuck)).tolist():
        speeds = np.zeros((2, max(run.count(c) for run in runs), 2))
        for run, of_run in zip(runs, speeds, strict=True):
            of_run[: run.count(c)] = np.column_stack([approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"])])
        difference[c] = np.max(
            np.abs(np.subtract(*speeds)), where=speeds[:, :, :1].max(axis=0) > weight[c], initial=0.0)
    return difference


def counted(hard: Trajectory, soft: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Return a hard and a soft run without contacts at rounding level.

    A contact is removed if its strength is at most `MIN_CONTACT_STRENGTH` times the fastest approach speed of its
    component in either run.
    """
    runs, fastest_of_all = (hard, soft), max(approach(hard).max(initial=0.0), approach(soft).max(initial=0.0))
    weakest = min(strengths(hard).min(initial=np.inf), strengths(soft).min(initial=np.inf))
    if weakest > MIN_CONTACT_STRENGTH * fastest_of_all:
        return runs
    parts, speed = components(hard, soft), np.zeros(hard.scene.n_pairs)
    for run in runs:
        np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)[parts.of_pair]
    return without_weak_contacts(hard, fastest), without_weak_contacts(soft, fastest)


def without_weak_contacts(run: Trajectory, fastest: Array) -> Trajectory:
    """Return a run without the contacts that are at rounding level.

    The given run is not changed. A contact is left out if its strength (see `strengths`) is at most
    `MIN_CONTACT_STRENGTH` times `fastest`. Such a contact is an artefact: balls that an engine leaves with a relative
    speed of 1e-16 m/s meet again after about 1e12 s.

    Parameters
    ----------
    fastest : (n-1,) array
        Reference speed of each pair in m/s: the fastest approach of its component.
    """
    kept = strengths(run) > MIN_CONTACT_STRENGTH * fastest[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def order(run: Trajectory) -> int:
    """Return a checksum of the order in which contacts begin and end.

    Two runs with the same checksum have the same order. As long as a parameter does not change the order, outcomes
    depend smoothly on the parameter. Only the relative order of events of neighbouring pairs is included, for soft
    spheres also of pairs with one pair in between. The events are onsets and ends of contacts, and kinks in the path
    of a driven wall. An onset counts as a different event if the balls approach, touch at rest, or separate.
    Simultaneous events are ordered by pair.
    """
    log, scene, closing = run.contacts, run.scene, approach(run)
    begins = np.sign(np.round(closing / (float(np.abs(closing).max(initial=0.0)) or 1.0), 9))
    time, pair, kind = [log["t_begin"], log["t_end"]], [log["pair"]] * 2, [begins, np.full(len(log), 2.0)]
    for wall, motion in zip((0, scene.n_pairs - 1), scene.motions, strict=True):
        breaks = np.asarray(getattr(motion, "breaks", ()), float)
        time, pair, kind = [*time, breaks], [*pair, np.full(len(breaks), wall)], [*kind, np.full(len(breaks), 3.0)]
    events = np.column_stack([np.concatenate(column) for column in (time, pair, kind)])
    events = events[(events[:, 0] >= run.time[0]) & (events[:, 0] <= run.time[-1])]
    events = events[np.argsort(events[:, 0], kind="stable")]
    # replace times by ranks; simultaneous events share a rank
    events[:, 0] = np.cumsum(np.diff(events[:, 0], prepend=0.0) > SIMULTANEITY_TOLERANCE * (events[:, 0] - run.time[0]))
    shifts = range(2 if run.law is None else 3)
    groups = np.concatenate([(events[:, 1] - shift) % scene.n_pairs for shift in shifts])
    columns = np.column_stack([groups, np.tile(events, (len(shifts), 1))])
    # columns: group, rank, pair, kind; the rank itself is not part of the checksum
    return crc32(columns[np.lexsort((columns[:, 2], columns[:, 1], columns[:, 0]))][:, [0, 2, 3]].tobytes()) >> 1


check_argument_types(globals(), Trajectory, Components)
