"""The loop of the fixed-step methods: step, notice contacts that begin and end, log them.

Times are counted in whole steps plus a fraction, so late times cost no digits. A contact begins between two steps
where the interpolated overlap (or, inside an overlap, the interpolated force) crosses zero, and ends likewise. Pairs
that touch at rest in a row begin when the row is hit, however many steps the push needs to be felt at its other end.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.md.rows import COLUMNS
from granular.md.steps import step

DONE, FLIGHT, FULL, UNTIL = range(4)
"""Why `march` returned: steps used up, every pair open, log buffer full, stop condition."""

Old = namedtuple("Old", "xi v raw force")
"""State at the start of the current step, from which begins, ends and samples are interpolated."""
Open = namedtuple("Open", "step part lower upper xi_max force_max impulse count touched deepest beside shared")
"""Per pair: begin of the running contact (step, fraction), velocities then, peaks and impulse so far; number of
contacts begun; whether the begin is noted of a contact that is still without force; over the whole run: largest
overlap, largest overlap of the pair and the next one together, impulse exchanged while a neighbouring pair was active.
"""

COUNTED = ("step", "count", "touched")
"""Fields of `Open` that hold whole numbers."""

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *COLUMNS], align=True
)
"""A row of the log: a contact; onset and end as step numbers and fractions of a step."""


@kernel
def _keep(old: Any, s: Any) -> None:
    for c in range(len(s.xi)):
        old.xi[c] = s.xi[c]
        old.raw[c] = s.raw[c]
        old.force[c] = s.force[c]
    for i in range(len(s.v)):
        old.v[i] = s.v[i]


@kernel
def begin_part(c: int, old: Any, s: Any) -> float:
    """Fraction of the step at which the contact of pair `c` began."""
    part: float = -old.raw[c] / (s.raw[c] - old.raw[c])
    if old.xi[c] <= 0.0:
        part = -old.xi[c] / (s.xi[c] - old.xi[c])
    return part


@kernel
def end_part(c: int, old: Any, s: Any) -> float:
    """Fraction of the step at which the contact of pair `c` ended."""
    part: float = old.raw[c] / (old.raw[c] - s.raw[c])
    if s.xi[c] <= 0.0:
        part = old.xi[c] / (old.xi[c] - s.xi[c])
    return part


@kernel
def _touch(c: int, k: int, part: float, old: Any, s: Any, now: Any) -> None:
    now.step[c] = k
    now.part[c] = part
    now.lower[c] = old.v[c] + part * (s.v[c] - old.v[c])
    now.upper[c] = old.v[c + 1] + part * (s.v[c + 1] - old.v[c + 1])


@kernel
def spread(c: int, k: int, part: float, old: Any, s: Any, now: Any) -> None:
    """Note that the pairs that touch at rest in a row beside pair `c` are touched when it is."""
    for way in (-1, 1):
        d = c + way
        while (
            0 <= d < len(s.xi)
            and old.xi[d] == 0.0
            and old.v[d] == old.v[d + 1]
            and old.force[d] <= 0.0
            and now.touched[d] == 0
        ):
            _touch(d, k, part, old, s, now)
            now.touched[d] = 1
            d += way


@kernel
def _forget(c: int, s: Any, now: Any) -> None:
    """The contact of pair `c` is over: pairs of its row that felt nothing of it are as before."""
    for way in (-1, 1):
        d = c + way
        while 0 <= d < len(s.xi) and now.touched[d] == 1:
            now.touched[d] = 0
            d += way


@kernel
def _begin(c: int, k: int, old: Any, s: Any, now: Any) -> None:
    if now.touched[c] == 0 or old.xi[c] < 0.0:
        part = begin_part(c, old, s)
        _touch(c, k, part, old, s, now)
        spread(c, k, part, old, s, now)
    now.touched[c] = 0
    now.xi_max[c] = 0.0
    now.force_max[c] = 0.0
    now.impulse[c] = 0.0
    now.count[c] += 1


@kernel
def _end(c: int, k: int, old: Any, s: Any, now: Any, row: Any) -> None:
    part = end_part(c, old, s)
    row.pair = c
    row.step_in, row.part_in = now.step[c], now.part[c]
    row.step_out, row.part_out = k, part
    row.lower_in, row.upper_in = now.lower[c], now.upper[c]
    row.lower_out = old.v[c] + part * (s.v[c] - old.v[c])
    row.upper_out = old.v[c + 1] + part * (s.v[c + 1] - old.v[c + 1])
    row.xi_max, row.force_max, row.impulse = now.xi_max[c], now.force_max[c], now.impulse[c]


@kernel
def _follow(c: int, dt: float, old: Any, s: Any, now: Any) -> None:
    impulse = 0.5 * dt * (old.force[c] + s.force[c])
    now.impulse[c] += impulse
    if (c > 0 and s.force[c - 1] > 0.0) or (c + 1 < len(s.xi) and s.force[c + 1] > 0.0):
        now.shared[c] += impulse
    if s.xi[c] > now.xi_max[c]:
        now.xi_max[c] = s.xi[c]
    if s.force[c] > now.force_max[c]:
        now.force_max[c] = s.force[c]


@kernel
def _watch(c: int, s: Any, now: Any) -> None:
    if s.xi[c] > now.deepest[c]:
        now.deepest[c] = s.xi[c]
    if c + 1 < len(s.xi):
        both = s.xi[c] if s.xi[c] < s.xi[c + 1] else s.xi[c + 1]
        if both > now.beside[c]:
            now.beside[c] = both


@kernel
def march(
    method: int, force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, start: int, steps: int,
    room: int, s: Any, work: Any, old: Any, now: Any, log: Any, until_pair: int, until_nth: int,
) -> tuple[int, int, int]:  # fmt: skip
    """Take up to `steps` steps from step number `start`, until more than `room` contacts have ended.

    Returns
    -------
    why, k, rows : int
        One of `DONE`, `FLIGHT`, `FULL`, `UNTIL`; the step number reached; rows written to `log`. After `UNTIL`
        the contact begins between the states `old` (step k) and `s` (step k + 1).
    """
    rows, pairs_n = 0, len(s.xi)
    for k in range(start, start + steps):
        if rows > room or rows + pairs_n > len(log):
            return 2, k, rows
        _keep(old, s)
        step(method, force, laws, pairs, w, fall, dt, s, work)
        if (
            until_pair >= 0
            and old.force[until_pair] <= 0.0 < s.force[until_pair]
            and now.count[until_pair] + 1 == until_nth
        ):
            return 3, k, rows
        closed = False
        for c in range(pairs_n):
            before, after = old.force[c] > 0.0, s.force[c] > 0.0
            if after and not before:
                _begin(c, k, old, s, now)
            if before or after:
                _follow(c, dt, old, s, now)
            if before and not after:
                _end(c, k, old, s, now, log[rows])
                _forget(c, s, now)
                rows += 1
            if s.xi[c] > 0.0:
                closed = True
                _watch(c, s, now)
        if not closed:
            return 1, k + 1, rows
    return 0, start + steps, rows
