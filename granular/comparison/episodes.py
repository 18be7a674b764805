"""Episodes of linked contacts, and the velocities with which balls leave them.

Two contacts of soft spheres are linked if they share a ball and overlap in time. An episode is a group of contacts
joined by such links. States within an episode are intermediate. The velocities with which balls leave an episode are
outcomes, which are compared. A ball also leaves an episode before each long free flight between two of its contacts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine.check import Array, typed
from granular.comparison.outcome import (
    SIMULTANEITY_TOLERANCE,
    approach,
    carried,
    counts,
    last_contacts,
    partings,
    sticking,
)
from granular.run.trajectory import Trajectory
from granular.scene import Scene

LONG_FLIGHT = 5.0
"""Flight time, over the duration of the contact before it, to be compared."""


@dataclass(frozen=True)
class Departure:
    """A ball that leaves an episode of contacts, in both runs.

    Attributes
    ----------
    ball, episode : int
        The ball, and the episode, numbered from 0 by onset.
    contacts : int
        Number of soft contacts in the episode.
    pairs : tuple of int
        The pairs of these contacts, in ascending order.
    hard_t, soft_t : float
        Time in s at which the ball's last contact ends.
    hard_velocity, soft_velocity : float
        Velocity of the ball in m/s at that time.
    difference : float
        Difference of the velocities divided by the unit U of the component. The hard ball is first carried in free
        flight towards `soft_t` if this reduces the difference.
    """

    ball: int
    episode: int
    contacts: int
    pairs: tuple[int, ...]
    hard_t: float
    soft_t: float
    hard_velocity: float
    soft_velocity: float
    difference: float


class Departures:
    """All departures of balls from episodes that occur in both runs.

    Parameters
    ----------
    hard, soft : Trajectory
        Runs continued to equal contact counts, see `granular.comparison.align.levelled`.
    weight : (n-1,) array
        Speed in m/s that weight gives a ball during a contact, see `granular.comparison.outcome.Components.weight`.
    lag : callable
        ``lag(pair, speed)``: time in s by which contacts of these pairs at these approach speeds may be late.

    Attributes
    ----------
    episode : array of int
        Episode of every soft contact, numbered from 0 by onset.
    ball, of : arrays of int
        Ball and episode of every departure.
    time, velocity : (2, m) arrays
        Time in s and velocity in m/s of every departure, hard and soft.
    apart : (m,) array
        Difference in m/s of every departure. It is nan for a ball that is compared only at rest.
    """

    def __init__(self, hard: Trajectory, soft: Trajectory, weight: Array, lag: Callable[[Any, Array], Array]) -> None:
        scene, mate = hard.scene, mates(hard, soft)
        met = mate >= 0
        fastest = approach(soft)
        np.maximum.at(fastest, mate[met], approach(hard)[met])
        compared = ~resting_in_both(hard, soft)[soft.contacts["pair"]] | (
            fastest > weight[soft.contacts["pair"]])  # the others are contacts of balls that settle
        self.soft, self.episode = soft, episodes(soft, compared)
        rows = np.flatnonzero(met & np.append(compared, False)[mate])
        left = [last_contacts(hard, rows, self.episode[mate[rows]]),
                last_contacts(soft, np.flatnonzero(compared), self.episode[compared])]
        found = np.intersect1d(left[0][0], left[1][0], assume_unique=True, return_indices=True)[1:]
        (row, side), (last, flank) = ([of[i] for of in some] for (_, *some), i in zip(left, found, strict=True))
        twice = np.isin(np.arange(len(soft.contacts)), mate)
        duration = (soft.contacts["t_end"] - soft.contacts["t_begin"])[mate[rows], None]
        free = np.minimum(flights(hard, met)[rows], flights(soft, twice)[mate[rows]])
        k, of = np.nonzero(free > LONG_FLIGHT * duration)
        row, side, last, flank = map(np.append, (row, side, last, flank), (rows[k], of, mate[rows[k]], of))
        self.of = self.episode[last]
        self.ball = np.array(scene.bodies(soft.contacts["pair"][last]))[flank, np.arange(len(last))]
        self.time = np.array([hard.contacts["t_end"][row], soft.contacts["t_end"][last]])
        self.velocity = np.array([hard.contacts["v_out"][row, side], soft.contacts["v_out"][last, flank]])
        (begin, end), (u, v) = self.time, self.velocity
        self.apart = np.abs(u - v)
        if scene.fall.any() or scene.pendulum > 0.0:
            late = lag(hard.contacts["pair"][row], approach(hard)[row])
            free = carried(hard, u, self.ball, np.clip(end - begin, -late, late), (row, side))
            self.apart = np.fmin(self.apart, np.abs(free - v))
        self.apart[scene.is_wall[self.ball] | (end > _held_since(soft)[self.ball])] = np.nan

    def departure(self, k: int, unit: float) -> Departure:
        """Return the k-th departure, with its difference divided by `unit` in m/s."""
        pair = self.soft.contacts["pair"][self.episode == self.of[k]]
        (begin, end), (u, v) = self.time[:, k].tolist(), self.velocity[:, k].tolist()
        return Departure(int(self.ball[k]), int(self.of[k]), len(pair), tuple(np.unique(pair).tolist()), begin, end,
                         u, v, float(self.apart[k]) / unit)


def episodes(soft: Trajectory, compared: Any) -> Any:
    """Return the episode of every contact in the log, numbered from 0 by onset.

    If two contacts of neighbouring pairs overlap in time, the later one begins during the last contact of the other
    pair that has begun by then. Every contact therefore has at most one such link on either side. Contacts without
    end, and contacts that are not `compared`, are episodes of their own.
    """
    log, scene, size = soft.contacts, soft.scene, len(soft.contacts)
    onset, links = np.empty(size, np.int64), []
    onset[np.argsort(log["t_begin"], kind="stable")] = np.arange(size)
    begin, end, pair = log["t_begin"], np.where(compared, log["t_end"], np.nan), log["pair"]
    order = np.lexsort((onset, pair))
    key = (pair * size + onset)[order]
    for step in (-1, 1):
        beside = (pair + step) % scene.n_pairs if scene.ring else pair + step
        place = np.searchsorted(key, beside * size + onset) - 1
        other = order[place]
        linked = (place >= 0) & (pair[other] == beside) & (end[other] > begin) & (end == end)
        links.append(np.array([onset[linked], onset[other[linked]]]))
    return np.unique(_groups(size, *np.hstack(links)), return_inverse=True)[1][onset] if size else onset


def flights(run: Trajectory, met: Any) -> Array:
    """Free time in s of both bodies of each contact after its end, shape (m, 2).

    It is not positive if another contact of the body is running, or if the next contact is not in the other run
    (`met`). It is inf without a next contact. For all hard contacts of a body in one instant it is the flight after
    the instant.
    """
    log = run.contacts
    body = np.column_stack(run.scene.bodies(log["pair"])).ravel()
    begin, end = np.repeat(log["t_begin"], 2), np.repeat(log["t_end"], 2)
    by_begin, by_end = np.lexsort((begin, body)), np.lexsort((end, body))
    onset = np.where(np.repeat(met, 2), begin, -np.inf)[by_begin]
    # a body is free after its j-th end if its contact j + 1 is the next to begin: only then all before it are over
    free = np.append(onset[1:], np.inf)[: len(body)] - end[by_end]
    free[np.diff(body[by_end], append=-1) != 0] = np.inf
    if run.rule is not None:
        over = np.where(
            np.abs(free) > SIMULTANEITY_TOLERANCE * (end[by_end] - run.time[0]), np.arange(len(body)), len(body)
        )
        free = free[np.minimum.accumulate(over[::-1])[::-1]]
    return np.asarray(free[np.argsort(by_end)].reshape(-1, 2))


def _groups(size: int, one: Any, other: Any) -> Any:
    """Return the smallest member of the group that each of `size` numbers is in.

    The numbers `one` and `other` are linked, element by element.
    """
    least = np.arange(size)
    while (least[one] != least[other]).any():
        np.minimum.at(least, np.maximum(least[one], least[other]), np.minimum(least[one], least[other]))
        while (least != least[least]).any():
            least = least[least]
    return least


def mates(hard: Trajectory, soft: Trajectory) -> Any:
    """Row of the soft contact with the same pair and number, per hard contact.

    It is -1 without one.
    """
    (order, edge), (others, start) = hard.by_pair, soft.by_pair
    pair = hard.contacts["pair"][order]
    number, mate = np.arange(len(order)) - edge[pair], np.full(len(order), -1)
    both = number < counts(soft)[pair]
    mate[order[both]] = others[(start[pair] + number)[both]]
    return mate


def _held_since(soft: Trajectory) -> Array:
    """Time in s from which contacts without end connect each body to a wall, or inf."""
    endless, since = np.isnan(soft.contacts["t_end"]), np.full(soft.scene.n_pairs, np.inf)
    since[soft.contacts["pair"][endless]] = soft.contacts["t_begin"][endless]
    held, wall = np.full((2, soft.scene.n), np.inf), soft.scene.is_wall
    if wall[0]:
        held[0, 1:] = np.maximum.accumulate(since)
    if wall[-1]:
        held[1, :-1] = np.maximum.accumulate(since[::-1])[::-1]
    return np.asarray(held.min(axis=0))


def at_rest(hard: Trajectory, soft: Trajectory) -> tuple[Any, Any]:
    """Whether each pair is at rest at the end of the soft run, and of the hard run.

    In the soft run its last contact has no end. In the hard run its bodies stick, and it has fewer contacts. Both
    arrays have the shape of the gaps.
    """
    sticks = np.abs(partings(hard)) <= sticking(hard)
    return np.isnan(partings(soft)) & (counts(soft) > 0), sticks & (counts(hard) < counts(soft))


def resting_in_both(hard: Trajectory, soft: Trajectory) -> Any:
    """Whether each pair `at_rest` in one run also rests at the end of the other.

    The result has the shape of the gaps.
    """
    never, sticks = at_rest(hard, soft)
    parting = np.where(never, partings(hard), partings(soft))
    still = np.where(np.isnan(parting), hard.gap[-1] == 0.0, np.abs(parting) <= sticking(hard))
    return (never | sticks) & still


def rests_apart(hard: Trajectory, soft: Trajectory, weight: Array) -> Iterator[tuple[int, float]]:
    """Yield pairs that rest in a contact without end, and their difference in m/s.

    The difference of the two runs is the largest of the following. A contact before the contact without end that the
    other run lacks contributes its full speed. The contact without end begins in both runs, and the difference of its
    approach speeds counts. Further contacts of one run, for example of a ball that bounces ever lower, contribute the
    speed by which they are faster, and the speed with which they leave the pair. If the pair is at rest in both runs,
    contacts with an approach speed of at most `weight` (n-1,) belong to balls that settle, and are ignored. The ends of
    the contacts before it are compared by episodes, see `granular.comparison.episodes`.
    """
    (never, sticks), still = at_rest(hard, soft), resting_in_both(hard, soft)
    for c in np.flatnonzero(never | sticks).tolist():
        runs = [(approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"]).ravel()) for run in (hard, soft)]
        (closing, parting), (others, out) = runs if sticks[c] and not never[c] else runs[::-1]
        k = len(closing) - 1  # the number of the contact without end
        both = min(k, len(others))
        apart = [*np.maximum(np.abs(parting), closing)[both:k]]
        apart += [abs(closing[k] - others[k]), *(others[k + 1 :] - closing[k])] if len(others) > k else [closing[k]]
        fastest = np.zeros(max(k + 1, len(others)))
        fastest[: k + 1] = closing
        fastest[: len(others)] = np.maximum(fastest[: len(others)], others)
        left = float(np.abs(np.nan_to_num(out[-1:])).max(initial=0.0))
        yield c, max(left, float(np.max(apart, where=fastest[both:] > weight[c] * still[c], initial=0.0)))


typed(globals(), Scene, Trajectory)
