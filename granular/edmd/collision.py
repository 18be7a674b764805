"""One collision: everything that happens to the bodies, for both queues; and balls that stay together after it.

There are no cluster objects. A *closed* pair has gap 0, rate 0 and no pull, all in bits; it never collides by itself
and needs no flag. A ball that rests on a wall, directly or on a pile, has ``falls = 0`` and the velocity of the wall;
the next ball then sees a floor. A hit on a cluster is an ordinary collision of the body hit; what it starts runs
through the cluster by collisions at the same time.
"""

from __future__ import annotations

import math

import numpy as np

from granular._flight import rate_at_contact
from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.motion import NOISE, Walls, blur, carry, collide, impulse, velocities
from granular.edmd.physics import Restitution

SUSPICIOUS = 8
"""Streak that calls for a closer look."""
RESTING = 0.0
"""A pair pulled more than this (m/s²) that is never to collide rests."""
FAINT = 2.0**-26
"""Rate, in units of the velocities it is the difference of, that calls for one at once: half its digits are gone."""

ROW = np.dtype(
    [
        ("pair", int), ("t_begin", float),
        ("lower_in", float), ("upper_in", float), ("lower_out", float), ("upper_out", float),
        ("impulse", float),
    ],
    align=True,
)
"""What is kept of a collision: pair, time in s since the epoch, velocities before and after in m/s, impulse in N s.

The impulse is no function of the others: in a closer look velocities cannot hold the change, and balls that stick
together pass on more than their own."""


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after.

    `row`, if there is one, takes what is kept of it. A weak impact merges, but a ceiling cannot carry.
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    w = rate_at_contact(pair.gap, (upper.u - lower.u) - pair.pull * pair.at, pair.pull)
    e = pair.eps if rule is None else rule(c, -w)
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied(run, pairs, c, -w, e, now)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    weak, exchanged = e < 1.0 and -w < run.merge_below and pair.pull >= 0.0, 0.0
    if weak:
        start, end, exchanged = absorb(run, pairs, bodies, c, now, w, walls)
    elif (g > 0.0 or run.merge_below > 0.0) and (at_rest(lower) or at_rest(upper)):
        start, end = wake(run, pairs, bodies, c, now, walls)
        collide(pair, lower, upper, now, w, e)
    else:
        start = end = c
        if c > 0:
            start = c - 1
            run.clamps += carry(pairs[start], bodies[start], lower, now, walls)
        if c + 1 < len(pairs):
            end = c + 1
            run.clamps += carry(pairs[end], upper, bodies[end + 1], now, walls)
        collide(pair, lower, upper, now, w, e)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = exchanged if weak else impulse(lower, upper, (1.0 + e) * w)
    if weak:
        share(bodies, c, start, end, w)
    else:
        blur(pair, lower, upper, w, e)
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


