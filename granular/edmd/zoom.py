"""Motion of a few neighbouring pairs in relative coordinates, down to 1e-200.

A difference of two velocities has no digits if it is below 1e-16 of the velocities. The rates of gaps keep their
digits. A suspected inelastic collapse is therefore decided in gaps and rates. `advance_relative` advances a slice of
consecutive pairs alone until an event outside the slice is due, without any approximation. The terms are defined in
`granular.edmd.motion`.

Pair j of the slice and its bodies j and j + 1 have their records in `pairs` and `bodies`, which are parts of the
records of the state. The current gap and rate of the pair are in `near`.
"""

from __future__ import annotations

import math

from granular._engine.flight import gap_after, rate_at_contact, time_to_contact
from granular._engine.kernels import FORCED, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.clusters import ball_is_stuck
from granular.edmd.motion import copy_seam_ball, impulse, total_mass, velocities
from granular.edmd.physics import GROUP, Restitution, rank
from granular.edmd.records import APART, BUDGET, CEILING, FLOOR, LATER, OUTSIDE, QUIET, RESTS, SPENT, TINY, UNTIL, Walls
from granular.edmd.wall_state import account_collision, account_impulse

NO_OBSTACLE = -1


@kernel
def advance_relative(
    run: Record, near: Records, pairs: Records, bodies: Records, rule: Restitution | None, rows: Records | None,
    walls: Walls,
) -> int:
    """Advance the slice collision by collision, and return the reason of the pause.

    `rule` returns ε, or is None for constant rules. If `rows` is not None, it receives the contact log. The reasons are
    explained at `LATER` in `granular.edmd.records`.
    """
    done = 0
    while True:
        j, dt = next_collision(run, near, pairs)
        reason = obstacle(run, near, pairs, bodies, j, dt, walls)
        if reason != NO_OBSTACLE or done == run.budget:
            return BUDGET if reason == NO_OBSTACLE else reason
        own, pair, lower, upper = near[j], pairs[j], bodies[j], bodies[j + 1]
        w = rate_at_contact(own.gap, own.rate, pair.closing_acceleration)
        e = pair.eps if rule is None else rule(pair_number(run, j), -w)
        if e == 0.0:
            return QUIET  # the bodies stick, which also moves all bodies stuck to them
        advance_gaps(run, near, pairs, dt)
        run.suspect = pair_number(run, j)
        tau = run.began + run.elapsed
        if rows is not None:
            row = rows[done]
            row.pair, row.t_begin = run.suspect, tau
            row.lower_in, row.upper_in = velocities(lower, upper, run.gravity, tau)
        collide_in_slice(near, pairs, bodies, j, w, e)
        if FORCED:
            account_collision(lower, upper, w, e, walls)
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
                remaining_impulse = impulse(lower, upper, own.rate - pair.closing_acceleration * wait)
                energy = 0.5 * min(lower.mass, upper.mass) * own.rate * own.rate
                account_impulse(lower, upper, remaining_impulse, energy, walls)
            settle_on_wall(near, pairs, bodies, j)
            return RESTS
        reason = end_after_bounce(run, near, pairs, j, w, e, dt)
        if reason != NO_OBSTACLE:
            return reason


@kernel
def end_after_bounce(run: Record, near: Records, pairs: Records, j: int, w: float, e: float, dt: float) -> int:
    """Return why relative coordinates end after a collision, or `NO_OBSTACLE`.

    Pair `j` of the slice has collided at the rate `w` ≤ 0 (m/s) with ε = `e`. `dt` is the time in s since the collision
    before.
    """
    if (near[j].rate == 0.0 and pairs[j].closing_acceleration > 0.0) or (run.stop_pair == APART and all_recede(near)):
        return QUIET  # the ball rests, or all pairs recede and the run can stop
    # run.slow is 2^-16 of the speed scale, so the limit is 2^-200 of the scale.
    if e < 1.0 and -w < math.ldexp(run.slow, -184):
        return TINY
    run.ordinary = run.ordinary + 1 if -w >= run.slow and dt >= run.short else 0
    # Four ordinary collisions per pair in a row: not a collapse.
    return QUIET if run.ordinary >= 4 * len(near) else NO_OBSTACLE


