"""Walls that move along a path, and forces on balls: the kernels that take the place of those of `motion`.
May be skipped: rarer, walls that shake.

The state is the same: gaps, and velocities u that change at impacts only. A body falls with ``falls·g - push``, `push`
being the acceleration by the force on it (of those that move as one, their common one). Beside a moving wall the gap
is followed by `granular.walls`; `u` of what is bound to that wall is its velocity at the time `at` of the pair, so that
the rate of the gap is written as that of any other. What is bound, the wall and what rests on it, has ``falls = 0``;
pairs among it are shut.
"""

from __future__ import annotations

import math

import numpy as np

from granular._flight import rate_at_contact
from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.motion import NOISE, REBASED, Walls
from granular.edmd.motion import carry as carry_free
from granular.edmd.motion import predicted as predicted_free
from granular.edmd.motion import touches as touches_free
from granular.walls.gap import after, state
from granular.walls.hits import first_hit, lift_off, opens
from granular.walls.panels import WALL
from granular.walls.path import moved

SIDE = np.dtype(
    [
        *((name, WALL[name]) for name in WALL.names or ()),
        ("epoch", float), ("low", float),  # s, the zero of times of the run
        ("work", float), ("work_low", float), ("lost", float), ("lost_low", float),  # J: done by it; of all, in side 0
        ("temperature", float), ("seed", int),  # J, of a thermal wall; else 0
        ("heat", float), ("heat_low", float), ("given", float), ("given_low", float),  # J and N s, given to balls
        ("lands", int), ("forces", int),  # of the scene: touching pairs come to rest by rounding; forces act
    ],
    align=True,
)
"""What kernels know of the floor and of the ceiling, one record each; no panels: it moves at constant speed."""
OF_PAIR = [("wall", int), ("shut", int), ("wait", float), ("heat", int)]
"""Fields of a pair: beside which driven wall it is (0 floor, 1 ceiling, 2 both, -1 neither); 0 open, 1 or 2 closed for
as long as its bodies rest on the floor or the ceiling; the time (s) from `at` to its next hit; beside which thermal
wall it is."""
OF_BODY = [("push", float), ("own", float)]
"""Fields of a body, m/s²: acceleration by forces, and by its own force if nothing holds it."""
FREE, FLOOR, CEILING = 0, 1, 2
BOTH = 2
"""`wall` of a pair between what rests on a driven floor and on a driven ceiling."""
NEVER = math.inf


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities of the bodies of a pair (m/s) at time `now`; of a driven wall, at that of its pair."""
    fallen = g * now
    below = lower.u - (lower.falls * fallen - lower.push * now)
    return below, upper.u - (upper.falls * fallen - upper.push * now)


@kernel
def rate_of(pair: Record, lower: Record, upper: Record) -> float:
    """Return the rate of a pair at its time (m/s); 0 where the bodies touch and it is but rounding."""
    rate = (upper.u - lower.u) - pair.pull * pair.at
    if pair.gap == 0.0 and rate * rate <= lower.noise + upper.noise:
        return 0.0
    return rate  # type: ignore[no-any-return]


@kernel
def predicted(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair collides, or, if it is shut, opens; inf if it never does.

    That of one at rest on a thermal wall is now, if it is pressed on.
    """
    if pair.heat >= 0 and pair.gap == 0.0 and pair.pull > 0.0 and (upper.u - lower.u) - pair.pull * pair.at <= 0.0:
        return pair.at  # type: ignore[no-any-return]
    if pair.shut > FREE:
        return opening(pair, walls)
    if pair.wall == BOTH:
        return NEVER  # they meet when there is no room left: then the run is over
    if pair.wall < 0:
        if walls[0][0].lands and pair.pull != 0.0 and pair.gap == 0.0 and rate_of(pair, lower, upper) == 0.0:
            return NEVER
        return predicted_free(pair, lower, upper, walls)
    return hit(pair, lower, upper, walls)


