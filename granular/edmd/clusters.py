"""Clusters: balls that stick together, or rest on a wall or on each other.

Clusters are not stored as objects. A *stuck* pair has gap 0, rate 0 and closing acceleration 0, all exactly. It never
collides by itself and needs no mark. A ball that rests on a wall, directly or on a pile, is not free and has the
velocity of the wall. The next ball then meets it like a floor. A hit on a cluster is an ordinary collision of the body
that is hit, and propagates through the cluster by simultaneous collisions.

Scenes with forces or driven walls have more kinds of rest, and mark their stuck pairs. A ball whose rebound is below
its rounding error comes to rest. On a driven wall it moves with the velocity of the wall, without events, until no
acceleration presses it on the wall any more. Balls that forces press together in mid-air move as one with their common
acceleration, until one of them is hit.
"""

from __future__ import annotations

import math

from granular._engine.kernels import FORCED, HUNG, RING, kernel, rare
from granular._engine.records import Record, Records
from granular.edmd.driven import presses, rate_of
from granular.edmd.hanging import swing_together
from granular.edmd.motion import COLLISION_NOISE, carry, total
from granular.edmd.records import BOTH, CEILING, FLOOR, FREE, Walls
from granular.edmd.wall_state import borne, enter
from granular.scene.walls.hits import pressing_bounds
from granular.scene.walls.path import moved


