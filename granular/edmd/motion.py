"""What a pair does: predict its contact, be carried along, collide. Both queues use these same expressions.

Records of pair c: `gap` (m, never negative) as it was at time `at`, and of its bodies the `fall_velocity` u
(m/s), which changes only at impacts: a body moves with ``u - g·tau`` if it `is_free`. Gravity gives the gap its
`closing_acceleration` (g at a floor, 0 between balls, -g at a ceiling). Times are counted from the last re-basing.

What collisions leave of a velocity is rounded. `noise` (m²/s²) is the square of what that may amount to in u, with a
margin: a collision passes it on as it does velocities, and adds its own. Two balls that close more slowly than that
are not known to close at all, and do not collide; velocities that were given are exact.

What stands behind `if FORCED`, `if HUNG` or `if RING` is for scenes that are not plain, see `granular._engine.kernels`,
and may be skipped: walls that shake and forces (`driven`), pendula (`hanging`), and rings. A ring of n balls is a line
of n pairs and n + 1 bodies, the last of which is the first once more: what happens to one of these two happens to the
other, and the neighbours of a pair are counted round. Its velocities are relative to the centre of mass.
"""

from __future__ import annotations

import math

from granular._engine.flight import gap_after, hung, hung_after, hung_rate_at_contact, rate_at_contact, time_to_contact
from granular._engine.kernels import FORCED, HUNG, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.driven import beside, next_wall_hit, opening, rate_at_wall, rate_of, take_wall_velocity
from granular.edmd.records import FREE, Walls

