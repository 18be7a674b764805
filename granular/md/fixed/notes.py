"""Logging of onset and end of contacts with a fixed step.

A contact begins between two steps where the interpolated overlap crosses zero, or inside an overlap the interpolated
force. It ends likewise. Pairs that touch at rest in a row begin when the row is hit. The number of steps that the force
needs to reach the other end of the row does not matter.

`was` and `now` are rows of the previous and of the present step, of a window or of the whole chain. `j` is an index
into them. On a ring of `ring` pairs the index behind the last is the first, in rows that contain all of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._engine.kernels import RING, kernel
from granular.md.fixed.window import COUNT, FORCE_MAX, IMPULSE, LOWER, PART, RAW, STEP, TOUCHED, UPPER, XI, XI_MAX, V
from granular.run.contact_log import SOFT_FIELDS

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *SOFT_FIELDS],
    align=True,
)
"""Row of the log: a contact with onset and end as step numbers and fractions."""


@kernel
def place(i: int, ring: int) -> int:
    """Return the index of a pair that is counted beyond an end of a ring."""
    return i if not RING or 1 <= i <= ring else i - ring if i > ring else i + ring


@kernel
def part_of_step(j: int, apart: float, was: Any, now: Any) -> Any:
    """Return the fraction of the step at which a contact began or ended.

    `apart` is the overlap on the side without the contact.
    """
    row = XI if apart <= 0.0 else RAW
    return was[row][j] / (was[row][j] - now[row][j])


@kernel
def between(i: int, part: float, was: Any, now: Any) -> Any:
    """Return the velocity of a body within the step, by linear interpolation."""
    return was[V][i] + part * (now[V][i] - was[V][i])


@kernel
def _touch(j: int, k: int, part: float, was: Any, now: Any) -> None:
    now[STEP][j], now[PART][j] = k, part
    now[LOWER][j], now[UPPER][j] = between(j, part, was, now), between(j + 1, part, was, now)


@kernel
def _waits(j: int, was: Any, now: Any) -> bool:
    """Return whether a pair touches at rest in a row that has not been hit so far."""
    at_rest = was[XI][j] == 0.0 and was[V][j] == was[V][j + 1] and not was[RAW][j] > 0.0
    return bool(at_rest and now[TOUCHED][j] == 0)


@kernel
def spread(j: int, k: int, part: float, ring: int, was: Any, now: Any) -> None:
    """Start the contacts of pairs that touch at rest in a row beside pair `j`."""
    for direction in (-1, 1):
        i = place(j + direction, ring)
        while _waits(i, was, now):
            _touch(i, k, part, was, now)
            now[TOUCHED][i] = 1
            i = place(i + direction, ring)


@kernel
def _forget(j: int, ring: int, now: Any) -> None:
    """Reset pairs of the row that felt nothing of the finished contact."""
    for direction in (-1, 1):
        i = place(j + direction, ring)
        while now[TOUCHED][i] == 1:
            now[TOUCHED][i] = 0
            i = place(i + direction, ring)


@kernel
def _begin(j: int, k: int, dt: float, ring: int, was: Any, now: Any) -> None:
    if now[TOUCHED][j] == 0 or was[XI][j] < 0.0:
        part = part_of_step(j, was[XI][j], was, now)
        _touch(j, k, part, was, now)
        spread(j, k, part, ring, was, now)
    now[TOUCHED][j] = 0
    now[COUNT][j] += 1
    # the impulse starts by the trapezoidal rule, with force 0 before the onset
    now[XI_MAX][j], now[FORCE_MAX][j], now[IMPULSE][j] = now[XI][j], now[RAW][j], 0.5 * dt * now[RAW][j]


@kernel
def _end(j: int, k: int, ring: int, was: Any, now: Any, row: Any) -> None:
    part = part_of_step(j, now[XI][j], was, now)
    row.step_in, row.part_in, row.step_out, row.part_out = int(now[STEP][j]), now[PART][j], k, part
    row.lower_in, row.upper_in = now[LOWER][j], now[UPPER][j]
    row.lower_out, row.upper_out = between(j, part, was, now), between(j + 1, part, was, now)
    row.xi_max, row.force_max, row.impulse = now[XI_MAX][j], now[FORCE_MAX][j], now[IMPULSE][j]
    _forget(j, ring, now)


@kernel
def log_contacts(first: int, stop: int, lo: int, k: int, physics: Any, was: Any, now: Any, work: Any) -> None:
    """Note the contacts that begin in this step, and count and log those that end."""
    for c in range(first, stop):
        j = c - lo + 1
        before, after = was[RAW][j] > 0.0, now[RAW][j] > 0.0
        if after and not before and physics.logged:
            _begin(j, k, physics.dt, physics.ring, was, now)
        if before and not after:
            if physics.logged:
                row = work.log[work.ended[0]]
                row.pair = c
                _end(j, k, physics.ring, was, now, row)
            work.ended[0] += 1


@kernel
def may_log_alone(first: int, stop: int, lo: int, ring: int, was: Any, now: Any, work: Any) -> bool:
    """Return whether a window can log its contacts independently of other windows.

    No row at rest may be hit or left, the contact to stop at must not begin, and the log must have room.
    """
    rows = work.ended[0]
    for c in range(first, stop):
        j = c - lo + 1
        before, after = was[RAW][j] > 0.0, now[RAW][j] > 0.0
        if before != after:
            rows += 1 if before else 0
            if after and c == work.pair and now[COUNT][j] + 1 == work.nth:
                return False
            for direction in (-1, 1):
                i = place(j + direction, ring)
                if _waits(i, was, now) or (before and now[TOUCHED][i] == 1):
                    return False
    return bool(rows <= len(work.log))
