"""Epoch of a run: its move to a later time, and the length of the window.

A move also limits the rounding errors that accumulate in velocities and gaps. For epoch, window, noise and the branches
`if FORCED`, `if HUNG` and `if RING` see `granular.edmd.motion`.
"""

from __future__ import annotations

import math

from granular._engine.kernels import FORCED, HUNG, RING, kernel
from granular._engine.records import Record, Records
from granular.edmd.motion import add_compensated, advance_pair, copy_ball
from granular.edmd.records import FREE, Walls

MAX_RELATIVE_NOISE = 2.0**-76
"""Largest noise of a ball, in units of the largest squared velocity of all balls."""
REBASING_NOISE = 2.0**-104
"""Noise added by moving the epoch under gravity, in units of the squared velocity.

It corresponds to one unit in the last place. The actual rounding error is half a unit.
"""
MIN_REMOVED_DRIFT = 2.0**-20
"""Smallest velocity of the centre of mass of a ring that is subtracted.

It is in units of the largest speed of a ball.
"""
MAX_WINDOW_EXPONENT = 1000
"""Largest binary exponent of the window, which is a power of 2 in s."""
LATEST_TIME = 2.0**MAX_WINDOW_EXPONENT
"""Latest time in s of a collision. A run whose next collision is later ends."""


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> float:
    """Advance all pairs to time `shift`, and make this time the new epoch.

    All stored times and fall velocities are converted to the new epoch. Stuck pairs are not advanced. Returns the
    largest magnitude of the relative velocities of pairs (m/s) at the new epoch.
    """
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += advance_pair(pair, bodies[c], bodies[c + 1], shift, walls)
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
        limit_noise(bodies)
    if (HUNG or RING) and run.gap_sum > 0.0:
        restore_gap_sum(run, pairs)
    if RING:
        remove_drift(bodies)
    speed = 0.0
    for c in range(len(pairs)):
        if HUNG:
            speed = max(speed, abs(pairs[c].rate))
        else:
            speed = max(speed, abs(bodies[c + 1].fall_velocity - bodies[c].fall_velocity))
    return speed


@kernel
def window_length(length: float, speed: float, g: float) -> float:
    """Return the length of the window (s): a power of two near 64 mean flight times.

    The mean flight time is `length`/`speed`, where `length` is the mean gap (m) and `speed` the scale of speeds (m/s).
    The window is at most about `speed`/`g`, the time in which the largest acceleration `g` (m/s²) doubles the speed.
    It is a power of two, so a scene that is scaled by powers of two gives the same binary digits.
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
def limit_noise(bodies: Records) -> None:
    """Limit the noise of all bodies relative to the largest velocity.

    The limit is `MAX_RELATIVE_NOISE` times the largest squared velocity. In a gas that loses energy, velocities
    decrease and their rounding errors with them. The stored noise of neighbouring balls does not decrease. Without the
    limit, slow balls would pass through each other, because collisions below the noise are ignored.
    """
    fastest = 0.0
    for i in range(len(bodies)):
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    for i in range(len(bodies)):
        bodies[i].noise = min(bodies[i].noise, MAX_RELATIVE_NOISE * (fastest * fastest))


@kernel
def restore_gap_sum(run: Record, pairs: Records) -> None:
    """Correct the largest gap so that the sum of all gaps keeps its initial value.

    The initial value is `run.gap_sum` in m. For pendula, the rate of this pair is corrected as well, so that the sum
    of all rates is 0.
    """
    widest, sum_high, low = 0, 0.0, 0.0
    for c in range(len(pairs)):
        sum_high, low = add_compensated(sum_high, low, pairs[c].gap)
        if pairs[c].gap > pairs[widest].gap:
            widest = c
    # The relative change is smallest in the largest gap, which also cannot become negative.
    pairs[widest].gap += (run.gap_sum - sum_high) - low
    if HUNG:
        sum_high, low = 0.0, 0.0
        for c in range(len(pairs)):
            sum_high, low = add_compensated(sum_high, low, pairs[c].rate)
        pairs[widest].rate -= sum_high + low


@kernel
def remove_drift(bodies: Records) -> None:
    """Subtract the velocity of the centre of mass from all balls of a ring.

    This is done only if this velocity exceeds `MIN_REMOVED_DRIFT` times the largest speed. Velocities relative to the
    centre of mass keep their digits, even if the balls become very slow.
    """
    n, momentum, low, mass, fastest = len(bodies) - 1, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        momentum, low = add_compensated(momentum, low, bodies[i].mass * bodies[i].fall_velocity)
        mass += bodies[i].mass
        fastest = max(fastest, abs(bodies[i].fall_velocity))
    mean = (momentum + low) / mass
    for i in range(n):
        if abs(mean) > MIN_REMOVED_DRIFT * fastest:
            bodies[i].fall_velocity -= mean
    copy_ball(bodies[n], bodies[0])
