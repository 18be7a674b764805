"""Fixed steps of a long chain without a log: some steps of one block while it lies in the cache, then the next.

May be skipped: faster, same bits. A push goes one ball far a step. So a block with a margin of ``REACH + 1`` pairs on
either side takes its steps without asking the rest; what the margins then hold is wrong and is thrown away.

For methods that kick each ball before and after the drift (`granular.md.integrators.Integrator.kicks`), and forces
√ξ (k ξ + γ ξ̇) or k ξ + γ ξ̇. Few columns are needed, and they are rows of one array at fixed distances, with a choice
between two numbers for every branch: compilers turn the loops into vector code.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.md.integrators import Integrator, accelerations
from granular.md.march import DONE, FLIGHT, Memory, exchange, march

REACH = 24
"""Steps of a block before the next one has its turn."""
BLOCK = 380
"""Pairs of a block, without margins; its rows should fit in the first-level cache (48 kB)."""
LENGTH = BLOCK + 2 * (REACH + 1) + 2
"""Length of a row of the work space: margins, and a pair without force at either end."""
V, GUESS, W, FALL = range(0, 4 * LENGTH, LENGTH)
"""Where the rows of the balls begin: velocities, those that forces see, inverse masses, free accelerations."""
XI, RAW, WAS, K, GAMMA, DEEPEST, BESIDE, SHARED, ENDED = range(4 * LENGTH + 1, 13 * LENGTH, LENGTH)
"""Where those of the pairs begin, behind a pair at -1: overlaps, unclipped forces now and a step ago, the law's
coefficients; largest overlaps, also together with the next pair; impulse beside an active pair; contacts ended."""

Window = namedtuple("Window", "rows then until before after")
"""The work space; what is noted of the whole chain after the steps; that no pair is to be stopped at, as `march` takes
it; the two kicks of a step in s."""


def window(memory: Memory, integrator: Integrator, dt: float) -> Window:
    """Return what a run needs beside its memory."""
    then = memory.now._replace(**{name: np.zeros(len(memory.s.xi)) for name in ("deepest", "beside", "shared")})
    return Window(np.zeros(13 * LENGTH), then, (-1, 0), *(part * dt for part in integrator.kicks))


@kernel
def kick(m: int, after: float, before: float, dt: float, a: Any) -> None:
    """End one step of `m` balls and begin the next; a rate-dependent force will see the velocities of `GUESS`."""
    for i in range(m):
        below = a[RAW - 1 + i] if a[RAW - 1 + i] > 0.0 else 0.0
        above = a[RAW + i] if a[RAW + i] > 0.0 else 0.0
        acc = a[W + i] * (below - above) + a[FALL + i]
        v = a[V + i] + after * acc
        a[GUESS + i] = v + dt * acc
        a[V + i] = v + before * acc


@kernel
def move(m: int, dt: float, root: bool, a: Any) -> None:
    """Move `m` pairs, and evaluate their unclipped forces."""
    for j in range(m):
        xi = a[XI + j] + dt * (a[V + j] - a[V + 1 + j])
        x = xi if xi > 0.0 else 0.0
        f = a[K + j] * x + a[GAMMA + j] * (a[GUESS + j] - a[GUESS + 1 + j])
        if root:
            f = math.sqrt(x) * f
        a[XI + j] = xi
        a[WAS + j] = a[RAW + j]
        a[RAW + j] = f if xi > 0.0 else 0.0
        a[DEEPEST + j] = xi if xi > a[DEEPEST + j] else a[DEEPEST + j]


@kernel
def note(m: int, half: float, a: Any) -> None:
    """Count contacts that end, add up the impulse exchanged beside an active neighbour, and see who is closed."""
    for j in range(m):
        old = a[WAS + j] if a[WAS + j] > 0.0 else 0.0
        new = a[RAW + j] if a[RAW + j] > 0.0 else 0.0
        next_to = a[RAW - 1 + j] if a[RAW - 1 + j] > a[RAW + 1 + j] else a[RAW + 1 + j]
        both = a[XI + j] if a[XI + j] < a[XI + 1 + j] else a[XI + 1 + j]
        impulse = half * (old + new)
        a[SHARED + j] += impulse if next_to > 0.0 else 0.0
        a[ENDED + j] += 1.0 if old > 0.0 >= new else 0.0
        a[BESIDE + j] = both if both > a[BESIDE + j] else a[BESIDE + j]


@kernel
def load(lo: int, m: int, physics: Any, here: Any, a: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the work space."""
    s, now, laws = here.s, here.now, physics.laws
    for i in range(m + 1):
        a[V + i], a[W + i], a[FALL + i] = s.v[lo + i], physics.w[lo + i], physics.fall[lo + i]
    for j in range(m):
        a[XI + j], a[RAW + j], a[K + j], a[GAMMA + j] = s.xi[lo + j], s.raw[lo + j], laws.k[lo + j], laws.gamma[lo + j]
        a[DEEPEST + j], a[BESIDE + j], a[SHARED + j] = now.deepest[lo + j], now.beside[lo + j], now.shared[lo + j]
        a[ENDED + j] = 0.0
    a[RAW - 1] = a[RAW + m] = a[XI + m] = 0.0


