"""Rows of output: gaps, velocities and forces at one time, read from the pieces without disturbing them."""

from __future__ import annotations

from typing import Any

from granular._flight import gap_after
from granular._kernels import kernel
from granular.md.located.clock import since, tau_at
from granular.md.located.piece import value
from granular.md.located.records import ACTIVE, FREE


@kernel
def look(s: Any, t: float, xi: Any, eta: Any, force: Any) -> None:
    """Write overlap, rate and force of every pair at time `t`, which lies within the current pieces."""
    pairs, pool, c = s.pairs, s.pool, 0
    while c < s.run[0].pairs:
        hi = pairs[c].hi
        if pairs[c].slot < 0:
            xi[c], eta[c] = in_flight(pairs[c], t)
            force[c] = 0.0
        elif pool[pairs[c].slot].clock == FREE:
            xi[c], eta[c] = in_flight(pool[pairs[c].slot], t)
            force[c] = 0.0
        else:
            block = pool[pairs[c].slot]
            tau = min(block.tau, tau_at(block.h, block.clock, max(0.0, since(block, t, 0.0))))
            for i in range(c, hi):
                pair = pool[pairs[i].slot]
                xi[i], eta[i] = value(pair.x, tau), value(pair.e, tau)
                force[i] = max(0.0, value(pair.f, tau)) if pair.mode == ACTIVE else 0.0
        c = hi


@kernel
def in_flight(pair: Any, t: float) -> tuple[float, float]:
    """Return overlap and rate at time `t` of a pair in free flight."""
    dt = max(0.0, since(pair, t, 0.0))
    return -gap_after(-pair.xi, -pair.eta, pair.pull, dt), pair.eta + pair.pull * dt
