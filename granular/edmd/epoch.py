"""The zero of times of a run beside driven walls, moved on without leaving the event loop.
May be skipped: faster, same results.

One ball on a shaken plate flies for longer than a window lasts: each bounce begins a new one. So the loop moves the
zero itself, at the very times at which `State.shift_to` would.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.driven import rebase, synchronise
from granular.edmd.motion import Walls

LONGEST = 1000
"""Largest window of the clock, a power of 2, in s."""
LATEST = 2.0**LONGEST
"""Time in s after which runs end."""
BELOW = 1.0 - 2.0**-53
"""Times this number of a power of two is the number below it."""


@kernel
def span(length: float, speed: float, g: float) -> float:
    """Return the window (s): the power of two near 64 times the mean time to cross a gap, less if gravity is strong.

    Then it is the time in which gravity doubles the speed. A power of two keeps the bits of a scene scaled by powers
    of two.
    """
    if speed == 0.0:
        return 1.0
    window = 64.0 * length / speed if length > 0.0 else speed / g if g > 0.0 else 1.0
    if g > 0.0:
        window = min(window, speed / g)
    return math.ldexp(1.0, min(math.frexp(window)[1], LONGEST))


@rare
@kernel
def moves_on(
    run: Record, pairs: Records, bodies: Records, rows: Records | None, done: int, now: float, walls: Walls
) -> bool:
    """Move the zero of times on for the event at `now`, beyond the window, if it is due before the goal of the clock;
    date the `done` rows of the log first."""
    clock = walls[2]
    if not now <= (clock.goal - clock.epoch) - clock.epoch_low or now == math.inf:
        return False
    date(clock, rows, done)
    shift(run, pairs, bodies, now, walls)
    run.edge = min((clock.goal - clock.epoch) - clock.epoch_low, clock.window * BELOW)
    return True


@kernel
def date(clock: Record, rows: Records | None, done: int) -> None:
    """Let rows of the log, up to `done`, say their time and not that since the zero of times."""
    if rows is not None:
        for k in range(clock.dated, done):
            rows[k].t_begin = clock.epoch + (clock.epoch_low + rows[k].t_begin)
    clock.dated = done


@kernel
def shift(run: Record, pairs: Records, bodies: Records, tau: float, walls: Walls) -> None:
    """Move the epoch on by whole windows, so that `tau` comes to lie in the first one."""
    clock, n, total, speed = walls[2], len(pairs), 0.0, walls[2].fall
    by = tau - tau % clock.window
    rebase(run, pairs, bodies, by, walls)
    epoch = clock.epoch + by
    back = epoch - clock.epoch
    clock.epoch_low += (clock.epoch - (epoch - back)) + (by - back)
    clock.epoch = epoch
    clock.rebases += 1
    run.now -= by
    for which in range(2):
        walls[0][which].epoch, walls[0][which].low = clock.epoch, clock.epoch_low
    synchronise(pairs, bodies, walls)
    for c in range(n):
        total += pairs[c].gap
        speed = max(speed, abs(bodies[c + 1].u - bodies[c].u))
    clock.length, clock.speed = max(clock.length, total / n), speed  # what is shaken expands
    if run.slow >= 0.0:
        run.slow = speed * 2.0**-16
    if speed > 0.0:
        clock.window = max(clock.window, span(clock.length, speed, clock.strength))
