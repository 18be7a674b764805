"""Rows of numbers: the state of a chain, its free flight, and a stretch of it while it takes some steps.

What changes in a run stands in rows as long as the chain: pair c at ``c + 1``, ball i at ``i + 1``, with an open pair
before the first and behind the last; on a ring ball 0 comes once more behind the last. Kernels step a *window*, a
record of such rows that lie in the cache, beginning at pair `lo`: pair c at ``c - lo + 1``. Rows at fixed distances,
loops that begin at 0 and know no branches: compilers turn these into vector code. Interpreted, rows are lists, and a
window holds the whole chain.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.flight import gap_after, hung, hung_after, time_to_contact
from granular._engine.kernels import RING, kernel

LENGTH = 2008
"""Entries of a row of a window: all rows should fit in the second-level cache. No power of two: rows would begin at the
same places of it."""
ROWS = (
    "xi", "raw", "v", "deepest", "beside", "shared",
    "xi_max", "force_max", "impulse", "step", "part", "lower", "upper", "count", "touched",
    "top", "acc", "jerk", "snap",
    "lost", "lost_low", "work", "work_low", "heat", "heat_low", "off",
    "was_xi", "was_raw", "was_v", "k", "gamma", "w", "fall", "square",
    "half", "guess", "rate", "start", "sway",
)
"""Overlap, unclipped force, velocity. Over the whole run: largest overlap, an overlap of the pair and the next one
together, impulse exchanged while a neighbouring pair was active. If a log is kept, of the running contact: peaks and
impulse so far; onset (step, fraction) and velocities then; number of contacts begun; whether the onset is noted of a
contact still without force. For laws with memory: largest overlap of the running contact. For Gear's method:
acceleration and higher derivatives of the velocity. Where walls are driven or heat: what the pair dissipated, and the
work and the heat of the wall that is its lower body, or of a ceiling, in two floats each. Of pendula: displacements.

In windows only: the state a step ago; the law's coefficients, inverse masses, free accelerations, squares of Ω;
velocities within a step; a sum of Runge and Kutta, displacements at the start of their step, and the sum for these."""
(
    XI, RAW, V, DEEPEST, BESIDE, SHARED,
    XI_MAX, FORCE_MAX, IMPULSE, STEP, PART, LOWER, UPPER, COUNT, TOUCHED, TOP, ACC, JERK, SNAP,
    LOST, LOST_LOW, WORK, WORK_LOW, HEAT, HEAT_LOW, OFF,
) = range(26)
"""Places of the rows that a chain may have, too: all up to the last one that the run needs."""
LOGGED: bool = False
"""A log is kept: kernels note peaks, and the state before a change. `Stepper` has kernels made in which it says so."""
DAMPED: bool = True
"""Forces see velocities; said as `LOGGED` is."""
WAS, GIVEN = ROWS.index("was_xi"), ROWS.index("k")
WINDOW = np.dtype([(name, float, (LENGTH,)) for name in ROWS])
HALF, WHOLE, LAST, START, MIDDLE, END = range(6)
"""Of a wall in a step: its mean velocity in the first half, in all of it, and the one that makes the sum of
Runge-Kutta's rates that of all of it; its velocity at the start, in the middle, at the end."""
K, GAMMA, INVERSE_MASS, FALL, SQUARE = range(5)
"""Places of the rows that are given, which begin at `GIVEN` in a window."""
MOST = 1 << 40
"""More entries than any row has."""

Physics = namedtuple("Physics", "laws given root dt logged memory block walls ring heat")
"""What does not change: what the kernel `force` takes for laws; rows of coefficients, inverse masses, free
accelerations and squares of Ω, and whether √ξ is a factor of k ξ + γ ξ̇; time step; whether a log is kept, and whether
laws have memory; pairs that a window stands for; walls that move, or 0; pairs of a ring, or 0; thermal walls, or
0: see `walls`."""
Work = namedtuple("Work", "window rows was given ended log pair nth low high", defaults=(0, MOST))
"""The window, by name, as rows, as those of a step ago, as those that are given; how many contacts ended (1,), and
their rows; at the onset of which contact of a pair to stop (-1: of none); the pairs it is for, from one to before
another."""


@kernel
def copy(count: int, source: Any, i: int, target: Any, j: int) -> None:
    """Copy some entries of the rows that both have. Compilers need to know that no place is negative."""
    if 0 <= i < MOST and 0 <= j < MOST:
        for r in range(min(len(source), len(target))):
            one, other = source[r], target[r]
            for k in range(count):
                other[j + k] = one[i + k]


