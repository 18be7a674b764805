"""Episodes of linked contacts, and the velocities with which balls leave them.

Two contacts of soft spheres are linked if they share a ball and overlap in time. An episode is a group of contacts
joined by such links. The velocities with which balls leave an episode are its outcome, and are compared between hard
and soft spheres. States within an episode are intermediate and are not compared. A long free flight between two
contacts of the same episode also counts as leaving the episode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._engine.callables import check_argument_types
from granular._engine.check import Array
from granular.comparison.outcome import (
    SIMULTANEITY_TOLERANCE,
    approach,
    counts,
    last_contacts,
    separation_speeds,
    sticking_speed,
    touching_bodies,
    velocities_after_flight,
)
from granular.run.trajectory import Trajectory
from granular.scene import Scene

LONG_FLIGHT = 5.0
"""Shortest compared free flight, relative to the duration of the last contact."""


@dataclass(frozen=True)
class Departure:
    """A ball that leaves an episode of contacts, in both runs.

    Attributes
    ----------
    ball, episode : int
        Numbers of the ball and of the episode. Episodes are numbered from 0 by onset.
    contacts : int
        Number of soft contacts in the episode.
    pairs : tuple of int
        The pairs of these contacts, in ascending order.
    hard_t, soft_t : float
        Time in s at which the contact ends with which the ball leaves the episode.
    hard_velocity, soft_velocity : float
        Velocity of the ball in m/s at that time.
    difference : float
        Difference of the velocities divided by the unit U of the component. If free flight of the hard ball towards
        `soft_t` reduces the difference, its velocity after this flight is used.
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
        Runs continued to equal contact counts, see `granular.comparison.align.equalize_counts`.
    weight : (n-1,) array
        Speed in m/s that weight gives a ball during a contact, see `granular.comparison.outcome.Components.weight`.
    lag : callable
        ``lag(pair, speed)``: time in s by which contacts of these pairs at these approach speeds can be late.

    Attributes
    ----------
    episode : array of int
        Episode of every soft contact, numbered from 0 by onset.
    ball, of : (m,) arrays of int
        Ball and episode of every departure.
    time, velocity : (2, m) arrays
        Time in s and velocity in m/s of every departure. Row 0 is the hard run, row 1 the soft run.
    apart : (m,) array
        Difference of the two velocities in m/s. It is nan for walls, and for a ball that rests on a wall when it
        leaves. The velocities of such a ball are compared by `rest_differences`.
    """

    def __init__(self, hard: Trajectory, soft: Trajectory, weight: Array, lag: Callable[[Any, Array], Array]) -> None:
        scene, matching = hard.scene, matching_soft_contacts(hard, soft)
        is_matched = matching >= 0
        fastest = approach(soft).copy()
        np.maximum.at(fastest, matching[is_matched], approach(hard)[is_matched])
        compared = ~resting_in_both(hard, soft)[soft.contacts["pair"]] | (
            fastest > weight[soft.contacts["pair"]])  # the others are contacts of balls that settle
        self.soft, self.episode = soft, episodes(soft, compared)
        is_compared = is_matched.copy()
        is_compared[is_matched] = compared[matching[is_matched]]
        rows = np.flatnonzero(is_compared)
        leaving = [last_contacts(hard, rows, self.episode[matching[rows]]),
                   last_contacts(soft, np.flatnonzero(compared), self.episode[compared])]
        (key, *hard_columns), (soft_key, *soft_columns) = leaving
        place = np.searchsorted(soft_key, key)
        common = soft_key[place.clip(max=len(soft_key) - 1)] == key if len(soft_key) else place < 0
        row, side, place = hard_columns[0][common], hard_columns[1][common], place[common]
        last, soft_side = soft_columns[0][place], soft_columns[1][place]
        is_matched_soft = np.zeros(len(soft.contacts), np.bool_)
        is_matched_soft[matching[is_matched]] = True
        duration = (soft.contacts["t_end"] - soft.contacts["t_begin"])[matching[rows], None]
        free = np.minimum(flights(hard, is_matched)[rows], flights(soft, is_matched_soft)[matching[rows]])
        k, body_side = np.nonzero(free > LONG_FLIGHT * duration)
        row, side = np.concatenate((row, rows[k])), np.concatenate((side, body_side))
        last, soft_side = np.concatenate((last, matching[rows[k]])), np.concatenate((soft_side, body_side))
        self.of = self.episode[last]
        self.ball = touching_bodies(soft)[last, soft_side]
        self.time = np.array([hard.contacts["t_end"][row], soft.contacts["t_end"][last]])
        self.velocity = np.array([hard.contacts["v_out"][row, side], soft.contacts["v_out"][last, soft_side]])
        (begin, end), (u, v) = self.time, self.velocity
        self.apart = np.abs(u - v)
        if scene.fall.any() or scene.pendulum > 0.0:
            max_delay = lag(hard.contacts["pair"][row], approach(hard)[row])
            free = velocities_after_flight(hard, u, self.ball, np.clip(end - begin, -max_delay, max_delay), (row, side))
            self.apart = np.fmin(self.apart, np.abs(free - v))
        self.apart[scene.is_wall[self.ball] | (end > _wall_contact_since(soft)[self.ball])] = np.nan

    def departure(self, k: int, unit: float) -> Departure:
        """Return departure number `k`, with its difference in units of `unit` in m/s."""
        pair = self.soft.contacts["pair"][self.episode == self.of[k]]
        (begin, end), (u, v) = self.time[:, k].tolist(), self.velocity[:, k].tolist()
        return Departure(
            ball=int(self.ball[k]), episode=int(self.of[k]), contacts=len(pair), pairs=tuple(np.unique(pair).tolist()),
            hard_t=begin, soft_t=end, hard_velocity=u, soft_velocity=v, difference=float(self.apart[k]) / unit)


def episodes(soft: Trajectory, compared: Any) -> Any:
    """Episode of every contact in the log, numbered from 0 by onset, (m,).

    Contacts of one pair follow each other. If two contacts of neighbouring pairs overlap in time, the later one
    therefore begins during the most recent contact of the other pair. It is enough to test this contact on either side.

    Parameters
    ----------
    compared : (m,) array of bool
        Contacts that can be linked. All other contacts, and contacts without end, are episodes of their own.
    """
    log, scene, size = soft.contacts, soft.scene, len(soft.contacts)
    onset, links = np.empty(size, np.int64), []
    onset[np.argsort(log["t_begin"], kind="stable")] = np.arange(size)
    begin, end, pair = log["t_begin"], np.where(compared, log["t_end"], np.nan), log["pair"]
    order = np.lexsort((onset, pair))
    key = (pair * size + onset)[order]
    for step in (-1, 1):
        neighbour = (pair + step) % scene.n_pairs if scene.ring else pair + step
        place = np.searchsorted(key, neighbour * size + onset) - 1
        other = order[place]
        linked = (place >= 0) & (pair[other] == neighbour) & (end[other] > begin) & (end == end)
        links.append(np.array([onset[linked], onset[other[linked]]]))
    one, other = np.hstack(links)
    return np.unique(_groups(size, one, other), return_inverse=True)[1][onset] if len(one) else onset


def flights(run: Trajectory, met: Any) -> Array:
    """Duration in s of the free flight of both bodies after each contact, (m, 2).

    It is negative or 0 if another contact of the body has not ended. It is -inf if the next contact is not `met`, and
    inf if there is no next contact. All simultaneous contacts of a hard sphere have the flight after the last of them.

    Parameters
    ----------
    met : (m,) array of bool
        Whether each contact of the run also occurs in the other run.
    """
    log = run.contacts
    body = touching_bodies(run).ravel()
    begin, end = log["t_begin"].repeat(2), log["t_end"].repeat(2)
    by_begin, by_end = np.lexsort((begin, body)), np.lexsort((end, body))
    onset, end, of_body = np.where(met.repeat(2), begin, -np.inf)[by_begin], end[by_end], body[by_end]
    # a body is free after its j-th end if its contact j + 1 is the next to begin: only then all before it are over
    free = np.full(len(body), np.inf)
    np.subtract(onset[1:], end[:-1], out=free[:-1], where=of_body[1:] == of_body[:-1])
    if run.rule is not None:
        is_last = np.abs(free) > SIMULTANEITY_TOLERANCE * (end - run.time[0])
        last_of_instant = np.where(is_last, np.arange(len(body)), len(body))
        free = free[np.minimum.accumulate(last_of_instant[::-1])[::-1]]
    of_contacts = np.empty(len(body))
    of_contacts[by_end] = free
    return of_contacts.reshape(-1, 2)


def _groups(size: int, one: Any, other: Any) -> Any:
    """Smallest member of the group of each of the numbers 0 to size - 1, (size,).

    Two numbers belong to the same group if links connect them. Link k connects the numbers ``one[k]`` and ``other[k]``.
    """
    least = np.arange(size)
    while (least[one] != least[other]).any():
        np.minimum.at(least, np.maximum(least[one], least[other]), np.minimum(least[one], least[other]))
        while (least != least[least]).any():
            least = least[least]
    return least


def matching_soft_contacts(hard: Trajectory, soft: Trajectory) -> Any:
    """Row of the soft contact with the same pair and number, for each hard contact.

    It is -1 if there is no such contact. The result is in the order of the hard contact log.
    """
    (order, edge), (others, start) = hard.by_pair, soft.by_pair
    pair = hard.contacts["pair"][order]
    number, matching = np.arange(len(order)) - edge[pair], np.full(len(order), -1)
    in_both = number < counts(soft)[pair]
    matching[order[in_both]] = others[(start[pair] + number)[in_both]]
    return matching


def _wall_contact_since(soft: Trajectory) -> Array:
    """Time in s from which contacts without end connect each body to a wall, (n,).

    It is inf for a body that is not connected to a wall.
    """
    has_no_end, since = np.isnan(soft.contacts["t_end"]), np.full(soft.scene.n_pairs, np.inf)
    since[soft.contacts["pair"][has_no_end]] = soft.contacts["t_begin"][has_no_end]
    connected, wall = np.full((2, soft.scene.n), np.inf), soft.scene.is_wall
    if wall[0]:
        connected[0, 1:] = np.maximum.accumulate(since)
    if wall[-1]:
        connected[1, :-1] = np.maximum.accumulate(since[::-1])[::-1]
    return np.asarray(connected.min(axis=0))


def is_at_rest(hard: Trajectory, soft: Trajectory) -> tuple[Any, Any]:
    """Whether each pair is at rest at the end of the soft run, and of the hard run.

    A pair rests in the soft run if its last contact has no end. It rests in the hard run if its bodies stick and if it
    has fewer contacts than in the soft run. Two arrays of bool, (n-1,).
    """
    sticks = np.abs(separation_speeds(hard)) <= sticking_speed(hard)
    return np.isnan(separation_speeds(soft)) & (counts(soft) > 0), sticks & (counts(hard) < counts(soft))


def resting_in_both(hard: Trajectory, soft: Trajectory) -> Any:
    """Whether each pair at rest in one run also rests in the other run, (n-1,)."""
    has_no_end, sticks = is_at_rest(hard, soft)
    parting = np.where(has_no_end, separation_speeds(hard), separation_speeds(soft))
    is_resting = np.where(np.isnan(parting), hard.gap[-1] == 0.0, np.abs(parting) <= sticking_speed(hard))
    return (has_no_end | sticks) & is_resting


def rest_differences(hard: Trajectory, soft: Trajectory, weight: Array) -> Iterator[tuple[int, float]]:
    """Yield each pair that comes to rest, and the difference between its runs in m/s.

    The pair rests from its contact number k onwards, in the run in which it is `is_at_rest`. The difference is the
    largest of the following speeds:

    - The larger of approach and separation speed of each contact before contact k that the other run lacks.
    - The difference of the approach speeds of contact k, or its approach speed if the other run lacks it.
    - The excess of the approach speed of each later contact of the other run over the approach speed of contact k.
    - The speed with which the balls leave the last contact in the other run.

    If the pair is at rest in both runs, contacts with an approach speed of at most `weight` belong to balls that
    settle. They are ignored, except for the last of these speeds. The velocities after contacts before k are compared
    by episodes.

    Parameters
    ----------
    hard, soft : Trajectory
        Runs continued to equal contact counts.
    weight : (n-1,) array
        Speed in m/s that weight gives a ball during a contact.
    """
    (has_no_end, sticks), rests_in_both = is_at_rest(hard, soft), resting_in_both(hard, soft)
    for c in np.flatnonzero(has_no_end | sticks).tolist():
        runs = [(approach(run)[run.rows(c)], np.diff(run.of(c)["v_out"]).ravel()) for run in (hard, soft)]
        (closing, parting), (other_closing, other_parting) = runs if sticks[c] and not has_no_end[c] else runs[::-1]
        k = len(closing) - 1  # the number of the contact without end
        common = min(k, len(other_closing))
        differences = [*np.maximum(np.abs(parting), closing)[common:k]]
        differences += [abs(closing[k] - other_closing[k]), *(other_closing[k + 1 :] - closing[k])] if (
            len(other_closing) > k) else [closing[k]]
        fastest = np.zeros(max(k + 1, len(other_closing)))
        fastest[: k + 1] = closing
        fastest[: len(other_closing)] = np.maximum(fastest[: len(other_closing)], other_closing)
        leaving_speed = float(np.abs(np.nan_to_num(other_parting[-1:])).max(initial=0.0))
        yield c, max(leaving_speed, float(
            np.max(differences, where=fastest[common:] > weight[c] * rests_in_both[c], initial=0.0)))


check_argument_types(globals(), Scene, Trajectory)
