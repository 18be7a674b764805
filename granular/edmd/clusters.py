"""Clusters: balls that stick together, or rest on a wall or on each other.

Clusters are not stored as objects. The gap, the rate and the closing acceleration of a *stuck* pair are exactly 0. It
never collides by itself, and no mark is needed. A ball that rests on a wall, directly or on a pile, is not free
(`is_free` = 0) and has the velocity of the wall. The next ball therefore meets it like a floor. A hit on a cluster is
an ordinary collision of the body that is hit. Simultaneous collisions then propagate it through the cluster.

In scenes with forces or driven walls, the field `stuck` marks the stuck pairs. A ball whose rebound is below its
rounding error comes to rest. On a driven wall it then moves with the velocity of the wall, without events, until no
acceleration presses it on the wall any more. Balls that forces press together in mid-air move with their common
acceleration until one of them is hit. The terms are defined in `granular.edmd.motion`.
"""

from __future__ import annotations

import math

from granular._engine.kernels import FORCED, HUNG, RING, kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.driven import is_pressed_on_wall, rate_of
from granular.edmd.hanging import swing_together
from granular.edmd.motion import COLLISION_NOISE, advance_pair, total_mass
from granular.edmd.records import BOTH, CEILING, FLOOR, FREE, Walls
from granular.edmd.wall_state import account_impulse, account_rest
from granular.scene.walls.hits import pressing_bounds
from granular.scene.walls.path import moved


