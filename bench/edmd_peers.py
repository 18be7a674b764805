"""Bare event loops, with which the engines are compared.

The loops handle gaps of elastic balls without gravity, contact log, checks and re-basing of the clock. `bare_sorted` is
the shortest loop on a `SortedList`, `bare_tree` the shortest loop on a compiled tournament tree. The ratio between an
engine and its bare loop, both measured in one run, can be compared between machines.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from sortedcontainers import SortedList


def bare_sorted(gap: list[float], u: list[float], low: list[float], high: list[float], events: int) -> float:
    """Process `events` collisions and return the time of the last collision."""
    n = len(gap)
    at, slot, now = [0.0] * n, [math.inf] * n, 0.0
    for c in range(n):
        rate = u[c + 1] - u[c]
        if rate < 0.0:
            slot[c] = gap[c] / -rate
    queue = SortedList([(t, c) for c, t in enumerate(slot) if t < math.inf])
    for _ in range(events):
        now, c = queue.pop(0)
        slot[c] = math.inf
        first, last = max(c - 1, 0), min(c + 1, n - 1)
        for k in range(first, last + 1):
            gap[k] = max(0.0, gap[k] + (u[k + 1] - u[k]) * (now - at[k]))  # rounding must not make it negative
            at[k] = now
        gap[c] = 0.0
        jump = 2.0 * (u[c + 1] - u[c])
        u[c] += low[c] * jump
        u[c + 1] -= high[c] * jump
        for k in range(first, last + 1):
            rate = u[k + 1] - u[k]
            t = now + gap[k] / -rate if rate < 0.0 else math.inf
            if t != slot[k]:  # an unchanged time keeps its entry in the queue
                if slot[k] < math.inf:
                    queue.remove((slot[k], k))
                slot[k] = t
                if t < math.inf:
                    queue.add((t, k))
    return now


@numba.njit(error_model="numpy")
def bare_tree(gap: np.ndarray, u: np.ndarray, low: np.ndarray, high: np.ndarray, events: int) -> float:
    """Process `events` collisions and return the time of the last collision."""
    n = len(gap)
    size = 1
    while size < n:
        size *= 2
    at, slot = np.zeros(n), np.full(size, np.inf)
    tree = np.zeros(2 * size, np.int32)  # leaf size + c holds pair c, each inner node its earlier child
    for c in range(size):
        tree[size + c] = c
        if c < n and u[c + 1] < u[c]:
            slot[c] = gap[c] / (u[c] - u[c + 1])
    for i in range(size - 1, 0, -1):
        a, b = tree[2 * i], tree[2 * i + 1]
        tree[i] = b if slot[b] < slot[a] else a
    now = 0.0
    for _ in range(events):
        c = tree[1]
        now = slot[c]
        first, last = max(c - 1, 0), min(c + 1, n - 1)
        jump = 2.0 * (u[c + 1] - u[c])
        for k in range(first, last + 1):
            d = gap[k] + (u[k + 1] - u[k]) * (now - at[k])
            gap[k] = d if d > 0.0 else 0.0  # rounding must not make it negative
            at[k] = now
        gap[c] = 0.0
        u[c] += low[c] * jump
        u[c + 1] -= high[c] * jump
        for k in range(first, last + 1):
            rate = u[k + 1] - u[k]
            slot[k] = now + gap[k] / -rate if rate < 0.0 else np.inf
        i, j = (size + first) >> 1, (size + last) >> 1  # only the parents of the changed pairs are updated
        while i > 0:
            for m in range(i, j + 1):
                a, b = tree[2 * m], tree[2 * m + 1]
                tree[m] = b if slot[b] < slot[a] else a
            i >>= 1
            j >>= 1
    return now
