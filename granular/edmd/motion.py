"""Motion of one pair: prediction of its contact, free flight and collision.

Both event queues evaluate these same expressions.

The record of a pair holds its `gap` (m, never negative) at the time `at`. The record of a body holds its
`fall_velocity` u (m/s), which changes only at impacts. A body moves with ``u - g·tau`` if it `is_free`. Gravity gives
the gap its `closing_acceleration` (g at a floor, 0 between balls, -g at a ceiling). Times are measured from the last
re-basing.

A collision rounds velocities. `noise` (m²/s²) bounds the square of the rounding error of u, with a margin. A collision
propagates the noise as it propagates velocities, and adds its own rounding error. Two balls whose approach speed is
below their noise do not collide, because the sign of their relative velocity is uncertain. Initial velocities are
exact.

The branches `if FORCED`, `if HUNG` and `if RING` serve driven walls and forces (`driven`), pendula (`hanging`) and
rings. A first reader can skip them, see `granular._engine.kernels`. A ring of n balls is a line of n pairs and n + 1
bodies, where the last body repeats the first. Every change of one of these two bodies is copied to the other, and the
neighbours of a pair are counted modulo n. Velocities on a ring are relative to the centre of mass.
"""

from __future__ import annotations

import math

from granular._engine.flight import gap_after, hung, hung_after, hung_rate_at_contact, rate_at_contact, time_to_contact
from granular._engine.kernels import FORCED, HUNG, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.driven import beside, next_wall_hit, opening, rate_at_wall, rate_of, take_wall_velocity
from granular.edmd.records import FREE, Walls

