"""Pieces of motion between two events, polynomials in τ for islands, free flight in closed form for all other pairs;
and which event comes first within a piece, located as the first root of a polynomial.

The clock of a block is its absolute time, in two floats; a step maps τ to the time t = (hτ)^q.

| mode     | event                                  | goes through zero |
|----------|----------------------------------------|-------------------|
| open     | BEGIN, the balls touch                 | ξ upwards         |
| active   | END, the force falls to zero           | φ downwards       |
|          | PART (elastic), the balls part         | ξ downwards       |
| residual | BEGIN, the force rises again           | φ upwards         |
|          | PART, the balls part                   | ξ downwards       |
| active, with memory | TURN, unloading begins | ξ̇ downwards |
|          | RELOAD, the old maximum is passed      | ξ - ξ_peak upwards |
| dormant  | BEGIN, the force is no longer rounding | ξ - wake upwards  |
|          | PART, the balls part                   | ξ downwards       |
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import time_to_contact
from granular._engine.kernels import DRIVEN, HUNG, kernel
from granular._engine.roots import first_up_crossing
from granular.md.located.records import (
    ACTIVE,
    BEGIN,
    DAMPED,
    DORMANT,
    EDGE,
    ELASTIC,
    END,
    LINEAR,
    NOTHING,
    OPEN,
    ORDER,
    PART,
    RESIDUAL,
)
from granular.md.located.system import nth
from granular.md.located.walls import flown, next_touch, touching_rate

DRIFT = 4.0
"""Balls that close at less than this many times the noise of their rate are taken to drift along side by side."""
INVERSE = (0.0, *(1.0 / n for n in range(1, ORDER + 5)))
ULP = 2.0**-52
DOUBT = 1e4
"""A pair at rest is taken to part at so many times the overlap at which it wakes: the first forces beside it, far below
rounding, may err to either side."""
ALL_BUT = 0.1
"""Part of its overlap at which a pair that turns round had all but parted."""
CLEAR = 0.999
"""Part of the first slope of a row that the others, which are rounded, may take from it."""
GRAZE = 1e-15
"""Part of the typical overlap at which it has parted, except for rounding."""


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return a + b in two floats (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def tick(block: Any, dt: float) -> None:
    """Advance a clock by `dt`; t + tail keeps what one float would lose, so that no gap suffers from late times."""
    block.t, block.tail = two_sum(block.t, dt + block.tail)


@kernel
def since(block: Any, t: float, tail: float) -> float:
    """Return the time from the block's clock to t + tail."""
    dt: float = (t - block.t) + (tail - block.tail)
    return dt


@kernel
def in_contact(pair: Any, t: float, tail: float) -> bool:
    """Return whether a pair outside the islands is in a contact, or its run-off, at the time t + tail."""
    return bool(pair.slot < 0 and pair.lasts > 0.0 and since(pair, t, tail) < 0.0)


@kernel
def elapsed(h: float, q: int, tau: float) -> float:
    """Return the time (hτ)^q into a step."""
    u = h * tau
    t = u
    for _ in range(1, q):
        t *= u
    return t


@kernel
def piece_time(block: Any) -> float:
    """Return how long the piece of a block takes; at an EDGE to the last digit."""
    if DRIVEN and block.event == EDGE:
        return float(block.holds)
    return elapsed(block.h, block.clock, block.tau)


@kernel
def tau_at(block: Any, t: float, tail: float) -> float:
    """Return the τ that a piece has reached at the time t + tail, at most its end."""
    dt = since(block, t, tail)
    if dt <= 0.0 or block.tau == 0.0:
        return 0.0
    if block.h == 0.0:  # less than a float can tell
        return float(block.tau)
    return float(min(block.tau, power(dt, 1.0 / block.clock) / block.h))


@kernel
def power(x: float, alpha: float) -> float:
    """Return x^α for x ≥ 0, by square roots where they do."""
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
    """Return Σ row_j τ^j; even and odd powers apart, which are two short chains of operations instead of a long one."""
    square = tau * tau
    even, odd = row[ORDER], 0.0
    for j in range(ORDER - 1, 0, -2):
        odd = odd * square + row[j]
        even = even * square + row[j - 1]
    out: float = even + odd * tau
    return out


@kernel
def integral(row: Any, q: int, tau: float) -> float:
    """Return ∫ Σ row_j τ^j q τ^(q-1) dτ, to be multiplied by h^q."""
    square = tau * tau
    even, odd = row[ORDER] * INVERSE[ORDER + q], 0.0
    for j in range(ORDER - 1, 0, -2):
        odd = odd * square + row[j] * INVERSE[j + q]
        even = even * square + row[j - 1] * INVERSE[j - 1 + q]
    total = even + odd * tau
    for _ in range(q):
        total *= tau
    return float(q * total)