@kernel
def load(lo: int, m: int, physics: Any, x: Any, work: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the window; what lies beside them is open, but on a ring."""
    if RING:
        around(m + 2, x, lo, physics.ring, work.rows)
        around(m + 2, physics.given, lo, physics.ring, work.given)
        return
    copy(m + 2, x, lo, work.rows, 0)
    copy(m + 2, physics.given, lo, work.given, 0)
    a = work.window
    a.raw[0] = a.raw[m + 1] = 0.0
    a.xi[0] = a.xi[m + 1] = a.was_xi[0] = a.was_xi[m + 1] = -1.0


@kernel
def around(count: int, source: Any, lo: int, ring: int, target: Any) -> None:
    """Copy some entries of rows of a ring from that of pair lo - 1 on, and go on behind the last with the first."""
    i, done = (lo - 1) % ring + 1, 0
    while done < count:
        part = min(count - done, ring + 1 - i)
        copy(part, source, i, target, done)
        i, done = 1, done + part


@kernel
def close(physics: Any, m: int, a: Any) -> None:
    """Let the ends of a window that holds all of a ring see each other."""
    if RING and m == physics.ring:
        a.raw[0], a.raw[m + 1], a.xi[m + 1] = a.raw[m], a.raw[1], a.xi[1]


@kernel
def store(lo: int, first: int, stop: int, work: Any, x: Any) -> None:
    """Copy the pairs from `first` to before `stop`, and their balls, out of the window.

    The last ball is one of the next window, which will overwrite it and its pair, or the last of all.
    """
    copy(stop - first + 1, work.rows, first - lo + 1, x, first + 1)


@kernel
def steer(physics: Any, lo: int, m: int, row: Any, this: int, other: Any, that: int) -> None:
    """Give driven walls in a window, in two of its rows, velocities of this step: drift and what forces see, or those
    at its start and at its end."""
    walls = physics.walls
    for i in range(len(walls.bodies)):
        place, given = walls.bodies[i] - lo, walls.drive[0 if walls.bodies[i] == 0 else 1]
        if 0 <= place <= m:
            row[place + 1], other[place + 1] = given[this], given[that]


def copied(x: Any) -> Any:
    """A copy of rows."""
    return x.copy() if isinstance(x, np.ndarray) else [row.copy() for row in x]


@kernel
def time_to_touch(x: Any, pull: Any, low: int, high: int) -> float:
    """Time until the first gap of the pairs from `low` to before `high` closes; inf if none ever does."""
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(low, high):
        rate = v[c + 2] - v[c + 1]
        if xi[c + 1] == 0.0 and rate == 0.0 and pull[c] > 0.0:
            return 0.0  # a soft ball placed on the floor sinks in
        t = time_to_contact(-xi[c + 1], rate, pull[c])
        if t < first:
            first = t
    return first


@kernel
def glide(x: Any, pull: Any, fall: Any, dt: float) -> None:
    """Advance the rows of an open scene by `dt`; rounding never makes a gap negative."""
    xi, raw, v = x[XI], x[RAW], x[V]
    for c in range(len(pull)):
        gap = gap_after(-xi[c + 1], v[c + 2] - v[c + 1], pull[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        v[i] += fall[i] * dt
    for r in range(TOP, min(len(x), SNAP + 1)):
        for i in range(len(v)):
            x[r][i] = fall[i] if r == ACC else 0.0


@kernel
def time_to_touch_hung(x: Any, omega: float, rest: Any) -> float:
    """Time until the first gap between pendula closes; inf if none ever does."""
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(len(rest)):
        t = hung(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c])
        if t < first:
            first = t
    return first


@kernel
def swing(x: Any, omega: float, rest: Any, dt: float) -> None:
    """Advance the rows of an open scene of pendula by `dt`."""
    xi, raw, v, off = x[XI], x[RAW], x[V], x[OFF]
    for c in range(len(rest)):
        gap, _ = hung_after(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        off[i], v[i] = hung_after(off[i], v[i], omega, 0.0, dt)
        x[TOP][i], x[ACC][i] = 0.0, -omega * omega * off[i]
        x[JERK][i], x[SNAP][i] = -omega * omega * v[i], -omega * omega * x[ACC][i]
