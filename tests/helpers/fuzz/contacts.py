"""How contacts begin, go on and end in the independent solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.helpers.fuzz.arithmetic import formula, power, root
from tests.helpers.fuzz.forces import TWO_STIFF, bracket, duration_scale, elastic, force, remembers, roughness
from tests.helpers.fuzz.state import TIME, TOL, UNTIL, H, T, V
from tests.helpers.fuzz.steps import ACTIVE, BRACKET, KINK, OPEN, RESIDUAL, RESTING, rates


@formula
def start(s: Any, y: Any, until: Any) -> int:
    """Give each pair its mode at the start; UNTIL if the run is to stop at once."""
    n = len(s.kind)
    for c in range(n):
        s.branch[c], s.armed[c] = 1, 1
        if y[c] > 0.0:
            s.mode[c] = ACTIVE
            if remembers(s.kind[c]):
                s.top[c] = y[c]
            elif s.kind[c] == TWO_STIFF:
                s.branch[c] = 1 if y[c] > s.law[c][2] else 0
        elif y[c] == 0.0 and y[n + c] == 0.0:
            s.mode[c] = RESTING
            if s.kind[c] == TWO_STIFF:
                s.branch[c] = 0
        else:
            s.mode[c] = OPEN
    slope = np.zeros_like(y)
    for _ in range(2):  # twice: what pushes depends on the branches
        rates(s, y, slope)
        for c in range(n):
            if s.mode[c] == ACTIVE or s.mode[c] == RESIDUAL:
                if s.kind[c] != TWO_STIFF:
                    way = y[n + c] if y[n + c] != 0.0 else slope[n + c]
                    s.branch[c] = 1 if way > 0.0 else 0
                pushes = bracket(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c]) > 0.0
                s.mode[c] = ACTIVE if pushes else RESIDUAL
    for c in range(n):
        if s.mode[c] == ACTIVE:
            s.mode[c] = OPEN
            if not begin(s, y, c, until):
                return UNTIL
            pressed = force(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c])
            speed = root(pressed * y[c] * (s.w[c] + s.w[c + 1]))
            s.number[V] = max(s.number[V], max(speed, abs(y[n + c])))
            first = 1e-3 * y[c] / max(speed, abs(y[n + c]))
            s.number[H] = first if s.number[H] == 0.0 else min(first, s.number[H])
    for c in range(n):
        if s.mode[c] == RESTING and s.pull[c] > 0.0:
            touch(s, y, c)
            rouse(s, y, c)
    return TIME


@formula
def touch(s: Any, y: Any, c: int) -> None:
    """Note time and velocities at which the contact of pair `c` begins, or might begin."""
    n = len(s.kind)
    mine = s.contact[c]
    mine[0], mine[1] = s.number[T], 0.0 * y[c]
    mine[2], mine[3] = y[3 * n + c], y[3 * n + c + 1]
    mine[4], mine[5] = y[c], 0.0 * y[c]
    y[2 * n + c] = 0.0 * y[c]


@formula
def rouse(s: Any, y: Any, c: int) -> None:
    """Touch all pairs at rest in a row beside pair `c`: they will feel it at once."""
    n = len(s.kind)
    for way in (-1, 1):
        k = c + way
        while 0 <= k < n and s.mode[k] == RESTING and y[k] == 0.0 and y[n + k] == 0.0:
            touch(s, y, k)
            k += way


@formula
def begin(s: Any, y: Any, c: int, until: Any) -> bool:
    """Begin the contact of pair `c`; false if the run is to stop just before."""
    n = len(s.kind)
    if c == until[0] and s.count[c] + 1 == until[1]:
        return False
    s.count[c] += 1
    s.armed[c] = 0 if s.mode[c] == RESIDUAL else 1
    s.mode[c] = ACTIVE
    touch(s, y, c)
    push = force(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c])
    s.contact[c][5] = max(0.0 * push, push)
    rouse(s, y, c)
    return True


@formula
def onset(s: Any, y: Any, c: int) -> None:
    """Set the first, tiny step of a contact: the force may begin like any root of the time."""
    n = len(s.kind)
    speed = abs(y[n + c])
    if speed == 0.0:
        return
    tiny = duration_scale(s.kind[c], s.law[c], 1.0 / (s.w[c] + s.w[c + 1]), speed)
    power_of_time = roughness(s.kind[c], s.law[c])
    for k in range(n):
        rough = roughness(s.kind[k], s.law[k])
        if s.mode[k] == RESTING and rough > 0.0 and (power_of_time == 0.0 or rough < power_of_time):
            power_of_time = rough
    tiny = 0.01 * tiny
    if power_of_time > 0.0:
        tiny = tiny * power(s.number[TOL], 1.0 / (1.0 + power_of_time))
    s.number[V] = max(s.number[V], speed)
    if s.number[H] == 0.0 or tiny < s.number[H]:
        s.number[H] = tiny


@formula
def end(s: Any, y: Any, c: int, rows: Any, k: int) -> None:
    """Write row `k` of the log: the contact of pair `c` ends."""
    n = len(s.kind)
    mine, row = s.contact[c], rows[k]
    row[0], row[1], row[2], row[3] = c, mine[0], s.number[T], mine[1]
    row[4], row[5], row[6], row[7] = mine[2], mine[3], y[3 * n + c], y[3 * n + c + 1]
    row[8], row[9], row[10] = mine[4], mine[5], y[2 * n + c]


@formula
def act(s: Any, y: Any, c: int, which: int, rows: Any, k: int, until: Any) -> int:
    """Let an event happen; return 1 if it wrote row k, -1 if the run is to stop, else 0."""
    mode = s.mode[c]
    if which == KINK:
        if remembers(s.kind[c]):
            if s.branch[c] == 1:
                s.top[c] = y[c]
            else:
                y[c] = s.top[c]
        s.branch[c] = 1 - s.branch[c]
        return 0
    if mode == ACTIVE:
        end(s, y, c, rows, k)
        if elastic(s.kind[c], s.law[c], s.branch[c]):
            y[c] = 0.0 * y[c]
            s.mode[c] = OPEN
        else:
            s.mode[c], s.armed[c] = RESIDUAL, 0
        return 1
    if which == BRACKET:
        if not begin(s, y, c, until):
            return -1
        onset(s, y, c)  # until it is armed, a long step could pass over its end
        return 0
    y[c] = 0.0 * y[c]
    if mode == OPEN and y[len(s.kind) + c] > 0.0:
        s.top[c], s.branch[c] = 0.0 * y[c], 0 if s.kind[c] == TWO_STIFF else 1
        if not begin(s, y, c, until):
            return -1
        onset(s, y, c)
        return 0
    s.mode[c] = OPEN
    return 0


@formula
def force_now(s: Any, y: Any, c: int) -> Any:
    """Force of a pair in contact."""
    n = len(s.kind)
    return force(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c])


@formula
def settle(s: Any, y: Any, until: Any) -> bool:
    """Decide on pairs that touched at rest once they are pressed or parted; true if the run was to stop there."""
    n = len(s.kind)
    largest, strongest = 0.0 * y[0], 0.0 * y[0]
    for c in range(n):
        if s.mode[c] != OPEN:
            largest = max(largest, y[c])
        if s.mode[c] == ACTIVE or (s.mode[c] == RESTING and y[c] > 0.0):
            strongest = max(strongest, force_now(s, y, c))
    for c in range(n):
        if s.mode[c] != RESTING:
            continue
        if y[c] > 1e-13 * largest or (y[c] > 0.0 and force_now(s, y, c) > 1e-10 * strongest):
            if c == until[0] and s.count[c] + 1 == until[1]:
                return True
            s.mode[c], s.armed[c] = ACTIVE, 1
            s.count[c] += 1
            if s.kind[c] == TWO_STIFF:
                s.branch[c] = 0
        elif y[c] < -1e-13 * largest or (largest == 0.0 and y[c] < 0.0):
            s.mode[c] = OPEN
    return False
