"""One collision: everything that happens to the bodies, for both queues."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.edmd.merge import ORDINARY, WEAK, absorb, kind, share, strike
from granular.edmd.model import remedied
from granular.edmd.motion import Bodies, Ints, Physics, approach, blur, carry, collide

SUSPICIOUS = 8
"""Streak that calls for a closer look."""
FAINT = 2.0**-26
"""Rate, in units of the velocities it is the difference of, that calls for one at once: half its digits are gone."""


@kernel
def event(
    c: int, now: float, bodies: Bodies, physics: Physics, rule: Any, watch: tuple[float, float], tally: Ints, row: Any
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after.

    `watch` is the scale of the speeds (m/s; negative: do not watch) and the interval (s) that look like a collapse;
    `tally` counts clamps and merged collisions; `row` takes the row of the log: pair, time, velocities of the lower and
    the upper body before and after, impulse.
    """
    u, falls, gap, at, pull, hits, last, streaks, noise = bodies
    low, high, m_eff, mass, eps, tc, elastic_below, merge_below, g = physics
    w = approach(c, u, gap, at, pull)
    e = eps[c] if rule is None else rule(c, -w)
    if tc > 0.0 or elastic_below > 0.0:
        e = remedied(c, -w, e, now, last, tc, elastic_below)
    if row is not None:
        row[0], row[1] = c, now
        row[2], row[3] = u[c] - falls[c] * (g * now), u[c + 1] - falls[c + 1] * (g * now)
    what, exchanged = ORDINARY, 0.0
    if merge_below > 0.0 or g > 0.0:
        what = kind(c, w, e, merge_below, mass, falls, pull)
    if what == ORDINARY:
        start = end = c
        if c > 0:
            start = c - 1
            tally[0] += carry(start, now, u, gap, at, pull)
        if c + 1 < len(gap):
            end = c + 1
            tally[0] += carry(end, now, u, gap, at, pull)
        collide(c, now, w, e, u, gap, at, pull, low, high)
    elif what == WEAK:
        tally[1] += 1
        start, end, exchanged = absorb(c, now, w, g, mass, u, falls, gap, at, pull)
    else:
        start, end = strike(c, now, w, e, g, mass, u, falls, gap, at, pull, low, high)
    if row is not None:
        row[4], row[5] = u[c] - falls[c] * (g * now), u[c + 1] - falls[c + 1] * (g * now)
        row[6] = exchanged if what == WEAK else -((1.0 + e) * w) * m_eff[c]
    blur(c, w, e, u, noise, low, high)
    if what == WEAK:
        share(c, start, end, falls, u, noise)
    hits[c] += 1
    if e < 1.0:
        size = max(abs(u[c]), abs(u[c + 1]))
        streaks[c] = streak(streaks[c], -w, now - last[c], e, size, watch[0], watch[1])
    else:
        streaks[c] = 0
    last[c] = now
    return start, end, -e * w


@kernel
def streak(count: int, speed: float, interval: float, e: float, size: float, slow: float, short: float) -> int:
    """Return how often in a row (before: `count`) a pair collided slowly, which counts thrice, or at once again.

    A rebound that velocities of that `size` can hardly hold calls for a closer look at once.
    """
    if slow >= 0.0 and 0.0 < e * speed < FAINT * size:
        return SUSPICIOUS
    if speed < slow:
        return count + 3
    return count + 1 if interval <= short else 0
