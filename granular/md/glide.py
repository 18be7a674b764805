"""Free flight of the whole scene: while no pair is closed, the balls fly analytically.
May be skipped: rarer, nothing touches.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, hung, hung_after, time_to_contact
from granular._kernels import kernel
from granular.md.window import ACC, JERK, OFF, RAW, SNAP, TOP, XI, V


@kernel
def time_to_touch(x: Any, pull: Any, low: int, high: int) -> float:
    """Time until the first gap of the pairs from `low` to before `high` closes; inf if none ever does."""
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(low, high):
        rate = v[c + 2] - v[c + 1]
        if xi[c + 1] == 0.0 and rate == 0.0 and pull[c] > 0.0:
            return 0.0  # a soft ball placed on the floor sinks in
        t = time_to_contact(-xi[c + 1], rate, pull[c])
        if t < first:
            first = t
    return first


@kernel
def glide(x: Any, pull: Any, fall: Any, dt: float) -> None:
    """Advance the rows of an open scene by `dt`; rounding never makes a gap negative."""
    xi, raw, v = x[XI], x[RAW], x[V]
    for c in range(len(pull)):
        gap = gap_after(-xi[c + 1], v[c + 2] - v[c + 1], pull[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        v[i] += fall[i] * dt
    for r in range(TOP, min(len(x), SNAP + 1)):
        for i in range(len(v)):
            x[r][i] = fall[i] if r == ACC else 0.0


@kernel
def time_to_touch_hung(x: Any, omega: float, rest: Any) -> float:
    """Time until the first gap between pendula closes; inf if none ever does."""
    first, xi, v = math.inf, x[XI], x[V]
    for c in range(len(rest)):
        t = hung(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c])
        if t < first:
            first = t
    return first


@kernel
def swing(x: Any, omega: float, rest: Any, dt: float) -> None:
    """Advance the rows of an open scene of pendula by `dt`."""
    xi, raw, v, off = x[XI], x[RAW], x[V], x[OFF]
    for c in range(len(rest)):
        gap, _ = hung_after(-xi[c + 1], v[c + 2] - v[c + 1], omega, rest[c], dt)
        xi[c + 1], raw[c + 1] = -gap if gap > 0.0 else 0.0, 0.0
    for i in range(1, len(v)):
        off[i], v[i] = hung_after(off[i], v[i], omega, 0.0, dt)
        x[TOP][i], x[ACC][i] = 0.0, -omega * omega * off[i]
        x[JERK][i], x[SNAP][i] = -omega * omega * v[i], -omega * omega * x[ACC][i]
