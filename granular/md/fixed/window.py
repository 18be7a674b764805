"""State of a chain as rows of numbers, its free flight, and windows of it.

All variables of a run are rows as long as the chain: pair c at ``c + 1``, ball i at ``i + 1``. An open pair precedes
the first pair, and another one follows the last. On a ring ball 0 is repeated behind the last ball. Kernels step a
*window*: a record of such rows that fits into the cache and starts at pair `lo`, with pair c at ``c - lo + 1``. Rows at
fixed distances and loops without branches that start at 0 can be vectorized by compilers. In interpreted runs, rows are
lists, and a window contains the whole chain.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.flight import gap_after, hung, hung_after, time_to_contact
from granular._engine.kernels import RING, kernel

WINDOW_LENGTH = 2008
"""Number of entries of a window row.

All rows should fit into the second-level cache. A power of two would map all rows to the same cache lines."""
ROW_NAMES = (
    "xi", "raw", "v", "deepest", "beside", "shared",
    "xi_max", "force_max", "impulse", "step", "part", "lower", "upper", "count", "touched",
    "top", "acc", "jerk", "snap",
    "lost", "lost_low", "work", "work_low", "heat", "heat_low", "off",
    "was_xi", "was_raw", "was_v", "k", "gamma", "w", "fall", "square",
    "half", "guess", "rate", "start", "sway",
)
"""Names of the rows.

Overlap, unclipped force, velocity. For the whole run: largest overlap, overlap of the pair together with the next one,
impulse exchanged while a neighbouring pair was active. If a log is kept, for the running contact: peaks and impulse so
far, step and fraction of its onset, velocities then, number of contacts begun, and whether the onset of a contact still
without force is noted. For laws with memory: largest overlap of the running contact. For Gear's method: acceleration
and higher derivatives of the velocity. With driven or thermal walls: energy dissipated by the pair, and work and heat
of the wall that is its lower body (or of the ceiling), in two floats each. For pendula: displacements.

In windows only: the state one step ago, coefficients of the law, inverse masses, free accelerations, squares of Ω. Also
velocities within a step, a sum of Runge-Kutta, displacements at the start of its step, and their sum."""
(
    XI, RAW, V, DEEPEST, BESIDE, SHARED,
    XI_MAX, FORCE_MAX, IMPULSE, STEP, PART, LOWER, UPPER, COUNT, TOUCHED, TOP, ACC, JERK, SNAP,
    LOST, LOST_LOW, WORK, WORK_LOW, HEAT, HEAT_LOW, OFF,
) = range(26)
"""Indices of the rows that a chain can have.

A chain has all rows up to the last one that the run needs."""
KEEPS_LOG: bool = False
"""Whether a log is kept, so that kernels note peaks and the state before a change.

`Stepper` compiles kernels in which this constant is replaced."""
HAS_DAMPING: bool = True
"""Whether forces depend on velocities. It is replaced like `KEEPS_LOG`."""
FIRST_WAS_ROW, FIRST_GIVEN_ROW = ROW_NAMES.index("was_xi"), ROW_NAMES.index("k")
WINDOW_RECORD = np.dtype([(name, float, (WINDOW_LENGTH,)) for name in ROW_NAMES])
HALF, WHOLE, LAST, START, MIDDLE, END = range(6)
"""Velocities of a wall in a step.

First its mean in the first half, then its mean in the whole step. Then the value that makes the sum of the Runge-Kutta
rates equal to the latter. Last its velocity at the start, in the middle and at the end."""
K, GAMMA, INVERSE_MASS, FALL, SQUARE = range(5)
"""Indices of the given rows, which begin at `FIRST_GIVEN_ROW` in a window."""
MAX_ROW_LENGTH = 1 << 40
"""Larger than the number of entries of any row."""

Physics = namedtuple("Physics", "laws given root dt logged memory block walls ring heat")
"""Constants of a run.

