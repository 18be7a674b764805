"""Fixed steps of a long chain without a log: some steps of one stretch while it lies in the cache, then the next.

A signal passes one ball a step. So a stretch with a margin of ``reach + 1`` balls on either side takes `reach` steps
without asking the rest; what the margins then hold is wrong and is thrown away. The loops are plain, with a choice
between two numbers for every branch, over rows of one array at fixed distances: compilers turn them into vector code.

For Verlet and symplectic Euler, and forces √ξ (k ξ + γ ξ̇) or k ξ + γ ξ̇; the bits are those of `granular.md.march`.
Both methods kick each ball twice a step: `before` the drift with the old force, `after` it with the new one
(Verlet: dt/2 each; Euler: dt and nothing).
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

from granular._kernels import kernel

REACH = 24
"""Steps of a stretch before the next one has its turn."""
BLOCK = 380
"""Pairs of a stretch, without margins; its rows should fit in the first-level cache (48 kB)."""
LENGTH = BLOCK + 2 * (REACH + 1) + 2
"""Length of a row of the work space: margins, and a pair without force at either end."""
ROWS = 13
XI, V, GUESS, RAW, WAS, W, FALL, K, GAMMA, DEEPEST, BESIDE, SHARED, ENDED = range(0, ROWS * LENGTH, LENGTH)
"""Where the rows begin. Pair j of the stretch is at j + 1, between the balls j and j + 1; both ends are pairs at 0."""

Chain = namedtuple("Chain", "xi v raw deepest beside shared")
"""What changes: overlaps, velocities, unclipped forces; largest overlaps, also together with the next pair; impulse
exchanged while a neighbouring pair was active."""
Given = namedtuple("Given", "w fall k gamma root dt before after")
"""What does not: inverse masses, free acceleration; stiffness and damping of the pairs; whether √ξ is a factor of the
force; the step, and its two kicks."""


@kernel
def kick(m: int, after: float, before: float, dt: float, a: Any) -> None:
    """End one step of `m` balls and begin the next; a rate-dependent force will see the velocities of `GUESS`."""
    for i in range(m):
        below = a[RAW + i] if a[RAW + i] > 0.0 else 0.0
        above = a[RAW + 1 + i] if a[RAW + 1 + i] > 0.0 else 0.0
        acc = a[W + i] * (below - above) + a[FALL + i]
        v = a[V + i] + after * acc
        a[GUESS + i] = v + dt * acc
        a[V + i] = v + before * acc


@kernel
def move(m: int, dt: float, root: bool, a: Any) -> None:
    """Move `m` pairs, and evaluate their unclipped forces."""
    for j in range(1, m + 1):
        xi = a[XI + j] + dt * (a[V - 1 + j] - a[V + j])
        x = xi if xi > 0.0 else 0.0
        f = a[K + j] * x + a[GAMMA + j] * (a[GUESS - 1 + j] - a[GUESS + j])
        if root:
            f = math.sqrt(x) * f
        a[XI + j] = xi
        a[WAS + j] = a[RAW + j]
        a[RAW + j] = f if xi > 0.0 else 0.0
        a[DEEPEST + j] = xi if xi > a[DEEPEST + j] else a[DEEPEST + j]


@kernel
def note(m: int, half: float, a: Any) -> None:
    """Count contacts that end, add up the impulse exchanged beside an active neighbour, and see who is closed."""
    for j in range(1, m + 1):
        old = a[WAS + j] if a[WAS + j] > 0.0 else 0.0
        new = a[RAW + j] if a[RAW + j] > 0.0 else 0.0
        next_to = a[RAW - 1 + j] if a[RAW - 1 + j] > a[RAW + 1 + j] else a[RAW + 1 + j]
        both = a[XI + j] if a[XI + j] < a[XI + 1 + j] else a[XI + 1 + j]
        impulse = half * (old + new)
        a[SHARED + j] += impulse if next_to > 0.0 else 0.0
        a[ENDED + j] += 1.0 if old > 0.0 >= new else 0.0
        a[BESIDE + j] = both if both > a[BESIDE + j] else a[BESIDE + j]


@kernel
def advance(m: int, reach: int, witness: int, given: Any, a: Any) -> bool:
    """Take `reach` steps of `m` pairs; false as soon as the pair `witness` (if not -1) opens."""
    dt, half = given.dt, 0.5 * given.dt
    kick(m + 1, 0.0, given.before, dt, a)
    for k in range(reach):
        move(m, dt, given.root, a)
        note(m, half, a)
        kick(m + 1, given.after, given.before if k + 1 < reach else 0.0, dt, a)
        if witness >= 0 and a[XI + 1 + witness] <= 0.0:
            return False
    return True


@kernel
def load(lo: int, m: int, given: Any, chain: Any, a: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the work space."""
    for i in range(m + 1):
        a[V + i], a[W + i], a[FALL + i] = chain.v[lo + i], given.w[lo + i], given.fall[lo + i]
    for j in range(m):
        a[XI + 1 + j], a[RAW + 1 + j], a[ENDED + 1 + j] = chain.xi[lo + j], chain.raw[lo + j], 0.0
        a[K + 1 + j], a[GAMMA + 1 + j], a[SHARED + 1 + j] = given.k[lo + j], given.gamma[lo + j], chain.shared[lo + j]
        a[DEEPEST + 1 + j], a[BESIDE + 1 + j] = chain.deepest[lo + j], chain.beside[lo + j]
    a[RAW], a[XI + 1 + m], a[RAW + 1 + m] = 0.0, 0.0, 0.0


@kernel
def store(lo: int, first: int, stop: int, a: Any, chain: Any) -> int:
    """Copy the pairs from `first` to before `stop` out of a work space that begins at `lo`; return contacts ended."""
    ended = 0.0
    for c in range(first, stop):
        i, j = c - lo, c - lo + 1
        chain.v[c], chain.xi[c], chain.raw[c], chain.shared[c] = a[V + i], a[XI + j], a[RAW + j], a[SHARED + j]
        chain.deepest[c], chain.beside[c] = a[DEEPEST + j], a[BESIDE + j]
        ended += a[ENDED + j]
    chain.v[stop] = a[V + stop - lo]  # of the next stretch, which will overwrite it, or of the last ball
    return int(ended)


@kernel
def leap(reach: int, witness: int, given: Any, old: Any, new: Any, a: Any) -> int:
    """Take `reach` steps of the whole chain from `old` to `new`; return contacts ended, or -1 if `witness` opened."""
    pairs, ended = len(old.xi), 0
    for first in range(0, pairs, BLOCK):
        stop = min(first + BLOCK, pairs)
        lo, hi = max(0, first - reach - 1), min(pairs, stop + reach + 1)
        load(lo, hi - lo, given, old, a)
        if not advance(hi - lo, reach, witness - lo if first <= witness < stop else -1, given, a):
            return -1
        ended += store(lo, first, stop, a, new)
    return ended
