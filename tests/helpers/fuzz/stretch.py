"""A step of the independent solver that is accurate, hides no event, and ends at the first one."""

from __future__ import annotations

from typing import Any

from tests.helpers.fuzz.arithmetic import formula, root
from tests.helpers.fuzz.forces import TWO_STIFF, force
from tests.helpers.fuzz.state import DELTA, EPS, TOL, H, V
from tests.helpers.fuzz.steps import BRACKET, OPEN, RESIDUAL, RESTING, event, locate, nearby, noise, step


@formula
def prepare(s: Any, y: Any) -> None:
    """Give speed and step a scale where only weights act."""
    n = len(s.kind)
    for c in range(n):
        if s.mode[c] != OPEN or s.number[V] == 0.0:
            s.number[V] = max(s.number[V], abs(y[n + c]))
    if s.number[V] == 0.0 or s.number[H] == 0.0:
        for c in range(n):
            if s.mode[c] == RESTING and s.pull[c] > 0.0:
                xi = 1e-40 + 0.0 * y[c]
                mass = 1.0 / (s.w[c] + s.w[c + 1])
                branch = 0 if s.kind[c] == TWO_STIFF else 1
                while force(s.kind[c], s.law[c], xi, 0.0 * xi, xi, branch) < mass * s.pull[c]:
                    xi = 2.0 * xi
                t = root(xi / s.pull[c])
                s.number[V] = max(s.number[V], s.pull[c] * t)
                if s.number[H] == 0.0 or s.number[TOL] * t < s.number[H]:
                    s.number[H] = s.number[TOL] * t
    if s.number[H] == 0.0:  # residual pairs only
        for c in range(n):
            if s.mode[c] == RESIDUAL:
                s.number[H] = max(s.number[H], 0.01 * y[c] / (abs(y[n + c]) + root(abs(s.pull[c] * y[c]))))
    if s.number[V] == 0.0:
        s.number[V] = 1.0 + s.number[V]


@formula
def try_step(s: Any, y: Any, columns: int, left: Any, new: Any) -> Any:
    """Take a step of a length that the error, and humps of event functions inside it, allow."""
    h, halved = s.number[H], 0
    cut = left >= 0.0 and h >= left
    if cut:
        h = left
    tol, order = s.number[TOL], 2 * columns - 1
    error = 0.0 * h
    for turn in range(200):
        error = step(s, y, h, columns, s.number[V], new)
        if not error <= tol and turn < 150:
            factor = 0.2
            if error > 0.0 and error < 1.0:
                factor = max(0.2, 0.8 * float(tol / error) ** (1.0 / order))
            h = h * factor
            cut = False
            continue
        if halved < 24 and hump(s, y, h, new):
            h, halved, cut = 0.5 * h, halved + 1, False
            continue
        break
    growth = 2.5
    if error > 0.0:
        growth = min(2.5, max(0.5, 0.8 * float(tol / error) ** (1.0 / order)))
    if halved > 0:
        growth = 1.0
    if not cut:
        s.number[H] = h * growth
    return h


@formula
def hump(s: Any, y: Any, h: Any, new: Any) -> bool:
    """Whether an event function may rise above 0 and fall again within the step, by its cubic."""
    ahead, before = s.work[5], s.work[6]
    dt = s.number[DELTA] * h
    nearby(s, y, dt, ahead)
    nearby(s, new, -dt, before)
    for c in range(len(s.kind)):
        for which in range(3):
            p0, p1 = event(s, y, c, which), event(s, new, c, which)
            if s.armed[c] == 0 and which == BRACKET:
                if p1 > noise(s, new, c, which, s.number[EPS]):
                    return True
                continue
            if p0 <= 0.0 and p1 <= 0.0 and not (p0 == -1.0 and p1 == -1.0):
                d0 = (event(s, ahead, c, which) - p0) / s.number[DELTA]
                d1 = (p1 - event(s, before, c, which)) / s.number[DELTA]
                if d0 > 0.0 and d1 < 0.0:
                    high, low = p0, min(p0, p1)
                    for i in range(1, 16):
                        u = i / 16.0
                        v = 1.0 - u
                        p = v * v * ((1.0 + 2.0 * u) * p0 + u * d0) + u * u * ((1.0 + 2.0 * v) * p1 - v * d1)
                        high = max(high, p)
                    if high > -0.1 * (high - low):
                        return True
    return False


@formula
def earliest(s: Any, y: Any, h: Any, columns: int, new: Any, trial: Any) -> Any:
    """Any event that has fired at the end of the step."""
    for c in range(len(s.kind)):
        for which in range(3):
            if event(s, new, c, which) > 0.0 and not (which == BRACKET and s.armed[c] == 0):
                return c, which
    return -1, 0


@formula
def locate_all(s: Any, y: Any, h: Any, c: int, columns: int, new: Any, trial: Any) -> Any:
    """Shorten the step to the first event; return its length, and leave pair and event in `number`."""
    speed, eps, n = s.number[V], s.number[EPS], len(s.kind)
    found, what, low = -1, 0, h
    for i in range(n):
        for which in range(3):
            if which == BRACKET and s.armed[i] == 0:
                continue
            if event(s, new, i, which) > 0.0:
                trial[:] = new
                x = locate(s, y, h, i, which, columns, speed, eps, trial)
                if found < 0 or x < low:
                    found, what, low = i, which, x
    step(s, y, low, columns, speed, new)
    s.number[7], s.number[8] = 0.0 * h + found, 0.0 * h + what
    return low
