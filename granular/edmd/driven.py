"""Flight of a pair next to a driven wall, and under constant forces on the balls.

The state consists of gaps and of fall velocities that change only in collisions, as without forces. A free body falls
with the acceleration g - `force_acceleration`, where the second term is the upward acceleration by the force on it.
Balls that move as one have a common `force_acceleration`.

Next to a moving wall the gap is evaluated by `granular.scene.walls`. The fall velocity of the wall, and of every ball
that rests on it, is the velocity of the wall at the time `at` of the pair. The rate of the gap then has the same
formula as for any other pair. Walls and balls that rest on them are not free, and the pairs between them are stuck.
The terms are defined in `granular.edmd.motion`.
"""

from __future__ import annotations

import math

from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.records import AT_CEILING, AT_FLOOR, BOTH, Walls
from granular.scene.walls.gap import gap_at_time, gap_state
from granular.scene.walls.hits import first_hit, lift_off, opening_time
from granular.scene.walls.path import moved

NO_EVENT_TIME = math.inf


@kernel
def rate_of(pair: Record, lower: Record, upper: Record) -> float:
    """Return the rate (m/s) of a pair at its time `at`.

    The result is 0 if the bodies touch and their relative velocity is below its noise.
    """
    rate = (upper.fall_velocity - lower.fall_velocity) - pair.closing_acceleration * pair.at
    if pair.gap == 0.0 and rate * rate <= lower.noise + upper.noise:
        return 0.0
    return rate  # type: ignore[no-any-return]


