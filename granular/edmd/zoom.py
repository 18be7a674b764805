"""Motion of a few neighbouring pairs in relative coordinates, down to 1e-200.

Velocities lose relative velocities below 1e-16 of their size; rates of gaps do not. A suspected inelastic collapse is
therefore decided in gaps and rates. `zoom` advances a slice of pairs alone until an event outside the slice is due,
without any approximation. Pair j of the slice and the bodies j and j + 1 have their records in `pairs` and `bodies`,
which are slices too. The gap and the rate of the pair are in `near`.
"""

from __future__ import annotations

import math

from granular._engine.flight import gap_after, rate_at_contact, time_to_contact
from granular._engine.kernels import FORCED, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.clusters import ball_is_stuck
from granular.edmd.motion import across, impulse, total, velocities
from granular.edmd.physics import GROUP, Restitution, rank
from granular.edmd.records import APART, BUDGET, CEILING, FLOOR, LATER, OUTSIDE, QUIET, RESTS, SPENT, TINY, UNTIL, Walls
from granular.edmd.wall_state import book, enter

NO_OBSTACLE = -1


@kernel
def zoom(
    run: Record, near: Records, pairs: Records, bodies: Records, rule: Restitution | None, rows: Records | None,
    walls: Walls,
) -> int:
    """Advance the slice and return the reason of its end."""
    done = 0
    while True:
        j, dt = soonest(run, near, pairs)
        why = obstacle(run, near, pairs, bodies, j, dt, walls)
        if why != NO_OBSTACLE or done == run.budget:
            return BUDGET if why == NO_OBSTACLE else why
        own, pair, lower, upper = near[j], pairs[j], bodies[j], bodies[j + 1]
        w = rate_at_contact(own.gap, own.rate, pair.closing_acceleration)
        e = pair.eps if rule is None else rule(number(run, j), -w)
        if e == 0.0:
            return QUIET  # the bodies stick, which also moves all bodies stuck to them
        advance(run, near, pairs, dt)
        run.suspect = number(run, j)
        tau = run.began + run.elapsed
        if rows is not None:
            row = rows[done]
            row.pair, row.t_begin = run.suspect, tau
            row.lower_in, row.upper_in = velocities(lower, upper, run.gravity, tau)
        bounce(near, pairs, bodies, j, w, e)
        if FORCED:
            book(lower, upper, w, e, walls)
        if rows is not None:
            row.lower_out, row.upper_out = velocities(lower, upper, run.gravity, tau)
            row.impulse = impulse(lower, upper, (1.0 + e) * w)
        done += 1
        run.events += 1
        run.zoomed += 1
        run.looked += 1
        wait = rest_time(near, pairs, j, e) if rule is None else math.inf
        if run.began + (run.elapsed + wait) == tau:  # the wait is below the resolution of the clock
            if FORCED:
                # Impulse of all remaining bounces, including the weight of the ball.
                left = impulse(lower, upper, own.rate - pair.closing_acceleration * wait)
                enter(lower, upper, left, 0.5 * min(lower.mass, upper.mass) * own.rate * own.rate, walls)
            settle(near, pairs, bodies, j)
            return RESTS
        why = end_after_bounce(run, near, pairs, j, w, e, dt)
        if why != NO_OBSTACLE:
            return why


@kernel
def end_after_bounce(run: Record, near: Records, pairs: Records, j: int, w: float, e: float, dt: float) -> int:
    """Return how the rescaled run ends after pair `j` bounced at rate `w`, or GOES_ON.

    `dt` is the time since the last bounce.
    """
    if (near[j].rate == 0.0 and pairs[j].closing_acceleration > 0.0) or (run.stop_pair == APART and recede(near)):
        return QUIET  # the ball rests, or all pairs recede and the run may stop
    # run.slow is 2^-16 of the speed scale, so the limit is 2^-200 of the scale.
    if e < 1.0 and -w < math.ldexp(run.slow, -184):
        return TINY
    run.ordinary = run.ordinary + 1 if -w >= run.slow and dt >= run.short else 0
    # Four ordinary collisions per pair in a row: not a collapse.
    return QUIET if run.ordinary >= 4 * len(near) else NO_OBSTACLE


@kernel
def recede(near: Records) -> bool:
    """Return whether no pair of the slice closes."""
    for j in range(len(near)):
        if near[j].rate < 0.0:
            return False
    return True


