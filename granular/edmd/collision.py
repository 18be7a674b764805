"""Apply one collision to the two bodies of a pair, for both event queues.

Balls that rested on these bodies are released.
"""

from __future__ import annotations

import math

from granular._engine.kernels import FORCED, HUNG, RING, kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.clusters import (
    at_rest,
    ball_is_stuck,
    common,
    is_pressed,
    is_stuck,
    press_again,
    set_closing,
    stick,
    will_stick,
)
from granular.edmd.driven import place, take_wall_velocity
from granular.edmd.hanging import swing_off
from granular.edmd.motion import COLLISION_NOISE, across, add, carry, collide, impulse, rate_at_touch, velocities
from granular.edmd.physics import Restitution
from granular.edmd.records import CEILING, FLOOR, FREE, Walls
from granular.edmd.wall_state import book, borne, enter
from granular.scene.walls.thermal import drawn

SUSPICIOUS_STREAK = 8
"""Streak from which a collapse is suspected."""
MIN_RELATIVE_REBOUND = 2.0**-26
"""Rebound that raises a suspicion immediately, in units of the fall velocities.

Half of the digits of such a rate are lost in the velocities.
"""
MIN_INTERVAL, MAX_REBASED = 2.0**-20, 64
"""Limits for moving the zero of time when balls merge.

The zero of time is moved if the time between two collisions of a pair is below `MIN_INTERVAL` times the time on the
clock. It is moved for at most `MAX_REBASED` pairs, because all pairs have to be advanced.
"""


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`.

    Returns the first and the last pair to predict again, and the rate after the collision. The log entry is written to
    `row`, if given.
    """
    if FORCED and pairs[c].heat >= 0:
        return leave_thermal_wall(run, pairs, bodies, c, now, row, walls)
    pair, lower, upper, first, last = pairs[c], bodies[c], bodies[c + 1], c, c
    if RING and (c == 0 or c + 1 == len(pairs)):
        k = len(pairs) - 1 - c  # the neighbour across the seam
        run.clamps += carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    w = rate_at_touch(pair, lower, upper, walls)
    e = pair.eps if rule is None else rule(c, -w)
    # A call only for scenes with a remedy.
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied(run, pairs, c, -w, e, now)
    if FORCED and pair.wall >= 0:
        carry(pair, lower, upper, now, walls)  # sets the velocity of the wall at `now`
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, run.gravity, now)
    # Without a rebound, or with a rebound below the noise, the bodies may stick.
    nothing_left = e * w == 0.0 or (e * w) * (e * w) < lower.noise + upper.noise
    if e < 1.0 and (nothing_left or -w < run.merge_below) and will_stick(pairs, bodies, c, now, w, e, walls):
        first, last, exchanged = stick(run, pairs, bodies, c, now, w, walls)
    else:
        # The first factor is a cheap test: without gravity and mergers nothing is stuck.
        if (FORCED or run.gravity > 0.0 or run.merged > 0) and (ball_is_stuck(lower) or ball_is_stuck(upper)):
            first, last = wake(run, pairs, bodies, c, now, walls)
        else:  # carry the neighbours to `now`
            if c > 0:
                first = c - 1
                run.clamps += carry(pairs[first], bodies[first], lower, now, walls)
            if c + 1 < len(pairs):
                last = c + 1
                run.clamps += carry(pairs[last], upper, bodies[last + 1], now, walls)
        if HUNG:
            swing_off(pairs, bodies, c, now, w, e, row)
        else:
            collide(pair, lower, upper, now, w, e)
        exchanged = book(lower, upper, w, e, walls) if FORCED else impulse(lower, upper, (1.0 + e) * w)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, run.gravity, now)
        row.impulse = exchanged
    pair.contacts += 1
    pair.streak = streak(run, pair.streak, lower, upper, now, pair.last, -w, e) if 0.0 < e < 1.0 else 0
    pair.last = now
    if RING:
        across(bodies, c)
    return first, last, -e * w


@kernel
def remedied(run: Record, pairs: Records, c: int, speed: float, e: float, now: float) -> float:
    """Return ε of a collision of pair `c`, where `e` is the value of its rule.

    A collision is elastic if its `speed` is below `elastic_below`, or if one of its two bodies has collided less than
    `tc` before `now` (TC model, Luding & McNamara, Granular Matter 1, 113 (1998)).
    """
    if speed < run.elastic_below:
        return 1.0
    for k in range(max(c - 1, 0), min(c + 2, len(pairs))):
        if now - pairs[k].last < run.tc:
            return 1.0
    # The neighbour across the seam of a ring.
    end = len(pairs) - 1
    if RING and (c == 0 or c == end) and now - pairs[end - c].last < run.tc:
        return 1.0
    return e


@kernel
def streak(
    run: Record, count: int, lower: Record, upper: Record, now: float, last: float, speed: float, e: float
) -> int:
    """Return the number of consecutive suspicious collisions of a pair.

    `count` is the number before. A slow collision counts three times, and a repeated collision within a short time
    once. A rebound that velocities of their size can hardly represent raises a suspicion immediately. Where balls
    merge, so does a collision too soon after `last` for the resolution of the clock, because the order of the next
    events depends on it.
    """
    if run.slow < 0.0:
        # Order: cheap tests first. `MAX_REBASED` because all pairs are advanced when the clock moves.
        fine = (
            FORCED
            or HUNG
            or run.merge_below == 0.0
            or e == 0.0
            or run.pairs > MAX_REBASED
            or now - last >= MIN_INTERVAL * now
        )
        return 0 if fine else SUSPICIOUS_STREAK
    if 0.0 < e * speed < MIN_RELATIVE_REBOUND * max(abs(lower.fall_velocity), abs(upper.fall_velocity)):
        return SUSPICIOUS_STREAK
    if speed < run.slow:
        return count + 3
    return count + 1 if now - last <= run.short else 0


@rare
@kernel
def leave_thermal_wall(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, row: Record | None, walls: Walls
) -> tuple[int, int, float]:
    """Let the ball of pair `c` leave the thermal wall it hits at time `now`.

    Returns the same values as `event`. Such a hit is never part of a touching group or of a slice in `zoom`, and its
    bodies never merge. A ball pressed on the wall is hit immediately. The drawn speed depends on the number of earlier
    hits of the pair, so every queue and a resumed run draw the same speed. With w the rate before and s the drawn
    speed, the wall transfers the impulse m(s - w), does the work of this impulse at its own velocity, and adds the heat
    ½m(s² - w²).
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    side, w = walls.sides[pair.heat], rate_at_touch(pair, lower, upper, walls)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    pair.gap, pair.at = 0.0, now
    start, end = wake(run, pairs, bodies, c, now, walls)
    ball = upper if pair.heat == 0 else lower
    # A function of the contact count, not of a generator state: every queue draws the same speed.
    s = drawn(side.temperature, side.seed, pair.heat, pair.contacts, ball.mass)
    if pair.heat == 0:
        upper.fall_velocity = lower.fall_velocity + (pair.closing_acceleration * now + s)
    else:
        lower.fall_velocity = upper.fall_velocity - (pair.closing_acceleration * now + s)
    ball.noise = COLLISION_NOISE * (ball.fall_velocity * ball.fall_velocity + s * s)
    given = impulse(lower, upper, w - s)
    enter(lower, upper, given, 0.0, walls)
    side.heat, side.heat_low = add(side.heat, side.heat_low, 0.5 * (s + w) * given)
    side.given, side.given_low = add(side.given, side.given_low, given)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = given
    pair.contacts += 1
    pair.last = now
    return start, end, s


@rare
@kernel
def wake(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Release the bodies of pair `c`, which is hit, and the balls that rest on them.

    Balls that forces press against them are released as well. Returns the first and the last pair to predict again.
    """
    low, top = c, c + 1
    while low > 0 and is_pressed(bodies[low]) and is_stuck(pairs[low - 1], bodies[low - 1], bodies[low]):
        low -= 1
    while top < len(pairs) and ball_is_stuck(bodies[top]) and is_stuck(pairs[top], bodies[top], bodies[top + 1]):
        if FORCED and at_rest(bodies[top]) and pairs[top].wall >= 0:
            break
        top += 1
    if not FORCED and bodies[top].mass == math.inf:  # the bodies above rest on the ceiling, so those below rest on them
        top = c + 1
        while low > 0 and at_rest(bodies[low]) and is_stuck(pairs[low - 1], bodies[low - 1], bodies[low]):
            low -= 1
        if bodies[low].mass == math.inf:
            low = c
    first, last = max(low - 1, 0), min(top, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    release(run, pairs, bodies, low, top, now, walls)
    return press_again(run, pairs, bodies, first, last, walls)


@rare
@kernel
def release(run: Record, pairs: Records, bodies: Records, low: int, high: int, now: float, walls: Walls) -> None:
    """Release the stuck bodies `low` to `high`.

    From `now` on each of them falls under its own forces.
    """
    first, last = max(low - 1, 0), min(high, len(pairs) - 1)
    for i in range(low, high + 1):
        body = bodies[i]
        if FORCED:
            set_free(run, pairs, bodies, i, now, walls)
        # The fall velocity changes by g·now, so that the velocity is unchanged.
        elif at_rest(body):
            body.is_free = 1.0
            body.fall_velocity += run.gravity * now
    if FORCED:
        for k in range(first, last + 1):
            pair = pairs[k]
            if pair.stuck > FREE and (bodies[k].is_free > 0.0 or bodies[k + 1].is_free > 0.0):
                pair.stuck, pair.gap, pair.at = FREE, 0.0, now
    set_closing(run, pairs, bodies, first, last, walls)
    if FORCED:
        for k in range(first, last + 1):
            if pairs[k].stuck == FREE:
                take_wall_velocity(pairs[k], bodies[k], bodies[k + 1], walls)


@rare
@kernel
def set_free(run: Record, pairs: Records, bodies: Records, i: int, now: float, walls: Walls) -> None:
    """Release ball `i`, if it is stuck, to fall under its own force."""
    body = bodies[i]
    if at_rest(body):
        which = CEILING - 1 if (i < len(pairs) and pairs[i].stuck == CEILING) else FLOOR - 1
        if walls.sides[which].panels > 0:
            body.fall_velocity = place(walls, which, now)[1]
        borne(run, body, which, now, body.fall_velocity, 1.0, walls)
        body.is_free = 1.0
        accelerate(body, (run.gravity - body.own_acceleration) * now, body.own_acceleration, walls)
    elif is_pressed(body):
        accelerate(body, (body.force_acceleration - body.own_acceleration) * now, body.own_acceleration, walls)


@rare
@kernel
def accelerate(body: Record, more: float, push: float, walls: Walls) -> None:
    """Set the acceleration of a ball by forces to `push` (m/s²).

    The fall velocity changes by `more` (m/s), so that the velocity is unchanged.
    """
    body.fall_velocity += more
    body.force_acceleration = push
    if walls.sides[0].lands:
        body.noise += COLLISION_NOISE * (body.fall_velocity * body.fall_velocity)


@rare
@kernel
def leave(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Let the balls that rest on a wall beyond stuck pair `c` leave it as one.

    All pairs that open at time `now` open. Returns the first and the last pair to predict again.
    """
    on, low, high = pairs[c].stuck, c, c
    same = pairs[c].closing_acceleration
    if on == FLOOR:
        while low > 0 and pairs[low - 1].closing_acceleration == same:
            low -= 1
        while high + 1 < len(pairs) and pairs[high + 1].stuck == on:
            high += 1
        b, e, opens = low + 1, high + 1, low
    else:
        while high + 1 < len(pairs) and pairs[high + 1].closing_acceleration == same:
            high += 1
        while low > 0 and pairs[low - 1].stuck == on:
            low -= 1
        b, e, opens = low, high, high
    side, push = walls.sides[on - 1], common(bodies, b, e)
    v = place(walls, on - 1, now - 2.0**-49 * (abs(side.epoch) + abs(now)))[1]  # before a jump of the wall velocity
    first, last = max(low - 1, 0), min(high + 1, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
        if low <= k <= high:
            pairs[k].stuck, pairs[k].gap, pairs[k].at = FREE, 0.0, now
    for i in range(b, e + 1):
        body = bodies[i]
        borne(run, body, on - 1, now, v, 1.0, walls)
        body.is_free, body.fall_velocity = 1.0, v
        accelerate(body, (run.gravity - push) * now, push, walls)
    set_closing(run, pairs, bodies, first, last, walls)
    take_wall_velocity(pairs[opens], bodies[opens], bodies[opens + 1], walls)
    return press_again(run, pairs, bodies, first, last, walls)
