"""Onset and end of contacts, noted as they happen.

A contact begins between two steps where the interpolated overlap (or, inside an overlap, the interpolated force)
crosses zero, and ends likewise. Pairs that touch at rest in a row begin when the row is hit, however many steps the
push needs to be felt at its other end.

`was` and `now` are rows of a step ago and of the present, of a window or of the whole chain; `j` is a place in them. On
a ring of so many pairs the place behind the last is the first, in rows that hold all of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._engine.kernels import RING, kernel
from granular.md.fixed.window import COUNT, FORCE_MAX, IMPULSE, LOWER, PART, RAW, STEP, TOUCHED, UPPER, XI, XI_MAX, V
from granular.run.contact_log import COLUMNS

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *COLUMNS], align=True
)
"""A row of the log: a contact; onset and end as step numbers and fractions of a step."""


@kernel
def place(i: int, ring: int) -> int:
    """The place of a pair that is counted beyond an end of a ring."""
    return i if not RING or 1 <= i <= ring else i - ring if i > ring else i + ring


@kernel
def part_of_step(j: int, apart: float, was: Any, now: Any) -> Any:
    """Fraction of the step at which a contact began or ended; `apart` is the overlap on the side without it."""
    row = XI if apart <= 0.0 else RAW
    return was[row][j] / (was[row][j] - now[row][j])


@kernel
def between(i: int, part: float, was: Any, now: Any) -> Any:
    """Velocity within the step."""
    return was[V][i] + part * (now[V][i] - was[V][i])


@kernel
def _touch(j: int, k: int, part: float, was: Any, now: Any) -> None:
    now[STEP][j], now[PART][j] = k, part
    now[LOWER][j], now[UPPER][j] = between(j, part, was, now), between(j + 1, part, was, now)


@kernel
def _waits(j: int, was: Any, now: Any) -> bool:
    """Whether a pair touches at rest, and nothing has hit its row so far."""
    at_rest = was[XI][j] == 0.0 and was[V][j] == was[V][j + 1] and not was[RAW][j] > 0.0
    return bool(at_rest and now[TOUCHED][j] == 0)


@kernel
def spread(j: int, k: int, part: float, ring: int, was: Any, now: Any) -> None:
    """Note that the pairs that touch at rest in a row beside a pair are touched when it is."""
    for way in (-1, 1):
        i = place(j + way, ring)
        while _waits(i, was, now):
            _touch(i, k, part, was, now)
            now[TOUCHED][i] = 1
            i = place(i + way, ring)


@kernel
def _forget(j: int, ring: int, now: Any) -> None:
    """The contact is over: pairs of its row that felt nothing of it are as before."""
    for way in (-1, 1):
        i = place(j + way, ring)
        while now[TOUCHED][i] == 1:
            now[TOUCHED][i] = 0
            i = place(i + way, ring)


@kernel
def _begin(j: int, k: int, dt: float, ring: int, was: Any, now: Any) -> None:
    if now[TOUCHED][j] == 0 or was[XI][j] < 0.0:
        part = part_of_step(j, was[XI][j], was, now)
        _touch(j, k, part, was, now)
        spread(j, k, part, ring, was, now)
    now[TOUCHED][j] = 0
    now[COUNT][j] += 1
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
    """Note the contacts that begin in this step, count and log those that end."""
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
    """Whether a window may log its contacts alone: no row at rest is hit or left, the contact to stop at does not
    begin, there is room in the log."""
    rows = work.ended[0]
    for c in range(first, stop):
        j = c - lo + 1
        before, after = was[RAW][j] > 0.0, now[RAW][j] > 0.0
        if before != after:
            rows += 1 if before else 0
            if after and c == work.pair and now[COUNT][j] + 1 == work.nth:
                return False
            for way in (-1, 1):
                i = place(j + way, ring)
                if _waits(i, was, now) or (before and now[TOUCHED][i] == 1):
                    return False
    return bool(rows <= len(work.log))
