"""What a run comes to, read from its contact log: how pairs part, how balls leave, and how far two runs differ.

Balls that touch each other in either of two runs form a component, and each component is judged on its own.
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

SAME = 0.01
"""Outcomes closer than this share of the fastest impact are called the same."""
INSTANT = 1e-12
"""Collisions closer than this share of the time since the start are in one instant: rounding decides which is first."""
FAINT = 1e-12
"""Impacts weaker than this share of the fastest are rounding: a contact leaves some 1e-15, a thousand leave this."""
ROUNDING = 1e-13
"""Speeds below this share of the velocities that they are differences of are rounding."""
ROUNDS = 100
"""Iterations of v = a t_c(v) at most. In F = k ξ^p an error decreases by (p - 1)/(p + 1) each: 1/5 of Hertz spheres."""


@dataclass(frozen=True)
class PairOutcome:
    """What one pair has done under both engines by the end of its last contact that counts.

    Attributes
    ----------
    pair : int
        Number of the pair.
    hard_contacts, soft_contacts : int
        Number of contacts, without those that are rounding (`granular.comparison.outcome.without_rounding`).
    hard_v_rel, soft_v_rel : float
        Separation speed v[c+1] - v[c] in m/s at the end of the pair's last contact; nan without contacts.
    hard_t_f, soft_t_f : float
        When that was, in s.
    ongoing : bool
        The last soft contact was still running at `until` and was followed to its end (v_rel is nan if it rests).
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
    """Outcome of every pair of two runs that are `end_time.levelled`; `cut` is the soft run as it was cut."""
    ongoing = np.zeros(soft.scene.n_pairs, dtype=np.bool_)
    ongoing[cut.contacts["pair"][np.isnan(cut.contacts["t_end"])]] = True
    columns = [counts(hard), counts(soft), *separations(hard), *separations(soft), ongoing]
    n_hard, n_soft, hard_v, hard_t, soft_v, soft_t, open_ = (column.tolist() for column in columns)
    return tuple(map(PairOutcome, range(len(n_hard)), n_hard, n_soft, hard_v, soft_v, hard_t, soft_t, open_))


def counts(run: Trajectory) -> Any:
    """Number of contacts of every pair, shape (n-1,)."""
    return np.diff(run.by_pair[1])


def partings(run: Trajectory) -> Array:
    """Separation speed v′ in m/s at the end of the last contact of every pair; nan without one."""
    return separations(run)[0]


def sticking(run: Trajectory) -> float:
    """Speed in m/s up to which pairs of hard spheres that part are at rest: `merge_below`, 0 if the rule itself merges
    balls, -1 if none merge. Balls may also leave one instant with the same velocity, and do not stick."""
    rests = run.stats.get("merged", 0) + run.stats.get("settled", 0) > 0
    return float(run.stats.get("merge_below", 0.0 if rests else -1.0))


def separations(run: Trajectory) -> tuple[Array, Array]:
    """Separation speed in m/s and time in s at the end of the last contact of every pair; nan without one."""
    order, edge = run.by_pair
    met = np.flatnonzero(np.diff(edge))
    last = run.contacts[order[edge[met + 1] - 1]]
    speed, time = np.full((2, len(edge) - 1), math.nan)
    speed[met], time[met] = last["v_out"][:, 1] - last["v_out"][:, 0], last["t_end"]
    return speed, time


def leaving(run: Trajectory) -> tuple[Array, Array]:
    """Velocity u in m/s with which each body leaves the last of its contacts that ends, and when in s, shapes (n,).

    The initial velocity, at the start, without contacts; nan where the last contact to begin has no end.
    """
    u, at = run.scene.velocity.copy(), np.full(run.scene.n, float(run.time[0]))
    body, row, side = last_contacts(run, np.arange(len(run.contacts)), np.zeros(len(run.contacts), np.int64))
    u[body], at[body] = run.contacts["v_out"][row, side], run.contacts["t_end"][row]
    return u, at


