"""Pieces of the motion, and the first event within a piece.

The overlap and its rate of a pair in an island are polynomials in τ, valid until the next event: a piece. All other
pairs are in free flight, in closed form. An event is the first root of a polynomial, found by certified root isolation.
The clock of a block is its absolute time in s as the sum of two floats, t + tail. A piece maps τ to the time (hτ)^q in
s after that clock. The field `clock` of a record in the pool is not a time but this exponent q.

The mode of a pair determines which events can end it. Here φ = kξ^s + γξ̇ is the bracket of the force F = ξ^d φ:

| mode of the pair    | event  | meaning                                         | zero crossing      |
|---------------------|--------|-------------------------------------------------|--------------------|
| open                | BEGIN  | the balls touch                                 | ξ upwards          |
| active              | END    | the force falls to zero while the balls overlap | φ downwards        |
|                     | PART   | elastic law: overlap and force vanish together  | ξ downwards        |
| residual            | BEGIN  | the force becomes positive again                | φ upwards          |
|                     | PART   | the balls separate                              | ξ downwards        |
| active, with memory | TURN   | unloading begins                                | ξ̇ downwards        |
|                     | RELOAD | the overlap exceeds its maximum so far          | ξ - ξ_peak upwards |
| dormant             | BEGIN  | the force exceeds its rounding error            | ξ - wake upwards   |
|                     | PART   | the balls separate                              | ξ downwards        |

A dormant pair touches at rest. `contacts` describes the transition at each event.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import time_to_contact
from granular._engine.kernels import DRIVEN, HUNG, kernel
from granular._engine.roots import first_up_crossing
from granular.md.located.numbering import wrapped_number
from granular.md.located.records import (
    ACTIVE,
    BEGIN,
    DORMANT,
    EDGE,
    ELASTIC,
    END,
    LINEAR,
    NOTHING,
    OPEN,
    PART,
    RESIDUAL,
    SERIES_ORDER,
)
from granular.md.located.walls import free_flight, next_touch, touching_rate

DRIFT_NOISE_FACTOR = 4.0
"""Closing speed below which two balls count as moving together, in units of noise.

The noise of a pair is the bound of the rounding errors in the rate of its overlap, in m/s."""
INTEGER_RECIPROCALS = (0.0, *(1.0 / n for n in range(1, SERIES_ORDER + 5)))
"""Reciprocals 1/n at index n, for integrals of polynomials. Entry 0 is never used."""
FLOAT_SPACING = 2.0**-52
"""Relative spacing of double-precision floats."""
SEPARATION_WAKE_FACTOR = 1e4
"""Gap at which a pair at rest counts as separated, in units of its overlap `wake`.

At `wake` a dormant pair becomes active. A gap is needed because the first forces on its neighbours are far below
rounding error and can have either sign."""
NEAR_SEPARATION_SHARE = 0.1
"""Fraction of its initial overlap below which a pair has almost separated."""
ROUNDING_OVERLAP_SHARE = 1e-15
"""Fraction of its typical overlap below which a pair counts as separated.

