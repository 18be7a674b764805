"""Contact log of the fixed-step methods: onsets and ends of contacts.

A contact begins or ends between two steps, where the linearly interpolated overlap crosses zero. If the pair overlaps
in both steps, the zero of the interpolated force is used instead. If balls touch each other at rest, all their contacts
begin when the first ball is hit. The force reaches the last ball several steps later.

`was` and `now` are the state arrays (see `window`) before and after the current step, of a window or of the whole
chain. `j` is an index into them: pair c of a window that starts at pair `lo` has j = c - lo + 1. `k` is the step
number. A ring has `ring` pairs. In arrays that contain the whole ring, index 1 follows index `ring`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._engine.kernels import RING, kernel
from granular.md.fixed.window import (
    COUNT,
    ENERGIES,
    FORCE_MAX,
    IMPULSE,
    LOWER,
    PART,
    RAW,
    STEP,
    TOUCHED,
    UPPER,
    XI,
    XI_MAX,
    V,
)
from granular.run.contact_log import SOFT_FIELDS

STEP_ROW = np.dtype(
    [("pair", int), ("step_in", int), ("part_in", float), ("step_out", int), ("part_out", float), *SOFT_FIELDS],
    align=True,
)
"""Row of the internal log.

It describes a contact with its onset and its end, each as a step number and a fraction of a step."""


@kernel
def ring_index(i: int, ring: int) -> int:
    """Return index `i` reduced to 1 … `ring` on a ring, else `i` itself.

    `i` can exceed this range by at most one revolution.
    """
    return i if not RING or 1 <= i <= ring else i - ring if i > ring else i + ring


@kernel
def part_of_step(j: int, xi_outside: float, was: Any, now: Any) -> Any:
    """Return the fraction of the step at which contact `j` began or ended.

    `xi_outside` is the overlap in m at the end of the step at which the contact does not exist. The fraction is the
    zero of the linearly interpolated overlap, or of the force if `xi_outside` is positive.
    """
    row = XI if xi_outside <= 0.0 else RAW
    return was[row][j] / (was[row][j] - now[row][j])


@kernel
def velocity_within(i: int, part: float, was: Any, now: Any) -> Any:
    """Return the velocity in m/s of body `i` at the fraction `part` of the step."""
    return was[V][i] + part * (now[V][i] - was[V][i])


@kernel
def _store_onset(j: int, k: int, part: float, was: Any, now: Any) -> None:
    """Store an onset: fraction `part` of step `k`, and the velocities at that time."""
    now[STEP][j], now[PART][j] = k, part
    now[LOWER][j], now[UPPER][j] = velocity_within(j, part, was, now), velocity_within(j + 1, part, was, now)


@kernel
def _rests_in_touching_row(j: int, was: Any, now: Any) -> bool:
    """Return whether pair `j` touches at rest without a force.

    The result is False once its onset is stored.
    """
    at_rest = was[XI][j] == 0.0 and was[V][j] == was[V][j + 1] and not was[RAW][j] > 0.0
    return bool(at_rest and now[TOUCHED][j] == 0)


@kernel
def begin_resting_neighbours(j: int, k: int, part: float, ring: int, was: Any, now: Any) -> None:
    """Store the onset of pair `j` also for the touching pairs at rest next to it.

    The onset is at the fraction `part` of step `k`. These pairs are marked in `TOUCHED`.
    """
    for direction in (-1, 1):
        i = ring_index(j + direction, ring)
        while _rests_in_touching_row(i, was, now):
            _store_onset(i, k, part, was, now)
            now[TOUCHED][i] = 1
            i = ring_index(i + direction, ring)


@kernel
def _clear_touched_marks(j: int, ring: int, now: Any) -> None:
    """Clear the `TOUCHED` marks of pairs in a series next to pair `j`.

    The contact of pair `j` ended before its force reached the marked pairs. Their stored onsets are no longer valid.
    """
    for direction in (-1, 1):
        i = ring_index(j + direction, ring)
        while now[TOUCHED][i] == 1:
            now[TOUCHED][i] = 0
            i = ring_index(i + direction, ring)


@kernel
def _begin(j: int, k: int, physics: Any, was: Any, now: Any) -> None:
    """Begin to record contact `j`, whose force became positive in step `k`."""
    if now[TOUCHED][j] == 0 or was[XI][j] < 0.0:
        part = part_of_step(j, was[XI][j], was, now)
        _store_onset(j, k, part, was, now)
        begin_resting_neighbours(j, k, part, physics.ring, was, now)
    now[TOUCHED][j] = 0
    now[COUNT][j] += 1
    # impulse and energy start by the trapezoidal rule, with force 0 before the onset
    now[XI_MAX][j], now[IMPULSE][j], now[FORCE_MAX][j] = now[XI][j], 0.5 * physics.dt * now[RAW][j], (
        0.5 * (now[XI][j] - was[XI][j]) * now[RAW][j] if physics.logged == ENERGIES else now[RAW][j])


@kernel
def _end(j: int, k: int, ring: int, was: Any, now: Any, row: Any) -> None:
    """Write contact `j`, whose force vanished in step `k`, to the log row `row`."""
    part = part_of_step(j, now[XI][j], was, now)
    row.step_in, row.part_in, row.step_out, row.part_out = int(now[STEP][j]), now[PART][j], k, part
    row.lower_in, row.upper_in = now[LOWER][j], now[UPPER][j]
    row.lower_out, row.upper_out = velocity_within(j, part, was, now), velocity_within(j + 1, part, was, now)
    row.xi_max, row.force_max, row.impulse = now[XI_MAX][j], now[FORCE_MAX][j], now[IMPULSE][j]
    _clear_touched_marks(j, ring, now)


@kernel
def log_contacts(first: int, stop: int, lo: int, k: int, physics: Any, was: Any, now: Any, work: Any) -> None:
    """Record onsets and ends of contacts of pairs `first` to `stop` - 1 in step `k`.

    Contacts that end are counted, and logged if a log is kept. The arrays start at pair `lo`.
    """
    for c in range(first, stop):
        j = c - lo + 1
        was_active, is_active = was[RAW][j] > 0.0, now[RAW][j] > 0.0
        if is_active and not was_active and physics.logged:
            _begin(j, k, physics, was, now)
        if was_active and not is_active:
            if physics.logged:
                row = work.log[work.ended[0]]
                row.pair = c
                _end(j, k, physics.ring, was, now, row)
            work.ended[0] += 1


@kernel
def can_log_alone(first: int, stop: int, lo: int, ring: int, was: Any, now: Any, work: Any) -> bool:
    """Return whether a window can log this step independently of other windows.

    The result is False if a contact begins or ends next to balls that touch at rest, or if the contact to stop at
    begins. It is also False if the log is too short. `first` to `stop` - 1 are the pairs of the window, and its arrays
    start at pair `lo`.
    """
    rows = work.ended[0]
    for c in range(first, stop):
        j = c - lo + 1
        was_active, is_active = was[RAW][j] > 0.0, now[RAW][j] > 0.0
        if was_active != is_active:
            rows += 1 if was_active else 0
            if is_active and c == work.pair and now[COUNT][j] + 1 == work.nth:
                return False
            for direction in (-1, 1):
                i = ring_index(j + direction, ring)
                if _rests_in_touching_row(i, was, now) or (was_active and now[TOUCHED][i] == 1):
                    return False
    return bool(rows <= len(work.log))
