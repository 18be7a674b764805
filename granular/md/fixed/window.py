"""State table of a chain under a fixed time step, its windows and its free flight.

The state of a run is a table with one row per quantity. A row has an entry for every pair or body of the chain: pair c
at index c + 1, body i at index i + 1. A pair without contact is added before the first pair and after the last pair.
On a ring, body 0 is repeated after the last body.

The kernels do not step these rows directly, but a *window*: a record with the same rows for a part of the chain, short
enough for the processor cache. In a window that starts at pair `lo`, pair c has index c - lo + 1. `m` is the number of
its pairs, and kernels call the record `a`. Loops over a window start at 0 and have no branches, so compilers can
vectorize them. In interpreted runs, rows are lists, and a window contains the whole chain.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.flight import gap_after, hung_after, hung_time_to_contact, time_to_contact
from granular._engine.kernels import RING, kernel

WINDOW_LENGTH = 2008
"""Number of entries in each row of a window.

All rows together fit into the second-level cache. A power of two would map all rows to the same cache lines."""
ROW_NAMES = (
    "xi", "raw", "v", "deepest", "beside", "shared",
    "xi_max", "force_max", "impulse", "step", "part", "lower", "upper", "count", "touched",
    "top", "acc", "jerk", "snap",
    "lost", "lost_low", "work", "work_low", "heat", "heat_low", "off",
    "was_xi", "was_raw", "was_v", "k", "gamma", "w", "fall", "square",
    "half", "guess", "rate", "start", "sway",
)
"""Names of the rows of a window.

* `xi`, `raw`, `v`: overlap in m and unclipped force in N of each pair, velocity in m/s of each body.
* `deepest`: largest overlap of the pair in the whole run.
* `beside`: largest overlap that the pair and the next pair had simultaneously, the smaller of their two overlaps.
* `shared`: impulse in N s of the pair while a neighbouring pair exerted a force.
* `xi_max` to `upper`, if a log is kept: largest overlap, largest force and impulse of the unfinished contact, and step
  number, fraction of the step and velocities of both bodies at its onset.
* `count`, `touched`: number of contacts that have begun, and whether the onset of a contact without force is stored.
* `top`, for laws with memory: largest overlap of the unfinished contact.
* `acc`, `jerk`, `snap`, for Gear's method: acceleration of each body and its first two derivatives.
* `lost` to `heat_low`, for driven or thermal walls: energy dissipated by the pair, and work and heat of the wall, in J.
  Each is a sum of two floats. Work and heat are stored at the index of the wall.
* `off`, for pendula: displacement in m of each ball.

The other rows exist in windows only. `was_xi`, `was_raw` and `was_v` are the state one step ago. `k` and `gamma` are
coefficients of the laws, `w` inverse masses, `fall` free accelerations, `square` squares of Ω. `half` and `guess` are
velocities within a step. `rate`, `start` and `sway` are sums and initial displacements of Runge-Kutta."""
(
    XI, RAW, V, DEEPEST, BESIDE, SHARED,
    XI_MAX, FORCE_MAX, IMPULSE, STEP, PART, LOWER, UPPER, COUNT, TOUCHED, TOP, ACC, JERK, SNAP,
    LOST, LOST_LOW, WORK, WORK_LOW, HEAT, HEAT_LOW, OFF,
) = range(26)
"""Indices of the rows in the state table of a chain, in the order of `ROW_NAMES`.

The table ends with the last row that the run needs."""
KEEPS_LOG: int = 0
"""Whether a contact log is kept: 0, 1, or `ENERGIES`.

Kernels then store peaks and the state one step ago. `Stepper` uses copies of the kernels in which this constant is
replaced."""
ENERGIES = 2
"""Value of `KEEPS_LOG` in runs that compute the energy of each contact.

The row `force_max` then contains ∫ F ξ̇ dt in J instead of the largest force."""
HAS_DAMPING: bool = True
"""Whether contact forces depend on velocities. It is replaced like `KEEPS_LOG`."""
FIRST_WAS_ROW, FIRST_GIVEN_ROW = ROW_NAMES.index("was_xi"), ROW_NAMES.index("k")
WINDOW_RECORD = np.dtype([(name, float, (WINDOW_LENGTH,)) for name in ROW_NAMES])
HALF, WHOLE, LAST, START, MIDDLE, END = range(6)
"""Indices of six velocities in m/s of a driven wall in a step.

`HALF` and `WHOLE` are its mean velocities in the first half and in the whole step. `LAST` is the rate of the last
Runge-Kutta stage with which all four stages add up to `WHOLE`. `START`, `MIDDLE` and `END` are its velocities at these
times of the step."""
K, GAMMA, INVERSE_MASS, FALL, SQUARE = range(5)
"""Indices of the constant rows `k` to `square`.

They begin at `FIRST_GIVEN_ROW` in a window."""
MAX_ROW_LENGTH = 1 << 40
"""Number of entries that no row reaches."""

Physics = namedtuple("Physics", "laws given root dt logged memory block walls ring heat")
"""Constants of a run, as the kernels read them.

* `laws`: force laws in the form that the kernel `force` accepts.
* `given`: constant rows `K` to `SQUARE`.
* `root`: whether the force is √ξ (k ξ + γ ξ̇) instead of k ξ + γ ξ̇.
* `dt`: time step in s.
* `logged`, `memory`: whether a log is kept (`KEEPS_LOG`), and whether a law has memory.
* `block`: number of pairs per window without its margins.
* `walls`, `heat`: driven walls and thermal walls (see `walls`), or 0.
* `ring`: number of pairs of a ring, or 0."""
Work = namedtuple("Work", "window rows was given ended log pair nth low high", defaults=(0, MAX_ROW_LENGTH))
"""Work space of the kernels.

