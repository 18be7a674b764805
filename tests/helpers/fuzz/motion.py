"""The march of the independent solver: from step to step and from event to event, with samples on the way."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.helpers.fuzz.arithmetic import formula
from tests.helpers.fuzz.contacts import act, settle, start, touch
from tests.helpers.fuzz.flight import fly, next_touch
from tests.helpers.fuzz.peaks import peaks
from tests.helpers.fuzz.state import EPS, LOST, QUIET, TIME, TIRED, TOUCH, UNTIL, H, T, V, advance_clock, busy, parted
from tests.helpers.fuzz.steps import BRACKET, OPEN, OVERLAP, RESTING, event, noise, step
from tests.helpers.fuzz.stretch import earliest, locate_all, prepare, try_step


@formula
def march(
    s: Any, y: Any, t_end: Any, until: Any, separated: bool, columns: int, rows: Any, times: Any, sampled: Any,
    most: int,
) -> Any:
    """March to `t_end` (negative: forever) or the stop; return why it ended, rows of the log, samples, steps."""
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
            return TIRED, k, done, steps  # at rest forever
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
