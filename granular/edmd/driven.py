"""Walls that move along a path, and forces on balls: the flight of a pair beside a wall that shakes.

The state is the same: gaps, and fall velocities that change at impacts only. A body falls with g, if it is free, less
the `force_acceleration` by the force on it (of those that move as one, their common one). Beside a moving wall the gap
is followed by `granular.walls`; the fall velocity of the wall, and of what is stuck to it, is that of the wall at the
time `at` of the pair, so that the rate of the gap is written as that of any other. They are not free; pairs among them
are stuck.
"""

from __future__ import annotations

import math

from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.records import AT_CEILING, AT_FLOOR, BOTH, Walls
from granular.scene.walls.gap import after, state
from granular.scene.walls.hits import first_hit, lift_off, opens
from granular.scene.walls.path import moved

NEVER = math.inf


@kernel
def rate_of(pair: Record, lower: Record, upper: Record) -> float:
    """Return the rate of a pair at its time (m/s); 0 where the bodies touch and it is but rounding."""
    rate = (upper.fall_velocity - lower.fall_velocity) - pair.closing_acceleration * pair.at
    if pair.gap == 0.0 and rate * rate <= lower.noise + upper.noise:
        return 0.0
    return rate  # type: ignore[no-any-return]


@rare
@kernel
def next_wall_hit(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair beside a driven wall collides, inf if it never does; note it as `wait`.

    Between two of them the bodies meet when there is no room left: then the run is over.
    """
    if pair.wall == BOTH:
        return NEVER
    side, rate, a = walls.sides[pair.wall], rate_of(pair, lower, upper), pair.closing_acceleration
    pair.wait = first_hit(side, walls.panels, side.epoch, side.low + pair.at, pair.gap, rate, a, NEVER)
    return pair.at + pair.wait  # type: ignore[no-any-return]


@rare
@kernel
def opening(pair: Record, walls: Walls) -> float:
    """Return the time at which a stuck pair opens: nothing presses it any more, or the velocity of its wall jumps."""
    if pair.wall < 0:
        return pair.at if pair.closing_acceleration < 0.0 else NEVER
    side = walls.sides[pair.wall]
    wait, rate = lift_off(side, walls.panels, side.epoch, side.low + pair.at, pair.closing_acceleration, NEVER)
    time = pair.at + wait
    if rate != 0.0:
        time += 2.0**-50 * (abs(side.epoch) + abs(time))  # after the jump for certain
    return time  # type: ignore[no-any-return]


@rare
@kernel
def rate_at_wall(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate, not positive, at which a pair beside a driven wall is about to collide."""
    side, rate, a = walls.sides[pair.wall], rate_of(pair, lower, upper), pair.closing_acceleration
    t, tail = side.epoch, side.low + pair.at
    _, w = after(side, walls.panels, t, tail, pair.gap, rate, a, pair.wait)
    if w >= 0.0 and pair.wait > 0.0:  # at a jump of the wall's velocity
        _, w = after(side, walls.panels, t, tail, pair.gap, rate, a, pair.wait + 2.0**-50 * (abs(t) + abs(tail)))
    if w >= 0.0 and pair.gap == 0.0:
        w = -rate  # a bounce too low for the time of the next one
    return min(w, 0.0)


@rare
@kernel
def beside(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> tuple[float, float]:
    """Return gap (m) and rate (m/s) of a pair beside a driven wall at time `now`."""
    if pair.wall == BOTH:
        return apart(pair, walls, now)
    side, rate = walls.sides[pair.wall], rate_of(pair, lower, upper)
    t, tail = side.epoch, side.low + pair.at
    return after(side, walls.panels, t, tail, pair.gap, rate, pair.closing_acceleration, now - pair.at)


@rare
@kernel
def take_wall_velocity(pair: Record, lower: Record, upper: Record, walls: Walls) -> None:
    """Give what is stuck to a driven wall, of a pair beside it, the velocity of the wall at the time of the pair."""
    if pair.wall == AT_FLOOR or pair.wall == BOTH:
        _, lower.fall_velocity = place(walls, 0, pair.at)
    if pair.wall == AT_CEILING or pair.wall == BOTH:
        _, upper.fall_velocity = place(walls, 1, pair.at)


@rare
@kernel
def place(walls: Walls, which: int, now: float) -> tuple[float, float]:
    """Return how far a wall has moved since the start (m), and its velocity (m/s)."""
    side = walls.sides[which]
    x, v = side.velocity * ((side.epoch - side.begin) + (side.low + now)), side.velocity
    if side.panels > 0:
        m, dm, _ = moved(side, walls.panels, side.epoch, side.low + now)
        x += side.side * (m - side.origin)
        v += side.side * dm
    return x, v


@rare
@kernel
def apart(pair: Record, walls: Walls, now: float) -> tuple[float, float]:
    """Return gap (m) and rate (m/s) of a pair between two driven walls, what rests on them included, at time `now`."""
    below, floor = place(walls, 0, now)
    above, ceiling = place(walls, 1, now)
    gap = pair.gap + ((above - place(walls, 1, pair.at)[0]) - (below - place(walls, 0, pair.at)[0]))
    return gap, ceiling - floor


@rare
@kernel
def presses(pair: Record, walls: Walls) -> bool:
    """Return whether a ball that touches a driven wall, at the time of their pair, is pressed on it."""
    side = walls.sides[pair.wall]
    now = state(side, walls.panels, side.epoch, side.low + pair.at, 0.0, 0.0, pair.closing_acceleration)
    return opens(side, walls.panels[now.panel], now, 0.0, 0.0) == 0.0


@kernel
def synchronise(pairs: Records, bodies: Records, walls: Walls) -> None:
    """Give the driven walls their velocities, for another zero of times."""
    for c in range(len(pairs)):
        take_wall_velocity(pairs[c], bodies[c], bodies[c + 1], walls)