@kernel
def all_recede(near: Records) -> bool:
    """Return whether no pair of the slice approaches."""
    for j in range(len(near)):
        if near[j].rate < 0.0:
            return False
    return True


@kernel
def obstacle(run: Record, near: Records, pairs: Records, bodies: Records, j: int, dt: float, walls: Walls) -> int:
    """Return why the slice cannot be advanced to the next collision, or `NO_OBSTACLE`.

    Pair `j` of the slice would collide next, after `dt` s. Hits on a thermal wall are outside the slice, and so are
    collisions of balls that move as one with others.
    """
    if dt == math.inf:
        return QUIET
    n, c = len(near), pair_number(run, j)
    is_outside = has_outer_neighbour(run, n, j)
    if FORCED and (pairs[j].heat >= 0 or ball_is_stuck(bodies[j]) or ball_is_stuck(bodies[j + 1])):
        is_outside = True
    is_group = run.order == GROUP and neighbour_touches(near, pairs, j, dt)
    if is_outside or is_group or not run.elapsed + dt < run.room:
        return OUTSIDE
    if run.looked >= run.allowance:
        return SPENT
    if run.began + (run.elapsed + dt) > run.edge:
        return LATER
    if c == run.stop_pair and pairs[j].contacts >= run.stop_contacts:
        return UNTIL  # the slice stays before the wait `dt`
    return NO_OBSTACLE


@kernel
def next_collision(run: Record, near: Records, pairs: Records) -> tuple[int, float]:
    """Return the pair of the slice that collides first, and the time until then in s.

    The rank decides between simultaneous collisions. The result is (0, inf) if no pair collides.
    """
    best, earliest = 0, math.inf
    for j in range(len(near)):
        own, pair = near[j], pairs[j]
        if own.rate >= 0.0 and pair.closing_acceleration <= 0.0:
            continue
        dt = time_to_contact(own.gap, own.rate, pair.closing_acceleration)
        if dt < earliest or (dt == earliest < math.inf and slice_rank(run, pairs, j) < slice_rank(run, pairs, best)):
            best, earliest = j, dt
    return best, earliest


@kernel
def pair_number(run: Record, j: int) -> int:
    """Return the number of pair `j` of the slice in the whole scene.

    On a ring it is counted modulo `run.pairs`.
    """
    c: int = run.first + j
    return c - run.pairs if RING and c >= run.pairs else c


@kernel
def has_outer_neighbour(run: Record, n: int, j: int) -> bool:
    """Return whether pair `j` of a slice of `n` pairs has a neighbour outside."""
    c = run.first + j
    if RING:
        return n < run.pairs and (j == 0 or j == n - 1)
    return (j == 0 and c > 0) or (j == n - 1 and c + 1 < run.pairs)


@kernel
def slice_rank(run: Record, pairs: Records, j: int) -> int:
    """Return the rank of pair `j` of the slice, see `physics.rank`."""
    return rank(pair_number(run, j), run.order, run.seed, pairs[j].contacts)


@kernel
def neighbour_touches(near: Records, pairs: Records, j: int, dt: float) -> bool:
    """Return whether a neighbour of pair `j` of the slice touches after `dt` s."""
    for k in range(max(j - 1, 0), min(j + 2, len(near))):
        if k != j and gap_after(near[k].gap, near[k].rate, pairs[k].closing_acceleration, dt) <= 0.0:
            return True
    end = len(near) - 1
    if RING and (j == 0 or j == end):
        return gap_after(near[end - j].gap, near[end - j].rate, 0.0, dt) <= 0.0
    return False


@kernel
def advance_gaps(run: Record, near: Records, pairs: Records, dt: float) -> None:
    """Advance all gaps and rates of the slice by `dt` s in free flight.

    Gaps that become negative by rounding are set to 0 and counted in `run.clamped`.
    """
    for j in range(len(near)):
        own, a = near[j], pairs[j].closing_acceleration
        gap = gap_after(own.gap, own.rate, a, dt)
        run.clamped += gap < 0.0
        # Rounding can make a closing gap negative.
        own.gap = gap if gap > 0.0 else 0.0
        own.rate -= a * dt
    run.elapsed += dt