@kernel
def is_closed(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair move as one."""
    return pair.gap == 0.0 and pair.pull == 0.0 and upper.u == lower.u  # type: ignore[no-any-return]


@kernel
def at_rest(body: Record) -> bool:
    """Return whether a ball rests on a wall, directly or on a pile."""
    return body.falls == 0.0 and body.mass < math.inf  # type: ignore[no-any-return]


@rare
@kernel
def absorb(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that is closed with them, move as one from now on.

    With the wall or the pile if one side belongs to it, else with their common momentum. Returns the first and the
    last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    b, e = joined(pairs, bodies, c)
    first, last = max(b - 1, 0), min(e, len(pairs) - 1)
    for k in (first, c, last):  # all others between are closed
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    pairs[c].gap = 0.0
    lower = math.inf if bodies[c].falls == 0.0 else total(bodies, b, c)
    upper = math.inf if bodies[c + 1].falls == 0.0 else total(bodies, c + 1, e)
    if lower == math.inf:
        common, exchanged = bodies[c].u, -upper * w
    elif upper == math.inf:
        common, exchanged = bodies[c + 1].u, -lower * w
    else:
        part = upper / (lower + upper)
        common, exchanged = bodies[c].u + part * w, -(lower * part) * w
    for i in range(b, e + 1):
        bodies[i].u = common
        if lower == math.inf or upper == math.inf:
            bodies[i].falls = 0.0
    repull(run, pairs, bodies, first, last)
    run.merged += 1
    return first, last, exchanged


@rare
@kernel
def joined(pairs: Records, bodies: Records, c: int) -> tuple[int, int]:
    """Return the lowest and the highest of the bodies that are closed with one of pair `c`, which collides.

    They end before a wall and what rests on it, which only a collision of its own holds: it may be elastic.
    """
    b, e = c, c + 1
    while b > 0 and bodies[b].falls * bodies[b - 1].falls > 0.0 and is_closed(pairs[b - 1], bodies[b - 1], bodies[b]):
        b -= 1
    while e < len(pairs) and bodies[e].falls * bodies[e + 1].falls > 0.0 and is_closed(
        pairs[e], bodies[e], bodies[e + 1]
    ):
        e += 1
    return b, e


@rare
@kernel
def share(bodies: Records, c: int, first: int, last: int, w: float) -> None:
    """Give all bodies that now move as one with pair `c`, which closed at rate `w`, their common noise.

    They are among those of pairs `first` … `last`. As their velocities it is the mean by mass, at most, so Σ m noise
    does not grow but by rounding; what rests on a wall has its velocity, without noise.
    """
    u, noise, mass = bodies[c].u, 0.0, 0.0
    for i in range(first, last + 2):
        if bodies[i].u == u and bodies[i].falls > 0.0:
            noise += bodies[i].mass * bodies[i].noise
            mass += bodies[i].mass
    for i in range(first, last + 2):
        if bodies[i].u == u and bodies[i].falls > 0.0:
            bodies[i].noise = noise / mass + NOISE * (u * u + w * w)


@rare
@kernel
def wake(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Let the bodies of pair `c`, which is hit, and those that rested upon them, fall again.

    Returns the first and the last pair to predict anew.
    """
    top = c + 1
    while top < len(pairs) and at_rest(bodies[top]) and is_closed(pairs[top], bodies[top], bodies[top + 1]):
        top += 1
    first, last = max(c - 1, 0), min(top, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    release(run, pairs, bodies, c, top, now, walls)
    return first, last


@rare
@kernel
def release(
    run: Record, pairs: Records, bodies: Records, low: int, high: int, now: float, walls: Walls
) -> None:
    """Let those of bodies `low` … `high` that are at rest fall again."""
    for i in range(low, high + 1):
        if at_rest(bodies[i]):
            bodies[i].falls = 1.0
            bodies[i].u += run.gravity * now
    repull(run, pairs, bodies, max(low - 1, 0), min(high, len(pairs) - 1))


@kernel
def total(bodies: Records, b: int, e: int) -> float:
    """Return the mass of bodies `b` … `e`."""
    mass = 0.0
    for i in range(b, e + 1):
        mass += bodies[i].mass
    return mass


@rare
@kernel
def rest(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> tuple[int, int]:
    """Let the upper body of pair `c` rest on the wall, or on the pile on it.

    For a pulled pair that never collides again: it has gap and rate 0. Returns the first and the last pair to predict
    anew, at least the next one.
    """
    top = min(c + 1, len(pairs) - 1)
    if top > c:
        carry(pairs[top], bodies[top], bodies[top + 1], pairs[c].at, walls)
    bodies[c + 1].falls = 0.0
    bodies[c + 1].u = bodies[c].u
    repull(run, pairs, bodies, c, top)
    return c + 1, top


@kernel
def repull(run: Record, pairs: Records, bodies: Records, first: int, last: int) -> None:
    """Set gravity's closing acceleration of pairs `first` … `last` from which of their bodies fall."""
    for c in range(first, last + 1):
        pairs[c].pull = run.gravity * (bodies[c + 1].falls - bodies[c].falls)
