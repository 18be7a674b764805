"""Boundaries between contact counts, found by bisection of many intervals at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from granular import _check
from granular.sweeps.axes import Values

Counts = Callable[[list[Values]], Values]
"""Contact counts (S, pairs) at the rows of some columns of parameters."""


class Edges(NamedTuple):
    """Intervals in which the contact counts jump.

    Attributes
    ----------
    columns : list of arrays
        Parameters of each edge, those of the refined axis left out as nan.
    ends : (E, 2) array
        Lower and upper end of the interval on the refined axis.
    counts : (E, 2, pairs) array
        Contact counts at both ends.
    """

    columns: list[Values]
    ends: Values
    counts: Values


def edges(axis: int, columns: Sequence[Values], grid: Values, shape: tuple[int, ...], counts: Counts,
          precision: float) -> Edges:
    """Bisect every jump between neighbours of the grid along `axis` until it is known to a relative `precision`.

    An interval whose midpoint has a third count is cut in two. A window that lies between two points of the grid, with
    the same count on both, is not seen.
    """
    _check.number("precision", precision, at_least=1e-15, at_most=0.1)
    lower, upper, low_counts, high_counts = _jumps(axis, shape, grid)
    ends = np.stack([columns[axis][lower], columns[axis][upper]], axis=1).astype(np.float64)
    others = [column[lower] for column in columns]
    both = np.stack([low_counts, high_counts], axis=1)
    while True:
        middle = 0.5 * (ends[:, 0] + ends[:, 1])
        wide = np.abs(ends[:, 1] - ends[:, 0]) > precision * np.abs(ends).max(axis=1, initial=0.0)
        wide &= (middle != ends[:, 0]) & (middle != ends[:, 1])
        if not wide.any():
            break
        found = counts([middle[wide] if k == axis else other[wide] for k, other in enumerate(others)])
        halves = []
        for side, other_side in ((0, 1), (1, 0)):
            differs = (found != both[wide][:, side]).any(axis=1)
            part = np.flatnonzero(wide)[differs]
            span, count = ends[part].copy(), both[part].copy()
            span[:, other_side], count[:, other_side] = middle[part], found[differs]
            halves.append((part, span, count))
        kept = np.flatnonzero(~wide)
        source = np.concatenate([kept, *(half[0] for half in halves)])
        ends = np.concatenate([ends[kept], *(half[1] for half in halves)])
        both = np.concatenate([both[kept], *(half[2] for half in halves)])
        others = [other[source] for other in others]
    order = np.lexsort((ends[:, 0], *(others[k] for k in reversed(range(len(others))) if k != axis)))
    columns_found = [np.full(len(order), math.nan) if k == axis else other[order] for k, other in enumerate(others)]
    return Edges(columns_found, ends[order], both[order])


def _jumps(axis: int, shape: tuple[int, ...], grid: Values) -> tuple[Any, Any, Values, Values]:
    """Flat places of neighbours along `axis` with different counts, and the counts; cells without any are left out."""
    cells = np.moveaxis(np.arange(len(grid)).reshape(shape), axis, -1)
    left, right = cells[..., :-1].ravel(), cells[..., 1:].ravel()
    jump = (grid[left] != grid[right]).any(axis=1) & (grid[left] >= 0).any(axis=1) & (grid[right] >= 0).any(axis=1)
    return left[jump], right[jump], grid[left[jump]], grid[right[jump]]
