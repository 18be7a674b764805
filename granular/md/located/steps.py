"""How long a step is, and on which clock.

*Linear blocks*: the series of the step converges like that of exp(λh), λ = ½ (b + √(b² + 4a)) with a, b the largest
absolute row sums of M⁻¹K and M⁻¹C over the touching pairs; λh = `REACH` leaves (λh)^(N+1)/(N+1)! = 1e-17.

*Others*: h is only a scale. The coefficients themselves say how far they may be trusted, θ = tol^(1/N) / a with
a = max_j A_j^(1/j) and A_j the largest |ξ_j|/X, |η_j|/V, and of clipped pairs |φ_j|/(k X^s), of the block, with
each pair's own X and V: a slow contact beside a fast one is to be as good. The maximum
is over the last six orders j, and over more where a contact begins: its series is lacunary, F = k ξ^p has terms of
orders q(p+1), 2q(p+1), … only, and the last of them must be seen. Left out is less than (aτ)^(N+1) / (1 - aτ).
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.clock import elapsed, root
from granular.md.located.flight import DRIFT
from granular.md.located.powers import power
from granular.md.located.records import ACTIVE, DAMPED, DORMANT, GENERAL, LINEAR, OPEN, ORDER, RESIDUAL, STEEPEST

REACH = (math.factorial(ORDER + 1) * 1e-17) ** (1.0 / (ORDER + 1))
FURTHEST = 8.0
"""A step reaches at most this many times the scale it was computed with."""
FAR = 1e9
"""The scale of a step is at most so many times the time for which a contact has lasted: 1e9^20 is a number."""
JUST = 1e-15
"""Overlap, as a part of the typical one, below which a closing pair has only just touched: what an event elsewhere in
the block, located to rounding, leaves of a touch at the same instant."""
SHALLOW = 0.1
"""Part of its typical overlap below which a pair's force may be about to grow by many orders."""
DORMANCY = 1e-17
"""A pair that touches at rest, or on a clock that does not suit it, sleeps up to this part of the typical overlap."""


@kernel
def is_linear(pairs: Any, pool: Any, lo: int, hi: int) -> bool:
    """Return whether no other than linear laws are at work in the block."""
    for c in range(lo, hi):
        if pool[pairs[c].slot].mode != OPEN and pool[pairs[c].slot].kind != LINEAR:
            return False
    return True


@kernel
def fastest_rate(pairs: Any, pool: Any, lo: int, hi: int) -> float:
    """Return λ in 1/s, a bound of all rates of the touching pairs of a linear block."""
    a, b, k0, g0 = 0.0, 0.0, 0.0, 0.0
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.mode == OPEN or pair.mode == RESIDUAL:
            k0, g0 = 0.0, 0.0
            continue
        k1, g1 = 0.0, 0.0
        if c + 1 < hi and (pool[pairs[c + 1].slot].mode == ACTIVE or pool[pairs[c + 1].slot].mode == DORMANT):
            k1, g1 = pool[pairs[c + 1].slot].k, pool[pairs[c + 1].slot].gamma
        a = max(a, pair.lower * k0 + pair.inverse * pair.k + pair.upper * k1)
        b = max(b, pair.lower * g0 + pair.inverse * pair.gamma + pair.upper * g1)
        k0, g0 = pair.k, pair.gamma
    return 0.5 * (b + math.sqrt(b * b + 4.0 * a))


@kernel
def measure(pairs: Any, pool: Any, lo: int, hi: int) -> None:
    """Set the block's `speed` V and `length` X, and each pair's own: what its energy amounts to as a rate and overlap.

    V² is the largest η² + 2 w k ξ^(p+1)/(p+1), X the largest ((p+1) V² / (2 k w))^(1/(p+1)), w the inverse m_eff.
    A ball at rest on a floor counts with its static overlap. Open pairs do not count: beside a slow contact a fast
    ball may fly.
    """
    speed, length = 0.0, 0.0
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        stored = 0.0
        if pair.xi > 0.0:
            stored = 2.0 * pair.inverse * pair.k * pair.xi * power(pair.xi, pair.p) / (pair.p + 1.0)
            if pair.kind == GENERAL:  # matched where impacts reach, it may tell little of a ball that comes to rest
                stored = max(stored, 2.0 * pair.pull * pair.xi)
        elif pair.pull > 0.0 and (pair.mode == DORMANT or (pair.mode == ACTIVE and pair.eta <= DRIFT * pair.noise)):
            stored = 2.0 * pair.pull * power(pair.pull / (pair.k * pair.inverse), 1.0 / pair.p)
        pair.own_speed = math.sqrt(pair.eta * pair.eta + stored)
        if pair.mode != OPEN:
            speed = max(speed, pair.own_speed)
    pass_on(pairs, pool, lo, hi)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.own_speed == 0.0:
            pair.own_speed = speed
        pair.own_length = amplitude(pair, pair.own_speed * pair.own_speed)
        if pair.mode != OPEN:
            length = max(length, amplitude(pair, speed * speed))
    block = pool[pairs[lo].slot]
    block.speed, block.length = speed, length


