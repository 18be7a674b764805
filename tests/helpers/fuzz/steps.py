"""One step of the motion: Gragg-Bulirsch-Stoer extrapolation; and the functions whose zeros are the events."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.helpers.fuzz.arithmetic import formula
from tests.helpers.fuzz.forces import bracket, force, has_kink, kink, weight

OPEN, ACTIVE, RESIDUAL, RESTING = range(4)
"""ξ ≤ 0 · F > 0 · ξ > 0 with no force · touching at rest: ξ = η = 0 up to rounding, force where ξ > 0."""

OVERLAP, BRACKET, KINK = range(3)
"""The three functions of a pair that may fire: of ξ, of the bracket of its law, and of its other branch."""


@formula
def rates(s: Any, y: Any, out: Any) -> None:
    """d/dt of (ξ, η, impulse) per pair."""
    n = len(s.kind)
    for c in range(n):
        push = 0.0 * y[c]
        if s.mode[c] == ACTIVE or (s.mode[c] == RESTING and y[c] > 0.0):
            push = force(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c])
            if s.mode[c] == RESTING and push < 0.0:
                push = 0.0 * push
        out[2 * n + c] = push
    for c in range(n):
        a = s.pull[c] - (s.w[c] + s.w[c + 1]) * out[2 * n + c]
        if c > 0:
            a = a + s.w[c] * out[2 * n + c - 1]
        if c + 1 < n:
            a = a + s.w[c + 1] * out[2 * n + c + 1]
        out[c], out[n + c] = y[n + c], a


@formula
def step(s: Any, y: Any, h: Any, columns: int, speed: Any, end: Any) -> Any:
    """Write y after `h` to `end`; return the error of the rates over `speed` (difference of the last two columns).

    y is (ξ, η, impulse) per pair, then the velocity per body, which follows from the impulses.
    """
    n, size = len(s.kind), 3 * len(s.kind)
    table = np.zeros((columns, size), y.dtype)
    slope, last, here, at, first = s.work[0], s.work[1], s.work[2], s.work[3], s.work[4]
    rates(s, y, first)
    for j in range(columns):
        m = 2 * (j + 1)
        dt = h / m
        for i in range(size):
            last[i] = 0.0 * y[i]
            here[i] = dt * first[i]
        for _ in range(m - 1):
            for i in range(2 * n):
                at[i] = y[i] + here[i]
            rates(s, at, slope)
            for i in range(size):
                new = last[i] + (dt + dt) * slope[i]
                last[i] = here[i]
                here[i] = new
        for i in range(size):
            table[j, i] = here[i]
        for k in range(j - 1, -1, -1):
            below = 2 * (k + 1)
            ratio = (0.0 * h + m * m) / (0.0 * h + below * below) - 1.0
            for i in range(size):
                table[k, i] = table[k + 1, i] + (table[k + 1, i] - table[k, i]) / ratio
    error = 0.0 * h
    for c in range(n):
        difference = abs(table[1, n + c] - table[0, n + c])
        if not difference <= error:
            error = difference
    for i in range(size):
        end[i] = y[i] + table[0, i]
    for b in range(n + 1):
        push = 0.0 * h
        if b > 0:
            push = push + table[0, 2 * n + b - 1]
        if b < n:
            push = push - table[0, 2 * n + b]
        end[size + b] = y[size + b] + (s.w[b] * push - s.fall[b] * h)
    return error / speed


@formula
def nearby(s: Any, y: Any, dt: Any, out: Any) -> None:
    """Where the overlaps and rates are about to be, or were, by their slopes."""
    slope = s.work[0]
    rates(s, y, slope)
    for i in range(2 * len(s.kind)):
        out[i] = y[i] + dt * slope[i]


@formula
def event(s: Any, y: Any, c: int, which: int) -> Any:
    """The value that rises through 0 at an event of pair `c`, or -1."""
    n, mode = len(s.kind), s.mode[c]
    xi, eta = y[c], y[n + c]
    if which == OVERLAP:
        if mode == OPEN:
            return xi
        if mode == RESIDUAL:
            return -xi
    elif which == BRACKET:
        if mode == ACTIVE:
            return -bracket(s.kind[c], s.law[c], xi, eta, s.top[c], s.branch[c])
        if mode == RESIDUAL:
            return bracket(s.kind[c], s.law[c], xi, eta, s.top[c], s.branch[c])
    elif (mode in (ACTIVE, RESIDUAL)) and has_kink(s.kind[c]):
        return kink(s.kind[c], s.law[c], xi, eta, s.top[c], s.branch[c])
    return -1.0 + 0.0 * xi


@formula
def noise(s: Any, y: Any, c: int, which: int, eps: Any) -> Any:
    """How well the value of an event function is known."""
    if which == BRACKET:
        return 256.0 * eps * weight(s.kind[c], s.law[c], y[c], s.top[c])
    return 0.0 * y[c]


@formula
def locate(s: Any, y: Any, h: Any, c: int, which: int, columns: int, speed: Any, eps: Any, end: Any) -> Any:
    """Return the length of the step from y at whose end the event fires, by re-integration; `end` is y there."""
    lo, hi = 0.0 * h, h
    p_lo = event(s, y, c, which)
    p_hi = event(s, end, c, which)
    x, side = hi, 0
    for turn in range(100):
        x = (lo * p_hi - hi * p_lo) / (p_hi - p_lo) if p_lo < 0.0 else 0.5 * (lo + hi)
        if turn % 8 == 7 or not (lo < x < hi):
            x = 0.5 * (lo + hi)
        step(s, y, x, columns, speed, end)
        p = event(s, end, c, which)
        if p == 0.0:
            break
        if p > 0.0:
            hi, p_hi = x, p
            if side == 1:
                p_lo = 0.5 * p_lo
            side = 1
        else:
            lo, p_lo = x, p
            if side == -1:
                p_hi = 0.5 * p_hi
            side = -1
        if hi - lo <= 4.0 * eps * hi:
            break
    return x
