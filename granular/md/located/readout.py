"""Rows of output: gaps, velocities and forces at one time, read from the pieces without disturbing them."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._check import Array
from granular._flight import gap_after
from granular._kernels import kernel
from granular.md.located.clock import since, tau_at
from granular.md.located.piece import value
from granular.md.located.records import ACTIVE, FREE
from granular.scene import Scene


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


def velocities(scene: Scene, rate: Array, elapsed: Array) -> Array:
    """Velocities (T, n) in m/s from the rates (T, n-1) of the gaps a time `elapsed` (T,) in s after the start.

    A cumulative sum from a wall, or else from the centre of mass: differences are the rates to the last digit. The
    second look at the centre of mass matters in long chains, where the rounding of the first moves every ball.
    """
    offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
    walls = np.flatnonzero(scene.is_wall)
    if len(walls):
        i = int(walls[0])
        anchor = scene.velocity[i] - offset[:, i]
    else:
        share = scene.mass / scene.mass.sum()
        centre = (share * scene.velocity).sum() - scene.gravity * elapsed
        anchor = centre - (offset * share).sum(axis=-1)
        offset = anchor[:, None] + offset
        anchor = centre - (offset * share).sum(axis=-1)
    out: Array = anchor[:, None] + offset
    return out
