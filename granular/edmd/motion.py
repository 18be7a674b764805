"""What a pair does: predict its contact, be carried along, collide. Both queues use these same expressions.

Records of pair c: `gap` (m, never negative) as it was at time `at`, and of its bodies the free-fall velocities `u`
(m/s), which change only at impacts: a body moves with ``u - g·tau`` if it falls. `pull` is gravity's closing
acceleration of the gap (g at a floor, 0 between balls, -g at a ceiling). Times are counted from the last re-basing.

What collisions leave of a velocity is rounded. `noise` (m²/s²) is the square of what that may amount to in `u`, with a
margin: a collision passes it on as it does velocities, and adds its own. Two balls that close more slowly than that
are not known to close at all, and do not collide; velocities that were given are exact.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

from granular._flight import gap_after, time_to_contact
from granular._kernels import kernel
from granular._records import Record, Records

Walls: TypeAlias = Any
"""Of scenes that are driven: see `granular.edmd.driven`, which has other kernels for them. Else None."""
NOISE = 2.0**-96
"""What a collision adds to the noise, in units of the velocities squared: 16 units in the last place of velocities, of
which rounding takes less than 3."""
UNCERTAIN = 2.0**-76
"""Noise that a ball has at most, in units of the largest velocity squared."""
REBASED = 2.0**-104
"""What re-basing under gravity adds to it, in the same units: one unit in the last place; rounding takes half of it."""
LONGEST = 1000
"""Largest window of the clock, a power of 2, in s."""
LATEST = 2.0**LONGEST
"""Time in s after which runs end."""


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities of the bodies of a pair (m/s) at time `now`."""
    fallen = g * now
    return lower.u - lower.falls * fallen, upper.u - upper.falls * fallen


@kernel
def predicted(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair collides if nothing happens before, inf if it never does.

    A pair that touches and approaches collides now. One whose approach is but rounding never does.
    """
    a = pair.pull
    rate = (upper.u - lower.u) - a * pair.at
    if a == 0.0:
        known = rate < 0.0 and rate * rate >= lower.noise + upper.noise
        return pair.at + pair.gap / -rate if known else math.inf
    return pair.at + time_to_contact(pair.gap, rate, a)  # type: ignore[no-any-return]


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`, without tolerance."""
    a, at = pair.pull, pair.at
    return gap_after(pair.gap, (upper.u - lower.u) - a * at, a, now - at) <= 0.0


@kernel
def carry(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Move the gap of a pair to time `now`; return 1 if rounding made it negative and it was clamped at 0."""
    a, at = pair.pull, pair.at
    d = gap_after(pair.gap, (upper.u - lower.u) - a * at, a, now - at)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def collide(pair: Record, lower: Record, upper: Record, now: float, w: float, e: float) -> None:
    """Let a pair collide at time `now` with rate `w` ≤ 0, and part with -ε·w.

    The heavier body takes its share of the change, the lighter one follows at the new rate. So no rounding of the
    shares adds up (with two shares that are 1 together except for 2^-54, the energy drifts by 4e-12 in 4e7 collisions),
    and with ε = 0 the pair moves as one in all bits.
    """
    part = pair.pull * now - e * w
    if pair.low <= 0.5:
        lower.u += pair.low * ((1.0 + e) * w)
        upper.u = lower.u + part
    else:
        upper.u -= pair.high * ((1.0 + e) * w)
        lower.u = upper.u - part
    pair.gap = 0.0
    pair.at = now


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

    In squares, so m₁ noise₁ + m₂ noise₂ is kept if ε = 1, and falls if ε < 1, as the energy does. A wall has none.
    """
    a, b = pair.low * (1.0 + e), pair.high * (1.0 + e)
    below, above = lower.noise, upper.noise
    if a > 0.0:
        x, y = lower.u, a * w
        lower.noise = (1.0 - a) * (1.0 - a) * below + a * a * above + NOISE * (x * x + y * y)
    if b > 0.0:
        x, y = upper.u, b * w
        upper.noise = b * b * below + (1.0 - b) * (1.0 - b) * above + NOISE * (x * x + y * y)


@kernel
def rate_at(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> float:
    """Return the rate of a pair (m/s) at time `now`."""
    return (upper.u - lower.u) - pair.pull * now  # type: ignore[no-any-return]


@kernel
def approaching(pairs: Records, bodies: Records, first: int, now: float, walls: Walls) -> int:
    """Return a pair that approaches at time `now`, looking at pair `first` first; -1 if none does."""
    n = len(pairs)
    for k in range(n):
        c = first + k if first + k < n else first + k - n
        pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
        rate = rate_at(pair, lower, upper, now, walls)
        if rate < 0.0 and (pair.pull != 0.0 or rate * rate >= lower.noise + upper.noise):
            return c
    return -1


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> None:
    """Move all gaps to time `shift`, the new zero of time."""
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += carry(pair, bodies[c], bodies[c + 1], shift, walls)
        pair.at = 0.0
        pair.last -= shift
    if run.gravity != 0.0:
        for i in range(len(bodies)):
            body = bodies[i]
            body.u -= body.falls * (run.gravity * shift)
            body.noise += body.falls * REBASED * (body.u * body.u)
    else:
        cut(bodies)


@kernel
def cut(bodies: Records) -> None:
    """Cut the noise: what rounding has left in rates becomes less as they do, but noise, which balls have in common
    too, does not, and would have slow balls pass through each other."""
    fastest = 0.0
    for i in range(len(bodies)):
        fastest = max(fastest, abs(bodies[i].u))
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
def reimpose(run: Record, pairs: Records) -> int:
    """Give the largest gap what rounding has taken from the sum of all, which never changes; return its pair."""
    widest, total, low = 0, 0.0, 0.0
    for c in range(len(pairs)):
        total, low = add(total, low, pairs[c].gap)
        if pairs[c].gap > pairs[widest].gap:
            widest = c
    pairs[widest].gap += (run.closed - total) - low
    return widest
