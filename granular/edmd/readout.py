"""Rows of output, read from a `State` without changing it. Positions follow from gaps: `granular.scene.positions`."""

from __future__ import annotations

import numpy as np

from granular._check import Array
from granular._records import Records, column
from granular.edmd.state import FloatOrArray, State


def row(state: State, tau: float, gravity: float) -> tuple[Array, Array]:
    """Return velocities in m/s, and gaps in m, never negative, at `tau`."""
    velocity = np.array(column(state.bodies, "u"))
    gap = gaps(state.pairs, velocity, tau, gravity)
    if gravity > 0.0:
        velocity -= column(state.bodies, "falls") * (gravity * tau)
    return velocity, gap


def gaps(pairs: Records, u: Array, tau: float, gravity: float) -> Array:
    """Return the gaps in m, never negative, at `tau` between bodies of free-fall velocities `u`."""
    gap, at, rate = column(pairs, "gap"), column(pairs, "at"), np.diff(u)
    dt = tau - at
    if gravity > 0.0:
        pull = column(pairs, "pull")
        rate -= pull * at
        gap = np.where(pull == 0.0, gap + rate * dt, gap + dt * (rate - 0.5 * pull * dt))
    else:
        gap = gap + rate * dt
    return np.maximum(0.0, gap)


def elapsed(state: State, tau: FloatOrArray) -> FloatOrArray:
    """Return the time in s from the start of the run to `tau`; it has all its digits however late the start."""
    return ((state.epoch - state.start) + state.epoch_low) + tau