@kernel
def is_stuck(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair touch and move with the same velocity."""
    # Next to a driven wall equal velocities are not a proof, so the mark decides.
    if FORCED and (pair.stuck > FREE or pair.wall >= 0):
        return pair.stuck > FREE  # type: ignore[no-any-return]
    return pair.gap == 0.0 and pair.closing_acceleration == 0.0 and upper.fall_velocity == lower.fall_velocity  # type: ignore[no-any-return]


@kernel
def at_rest(body: Record) -> bool:
    """Return whether a ball rests on a wall, directly or on a pile."""
    return body.is_free == 0.0 and body.mass < math.inf  # type: ignore[no-any-return]


@kernel
def is_pressed(body: Record) -> bool:
    """Return whether forces press a ball in mid-air against other balls."""
    return FORCED and body.is_free > 0.0 and body.force_acceleration != body.own_acceleration


@kernel
def ball_is_stuck(body: Record) -> bool:
    """Return whether a ball rests on a wall, or is pressed against others by forces."""
    return (FORCED and is_pressed(body)) or (body.is_free == 0.0 and body.mass < math.inf)


@kernel
def stick(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Join the bodies of pair `c` at time `now`, so that they move with one velocity.

    `w` ≤ 0 is the rate of the pair in m/s before. All bodies that are stuck to these two bodies are included. Returns
    the first and the last pair to predict again, and the momentum in kg m/s that pair `c` exchanged.
    """
    run.merged += 1
    if HUNG:
        return swing_together(run, pairs, bodies, c, now, w, walls)
    first, last, exchanged = join_clusters(run, pairs, bodies, c, now, w, walls)
    if not (FORCED and walls.sides[0].lands):  # otherwise `join_clusters` has set their common noise
        set_common_noise(bodies, c, first, last, w)
    return first, last, exchanged


@rare
@kernel
def join_clusters(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Join the clusters of both bodies of pair `c` at time `now`.

    Parameters and return values are as in `stick`. If one of the clusters touches a wall or a pile on a wall, all
    bodies take the velocity of the wall. Otherwise they take their common velocity, which conserves momentum.
    """
    n = len(pairs)
    b, e = cluster_limits(pairs, bodies, c)
    for k in (b - 1, c, e):  # all pairs between are stuck
        k = k % n if RING else min(max(k, 0), n - 1)
        advance_pair(pairs[k], bodies[k], bodies[k + 1], now, walls)
    pairs[c].gap = 0.0
    on_floor, on_ceiling = bodies[c].is_free == 0.0, bodies[c + 1].is_free == 0.0
    # The wall has infinite mass: only the bodies on the other side take part in the impulse.
    if on_floor or on_ceiling:
        mass = total_mass(bodies, c + 1, e) if on_floor else total_mass(bodies, b, c)
        exchanged = -mass * w
        if FORCED and not (on_floor and on_ceiling):
            account_impulse(bodies[c], bodies[c + 1], exchanged, 0.5 * mass * w * w, walls)
        if on_floor:
            stop_bodies(run, pairs, bodies, c, e, now, FLOOR, walls)
        else:
            stop_bodies(run, pairs, bodies, b, c + 1, now, CEILING, walls)
    else:
        exchanged = join_in_flight(bodies, b, c, e, now, w, walls)
    first, last = max(b - 1, 0), min(e, n - 1)
    if RING and (b < 0 or e > n):
        first, last = 0, n - 1
    first, last = recompute_closing(run, pairs, bodies, first, last, walls)
    return first, last, exchanged


@kernel
def cluster_limits(pairs: Records, bodies: Records, c: int) -> tuple[int, int]:
    """Return the lowest and the highest body that move as one with a body of pair `c`.

    Pair `c` collides now. The cluster does not include a wall or a pile on a wall, because a pile meets the cluster in
    a collision of its own, which can be elastic. On a ring, body numbers continue beyond the seam.
    """
    n, b, e = len(pairs), c, c + 1
    while (RING or b > 0) and is_stuck_in_flight(pairs, bodies, (b - 1) % n):
        b -= 1
    while (RING or e < n) and is_stuck_in_flight(pairs, bodies, e % n):
        e += 1
    return b, e


@kernel
def is_stuck_in_flight(pairs: Records, bodies: Records, c: int) -> bool:
    """Return whether the bodies of pair `c` move as one and do not rest on a wall."""
    lower, upper = bodies[c], bodies[c + 1]
    return lower.is_free * upper.is_free > 0.0 and is_stuck(pairs[c], lower, upper)


@rare
@kernel
def stop_bodies(
    run: Record, pairs: Records, bodies: Records, b: int, e: int, now: float, wall: int, walls: Walls
) -> None:
    """Bring bodies `b` to `e` to rest on the wall `wall` at time `now`.

    `wall` is `FLOOR` or `CEILING`. The body next to the wall, `b` or `e`, is a wall or at rest already.
    """
    support = bodies[b] if wall == FLOOR else bodies[e]
    for i in range(b, e + 1):
        body = bodies[i]
        if FORCED and body.is_free > 0.0:
            body.force_acceleration = 0.0
            account_rest(run, body, wall - 1, now, support.fall_velocity, -1.0, walls)
        if not FORCED or body.mass < math.inf:
            body.fall_velocity, body.noise = support.fall_velocity, support.noise
        body.is_free = 0.0
    if FORCED:
        for k in range(b, e):
            pairs[k].stuck, pairs[k].gap, pairs[k].at = wall, 0.0, now


@kernel
def join_in_flight(bodies: Records, b: int, c: int, e: int, now: float, w: float, walls: Walls) -> float:
    """Give bodies `b` to `e` in mid-air a common velocity and a common acceleration.

    Their clusters meet in pair `c` with the rate `w` (m/s, not positive) at time `now`. Momentum is conserved. Returns
    the momentum in kg m/s that pair `c` exchanged.
    """
    lower, upper = total_mass(bodies, b, c), total_mass(bodies, c + 1, e)
    part = upper / (lower + upper)
    u, exchanged = bodies[c].fall_velocity + part * w, -(lower * part) * w
    if FORCED:
        push = common_acceleration(bodies, b, e)
        u = (bodies[c].fall_velocity + (bodies[c].force_acceleration - push) * now) + part * w
        account_impulse(bodies[c], bodies[c + 1], exchanged, -0.5 * w * exchanged, walls)
        noise = COLLISION_NOISE * (u * u)
        for i in range(b, e + 1):  # the mean by mass: a maximum would grow with every hit
            noise += bodies[i].mass / (lower + upper) * bodies[i].noise
        for i in range(b, e + 1):
            bodies[i].force_acceleration = push
            if walls.sides[0].lands:
                bodies[i].noise = noise
    for i in range(b, e + 1):
        bodies[i % (len(bodies) - 1) if RING else i].fall_velocity = u
    if RING:
        bodies[len(bodies) - 1].fall_velocity = bodies[0].fall_velocity
    return exchanged


@rare
@kernel
def set_common_noise(bodies: Records, c: int, first: int, last: int, w: float) -> None:
    """Set the common noise of all bodies that move as one with pair `c`.

    Pair `c` has just joined its bodies at the rate `w` (m/s). All these bodies belong to pairs `first` to `last`. The
    common noise is the mean weighted by mass, like the common velocity. It is an upper bound, and Σ m noise grows by
    rounding only. A body that rests on a wall has the velocity of the wall and zero noise.
    """
    u, noise, mass = bodies[c].fall_velocity, 0.0, 0.0
    for i in range(first, last + 2):
        if bodies[i].fall_velocity == u and bodies[i].is_free > 0.0:
            noise += bodies[i].mass * bodies[i].noise
            mass += bodies[i].mass
    for i in range(first, last + 2):
        if bodies[i].fall_velocity == u and bodies[i].is_free > 0.0:
            bodies[i].noise = noise / mass + COLLISION_NOISE * (u * u + w * w)


@kernel
def will_stick(pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, walls: Walls) -> bool:
    """Return whether pair `c` sticks in a weak collision.

    `w` ≤ 0 is the rate (m/s) before the collision, `e` is ε. A pair sticks if no acceleration pulls it apart: a
    ceiling, for example, cannot carry a ball. Driven walls have further conditions, see `will_stick_to_wall`.
    """
    if FORCED and pairs[c].wall >= 0:
        return will_stick_to_wall(pairs, bodies, c, now, w, e, walls)
    return pairs[c].closing_acceleration >= 0.0  # type: ignore[no-any-return]


@rare
@kernel
def will_stick_to_wall(pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, walls: Walls) -> bool:
    """Return whether pair `c` next to a driven wall sticks in a weak collision.

    `w` ≤ 0 is the rate (m/s) before the collision, `e` is ε. A single ball on a driven wall does not stick: its
    bounces are computed one by one. A ball that moves as one with others, or that hits a ball resting on the wall,
    sticks if it is certainly pressed on the wall for twice the duration of its remaining bounces. With the speed u
    after the collision and the acceleration a relative to the wall, this duration is 2u/(a(1 - ε)).
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    wall_body, k = (lower, c + 1) if pair.wall == 0 else (upper, c - 1)
    is_single = not (0 <= k < len(pairs) and is_stuck(pairs[k], bodies[k], bodies[k + 1]))
    if (wall_body.mass == math.inf and e > 0.0 and is_single) or lower.is_free == upper.is_free:
        return False
    side = walls.sides[pair.wall]
    t, tail = side.epoch, side.low + now
    _, _, a = moved(side, walls.panels, t, tail)
    # The acceleration of the wall adds to the acceleration of the ball relative to a wall at rest.
    a += pair.closing_acceleration
    if a <= 0.0:
        return False
    low, _ = pressing_bounds(side, walls.panels, t, tail, pair.closing_acceleration, -4.0 * e * w / (a * (1.0 - e)))
    # Half of the current pressure is the margin: the bounces then end within twice their estimated duration.
    return low >= 0.5 * a  # type: ignore[no-any-return]


@rare
@kernel
def bring_to_rest(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> tuple[int, int]:
    """Bring the bodies of pair `c` to rest if they are pressed together.

    The pair has no next event. With forces or driven walls, the bodies have to touch with rate 0 and to be pressed
    together. Otherwise nothing changes. In all other scenes the caller has checked these conditions, and the upper
    body comes to rest on the wall or on the pile below it. Returns the first and the last pair to predict again. If
    nothing has changed, these are `c` + 1 and `c`, an empty range.
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    if not FORCED:
        top = min(c + 1, len(pairs) - 1)
        if top > c:
            advance_pair(pairs[top], bodies[top], bodies[top + 1], pair.at, walls)
        # count of balls whose remaining relative velocity is a rounding error
        run.settled += upper.fall_velocity - pair.closing_acceleration * pair.at != lower.fall_velocity
        upper.is_free, upper.fall_velocity, upper.noise = 0.0, lower.fall_velocity, lower.noise
        set_closing(run, pairs, bodies, c, top, walls)
        return c + 1, top
    if pair.stuck > FREE or pair.gap != 0.0 or rate_of(pair, lower, upper) != 0.0:
        return c + 1, c
    a = pair.closing_acceleration
    if lower.is_free == upper.is_free == 0.0 or not (is_pressed_on_wall(pair, walls) if pair.wall >= 0 else a > 0.0):
        return c + 1, c
    w = (upper.fall_velocity - lower.fall_velocity) - a * pair.at
    run.settled += w != 0.0
    first, last, _ = join_clusters(run, pairs, bodies, c, pair.at, w, walls)
    return first, last


@kernel
def recompute_closing(
    run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls
) -> tuple[int, int]:
    """Recompute the closing accelerations of pairs `first` to `last`.

    With forces, the range is extended to any cluster that rests on the floor or the ceiling. Returns the first and the
    last pair of the extended range.
    """
    if FORCED and walls.sides[0].forces:
        first = 0 if pairs[0].stuck == FLOOR else first
        last = len(pairs) - 1 if pairs[len(pairs) - 1].stuck == CEILING else last
    set_closing(run, pairs, bodies, first, last, walls)
    return first, last


@kernel
def set_closing(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> None:
    """Set the closing accelerations of pairs `first` to `last` from their bodies.

    For a stuck pair with forces, this is the closing acceleration of all bodies that rest on the wall through the pair.
    """
    for c in range(first, last + 1):
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        if FORCED:
            pull = closing_under_forces(run, pairs, bodies, c, walls)
            if pair.stuck > FREE and pull != pair.closing_acceleration and pair.at < run.now:
                pair.at = run.now
            pair.closing_acceleration = pull
        else:
            pair.closing_acceleration = run.gravity * (upper.is_free - lower.is_free)


@rare
@kernel
def closing_under_forces(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> float:
    """Return the closing acceleration (m/s²) of pair `c` under forces.

    The function also sets the field `wall` of the pair: the driven walls next to it.
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    is_on_floor = lower.is_free == 0.0 and walls.sides[0].panels > 0 and pair.stuck != CEILING
    is_on_ceiling = upper.is_free == 0.0 and walls.sides[1].panels > 0 and pair.stuck != FLOOR
    pair.wall = BOTH if is_on_floor and is_on_ceiling else 0 if is_on_floor else 1 if is_on_ceiling else -1
    if pair.stuck == FLOOR:
        # All bodies above that rest on the floor through this pair.
        top = c + 1
        while top < len(pairs) and pairs[top].stuck == FLOOR:
            top += 1
        return run.gravity - common_acceleration(bodies, c + 1, top)  # type: ignore[no-any-return]
    if pair.stuck == CEILING:
        # All bodies below that rest on the ceiling through this pair.
        low = c
        while low > 0 and pairs[low - 1].stuck == CEILING:
            low -= 1
        return common_acceleration(bodies, low, c) - run.gravity  # type: ignore[no-any-return]
    return run.gravity * (upper.is_free - lower.is_free) - (upper.force_acceleration - lower.force_acceleration)  # type: ignore[no-any-return]


@rare
@kernel
def common_acceleration(bodies: Records, b: int, e: int) -> float:
    """Return the common acceleration (m/s²) of bodies `b` to `e` by forces.

    It is the mean of their own accelerations, weighted by mass.
    """
    # Summing differences keeps equal accelerations exact.
    own, excess, mass = bodies[e].own_acceleration, 0.0, 0.0
    for i in range(b, e + 1):
        mass += bodies[i].mass
        excess += bodies[i].mass * (bodies[i].own_acceleration - own)
    return own + excess / mass  # type: ignore[no-any-return]
