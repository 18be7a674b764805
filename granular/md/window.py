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
fraction) and velocities then; number of contacts begun; whether the onset is noted of a contact still without force; rows of those that ended.
"""
COUNTED = ("step", "count", "touched")
"""Columns that hold whole numbers."""

Physics = namedtuple("Physics", "laws k gamma root w fall dt logged block")
"""What does not change: what the kernel `force` takes for laws; the coefficients of k ξ + γ ξ̇, and whether √ξ is a
factor of it; inverse masses, free accelerations, time step; whether a log is kept; pairs that a window stands for."""

Work = namedtuple("Work", "window ended pair nth")
"""The window; how many contacts ended (1,); at the onset of which contact of a pair to stop (-1: of none)."""


@kernel
def load(lo: int, m: int, physics: Any, x: Any, a: Any) -> None:
    """Copy `m` pairs from `lo` on, and their balls, into the window."""
    for i in range(m + 1):
        a.v[i + 1], a.w[i + 1], a.fall[i + 1] = x.v[lo + i], physics.w[lo + i], physics.fall[lo + i]
    for j in range(m):
        a.xi[j + 1], a.raw[j + 1] = x.xi[lo + j], x.raw[lo + j]
        a.k[j + 1], a.gamma[j + 1] = physics.k[lo + j], physics.gamma[lo + j]
        a.deepest[j + 1], a.beside[j + 1], a.shared[j + 1] = x.deepest[lo + j], x.beside[lo + j], x.shared[lo + j]
    a.raw[0] = a.raw[m + 1] = a.xi[m + 1] = 0.0
    if physics.logged:
        for j in range(m):
            a.xi_max[j + 1], a.force_max[j + 1] = x.xi_max[lo + j], x.force_max[lo + j]
            a.impulse[j + 1] = x.impulse[lo + j]
    for j in range(m if len(x.top) > 0 else 0):
        a.top[j + 1] = x.top[lo + j]
    for i in range(m + 1 if len(x.acc) > 0 else 0):
        a.acc[i + 1], a.jerk[i + 1], a.snap[i + 1] = x.acc[lo + i], x.jerk[lo + i], x.snap[lo + i]


@kernel
def store(lo: int, first: int, stop: int, physics: Any, a: Any, x: Any) -> None:
    """Copy the pairs from `first` to before `stop`, and their balls, out of the window."""
    j = first - lo + 1
    for c in range(first, stop):
        x.xi[c], x.raw[c], x.v[c] = a.xi[j], a.raw[j], a.v[j]
        x.deepest[c], x.beside[c], x.shared[c] = a.deepest[j], a.beside[j], a.shared[j]
        if physics.logged:
            x.xi_max[c], x.force_max[c], x.impulse[c] = a.xi_max[j], a.force_max[j], a.impulse[j]
        if len(x.top) > 0:
            x.top[c] = a.top[j]
        j += 1
    x.v[stop] = a.v[j]  # of the next window, which will overwrite it, or of the last ball
    j = first - lo + 1
    for i in range(first, stop + 1 if len(x.acc) > 0 else first):
        x.acc[i], x.jerk[i], x.snap[i] = a.acc[j], a.jerk[j], a.snap[j]
        j += 1


@kernel
def keep(pairs: int, x: Any, y: Any) -> None:
    """Copy what is noted of running contacts from one set of columns to another."""
    for c in range(pairs):
        y.step[c], y.part[c], y.lower[c], y.upper[c] = x.step[c], x.part[c], x.lower[c], x.upper[c]
        y.count[c], y.touched[c] = x.count[c], x.touched[c]
