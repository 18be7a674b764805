"""What moves as one beside driven walls and under forces: it comes to rest on a wall or on each other, and parts again.
May be skipped: rarer, walls that shake.

The kernels of `collision` once more, for more kinds of rest. A ball whose rebound is no more than rounding has come to
rest: beside a driven wall it rides, with the velocity of the wall and without events, until nothing presses it any
more. Balls that forces press together in mid-air move as one with their common `push`, until one of them is hit.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.collision import at_rest, joined, total
from granular.edmd.driven import BOTH, CEILING, FLOOR, FREE, carry, follow, place, presses, rate_of
from granular.edmd.motion import NOISE, Walls
from granular.edmd.wall_state import borne, enter


@kernel
def is_closed(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair move as one."""
    return pair.shut > FREE or (pair.gap == 0.0 and pair.pull == 0.0 and upper.u == lower.u and pair.wall < 0)  # type: ignore[no-any-return]


@kernel
def held(body: Record) -> bool:
    """Return whether a ball rests on a wall, or is pressed against others by forces."""
    return at_rest(body) or body.push != body.own


@kernel
def pressed(body: Record) -> bool:
    """Return whether a ball in mid-air is pressed against others by forces."""
    return body.falls > 0.0 and body.push != body.own  # type: ignore[no-any-return]


@rare
@kernel
def common(bodies: Records, b: int, e: int) -> float:
    """Return the acceleration (m/s²) by the forces on bodies `b` … `e` together."""
    own, more, mass = bodies[e].own, 0.0, 0.0
    for i in range(b, e + 1):
        mass += bodies[i].mass
        more += bodies[i].mass * (bodies[i].own - own)
    return own + more / mass  # type: ignore[no-any-return]


@rare
@kernel
def again(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> tuple[int, int]:
    """Set pulls of pairs `first` … `last`, and of what forces press on the walls; return all those pairs."""
    if walls[0][0].forces:
        first = 0 if pairs[0].shut == FLOOR else first
        last = len(pairs) - 1 if pairs[len(pairs) - 1].shut == CEILING else last
    repull(run, pairs, bodies, first, last, walls)
    return first, last


@rare
@kernel
def repull(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> None:
    """Set the closing accelerations of pairs `first` … `last`; of a shut pair, that of all that rests beyond it."""
    for c in range(first, last + 1):
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        below = lower.falls == 0.0 and walls[0][0].panels > 0 and pair.shut != CEILING
        above = upper.falls == 0.0 and walls[0][1].panels > 0 and pair.shut != FLOOR
        pair.wall = BOTH if below and above else 0 if below else 1 if above else -1
        before = pair.pull
        if pair.shut == FLOOR:
            top = c + 1
            while top < len(pairs) and pairs[top].shut == FLOOR:
                top += 1
            pair.pull = run.gravity - common(bodies, c + 1, top)
        elif pair.shut == CEILING:
            low = c
            while low > 0 and pairs[low - 1].shut == CEILING:
                low -= 1
            pair.pull = common(bodies, low, c) - run.gravity
        else:
            pair.pull = run.gravity * (upper.falls - lower.falls) - (upper.push - lower.push)
        if pair.shut > FREE and pair.pull != before and pair.at < run.now:
            pair.at = run.now


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


@rare
@kernel
def wake(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Let the bodies of pair `c`, which is hit, fall by themselves, and those that rested upon them or are pressed
    against them.

    Returns the first and the last pair to predict anew.
    """
    low, top = c, c + 1
    while low > 0 and pressed(bodies[low]) and is_closed(pairs[low - 1], bodies[low - 1], bodies[low]):
        low -= 1
    while top < len(pairs) and (pressed(bodies[top]) or (at_rest(bodies[top]) and pairs[top].wall < 0)) and is_closed(
        pairs[top], bodies[top], bodies[top + 1]
    ):
        top += 1
    first, last = max(low - 1, 0), min(top, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    release(run, pairs, bodies, low, top, now, walls)
    return again(run, pairs, bodies, first, last, walls)


@rare
@kernel
def release(
    run: Record, pairs: Records, bodies: Records, low: int, high: int, now: float, walls: Walls
) -> None:
    """Let bodies `low` … `high` fall by themselves again."""
    first, last = max(low - 1, 0), min(high, len(pairs) - 1)
    for i in range(low, high + 1):
        body = bodies[i]
        if at_rest(body):
            which = CEILING - 1 if (i < len(pairs) and pairs[i].shut == CEILING) else FLOOR - 1
            if walls[0][which].panels > 0:
                body.u = place(walls, which, now)[1]
            borne(run, body, which, now, body.u, 1.0, walls)
            body.falls = 1.0
            free(body, (run.gravity - body.own) * now, body.own, walls)
        elif pressed(body):
            free(body, (body.push - body.own) * now, body.own, walls)
    for k in range(first, last + 1):
        pair = pairs[k]
        if pair.shut > FREE and (bodies[k].falls > 0.0 or bodies[k + 1].falls > 0.0):
            pair.shut, pair.gap, pair.at = FREE, 0.0, now
    repull(run, pairs, bodies, first, last, walls)
    for k in range(first, last + 1):
        if pairs[k].shut == FREE:
            follow(pairs[k], bodies[k], bodies[k + 1], walls)


@rare
@kernel
def free(body: Record, more: float, push: float, walls: Walls) -> None:
    """Let a ball fall by itself: `more` is what its velocity u grows by (m/s), for its velocity stays."""
    body.u += more
    body.push = push
    if walls[0][0].lands:
        body.noise += NOISE * (body.u * body.u)


@rare
@kernel
def leave(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Let what rests on a wall beyond shut pair `c` leave it at time `now`, as one; all pairs that open now do.

    Returns the first and the last pair to predict anew.
    """
    on, low, high = pairs[c].shut, c, c
    same = pairs[c].pull
    if on == FLOOR:
        while low > 0 and pairs[low - 1].pull == same:
            low -= 1
        while high + 1 < len(pairs) and pairs[high + 1].shut == on:
            high += 1
        b, e, opens = low + 1, high + 1, low
    else:
        while high + 1 < len(pairs) and pairs[high + 1].pull == same:
            high += 1
        while low > 0 and pairs[low - 1].shut == on:
            low -= 1
        b, e, opens = low, high, high
    side, push = walls[0][on - 1], common(bodies, b, e)
    v = place(walls, on - 1, now - 2.0**-49 * (abs(side.epoch) + abs(now)))[1]  # before a jump of its velocity
    first, last = max(low - 1, 0), min(high + 1, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
        if low <= k <= high:
            pairs[k].shut, pairs[k].gap, pairs[k].at = FREE, 0.0, now
    for i in range(b, e + 1):
        body = bodies[i]
        borne(run, body, on - 1, now, v, 1.0, walls)
        body.falls, body.u = 1.0, v
        free(body, (run.gravity - push) * now, push, walls)
    repull(run, pairs, bodies, first, last, walls)
    follow(pairs[opens], bodies[opens], bodies[opens + 1], walls)
    return again(run, pairs, bodies, first, last, walls)
