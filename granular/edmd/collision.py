"""Apply one collision to the two bodies of a pair, for both event queues.

Balls that rest on these bodies, or that leave a wall, are released here as well. Stuck pairs, the slice and other terms
are defined in `granular.edmd.motion`.
"""

from __future__ import annotations

import math

from granular._engine.kernels import FORCED, HUNG, RING, kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.clusters import (
    at_rest,
    ball_is_stuck,
    common_acceleration,
    is_pressed,
    is_stuck,
    recompute_closing,
    set_closing,
    stick,
    will_stick,
)
from granular.edmd.driven import take_wall_velocity, wall_displacement
from granular.edmd.hanging import swing_off
from granular.edmd.motion import (
    COLLISION_NOISE,
    add_compensated,
    advance_pair,
    apply_collision,
    copy_seam_ball,
    impulse,
    rate_at_touch,
    velocities,
)
from granular.edmd.physics import Restitution
from granular.edmd.records import CEILING, FLOOR, FREE, Walls
from granular.edmd.wall_state import account_collision, account_impulse, account_rest
from granular.scene.walls.thermal import drawn

SUSPICIOUS_STREAK = 8
"""Suspicion streak of a pair from which a collapse is suspected."""
MIN_RELATIVE_REBOUND = 2.0**-26
"""Rebound rate below which a collapse is suspected immediately.

It is in units of the larger fall velocity of the two bodies. Half of the digits of a smaller rate are lost in the
velocities.
"""
MIN_INTERVAL, MAX_REBASED = 2.0**-20, 64
"""Limits for moving the epoch where balls merge.

The epoch is moved if the time between two collisions of a pair is below `MIN_INTERVAL` times the time since the epoch.
This is done only in runs of at most `MAX_REBASED` pairs, because all pairs have to be advanced.
"""


