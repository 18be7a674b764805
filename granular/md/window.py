"""A stretch of the chain while it takes some steps: rows of numbers at fixed distances, for pairs and for balls.

What changes in a run stands in columns as long as the chain. Kernels step a *window* of it, a record whose rows lie in
the cache: pair c at ``c - lo + 1``, ball i at ``i - lo + 1``, if `lo` is its first pair; the entries before and behind
the pairs are open. Rows at fixed distances, loops that begin at 0 and know no branches: compilers turn these into
vector code. Interpreted, a window is an object with lists, and holds the whole chain.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel

LENGTH = 328
"""Entries of a row: all rows should fit in the first-level cache (48 kB)."""
ROWS = (
    "xi", "raw", "v", "was_xi", "was_raw", "was_v", "k", "gamma", "w", "fall", "half", "guess",
    "xi_max", "force_max", "impulse", "deepest", "beside", "shared", "top", "acc", "jerk", "snap", "rate",
)  # fmt: skip
"""Overlaps, unclipped forces, velocities, also a step ago; the law's coefficients, inverse masses, free accelerations;
velocities within a step; notes as in `Chain`; largest overlap of the running contact; accelerations and Gear's higher
derivatives of the velocity; a sum of Runge and Kutta."""
WINDOW = np.dtype([(name, float, (LENGTH,)) for name in ROWS])

Chain = namedtuple(
    "Chain",
    "xi raw v top acc jerk snap deepest beside shared xi_max force_max impulse step part lower upper count touched log",
)
"""What changes in a run. State: overlap and unclipped force (P,), velocity (n,), largest overlap of the running contact
(P,; no values if no law has memory), acceleration and Gear's higher derivatives of the velocity (n,; no values for the
others). Over the whole run: largest overlap, largest overlap of the pair and the next one together, impulse exchanged
while a neighbouring pair was active. Of the running contact, if a log is kept: peaks and impulse so far; onset (step,
fraction) and velocities then; number of contacts begun; whether the onset is noted of a contact
still without force; rows of those that ended.
"""
MOST = 1 << 40
"""More entries than any column has."""
COUNTED = ("step", "count", "touched")
"""Columns that hold whole numbers."""

Physics = namedtuple("Physics", "laws k gamma root w fall dt logged block")
"""What does not change: what the kernel `force` takes for laws; the coefficients of k ξ + γ ξ̇, and whether √ξ is a
factor of it; inverse masses, free accelerations, time step; whether a log is kept; pairs that a window stands for."""

Work = namedtuple("Work", "window ended pair nth")
"""The window; how many contacts ended (1,); at the onset of which contact of a pair to stop (-1: of none)."""


@kernel
def copy(count: int, sources: Any, i: int, targets: Any, j: int) -> None:
    """Copy some entries of several columns, but for those that have none.

    Compilers need to know that no place is negative.
    """
    for source, target in zip(sources, targets):  # noqa: B905
        if len(source) > 0 and len(target) > 0 and 0 <= i < MOST and 0 <= j < MOST:
            for k in range(count):
                target[j + k] = source[i + k]


@kernel
def of_balls(x: Any) -> Any:
    """Columns or rows of the balls that change."""
    return x.v, x.acc, x.jerk, x.snap


@kernel
def of_pairs(x: Any) -> Any:
    """Columns or rows of the pairs that change in every step."""
    return x.xi, x.raw, x.top, x.deepest, x.beside, x.shared, x.xi_max, x.force_max, x.impulse


@kernel
def load(lo: int, m: int, physics: Any, x: Any, a: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the window."""
    copy(m + 1, of_balls(x), lo, of_balls(a), 1)
    copy(m, of_pairs(x), lo, of_pairs(a), 1)
    copy(m + 1, (physics.w, physics.fall), lo, (a.w, a.fall), 1)
    copy(m, (physics.k, physics.gamma), lo, (a.k, a.gamma), 1)
    a.raw[0] = a.raw[m + 1] = a.xi[m + 1] = 0.0


@kernel
def store(lo: int, first: int, stop: int, a: Any, x: Any) -> None:
    """Copy the pairs from `first` to before `stop`, and their balls, out of the window.

    The last ball is one of the next window, which will overwrite it, or the last of all.
    """
    copy(stop - first + 1, of_balls(a), first - lo + 1, of_balls(x), first)
    copy(stop - first, of_pairs(a), first - lo + 1, of_pairs(x), first)


@kernel
def keep(pairs: int, x: Any, y: Any) -> None:
    """Copy what is noted of running contacts from one set of columns to another."""
    copy(pairs, (x.step, x.count, x.touched), 0, (y.step, y.count, y.touched), 0)
    copy(pairs, (x.part, x.lower, x.upper), 0, (y.part, y.lower, y.upper), 0)
