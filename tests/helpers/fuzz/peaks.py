"""Largest overlap and force of contacts within a step of the independent solver."""

from __future__ import annotations

from typing import Any

from tests.helpers.fuzz.arithmetic import formula, root
from tests.helpers.fuzz.contacts import force_now
from tests.helpers.fuzz.forces import elastic
from tests.helpers.fuzz.state import DELTA, EPS, V
from tests.helpers.fuzz.steps import ACTIVE, RESTING, nearby, step


@formula
def peaks(s: Any, y: Any, h: Any, columns: int, new: Any, trial: Any) -> None:
    """Raise largest overlap and force of the contacts to those of the step."""
    n, damped = len(s.kind), False
    dt = s.number[DELTA] * h
    for c in range(n):
        if s.mode[c] == ACTIVE or s.mode[c] == RESTING:
            raise_peaks(s, new, c)
            if y[n + c] > 0.0 and new[n + c] < 0.0:
                peak(s, y, h, c, columns, False, y[n + c], new[n + c], trial)
        damped = damped or (s.mode[c] == ACTIVE and not elastic(s.kind[c], s.law[c], s.branch[c]))
    if damped:
        start_slope, end_slope = s.work[7], s.work[8]
        rise_of_force(s, y, dt, start_slope)
        rise_of_force(s, new, dt, end_slope)
        for c in range(n):
            if s.mode[c] == ACTIVE and start_slope[c] > 0.0 and end_slope[c] < 0.0:
                peak(s, y, h, c, columns, True, start_slope[c], end_slope[c], trial)


@formula
def rise_of_force(s: Any, y: Any, dt: Any, out: Any) -> None:
    """Write the change of all forces along the motion from -dt to dt."""
    ahead, before = s.work[5], s.work[6]
    nearby(s, y, dt, ahead)
    nearby(s, y, -dt, before)
    for c in range(len(s.kind)):
        if s.mode[c] == ACTIVE:
            out[c] = force_now(s, ahead, c) - force_now(s, before, c)


@formula
def raise_peaks(s: Any, y: Any, c: int) -> None:
    """Raise largest overlap and force of the contact of pair `c` to those at y."""
    s.contact[c][4] = max(s.contact[c][4], y[c])
    if y[c] > 0.0:
        s.contact[c][5] = max(s.contact[c][5], force_now(s, y, c))


@formula
def peak(s: Any, y: Any, h: Any, c: int, columns: int, of_force: bool, p_lo: Any, p_hi: Any, trial: Any) -> None:
    """Find the peak of overlap or force within a step, at whose start and end its slope is p_lo > 0 and p_hi < 0."""
    n, lo, hi, side = len(s.kind), 0.0 * h, h, 0
    near = root(s.number[EPS]) * h
    for turn in range(60):
        x = (lo * p_hi - hi * p_lo) / (p_hi - p_lo)
        if turn % 8 == 7 or not (lo < x < hi):
            x = 0.5 * (lo + hi)
        step(s, y, x, columns, s.number[V], trial)
        raise_peaks(s, trial, c)
        p = trial[n + c]
        if of_force:
            rise_of_force(s, trial, s.number[DELTA] * h, s.work[9])
            p = s.work[9][c]
        if p == 0.0:
            break
        moved = x - lo if p > 0.0 else hi - x
        if p > 0.0:
            lo, p_lo = x, p
            if side == 1:
                p_hi = 0.5 * p_hi
            side = 1
        else:
            hi, p_hi = x, p
            if side == -1:
                p_lo = 0.5 * p_lo
            side = -1
        if moved < near or hi - lo < near:
            break
