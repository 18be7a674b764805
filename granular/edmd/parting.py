"""What moved as one parts: it is hit, or leaves its wall.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.account import borne
from granular.edmd.as_one import again, common, is_closed, pressed, repull
from granular.edmd.collision import at_rest
from granular.edmd.driven import CEILING, FLOOR, FREE, carry, follow, place
from granular.edmd.motion import NOISE, Walls


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
