"""Boundaries between contact counts, found by bisection of many intervals at once.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from granular import _check
from granular.sweeps.axes import Values

Counts = Callable[[list[Values]], Values]
"""Contact counts (S, pairs) at the rows of some columns of parameters."""


class Edge(NamedTuple):
    """An interval of one axis in which the contact counts jump; the others have the values of cell `row`."""

    row: int
    ends: tuple[float, float]
    counts: tuple[list[int], list[int]]

    def wide(self, precision: float) -> bool:
        """Whether it can and must be cut further."""
        low, high = self.ends
        return abs(high - low) > precision * max(abs(low), abs(high)) and self.middle not in self.ends

    @property
    def middle(self) -> float:
        """Where it is cut."""
        return 0.5 * (self.ends[0] + self.ends[1])

    def halves(self, found: list[int]) -> Iterator[Edge]:
        """Those halves that hold a jump, if these are the counts in the middle."""
        if found != self.counts[0]:
            yield Edge(self.row, (self.ends[0], self.middle), (self.counts[0], found))
        if found != self.counts[1]:
            yield Edge(self.row, (self.middle, self.ends[1]), (found, self.counts[1]))


def edges(axis: int, columns: Sequence[Values], grid: Values, shape: tuple[int, ...], counts: Counts,
          precision: float) -> list[Edge]:
    """Bisect every jump between neighbours of the grid along `axis` until it is known to a relative `precision`.

    An interval whose midpoint has a third count is cut in two. A window that lies between two points of the grid, with
    the same count on both, is not seen. Cells without any count are left out.
    """
    _check.number("precision", precision, at_least=1e-15, at_most=0.1)
    cells = np.moveaxis(np.arange(len(grid)).reshape(shape), axis, -1)
    left, right = cells[..., :-1].ravel(), cells[..., 1:].ravel()
    jump = (grid[left] != grid[right]).any(axis=1) & (grid[left] >= 0).any(axis=1) & (grid[right] >= 0).any(axis=1)
    along = columns[axis].astype(np.float64)
    todo = [Edge(a, (float(along[a]), float(along[b])), (grid[a].tolist(), grid[b].tolist()))
            for a, b in zip(left[jump].tolist(), right[jump].tolist(), strict=True)]
    done: list[Edge] = []
    while todo:
        wide = [edge for edge in todo if edge.wide(precision)]
        done += [edge for edge in todo if not edge.wide(precision)]
        rows = [edge.row for edge in wide]
        middle = np.array([edge.middle for edge in wide])
        points = [middle if k == axis else column[rows] for k, column in enumerate(columns)]
        found: Any = counts(points) if wide else []
        todo = [half for edge, count in zip(wide, found, strict=True) for half in edge.halves(count.tolist())]

    def place(edge: Edge) -> tuple[Any, ...]:
        return *(column[edge.row] for k, column in enumerate(columns) if k != axis), edge.ends[0]

    return sorted(done, key=place)