@kernel
def direction(x: Any) -> float:
    """Return the first coefficient that is not zero: where a pair at rest goes. (The last may vanish by parity.)"""
    for j in range(1, ORDER + 1):
        if x[j] != 0.0:
            return float(x[j])
    return 0.0


@kernel
def peaks(pair: Any, tau: float, scratch: Any) -> None:
    """Raise the largest overlap and force to those of a piece at whose end the pair is; its g is scratch from now on.

    A force that does not depend on the rate is largest where the overlap is, and the law says it better than a series
    far below the scale of its island. In a piece so short that a force of ξ^(1/4) hardly counts no series need hold:
    no more than the law allows.
    """
    deepest = max(float(pair.x[0]), float(pair.xi))
    if pair.e[0] > 0.0 > pair.eta or heading(pair.x, tau) == 0.0:
        for j in range(ORDER + 1):
            pair.g[j] = pair.e[j]
        deepest = max(deepest, summit(pair.x, pair.g, tau, scratch))
    pair.xi_max = max(pair.xi_max, deepest)
    xi = max(0.0, deepest)
    if pair.kind == ELASTIC:
        pair.force_max = max(pair.force_max, pair.k * power(xi, pair.p))
        return
    way = heading(pair.f, tau)
    force = float(pair.f[0]) if way < 0.0 else max(float(pair.f[0]), value(pair.f, tau))
    if way == 0.0:
        pair.g[ORDER] = 0.0
        for j in range(ORDER):
            pair.g[j] = (j + 1) * pair.f[j + 1]
        force = max(force, summit(pair.f, pair.g, tau, scratch))
    if pair.kind == DAMPED:
        rate = max(abs(pair.e[0]), abs(pair.eta))
        force = min(force, 2.0 * (pair.k * power(xi, pair.p) + pair.gamma * power(xi, pair.d) * rate))
    pair.force_max = max(pair.force_max, force)


@kernel
def heading(row: Any, tau: float) -> float:
    """Return 1 if a row rises all the way from 0 to τ, -1 if it falls, 0 if a bound of its slope does not tell."""
    way, against = 1.0 if row[1] > 0.0 else -1.0, 0.0
    for j in range(ORDER, 1, -1):
        slope = way * row[j]
        against = (against + j * slope if slope < 0.0 else against) * tau
    return way if CLEAR * (way * row[1]) + against > 0.0 else 0.0


@kernel
def summit(row: Any, rate: Any, tau: float, scratch: Any) -> float:
    """Return the largest value at which a row turns down before τ, or -inf; `rate`, its slope in sign, is used up."""
    at, best, way, steady = 0.0, -math.inf, -1.0 if rate[0] > 0.0 else 1.0, heading(rate, tau)
    for _ in range(ORDER):
        step = first_up_crossing(rate, tau - at, scratch, way)
        if not at + step < tau:
            break
        at += step
        if way < 0.0:
            best = max(best, value(row, at))
        if steady == way:  # it turns once
            break
        for first in range(ORDER - 1, -1, -1):  # let it begin here: Horner's scheme, its columns one after the other
            for j in range(first, ORDER):
                rate[j] += rate[j + 1] * step
        rate[0], way = 0.0, -way
    return best


@kernel
def write_flight(pair: Any, h: float, push: float, force: float) -> None:
    """Write the piece of a pair of constant force that closes at a constant acceleration `push`, on the plain clock."""
    for j in range(ORDER + 1):
        pair.x[j], pair.e[j], pair.f[j], pair.g[j] = 0.0, 0.0, 0.0, 0.0
    pair.x[0], pair.x[1], pair.x[2] = pair.xi, h * pair.eta, 0.5 * h * h * push
    pair.e[0], pair.e[1], pair.f[0], pair.g[0] = pair.eta, h * push, force, force


@kernel
def predict(pair: Any, law: Any, field: Any) -> None:
    """Plan the flight of a free pair, a block of its own, to its next event.

    Contacts leave rates of rounding where the exact ones are zero: balls that stay together would meet again after
    some 1e12 s.
    """
    if HUNG and pair.pull == 0.0 and 0.0 < pair.eta <= DRIFT * pair.noise and pair.xi == 0.0:
        pair.eta = 0.0
    if HUNG or (DRIVEN and pair.wall > 0):
        pair.wait, pair.event = next_touch(field, pair), BEGIN
        pair.due = pair.t + (pair.wait + pair.tail)
        return
    if pair.mode == OPEN and pair.pull == 0.0 and 0.0 < pair.eta <= DRIFT * pair.noise:
        pair.eta = 0.0
    wait, what = time_to_contact(max(0.0, -pair.xi), -pair.eta, pair.pull), BEGIN
    if pair.mode == RESIDUAL:
        wait, what = time_to_contact(pair.xi, pair.eta, -pair.pull), PART
        again = force_returns(pair, law) if law.s == 1.0 else math.inf
        if again < wait:
            wait, what = again, BEGIN
    pair.wait, pair.event = wait, what
    pair.due = pair.t + (wait + pair.tail)


