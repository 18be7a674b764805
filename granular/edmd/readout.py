"""Rows of output, read from a `State` without changing it. Positions follow from gaps: `granular.scene.positions`."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from granular._check import Array
from granular.edmd.state import State

FloatOrArray = TypeVar("FloatOrArray", float, Array)


def gaps(state: State, tau: float) -> Array:
    """Return the gaps in m at `tau`, never negative."""
    u, gap, at, pull = (np.asarray(a, dtype=np.float64) for a in (state.u, state.gap, state.at, state.pull))
    rate = np.diff(u) - pull * at
    dt = tau - at
    gap = np.where(pull == 0.0, gap + rate * dt, gap + dt * (rate - 0.5 * pull * dt))
    return np.maximum(0.0, gap)


def velocities(state: State, tau: float, gravity: float) -> Array:
    """Return the velocities in m/s at `tau`."""
    velocity: Array = np.asarray(state.u) - np.asarray(state.falls) * (gravity * tau)
    return velocity


def elapsed(state: State, tau: FloatOrArray) -> FloatOrArray:
    """Return the time in s from the start of the run to `tau`; it has all its digits however late the start."""
    return ((state.epoch - state.start) + state.epoch_low) + tau