Laws as the kernel `force` takes them, rows of coefficients, inverse masses, free accelerations and squares of Ω, and
whether √ξ is a factor of k ξ + γ ξ̇. Time step, whether a log is kept, whether laws have memory, number of pairs that a
window represents. Moving walls or 0, number of pairs of a ring or 0, thermal walls or 0: see `walls`."""
Work = namedtuple("Work", "window rows was given ended log pair nth low high", defaults=(0, MAX_ROW_LENGTH))
"""Work space of the kernels.

The window by name, as rows, as rows one step ago, and as given rows. Number of finished contacts (1,) and their log
rows. Pair (-1: none) and number of the contact at whose onset to stop. First pair, and end of the pairs that are
stepped."""


@kernel
def copy(count: int, source: Any, i: int, target: Any, j: int) -> None:
    """Copy `count` entries of each row that both tables have.

    The guard shows compilers that no index is negative.
    """
    if 0 <= i < MAX_ROW_LENGTH and 0 <= j < MAX_ROW_LENGTH:
        for r in range(min(len(source), len(target))):
            one, other = source[r], target[r]
            for k in range(count):
                other[j + k] = one[i + k]


@kernel
def load(lo: int, m: int, physics: Any, x: Any, work: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the window.

    Outside the window pairs are open, except on a ring.
    """
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
    """Copy entries of rows of a ring, from pair lo - 1 on.

    Behind the last entry the copy continues with the first one.
    """
    i, done = (lo - 1) % ring + 1, 0
    while done < count:
        part = min(count - done, ring + 1 - i)
        copy(part, source, i, target, done)
        i, done = 1, done + part


@kernel
def close(physics: Any, m: int, a: Any) -> None:
    """Connect both ends of a window that contains a whole ring."""
    if RING and m == physics.ring:
        a.raw[0], a.raw[m + 1], a.xi[m + 1] = a.raw[m], a.raw[1], a.xi[1]


@kernel
def store(lo: int, first: int, stop: int, work: Any, x: Any) -> None:
    """Copy the pairs `first` to `stop` - 1, and their balls, out of the window.

    The last ball belongs to the next window, which overwrites it and its pair, or is the last of all.
    """
    copy(stop - first + 1, work.rows, first - lo + 1, x, first + 1)


@kernel
def steer(physics: Any, lo: int, m: int, row: Any, this: int, other: Any, that: int) -> None:
    """Write velocities of driven walls in this step to two rows of a window.

    Either the drift and the velocity that forces see, or the velocities at start and end.
    """
    walls = physics.walls
    for i in range(len(walls.bodies)):
        place, given = walls.bodies[i] - lo, walls.drive[0 if walls.bodies[i] == 0 else 1]
        if 0 <= place <= m:
            row[place + 1], other[place + 1] = given[this], given[that]


def copied(x: Any) -> Any:
    """Return a copy of rows."""
    return x.copy() if isinstance(x, np.ndarray) else [row.copy() for row in x]


@kernel
def time_to_touch(x: Any, pull: Any, low: int, high: int) -> float:
    """Return the time until the first gap of pairs `low` to `high` - 1 closes, or inf."""
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(low, high):
        rate = v[c + 2] - v[c + 1]
        if xi[c + 1] == 0.0 and rate == 0.0 and pull[c] > 0.0:
            return 0.0  # a soft ball at rest on the floor sinks in immediately
        t = time_to_contact(-xi[c + 1], rate, pull[c])
        if t < first:
            first = t
    return first


@kernel
def glide(x: Any, pull: Any, fall: Any, dt: float) -> None:
    """Advance the rows of an open scene by `dt`.

    Rounding never makes a gap negative.
    """
    xi, raw, v = x[XI], x[RAW], x[V]
    for c in range(len(pull)):
        gap = gap_after(-xi[c + 1], v[c + 2] - v[c + 1], pull[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        v[i] += fall[i] * dt
    # in free flight Gear's derivatives are exact: acceleration g, all higher ones 0
    for r in range(TOP, min(len(x), SNAP + 1)):
        for i in range(len(v)):
            x[r][i] = fall[i] if r == ACC else 0.0


@kernel
def time_to_touch_hung(x: Any, omega: float, rest: Any) -> float:
    """Return the time until the first gap between pendula closes, or inf."""
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
