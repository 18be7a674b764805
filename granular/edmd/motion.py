"""Motion of one pair: prediction of its next collision, free flight and collision.

Both event queues evaluate these functions, so their results are bitwise identical.

The record of a pair contains its `gap` (m, never negative) at the time `at`. All times are in s since the epoch. The
record of a body contains its `fall_velocity` u (m/s), which changes only in collisions. If a body `is_free`, its
velocity at the time tau is ``u - g·tau``. A gap has the `closing_acceleration` a = g above a floor, 0 between two balls
and -g below a ceiling. The rate of a gap in m/s is negative while the bodies approach.

A collision rounds the velocities. The field `noise` of a body (m²/s²) is an upper bound of the squared rounding error
of u. A collision propagates the noise like the velocities, and adds the noise of its own rounding. If the approach
speed of two balls is below their noise, the sign of their relative velocity is uncertain, and they do not collide.
Initial velocities are exact.

The docstrings of this package use these terms:

* *rate*: the rate of change of the gap of a pair in m/s. It is negative while the two bodies approach.
* *closing acceleration*: minus the second time derivative of a gap in m/s². It is positive if it closes the gap.
* *epoch*, *tau*: the records of a run store times in s since the epoch. Such a time is called tau. The epoch is moved
  forward from window to window, so late times keep their digits.
* *window*: the length of time in s after which the epoch is moved. It is a power of two.
* *fall velocity*: the velocity in m/s that a body in free flight has at the epoch.
* *noise*: an upper bound of the squared rounding error of a fall velocity, in m²/s².
* *stuck*: the bodies of a stuck pair touch and move with the same velocity.
* *relative coordinates*: the gaps and rates of neighbouring pairs (the *slice*) replace the velocities of their bodies
  while `zoom` examines a possible inelastic collapse.

The branches `if FORCED`, `if HUNG` and `if RING` are for driven walls and forces (`driven`), pendula (`hanging`) and
rings, see `granular._engine.kernels`. They can be skipped on a first reading. A ring of n balls is stored as a line of
n pairs and n + 1 bodies, where the last body is a copy of the first. After every change of the first or the last body
the other body is updated. The neighbours of a pair are counted modulo n. Velocities on a ring are relative to the
centre of mass.
"""

from __future__ import annotations

import math

from granular._engine.flight import (
    gap_after,
    hung_after,
    hung_rate_at_contact,
    hung_time_to_contact,
    rate_at_contact,
    time_to_contact,
)
from granular._engine.kernels import FORCED, HUNG, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.driven import gap_at_wall, next_wall_hit, opening, rate_at_wall, rate_of, take_wall_velocity
from granular.edmd.records import FREE, Walls

COLLISION_NOISE = 2.0**-96
"""Noise added by one collision, in units of the squared velocity of the body.

It corresponds to 16 units in the last place of a velocity. The actual rounding error is less than 3 units.
"""
CLOCK_ROUNDING = 2.0**-52
"""Relative rounding error of a time."""


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities (m/s) of the two bodies of a pair at time `now`.

    `g` is the gravity in m/s². A driven wall has the velocity that it had at the time `at` of its pair.
    """
    if HUNG:
        c, s = math.cos(lower.omega * now), math.sin(lower.omega * now)
        return lower.fall_velocity * c - lower.sway * s, upper.fall_velocity * c - upper.sway * s
    fallen = g * now
    if FORCED:
        below = lower.fall_velocity - (lower.is_free * fallen - lower.force_acceleration * now)
        return below, upper.fall_velocity - (upper.is_free * fallen - upper.force_acceleration * now)
    return lower.fall_velocity - lower.is_free * fallen, upper.fall_velocity - upper.is_free * fallen


@kernel
def next_event_time(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time of the next event of a pair, or inf if it has no event.

    The event is the next collision, under the assumption that no event of another pair acts earlier. With forces or
    driven walls, a stuck pair can only separate: then the result is the time of separation, see `driven.opening`.

    A pair that touches and approaches collides immediately. Without a closing acceleration, a pair whose approach
    speed is below its noise never collides. With a positive closing acceleration, such a pair is at rest if its bodies
    touch. Its gap is then set to exactly 0, and the result is inf. A ball on a thermal wall never rests. If it is
    pressed on the wall, it collides immediately.
    """
    if HUNG:
        if pair.gap == 0.0 and pair.rate < 0.0:
            return pair.at  # type: ignore[no-any-return]
        return pair.at + hung_time_to_contact(pair.gap, pair.rate, pair.omega, pair.rest)  # type: ignore[no-any-return]
    a = pair.closing_acceleration
    rate = (upper.fall_velocity - lower.fall_velocity) - a * pair.at
    if FORCED:
        # First, because a pressed ball on a thermal wall collides; the tests below would let it rest.
        if pair.heat >= 0 and pair.gap == 0.0 and a > 0.0 and rate <= 0.0:
            return pair.at  # type: ignore[no-any-return]
        if pair.stuck > FREE:
            return opening(pair, walls)
        if pair.wall >= 0:
            return next_wall_hit(pair, lower, upper, walls)
        # Touching at rest and pulled apart: the pair opens without a collision.
        if walls.sides[0].lands and a < 0.0 and pair.gap == 0.0 and rate_of(pair, lower, upper) == 0.0:
            return math.inf
    if (
        a > 0.0 and rate * rate < lower.noise + upper.noise and not (FORCED and pair.heat >= 0)
        and pair.gap <= CLOCK_ROUNDING * abs(pair.at) * (abs(lower.fall_velocity) + abs(upper.fall_velocity))
    ):
        pair.gap = 0.0  # The gap is at most the rounding error of `at` times the speeds: the bodies touch.
        return math.inf
    if a == 0.0:
        # The sign of a rate below the noise is unknown: such a pair does not collide.
        known = rate < 0.0 and rate * rate >= lower.noise + upper.noise
        return pair.at + pair.gap / -rate if known else math.inf
    return pair.at + time_to_contact(pair.gap, rate, a)  # type: ignore[no-any-return]