NOISE = 2.0**-96
"""What a collision adds to the noise, in units of the velocities squared: 16 units in the last place of velocities, of
which rounding takes less than 3."""
UNCERTAIN = 2.0**-76
"""Noise that a ball has at most, in units of the largest velocity squared."""
CLOCK_ROUNDING = 2.0**-52
"""Relative rounding error of a time."""
REBASED = 2.0**-104
"""What re-basing under gravity adds to it, in the same units: one unit in the last place; rounding takes half of it."""
COMPARABLE = 2.0**-20
"""Velocity of the centre of mass of a ring, in units of the largest, that is taken back."""
LONGEST = 1000
"""Largest window of the clock, a power of 2, in s."""
LATEST = 2.0**LONGEST
"""Time in s after which runs end."""


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities of the bodies of a pair (m/s) at time `now`; of a driven wall, at that of its pair."""
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
    """Return the time at which a pair collides if nothing happens before, inf if it never does.

    A pair that touches and approaches collides now. A pair whose approach speed is below its rounding error never
    collides: without a closing acceleration its balls pass by, and balls that touch and are pressed together are at
    rest. With forces, a stuck pair opens at that time. A ball on a thermal wall never rests: it collides now if it is
    pressed on the wall.
    """
    if HUNG:
        if pair.gap == 0.0 and pair.rate < 0.0:
            return pair.at  # type: ignore[no-any-return]
        return pair.at + hung(pair.gap, pair.rate, pair.omega, pair.rest)  # type: ignore[no-any-return]
    a = pair.closing_acceleration
    rate = (upper.fall_velocity - lower.fall_velocity) - a * pair.at
    if FORCED:
        if pair.heat >= 0 and pair.gap == 0.0 and a > 0.0 and rate <= 0.0:
            return pair.at  # type: ignore[no-any-return]
        if pair.stuck > FREE:
            return opening(pair, walls)
        if pair.wall >= 0:
            return next_wall_hit(pair, lower, upper, walls)
        if walls.sides[0].lands and a < 0.0 and pair.gap == 0.0 and rate_of(pair, lower, upper) == 0.0:
            return math.inf
    if (
        a > 0.0 and rate * rate < lower.noise + upper.noise and not (FORCED and pair.heat >= 0)
        and pair.gap <= CLOCK_ROUNDING * abs(pair.at) * (abs(lower.fall_velocity) + abs(upper.fall_velocity))
    ):
        pair.gap = 0.0  # at most the rounding error of a collision time, beside an event at the same instant
        return math.inf
    if a == 0.0:
        known = rate < 0.0 and rate * rate >= lower.noise + upper.noise
        return pair.at + pair.gap / -rate if known else math.inf
    return pair.at + time_to_contact(pair.gap, rate, a)  # type: ignore[no-any-return]


@kernel
def after(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> tuple[float, float]:
    """Return gap (m) and rate (m/s) of a pair at time `now`; rounding may make a gap negative that closes."""
    if HUNG:
        return hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)
    if FORCED and pair.wall >= 0:
        return beside(pair, lower, upper, now, walls)
    a, at, rate = pair.closing_acceleration, pair.at, upper.fall_velocity - lower.fall_velocity
    return gap_after(pair.gap, rate - a * at, a, now - at), rate - a * now


@kernel
def rate_at_touch(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the rate (m/s), not positive, at which a pair is about to collide."""
    if HUNG:
        return hung_rate_at_contact(pair.gap, pair.rate, pair.omega, pair.rest)
    if FORCED and pair.wall >= 0:
        return rate_at_wall(pair, lower, upper, walls)
    a = pair.closing_acceleration
    return rate_at_contact(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * pair.at, a)


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`, without tolerance; beside a thermal wall none do."""
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
    """Move a pair to time `now`; return 1 if rounding made its gap negative and it was clamped at 0."""
    if HUNG or (FORCED and (pair.wall >= 0 or pair.stuck > FREE)):
        return carry_led(pair, lower, upper, now, walls)
    a, at = pair.closing_acceleration, pair.at
    d = gap_after(pair.gap, (upper.fall_velocity - lower.fall_velocity) - a * at, a, now - at)  # `after`, called less
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def carry_led(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Move a pair of pendula, or beside a wall that may be driven, to time `now`.

    One that is stuck opens when it does, looked at from when it closed: a jump of its wall's velocity just now counts.
    """
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
    """Let a pair collide at time `now` with rate `w` ≤ 0, and part with -ε·w.

    The heavier body takes its share of the change, the lighter one follows at the new rate. So no rounding of the
    shares adds up (with two shares that are 1 together except for 2^-54, the energy drifts by 4e-12 in 4e7 collisions),
    and with ε = 0 the pair moves as one in all bits. On a ring equal balls that lose nothing exchange their velocities
    to the last bit: they fly as if they passed each other.
    """
    part = pair.closing_acceleration * now - e * w
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
    """Return the impulse in N s by which the rate of a pair becomes less by `jump` (m/s)."""
    light, heavy = lower.mass, upper.mass
    if light > heavy:
        light, heavy = heavy, light
    return -jump * (light / (1.0 + light / heavy))  # type: ignore[no-any-return]


@kernel
def blur(pair: Record, lower: Record, upper: Record, w: float, e: float) -> None:
    """Pass the noise of the bodies of a pair, which has just collided at rate `w`, on to each other, and add to it.

    In squares, so m₁ noise₁ + m₂ noise₂ is kept if ε = 1, and falls if ε < 1, as the energy does. A wall has none; a
    driven one, and what rests on it, has its own.
    """
    a, b = pair.low * (1.0 + e), pair.high * (1.0 + e)
    below, above = lower.noise, upper.noise
    if a > 0.0 and not (FORCED and pair.wall >= 0 and lower.is_free == 0.0):
        x, y = lower.fall_velocity, a * w
        lower.noise = (1.0 - a) * (1.0 - a) * below + a * a * above + NOISE * (x * x + y * y)
    if b > 0.0 and not (FORCED and pair.wall >= 0 and upper.is_free == 0.0):
        x, y = upper.fall_velocity, b * w
        upper.noise = b * b * below + (1.0 - b) * (1.0 - b) * above + NOISE * (x * x + y * y)


@kernel
def rate_at(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> float:
    """Return the rate of a pair (m/s) at time `now`."""
    if FORCED and pair.stuck > FREE:
        return 0.0
    return after(pair, lower, upper, now, walls)[1]


@kernel
def approaching(pairs: Records, bodies: Records, first: int, now: float, walls: Walls) -> int:
    """Return a pair that approaches at time `now`, looking at pair `first` first; -1 if none does."""
    n = len(pairs)
    for k in range(n):
        c = first + k if first + k < n else first + k - n
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        rate = rate_at(pair, lower, upper, now, walls)
        if rate < 0.0 and (pair.closing_acceleration != 0.0 or rate * rate >= lower.noise + upper.noise):
            return c
    return -1


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> float:
    """Move all gaps to time `shift`, the new zero of time; return the largest rate without what gravity adds (m/s)."""
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += carry(pair, bodies[c], bodies[c + 1], shift, walls)
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
                if fallen != 0.0:
                    body.noise += REBASED * (body.fall_velocity * body.fall_velocity)
            else:
                body.fall_velocity -= body.is_free * (run.gravity * shift)
                body.noise += body.is_free * REBASED * (body.fall_velocity * body.fall_velocity)
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
    """Cut the noise: what rounding has left in rates becomes less as they do, but noise, which balls have in common
    too, does not, and would have slow balls pass through each other."""
    fastest = 0.0
    for i in range(len(bodies)):
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    for i in range(len(bodies)):
        bodies[i].noise = min(bodies[i].noise, UNCERTAIN * (fastest * fastest))


@kernel
def span(length: float, speed: float, g: float) -> float:
    """Return the window (s): the power of two near 64 times the mean time to cross a gap, less if gravity is strong.

    Then it is the time in which gravity doubles the speed. A power of two keeps the bits of a scene scaled by powers
    of two.
    """
    if speed == 0.0:
        return 1.0
    window = 64.0 * length / speed if length > 0.0 else speed / g if g > 0.0 else 1.0
    if g > 0.0:
        window = min(window, speed / g)
    return math.ldexp(1.0, min(math.frexp(window)[1], LONGEST))


@kernel
def add(total: float, low: float, more: float) -> tuple[float, float]:
    """Return a sum and what its rounding has left, with one more summand (Neumaier, 1974)."""
    new = total + more
    return new, low + ((total - new) + more if abs(total) >= abs(more) else (more - new) + total)


@kernel
def reimpose(run: Record, pairs: Records) -> None:
    """Give the largest gap what rounding has taken from the sum of all, which never changes, and of pendula its rate
    what it has taken from the sum of those, which is 0."""
    widest, total, low = 0, 0.0, 0.0
    for c in range(len(pairs)):
        total, low = add(total, low, pairs[c].gap)
        if pairs[c].gap > pairs[widest].gap:
            widest = c
    pairs[widest].gap += (run.gap_sum - total) - low
    if HUNG:
        total, low = 0.0, 0.0
        for c in range(len(pairs)):
            total, low = add(total, low, pairs[c].rate)
        pairs[widest].rate -= total + low


@kernel
def centre(bodies: Records) -> None:
    """Take back what rounding has given the centre of mass of a ring, before it is comparable to the velocities.

    They are relative to it, and so keep their digits however much slower the balls become.
    """
    n, momentum, low, mass, fastest = len(bodies) - 1, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        momentum, low = add(momentum, low, bodies[i].mass * bodies[i].fall_velocity)
        mass += bodies[i].mass
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    mean = (momentum + low) / mass
    for i in range(n):
        if abs(mean) > COMPARABLE * fastest:
            bodies[i].fall_velocity -= mean
    same(bodies[n], bodies[0])


@kernel
def same(body: Record, other: Record) -> None:
    """Let a body be what the other is: both are the ball at the seam of a ring."""
    body.fall_velocity = other.fall_velocity
    body.noise = other.noise


@kernel
def across(bodies: Records, c: int) -> None:
    """Let what has happened to the ball at the seam of a ring, in pair `c`, happen to both bodies that it is."""
    n = len(bodies) - 1
    if c == 0:
        same(bodies[n], bodies[0])
    elif c == n - 1:
        same(bodies[0], bodies[n])


@kernel
def total(bodies: Records, b: int, e: int) -> float:
    """Return the mass of bodies `b` … `e` (kg), on a ring counted round."""
    mass = 0.0
    for i in range(b, e + 1):
        mass += bodies[i % (len(bodies) - 1) if RING else i].mass
    return mass