def last_contacts(run: Trajectory, rows: Any, group: Any) -> tuple[Any, Any, Any]:
    """Return the number ``group * n + body`` of each body in each group of some rows of the log, and the row and side
    of its contact that ends last; one without end is the last."""
    key = np.repeat(group, 2) * run.scene.n + np.column_stack(run.scene.bodies(run.contacts["pair"][rows])).ravel()
    order = np.lexsort((np.repeat(run.contacts["t_end"][rows], 2), key))
    last = order[np.append(np.diff(key[order]) != 0, np.ones(min(len(order), 1), np.bool_))]
    return key[last], rows[last // 2], last % 2


def leaving_velocities(run: Trajectory) -> Array:
    """Velocity u in m/s with which each body leaves, see `leaving`."""
    return leaving(run)[0]


def at_once(hard: Trajectory) -> Trajectory:
    """The run of hard spheres with the collisions of a pair in one instant as one, at whose end the instant is over.

    What a rule does within an instant, such as ball after ball, is no physics: a pair parts with the velocities that
    its bodies have after all collisions of that instant. Collisions within `INSTANT` of the time are in one.
    """
    log = hard.contacts
    if len(log) < 2:
        return hard
    time, rows = log["t_begin"], np.arange(len(log))
    instant = np.cumsum(np.diff(time, prepend=time[0]) > INSTANT * (time - hard.time[0]))
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
    """Energy in J, shape (T,), as `Trajectory.energy` but for heights: those of points above body 0 as it stood at the
    start. Radii are taken out, as in `granular.measures.height`; balls that lie on a floor have none."""
    scene, balls = run.scene, ~run.scene.is_wall
    below = (run.position[0] - np.append(0.0, run.gap[0].cumsum())[: scene.n])[balls]  # a ring has a gap more
    fixed = scene.gravity * (scene.mass[balls] @ below)
    if scene.external_force is not None:
        fixed -= scene.external_force[balls] @ below
    return np.asarray(run.energy() - fixed)


def energy_left(run: Trajectory) -> float:
    """E/E0, the share of its energy that a run has left at its end, see `energy_at_hand`; nan if it begins without."""
    energy = energy_at_hand(run)
    return float(energy[-1] / energy[0]) if energy[0] > 0.0 else math.nan


def strengths(run: Trajectory) -> Array:
    """How hard each contact of the log is, in m/s: by approach, and by impulse / m_eff, as touching balls have none."""
    log = run.contacts
    return np.asarray(np.maximum(approach(run), log["impulse"] / run.scene.pairs.m_eff[log["pair"]]))


def approach(run: Trajectory) -> Array:
    """Speeds in m/s at which the contacts of the log close at their onset."""
    return np.asarray(run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1])


@dataclass(frozen=True, eq=False)
class Components:
    """Which component pairs and balls belong to.

    Attributes
    ----------
    count : int
        How many there are.
    of_pair, of_ball : (n-1,), (n,) arrays of int
        Number of the component; `count` for pairs that never touch, for balls that touch none, and for walls.
    """

    count: int
    of_pair: Any
    of_ball: Any

    def largest(self, of_pairs: Array, of_balls: Array | None = None) -> Array:
        """Largest of some values of the pairs, and of the balls, of each component, (count,); nan does not count."""
        most = np.zeros(self.count + 1)
        np.fmax.at(most, self.of_pair, of_pairs)
        if of_balls is not None:
            np.fmax.at(most, self.of_ball, of_balls)
        return most[:-1]

    def total(self, of_balls: Array) -> Array:
        """Sum of some values of the balls of each component, (count,); nan does not count."""
        return np.asarray(np.bincount(self.of_ball, np.nan_to_num(of_balls), self.count + 1)[:-1], float)

    def weight(self, soft: Trajectory) -> Array:
        """Speed a t_c in m/s that weight and forces give a ball in a contact, per pair the largest of its component.

        a is the largest acceleration at which they close one of its gaps: g at a floor, 0 where all balls fall alike.
        No more than it gives in the whole run.
        """
        closing = np.append(self.largest(np.abs(soft.scene.pull)), 0.0)[self.of_pair]
        most = closing * float(soft.time[-1] - soft.time[0])
        return np.asarray(np.append(self.largest(np.fmin(_sagging(soft, closing), most)), 0.0)[self.of_pair])


def components(hard: Trajectory, soft: Trajectory) -> Components:
    """Find the components of two runs of one scene: neighbouring pairs that have contacts belong together."""
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
    """Largest closing speed U in m/s of each component, during contacts and at their onset, in either run.

    A contact that begins at rest, as of balls that touch, closes later at about the speed with which it parts. U is
    at least what weight gives a ball while a contact lasts, and more than rounding.
    """
    speed = parts.weight(soft)
    for run in (hard, soft):
        log = run.contacts
        parting = np.where(approach(run) > 0.0, 0.0, np.nan_to_num(log["v_out"][:, 1] - log["v_out"][:, 0]))
        np.maximum.at(speed, log["pair"], np.maximum(approach(run), parting))
    scale = max(float(np.abs(run.contacts["v_in"]).max(initial=0.0)) for run in (hard, soft))
    return np.maximum(parts.largest(speed), max(ROUNDING * scale, np.finfo(float).tiny))