@kernel
def pass_on(pairs: Any, pool: Any, lo: int, hi: int) -> None:
    """Let pairs count with the speed that a neighbour may give them: 2 m_eff/m of its own, m the ball between them."""
    for c in range(lo + 1, hi):
        pair, below = pool[pairs[c].slot], pool[pairs[c - 1].slot]
        if below.mode != OPEN:
            pair.own_speed = max(pair.own_speed, min(1.0, 2.0 * pair.lower / below.inverse) * below.own_speed)
    for c in range(hi - 2, lo - 1, -1):
        pair, above = pool[pairs[c].slot], pool[pairs[c + 1].slot]
        if above.mode != OPEN:
            pair.own_speed = max(pair.own_speed, min(1.0, 2.0 * pair.upper / above.inverse) * above.own_speed)


@kernel
def amplitude(pair: Any, square: float) -> float:
    """Return the overlap in m at which the pair alone would stop from a squared rate `square` in m²/s²."""
    return power((pair.p + 1.0) * square / (2.0 * pair.k * pair.inverse), 1.0 / (pair.p + 1.0))


@kernel
def choose_clock(pairs: Any, pool: Any, lo: int, hi: int) -> int:
    """Return q of the clock t = (hτ)^q: 1, or that of pairs just touched; those it does not suit go dormant."""
    q = 1
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if needs_clock(pair) and q % pair.q != 0:
            if pair.q % q == 0:
                q = pair.q
            else:
                pair.mode = DORMANT
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if needs_clock(pair) and (q * pair.p > STEEPEST or pair.eta <= DRIFT * pair.noise):
            pair.mode = DORMANT
        if pair.mode == ACTIVE and pair.kind != LINEAR and pair.kind != GENERAL and pair.eta > 0.0 and pair.xi > 0.0:
            deepest = pair.own_length
            if pair.xi < JUST * deepest and q % pair.q == 0 and q * pair.p <= STEEPEST:
                pair.xi = 0.0
            elif pair.xi < 0.5 * DORMANCY * deepest:
                pair.mode = DORMANT
        if pair.mode == DORMANT:
            pair.wake = DORMANCY * pair.own_length
    return q


@kernel
def needs_clock(pair: Any) -> bool:
    """Return whether the pair has just been touched and its power series needs a clock of its own."""
    return bool(pair.mode == ACTIVE and pair.xi == 0.0 and pair.kind != LINEAR and pair.kind != GENERAL)


@kernel
def scale(block: Any, q: int) -> float:
    """Return the h with which the coefficients of a nonlinear block are computed."""
    if q == 1 and block.stride > 0.0:
        h: float = block.stride
        return h
    return root(0.2 * block.length / block.speed, q) if block.speed > 0.0 else 1.0


@kernel
def within_range(pairs: Any, pool: Any, lo: int, hi: int, h: float) -> float:
    """Return h, or less if powers of h over the time a contact lasts at its rate or pull would leave the range."""
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE and pair.kind != LINEAR and pair.kind != GENERAL and pair.xi > 0.0:
            if pair.eta != 0.0:
                h = min(h, FAR * pair.xi / abs(pair.eta))
            if pair.pull != 0.0:
                h = min(h, FAR * math.sqrt(pair.xi / abs(pair.pull)))
    return h


