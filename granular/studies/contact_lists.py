"""Contacts of many particles that overlap in time: clusters and unshared impulse.

All functions take contacts in the order of their onsets. A side is one of the two particles of a contact. The run time
is dominated by a few sorts.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from granular._engine.check import Array

Bools: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]


def sides(bodies: Ints, end: Array, at_wall: Bools) -> tuple[Ints, Ints, Bools, Ints]:
    """Sort both sides of all contacts by particle and onset.

    Each side at a wall gets a particle of its own, because contacts with one wall do not disturb each other.

    Parameters
    ----------
    bodies : (2, n) array of int
        Bodies of each contact, numbered from 0.
    end : (n,) array
        Ends in s.
    at_wall : (2, n) array of bool
        Whether the body is a wall.

    Returns
    -------
    particle, contact : array of int
        Particle and contact of each side.
    is_first : array of bool
        Whether the side is the first of its particle.
    latest : array of int
        Contact with the latest end among the earlier contacts of the particle. Arbitrary where `is_first` is true.
    """
    n, particle, rank = len(end), bodies.copy(), np.empty(len(end), np.int64)
    particle[at_wall] = bodies.max() + 1 + np.arange(at_wall.sum())
    # one sort of unique keys is faster than a stable sort of particles
    particle, contact = np.divmod(np.sort((particle * n + np.arange(n)).ravel()), n)
    is_first = np.diff(particle, prepend=-1) != 0
    by_end = np.argsort(end)
    rank[by_end] = np.arange(n)
    # ranks of ends, raised from particle to particle, so that the running maximum begins again at each of them
    running = np.maximum.accumulate(np.cumsum(is_first) * n + rank[contact])
    return particle, contact, is_first, by_end[np.roll(running, 1) % n]


def clusters(n: int, first: Ints, second: Ints) -> Ints:
    """Return the smallest contact number in the cluster of each of `n` contacts.

    `first` and `second` are the two contacts of each link.
    """
    label = np.arange(n)
    while len(first):
        low, high = np.minimum(label[first], label[second]), np.maximum(label[first], label[second])
        np.minimum.at(label, high, low)
        while (label[label] != label).any():
            label = label[label]
        is_open = label[first] != label[second]
        first, second = first[is_open], second[is_open]
    return label


def stretches(group: Ints, start: Ints, stop: Ints, active: int, n: int) -> tuple[Bools, Ints, Ints, Ints]:
    """Find the intervals in which exactly `active` intervals of a group overlap.

    Parameters
    ----------
    group, start, stop : array of int
        Group of each interval, and the numbers of the events at which it starts and stops, all below `n`.

    Returns
    -------
    is_start, group, event : array
        Starts and stops, sorted by group and event.
    at : array of int
        Indices of starts and stops after which `active` intervals overlap, up to the next start or stop.
    """
    # one integer key sorts by group, then event, with stops before starts
    key = np.sort(np.concatenate([(group * n + stop) * 2, (group * n + start) * 2 + 1]))
    is_start, (owner, event) = key % 2 == 1, np.divmod(key // 2, n)
    return is_start, owner, event, np.flatnonzero(np.cumsum(2 * is_start - 1)[:-1] == active)


def unshared_impulse(begin: Array, end: Array, impulse: Array, particle: Ints, contact: Ints) -> float:
    """Return the impulse that is exchanged while neither particle has another contact.

    The force of a contact is assumed to be a half sine. `particle` and `contact` are the particle and the contact of
    each side. Times are in s, impulses in N s.
    """
    n, rank = 2 * len(begin), np.empty(2 * len(begin), np.int64)
    # events are all ends and begins in order; ends precede begins at the same time
    time = np.concatenate([end, begin])
    order = np.argsort(time, kind="stable")
    rank[order] = np.arange(n)
    last, first = np.split(rank, 2)
    is_start, _, event, at = stretches(particle, first[contact], last[contact], 1, n)
    # sum of the numbers of current contacts: with exactly one contact, it is the number of this contact
    owner = np.cumsum(np.where(is_start, 1, -1) * (order % max(n // 2, 1))[event])[at]
    _, owner, event, at = stretches(owner, event[at], event[at + 1], 2, n)
    owner, width = owner[at], np.pi / (end - begin)[owner[at]]
    part = [np.cos((time[order][event[k]] - begin[owner]) * width) for k in (at, at + 1)]
    return float(0.5 * (impulse[owner] * (part[0] - part[1])).sum())
