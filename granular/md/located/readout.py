"""Rows of output: gaps, velocities and forces at one time, read from the pieces without disturbing them."""

from __future__ import annotations

from typing import Any

from granular._flight import gap_after
from granular._kernels import kernel
from granular.md.located.clock import since, tau_at
from granular.md.located.piece import value
from granular.md.located.records import ACTIVE, FREE


@kernel
def look(pairs: Any, n: int, t: float, xi: Any, eta: Any, force: Any) -> None:
    """Write overlap, rate and force of every pair at time `t`, which lies within the present pieces."""
    c = 0
    while c < n:
        block = pairs[c]
        dt, hi = max(0.0, since(block, t, 0.0)), block.hi
        if block.clock == FREE:
            xi[c] = -gap_after(-block.xi, -block.eta, block.pull, dt)
            eta[c] = block.eta + block.pull * dt
            force[c] = 0.0
        else:
            tau = min(block.tau, tau_at(block.h, block.clock, dt))
            for i in range(c, hi):
                xi[i], eta[i] = value(pairs[i].x, tau), value(pairs[i].e, tau)
                force[i] = max(0.0, value(pairs[i].f, tau)) if pairs[i].mode == ACTIVE else 0.0
        c = hi
