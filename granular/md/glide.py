"""Free flight of the whole scene: while no pair is closed, the balls fly analytically."""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, time_to_contact
from granular._kernels import kernel


@kernel
def time_to_touch(xi: Any, v: Any, pull: Any) -> float:
    """Time until the first gap closes; inf if none ever does."""
    first = math.inf
    for c in range(len(xi)):
        rate = v[c + 1] - v[c]
        if xi[c] == 0.0 and rate == 0.0 and pull[c] > 0.0:
            return 0.0  # a soft ball placed on the floor sinks in
        t = time_to_contact(-xi[c], rate, pull[c])
        if t < first:
            first = t
    return first


@kernel
def glide(xi: Any, v: Any, pull: Any, fall: Any, dt: float) -> None:
    """Advance overlaps and velocities of an open scene by `dt`; rounding never makes a gap negative."""
    for c in range(len(xi)):
        gap = gap_after(-xi[c], v[c + 1] - v[c], pull[c], dt)
        xi[c] = -gap if gap > 0.0 else 0.0
    for i in range(len(v)):
        v[i] += fall[i] * dt