@kernel
def obstacle(run: Record, near: Records, pairs: Records, bodies: Records, j: int, dt: float, walls: Walls) -> int:
    """Return why the slice cannot be advanced to the collision of pair `j` after `dt`.

    Returns `NO_OBSTACLE` if it can. A thermal wall is outside the slice, because its hits are not collisions. Balls
    that move as one with others are outside too.
    """
    if dt == math.inf:
        return QUIET
    n, c = len(near), number(run, j)
    guard = guards(run, n, j)
    if FORCED and (pairs[j].heat >= 0 or ball_is_stuck(bodies[j]) or ball_is_stuck(bodies[j + 1])):
        guard = True
    together = run.order == GROUP and crowded(near, pairs, j, dt)
    if guard or together or not run.elapsed + dt < run.room:
        return OUTSIDE
    if run.looked >= run.allowance:
        return SPENT
    if run.began + (run.elapsed + dt) > run.edge:
        return LATER
    if c == run.stop_pair and pairs[j].contacts >= run.stop_contacts:
        return UNTIL  # the slice stays before the wait `dt`
    return NO_OBSTACLE


@kernel
def soonest(run: Record, near: Records, pairs: Records) -> tuple[int, float]:
    """Return the pair of the slice that collides first, and its waiting time.

    The rank decides between simultaneous collisions. The result is (0, inf) if no pair collides.
    """
    best, when = 0, math.inf
    for j in range(len(near)):
        own, pair = near[j], pairs[j]
        if own.rate >= 0.0 and pair.closing_acceleration <= 0.0:
            continue
        dt = time_to_contact(own.gap, own.rate, pair.closing_acceleration)
        if dt < when or (dt == when < math.inf and order(run, pairs, j) < order(run, pairs, best)):
            best, when = j, dt
    return best, when


@kernel
def number(run: Record, j: int) -> int:
    """Return the number of pair `j` of the slice, on a ring modulo `run.pairs`."""
    c: int = run.first + j
    return c - run.pairs if RING and c >= run.pairs else c


@kernel
def guards(run: Record, n: int, j: int) -> bool:
    """Return whether pair `j` of a slice of `n` pairs has a neighbour outside."""
    c = run.first + j
    if RING:
        return n < run.pairs and (j == 0 or j == n - 1)
    return (j == 0 and c > 0) or (j == n - 1 and c + 1 < run.pairs)


@kernel
def order(run: Record, pairs: Records, j: int) -> int:
    """Return the rank of pair `j` of the slice."""
    return rank(number(run, j), run.order, run.seed, pairs[j].contacts)


@kernel
def crowded(near: Records, pairs: Records, j: int, dt: float) -> bool:
    """Return whether a neighbour of pair `j` touches after `dt`."""
    for k in range(max(j - 1, 0), min(j + 2, len(near))):
        if k != j and gap_after(near[k].gap, near[k].rate, pairs[k].closing_acceleration, dt) <= 0.0:
            return True
    end = len(near) - 1
    if RING and (j == 0 or j == end):
        return gap_after(near[end - j].gap, near[end - j].rate, 0.0, dt) <= 0.0
    return False


@kernel
def advance(run: Record, near: Records, pairs: Records, dt: float) -> None:
    """Advance all gaps and rates by `dt`, and count the gaps clamped at 0."""
    for j in range(len(near)):
        own, a = near[j], pairs[j].closing_acceleration
        gap = gap_after(own.gap, own.rate, a, dt)
        run.clamped += gap < 0.0
        # Rounding can make a closing gap negative.
        own.gap = gap if gap > 0.0 else 0.0
        own.rate -= a * dt
    run.elapsed += dt


@kernel
def bounce(near: Records, pairs: Records, bodies: Records, j: int, w: float, e: float) -> None:
    """Let pair `j` of the slice collide at rate `w`; its rate becomes exactly -ε w.

    If the slice is the whole ring, its first and last pair are neighbours.
    """
    pair, jump = pairs[j], (1.0 + e) * w
    near[j].gap = 0.0
    near[j].rate = -e * w
    if j > 0:
        near[j - 1].rate += pair.low * jump
    if j + 1 < len(near):
        near[j + 1].rate += pair.high * jump
    bodies[j].fall_velocity += pair.low * jump
    bodies[j + 1].fall_velocity -= pair.high * jump
    pair.contacts += 1
    end = len(near) - 1
    if RING and j == 0:
        near[end].rate += pair.low * jump
    elif RING and j == end:
        near[0].rate += pair.high * jump
    if RING:
        across(bodies, j)


