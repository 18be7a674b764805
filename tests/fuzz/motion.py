"""The march of the independent solver: steps, events found by re-integrating the step, contacts, samples."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from fuzz.arithmetic import formula, power, root
from fuzz.forces import TWO_STIFF, bracket, duration_scale, elastic, force, remembers, roughness
from fuzz.steps import (
    ACTIVE,
    BRACKET,
    KINK,
    OPEN,
    OVERLAP,
    RESIDUAL,
    RESTING,
    event,
    locate,
    nearby,
    noise,
    rates,
    step,
)  # fmt: skip

System = namedtuple("System", "kind law w pull fall mode branch top armed count contact number work")
"""Laws, inverse masses, gravity; per pair its mode, branch, largest overlap, whether its bracket has left 0, contacts
so far, and the contact that goes on: time of touch (nan: none), duration, v_in (2), ξ_max, F_max."""

T, LOST, V, H, EPS, TOL, DELTA = range(7)
"""Places in `number`: time and what is lost of it, scales of speed and step, rounding, tolerance, difference step."""

TIME, UNTIL, QUIET, TOUCH, TIRED = range(5)
"""Why a march ends; TOUCH: the contact to stop at began at an earlier touch at rest."""


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
            s.number[H] = 1e-3 * y[c] / max(speed, abs(y[n + c]))
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
    """Set the first, tiny step after a touch: the force may begin like any root of the time."""
    n = len(s.kind)
    speed = y[n + c]
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
def advance_clock(s: Any, h: Any) -> None:
    """Add to the time, with what rounding loses, and to the durations."""
    t = s.number[T]
    new = t + (h + s.number[LOST])
    s.number[LOST] = (h + s.number[LOST]) - (new - t)
    s.number[T] = new
    for c in range(len(s.kind)):
        if s.mode[c] == ACTIVE or s.mode[c] == RESTING:
            s.contact[c][1] = s.contact[c][1] + h


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
        return 0 if begin(s, y, c, until) else -1
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
def busy(s: Any, y: Any) -> bool:
    """Whether any pair is in contact or about to be."""
    n = len(s.kind)
    for c in range(n):
        if s.mode[c] == ACTIVE or s.mode[c] == RESIDUAL:
            return True
        if s.mode[c] == RESTING and (s.pull[c] > 0.0 or y[c] != 0.0 or y[n + c] != 0.0):
            return True
    return False


@formula
def fly(s: Any, y: Any, h: Any, out: Any) -> None:
    """Free flight of all pairs."""
    n = len(s.kind)
    for c in range(n):
        out[c] = y[c] + (y[n + c] + 0.5 * s.pull[c] * h) * h
        out[n + c] = y[n + c] + s.pull[c] * h
        out[2 * n + c] = y[2 * n + c]
    for b in range(n + 1):
        out[3 * n + b] = y[3 * n + b] - s.fall[b] * h


@formula
def next_touch(s: Any, y: Any) -> Any:
    """Pair that closes first in free flight, and when; -1 if none does."""
    n, first, when = len(s.kind), -1, 0.0 * y[0]
    for c in range(n):
        gap, u, a = -y[c], y[n + c], s.pull[c]
        if s.mode[c] == RESTING:
            continue
        t = -1.0 + 0.0 * gap
        if a == 0.0:
            if u > 0.0:
                t = gap / u
        else:
            square = u * u + 2.0 * a * gap
            if square >= 0.0:
                if u > 0.0:
                    t = 2.0 * gap / (u + root(square))
                elif a > 0.0:
                    t = (root(square) - u) / a
        if t >= 0.0 and (first < 0 or t < when):
            first, when = c, t
    return first, when


@formula
def parted(s: Any, y: Any) -> bool:
    """Whether, after a contact, all pairs are open and none approaches."""
    n, any_so_far = len(s.kind), False
    for c in range(n):
        if s.mode[c] == ACTIVE or s.mode[c] == RESIDUAL or y[n + c] > 0.0:
            return False
        any_so_far = any_so_far or s.count[c] > 0
    return any_so_far


@formula
def keep_samples(s: Any, y: Any, h: Any, flying: bool, columns: int, times: Any, done: int, rows: Any) -> int:
    """Write the samples in [t, t + h) from the state at t; return how many are written in all."""
    at = np.zeros_like(y)
    while done < len(times) and (times[done] - s.number[T]) - s.number[LOST] < h:
        dt = (times[done] - s.number[T]) - s.number[LOST]
        if flying or dt <= 0.0:
            fly(s, y, dt, at)
        else:
            step(s, y, dt, columns, s.number[V], at)
        for i in range(len(y)):
            rows[done, i] = at[i]
        done += 1
    return done


@formula
def march(
    s: Any, y: Any, t_end: Any, until: Any, separated: bool, columns: int, rows: Any, times: Any, sampled: Any,
    most: int,
) -> Any:  # fmt: skip
    """March to `t_end` (negative: for ever) or the stop; return why it ended, rows of the log, samples, steps."""
    n, k, done, steps = len(s.kind), 0, 0, 0
    new, trial = np.zeros_like(y), np.zeros_like(y)
    if start(s, y, until) == UNTIL:
        return UNTIL, k, done, steps
    last = s.number[T]
    while True:
        steps += 1
        if steps > most or k >= len(rows) - 1:
            return TIRED, k, done, steps
        for c in range(n):
            closing = s.mode[c] == OPEN and y[c] >= 0.0 and y[n + c] > 0.0
            if closing and act(s, y, c, OVERLAP, rows, k, until) < 0:
                return UNTIL, k, done, steps
            if s.mode[c] == RESTING and s.pull[c] < 0.0 and not s.contact[c][0] >= 0.0:
                s.mode[c] = OPEN
        if separated and parted(s, y):
            return UNTIL, k, done, steps
        left = (t_end - s.number[T]) - s.number[LOST]
        if t_end >= 0.0 and left <= 0.0:
            return TIME, k, done, steps
        if not busy(s, y):
            s.number[V], s.number[H] = 0.0 * left, 0.0 * left
            c, h = next_touch(s, y)
            if c < 0 and t_end < 0.0:
                return QUIET, k, done, steps
            if t_end >= 0.0 and (c < 0 or h >= left):
                c, h = -1, left
            done = keep_samples(s, y, h, True, columns, times, done, sampled)
            fly(s, y, h, new)
            y[:] = new
            advance_clock(s, h)
            if c >= 0:
                last = s.number[T]
                y[c] = 0.0 * h
                if y[n + c] <= 0.0:
                    s.mode[c] = RESTING
                    y[n + c] = 0.0 * h
                    if s.pull[c] > 0.0:
                        touch(s, y, c)
            continue
        prepare(s, y)
        if t_end < 0.0 and s.number[T] > 1e9 * last and last > 0.0:
            return TIRED, k, done, steps  # at rest for ever
        h = try_step(s, y, columns, left if t_end >= 0.0 else -1.0 + 0.0 * left, new)
        c, which = earliest(s, y, h, columns, new, trial)
        if c >= 0:
            h = locate_all(s, y, h, c, columns, new, trial)
            c = int(s.number[7])
            which = int(s.number[8])
        done = keep_samples(s, y, h, False, columns, times, done, sampled)
        peaks(s, y, h, columns, new, trial)
        y[:] = new
        advance_clock(s, h)
        for i in range(n):
            if s.armed[i] == 0 and event(s, y, i, BRACKET) < -noise(s, y, i, BRACKET, s.number[EPS]):
                s.armed[i] = 1
        if c >= 0:
            last = s.number[T]
            wrote = act(s, y, c, which, rows, k, until)
            if wrote < 0:
                return UNTIL, k, done, steps
            k += wrote
        if settle(s, y, until):
            return TOUCH, k, done, steps


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


@formula
def force_now(s: Any, y: Any, c: int) -> Any:
    """Force of a pair in contact."""
    n = len(s.kind)
    return force(s.kind[c], s.law[c], y[c], y[n + c], s.top[c], s.branch[c])


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
