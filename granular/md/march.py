"""The loop of the fixed-step methods: step, notice contacts that begin and end, log them.

Times are counted in whole steps plus a fraction, so late times cost no digits. A contact begins between two steps
where the interpolated overlap (or, inside an overlap, the interpolated force) crosses zero, and ends likewise. Pairs
that touch at rest in a row begin when the row is hit, however many steps the push needs to be felt at its other end.

Two states take turns: one is read, the other written. What every step adds to the log's peaks and sums knows no
branches; onsets and ends are looked for only in steps in which a force comes or goes.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.md.integrators import remember
from granular.md.integrators import verlet as step
from granular.md.rows import COLUMNS

DONE, FLIGHT, FULL, UNTIL = range(4)
"""Why `march` returned: steps used up, every pair open, log buffer full, stop condition."""

Memory = namedtuple("Memory", "s old work now log")
"""What changes: state, state a step ago, scratch, contacts under way, rows of those that ended."""
Notes = namedtuple("Notes", "step part lower upper xi_max force_max impulse count touched deepest beside shared")
"""Per pair: begin of the running contact (step, fraction), velocities then, peaks and impulse so far; number of
contacts begun; whether the begin is noted of a contact that is still without force; over the whole run: largest
overlap, largest overlap of the pair and the next one together, impulse exchanged while a neighbouring pair was active.
"""

COUNTED = ("step", "count", "touched")
"""Fields of `Notes` that hold whole numbers."""

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *COLUMNS], align=True
)
"""A row of the log: a contact; onset and end as step numbers and fractions of a step."""


@kernel
def part_of_step(c: int, apart: Any, old: Any, s: Any) -> float:
    """Fraction of the step at which the contact of pair `c` began or ended; `apart` is the state without it."""
    part: float = old.raw[c] / (old.raw[c] - s.raw[c])
    if apart.xi[c] <= 0.0:
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
            and not old.raw[d] > 0.0
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
def _begin(c: int, k: int, dt: float, old: Any, s: Any, now: Any) -> None:
    if now.touched[c] == 0 or old.xi[c] < 0.0:
        part = part_of_step(c, old, old, s)
        _touch(c, k, part, old, s, now)
        spread(c, k, part, old, s, now)
    now.touched[c] = 0
    now.xi_max[c] = s.xi[c]
    now.force_max[c] = s.raw[c]
    now.impulse[c] = 0.5 * dt * s.raw[c]
    now.count[c] += 1


@kernel
def _end(c: int, k: int, old: Any, s: Any, now: Any, row: Any) -> None:
    part = part_of_step(c, s, old, s)
    row.pair = c
    row.step_in, row.part_in = now.step[c], now.part[c]
    row.step_out, row.part_out = k, part
    row.lower_in, row.upper_in = now.lower[c], now.upper[c]
    row.lower_out = old.v[c] + part * (s.v[c] - old.v[c])
    row.upper_out = old.v[c + 1] + part * (s.v[c + 1] - old.v[c + 1])
    row.xi_max, row.force_max, row.impulse = now.xi_max[c], now.force_max[c], now.impulse[c]


@kernel
def settle(k: int, dt: float, old: Any, s: Any, now: Any, log: Any, rows: int) -> int:
    """Note the contacts that begin in this step, log those that end; return the number of rows."""
    for c in range(len(s.xi)):
        before, after = old.raw[c] > 0.0, s.raw[c] > 0.0
        if after and not before:
            _begin(c, k, dt, old, s, now)
        if before and not after:
            _end(c, k, old, s, now, log[rows])
            _forget(c, s, now)
            rows += 1
    return rows


@kernel
def _push(c: int, half: float, beside: int, old: Any, s: Any, now: Any) -> int:
    """Add the impulse of a step, note the largest force; return 1 if a contact begins or ends in it, else 0."""
    before = old.raw[c] if old.raw[c] > 0.0 else 0.0
    after = s.raw[c] if s.raw[c] > 0.0 else 0.0
    impulse = half * (before + after)
    now.impulse[c] += impulse
    now.force_max[c] = after if after > now.force_max[c] else now.force_max[c]
    now.shared[c] += impulse if beside == 1 else 0.0
    return (1 if before > 0.0 else 0) ^ (1 if after > 0.0 else 0)


@kernel
def pushes(half: float, old: Any, s: Any, now: Any) -> int:
    """Add up the impulses of a step, also those beside an active neighbour; return 1 if any contact begins or ends."""
    raw, last = s.raw, len(s.raw) - 1
    changed = _push(0, half, 1 if last > 0 and raw[1] > 0.0 else 0, old, s, now)
    for c in range(1, last):
        beside = (1 if raw[c - 1] > 0.0 else 0) | (1 if raw[c + 1] > 0.0 else 0)
        changed |= _push(c, half, beside, old, s, now)
    if last > 0:
        changed |= _push(last, half, 1 if raw[last - 1] > 0.0 else 0, old, s, now)
    return changed


@kernel
def overlaps(xi: Any, now: Any) -> int:
    """Note the largest overlaps; return 1 if any pair is closed."""
    last, closed = len(xi) - 1, 0
    for c in range(last):
        x = xi[c] if xi[c] > 0.0 else 0.0
        both = x if x < xi[c + 1] else xi[c + 1]
        now.xi_max[c] = x if x > now.xi_max[c] else now.xi_max[c]
        now.deepest[c] = x if x > now.deepest[c] else now.deepest[c]
        now.beside[c] = both if both > now.beside[c] else now.beside[c]
        closed |= 1 if x > 0.0 else 0
    x = xi[last] if xi[last] > 0.0 else 0.0
    now.xi_max[last] = x if x > now.xi_max[last] else now.xi_max[last]
    now.deepest[last] = x if x > now.deepest[last] else now.deepest[last]
    return closed | (1 if x > 0.0 else 0)


@kernel
def exchange(old: Any, s: Any) -> None:
    """Let two states change places."""
    for one, other in zip(old, s):  # noqa: B905
        for a in range(len(one)):
            one[a], other[a] = other[a], one[a]


@kernel
def march(
    physics: Any, memory: Any, start: int, steps: int, room: int, until_pair: int, until_nth: int
) -> tuple[int, int, int]:
    """Take up to `steps` steps from step number `start`, until more than `room` contacts have ended.

    Returns
    -------
    why, k, rows : int
        One of `DONE`, `FLIGHT`, `FULL`, `UNTIL`; the step number reached; rows written to `log`. After `UNTIL`
        the contact begins between the states `old` (step k) and `s` (step k + 1).
    """
    why, k, rows, turned = DONE, start, 0, False
    dt, now, log, s, old = physics.dt, memory.now, memory.log, memory.s, memory.old
    while why == DONE and k < start + steps:
        if rows > room or rows + len(s.xi) > len(log):
            why = FULL
            break
        old, s, turned = s, old, not turned
        step(physics, old, s, memory.work)
        remember(old, s)
        if (
            until_pair >= 0
            and not old.raw[until_pair] > 0.0
            and s.raw[until_pair] > 0.0
            and now.count[until_pair] + 1 == until_nth
        ):
            why = UNTIL
            break
        changed, closed = pushes(0.5 * dt, old, s, now), overlaps(s.xi, now)
        if changed == 1:
            rows = settle(k, dt, old, s, now, log, rows)
        why, k = DONE if closed == 1 else FLIGHT, k + 1
    if turned:
        exchange(memory.old, memory.s)
    return why, k, rows