@kernel
def force_returns(pair: Any, law: Any) -> float:
    """Return the time until φ = kξ + γη of a clipped pair rises to zero: -φ falls like a gap."""
    phi = 0.0 if pair.exact else law.k * pair.xi + law.gamma * pair.eta
    rise = law.k * pair.eta + law.gamma * pair.pull
    return time_to_contact(max(0.0, -phi), -rise, law.k * pair.pull)


@kernel
def glide(pair: Any, dt: float, field: Any) -> None:
    """Advance a free pair by `dt`, if that is positive."""
    if dt > 0.0:
        fly(pair, dt, field)


@kernel
def fly(pair: Any, dt: float, field: Any) -> None:
    """Advance a free pair by `dt`; to go back is to trace its asymptote."""
    pair.xi, pair.eta = flown(field, pair, dt)
    pair.exact = 0
    tick(pair, dt)


@kernel
def arrive(pair: Any, field: Any) -> None:
    """Advance a free pair to its event: exactly there, with the rate it has from the state, not from the time."""
    if pair.mode == OPEN:
        pair.eta = touching_rate(field, pair, pair.wait)
        pair.xi = 0.0
        tick(pair, pair.wait)
    else:
        glide(pair, pair.wait, field)


@kernel
def locate(pairs: Any, pool: Any, lo: int, hi: int, span: float, scratch: Any, laws: Any) -> None:
    """Find the event that ends the piece of block lo … hi-1 on τ in [0, span]; it ends at `span` if there is none."""
    block = pool[pairs[lo].slot]
    block.tau, block.fired, block.event = span, -1, NOTHING
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        tau, what = next_event(pair, block.tau, scratch, laws)
        if tau <= block.tau:
            block.tau, block.fired, block.event = tau, nth(pairs, c), what
            if tau == 0.0:
                return
        if laws is None:
            tau, what = rebound(pair, block.tau, scratch)
            if tau < block.tau:
                block.tau, block.fired, block.event = tau, nth(pairs, c) if what == PART else -1, what


@kernel
def rebound(pair: Any, span: float, scratch: Any) -> tuple[float, int]:
    """Return the τ at which a pair that all but parts turns round, or parts by rounding; inf if it does neither.

    There its series has to end: a ball that falls from a touch at rest comes back to it with ξ = g (t - t0)²/2, and
    ξ^1.5 ∝ |t - t0|³ goes on as (t - t0)³, with no sign of it in the coefficients.
    """
    if pair.mode != ACTIVE or pair.kind == LINEAR or not (pair.e[0] < 0.0 < value(pair.e, span)):
        return math.inf, NOTHING
    tau = first_up_crossing(pair.e, span, scratch)
    least = value(pair.x, min(tau, span))
    if least <= GRAZE * pair.own_length:
        return tau, PART
    return (tau, NOTHING) if least < ALL_BUT * pair.x[0] else (math.inf, NOTHING)


@kernel
def next_event(pair: Any, span: float, scratch: Any, laws: Any) -> tuple[float, int]:
    """Return the τ of the first event of a pair within [0, span], inf without, and which it is."""
    row, doubt, wake = pair.g, 0.0, 0.0
    if pair.mode == OPEN:
        return first_up_crossing(pair.x, span, scratch), BEGIN
    if pair.mode == DORMANT:  # pressed enough to wake, or parted; linear ones never sleep
        if pair.kind == LINEAR:
            return math.inf, NOTHING
        row, doubt, wake = pair.x, DOUBT * pair.wake, pair.wake
    elif laws is not None:
        return laws.next_event(pair, span, scratch)  # type: ignore[no-any-return]
    elif pair.mode == ACTIVE:
        asleep = DOUBT * pair.wake if pair.xi <= pair.wake and pair.kind == LINEAR else 0.0
        if pair.kind == ELASTIC or (pair.kind == LINEAR and pair.gamma == 0.0):
            return shifted(pair.x, asleep, span, scratch, -1.0), PART
        if pair.kind == LINEAR:
            return shifted(pair.f, pair.k * asleep, span, scratch, -1.0), END
        return shifted(pair.g, 0.0, span, scratch, -1.0), END
    parts = shifted(pair.x, doubt, span, scratch, -1.0)
    again = shifted(row, -wake, min(parts, span), scratch, 1.0)
    return (again, BEGIN) if again < math.inf else (parts, PART)


@kernel
def shifted(row: Any, by: float, span: float, scratch: Any, way: float) -> float:
    """Return the first τ where a row, shifted by so much, goes up through zero (`way` 1) or down (-1); inf without."""
    first = row[0]
    row[0] = first + by
    tau: float = first_up_crossing(row, span, scratch, way)
    row[0] = first
    return tau

