"""A grid of values, and bisection of every change between neighbours, in whichever direction.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from granular.thresholds.criteria import Value

LEAST = 1e-9
"""Share of the scan below which a value is as good as 0."""
Judge = Callable[[float], Value]


def scanned(judge: Judge, grid: Sequence[float], within: float, whole: bool = False) -> Iterator[Value]:
    """Judge every value of an ascending grid, then bisect changes of the verdict until they are known to `within`.

    `within` is relative to the value, or to `LEAST` of what is scanned if that is more. Where a midpoint has a third
    verdict, both halves are cut further. What lies between two neighbours of the grid with the same verdict is not
    seen. Of `whole` numbers only whole ones are tried.
    """
    found: list[Value] = []
    least = LEAST * (grid[-1] - grid[0])
    todo: Sequence[float] = grid
    while todo:
        for value in todo:
            found.append(judge(value))
            yield found[-1]
        found.sort(key=lambda one: one.value)
        todo = [middle(a.value, b.value, whole) for a, b in pairwise(found)
                if a.verdict != b.verdict and wide(a.value, b.value, within, least, whole)]


def wide(low: float, high: float, within: float, least: float, whole: bool) -> bool:
    """Whether an interval must be cut further, and can be."""
    return high - low > within * max(abs(low), abs(high), least) and low < middle(low, high, whole) < high


def middle(low: float, high: float, whole: bool) -> float:
    """Where an interval is cut: at the geometric mean if it spans a factor of two or more, else at the mean."""
    mean = math.sqrt(low) * math.sqrt(high) if 0.0 < 2.0 * low < high else 0.5 * low + 0.5 * high
    return float(round(mean)) if whole else mean