@kernel
def collide_in_slice(near: Records, pairs: Records, bodies: Records, j: int, w: float, e: float) -> None:
    """Apply a collision to pair `j` of the slice: its rate changes from `w` to -ε·`w`.

    `w` ≤ 0 is in m/s, and `e` is ε. The rates of both neighbouring pairs and the velocities of both bodies are
    updated. If the slice is the whole ring, its first and last pair are neighbours.
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
        copy_seam_ball(bodies, j)


@kernel
def rest_time(near: Records, pairs: Records, j: int, e: float) -> float:
    """Return the time in s until the ball of pair `j` rests on its wall, or inf.

    The ball has just bounced on the wall, and `e` is ε. Without other collisions it bounces infinitely often within
    the time 2u/(a(1 - ε)), where u is its rate and a its closing acceleration. There are no other collisions if no
    other pair of the slice collides before, and if the next ball stays beyond the top of the first arc. It is
    sufficient to test the next ball at both ends of the time, because it moves uniformly or is accelerated towards the
    wall. The result is inf if other collisions are possible.
    """
    a, r, k = pairs[j].closing_acceleration, near[j].rate, next_pair(pairs, j)
    if not (a > 0.0 and pairs[j].low * pairs[j].high == 0.0 and e < 1.0):
        return math.inf
    end: float = 2.0 * r / (a * (1.0 - e))
    for i in range(len(near)):
        if i != j and i != k and time_to_contact(near[i].gap, near[i].rate, pairs[i].closing_acceleration) <= end:
            return math.inf
    if 0 <= k < len(near):
        neighbour, arc = near[k], r * r / (2.0 * a)
        final_gap = gap_after(neighbour.gap, neighbour.rate + r, pairs[k].closing_acceleration + a, end)
        # The neighbour must stay above the height of the first arc.
        if neighbour.gap <= arc or final_gap <= arc:
            return math.inf
    return end


@kernel
def next_pair(pairs: Records, j: int) -> int:
    """Return the pair of the slice on the other side of the ball of pair `j`.

    One of the bodies of pair `j` is a wall. The result is out of range if the ball has no other neighbour in the slice.
    """
    return j + 1 if pairs[j].low == 0.0 else j - 1


@kernel
def settle_on_wall(near: Records, pairs: Records, bodies: Records, j: int) -> None:
    """Bring the ball of pair `j`, which has just bounced on its wall, to rest.

    From now on, gap and rate of the next pair describe its other ball relative to the wall. The bounces that are
    left out do not affect this motion.
    """
    k, on_floor = next_pair(pairs, j), pairs[j].low == 0.0
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
    """Write gaps and velocities of the slice into the records `pairs` and `bodies`.

    Velocities are sums of rates. A sum starts at an end body of the slice with a known velocity. Such a body is a
    wall, or a body that also belongs to a pair outside, because it has not collided. Without such a body, the sum
    starts from the velocity of the centre of mass. Rates are exact, so the noise of a velocity is only its own
    rounding error.
    """
    n, tau = len(near), run.began + run.elapsed
    for j in range(n):
        pairs[j].streak = 0
    if run.looked == 0:
        return
    from_below = n < run.pairs if RING else run.first > 0 or bodies[0].mass == math.inf
    has_free_ends = not from_below and (RING or (run.first + n == run.pairs and bodies[n].mass != math.inf))
    top = n - 1 if has_free_ends and RING else n  # the last body of a ring is the first
    before = momentum(bodies, top) if has_free_ends else 0.0
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
    if has_free_ends:
        # Conserves the momentum of the slice.
        shift = (before - momentum(bodies, top)) / total_mass(bodies, 0, top)
        for i in range(top + 1):
            bodies[i].fall_velocity += shift
    if top < n:
        bodies[n].fall_velocity, bodies[n].noise = bodies[0].fall_velocity, bodies[0].noise


@kernel
def momentum(bodies: Records, top: int) -> float:
    """Return Σ m u (kg m/s) of the bodies 0 to `top` of the slice."""
    p = 0.0
    for i in range(top + 1):
        p += bodies[i].mass * bodies[i].fall_velocity
    return p
