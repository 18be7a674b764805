"""Outcomes of a run, read from its contact log, and differences of two runs.

Outcomes are the numbers of contacts, the separation speeds of pairs, and the velocities with which balls leave their
contacts. Balls that touch each other in either run form a component. Each component is compared separately.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from granular._engine.check import Array, typed
from granular.md.isolation import Durations
from granular.run.trajectory import Trajectory

ERROR_LIMIT = 0.01
"""Largest difference, over the unit of the error, at which outcomes agree."""
SIMULTANEITY_TOLERANCE = 1e-12
"""Collisions are simultaneous if closer than this share of the time elapsed.

Rounding errors decide their order.
"""
MIN_CONTACT_STRENGTH = 1e-12
"""Contacts weaker than this share of the fastest approach are ignored.

One contact leaves a rounding error of about 1e-15, and a thousand contacts leave this one.
"""
VELOCITY_ROUNDING_ERROR = 1e-13
"""Relative rounding error of a difference of two velocities."""
MAX_WEIGHT_ITERATIONS = 100
"""Limit on the iterations of v = a t_c(v).

For F = k ξ^p the error decreases by the factor (p - 1)/(p + 1) per iteration, 1/5 for Hertz spheres.
"""


@dataclass(frozen=True)
class PairOutcome:
    """Outcome of one pair under both engines, after its last contact that counts.

    Attributes
    ----------
    pair : int
        Number of the pair.
    hard_contacts, soft_contacts : int
        Number of contacts, without those at rounding level (`granular.comparison.outcome.without_rounding`).
    hard_v_rel, soft_v_rel : float
        Separation speed v[c+1] - v[c] in m/s at the end of the pair's last contact. nan without contacts.
    hard_t_f, soft_t_f : float
        Time in s of that end.
    ongoing : bool
        Whether the last soft contact was still running at `until` and was followed to its end. v_rel is nan if the pair
        comes to rest.
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

    The runs come from `granular.comparison.align.levelled`. `cut` is the soft run before it was continued.
    """
    ongoing = np.zeros(soft.scene.n_pairs, dtype=np.bool_)
    ongoing[cut.contacts["pair"][np.isnan(cut.contacts["t_end"])]] = True
    columns = [counts(hard), counts(soft), *separations(hard), *separations(soft), ongoing]
    n_hard, n_soft, hard_v, hard_t, soft_v, soft_t, open_ = (column.tolist() for column in columns)
    return tuple(map(PairOutcome, range(len(n_hard)), n_hard, n_soft, hard_v, soft_v, hard_t, soft_t, open_))


def counts(run: Trajectory) -> Any:
    """Number of contacts of every pair, shape (n-1,)."""
    return np.diff(run.by_pair[1])


def partings(run: Trajectory) -> Array:
    """Separation speed v′ in m/s after the last contact of every pair, or nan."""
    return separations(run)[0]


def sticking(run: Trajectory) -> float:
    """Speed in m/s up to which separating hard spheres are at rest.

    It is `merge_below`, 0 if the collision rule itself merges balls, and -1 if no balls merge. Balls that leave one
    instant with the same velocity do not stick.
    """
    rests = run.stats.get("merged", 0) + run.stats.get("settled", 0) > 0
    return float(run.stats.get("merge_below", 0.0 if rests else -1.0))


def separations(run: Trajectory) -> tuple[Array, Array]:
    """Separation speed in m/s and time in s of the last contact end of every pair.

    Both are nan without a contact.
    """
    order, edge = run.by_pair
    met = np.flatnonzero(np.diff(edge))
    last = run.contacts[order[edge[met + 1] - 1]]
    speed, time = np.full((2, len(edge) - 1), math.nan)
    speed[met], time[met] = last["v_out"][:, 1] - last["v_out"][:, 0], last["t_end"]
    return speed, time


def leaving(run: Trajectory) -> tuple[Array, Array]:
    """Velocity u in m/s after the last contact end of each body, and its time in s.

    Both have shape (n,). Without contacts they are the initial velocity and the start time. They are nan if the last
    contact to begin has no end.
    """
    u, at = run.scene.velocity.copy(), np.full(run.scene.n, float(run.time[0]))
    body, row, side = last_contacts(run, np.arange(len(run.contacts)), np.zeros(len(run.contacts), np.int64))
    u[body], at[body] = run.contacts["v_out"][row, side], run.contacts["t_end"][row]
    return u, at


def last_contacts(run: Trajectory, rows: Any, group: Any) -> tuple[Any, Any, Any]:
    """Return, for each body and group of contacts, the contact that ends last.

    `rows` are rows of the contact log, `group` the number of the group of each. The result contains the number
    ``group * n + body``, the row, and the side of the body in the pair. A contact without end is the last one.
    """
    key = np.repeat(group, 2) * run.scene.n + np.column_stack(run.scene.bodies(run.contacts["pair"][rows])).ravel()
    order = np.lexsort((np.repeat(run.contacts["t_end"][rows], 2), key))
    last = order[np.append(np.diff(key[order]) != 0, np.ones(min(len(order), 1), np.bool_))]
    return key[last], rows[last // 2], last % 2


def leaving_velocities(run: Trajectory) -> Array:
    """Velocity u in m/s with which each body leaves its last contact, see `leaving`."""
    return leaving(run)[0]


def at_once(hard: Trajectory) -> Trajectory:
    """Combine the simultaneous collisions of each pair of hard spheres.

    The order of collisions within an instant follows from the tie rule and has no physical meaning. A pair therefore
    separates with the velocities that its bodies have after all collisions of the instant. Collisions within
    `SIMULTANEITY_TOLERANCE` of the elapsed time are simultaneous.
    """
    log = hard.contacts
    if len(log) < 2:
        return hard
    time, rows = log["t_begin"], np.arange(len(log))
    instant = np.cumsum(np.diff(time, prepend=time[0]) > SIMULTANEITY_TOLERANCE * (time - hard.time[0]))
    after = log["v_out"].copy()
    body, k = np.column_stack(hard.scene.bodies(log["pair"])).ravel(), np.repeat(rows, 2)
    by_body = np.lexsort((k, instant[k], body))
    ends = np.append((np.diff(body[by_body]) != 0) | (np.diff(instant[k][by_body]) != 0), True)
    final = by_body[np.flatnonzero(ends)[np.cumsum(np.append(False, ends[:-1]))]]  # its body's last of the instant
    after.ravel()[by_body] = log["v_out"].ravel()[final]
    order = np.lexsort((rows, instant, log["pair"]))
    again = np.append(False, (np.diff(log["pair"][order]) == 0) & (np.diff(instant[order]) == 0))
    if not again.any() and (after == log["v_out"]).all():
        return hard
    log = log.copy()
    log["v_out"] = after
    return replace(hard, contacts=log[np.sort(order[~again])])


def energy_at_hand(run: Trajectory) -> Array:
    """Energy in J of every sample, with heights measured between surfaces, (T,).

    It is `Trajectory.energy` with the heights of points above the initial position of body 0. Radii are subtracted as
    in `granular.measures.height`, so that balls lying on a floor have no potential energy.
    """
    scene, balls = run.scene, ~run.scene.is_wall
    below = (run.position[0] - np.append(0.0, run.gap[0].cumsum())[: scene.n])[balls]  # a ring has a gap more
    fixed = scene.gravity * (scene.mass[balls] @ below)
    if scene.external_force is not None:
        fixed -= scene.external_force[balls] @ below
    return np.asarray(run.energy() - fixed)


def energy_left(run: Trajectory) -> float:
    """Share E/E0 of the energy of `energy_at_hand` at the end; nan for E0 = 0."""
    energy = energy_at_hand(run)
    return float(energy[-1] / energy[0]) if energy[0] > 0.0 else math.nan


def strengths(run: Trajectory) -> Array:
    """Strength in m/s of each contact in the log.

    It is the larger one of the approach speed and of impulse / m_eff, because touching balls have no approach speed.
    """
    log = run.contacts
    return np.asarray(np.maximum(approach(run), log["impulse"] / run.scene.pairs.m_eff[log["pair"]]))


def approach(run: Trajectory) -> Array:
    """Approach speeds in m/s of the contacts in the log at their onset."""
    return np.asarray(run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1])


@dataclass(frozen=True, eq=False)
class Components:
    """Components of the contact graph of two runs.

    Attributes
    ----------
    count : int
        Number of components.
    of_pair, of_ball : (n-1,), (n,) arrays of int
        Component of each pair and of each ball. It is `count` for pairs that never touch, for balls that never touch
        another ball, and for walls.
    """

    count: int
    of_pair: Any
    of_ball: Any

    def largest(self, of_pairs: Array, of_balls: Array | None = None) -> Array:
        """Largest value over the pairs, and the balls, of each component, (count,).

        nan is ignored.
        """
        most = np.zeros(self.count + 1)
        np.fmax.at(most, self.of_pair, of_pairs)
        if of_balls is not None:
            np.fmax.at(most, self.of_ball, of_balls)
        return most[:-1]

    def total(self, of_balls: Array) -> Array:
        """Sum of values of the balls of each component, (count,); nan is ignored."""
        return np.asarray(np.bincount(self.of_ball, np.nan_to_num(of_balls), self.count + 1)[:-1], float)

    def weight(self, soft: Trajectory) -> Array:
        """Speed v_g = a·t_c in m/s that weight and forces give a ball during a contact.

        Returned for each pair, as the largest value of its component. a is the largest acceleration with which they
        close a gap of the component: g at a floor, 0 where all balls fall together. v_g is at most the speed gained in
        the whole run.
        """
        closing = np.append(self.largest(np.abs(soft.scene.pull)), 0.0)[self.of_pair]
        most = closing * float(soft.time[-1] - soft.time[0])
        return np.asarray(np.append(self.largest(np.fmin(_sagging(soft, closing), most)), 0.0)[self.of_pair])


def components(hard: Trajectory, soft: Trajectory) -> Components:
    """Return the components: neighbouring pairs with contacts are connected."""
    scene, met = hard.scene, (counts(hard) + counts(soft)) > 0
    of_pair = np.cumsum(met) - 1
    of_pair[1:] -= np.cumsum(met[1:] & met[:-1])
    count = int(of_pair[-1]) + 1
    if scene.ring and count > 1 and met[0] and met[-1]:  # they are one, around the ring
        count -= 1
        of_pair[of_pair == count] = 0
    of_pair[~met] = count
    of_ball = np.full(scene.n, count)
    for of_body in scene.bodies(np.flatnonzero(met)):
        of_ball[of_body] = of_pair[met]
    of_ball[scene.is_wall] = count
    return Components(count, of_pair, of_ball)


def units(hard: Trajectory, soft: Trajectory, parts: Components) -> Array:
    """Unit U of the error in m/s of each component.

    U is the largest approach speed, at the onset of contacts and during them, in either run. A contact that begins at
    rest, such as one of touching balls, later closes at about its separation speed, which is used instead. U is at
    least the speed that weight gives a ball during a contact, and larger than rounding errors.
    """
    speed = parts.weight(soft)
    for run in (hard, soft):
        log = run.contacts
        parting = np.where(approach(run) > 0.0, 0.0, np.nan_to_num(log["v_out"][:, 1] - log["v_out"][:, 0]))
        np.maximum.at(speed, log["pair"], np.maximum(approach(run), parting))
    scale = max(float(np.abs(run.contacts["v_in"]).max(initial=0.0)) for run in (hard, soft))
    return np.maximum(parts.largest(speed), max(VELOCITY_ROUNDING_ERROR * scale, np.finfo(float).tiny))


def _sagging(soft: Trajectory, acceleration: Array) -> Array:
    """Speed v = a t_c(v) in m/s that an acceleration gives in a contact, per pair."""
    if not acceleration.any():
        return acceleration
    speed, alone = acceleration, Durations(soft.law or (), soft.scene)
    # the first guess has another unit, so only the limit does not depend on units
    for _ in range(MAX_WEIGHT_ITERATIONS):
        before, lasting = speed, alone(np.arange(len(speed)), speed)
        speed = acceleration * np.where(np.isfinite(lasting), lasting, 0.0)
        if (np.abs(speed - before) <= np.finfo(float).resolution * speed).all():
            break
    return speed


def differences(one: Trajectory, other: Trajectory) -> Array:
    """Differences in m/s of the velocities with which balls leave two runs, (n,).

    Each ball is compared after its last contact in both runs. The ball of `one`, a run of hard spheres, can also be
    carried in free flight to the time of the other, and the smaller difference is used: contacts that end at different
    times under gravity do not make a difference. It is nan where a contact has no end.
    """
    (u, at), (v, then) = leaving(one), leaving(other)
    apart = np.fmin(np.abs(u - v), np.abs(carried(one, u, np.arange(len(u)), then - at) - v))
    apart[one.scene.is_wall] = math.nan
    return np.asarray(apart)


def carried(hard: Trajectory, u: Array, ball: Any, elapsed: Array, contact: Any = None) -> Array:
    """Velocities in m/s of hard balls after a free flight of `elapsed` s.

    The balls leave with velocity `u` their last contacts, or the contacts given by rows and sides `contact`.
    """
    scene, omega = hard.scene, hard.scene.pendulum
    if omega == 0.0:
        return np.asarray(u + scene.fall[ball] * elapsed)
    of_contacts, turn = np.zeros((len(hard.contacts), 2)), omega * elapsed
    y, v, now = scene.displacement.copy(), scene.velocity.copy(), np.full(scene.n, float(hard.time[0]))
    for row, at in zip(hard.contacts, of_contacts, strict=True):
        for k, body in enumerate(scene.bodies(row["pair"])):
            way = omega * (row["t_begin"] - now[body])
            at[k] = y[body] = y[body] * np.cos(way) + v[body] * np.sin(way) / omega
            v[body], now[body] = row["v_out"][k], row["t_begin"]
    return np.asarray(u * np.cos(turn) - omega * (y[ball] if contact is None else of_contacts[contact]) * np.sin(turn))


def stuck_apart(one: Trajectory, other: Trajectory, weight: Array) -> Array:
    """Differences in m/s of two hard runs in pairs that stick in both, per pair.

    The approach and separation speeds are compared contact by contact. A contact present in only one run contributes
    its full speed. Contacts of balls that settle, not faster than `weight`, are ignored.
    """
    apart, runs = np.zeros(one.scene.n_pairs), (one, other)
    stuck = [(partings(run) == 0.0) & (sticking(run) >= 0.0) for run in runs]
    for c in np.flatnonzero(np.logical_and(*stuck)).tolist():
        speeds = np.zeros((2, max(run.count(c) for run in runs), 2))
        for run, of in zip(runs, speeds, strict=True):
            of[: run.count(c)] = np.column_stack([approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"])])
        apart[c] = np.max(np.abs(np.subtract(*speeds)), where=speeds[:, :, :1].max(axis=0) > weight[c], initial=0.0)
    return apart


def counted(hard: Trajectory, soft: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Remove contacts at rounding level from both runs.

    They are weaker than `MIN_CONTACT_STRENGTH` times the fastest approach of their component in either run.
    """
    parts, speed = components(hard, soft), np.zeros(hard.scene.n_pairs)
    for run in (hard, soft):
        np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)[parts.of_pair]
    return without_rounding(hard, fastest), without_rounding(soft, fastest)