@kernel
def collide_pair(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Apply the collision of pair `c` at time `now`.

    `rule` returns the coefficient of restitution, or is None if every pair has the constant `eps`. If `row` is not
    None, it receives the entry of the contact log. Bodies can stick if their rebound is zero or below their noise, or
    if their approach is slower than `merge_below`, see `clusters.will_stick`. Otherwise they rebound, and balls at rest
    on them are released.

    Returns the first and the last pair to predict again, and the rebound rate -ε·w (m/s), also if the bodies stick.
    """
    if FORCED and pairs[c].heat >= 0:
        return leave_thermal_wall(run, pairs, bodies, c, now, row, walls)
    pair, lower, upper, first, last = pairs[c], bodies[c], bodies[c + 1], c, c
    if RING and (c == 0 or c + 1 == len(pairs)):
        k = len(pairs) - 1 - c  # the neighbour across the seam
        run.clamps += advance_pair(pairs[k], bodies[k], bodies[k + 1], now, walls)
    w = rate_at_touch(pair, lower, upper, walls)
    e = pair.eps if rule is None else rule(c, -w)
    # A call only for scenes with a remedy.
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied_restitution(run, pairs, c, -w, e, now)
    if FORCED and pair.wall >= 0:
        advance_pair(pair, lower, upper, now, walls)  # sets the velocity of the wall at `now`
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, run.gravity, now)
    # Without a rebound, or with a rebound below the noise, the bodies can stick.
    no_rebound = e * w == 0.0 or (e * w) * (e * w) < lower.noise + upper.noise
    may_stick = e < 1.0 and (no_rebound or -w < run.merge_below)
    if may_stick and will_stick(pairs, bodies, c, now, w, e, walls):
        first, last, exchanged = stick(run, pairs, bodies, c, now, w, walls)
    else:
        # The first factor is a cheap test: without gravity and mergers nothing is stuck.
        if (FORCED or run.gravity > 0.0 or run.merged > 0) and (ball_is_stuck(lower) or ball_is_stuck(upper)):
            first, last = release_cluster(run, pairs, bodies, c, now, walls)
        else:  # carry the neighbours to `now`
            if c > 0:
                first = c - 1
                run.clamps += advance_pair(pairs[first], bodies[first], lower, now, walls)
            if c + 1 < len(pairs):
                last = c + 1
                run.clamps += advance_pair(pairs[last], upper, bodies[last + 1], now, walls)
        if HUNG:
            swing_off(pairs, bodies, c, now, w, e, row)
        else:
            apply_collision(pair, lower, upper, now, w, e)
        exchanged = account_collision(lower, upper, w, e, walls) if FORCED else impulse(lower, upper, (1.0 + e) * w)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, run.gravity, now)
        row.impulse = exchanged
    pair.contacts += 1
    pair.streak = suspicion_streak(run, pair.streak, lower, upper, now, pair.last, -w, e) if 0.0 < e < 1.0 else 0
    pair.last = now
    if RING:
        copy_seam_ball(bodies, c)
    return first, last, -e * w


@kernel
def remedied_restitution(run: Record, pairs: Records, c: int, speed: float, e: float, now: float) -> float:
    """Return ε of a collision, which is 1 if `tc` or `elastic_below` applies.

    The result is 1 if `speed` (m/s), the approach speed of pair `c`, is below `elastic_below`. It is also 1 if one of
    the two bodies has collided less than `tc` before `now` (TC model, Luding & McNamara, Granular Matter 1, 113
    (1998)). Otherwise it is `e`, the value of the restitution rule.
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
def suspicion_streak(
    run: Record, count: int, lower: Record, upper: Record, now: float, last: float, speed: float, e: float
) -> int:
    """Return the new suspicion streak of a pair after a collision.

    The streak counts consecutive collisions that look like an inelastic collapse. `count` is its value before. A
    collision slower than `run.slow` adds 3. A collision within `run.short` after `last`, the previous collision of the
    pair, adds 1. Any other collision resets the streak to 0. If the rebound is too slow to be represented by the fall
    velocities, the result is `SUSPICIOUS_STREAK`. `speed` is the approach speed (m/s) and `e` is ε.

    In runs without detection of a collapse (`run.slow` < 0), the result is 0 or `SUSPICIOUS_STREAK`. The latter is
    returned if balls can merge and the time since `last` is too short for the resolution of the clock. The order of
    the next events would then be uncertain.
    """
    if run.slow < 0.0:
        # Order: cheap tests first. `MAX_REBASED` because all pairs are advanced when the clock moves.
        is_resolved = (
            FORCED
            or HUNG
            or run.merge_below == 0.0
            or e == 0.0
            or run.pairs > MAX_REBASED
            or now - last >= MIN_INTERVAL * now
        )
        return 0 if is_resolved else SUSPICIOUS_STREAK
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
    """Reflect the ball of pair `c` from a thermal wall, with a random speed.

    Parameters and return values are as in `collide_pair`. Such a hit is never part of a touching group or a slice in
    `zoom`, and its bodies never merge. The drawn speed depends on the number of earlier hits of the pair. Every queue
    and a resumed run therefore draw the same speed.

    Let w be the rate before, s the drawn speed and m the mass of the ball. The wall transfers the impulse m(s - w),
    does the work of this impulse at its own velocity, and adds the heat ½m(s² - w²).
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    side, w = walls.sides[pair.heat], rate_at_touch(pair, lower, upper, walls)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    pair.gap, pair.at = 0.0, now
    start, end = release_cluster(run, pairs, bodies, c, now, walls)
    ball = upper if pair.heat == 0 else lower
    # A function of the contact count, not of a generator state: every queue draws the same speed.
    s = drawn(side.temperature, side.seed, pair.heat, pair.contacts, ball.mass)
    if pair.heat == 0:
        upper.fall_velocity = lower.fall_velocity + (pair.closing_acceleration * now + s)
    else:
        lower.fall_velocity = upper.fall_velocity - (pair.closing_acceleration * now + s)
    ball.noise = COLLISION_NOISE * (ball.fall_velocity * ball.fall_velocity + s * s)
    transferred = impulse(lower, upper, w - s)
    account_impulse(lower, upper, transferred, 0.0, walls)
    side.heat, side.heat_low = add_compensated(side.heat, side.heat_low, 0.5 * (s + w) * transferred)
    side.given, side.given_low = add_compensated(side.given, side.given_low, transferred)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = transferred
    pair.contacts += 1
    pair.last = now
    return start, end, s


@rare
@kernel
def release_cluster(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Release the bodies of colliding pair `c`, and the balls that rest on them.

    Balls that forces press against these bodies are released as well. `now` is the time. Returns the first and the last
    pair to predict again.
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
        advance_pair(pairs[k], bodies[k], bodies[k + 1], now, walls)
    release_bodies(run, pairs, bodies, low, top, now, walls)
    return recompute_closing(run, pairs, bodies, first, last, walls)


@rare
@kernel
def release_bodies(run: Record, pairs: Records, bodies: Records, low: int, high: int, now: float, walls: Walls) -> None:
    """Release the stuck bodies `low` to `high` at time `now`.

    From then onwards each body moves under its own forces. The closing accelerations and stuck marks of their pairs are
    updated. Bodies that are not stuck are unchanged.
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
    """Release ball `i` at time `now`, if it is stuck.

    It can rest on a wall, or be pressed against other balls by forces. From then onwards it moves under its own forces.
    """
    body = bodies[i]
    if at_rest(body):
        which = CEILING - 1 if (i < len(pairs) and pairs[i].stuck == CEILING) else FLOOR - 1
        if walls.sides[which].panels > 0:
            body.fall_velocity = wall_displacement(walls, which, now)[1]
        account_rest(run, body, which, now, body.fall_velocity, 1.0, walls)
        body.is_free = 1.0
        set_acceleration(body, (run.gravity - body.own_acceleration) * now, body.own_acceleration, walls)
    elif is_pressed(body):
        set_acceleration(body, (body.force_acceleration - body.own_acceleration) * now, body.own_acceleration, walls)


@rare
@kernel
def set_acceleration(body: Record, velocity_change: float, push: float, walls: Walls) -> None:
    """Set the acceleration of a ball by forces to `push` (m/s²).

    The fall velocity changes by `velocity_change` (m/s), so that the current velocity stays the same.
    """
    body.fall_velocity += velocity_change
    body.force_acceleration = push
    if walls.sides[0].lands:
        body.noise += COLLISION_NOISE * (body.fall_velocity * body.fall_velocity)


@rare
@kernel
def leave_wall(run: Record, pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Release the balls that rest on a wall beyond stuck pair `c`.

    This is the event in which the bodies of pair `c` separate at time `now`. All balls on the side of the pair that
    faces away from the wall leave the wall together, with their common acceleration. Pairs nearer to the wall with the
    same closing acceleration separate too. Returns the first and the last pair to predict again.
    """
    wall, low, high = pairs[c].stuck, c, c
    pull = pairs[c].closing_acceleration
    if wall == FLOOR:
        while low > 0 and pairs[low - 1].closing_acceleration == pull:
            low -= 1
        while high + 1 < len(pairs) and pairs[high + 1].stuck == wall:
            high += 1
        b, e, opening_pair = low + 1, high + 1, low
    else:
        while high + 1 < len(pairs) and pairs[high + 1].closing_acceleration == pull:
            high += 1
        while low > 0 and pairs[low - 1].stuck == wall:
            low -= 1
        b, e, opening_pair = low, high, high
    side, push = walls.sides[wall - 1], common_acceleration(bodies, b, e)
    # the wall velocity before a jump
    v = wall_displacement(walls, wall - 1, now - 2.0**-49 * (abs(side.epoch) + abs(now)))[1]
    first, last = max(low - 1, 0), min(high + 1, len(pairs) - 1)
    for k in range(first, last + 1):
        advance_pair(pairs[k], bodies[k], bodies[k + 1], now, walls)
        if low <= k <= high:
            pairs[k].stuck, pairs[k].gap, pairs[k].at = FREE, 0.0, now
    for i in range(b, e + 1):
        body = bodies[i]
        account_rest(run, body, wall - 1, now, v, 1.0, walls)
        body.is_free, body.fall_velocity = 1.0, v
        set_acceleration(body, (run.gravity - push) * now, push, walls)
    set_closing(run, pairs, bodies, first, last, walls)
    take_wall_velocity(pairs[opening_pair], bodies[opening_pair], bodies[opening_pair + 1], walls)
    return recompute_closing(run, pairs, bodies, first, last, walls)
