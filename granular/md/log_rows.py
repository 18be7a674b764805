"""The contact log of a fixed-step run: rows of the kernel become times and speeds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular.md.stepper import Stepper
from granular.trajectory import CONTACT


def contact_log(stepper: Stepper, t_stop: float) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Closed contacts and those still open at the end, sorted by their begin."""
    now, nan = stepper.now, math.nan
    present = stepper.s.force if stepper.halted_at is None else stepper.old.force
    open_pairs = [c for c in range(len(present)) if present[c] > 0.0]
    rows = [
        [c, now.step[c], now.part[c], nan, nan, now.lower[c], now.upper[c], nan, nan,
         now.xi_max[c], now.force_max[c], now.impulse[c]]
        for c in open_pairs
    ]  # fmt: skip
    log = logged(stepper, stepper.rows + rows)
    running = np.isnan(log["t_end"])
    log["duration"][running] = t_stop - log["t_begin"][running]
    return log[np.lexsort((log["pair"], log["t_begin"]))]


def logged(stepper: Stepper, rows: list[Any]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Rows of the kernel as a contact log, in their order."""
    log = np.zeros(len(rows), CONTACT)
    for i, (c, k0, part0, k1, part1, *rest) in enumerate(rows):
        lasted = ((k1 - k0) + (part1 - part0)) * stepper.dt
        begin, finish = (stepper.t_start + (k + part) * stepper.dt for k, part in ((k0, part0), (k1, part1)))
        log[i] = (c, begin, finish, lasted, rest[0:2], rest[2:4], *rest[4:])
    return log