@kernel
def gap_and_rate(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> tuple[float, float]:
    """Return the gap (m) and rate (m/s) of a pair at time `now` in free flight.

    Rounding can make the gap of an approaching pair negative.
    """
    if HUNG:
        return hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)
    if FORCED and pair.wall >= 0:
        return gap_at_wall(pair, lower, upper, now, walls)
    a, at, rate = pair.closing_acceleration, pair.at, upper.fall_velocity - lower.fall_velocity
    return gap_after(pair.gap, rate - a * at, a, now - at), rate - a * now


@kernel
def rate_at_touch(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate (m/s, not positive) that a pair will have at its next collision."""
    if HUNG:
        return hung_rate_at_contact(pair.gap, pair.rate, pair.omega, pair.rest)
    if FORCED and pair.wall >= 0:
        return min(rate_at_wall(pair, lower, upper, walls), 0.0)  # positive only in `next_wall_hit`
    a = pair.closing_acceleration
    return rate_at_contact(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * pair.at, a)


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`.

    The gap is compared with 0 without a tolerance. A stuck pair always touches. A pair with a thermal wall never
    counts as touching. Pendula also touch if their next collision is due.
    """
    if FORCED:
        if pair.heat >= 0:  # thermal wall
            return False
        if pair.stuck > FREE:
            return True
    # a pendulum collision that is due counts as a touch, even if rounding leaves a positive gap
    if HUNG and next_event_time(pair, lower, upper, walls) <= now:
        return True
    return gap_and_rate(pair, lower, upper, now, walls)[0] <= 0.0


@kernel
def advance_pair(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Advance the gap of a pair to time `now` in free flight.

    Returns 1 if rounding made the gap negative, so that it was set to 0. Otherwise returns 0.
    """
    if HUNG or (FORCED and (pair.wall >= 0 or pair.stuck > FREE)):
        return advance_special_pair(pair, lower, upper, now, walls)
    a, at = pair.closing_acceleration, pair.at
    # `gap_and_rate`, inlined
    d = gap_after(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * at, a, now - at)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def advance_special_pair(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Advance a pair of pendula, or a pair at a driven wall, to time `now`.

    A stuck pair is not changed. It keeps its time `at`, because `opening` has to find every later jump of the wall
    velocity. Returns 1 if rounding made the gap negative, so that it was set to 0. Otherwise returns 0.
    """
    # The gap of a stuck pair stays 0, and `opening` needs the time of its closing.
    if FORCED and pair.stuck > FREE:
        return 0
    d, rate = gap_and_rate(pair, lower, upper, now, walls)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    if HUNG:
        pair.rate = rate
    if FORCED and pair.wall >= 0:
        take_wall_velocity(pair, lower, upper, walls)
    return 1 if d < 0.0 else 0


@kernel
def apply_collision(pair: Record, lower: Record, upper: Record, now: float, w: float, e: float) -> None:
    """Apply a collision to a pair at time `now`: its rate changes from `w` to -ε·`w`.

    `w` ≤ 0 is in m/s, and `e` is ε. The function updates the fall velocities and the noise of both bodies, and sets
    the gap to 0.

    The velocity change of the heavier body is computed from its mass ratio. The velocity of the lighter body follows
    from the new rate. Otherwise the rounding errors of both mass ratios would accumulate, and the energy would drift if
    their sum differs from 1 by 2^-54. With ε = 0 and without a closing acceleration, both bodies have bitwise identical
    velocities afterwards. In all other cases the new rate is correct to rounding. On a ring, two equal balls with ε = 1
    exchange their velocities exactly, as if they passed through each other.
    """
    part = pair.closing_acceleration * now - e * w
    # Equal masses: an exchange has no rounding error.
    if RING and e == 1.0 and pair.low == 0.5:
        lower.fall_velocity, upper.fall_velocity = upper.fall_velocity, lower.fall_velocity
    elif pair.low <= 0.5:
        lower.fall_velocity += pair.low * ((1.0 + e) * w)
        upper.fall_velocity = lower.fall_velocity + part
    else:
        upper.fall_velocity -= pair.high * ((1.0 + e) * w)
        lower.fall_velocity = upper.fall_velocity - part
    pair.gap = 0.0
    pair.at = now
    spread_noise(pair, lower, upper, w, e)


@kernel
def impulse(lower: Record, upper: Record, jump: float) -> float:
    """Return the impulse (N s) that lowers the rate of a pair by `jump` (m/s).

    It is -m_eff·`jump`, where m_eff is the effective mass. In a collision `jump` is negative and the impulse is
    positive.
    """
    light, heavy = lower.mass, upper.mass
    if light > heavy:
        # The quotient below is then at most 1, also for an infinite mass.
        light, heavy = heavy, light
    return -jump * (light / (1.0 + light / heavy))  # type: ignore[no-any-return]


@kernel
def spread_noise(pair: Record, lower: Record, upper: Record, w: float, e: float) -> None:
    """Update the noise of both bodies of a pair after a collision.

    `w` is the rate (m/s) before the collision, and `e` is ε. The noise is quadratic in the velocities, so m₁ noise₁ +
    m₂ noise₂ changes like the energy: the sum is conserved if ε = 1 and decreases if ε < 1. The rounding of this
    collision is then added. A wall has zero noise. A driven wall, or a ball that rests on it, keeps its noise.
    """
    a, b = pair.low * (1.0 + e), pair.high * (1.0 + e)
    below, above = lower.noise, upper.noise
    if a > 0.0 and not (FORCED and pair.wall >= 0 and lower.is_free == 0.0):
        x, y = lower.fall_velocity, a * w
        lower.noise = (1.0 - a) * (1.0 - a) * below + a * a * above + COLLISION_NOISE * (x * x + y * y)
    if b > 0.0 and not (FORCED and pair.wall >= 0 and upper.is_free == 0.0):
        x, y = upper.fall_velocity, b * w
        upper.noise = b * b * below + (1.0 - b) * (1.0 - b) * above + COLLISION_NOISE * (x * x + y * y)


@kernel
def rate_at(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> float:
    """Return the rate (m/s) of a pair at time `now`, which is 0 for a stuck pair."""
    if FORCED and pair.stuck > FREE:
        return 0.0
    return gap_and_rate(pair, lower, upper, now, walls)[1]


@kernel
def approaching_pair_from(pairs: Records, bodies: Records, first: int, now: float, walls: Walls) -> int:
    """Return the number of a pair that approaches at time `now`, or -1 if none does.

    The search starts at pair `first` and wraps around. A rate below its noise is not an approach if the closing
    acceleration is 0.
    """
    n = len(pairs)
    for k in range(n):
        c = first + k if first + k < n else first + k - n
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        rate = rate_at(pair, lower, upper, now, walls)
        # As in `next_event_time`: without an acceleration, a rate below the noise is not an approach.
        if rate < 0.0 and (pair.closing_acceleration != 0.0 or rate * rate >= lower.noise + upper.noise):
            return c
    return -1


@kernel
def add_compensated(value: float, low: float, more: float) -> tuple[float, float]:
    """Add `more` to a compensated sum, whose main part is `value`.

    `low` is the rounding error accumulated so far. Returns the new main part and the new accumulated rounding error.
    Their sum is the result (Neumaier, 1974).
    """
    # The smaller summand loses digits.
    new = value + more
    return new, low + ((value - new) + more if abs(value) >= abs(more) else (more - new) + value)


@kernel
def copy_ball(body: Record, other: Record) -> None:
    """Copy the fields `fall_velocity` and `noise` from body `other` to `body`.

    The fields are defined in the module docstring. Both records represent the same ball of a ring, the first and the
    last body of the line.
    """
    body.fall_velocity = other.fall_velocity
    body.noise = other.noise


@kernel
def copy_seam_ball(bodies: Records, c: int) -> None:
    """Copy the seam ball of a ring to its other record after a collision of pair `c`.

    The seam ball is stored as the first and as the last body. The function does nothing if pair `c` contains neither of
    them.
    """
    n = len(bodies) - 1
    if c == 0:
        copy_ball(bodies[n], bodies[0])
    elif c == n - 1:
        copy_ball(bodies[0], bodies[n])


@kernel
def total_mass(bodies: Records, b: int, e: int) -> float:
    """Return the total mass (kg) of bodies `b` to `e`, counted modulo n on a ring."""
    mass = 0.0
    for i in range(b, e + 1):
        mass += bodies[i % (len(bodies) - 1) if RING else i].mass
    return mass
