"""The slow motion of a pile on a driven wall: the polynomial that obeys its equation on a stretch of the wall's path.
May be skipped: rarer, piles that ride on a driven wall.

Among all motions of overlaps that touch forever, ξ'' = p(t) - W F(ξ, ξ'), p of degree 17 on a panel of the path, one is
as slow as the wall is. Of linear laws it is a polynomial too, exactly: its coefficients follow from the last to the
first,

    W K S_j = p_j - (j+1) W Γ S_(j+1) - (j+1)(j+2) S_(j+2) .

Between two walls W is singular, and the sum of the overlaps is what the walls make it: this stands for the last row.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array
from granular.md.located.system import ORDER

TAMED = 4.0
"""A slow motion is no larger than so many times what the forces would bring about at rest."""


class Pressed(NamedTuple):
    """What presses on a pile during a stretch of length `h` in s: coefficients in τ, t = hτ, one row each.

    `pull` (ORDER+1, pairs) are accelerations of overlaps in m/s², `total` (ORDER+1,) is the sum of the overlaps in m
    between two walls, else None; `w` (pairs, pairs) are inverse masses in 1/kg.
    """

    h: float
    pull: Array
    total: Array | None
    w: Array


def linear(k: Array, gamma: Array, by: Pressed) -> Array | None:
    """Return overlaps (ORDER+1, pairs) in m as coefficients in τ under laws kξ + γη; None if they are not slow."""
    n, h = len(k), by.h
    static, damping = by.w * k, by.w * gamma / h
    if by.total is not None:
        static[-1], damping[-1] = 1.0, 0.0
    try:
        solve = np.linalg.inv(static)
    except np.linalg.LinAlgError:
        return None
    out, size, still = np.zeros((ORDER + 3, n)), 0.0, 0.0
    for j in range(ORDER, -1, -1):
        bend = (j + 1.0) * (j + 2.0) / (h * h) * out[j + 2]
        right = by.pull[j] - (j + 1.0) * (damping @ out[j + 1]) - bend
        alone = by.pull[j].copy()
        if by.total is not None:
            right[-1] = alone[-1] = by.total[j]
        out[j] = solve @ right
        size += float(abs(out[j]).max())
        still += float(abs(solve @ alone).max())
    return out[: ORDER + 1] if size <= TAMED * still < math.inf else None


def inverse_masses(pairs: list[Any]) -> Array:
    """W: how the forces of touching pairs (rows of records, from the bottom up) bend their overlaps apart, in 1/kg."""
    lower, own, upper = np.array([(p.lower, p.inverse, p.upper) for p in pairs]).T
    w: Array = np.diag(own) - np.diag(lower[1:], -1) - np.diag(upper[:-1], 1)
    return w