@kernel
def is_stuck(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair move as one."""
    # Beside a driven wall equal velocities are not a proof, so the mark decides.
    if FORCED and (pair.stuck > FREE or pair.wall >= 0):
        return pair.stuck > FREE  # type: ignore[no-any-return]
    return pair.gap == 0.0 and pair.closing_acceleration == 0.0 and upper.fall_velocity == lower.fall_velocity  # type: ignore[no-any-return]


@kernel
def at_rest(body: Record) -> bool:
    """Return whether a ball rests on a wall, directly or on a pile."""
    return body.is_free == 0.0 and body.mass < math.inf  # type: ignore[no-any-return]


@kernel
def is_pressed(body: Record) -> bool:
    """Return whether forces press a ball in mid-air against others."""
    return FORCED and body.is_free > 0.0 and body.force_acceleration != body.own_acceleration


@kernel
def ball_is_stuck(body: Record) -> bool:
    """Return whether a ball rests on a wall or is pressed against others by forces."""
    return (FORCED and is_pressed(body)) or (body.is_free == 0.0 and body.mass < math.inf)


@kernel
def stick(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Make the bodies of pair `c`, which closes at rate `w`, move as one from now on.

    All bodies stuck to them are included. Returns the first and the last pair to predict again, and the momentum
    exchanged by pair `c` in kg m/s.
    """
    run.merged += 1
    if HUNG:
        return swing_together(run, pairs, bodies, c, now, w, walls)
    first, last, exchanged = bind(run, pairs, bodies, c, now, w, walls)
    if not (FORCED and walls.sides[0].lands):  # otherwise `bind` has set their common noise
        share(bodies, c, first, last, w)
    return first, last, exchanged


@rare
@kernel
def bind(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let pair `c`, whose rate is `w`, stick.

    A cluster that touches a wall, or a pile on a wall, takes the velocity of the wall. Other clusters take the common
    velocity of their bodies, which conserves momentum.
    """
    n = len(pairs)
    b, e = cluster(pairs, bodies, c)
    for k in (b - 1, c, e):  # all pairs between are stuck
        k = k % n if RING else min(max(k, 0), n - 1)
        carry(pairs[k], bodies[k], bodies[k + 1], now, walls)
    pairs[c].gap = 0.0
    on_floor, on_ceiling = bodies[c].is_free == 0.0, bodies[c + 1].is_free == 0.0
    # The wall has infinite mass: only the bodies on the other side take part in the impulse.
    if on_floor or on_ceiling:
        mass = total(bodies, c + 1, e) if on_floor else total(bodies, b, c)
        exchanged = -mass * w
        if FORCED and not (on_floor and on_ceiling):
            enter(bodies[c], bodies[c + 1], exchanged, 0.5 * mass * w * w, walls)
        if on_floor:
            stop_bodies(run, pairs, bodies, c, e, now, FLOOR, walls)
        else:
            stop_bodies(run, pairs, bodies, b, c + 1, now, CEILING, walls)
    else:
        exchanged = join_in_flight(bodies, b, c, e, now, w, walls)
    first, last = max(b - 1, 0), min(e, n - 1)
    if RING and (b < 0 or e > n):
        first, last = 0, n - 1
    first, last = press_again(run, pairs, bodies, first, last, walls)
    return first, last, exchanged


@kernel
def cluster(pairs: Records, bodies: Records, c: int) -> tuple[int, int]:
    """Return the lowest and the highest body stuck to a body of pair `c`.

    Pair `c` collides now. The cluster ends before a wall and the pile on it. A pile is held by a collision of its own,
    which can be elastic. On a ring, which has an open gap somewhere, body numbers continue beyond the seam.
    """
    n, b, e = len(pairs), c, c + 1
    while (RING or b > 0) and falls_stuck(pairs, bodies, (b - 1) % n):
        b -= 1
    while (RING or e < n) and falls_stuck(pairs, bodies, e % n):
        e += 1
    return b, e


@kernel
def falls_stuck(pairs: Records, bodies: Records, c: int) -> bool:
    """Return whether the bodies of pair `c` move as one and do not rest on a wall."""
    lower, upper = bodies[c], bodies[c + 1]
    return lower.is_free * upper.is_free > 0.0 and is_stuck(pairs[c], lower, upper)


@rare
@kernel
def stop_bodies(
    run: Record, pairs: Records, bodies: Records, b: int, e: int, now: float, on: int, walls: Walls
) -> None:
    """Let bodies `b` to `e` come to rest.

    The first body (on the floor) or the last body (on the ceiling) is at rest already.
    """
    under = bodies[b] if on == FLOOR else bodies[e]
    for i in range(b, e + 1):
        body = bodies[i]
        if FORCED and body.is_free > 0.0:
            body.force_acceleration = 0.0
            borne(run, body, on - 1, now, under.fall_velocity, -1.0, walls)
        if not FORCED or body.mass < math.inf:
            body.fall_velocity, body.noise = under.fall_velocity, under.noise
        body.is_free = 0.0
    if FORCED:
        for k in range(b, e):
            pairs[k].stuck, pairs[k].gap, pairs[k].at = on, 0.0, now


@kernel
def join_in_flight(bodies: Records, b: int, c: int, e: int, now: float, w: float, walls: Walls) -> float:
    """Give bodies `b` to `e` in mid-air, which stick by pair `c`, a common motion.

    The bodies take their common velocity and acceleration. Returns the momentum exchanged.
    """
    lower, upper = total(bodies, b, c), total(bodies, c + 1, e)
    part = upper / (lower + upper)
    u, exchanged = bodies[c].fall_velocity + part * w, -(lower * part) * w
    if FORCED:
        push = common(bodies, b, e)
        u = (bodies[c].fall_velocity + (bodies[c].force_acceleration - push) * now) + part * w
        enter(bodies[c], bodies[c + 1], exchanged, -0.5 * w * exchanged, walls)
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
def share(bodies: Records, c: int, first: int, last: int, w: float) -> None:
    """Give all bodies that move as one with pair `c` their common noise.

    Pair `c` stuck at rate `w`, and all these bodies belong to pairs `first` to `last`. The mean weighted by mass, like
    the common velocity, is an upper bound, so Σ m noise grows by rounding only. A body that rests on a wall has the
    velocity of the wall and zero noise.
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
    """Return whether pair `c`, which collides weakly at rate `w`, is to move as one.

    A ceiling cannot carry a ball.
    """
    if FORCED and pairs[c].wall >= 0:
        return will_ride(pairs, bodies, c, now, w, e, walls)
    return pairs[c].closing_acceleration >= 0.0  # type: ignore[no-any-return]


@rare
@kernel
def will_ride(pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, walls: Walls) -> bool:
    """Return whether pair `c`, which collides weakly at a driven wall, moves as one.

    A single ball on a driven wall is followed bounce by bounce. A ball that moves as one with others, or that hits a
    ball resting on the wall, stays if it is certainly pressed on the wall. The pressure must last for the duration of
    its bounces, 2u/(a(1 - ε)).
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    other, k = (lower, c + 1) if pair.wall == 0 else (upper, c - 1)
    alone = not (0 <= k < len(pairs) and is_stuck(pairs[k], bodies[k], bodies[k + 1]))
    if (other.mass == math.inf and e > 0.0 and alone) or lower.is_free == upper.is_free:
        return False
    side = walls.sides[pair.wall]
    t, tail = side.epoch, side.low + now
    _, _, a = moved(side, walls.panels, t, tail)
    # The acceleration of the wall adds to that of the ball relative to a wall at rest.
    a += pair.closing_acceleration
    if a <= 0.0:
        return False
    low, _ = pressing_bounds(side, walls.panels, t, tail, pair.closing_acceleration, -4.0 * e * w / (a * (1.0 - e)))
    # Half of the present pressure is the margin: the bounces then end within twice their estimated duration.
    return low >= 0.5 * a  # type: ignore[no-any-return]


@rare
@kernel
def rest(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> tuple[int, int]:
    """Let pair `c`, which never collides again, stick if its bodies are at rest.

    The bodies have to touch, to be at rest and to be pressed together. Without forces and driven walls, the upper body
    of a pulled pair with gap and rate 0 comes to rest on the wall or on the pile on it. Returns the first and the last
    pair to predict again, at least the next pair.
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    if not FORCED:
        top = min(c + 1, len(pairs) - 1)
        if top > c:
            carry(pairs[top], bodies[top], bodies[top + 1], pair.at, walls)
        # Counts the balls whose remaining relative velocity is a rounding error.
        run.settled += upper.fall_velocity - pair.closing_acceleration * pair.at != lower.fall_velocity
        upper.is_free, upper.fall_velocity, upper.noise = 0.0, lower.fall_velocity, lower.noise
        set_closing(run, pairs, bodies, c, top, walls)
        return c + 1, top
    if pair.stuck > FREE or pair.gap != 0.0 or rate_of(pair, lower, upper) != 0.0:
        return c + 1, c
    a = pair.closing_acceleration
    if lower.is_free == upper.is_free == 0.0 or not (presses(pair, walls) if pair.wall >= 0 else a > 0.0):
        return c + 1, c
    w = (upper.fall_velocity - lower.fall_velocity) - a * pair.at
    run.settled += w != 0.0
    first, last, _ = bind(run, pairs, bodies, c, pair.at, w, walls)
    return first, last


@kernel
def press_again(
    run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls
) -> tuple[int, int]:
    """Recompute the closing accelerations of pairs `first` to `last`.

    The range is extended to clusters that forces press against a wall. Returns the first and the last pair of the
    extended range.
    """
    if FORCED and walls.sides[0].forces:
        first = 0 if pairs[0].stuck == FLOOR else first
        last = len(pairs) - 1 if pairs[len(pairs) - 1].stuck == CEILING else last
    set_closing(run, pairs, bodies, first, last, walls)
    return first, last


@kernel
def set_closing(run: Record, pairs: Records, bodies: Records, first: int, last: int, walls: Walls) -> None:
    """Set the closing accelerations of pairs `first` to `last` from their bodies.

    For a stuck pair it is the closing acceleration of all bodies that rest beyond the pair.
    """
    for c in range(first, last + 1):
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        if FORCED:
            pull = pulled(run, pairs, bodies, c, walls)
            if pair.stuck > FREE and pull != pair.closing_acceleration and pair.at < run.now:
                pair.at = run.now
            pair.closing_acceleration = pull
        else:
            pair.closing_acceleration = run.gravity * (upper.is_free - lower.is_free)


@rare
@kernel
def pulled(run: Record, pairs: Records, bodies: Records, c: int, walls: Walls) -> float:
    """Return the closing acceleration of pair `c` under forces.

    Also sets beside which driven walls the pair is.
    """
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    below = lower.is_free == 0.0 and walls.sides[0].panels > 0 and pair.stuck != CEILING
    above = upper.is_free == 0.0 and walls.sides[1].panels > 0 and pair.stuck != FLOOR
    pair.wall = BOTH if below and above else 0 if below else 1 if above else -1
    if pair.stuck == FLOOR:
        # All bodies above that rest on the floor through this pair.
        top = c + 1
        while top < len(pairs) and pairs[top].stuck == FLOOR:
            top += 1
        return run.gravity - common(bodies, c + 1, top)  # type: ignore[no-any-return]
    if pair.stuck == CEILING:
        # All bodies below that rest on the ceiling through this pair.
        low = c
        while low > 0 and pairs[low - 1].stuck == CEILING:
            low -= 1
        return common(bodies, low, c) - run.gravity  # type: ignore[no-any-return]
    return run.gravity * (upper.is_free - lower.is_free) - (upper.force_acceleration - lower.force_acceleration)  # type: ignore[no-any-return]


@rare
@kernel
def common(bodies: Records, b: int, e: int) -> float:
    """Return the common acceleration (m/s²) of bodies `b` to `e` by their forces."""
    # Summing differences keeps equal accelerations exact.
    own, more, mass = bodies[e].own_acceleration, 0.0, 0.0
    for i in range(b, e + 1):
        mass += bodies[i].mass
        more += bodies[i].mass * (bodies[i].own_acceleration - own)
    return own + more / mass  # type: ignore[no-any-return]
