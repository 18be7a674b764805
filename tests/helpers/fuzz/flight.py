"""Free flight of the independent solver."""

from __future__ import annotations

from typing import Any

from tests.helpers.fuzz.arithmetic import formula, root
from tests.helpers.fuzz.steps import RESTING


@formula
def fly(s: Any, y: Any, h: Any, out: Any) -> None:
    """Free flight of all pairs."""
    n = len(s.kind)
    for c in range(n):
        out[c] = y[c] + (y[n + c] + 0.5 * s.pull[c] * h) * h
        out[n + c] = y[n + c] + s.pull[c] * h
        out[2 * n + c] = y[2 * n + c]
    for b in range(n + 1):
        out[3 * n + b] = y[3 * n + b] - s.fall[b] * h


@formula
def next_touch(s: Any, y: Any) -> Any:
    """Pair that closes first in free flight, and when; -1 if none does."""
    n, first, when = len(s.kind), -1, 0.0 * y[0]
    for c in range(n):
        gap, u, a = -y[c], y[n + c], s.pull[c]
        if s.mode[c] == RESTING:
            continue
        t = -1.0 + 0.0 * gap
        if a == 0.0:
            if u > 0.0:
                t = gap / u
        else:
            square = u * u + 2.0 * a * gap
            if square >= 0.0:
                if u > 0.0:
                    t = 2.0 * gap / (u + root(square))
                elif a > 0.0:
                    t = (root(square) - u) / a
        if t >= 0.0 and (first < 0 or t < when):
            first, when = c, t
    return first, when