def without_rounding(run: Trajectory, fastest: Array) -> Trajectory:
    """Remove contacts of a run that are at rounding level.

    They are weaker than `MIN_CONTACT_STRENGTH` times `fastest` (n-1,) in m/s. Balls that an engine leaves with a
    relative speed of 1e-16 m/s would meet again after about 1e12 s.
    """
    kept = strengths(run) > MIN_CONTACT_STRENGTH * fastest[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def order(run: Trajectory) -> int:
    """Return a number that identifies the order in which contacts begin and end.

    Outcomes depend smoothly on a parameter between runs with the same number. The order concerns events of
    neighbouring pairs, for soft spheres also of next but one pairs, and of the breaks of a wall's path. The order of
    distant events does not matter. A contact begins with a touch, with residual overlap, or at rest. Of simultaneous
    events the lower pair is first.
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
    events[:, 0] = np.cumsum(np.diff(events[:, 0], prepend=0.0) > SIMULTANEITY_TOLERANCE * (events[:, 0] - run.time[0]))
    near = range(2 if run.law is None else 3)
    groups = np.concatenate([(events[:, 1] - shift) % scene.n_pairs for shift in near])
    found = np.column_stack([groups, np.tile(events, (len(near), 1))])
    return crc32(found[np.lexsort((found[:, 2], found[:, 1], found[:, 0]))][:, [0, 2, 3]].tobytes()) >> 1


typed(globals(), Trajectory, Components)