@rare
@kernel
def next_wall_hit(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time of the next hit on the driven wall of a pair, or inf.

    The time in s from `at` to the hit is stored in the field `wait`. A touch at which the velocity of the wall jumps
    away from the ball does not count, because it has no impulse. A pair between two driven walls has no hit: its bodies
    meet only when no room is left, and the run ends at that time.
    """
    if pair.wall == BOTH:
        return NO_EVENT_TIME
    side, rate, a = walls.sides[pair.wall], rate_of(pair, lower, upper), pair.closing_acceleration
    t, tail = side.epoch, side.low + pair.at
    pair.wait = first_hit(side, walls.panels, t, tail, pair.gap, rate, a, NO_EVENT_TIME)
    while pair.wait < NO_EVENT_TIME and rate_at_wall(pair, lower, upper, walls) > 0.0:
        after = pair.wait + time_past_jump(t, abs(tail) + pair.wait)
        _, opening_rate = gap_at_time(side, walls.panels, t, tail, pair.gap, rate, a, after)
        pair.wait = after + first_hit(side, walls.panels, t, tail + after, 0.0, opening_rate, a, NO_EVENT_TIME)
    return pair.at + pair.wait  # type: ignore[no-any-return]


@rare
@kernel
def opening(pair: Record, walls: Walls) -> float:
    """Return the time at which the bodies of a stuck pair separate, or inf.

    They separate when no acceleration presses them together any more, or when the velocity of their wall jumps.
    """
    if pair.wall < 0:
        return pair.at if pair.closing_acceleration < 0.0 else NO_EVENT_TIME
    side = walls.sides[pair.wall]
    wait, rate = lift_off(side, walls.panels, side.epoch, side.low + pair.at, pair.closing_acceleration, NO_EVENT_TIME)
    time = pair.at + wait
    if rate != 0.0:
        time += 2.0**-50 * (abs(side.epoch) + abs(time))  # after the jump despite rounding
    return time  # type: ignore[no-any-return]


@kernel
def time_past_jump(t: float, tail: float) -> float:
    """Return a time in s that leads past a jump of the wall velocity.

    It exceeds the rounding error of the time t + tail.
    """
    return 2.0**-50 * (abs(t) + abs(tail))


@rare
@kernel
def rate_at_wall(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate (m/s) of a pair at its next hit on a driven wall.

    It is positive only if the wall's velocity jumps away from the ball, which `next_wall_hit` excludes.
    """
    side, rate, a = walls.sides[pair.wall], rate_of(pair, lower, upper), pair.closing_acceleration
    t, tail = side.epoch, side.low + pair.at
    _, w = gap_at_time(side, walls.panels, t, tail, pair.gap, rate, a, pair.wait)
    if w >= 0.0 and pair.wait > 0.0:  # The wall velocity jumps at the hit: take the rate just after the jump.
        _, w = gap_at_time(side, walls.panels, t, tail, pair.gap, rate, a, pair.wait + time_past_jump(t, tail))
        if w > 0.0 and w * w > lower.noise + upper.noise:
            return w
    if w >= 0.0 and pair.gap == 0.0:
        w = -rate  # The next bounce is too short for the resolution of the clock.
    return min(w, 0.0)


@rare
@kernel
def gap_at_wall(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> tuple[float, float]:
    """Return the gap (m) and rate (m/s) at time `now` of a pair next to a driven wall."""
    if pair.wall == BOTH:
        return gap_between_walls(pair, walls, now)
    side, rate = walls.sides[pair.wall], rate_of(pair, lower, upper)
    t, tail = side.epoch, side.low + pair.at
    return gap_at_time(side, walls.panels, t, tail, pair.gap, rate, pair.closing_acceleration, now - pair.at)


@rare
@kernel
def take_wall_velocity(pair: Record, lower: Record, upper: Record, walls: Walls) -> None:
    """Set the velocity of the body on the wall side of a pair next to a driven wall.

    This body is the wall or a ball that rests on it. It gets the velocity of the wall at the time `at` of the pair.
    """
    if pair.wall == AT_FLOOR or pair.wall == BOTH:
        _, lower.fall_velocity = wall_displacement(walls, 0, pair.at)
    if pair.wall == AT_CEILING or pair.wall == BOTH:
        _, upper.fall_velocity = wall_displacement(walls, 1, pair.at)


@rare
@kernel
def wall_displacement(walls: Walls, which: int, now: float) -> tuple[float, float]:
    """Return the displacement (m) since the start and the velocity (m/s) of a wall.

    `which` is 0 for the floor and 1 for the ceiling, and `now` is the time in s since the epoch.
    """
    side = walls.sides[which]
    x, v = side.velocity * ((side.epoch - side.begin) + (side.low + now)), side.velocity
    if side.panels > 0:
        # Panels hold the path with its sign towards the balls; `origin` is its value at the start.
        m, dm, _ = moved(side, walls.panels, side.epoch, side.low + now)
        x += side.side * (m - side.origin)
        v += side.side * dm
    return x, v


@rare
@kernel
def gap_between_walls(pair: Record, walls: Walls, now: float) -> tuple[float, float]:
    """Return gap (m) and rate (m/s) at time `now` of a pair between two driven walls.

    The bodies of the pair are the walls or balls that rest on them.
    """
    below, floor = wall_displacement(walls, 0, now)
    above, ceiling = wall_displacement(walls, 1, now)
    above_before, below_before = wall_displacement(walls, 1, pair.at)[0], wall_displacement(walls, 0, pair.at)[0]
    gap = pair.gap + ((above - above_before) - (below - below_before))
    return gap, ceiling - floor


@rare
@kernel
def is_pressed_on_wall(pair: Record, walls: Walls) -> bool:
    """Return whether the ball of a pair is pressed on the driven wall that it touches.

    The acceleration is evaluated at the time `at` of the pair.
    """
    side = walls.sides[pair.wall]
    now = gap_state(side, walls.panels, side.epoch, side.low + pair.at, 0.0, 0.0, pair.closing_acceleration)
    return opening_time(side, walls.panels[now.panel], now, 0.0, 0.0) == 0.0


@kernel
def update_wall_velocities(pairs: Records, bodies: Records, walls: Walls) -> None:
    """Update the velocities of driven walls, and of balls on them, in all pairs.

    Each velocity is evaluated at the time `at` of its pair. This is needed after the epoch has moved.
    """
    for c in range(len(pairs)):
        take_wall_velocity(pairs[c], bodies[c], bodies[c + 1], walls)
