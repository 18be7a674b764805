"""A closer look at a few neighbours: the same physics in relative gaps and rates, exact down to 1e-200.

Velocities of bodies lose a relative velocity of 1e-16 of theirs; rates of gaps do not. So what looks like an inelastic
collapse in velocities is decided in rates: `zoom` goes on with pairs `first` … `first + len(gap) - 1` alone until
something outside is about to happen, and nothing in it is approximated.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, rate_at_contact, time_to_contact
from granular._kernels import kernel
from granular.edmd.motion import Floats, Ints
from granular.edmd.ties import GROUP, rank

LIMIT, UNTIL, BUDGET, OUTSIDE, QUIET, RESTS, TINY, SPENT = range(8)
"""Why a zoom returns. To go on when called again: the time or the number of events asked for is reached, or the contact
to stop at is next. For good: something outside the slice comes next; no collapse; a ball comes to rest on a wall; rates
below 2^-200 of the scale; no decision within the allowance."""


@kernel
def zoom(
    first: int,
    gap: Floats,
    rate: Floats,
    dial: Floats,
    room: float,
    limit: float,
    allowance: int,
    budget: int,
    scale: tuple[float, float],
    stop: tuple[int, int],
    pull: Floats,
    low: Floats,
    high: Floats,
    m_eff: Floats,
    eps: Floats,
    rule: Any,
    tie: tuple[int, int],
    hits: Ints,
    u: Floats,
    falls: Floats,
    base: float,
    g: float,
    log: Any,
) -> tuple[int, int, int]:
    """Advance the slice; return how it ended, the number (in the slice) of the last pair, and events done.

    `dial` holds the time since `base`, the events so far, how many in a row did not look like a collapse, the number of
    clamps, and how often in a row its speeds were found to count for nothing; `room` is the time until something
    outside happens, `limit` until when to go, `scale` the speed and the interval that look like a collapse.
    """
    n = len(gap)
    done, last = 0, 0
    while True:
        j, dt = soonest(first, gap, rate, pull, tie, hits)
        if dt == math.inf:
            return QUIET, last, done
        c = first + j
        guard = (j == 0 and first > 0) or (j == n - 1 and c + 1 < len(pull))
        group = tie[0] == GROUP and touches(j, first, dt, gap, rate, pull)
        if guard or group or not dial[0] + dt < room:
            return OUTSIDE, last, done
        if dial[1] >= allowance:
            return SPENT, last, done
        if dial[0] + dt > limit:
            return LIMIT, last, done
        if c == stop[0] and hits[c] >= stop[1]:
            dial[0] += dt
            return UNTIL, last, done
        if done == budget:
            return BUDGET, last, done
        w = rate_at_contact(gap[j], rate[j], pull[c])
        e = eps[c] if rule is None else rule(c, -w)
        dial[3] += advance(first, dt, gap, rate, pull)
        dial[0] += dt
        dial[1] += 1.0
        jump = (1.0 + e) * w
        bounce(j, first, w, e, gap, rate, low, high)
        tau = base + dial[0]
        if log is not None:
            row = log[done]
            below, above = falls[c] * (g * tau), falls[c + 1] * (g * tau)
            row[0], row[1], row[2], row[3] = c, tau, u[c] - below, u[c + 1] - above
        u[c] += low[c] * jump
        u[c + 1] -= high[c] * jump
        if log is not None:
            row[4], row[5], row[6] = u[c] - below, u[c + 1] - above, -jump * m_eff[c]
        hits[c] += 1
        done += 1
        last = j
        if rule is None and dial[0] + rest_time(j, first, gap, rate, pull, low, e) < min(room, limit):
            return RESTS, last, done
        if rate[j] == 0.0 and pull[c] > 0.0:
            return QUIET, last, done
        if e < 1.0 and -w < math.ldexp(scale[0], -184):
            return TINY, last, done
        dial[2] = dial[2] + 1.0 if -w >= scale[0] and dt >= scale[1] else 0.0
        if dial[2] >= 4 * n:
            return QUIET, last, done


@kernel
def soonest(
    first: int, gap: Floats, rate: Floats, pull: Floats, tie: tuple[int, int], hits: Ints
) -> tuple[int, float]:
    """Return the pair (numbered in the slice) that collides first, and when."""
    best, when = 0, math.inf
    for j in range(len(gap)):
        if rate[j] >= 0.0 and pull[first + j] <= 0.0:
            continue
        dt = time_to_contact(gap[j], rate[j], pull[first + j])
        if dt < when or (dt == when and dt < math.inf and earlier(first + j, first + best, tie, hits)):
            best, when = j, dt
    return best, when


@kernel
def touches(j: int, first: int, dt: float, gap: Floats, rate: Floats, pull: Floats) -> bool:
    """Return whether a neighbour of pair `j` touches after `dt`."""
    for k in range(max(j - 1, 0), min(j + 2, len(gap))):
        if k != j and gap_after(gap[k], rate[k], pull[first + k], dt) <= 0.0:
            return True
    return False


@kernel
def earlier(c: int, d: int, tie: tuple[int, int], hits: Ints) -> bool:
    return rank(c, tie[0], tie[1], hits[c]) < rank(d, tie[0], tie[1], hits[d])


@kernel
def advance(first: int, dt: float, gap: Floats, rate: Floats, pull: Floats) -> int:
    """Move all gaps and rates on by `dt`; return the number of gaps clamped at 0."""
    clamps = 0
    for j in range(len(gap)):
        a = pull[first + j]
        if a == 0.0 and rate[j] == 0.0:
            continue
        d = gap_after(gap[j], rate[j], a, dt)
        if d < 0.0:
            d = 0.0
            clamps += 1
        gap[j] = d
        if a != 0.0:
            rate[j] -= a * dt
    return clamps


@kernel
def bounce(j: int, first: int, w: float, e: float, gap: Floats, rate: Floats, low: Floats, high: Floats) -> None:
    """Let pair `j` of the slice collide at rate `w`: its rate becomes exactly -ε w."""
    jump = (1.0 + e) * w
    gap[j] = 0.0
    rate[j] = -e * w
    if j > 0:
        rate[j - 1] += low[first + j] * jump
    if j + 1 < len(gap):
        rate[j + 1] += high[first + j] * jump


@kernel
def rest_time(j: int, first: int, gap: Floats, rate: Floats, pull: Floats, low: Floats, e: float) -> float:
    """Return after which time the ball that just bounced on a wall (pair `j`) is at rest on it, inf if not certain.

    Alone it bounces infinitely often within 2u/(g(1 - ε)). It stays alone if no other pair of the slice collides
    before, and its neighbour stays above the top of the first arc, which that does if it is so at both ends of the
    time, since it moves on a straight line or falls.
    """
    a = pull[first + j]
    if not (a > 0.0 and low[first + j] == 0.0 and e < 1.0):
        return math.inf
    r = rate[j]
    end: float = 2.0 * r / (a * (1.0 - e))
    for i in range(len(gap)):
        if i != j and i != j + 1 and time_to_contact(gap[i], rate[i], pull[first + i]) <= end:
            return math.inf
    if j + 1 < len(gap):
        arc = r * r / (2.0 * a)
        path = gap_after(gap[j + 1], rate[j + 1] + r, pull[first + j + 1] + a, end)
        if gap[j + 1] <= arc or path <= arc:
            return math.inf
    return end


@kernel
def settle(j: int, first: int, end: float, gap: Floats, rate: Floats, u: Floats, falls: Floats, pull: Floats) -> None:
    """Move the slice on by `end` to the moment when the ball above the wall of pair `j` has come to rest on it."""
    c = first + j
    a = pull[c]
    if j + 1 < len(gap):  # measured from the wall, the neighbour's path knows nothing of the bounces
        gap[j + 1] = gap_after(gap[j + 1], rate[j + 1] + rate[j], pull[c + 1] + a, end)
        rate[j + 1] = (rate[j + 1] + rate[j]) - (pull[c + 1] + a) * end
    for i in range(len(gap)):
        if i != j and i != j + 1:
            gap[i] = gap_after(gap[i], rate[i], pull[first + i], end)
            rate[i] -= pull[first + i] * end
    gap[j] = rate[j] = pull[c] = falls[c + 1] = 0.0
    if c + 1 < len(pull):
        pull[c + 1] += a
    u[c + 1] = u[c]


@kernel
def write_back(
    first: int, new_gap: Floats, rate: Floats, tau: float, mass: Floats, u: Floats, noise: Floats, gap: Floats,
    at: Floats, pull: Floats, streak: Ints,
) -> None:
    """Put the slice back: gaps as they are, velocities as sums of rates from a body that is known.

    That is an end body of the slice which is a wall or belongs to pairs outside too (it has not collided), else the
    centre of mass. The rates are exact, so velocities have no noise but what they cannot hold of them.
    """
    n = len(new_gap)
    top = first + n
    known = first if first > 0 or mass[0] == math.inf else top
    free = known == top and top == len(u) - 1 and mass[top] != math.inf
    before = momentum(first, top, mass, u) if free else 0.0
    for j in range(n):
        c = first + j
        gap[c], at[c], streak[c] = new_gap[j], tau, 0
        if known == first and mass[c + 1] != math.inf:
            u[c + 1] = u[c] + (rate[j] + pull[c] * tau)
            noise[c + 1] = 0.0
    if known == top:
        for j in range(n - 1, -1, -1):
            c = first + j
            u[c] = u[c + 1] - (rate[j] + pull[c] * tau)
            noise[c] = 0.0
    if free:
        total = 0.0
        for i in range(first, top + 1):
            total += mass[i]
        shift = (before - momentum(first, top, mass, u)) / total
        for i in range(first, top + 1):
            u[i] += shift


@kernel
def momentum(first: int, top: int, mass: Floats, u: Floats) -> float:
    """Return Σ m u over bodies `first` … `top`."""
    total = 0.0
    for i in range(first, top + 1):
        total += mass[i] * u[i]
    return total