@rare
@kernel
def hit(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair beside a driven wall collides, inf if it never does."""
    side, rate = walls[0][pair.wall], rate_of(pair, lower, upper)
    pair.wait = first_hit(side, walls[1], side.epoch, side.low + pair.at, pair.gap, rate, pair.pull, NEVER)
    return pair.at + pair.wait  # type: ignore[no-any-return]


@rare
@kernel
def opening(pair: Record, walls: Walls) -> float:
    """Return the time at which a shut pair opens: nothing presses it any more, or the velocity of its wall jumps."""
    if pair.wall < 0:
        return pair.at if pair.pull < 0.0 else NEVER
    side = walls[0][pair.wall]
    wait, rate = lift_off(side, walls[1], side.epoch, side.low + pair.at, pair.pull, NEVER)
    time = pair.at + wait
    if rate != 0.0:
        time += 2.0**-50 * (abs(side.epoch) + abs(time))  # after the jump for certain
    return time  # type: ignore[no-any-return]


@kernel
def meets(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate, not positive, at which a pair is about to collide."""
    if pair.wall < 0:
        return rate_at_contact(pair.gap, (upper.u - lower.u) - pair.pull * pair.at, pair.pull)
    return meets_wall(pair, lower, upper, walls)


@rare
@kernel
def meets_wall(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate, not positive, at which a pair beside a driven wall is about to collide."""
    side, rate = walls[0][pair.wall], rate_of(pair, lower, upper)
    t, tail = side.epoch, side.low + pair.at
    _, w = after(side, walls[1], t, tail, pair.gap, rate, pair.pull, pair.wait)
    if w >= 0.0 and pair.wait > 0.0:  # at a jump of the wall's velocity
        _, w = after(side, walls[1], t, tail, pair.gap, rate, pair.pull, pair.wait + 2.0**-50 * (abs(t) + abs(tail)))
    if w >= 0.0 and pair.gap == 0.0:
        w = -rate  # a bounce too low for the time of the next one
    return min(w, 0.0)


@rare
@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`, without tolerance; beside a thermal wall none do."""
    if pair.heat >= 0:
        return False
    if pair.shut > FREE:
        return True
    if pair.wall == BOTH:
        return apart(pair, walls, now)[0] <= 0.0
    if pair.wall < 0:
        return touches_free(pair, lower, upper, now, walls)
    side, rate = walls[0][pair.wall], rate_of(pair, lower, upper)
    t, tail = side.epoch, side.low + pair.at
    return after(side, walls[1], t, tail, pair.gap, rate, pair.pull, now - pair.at)[0] <= 0.0


@kernel
def carry(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Move a pair to time `now`: its gap, and the velocity of a driven wall; return 1 if the gap was clamped at 0.

    One that is shut opens when it does, looked at from when it closed: a jump of the wall's velocity just now counts.
    """
    if pair.shut > FREE:
        return 0
    if pair.wall < 0:
        return carry_free(pair, lower, upper, now, walls)
    return carry_beside(pair, lower, upper, now, walls)


@rare
@kernel
def carry_beside(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Move a pair beside a driven wall to time `now`; return 1 if the gap was clamped at 0."""
    if pair.wall == BOTH:
        d, _ = apart(pair, walls, now)
    else:
        side, rate = walls[0][pair.wall], rate_of(pair, lower, upper)
        t, tail = side.epoch, side.low + pair.at
        d, _ = after(side, walls[1], t, tail, pair.gap, rate, pair.pull, now - pair.at)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    follow(pair, lower, upper, walls)
    return 1 if d < 0.0 else 0


@rare
@kernel
def follow(pair: Record, lower: Record, upper: Record, walls: Walls) -> None:
    """Give what is bound to a driven wall, of a pair beside it, the velocity of the wall at the time of the pair."""
    if pair.wall == 0 or pair.wall == BOTH:
        lower.u = place(walls, 0, pair.at)[1]
    if pair.wall == 1 or pair.wall == BOTH:
        upper.u = place(walls, 1, pair.at)[1]


@rare
@kernel
def place(walls: Walls, which: int, now: float) -> tuple[float, float]:
    """Return how far a wall has moved since the start (m), and its velocity (m/s)."""
    side = walls[0][which]
    x, v = side.velocity * ((side.epoch - side.begin) + (side.low + now)), side.velocity
    if side.panels > 0:
        m, dm, _ = moved(side, walls[1], side.epoch, side.low + now)
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
    side = walls[0][pair.wall]
    now = state(side, walls[1], side.epoch, side.low + pair.at, 0.0, 0.0, pair.pull)
    return opens(side, walls[1][now[2]], now, 0.0, 0.0) == 0.0


@rare
@kernel
def rate_at(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> float:
    """Return the rate of a pair (m/s) at time `now`."""
    if pair.shut > FREE:
        return 0.0
    if pair.wall < 0:
        return (upper.u - lower.u) - pair.pull * now  # type: ignore[no-any-return]
    if pair.wall == BOTH:
        return apart(pair, walls, now)[1]
    side, rate = walls[0][pair.wall], rate_of(pair, lower, upper)
    t, tail = side.epoch, side.low + pair.at
    return after(side, walls[1], t, tail, pair.gap, rate, pair.pull, now - pair.at)[1]


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> None:
    """Move all gaps to time `shift`, the new zero of time."""
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += carry(pair, bodies[c], bodies[c + 1], shift, walls)
        pair.at = pair.at - shift if pair.shut > FREE else 0.0
        pair.last -= shift
    for i in range(len(bodies)):
        body = bodies[i]
        fallen = body.falls * (run.gravity * shift) - body.push * shift
        body.u -= fallen
        if fallen != 0.0:
            body.noise += REBASED * (body.u * body.u)


@kernel
def synchronise(pairs: Records, bodies: Records, walls: Walls) -> None:
    """Give the driven walls their velocities, for another zero of times."""
    for c in range(len(pairs)):
        follow(pairs[c], bodies[c], bodies[c + 1], walls)


def rounding(speed: float) -> float:
    """Return the noise (m²/s²) of velocities of that size."""
    return NOISE * speed * speed