@kernel
def store(lo: int, first: int, stop: int, a: Any, there: Any) -> int:
    """Copy the pairs from `first` to before `stop` out of a work space that begins at `lo`; return contacts ended."""
    s, now, ended = there.s, there.now, 0.0
    for c in range(first, stop):
        j = c - lo
        s.xi[c], s.v[c], s.raw[c] = a[XI + j], a[V + j], a[RAW + j]
        now.deepest[c], now.beside[c], now.shared[c] = a[DEEPEST + j], a[BESIDE + j], a[SHARED + j]
        ended += a[ENDED + j]
    s.v[stop] = a[V + stop - lo]  # of the next block, which will overwrite it, or of the last ball
    return int(ended)


@kernel
def leap(physics: Any, here: Any, there: Any, reach: int, witness: int, window: Any) -> int:
    """Take `reach` steps of all from `here` to `there`; return contacts ended, or -1 if the pair `witness` opened."""
    pairs, ended, dt, a = len(here.s.xi), 0, physics.dt, window.rows
    for first in range(0, pairs, BLOCK):
        stop = min(first + BLOCK, pairs)
        lo, hi = max(0, first - reach - 1), min(pairs, stop + reach + 1)
        m = hi - lo
        load(lo, m, physics, here, a)
        kick(m + 1, 0.0, window.before, dt, a)
        for k in range(reach):
            move(m, dt, physics.laws.root, a)
            note(m, 0.5 * dt, a)
            kick(m + 1, window.after, window.before if k + 1 < reach else 0.0, dt, a)
            if first <= witness < stop and not a[XI + witness - lo] > 0.0:  # or no number
                return -1
        ended += store(lo, first, stop, a, there)
    return ended


@kernel
def deepest(xi: Any) -> int:
    """The pair of the largest overlap."""
    best = 0
    for c in range(len(xi)):
        best = c if xi[c] > xi[best] else best
    return best


@kernel
def march_in_blocks(physics: Any, memory: Any, start: int, steps: int, room: int, window: Any) -> tuple[int, int, int]:
    """Take up to `steps` steps as `granular.md.march.march` would, bit for bit, but leave nothing in the log.

    Blocks are used while the pair that was the deepest stays closed (so there is no free flight to be made) and no
    more than `room` contacts end; if not, these few steps are forgotten and all balls take them together.
    """
    here, there = memory, Memory(memory.old, memory.s, memory.work, window.then, memory.log)
    why, k, contacts, turned = DONE, start, 0, False
    while why != FLIGHT and contacts <= room and k < start + steps:
        reach, ended, witness = min(REACH, start + steps - k), -1, deepest(here.s.xi)
        if here.s.xi[witness] > 0.0:
            ended = leap(physics, here, there, reach, witness, window)
        if ended >= 0 and contacts + ended <= room:
            here, there, turned = there, here, not turned
            k += reach
        else:
            accelerations(here.s.raw, physics.w, physics.fall, here.s.acc)
            why, k, ended = march(physics, here, k, reach, room - contacts, *window.until)
        contacts += ended
    accelerations(here.s.raw, physics.w, physics.fall, here.s.acc)
    if turned:
        exchange(memory.old, memory.s)
        now, then = memory.now, window.then
        exchange((now.deepest, now.beside, now.shared), (then.deepest, then.beside, then.shared))
    return why, k, contacts