@kernel
def growth(pairs: Any, pool: Any, lo: int, hi: int, tol: float) -> float:
    """Return ln a, the growth of the computed coefficients per order; -inf if there are none."""
    block, first, worst = pool[pairs[lo].slot], ORDER - 5, -math.inf
    for c in range(lo, hi):
        first = min(first, last_sure_order(pool[pairs[c].slot], block.clock))
    for j in range(first, ORDER + 1):
        largest = 0.0
        for c in range(lo, hi):
            pair = pool[pairs[c].slot]
            largest = max(largest, abs(pair.x[j]) / pair.own_length, abs(pair.e[j]) / pair.own_speed)
        if largest > 0.0:
            worst = max(worst, math.log(largest) / j)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if has_lone_term(pair, block.clock):
            worst = max(worst, growth_of_power(pair, block.clock))
        elif is_shallow(pair):
            worst = max(worst, growth_of_overlap(pair))
        if pair.mode == ACTIVE and pair.kind == DAMPED and pair.s < 1.0 and pair.x[0] > 0.0:
            worst = max(worst, growth_of_bracket(pair))
        if pair.mode == RESIDUAL and pair.s != 1.0:
            if stays_clipped(pair, trusted(worst, tol)):
                pair.g[0] = -1.0
                for j in range(1, ORDER + 1):
                    pair.g[j] = 0.0
            else:
                worst = max(worst, growth_of_bracket(pair))
    return worst


@kernel
def has_lone_term(pair: Any, q: int) -> bool:
    """Return whether no more than one order of the force of a contact just touched is in the series."""
    just_touched = pair.mode == ACTIVE and pair.x[0] == 0.0 and pair.x[q] > 0.0 and pair.kind != LINEAR
    return bool(just_touched and 2.0 * q * (pair.p + 1.0) > ORDER)


@kernel
def is_shallow(pair: Any) -> bool:
    """Return whether the orders that the force of a pair has now may lie far below those that it will soon have."""
    lifts = pair.mode == ACTIVE and pair.kind != LINEAR and pair.kind != GENERAL
    return bool(lifts and 0.0 < pair.x[0] < SHALLOW * pair.own_length)


@kernel
def growth_of_overlap(pair: Any) -> float:
    """Return ln a of ξ/X in all its orders: then the products of orders that F = k ξ^p leaves out are left out rightly.

    A pair that turns round with ξ = 0 and η = 0 goes on with ξ ∝ τ², and a force ∝ τ^(2p) that no order need show.
    """
    worst = -math.inf
    for j in range(1, ORDER + 1):
        if pair.x[j] != 0.0:
            worst = max(worst, math.log(abs(pair.x[j]) / pair.own_length) / j)
    return worst


@kernel
def growth_of_power(pair: Any, q: int) -> float:
    """Return ln a of y in ξ = τ^q y, relative to its first order: y^p is a power series up to where y is zero.

    One order of the force cannot tell; a ball that touches almost at rest is soon moved by gravity alone.
    """
    worst = -math.inf
    for j in range(1, ORDER + 1 - q):
        if pair.x[q + j] != 0.0:
            worst = max(worst, math.log(abs(pair.x[q + j]) / pair.x[q]) / j)
    return worst


@kernel
def growth_of_bracket(pair: Any) -> float:
    """Return ln a of the coefficients of φ = k ξ^s + γη."""
    worst, size = -math.inf, pair.k * power(pair.own_length, pair.s)
    for j in range(ORDER - 5, ORDER + 1):
        if pair.g[j] != 0.0:
            worst = max(worst, math.log(abs(pair.g[j]) / size) / j)
    return worst


@kernel
def stays_clipped(pair: Any, theta: float) -> bool:
    """Return whether φ = k ξ^s + γη is negative up to θ: by bounds of ξ and η, for φ is singular where ξ is zero."""
    xi, eta, t = pair.x[0], pair.e[0], 1.0
    for j in range(1, ORDER + 1):
        t *= theta
        xi += max(0.0, pair.x[j] * t)
        eta += max(0.0, pair.e[j] * t)
    return bool(pair.k * power(xi, pair.s) + pair.gamma * eta < 0.0)


@kernel
def last_sure_order(pair: Any, q: int) -> int:
    """Return the highest order that the rate of a contact just touched is sure to have."""
    if pair.mode != ACTIVE or pair.x[0] != 0.0 or pair.kind == LINEAR:
        return ORDER
    period = int(q * (pair.p + 1.0) + 0.5)
    return ORDER // period * period


@kernel
def trusted(worst: float, tol: float) -> float:
    """Return the θ up to which coefficients that grow by ln a = `worst` hold to `tol`."""
    return math.exp(min(math.log(FURTHEST), math.log(tol) / ORDER - worst))


@kernel
def left_out(worst: float, tau: float) -> float:
    """Return what the piece leaves out up to τ, as a part of its speed."""
    ratio = tau * math.exp(worst)
    return elapsed(ratio, ORDER + 1, 1.0) / max(0.5, 1.0 - ratio)
