"""Onset and end of contacts, noted as they happen.

A contact begins between two steps where the interpolated overlap (or, inside an overlap, the interpolated force)
crosses zero, and ends likewise. Pairs that touch at rest in a row begin when the row is hit, however many steps the
push needs to be felt at its other end.

`a` is a window, or the columns `Seen` of the whole chain, where pair c and ball i stand at ``c - lo + 1`` and
``i - lo + 1``.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.md.rows import COLUMNS

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *COLUMNS], align=True
)
"""A row of the log: a contact; onset and end as step numbers and fractions of a step."""
Seen = namedtuple("Seen", "xi raw v was_xi was_raw was_v xi_max force_max impulse")
"""What is looked at to note a contact: the state, that of a step ago, and what was noted of the contact so far."""


@kernel
def part_of_step(apart: float, was_xi: float, xi: float, was_raw: float, raw: float) -> float:
    """Fraction of the step at which a contact began or ended; `apart` is the overlap on the side without it."""
    part: float = was_xi / (was_xi - xi) if apart <= 0.0 else was_raw / (was_raw - raw)
    return part


@kernel
def _touch(c: int, lo: int, k: int, part: float, a: Any, now: Any) -> None:
    j = c - lo + 1
    now.step[c] = k
    now.part[c] = part
    now.lower[c] = a.was_v[j] + part * (a.v[j] - a.was_v[j])
    now.upper[c] = a.was_v[j + 1] + part * (a.v[j + 1] - a.was_v[j + 1])


@kernel
def _waits(c: int, lo: int, a: Any, now: Any) -> bool:
    """Whether pair `c` touches at rest, and nothing has hit its row so far."""
    j = c - lo + 1
    return bool(
        0 <= c < len(now.xi)
        and a.was_xi[j] == 0.0
        and a.was_v[j] == a.was_v[j + 1]
        and not a.was_raw[j] > 0.0
        and now.touched[c] == 0
    )


@kernel
def spread(c: int, lo: int, k: int, part: float, a: Any, now: Any) -> None:
    """Note that the pairs that touch at rest in a row beside pair `c` are touched when it is."""
    for way in (-1, 1):
        d = c + way
        while _waits(d, lo, a, now):
            _touch(d, lo, k, part, a, now)
            now.touched[d] = 1
            d += way


@kernel
def _forget(c: int, now: Any) -> None:
    """The contact of pair `c` is over: pairs of its row that felt nothing of it are as before."""
    for way in (-1, 1):
        d = c + way
        while 0 <= d < len(now.xi) and now.touched[d] == 1:
            now.touched[d] = 0
            d += way


@kernel
def _begin(c: int, lo: int, k: int, dt: float, a: Any, now: Any) -> None:
    j = c - lo + 1
    if now.touched[c] == 0 or a.was_xi[j] < 0.0:
        part = part_of_step(a.was_xi[j], a.was_xi[j], a.xi[j], a.was_raw[j], a.raw[j])
        _touch(c, lo, k, part, a, now)
        spread(c, lo, k, part, a, now)
    now.touched[c] = 0
    now.count[c] += 1
    a.xi_max[j] = a.xi[j]
    a.force_max[j] = a.raw[j]
    a.impulse[j] = 0.5 * dt * a.raw[j]


@kernel
def _end(c: int, lo: int, k: int, a: Any, now: Any, row: Any) -> None:
    j = c - lo + 1
    part = part_of_step(a.xi[j], a.was_xi[j], a.xi[j], a.was_raw[j], a.raw[j])
    row.pair = c
    row.step_in, row.part_in = now.step[c], now.part[c]
    row.step_out, row.part_out = k, part
    row.lower_in, row.upper_in = now.lower[c], now.upper[c]
    row.lower_out = a.was_v[j] + part * (a.v[j] - a.was_v[j])
    row.upper_out = a.was_v[j + 1] + part * (a.v[j + 1] - a.was_v[j + 1])
    row.xi_max, row.force_max, row.impulse = a.xi_max[j], a.force_max[j], a.impulse[j]
    _forget(c, now)


@kernel
def settle(first: int, stop: int, lo: int, k: int, physics: Any, a: Any, now: Any, work: Any) -> None:
    """Note the contacts that begin in this step, count and log those that end."""
    for c in range(first, stop):
        before, after = a.was_raw[c - lo + 1] > 0.0, a.raw[c - lo + 1] > 0.0
        if after and not before and physics.logged:
            _begin(c, lo, k, physics.dt, a, now)
        if before and not after:
            if physics.logged:
                _end(c, lo, k, a, now, now.log[work.ended[0]])
            work.ended[0] += 1


@kernel
def local(first: int, stop: int, lo: int, a: Any, here: Any, now: Any, work: Any) -> bool:
    """Whether a window may settle its contacts alone: no row at rest is hit or left, there is room in the log.

    `here` is the chain before the steps of the window, `now` the one after them.
    """
    rows = work.ended[0]
    for c in range(first, stop):
        before, after = a.was_raw[c - lo + 1] > 0.0, a.raw[c - lo + 1] > 0.0
        if before != after:
            rows += 1 if before else 0
            if after and c == work.pair and now.count[c] + 1 == work.nth:
                return False
            for d in (c - 1, c + 1):
                if _waits(d, lo, a, here) or (before and 0 <= d < len(here.xi) and here.touched[d] == 1):
                    return False
    return bool(rows <= len(now.log))