@kernel
def rest_time(near: Records, pairs: Records, j: int, e: float) -> float:
    """Return the time in s until the ball of pair `j` rests on its wall, or inf.

    The ball has just bounced on the wall. Alone, it bounces infinitely often within 2u/(a(1 - ε)). It stays alone if no
    other pair of the slice collides before, and if its neighbour stays beyond the top of the first arc. The neighbour
    does so if it does so at both ends of the time, because it moves uniformly or is accelerated towards the wall. The
    result is inf if this is not certain.
    """
    a, r, k = pairs[j].closing_acceleration, near[j].rate, beyond(pairs, j)
    if not (a > 0.0 and pairs[j].low * pairs[j].high == 0.0 and e < 1.0):
        return math.inf
    end: float = 2.0 * r / (a * (1.0 - e))
    for i in range(len(near)):
        if i != j and i != k and time_to_contact(near[i].gap, near[i].rate, pairs[i].closing_acceleration) <= end:
            return math.inf
    if 0 <= k < len(near):
        other, arc = near[k], r * r / (2.0 * a)
        path = gap_after(other.gap, other.rate + r, pairs[k].closing_acceleration + a, end)
        # The neighbour must stay above the height of the first arc.
        if other.gap <= arc or path <= arc:
            return math.inf
    return end


@kernel
def beyond(pairs: Records, j: int) -> int:
    """Return the number of the pair on the other side of the ball of pair `j`.

    Pair `j` is beside a wall.
    """
    return j + 1 if pairs[j].low == 0.0 else j - 1


@kernel
def settle(near: Records, pairs: Records, bodies: Records, j: int) -> None:
    """Bring the ball of pair `j`, which has just bounced on its wall, to rest.

    The path of its neighbour, measured from the wall, does not depend on the bounces.
    """
    k, on_floor = beyond(pairs, j), pairs[j].low == 0.0
    i = j + 1 if on_floor else j
    ball, wall = bodies[i], bodies[2 * j + 1 - i]
    if 0 <= k < len(near):
        near[k].rate += near[j].rate
        pairs[k].closing_acceleration += pairs[j].closing_acceleration
    near[j].gap = near[j].rate = pairs[j].closing_acceleration = ball.is_free = 0.0
    ball.fall_velocity = wall.fall_velocity
    if FORCED:
        ball.force_acceleration, pairs[j].stuck = 0.0, FLOOR if on_floor else CEILING


@kernel
def write_back(run: Record, near: Records, pairs: Records, bodies: Records) -> None:
    """Write the slice back: its gaps, and velocities as sums of rates.

    The sums start at an end body of the slice with a known velocity: a wall, or a body that also belongs to pairs
    outside, which has not collided. Without such a body they start from the velocity of the centre of mass. The rates
    are exact, so velocities have only their own rounding error as noise.
    """
    n, tau = len(near), run.began + run.elapsed
    for j in range(n):
        pairs[j].streak = 0
    if run.looked == 0:
        return
    from_below = n < run.pairs if RING else run.first > 0 or bodies[0].mass == math.inf
    free = not from_below and (RING or (run.first + n == run.pairs and bodies[n].mass != math.inf))
    top = n - 1 if free and RING else n  # the last body of a ring is the first
    before = momentum(bodies, top) if free else 0.0
    for j in range(n):
        pair = pairs[j]
        pair.gap, pair.at = near[j].gap, tau
        if from_below and bodies[j + 1].mass != math.inf:
            bodies[j + 1].fall_velocity = bodies[j].fall_velocity + (near[j].rate + pair.closing_acceleration * tau)
            bodies[j + 1].noise = 0.0
    if not from_below:
        for j in range(n - 1, -1, -1):
            bodies[j].fall_velocity = bodies[j + 1].fall_velocity - (near[j].rate + pairs[j].closing_acceleration * tau)
            bodies[j].noise = 0.0
    if free:
        # Conserves the momentum of the slice.
        shift = (before - momentum(bodies, top)) / total(bodies, 0, top)
        for i in range(top + 1):
            bodies[i].fall_velocity += shift
    if top < n:
        bodies[n].fall_velocity, bodies[n].noise = bodies[0].fall_velocity, bodies[0].noise


@kernel
def momentum(bodies: Records, top: int) -> float:
    """Return Σ m u (kg m/s) of the bodies of the slice up to `top`."""
    p = 0.0
    for i in range(top + 1):
        p += bodies[i].mass * bodies[i].fall_velocity
    return p