COLLISION_NOISE = 2.0**-96
"""Noise that a collision adds, in units of the squared velocities.

It corresponds to 16 units in the last place of a velocity. The rounding error is less than 3 units.
"""
MAX_RELATIVE_NOISE = 2.0**-76
"""Largest noise of a ball, in units of the largest squared velocity."""
CLOCK_ROUNDING = 2.0**-52
"""Relative rounding error of a time."""
REBASING_NOISE = 2.0**-104
"""Noise that re-basing under gravity adds, in the same units as `COLLISION_NOISE`.

It corresponds to one unit in the last place. The rounding error is half a unit.
"""
MIN_REMOVED_DRIFT = 2.0**-20
"""Smallest centre-of-mass velocity of a ring that is removed.

In units of the largest velocity of a ball.
"""
MAX_WINDOW_EXPONENT = 1000
"""Largest binary exponent of the clock window, a power of 2 in s."""
LATEST_TIME = 2.0**MAX_WINDOW_EXPONENT
"""Time in s after which runs end."""


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities (m/s) of the two bodies of a pair at time `now`.

    The velocity of a driven wall is its velocity at the time `at` of its pair.
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
def predicted(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time of the next collision of a pair, or inf if it never collides.

    The prediction assumes that no other event changes the pair before.

    A pair that touches and approaches collides now. A pair whose approach speed is below its rounding error never
    collides: without a closing acceleration its balls pass by, and balls that touch and are pressed together are at
    rest. With forces, a stuck pair opens at the returned time. A ball on a thermal wall never rests: it collides now if
    it is pressed on the wall.
    """
    if HUNG:
        if pair.gap == 0.0 and pair.rate < 0.0:
            return pair.at  # type: ignore[no-any-return]
        return pair.at + hung(pair.gap, pair.rate, pair.omega, pair.rest)  # type: ignore[no-any-return]
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
        pair.gap = 0.0  # The gap is within the rounding error of the time of a simultaneous event.
        return math.inf
    if a == 0.0:
        # The sign of a rate below the noise is unknown: such a pair does not collide.
        known = rate < 0.0 and rate * rate >= lower.noise + upper.noise
        return pair.at + pair.gap / -rate if known else math.inf
    return pair.at + time_to_contact(pair.gap, rate, a)  # type: ignore[no-any-return]


@kernel
def after(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> tuple[float, float]:
    """Return the gap (m) and rate (m/s) of a pair at time `now`.

    The gap of a closing pair can be negative by rounding.
    """
    if HUNG:
        return hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)
    if FORCED and pair.wall >= 0:
        return beside(pair, lower, upper, now, walls)
    a, at, rate = pair.closing_acceleration, pair.at, upper.fall_velocity - lower.fall_velocity
    return gap_after(pair.gap, rate - a * at, a, now - at), rate - a * now


@kernel
def rate_at_touch(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate (m/s, not positive) of a pair at its next collision."""
    if HUNG:
        return hung_rate_at_contact(pair.gap, pair.rate, pair.omega, pair.rest)
    if FORCED and pair.wall >= 0:
        return rate_at_wall(pair, lower, upper, walls)
    a = pair.closing_acceleration
    return rate_at_contact(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * pair.at, a)


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`, without tolerance.

    A pair with a thermal wall never counts as touching.
    """
    if FORCED:
        if pair.heat >= 0:
            return False
        if pair.stuck > FREE:
            return True
    if HUNG and predicted(pair, lower, upper, walls) <= now:
        return True
    return after(pair, lower, upper, now, walls)[0] <= 0.0


@kernel
def carry(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Advance a pair to time `now`.

    Returns 1 if rounding made the gap negative and the gap was clamped at 0, else 0.
    """
    if HUNG or (FORCED and (pair.wall >= 0 or pair.stuck > FREE)):
        return carry_led(pair, lower, upper, now, walls)
    a, at = pair.closing_acceleration, pair.at
    d = gap_after(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * at, a, now - at)  # `after`, inlined
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def carry_led(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Advance a pair of pendula, or a pair at a driven wall, to time `now`.

    A stuck pair is not changed: it keeps its time `at`. Its opening is searched from the time of its closing, so that a
    jump of the wall velocity at `now` is found. Returns 1 if the gap was replaced by 0, otherwise 0.
    """
    # The gap of a stuck pair stays 0, and `opening` needs the time of its closing.
    if FORCED and pair.stuck > FREE:
        return 0
    d, rate = after(pair, lower, upper, now, walls)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    if HUNG:
        pair.rate = rate
    if FORCED and pair.wall >= 0:
        take_wall_velocity(pair, lower, upper, walls)
    return 1 if d < 0.0 else 0


@kernel
def collide(pair: Record, lower: Record, upper: Record, now: float, w: float, e: float) -> None:
    """Let a pair collide at time `now` and separate with the rate -ε·w.

    `w` ≤ 0 is the rate before the collision, `e` is ε. The noise of both bodies is updated too.

    The velocity change of the heavier body is computed from its share. The velocity of the lighter body follows from
    the new rate. Rounding errors of the two shares therefore do not accumulate (with shares that add to 1 only within
    2^-54, the energy drifts by 4e-12 in 4e7 collisions). With ε = 0 and without a closing acceleration, both bodies
    have bitwise identical velocities; otherwise they agree to rounding. On a ring, equal balls with ε = 1 exchange
    their velocities exactly, as if they passed through each other.
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
    blur(pair, lower, upper, w, e)


@kernel
def impulse(lower: Record, upper: Record, jump: float) -> float:
    """Return the impulse in N s that reduces the rate of a pair by `jump` (m/s)."""
    light, heavy = lower.mass, upper.mass
    if light > heavy:
        # The quotient below is then at most 1, also for an infinite mass.
        light, heavy = heavy, light
    return -jump * (light / (1.0 + light / heavy))  # type: ignore[no-any-return]


@kernel
def blur(pair: Record, lower: Record, upper: Record, w: float, e: float) -> None:
    """Propagate the noise of a pair through its collision at rate `w`, and add to it.

    The noise is quadratic, so m₁ noise₁ + m₂ noise₂ is conserved if ε = 1 and decreases if ε < 1, as the energy does. A
    wall has zero noise. A driven wall, and a ball that rests on it, keep their own noise.
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
    """Return the rate (m/s) of a pair at time `now`."""
    if FORCED and pair.stuck > FREE:
        return 0.0
    return after(pair, lower, upper, now, walls)[1]


@kernel
def approaching(pairs: Records, bodies: Records, first: int, now: float, walls: Walls) -> int:
    """Return the number of a pair that approaches at time `now`, or -1.

    The search starts at pair `first` and wraps around. Without a closing acceleration, a rate below its noise is not an
    approach.
    """
    n = len(pairs)
    for k in range(n):
        c = first + k if first + k < n else first + k - n
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        rate = rate_at(pair, lower, upper, now, walls)
        # As in `predicted`: without an acceleration, a rate below the noise is not an approach.
        if rate < 0.0 and (pair.closing_acceleration != 0.0 or rate * rate >= lower.noise + upper.noise):
            return c
    return -1


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> float:
    """Advance all pairs to time `shift`, which becomes the new zero of time.

    Stuck pairs keep the time of their closing. Returns the largest magnitude of the relative velocities (m/s) at the
    new zero of time.
    """
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += carry(pair, bodies[c], bodies[c + 1], shift, walls)
        # Stuck pairs keep the time of their closing.
        pair.at = pair.at - shift if FORCED and pair.stuck > FREE else 0.0
        pair.last -= shift
    if FORCED or HUNG or run.gravity != 0.0:
        for i in range(len(bodies)):
            body = bodies[i]
            if HUNG:
                u, cosine, sine = body.fall_velocity, math.cos(body.omega * shift), math.sin(body.omega * shift)
                body.fall_velocity, body.sway = u * cosine - body.sway * sine, body.sway * cosine + u * sine
            elif FORCED:
                fallen = body.is_free * (run.gravity * shift) - body.force_acceleration * shift
                body.fall_velocity -= fallen
                # A subtraction of 0 does not round.
                if fallen != 0.0:
                    body.noise += REBASING_NOISE * (body.fall_velocity * body.fall_velocity)
            else:
                body.fall_velocity -= body.is_free * (run.gravity * shift)
                body.noise += body.is_free * REBASING_NOISE * (body.fall_velocity * body.fall_velocity)
    else:
        cut(bodies)
    if (HUNG or RING) and run.gap_sum > 0.0:
        reimpose(run, pairs)
    if RING:
        centre(bodies)
    speed = 0.0
    for c in range(len(pairs)):
        if HUNG:
            speed = max(speed, abs(pairs[c].rate))
        else:
            speed = max(speed, abs(bodies[c + 1].fall_velocity - bodies[c].fall_velocity))
    return speed


@kernel
def cut(bodies: Records) -> None:
    """Limit the noise of all bodies relative to their velocities.

    The limit is `MAX_RELATIVE_NOISE` times the largest squared velocity. Rounding errors of relative velocities
    decrease as the velocities do. The noise, which neighbouring balls have in common, does not decrease. Without the
    limit, slow balls would pass through each other.
    """
    fastest = 0.0
    for i in range(len(bodies)):
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    for i in range(len(bodies)):
        bodies[i].noise = min(bodies[i].noise, MAX_RELATIVE_NOISE * (fastest * fastest))


@kernel
def span(length: float, speed: float, g: float) -> float:
    """Return the window (s), a power of two near 64 mean times to cross a gap.

    Under strong gravity the window is limited to the time in which gravity doubles the speed. With a power of two, a
    scene that is scaled by powers of two gives the same bits.
    """
    if speed == 0.0:
        return 1.0
    # Balls that touch everywhere have no mean gap; gravity sets the scale then.
    window = 64.0 * length / speed if length > 0.0 else speed / g if g > 0.0 else 1.0
    if g > 0.0:
        window = min(window, speed / g)
    # frexp returns the exponent of the next power of two.
    return math.ldexp(1.0, min(math.frexp(window)[1], MAX_WINDOW_EXPONENT))


@kernel
def add(value: float, low: float, more: float) -> tuple[float, float]:
    """Add `more` to a compensated sum.

    Returns the new sum and its accumulated rounding error (Neumaier, 1974).
    """
    # The smaller summand is the one that loses digits.
    new = value + more
    return new, low + ((value - new) + more if abs(value) >= abs(more) else (more - new) + value)


@kernel
def reimpose(run: Record, pairs: Records) -> None:
    """Correct the largest gap so that the sum of all gaps keeps its initial value.

    For pendula, the rate of this pair is corrected so that the sum of all rates is 0.
    """
    widest, sum_high, low = 0, 0.0, 0.0
    for c in range(len(pairs)):
        sum_high, low = add(sum_high, low, pairs[c].gap)
        if pairs[c].gap > pairs[widest].gap:
            widest = c
    # The relative change is smallest in the largest gap, which also cannot become negative.
    pairs[widest].gap += (run.gap_sum - sum_high) - low
    if HUNG:
        sum_high, low = 0.0, 0.0
        for c in range(len(pairs)):
            sum_high, low = add(sum_high, low, pairs[c].rate)
        pairs[widest].rate -= sum_high + low


@kernel
def centre(bodies: Records) -> None:
    """Subtract the velocity of the centre of mass of a ring before it is significant.

    Velocities are relative to the centre of mass, so they keep their digits however slow the balls become.
    """
    n, momentum, low, mass, fastest = len(bodies) - 1, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        momentum, low = add(momentum, low, bodies[i].mass * bodies[i].fall_velocity)
        mass += bodies[i].mass
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    mean = (momentum + low) / mass
    for i in range(n):
        if abs(mean) > MIN_REMOVED_DRIFT * fastest:
            bodies[i].fall_velocity -= mean
    copy_ball(bodies[n], bodies[0])


@kernel
def copy_ball(body: Record, other: Record) -> None:
    """Copy velocity and noise from `other` to `body`, which represent the same ball.

    Both represent the ball at the seam of a ring.
    """
    body.fall_velocity = other.fall_velocity
    body.noise = other.noise


@kernel
def across(bodies: Records, c: int) -> None:
    """Copy the result of a collision of pair `c` to the other body of the seam ball."""
    n = len(bodies) - 1
    if c == 0:
        copy_ball(bodies[n], bodies[0])
    elif c == n - 1:
        copy_ball(bodies[0], bodies[n])


@kernel
def total(bodies: Records, b: int, e: int) -> float:
    """Return the mass (kg) of bodies `b` to `e`, on a ring counted modulo n."""
    mass = 0.0
    for i in range(b, e + 1):
        mass += bodies[i % (len(bodies) - 1) if RING else i].mass
    return mass