* `window`, `rows`: the window as a record, and as a table of its rows.
* `was`, `given`: the parts of this table with the state one step ago, and with the constant rows.
* `ended`, `log`: number of finished contacts, shape (1,), and their log rows.
* `pair`, `nth`: pair and number of the contact at whose onset the run stops. Pair -1 denotes no contact.
* `low`, `high`: the pairs `low` to `high` - 1 are stepped."""


@kernel
def copy(count: int, source: Any, i: int, target: Any, j: int) -> None:
    """Copy `count` entries of each row, from index `i` of `source` to `j` of `target`.

    Rows that only one of the two tables has are ignored.
    """
    # the guard shows compilers that no index is negative
    if 0 <= i < MAX_ROW_LENGTH and 0 <= j < MAX_ROW_LENGTH:
        for r in range(min(len(source), len(target))):
            source_row, target_row = source[r], target[r]
            for k in range(count):
                target_row[j + k] = source_row[i + k]


@kernel
def load(lo: int, m: int, physics: Any, x: Any, work: Any) -> None:
    """Copy `m` pairs from pair `lo` onwards, and their bodies, into the window.

    The pairs just outside the window get no overlap and no force, except on a ring.
    """
    if RING:
        copy_ring(m + 2, x, lo, physics.ring, work.rows)
        copy_ring(m + 2, physics.given, lo, physics.ring, work.given)
        return
    copy(m + 2, x, lo, work.rows, 0)
    copy(m + 2, physics.given, lo, work.given, 0)
    a = work.window
    a.raw[0] = a.raw[m + 1] = 0.0
    a.xi[0] = a.xi[m + 1] = a.was_xi[0] = a.was_xi[m + 1] = -1.0


@kernel
def copy_ring(count: int, source: Any, lo: int, ring: int, target: Any) -> None:
    """Copy `count` entries of each row of a ring, starting with pair `lo` - 1.

    After the last of the `ring` pairs, the copy continues with the first pair.
    """
    i, done = (lo - 1) % ring + 1, 0
    while done < count:
        length = min(count - done, ring + 1 - i)
        copy(length, source, i, target, done)
        i, done = 1, done + length


@kernel
def connect_ring_ends(physics: Any, m: int, a: Any) -> None:
    """Connect both ends of a window that contains a whole ring."""
    if RING and m == physics.ring:
        a.raw[0], a.raw[m + 1], a.xi[m + 1] = a.raw[m], a.raw[1], a.xi[1]


@kernel
def store(lo: int, first: int, stop: int, work: Any, x: Any) -> None:
    """Copy the pairs `first` to `stop` - 1 and their bodies to the state table `x`.

    The last copied body also belongs to the next window, which overwrites it.
    """
    copy(stop - first + 1, work.rows, first - lo + 1, x, first + 1)


@kernel
def set_wall_speeds(physics: Any, lo: int, m: int, row_1: Any, kind_1: int, row_2: Any, kind_2: int) -> None:
    """Write two velocities of each driven wall in a step to two rows of a window.

    Parameters
    ----------
    row_1, row_2 : row
        Rows of the window, such as `half` and `guess`.
    kind_1, kind_2 : int
        Velocities to write to them, `HALF` to `END`.
    """
    walls = physics.walls
    for i in range(len(walls.bodies)):
        index, velocities = walls.bodies[i] - lo, walls.drive[0 if walls.bodies[i] == 0 else 1]
        if 0 <= index <= m:
            row_1[index + 1], row_2[index + 1] = velocities[kind_1], velocities[kind_2]


def copy_state(x: Any) -> Any:
    """Return a copy of the state table `x`, an array or a list of lists."""
    return x.copy() if isinstance(x, np.ndarray) else [row.copy() for row in x]


@kernel
def time_to_touch(x: Any, pull: Any, low: int, high: int) -> float:
    """Return the time in s until a gap of pairs `low` to `high` - 1 closes, or inf.

    `x` is the state table, and `pull` the closing acceleration of each pair in m/s².
    """
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
    """Advance the state table `x` of a chain without contacts by a time `dt` in s.

    `pull` are the closing accelerations of the pairs in m/s², and `fall` the accelerations of the bodies. A gap that
    rounding makes negative is set to 0.
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
    """Return the time in s until the first gap between pendula closes, or inf.

    `omega` is Ω in rad/s, and `rest` the gap in m of each pair with both pendula at rest.
    """
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(len(rest)):
        t = hung_time_to_contact(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c])
        if t < first:
            first = t
    return first


@kernel
def swing(x: Any, omega: float, rest: Any, dt: float) -> None:
    """Advance the state table `x` of pendula without contacts by a time `dt` in s.

    `omega` and `rest` are as for `time_to_touch_hung`.
    """
    xi, raw, v, off = x[XI], x[RAW], x[V], x[OFF]
    for c in range(len(rest)):
        gap, _ = hung_after(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        off[i], v[i] = hung_after(off[i], v[i], omega, 0.0, dt)
        x[TOP][i], x[ACC][i] = 0.0, -omega * omega * off[i]
        x[JERK][i], x[SNAP][i] = -omega * omega * v[i], -omega * omega * x[ACC][i]