A smaller overlap is rounding error."""


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return a + b as its rounded value and the rounding error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def advance_clock(block: Any, dt: float) -> None:
    """Advance the clock t + tail of a block or body by `dt` in s.

    The tail keeps the digits that a single float would lose, so that gaps are equally accurate at late times.
    """
    block.t, block.tail = two_sum(block.t, dt + block.tail)


@kernel
def time_since(block: Any, t: float, tail: float) -> float:
    """Return the time in s from the clock of a record to the time t + tail.

    `block` is the record of a block, pair or body.
    """
    dt: float = (t - block.t) + (tail - block.tail)
    return dt


@kernel
def in_contact(pair: Any, t: float, tail: float) -> bool:
    """Return whether a pair outside the islands overlaps at the time t + tail.

    Such a pair is in a contact that was solved as one event, or in the residual phase after this contact.
    """
    return bool(pair.slot < 0 and pair.lasts > 0.0 and time_since(pair, t, tail) < 0.0)


@kernel
def elapsed_time(h: float, q: int, tau: float) -> float:
    """Return (hτ)^q: the time in s from the start of a piece to τ."""
    u = h * tau
    t = u
    for _ in range(1, q):
        t *= u
    return t


@kernel
def piece_time(block: Any) -> float:
    """Return the duration in s of the current piece of a block.

    A piece that ends at an EDGE of the path of a driven wall lasts exactly `block.holds`.
    """
    if DRIVEN and block.event == EDGE:
        return float(block.holds)
    return elapsed_time(block.h, block.clock, block.tau)


@kernel
def tau_at(block: Any, t: float, tail: float) -> float:
    """Return the τ of the current piece of a block at the time t + tail.

    The result is 0 before the piece and at most the τ of its end.
    """
    dt = time_since(block, t, tail)
    if dt <= 0.0 or block.tau == 0.0:
        return 0.0
    if block.h == 0.0:  # shorter than the spacing of floats
        return float(block.tau)
    return float(min(block.tau, power(dt, 1.0 / block.clock) / block.h))


@kernel
def power(x: float, alpha: float) -> float:
    """Return x^α for x ≥ 0, by square roots where possible."""
    if alpha == 1.0:
        return x
    if alpha == 0.5:
        return math.sqrt(x)
    if alpha == 1.5:
        return x * math.sqrt(x)
    if alpha == 0.25:
        return math.sqrt(math.sqrt(x))
    return math.pow(x, alpha)


@kernel
def value(row: Any, tau: float) -> float:
    """Return the value Σ row_j τ^j of a polynomial at τ.

    Even and odd powers are summed separately: two short chains of operations are faster than one long chain.
    """
    square = tau * tau
    even, odd = row[SERIES_ORDER], 0.0
    for j in range(SERIES_ORDER - 1, 0, -2):
        odd = odd * square + row[j]
        even = even * square + row[j - 1]
    out: float = even + odd * tau
    return out


@kernel
def integral(row: Any, q: int, tau: float) -> float:
    """Return ∫ Σ row_j τ^j q τ^(q-1) dτ from 0 to τ.

    Multiplied by h^q, it is the integral over the time (hτ)^q.
    """
    square = tau * tau
    even, odd = row[SERIES_ORDER] * INTEGER_RECIPROCALS[SERIES_ORDER + q], 0.0
    for j in range(SERIES_ORDER - 1, 0, -2):
        odd = odd * square + row[j] * INTEGER_RECIPROCALS[j + q]
        even = even * square + row[j - 1] * INTEGER_RECIPROCALS[j - 1 + q]
    total = even + odd * tau
    for _ in range(q):
        total *= tau
    return float(q * total)


@kernel
def direction(x: Any) -> float:
    """Return the first non-zero coefficient after x_0 of an overlap series, or 0.

    Its sign is the direction in which a pair at rest starts to move: positive if the balls are pressed together. (The
    coefficient of highest order can vanish by parity.)
    """
    for j in range(1, SERIES_ORDER + 1):
        if x[j] != 0.0:
            return float(x[j])
    return 0.0


@kernel
def write_flight(pair: Any, h: float, push: float, force: float) -> None:
    """Write the piece of a pair with constant force and constant acceleration.

    `h` is the scale of the piece in s, where t = hτ (q = 1). `push` is the acceleration of the overlap in m/s²,
    and `force` the force in N.
    """
    for j in range(SERIES_ORDER + 1):
        pair.x[j], pair.e[j], pair.f[j], pair.g[j] = 0.0, 0.0, 0.0, 0.0
    pair.x[0], pair.x[1], pair.x[2] = pair.xi, h * pair.eta, 0.5 * h * h * push
    pair.e[0], pair.e[1], pair.f[0], pair.g[0] = pair.eta, h * push, force, force


@kernel
def predict_flight(pair: Any, law: Any, field: Any) -> None:
    """Compute the next event of a pair in free flight: `event`, `wait` and `due`.

    The event is BEGIN or, for a residual pair, possibly PART. `wait` is the time in s from the clock of the pair, `due`
    the absolute time. `law` is the record of the law of the pair, `field` the record of driven walls or pendula.

    After contacts, the rate of balls that move together is a rounding error instead of zero. A closing rate of at most
    `DRIFT_NOISE_FACTOR` times its noise is therefore set to zero: such balls would meet again after about 1e12 s.
    """
    if HUNG and pair.pull == 0.0 and 0.0 < pair.eta <= DRIFT_NOISE_FACTOR * pair.noise and pair.xi == 0.0:
        pair.eta = 0.0
    if HUNG or (DRIVEN and pair.wall > 0):
        pair.wait, pair.event = next_touch(field, pair), BEGIN
        pair.due = pair.t + (pair.wait + pair.tail)
        return
    if pair.mode == OPEN and pair.pull == 0.0 and 0.0 < pair.eta <= DRIFT_NOISE_FACTOR * pair.noise:
        pair.eta = 0.0
    wait, event = time_to_contact(max(0.0, -pair.xi), -pair.eta, pair.pull), BEGIN
    if pair.mode == RESIDUAL:
        # the overlap vanishes like a gap with opposite signs
        wait, event = time_to_contact(pair.xi, pair.eta, -pair.pull), PART
        return_time = force_return_time(pair, law) if law.s == 1.0 else math.inf
        if return_time < wait:
            wait, event = return_time, BEGIN
    pair.wait, pair.event = wait, event
    pair.due = pair.t + (wait + pair.tail)


@kernel
def force_return_time(pair: Any, law: Any) -> float:
    """Return the time in s until φ = kξ + γη of a clipped pair increases to zero.

    The law has s = 1. In free flight -φ has a constant acceleration, so the formula for a closing gap applies. The
    result is inf if φ stays negative.
    """
    phi = 0.0 if pair.exact else law.k * pair.xi + law.gamma * pair.eta
    rise = law.k * pair.eta + law.gamma * pair.pull
    return time_to_contact(max(0.0, -phi), -rise, law.k * pair.pull)


@kernel
def advance_flight_forward(pair: Any, dt: float, field: Any) -> None:
    """Advance a pair in free flight by `dt` in s. A negative `dt` is ignored."""
    if dt > 0.0:
        advance_flight(pair, dt, field)


@kernel
def advance_flight(pair: Any, dt: float, field: Any) -> None:
    """Advance a pair in free flight by `dt` in s.

    A negative `dt` follows the asymptote of the pair: the free motion after a contact, continued back into this
    contact.
    """
    pair.xi, pair.eta = free_flight(field, pair, dt)
    pair.exact = 0
    advance_clock(pair, dt)


@kernel
def advance_flight_to_event(pair: Any, field: Any) -> None:
    """Advance a pair in free flight to its next event.

    An open pair then has exactly ξ = 0. Its rate is computed from its state and not from the rounded time.
    """
    if pair.mode == OPEN:
        pair.eta = touching_rate(field, pair, pair.wait)
        pair.xi = 0.0
        advance_clock(pair, pair.wait)
    else:
        advance_flight_forward(pair, pair.wait, field)


@kernel
def locate_event(pairs: Any, pool: Any, lo: int, hi: int, span: float, scratch: Any, laws: Any) -> None:
    """Find the first event of the pairs lo … hi-1 of a block on τ in [0, span].

    The piece ends at that event, or at `span` without an event. `tau`, `event` and `fired` (the pair, or -1) of the
    block are set. `laws` is the `Collocation` of general laws, or None.
    """
    block = pool[pairs[lo].slot]
    block.tau, block.fired, block.event = span, -1, NOTHING
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        # only an event before the earliest one so far matters: the interval shrinks from pair to pair
        tau, event = next_event(pair, block.tau, scratch, laws)
        if tau <= block.tau:
            block.tau, block.fired, block.event = tau, wrapped_number(pairs, c), event
            if tau == 0.0:  # no event can be earlier
                return
        if laws is None:
            tau, event = turning_point(pair, block.tau, scratch)
            if tau < block.tau:
                block.tau, block.fired, block.event = tau, wrapped_number(pairs, c) if event == PART else -1, event


@kernel
def turning_point(pair: Any, span: float, scratch: Any) -> tuple[float, int]:
    """Return the τ at which an active pair turns round before it separates, if any.

    Only τ in [0, span] are examined. The second result is the event: PART if the overlap at this τ is a rounding error,
    else NOTHING. Without a turning point whose overlap is small, τ is inf. The caller ends the piece at this τ, because
    the series can be wrong after it. For example, a ball that falls from a touch at rest returns to it with ξ = g (t -
    t0)²/2. Then ξ^1.5 ∝ |t - t0|³, but the series continues as (t - t0)³, and its coefficients do not show the
    difference.
    """
    # the rate has to change from separating to closing within the piece
    if pair.mode != ACTIVE or pair.kind == LINEAR or not (pair.e[0] < 0.0 < value(pair.e, span)):
        return math.inf, NOTHING
    tau = first_up_crossing(pair.e, span, scratch)
    least_overlap = value(pair.x, min(tau, span))
    if least_overlap <= ROUNDING_OVERLAP_SHARE * pair.own_length:
        return tau, PART
    return (tau, NOTHING) if least_overlap < NEAR_SEPARATION_SHARE * pair.x[0] else (math.inf, NOTHING)


@kernel
def next_event(pair: Any, span: float, scratch: Any, laws: Any) -> tuple[float, int]:
    """Return the τ of the first event of a pair in [0, span], and the event.

    Without an event, τ is inf. `laws` is the `Collocation` of general laws, or None.
    """
    row, separation_gap, wake = pair.g, 0.0, 0.0
    if pair.mode == OPEN:
        return first_up_crossing(pair.x, span, scratch), BEGIN
    if pair.mode == DORMANT:  # linear pairs wake in `activate_pressed`, not at an event
        if pair.kind == LINEAR:
            return math.inf, NOTHING
        row, separation_gap, wake = pair.x, SEPARATION_WAKE_FACTOR * pair.wake, pair.wake
    elif laws is not None:
        return laws.next_event(pair, span, scratch)  # type: ignore[no-any-return]
    elif pair.mode == ACTIVE:
        # a linear pair that has not left the overlap at which it woke separates like a dormant pair
        wake_gap = SEPARATION_WAKE_FACTOR * pair.wake if pair.xi <= pair.wake and pair.kind == LINEAR else 0.0
        if pair.kind == ELASTIC or (pair.kind == LINEAR and pair.gamma == 0.0):
            return shifted_crossing(pair.x, wake_gap, span, scratch, -1.0), PART
        if pair.kind == LINEAR:
            return shifted_crossing(pair.f, pair.k * wake_gap, span, scratch, -1.0), END
        return shifted_crossing(pair.g, 0.0, span, scratch, -1.0), END
    separates_at = shifted_crossing(pair.x, separation_gap, span, scratch, -1.0)
    begins_at = shifted_crossing(row, -wake, min(separates_at, span), scratch, 1.0)
    return (begins_at, BEGIN) if begins_at < math.inf else (separates_at, PART)


@kernel
def shifted_crossing(row: Any, shift: float, span: float, scratch: Any, sign: float) -> float:
    """Return the first τ in [0, span] at which a polynomial plus `shift` crosses zero.

    The crossing is upwards if `sign` is 1 and downwards if `sign` is -1. The result is inf without a crossing.
    """
    first = row[0]
    row[0] = first + shift
    tau: float = first_up_crossing(row, span, scratch, sign)
    row[0] = first
    return tau
