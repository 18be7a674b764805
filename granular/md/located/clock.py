"""Time of a block: absolute time in two floats, and the map t = (hτ)^q of a step."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel


@kernel
def tick(block: Any, dt: float) -> None:
    """Advance a clock by `dt`; t + tail keeps what one float would lose, so that no gap suffers from late times."""
    dt += block.tail
    t = block.t + dt
    part = t - block.t
    block.tail = (block.t - (t - part)) + (dt - part)
    block.t = t


@kernel
def since(block: Any, t: float, tail: float) -> float:
    """Return the time from the block's clock to t + tail."""
    dt: float = (t - block.t) + (tail - block.tail)
    return dt


@kernel
def elapsed(h: float, q: int, tau: float) -> float:
    """Return the time (hτ)^q into a step."""
    u = h * tau
    t = u
    for _ in range(1, q):
        t *= u
    return t


@kernel
def tau_at(h: float, q: int, dt: float) -> float:
    """Return the τ at which a time `dt` of the step has passed."""
    if dt <= 0.0:
        return 0.0
    return root(dt, q) / h


@kernel
def root(x: float, q: int) -> float:
    """Return x^(1/q)."""
    if q == 1:
        return x
    if q == 2:
        return math.sqrt(x)
    if q == 4:
        return math.sqrt(math.sqrt(x))
    return math.pow(x, 1.0 / 3.0)
