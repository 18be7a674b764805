"""A collision in a scene with forces or driven walls; and balls that come to rest on a wall, or on each other.
May be skipped: rarer, walls that shake.

The kernels of `collision` once more, for more kinds of rest. A ball whose rebound is no more than rounding has come to
rest: beside a driven wall it rides, with the velocity of the wall and without events, until nothing presses it any
more. Balls that forces press together in mid-air move as one with their common `push`, until one of them is hit.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.account import book, borne, enter
from granular.edmd.as_one import again, common, held, is_closed
from granular.edmd.collision import joined, remedied, share, streak, total
from granular.edmd.driven import CEILING, FLOOR, FREE, carry, meets, presses, rate_of, velocities
from granular.edmd.motion import NOISE, Walls, blur, collide, impulse
from granular.edmd.parting import wake
from granular.edmd.physics import Restitution
from granular.walls.path import moved
from granular.walls.riding import pressing


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:  # fmt: skip
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after."""
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    w = meets(pair, lower, upper, walls)
    e = pair.eps if rule is None else rule(c, -w)
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied(run, pairs, c, -w, e, now)
    if pair.wall >= 0:
        carry(pair, lower, upper, now, walls)  # its wall has the velocity of this time
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    weak, exchanged = e < 1.0 and -w < run.merge_below and sticks(pairs, bodies, c, now, w, e, walls), 0.0
    if weak:
        start, end, exchanged = absorb(run, pairs, bodies, c, now, w, walls)
    else:
        if held(lower) or held(upper):
            start, end = wake(run, pairs, bodies, c, now, walls)
        else:
            start = end = c
            if c > 0:
                start = c - 1
                run.clamps += carry(pairs[start], bodies[start], lower, now, walls)
            if c + 1 < len(pairs):
                end = c + 1
                run.clamps += carry(pairs[end], upper, bodies[end + 1], now, walls)
        collide(pair, lower, upper, now, w, e)
        book(lower, upper, w, e, walls)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = exchanged if weak else impulse(lower, upper, (1.0 + e) * w)
    if weak and not walls[0][0].lands:  # else they have it already
        share(bodies, c, start, end, w)
    if not weak:
        below, above = lower.noise, upper.noise
        blur(pair, lower, upper, w, e)
        if pair.wall >= 0 and lower.falls == 0.0:
            lower.noise = below
        if pair.wall >= 0 and upper.falls == 0.0:
            upper.noise = above
    pair.hits += 1
    pair.streak = streak(run, pair.streak, lower, upper, now - pair.last, -w, e) if e < 1.0 else 0
    pair.last = now
    return start, end, -e * w


@rare
@kernel
def sticks(pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, walls: Walls) -> bool:
    """Return whether pair `c`, which collides weakly, at rate `w`, is to move as one.

    A single ball bounces on a driven wall to its end. What moves as one with others, or hits a ball that rides, stays
    if it is certain to be pressed on for as long as its bounces last, 2u/(a(1 - ε)).
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    if pair.wall < 0:
        return pair.pull >= 0.0  # type: ignore[no-any-return]
    bound, k = (lower, c + 1) if pair.wall == 0 else (upper, c - 1)
    alone = not (0 <= k < len(pairs) and is_closed(pairs[k], bodies[k], bodies[k + 1]))
    if (bound.mass == math.inf and e > 0.0 and alone) or lower.falls == upper.falls:
        return False
    side = walls[0][pair.wall]
    t, tail = side.epoch, side.low + now
    _, _, a = moved(side, walls[1], t, tail)
    a += pair.pull
    if a <= 0.0:
        return False
    low, _ = pressing(side, walls[1], t, tail, pair.pull, -4.0 * e * w / (a * (1.0 - e)))
    return low >= 0.5 * a  # type: ignore[no-any-return]


@rare
@kernel
def absorb(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that is closed with them, move as one from now on.

    Returns the first and the last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    run.merged += 1
    return bind(run, pairs, bodies, c, now, w, walls)


@rare
@kernel
def bind(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let pair `c`, whose rate is `w`, close: on a wall, or with the common momentum and acceleration of all."""
    b, e = joined(pairs, bodies, c)
    first, last = max(b - 1, 0), min(e, len(pairs) - 1)
    for k in (first, c, last):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    pairs[c].gap = 0.0
    under, over = bodies[c].falls == 0.0, bodies[c + 1].falls == 0.0
    if under:
        mass = total(bodies, c + 1, e)
        exchanged = -mass * w
        if not over:
            enter(bodies[c], bodies[c + 1], exchanged, 0.5 * mass * w * w, walls)
        settle(run, pairs, bodies, c, e, now, FLOOR, walls)
    elif over:
        mass = total(bodies, b, c)
        exchanged = -mass * w
        enter(bodies[c], bodies[c + 1], exchanged, 0.5 * mass * w * w, walls)
        settle(run, pairs, bodies, b, c + 1, now, CEILING, walls)
    else:
        lower, upper, push = total(bodies, b, c), total(bodies, c + 1, e), common(bodies, b, e)
        part = upper / (lower + upper)
        u = (bodies[c].u + (bodies[c].push - push) * now) + part * w
        exchanged = -(lower * part) * w
        enter(bodies[c], bodies[c + 1], exchanged, -0.5 * w * exchanged, walls)
        noise = NOISE * (u * u)
        for i in range(b, e + 1):  # the mean by mass: the largest would grow with every hit that parts them again
            noise += bodies[i].mass / (lower + upper) * bodies[i].noise
        for i in range(b, e + 1):
            bodies[i].u, bodies[i].push = u, push
            if walls[0][0].lands:
                bodies[i].noise = noise
    return (*again(run, pairs, bodies, first, last, walls), exchanged)


@rare
@kernel
def settle(run: Record, pairs: Records, bodies: Records, b: int, e: int, now: float, on: int, walls: Walls) -> None:
    """Let bodies `b` … `e`, of which the first (on the floor) or the last (on the ceiling) is bound, rest on it."""
    bound = bodies[b] if on == FLOOR else bodies[e]
    for i in range(b, e + 1):
        body = bodies[i]
        if body.falls > 0.0:
            body.falls, body.push, body.u = 0.0, 0.0, bound.u
            if walls[0][on - 1].panels > 0:
                body.noise = bound.noise
            borne(run, body, on - 1, now, bound.u, -1.0, walls)
        elif body.mass < math.inf:
            body.u = bound.u
    for k in range(b, e):
        pairs[k].shut, pairs[k].gap, pairs[k].at = on, 0.0, now


@rare
@kernel
def rest(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> tuple[int, int]:
    """Let pair `c`, which never collides again, close if its bodies touch, are at rest and are pressed together.

    Returns the first and the last pair to predict anew, at least the next one.
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    if pair.shut > FREE or pair.gap != 0.0 or rate_of(pair, lower, upper) != 0.0:
        return c + 1, c
    if lower.falls == upper.falls == 0.0 or not (presses(pair, walls) if pair.wall >= 0 else pair.pull > 0.0):
        return c + 1, c
    first, last, _ = bind(run, pairs, bodies, c, pair.at, (upper.u - lower.u) - pair.pull * pair.at, walls)
    return first, last