def _sagging(soft: Trajectory, acceleration: Array) -> Array:
    """Speed v = a t_c(v) in m/s that an acceleration a gives a ball in the contact that begins with it, per pair."""
    if not acceleration.any():
        return acceleration
    speed, alone = acceleration, Durations(soft.law or (), soft.scene)
    for _ in range(ROUNDS):  # the first guess has another unit, so only the limit does not depend on units
        before, lasting = speed, alone(np.arange(len(speed)), speed)
        speed = acceleration * np.where(np.isfinite(lasting), lasting, 0.0)
        if (np.abs(speed - before) <= np.finfo(float).resolution * speed).all():
            break
    return speed


def differences(one: Trajectory, other: Trajectory) -> Array:
    """Differences in m/s of the velocities with which every ball leaves its last contact in two runs, shape (n,).

    A ball is compared where its last contacts end, or `one`, of hard spheres, carried in free flight to where those of
    the other end, whichever is less: runs that end a contact some time apart under gravity are not that far apart. nan
    where a contact has no end.
    """
    (u, at), (v, then) = leaving(one), leaving(other)
    apart = np.fmin(np.abs(u - v), np.abs(carried(one, u, np.arange(len(u)), then - at) - v))
    apart[one.scene.is_wall] = math.nan
    return np.asarray(apart)


def carried(hard: Trajectory, u: Array, ball: Any, elapsed: Array, contact: Any = None) -> Array:
    """Velocities in m/s of hard balls in free flight, some time in s after they leave with `u`: by default their last
    contacts, else those with the rows and sides `contact`."""
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
    """How far in m/s two hard runs differ in pairs that end up stuck in both, contact by contact, shape of the gaps;
    what one run has alone counts in full, but for contacts of balls that settle."""
    apart, runs = np.zeros(one.scene.n_pairs), (one, other)
    stuck = [(partings(run) == 0.0) & (sticking(run) >= 0.0) for run in runs]
    for c in np.flatnonzero(np.logical_and(*stuck)).tolist():
        speeds = np.zeros((2, max(run.count(c) for run in runs), 2))
        for run, of in zip(runs, speeds, strict=True):
            of[: run.count(c)] = np.column_stack([approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"])])
        apart[c] = np.max(np.abs(np.subtract(*speeds)), where=speeds[:, :, :1].max(axis=0) > weight[c], initial=0.0)
    return apart


def counted(hard: Trajectory, soft: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Both runs without contacts that are rounding beside the fastest of either in their component."""
    parts, speed = components(hard, soft), np.zeros(hard.scene.n_pairs)
    for run in (hard, soft):
        np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)[parts.of_pair]
    return without_rounding(hard, fastest), without_rounding(soft, fastest)


def without_rounding(run: Trajectory, fastest: Array) -> Trajectory:
    """The run with only those contacts in its log that are more than rounding beside one at `fastest` (n-1,) m/s.

    Balls that an engine leaves with a relative speed of 1e-16 m/s meet again after some 1e12 s: that is nothing.
    """
    kept = strengths(run) > FAINT * fastest[run.contacts["pair"]]
    return run if kept.all() else replace(run, contacts=run.contacts[kept])


def order(run: Trajectory) -> int:
    """A number that stands for the order in which contacts of pairs near each other begin and end, and how.

    Between two runs with the same number, of scenes that differ a little, outcomes are smooth. Events of a pair stand
    beside those of the next pair, of soft spheres also of the next but one, and beside the breaks of a wall's path;
    what happens farther away may change its turn. A contact begins by a touch, or again while the overlap is still
    there, or at rest. Of events in one instant the lower pair is first.
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
    events[:, 0] = np.cumsum(np.diff(events[:, 0], prepend=0.0) > INSTANT * (events[:, 0] - run.time[0]))
    near = range(2 if run.law is None else 3)
    groups = np.concatenate([(events[:, 1] - shift) % scene.n_pairs for shift in near])
    found = np.column_stack([groups, np.tile(events, (len(near), 1))])
    return crc32(found[np.lexsort((found[:, 2], found[:, 1], found[:, 0]))][:, [0, 2, 3]].tobytes()) >> 1


typed(globals(), Trajectory, Components)
