"""One collision: everything that happens to the bodies, for both queues."""

from __future__ import annotations

import numpy as np

from granular._flight import rate_at_contact
from granular._kernels import kernel
from granular._records import Record, Records
from granular.edmd.merge import ORDINARY, WEAK, absorb, kind, share, strike
from granular.edmd.model import Restitution
from granular.edmd.motion import blur, carry, collide, impulse, velocities

SUSPICIOUS = 8
"""Streak that calls for a closer look."""
FAINT = 2.0**-26
"""Rate, in units of the velocities it is the difference of, that calls for one at once: half its digits are gone."""

ROW = np.dtype(
    [
        ("pair", int), ("t_begin", float),
        ("lower_in", float), ("upper_in", float), ("lower_out", float), ("upper_out", float),
        ("impulse", float),
    ],
    align=True,
)  # fmt: skip
"""What is kept of a collision: pair, time in s since the epoch, velocities before and after in m/s, impulse in N s.

The impulse is no function of the others: in a closer look velocities cannot hold the change, and balls that stick
together pass on more than their own."""


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after.

    `row`, if there is one, takes what is kept of it.
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    w = rate_at_contact(pair.gap, (upper.u - lower.u) - pair.pull * pair.at, pair.pull)
    e = pair.eps if rule is None else rule(c, -w)
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied(run, pairs, c, -w, e, now)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    what, exchanged = ORDINARY, 0.0
    if run.merge_below > 0.0 or g > 0.0:
        what = kind(run, pair, lower, upper, w, e)
    if what == ORDINARY:
        start = end = c
        if c > 0:
            start = c - 1
            run.clamps += carry(pairs[start], bodies[start], lower, now)
        if c + 1 < len(pairs):
            end = c + 1
            run.clamps += carry(pairs[end], upper, bodies[end + 1], now)
        collide(pair, lower, upper, now, w, e)
    elif what == WEAK:
        start, end, exchanged = absorb(run, pairs, bodies, c, now, w)
    else:
        start, end = strike(run, pairs, bodies, c, now, w, e)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = exchanged if what == WEAK else impulse(lower, upper, (1.0 + e) * w)
    blur(pair, lower, upper, w, e)
    if what == WEAK:
        share(bodies, c, start, end)
    pair.hits += 1
    pair.streak = streak(run, pair.streak, lower, upper, now - pair.last, -w, e) if e < 1.0 else 0
    pair.last = now
    return start, end, -e * w


@kernel
def remedied(run: Record, pairs: Records, c: int, speed: float, e: float, now: float) -> float:
    """Return ε of an impact of pair `c` with `speed` at time `now` where its rule says `e`.

    Elastic below a speed of `elastic_below`, and if one of its two bodies has collided less than `tc` ago (the TC
    model of Luding & McNamara, Granular Matter 1, 113 (1998)).
    """
    if speed < run.elastic_below:
        return 1.0
    for k in range(max(c - 1, 0), min(c + 2, len(pairs))):
        if now - pairs[k].last < run.tc:
            return 1.0
    return e


@kernel
def streak(run: Record, count: int, lower: Record, upper: Record, interval: float, speed: float, e: float) -> int:
    """Return how often in a row (before: `count`) a pair collided slowly, which counts thrice, or at once again.

    A rebound that velocities of their size can hardly hold calls for a closer look at once.
    """
    if run.slow < 0.0:
        return 0
    if 0.0 < e * speed < FAINT * max(abs(lower.u), abs(upper.u)):
        return SUSPICIOUS
    if speed < run.slow:
        return count + 3
    return count + 1 if interval <= run.short else 0
