"""A collision in a scene with forces, driven or thermal walls: the event in place of that of `collision`.
May be skipped: rarer, walls that shake.

A ball that hits a thermal wall leaves with a speed drawn anew. What is drawn hangs on how often this pair has hit
before, so every queue, and a run that goes on, draws the same. It is never part of a touching group or of a closer
look, and never merges: a ball that stands on such a wall, pressed on it, is hit at once.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.clusters import absorb, held, is_closed, wake
from granular.edmd.collision import remedied, share, streak
from granular.edmd.driven import carry, meets, velocities
from granular.edmd.motion import NOISE, Walls, add, blur, collide, impulse
from granular.edmd.physics import Restitution
from granular.edmd.wall_state import book, enter
from granular.walls.hits import pressing
from granular.walls.path import moved
from granular.walls.thermal import drawn


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after."""
    if pairs[c].heat >= 0:
        return heated(run, pairs, bodies, c, now, row, walls)
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
def heated(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, row: Record | None, walls: Walls
) -> tuple[int, int, float]:
    """Let the ball of pair `c` leave the thermal wall it hits at time `now`; return what `event` does.

    With w the rate before and s the speed drawn, the wall gives the impulse m(s - w), the work of that at its own
    velocity, and the heat ½m(s² - w²).
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    side, w = walls[0][pair.heat], meets(pair, lower, upper, walls)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    pair.gap, pair.at = 0.0, now
    start, end = wake(run, pairs, bodies, c, now, walls)
    ball = upper if pair.heat == 0 else lower
    s = drawn(side.temperature, side.seed, pair.heat, pair.hits, ball.mass)
    if pair.heat == 0:
        upper.u = lower.u + (pair.pull * now + s)
    else:
        lower.u = upper.u - (pair.pull * now + s)
    ball.noise = NOISE * (ball.u * ball.u + s * s)
    given = impulse(lower, upper, w - s)
    enter(lower, upper, given, 0.0, walls)
    side.heat, side.heat_low = add(side.heat, side.heat_low, 0.5 * (s + w) * given)
    side.given, side.given_low = add(side.given, side.given_low, given)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = given
    pair.hits += 1
    pair.last = now
    return start, end, s
