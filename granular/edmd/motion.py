"""What a pair does: predict its contact, be carried along, collide. Both queues use these same expressions.

State of pair c: `gap[c]` (m, never negative) as it was at time `at[c]`, and the free-fall velocities `u` (m/s) of its
bodies, which change only at impacts: body i moves with ``u[i] - g·tau`` if it falls. `pull[c]` is gravity's closing
acceleration of the gap (g at a floor, 0 between balls, -g at a ceiling). Times are counted from the last re-basing.

What collisions leave of a velocity is rounded. `noise[i]` (m²/s²) is the square of what that may amount to in ``u[i]``,
with a margin: a collision passes it on as it does velocities, and adds its own. Two balls that close more slowly than
that are not known to close at all, and do not collide; velocities that were given are exact.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, rate_at_contact, time_to_contact
from granular._kernels import kernel

Floats = Any
"""A list of floats (plain) or a float64 array (compiled)."""
Ints = Any
"""A list of ints (plain) or an int64 array (compiled)."""

Bodies = tuple[Floats, Floats, Floats, Floats, Floats, Ints, Floats, Ints, Floats]
"""u, falls, gap, at, pull, hits, last, streak, noise of a `State`."""
Physics = tuple[Floats, Floats, Floats, Floats, Floats, float, float, float, float]
"""low, high, m_eff, mass, eps, tc, elastic_below, merge_below, gravity of a `Model`."""


NOISE = 2.0**-96
"""What a collision adds to the noise, in units of the velocities squared: 16 units in the last place of velocities, of
which rounding takes less than 3."""
REBASED = 2.0**-104
"""What re-basing under gravity adds to it, in the same units: one unit in the last place; rounding takes half of it."""


@kernel
def predicted(c: int, u: Floats, gap: Floats, at: Floats, pull: Floats, noise: Floats) -> float:
    """Return the time at which pair `c` collides if nothing happens before, inf if it never does.

    A pair that touches and approaches collides now. One whose approach is but rounding never does.
    """
    a = pull[c]
    rate = (u[c + 1] - u[c]) - a * at[c]
    if a == 0.0:
        return at[c] + gap[c] / -rate if rate < 0.0 and rate * rate >= noise[c] + noise[c + 1] else math.inf
    if rate >= 0.0 and a < 0.0:
        return math.inf
    return at[c] + time_to_contact(gap[c], rate, a)  # type: ignore[no-any-return]


@kernel
def approach(c: int, u: Floats, gap: Floats, at: Floats, pull: Floats) -> float:
    """Return the rate (m/s, ≤ 0) with which pair `c` closes at its predicted contact."""
    a = pull[c]
    return rate_at_contact(gap[c], (u[c + 1] - u[c]) - a * at[c], a)


@kernel
def carry(c: int, now: float, u: Floats, gap: Floats, at: Floats, pull: Floats) -> int:
    """Move the gap of pair `c` to time `now`; return 1 if rounding made it negative and it was clamped at 0."""
    a = pull[c]
    d = gap_after(gap[c], (u[c + 1] - u[c]) - a * at[c], a, now - at[c])
    at[c] = now
    gap[c] = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def collide(
    c: int, now: float, w: float, e: float, u: Floats, gap: Floats, at: Floats, pull: Floats, low: Floats, high: Floats
) -> None:
    """Let pair `c` collide at time `now` with rate `w` ≤ 0, and part with -ε·w.

    The heavier body takes its share of the change, the lighter one follows at the new rate. So no rounding of the
    shares adds up (with two shares that are 1 together but for 2^-54, the energy drifts by 4e-12 in 4e7 collisions),
    and with ε = 0 the pair moves as one in all bits.
    """
    part = pull[c] * now - e * w
    if low[c] <= 0.5:
        u[c] += low[c] * ((1.0 + e) * w)
        u[c + 1] = u[c] + part
    else:
        u[c + 1] -= high[c] * ((1.0 + e) * w)
        u[c] = u[c + 1] - part
    gap[c] = 0.0
    at[c] = now


@kernel
def blur(c: int, w: float, e: float, u: Floats, noise: Floats, low: Floats, high: Floats) -> None:
    """Pass the noise of the bodies of pair `c`, which has just collided at rate `w`, on to each other, and add to it.

    In squares, so m₁ noise₁ + m₂ noise₂ is kept if ε = 1, and falls if ε < 1, as the energy does. A wall has none.
    """
    a, b = low[c] * (1.0 + e), high[c] * (1.0 + e)
    lower, upper = noise[c], noise[c + 1]
    if a > 0.0:
        x, y = u[c], a * w
        noise[c] = (1.0 - a) * (1.0 - a) * lower + a * a * upper + NOISE * (x * x + y * y)
    if b > 0.0:
        x, y = u[c + 1], b * w
        noise[c + 1] = b * b * lower + (1.0 - b) * (1.0 - b) * upper + NOISE * (x * x + y * y)


@kernel
def approaching(first: int, now: float, u: Floats, pull: Floats, noise: Floats) -> int:
    """Return a pair that approaches at time `now`, looking at pair `first` first; -1 if none does."""
    n = len(pull)
    for k in range(n):
        c = first + k if first + k < n else first + k - n
        rate = (u[c + 1] - u[c]) - pull[c] * now
        if rate < 0.0 and (pull[c] != 0.0 or rate * rate >= noise[c] + noise[c + 1]):
            return c
    return -1


@kernel
def rebase(
    shift: float, g: float, u: Floats, falls: Floats, gap: Floats, at: Floats, pull: Floats, last: Floats, noise: Floats
) -> int:
    """Move all gaps to time `shift` and make that the new zero of time; return the number of clamps."""
    clamps = 0
    for c in range(len(gap)):
        clamps += carry(c, shift, u, gap, at, pull)
        at[c] = 0.0
        last[c] -= shift
    if g != 0.0:
        for i in range(len(u)):
            u[i] -= falls[i] * (g * shift)
            noise[i] += falls[i] * REBASED * (u[i] * u[i])
    return clamps
