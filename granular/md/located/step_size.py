"""Length of a piece, and the exponent q of t = (hτ)^q.

*Linear islands*: the series of a piece converges like the series of exp(λh), λ = ½ (b + √(b² + 4a)). Here a and b are
the largest absolute row sums of M⁻¹K and M⁻¹C over the touching pairs, with Ω² of pendula in a. λh =
`LINEAR_STEP_REACH` leaves (λh)^(N+1)/(N+1)! = 1e-17, where N = 20 is the order of the series.

*Other islands*: h is only a scale. The coefficients determine up to which θ in τ the series is valid: θ = tol^(1/N) / a
with a = max_j A_j^(1/j). A_j is the largest coefficient |ξ_j|/X and |η_j|/V of any pair of the island, and |φ_j|/(k
X^s) of clipped pairs. Each pair has its own typical overlap X and speed V, so that a slow contact next to a fast one is
equally accurate.

The maximum is taken over the last six orders j, and over more orders where a contact begins. There most coefficients
are zero: F = k ξ^p has terms of orders q(p+1), 2q(p+1), … only, and the last of them must be included. The omitted
terms are less than (aτ)^(N+1) / (1 - aτ).
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import time_to_contact
from granular._engine.kernels import RING, kernel
from granular.md.located.numbering import is_closed
from granular.md.located.pieces import DRIFT_NOISE_FACTOR, elapsed_time, force_return_time, power
from granular.md.located.records import (
    ACTIVE,
    DAMPED,
    DORMANT,
    GENERAL,
    LINEAR,
    MAX_START_EXPONENT,
    OPEN,
    RESIDUAL,
    SERIES_ORDER,
)
from granular.md.located.series import has_force

LINEAR_STEP_REACH = (math.factorial(SERIES_ORDER + 1) * 1e-17) ** (1.0 / (SERIES_ORDER + 1))
"""Largest λh of a linear piece: the first omitted term is then 1e-17."""
MAX_STEP_PER_SCALE = 8.0
"""Largest length of a piece in τ, that is, relative to its scale h."""
MAX_SCALE_PER_CONTACT = 1e9
"""Largest scale h relative to the time for which a contact has lasted.

1e9^20 does not overflow."""
JUST_TOUCHED_OVERLAP = 1e-15
"""Overlap below which a closing pair has only just touched.

It is relative to the typical overlap of the pair. A smaller overlap is the rounding error of a simultaneous event
elsewhere in the island."""
SHALLOW_OVERLAP = 0.1
"""Overlap below which a force can grow by many orders of magnitude in one piece.

It is relative to the typical overlap of the pair."""
DORMANT_OVERLAP, DORMANT_OVERLAP_PER_TOL = 1e-17, 0.1
"""Limits of the overlap up to which a pair is dormant.

The overlap is relative to the typical overlap of the pair. The larger of two limits applies: the first number, and the
second number times the tolerance. Such an overlap is within the truncation error."""


@kernel
def fastest_rate(pairs: Any, pool: Any, lo: int, hi: int, square: float) -> float:
    """Return λ in 1/s, a bound of all rates in a linear island, or -1.

    The result is -1 if a nonlinear law is active. `square` is Ω² in 1/s² for pendula, else 0.
    """
    stiffness, damping = square, 0.0  # largest absolute row sums of M⁻¹K and M⁻¹C so far
    k_below, g_below, closed = 0.0, 0.0, RING and is_closed(pairs, lo, hi)
    if RING and closed:
        last = pool[pairs[hi - 1].slot]
        pushes = has_force(last)
        k_below, g_below = pushes * last.k, pushes * last.gamma
    pushes = has_force(pool[pairs[lo].slot])
    for c in range(lo, hi):
        pair, k_above, g_above, pushes_above = pool[pairs[c].slot], 0.0, 0.0, 0.0
        if pair.mode != OPEN and pair.kind != LINEAR:
            # only linear laws have a rate that is valid for the whole step
            return -1.0
        if c + 1 < hi or closed:
            above = pool[pairs[c + 1].slot]
            pushes_above = has_force(above)
            k_above, g_above = pushes_above * above.k, pushes_above * above.gamma
        if pushes > 0.0:
            row = pair.lower * k_below + pair.inverse * pair.k + pair.upper * k_above + square
            stiffness = max(stiffness, row)
            damping = max(damping, pair.lower * g_below + pair.inverse * pair.gamma + pair.upper * g_above)
        k_below, g_below, pushes = pushes * pair.k, pushes * pair.gamma, pushes_above
    return 0.5 * (damping + math.sqrt(damping * damping + 4.0 * stiffness))


@kernel
def residual_step_time(pairs: Any, pool: Any, lo: int, hi: int) -> float:
    """Return a duration in s for the piece of a linear island without forces.

    The piece covers the end of the first residual phase. The pull is assumed to be constant, as at a driven wall
    without an edge ahead. The result is 1 s if no pair is residual.
    """
    t = math.inf
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.mode == RESIDUAL:
            t = min(t, time_to_contact(pair.xi, pair.eta, -pair.pull), force_return_time(pair, pair))
    # twice the time of the event, so that the step certainly contains it
    return 2.0 * t if 0.0 < t < math.inf else 1.0


@kernel
def set_scales(pairs: Any, pool: Any, lo: int, hi: int) -> None:
    """Compute the typical speed V and overlap X of an island and of each of its pairs.

    They are stored as `speed` and `length` of the block, and `own_speed` and `own_length` of each pair, in m/s and m.

    V² is the largest η² + 2 w k ξ^(p+1)/(p+1), X the largest ((p+1) V² / (2 k w))^(1/(p+1)), with w the inverse m_eff.
    A pair at rest under a pull contributes the energy of its static overlap. Open pairs do not count for the island,
    because a fast ball can fly next to a slow contact. The speed of a pair also includes the speed that its neighbours
    can transfer to it.
    """
    speed, length = 0.0, 0.0
    for c in range(lo, hi):
        pair, elastic = pool[pairs[c].slot], 0.0
        if pair.xi > 0.0:
            elastic = 2.0 * pair.inverse * pair.k * pair.xi * power(pair.xi, pair.p) / (pair.p + 1.0)
            if pair.kind == GENERAL:  # matched at the depth of impacts, not at rest
                elastic = max(elastic, 2.0 * pair.pull * pair.xi)
        elif max(pair.pull, pair.sway) > 0.0 and (
            pair.mode == DORMANT or (pair.mode == ACTIVE and pair.eta <= DRIFT_NOISE_FACTOR * pair.noise)
        ):
            pull = max(pair.pull, pair.sway)
            elastic = 2.0 * pull * power(pull / (pair.k * pair.inverse), 1.0 / pair.p)
        pair.own_speed = math.sqrt(pair.eta * pair.eta + elastic)
        if pair.mode != OPEN:
            speed = max(speed, pair.own_speed)
    around = 1 if is_closed(pairs, lo, hi) else 0
    for c in range(lo + 1, hi + around):
        raise_speed(pool[pairs[c - 1].slot], pool[pairs[c].slot], pool[pairs[c].slot].lower)
    for c in range(hi - 2 + around, lo - 1, -1):
        raise_speed(pool[pairs[c + 1].slot], pool[pairs[c].slot], pool[pairs[c].slot].upper)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.own_speed == 0.0:
            pair.own_speed = speed
        pair_length = pair.own_length = stopping_overlap(pair, pair.own_speed * pair.own_speed)
        if pair.mode != OPEN:
            length = max(length, pair_length if pair.own_speed == speed else stopping_overlap(pair, speed * speed))
    block = pool[pairs[lo].slot]
    block.speed, block.length = speed, length


@kernel
def raise_speed(neighbour: Any, pair: Any, w: float) -> None:
    """Raise the typical speed of a pair to the speed that a neighbour can transfer.

    This is 2 m_eff/m of the neighbour's speed, at most that speed itself. m = 1/w is the mass of the body between the
    two pairs, m_eff belongs to the neighbour `neighbour`. An open neighbour transfers nothing.
    """
    if neighbour.mode != OPEN:
        pair.own_speed = max(pair.own_speed, min(1.0, 2.0 * w / neighbour.inverse) * neighbour.own_speed)


@kernel
def stopping_overlap(pair: Any, square: float) -> float:
    """Return the overlap in m at which an elastic pair alone would stop.

    `square` is its squared rate in m²/s² at overlap 0.
    """
    return power((pair.p + 1.0) * square / (2.0 * pair.k * pair.inverse), 1.0 / (pair.p + 1.0))


@kernel
def choose_clock(pairs: Any, pool: Any, lo: int, hi: int, tol: float) -> int:
    """Return the exponent q of the clock t = (hτ)^q of the island lo … hi-1.

    q is 1, unless a contact with a nonlinear force law begins now (ξ = 0). Then it is the q of the law, and for several
    laws the largest q, a multiple of the others. A beginning contact becomes DORMANT if this clock cannot represent its
    series, or if its approach speed is within rounding error. So does a pair whose overlap is within the truncation
    error. `tol` is the relative tolerance.
    """
    q, dormant_overlap = 1, max(DORMANT_OVERLAP, DORMANT_OVERLAP_PER_TOL * tol)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.xi == 0.0 and is_curved(pair) and q % pair.q != 0:
            if pair.q % q == 0:
                q = pair.q
            else:
                pair.mode = DORMANT
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if (
            pair.xi == 0.0
            and is_curved(pair)
            and (q * pair.p > MAX_START_EXPONENT or pair.eta <= DRIFT_NOISE_FACTOR * pair.noise)
        ):
            pair.mode = DORMANT
        if is_curved(pair) and pair.eta > 0.0 and pair.xi > 0.0:
            if (
                pair.xi < JUST_TOUCHED_OVERLAP * pair.own_length
                and q % pair.q == 0
                and q * pair.p <= MAX_START_EXPONENT
            ):
                pair.xi = 0.0
            # half of the overlap at which it wakes, so that it does not wake immediately
            elif pair.xi < 0.5 * dormant_overlap * pair.own_length:
                pair.mode = DORMANT
        if pair.mode == DORMANT:
            pair.wake = dormant_overlap * pair.own_length
    return q


@kernel
def is_curved(pair: Any) -> bool:
    """Return whether a force acts between the balls under a nonlinear power law.

    If such a pair has just touched, its law determines the exponent q of the island, where t = (hτ)^q.
    """
    return bool(pair.mode == ACTIVE and LINEAR < pair.kind < GENERAL)


@kernel
def series_scale(pairs: Any, pool: Any, lo: int, hi: int) -> float:
    """Return the scale h with which the series of a nonlinear island is computed.

    It is in s^(1/q), where t = (hτ)^q. It is reduced where powers of h relative to the time of a contact would
    overflow.
    """
    block = pool[pairs[lo].slot]
    # a fifth of the time of a contact
    h = power(0.2 * block.length / block.speed, 1.0 / block.clock) if block.speed > 0.0 else 1.0
    if block.clock > 1:
        return h
    if block.last_step > 0.0:
        h = block.last_step
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.xi > 0.0 and is_curved(pair):
            if pair.eta != 0.0:
                h = min(h, MAX_SCALE_PER_CONTACT * pair.xi / abs(pair.eta))
            if pair.pull != 0.0:
                h = min(h, MAX_SCALE_PER_CONTACT * math.sqrt(pair.xi / abs(pair.pull)))
    return h


@kernel
def coefficient_growth(pairs: Any, pool: Any, lo: int, hi: int, tol: float) -> float:
    """Return ln a, the growth of the coefficients of an island per order.

    The module docstring defines a. The result is -inf if all examined coefficients are zero. The bracket `g` of a pair
    that certainly stays clipped is replaced by -1, so that it has no roots.
    """
    q, first, log_growth = pool[pairs[lo].slot].clock, SERIES_ORDER - 5, -math.inf
    for c in range(lo, hi):
        if just_touched(pool[pairs[c].slot]):  # the highest order that its rate certainly has
            period = int(q * (pool[pairs[c].slot].p + 1.0) + 0.5)
            first = min(first, SERIES_ORDER // period * period)
    for j in range(first, SERIES_ORDER + 1):
        largest = 0.0
        for c in range(lo, hi):
            pair = pool[pairs[c].slot]
            largest = max(largest, abs(pair.x[j]) / pair.own_length, abs(pair.e[j]) / pair.own_speed)
        if largest > 0.0:
            log_growth = max(log_growth, math.log(largest) / j)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if just_touched(pair) and pair.x[q] > 0.0 and 2.0 * q * (pair.p + 1.0) > SERIES_ORDER:
            # one order of the force is not enough: ξ = τ^q y, and y^p is a power series up to the zero of y.
            # A ball that touches almost at rest is soon moved by gravity alone.
            log_growth = max(log_growth, row_growth(pair.x, 1, SERIES_ORDER - q, q, pair.x[q]))
        elif is_curved(pair) and 0.0 < pair.x[0] < SHALLOW_OVERLAP * pair.own_length:
            # Then the omitted products of orders in F = k ξ^p are negligible. A pair that reverses at
            # ξ = 0 and η = 0 continues with ξ ∝ τ² and a force ∝ τ^(2p), which must not affect any computed order.
            log_growth = max(log_growth, row_growth(pair.x, 1, SERIES_ORDER, 0, pair.own_length))
        examine_bracket = pair.mode == ACTIVE and pair.kind == DAMPED and pair.s < 1.0 and pair.x[0] > 0.0
        if pair.mode == RESIDUAL and pair.s != 1.0:
            examine_bracket = not stays_clipped(pair, trusted_tau(log_growth, tol))
            if not examine_bracket:
                for j in range(SERIES_ORDER + 1):
                    # φ is proved negative on the piece: replace it by a constant without roots
                    pair.g[j] = -1.0 if j == 0 else 0.0
        if examine_bracket:
            log_growth = max(
                log_growth,
                row_growth(pair.g, SERIES_ORDER - 5, SERIES_ORDER, 0, pair.k * power(pair.own_length, pair.s)),
            )
    return log_growth


@kernel
def just_touched(pair: Any) -> bool:
    """Return whether a force acts and the piece starts exactly at the touch (ξ = 0).

    Under a nonlinear law, F = k ξ^p then has terms of few orders only. The result is false for linear laws.
    """
    return bool(pair.mode == ACTIVE and pair.x[0] == 0.0 and pair.kind != LINEAR)


@kernel
def row_growth(row: Any, first: int, last: int, offset: int, size: float) -> float:
    """Return ln a = max_j ln(|row_(lead+j)|/size)/j, j from `first` to `last`.

    `row` has the coefficients of a series, and `size` is the typical value. The result is -inf if all of these
    coefficients are zero.
    """
    log_growth = -math.inf
    for j in range(first, last + 1):
        if row[offset + j] != 0.0:
            log_growth = max(log_growth, math.log(abs(row[offset + j]) / size) / j)
    return log_growth


@kernel
def stays_clipped(pair: Any, theta: float) -> bool:
    """Return whether φ = k ξ^s + γη of a residual pair is certainly negative up to θ.

    Upper bounds of ξ and η on [0, θ] are used, because φ is singular where ξ is zero.
    """
    xi, eta, t = pair.x[0], pair.e[0], 1.0
    for j in range(1, SERIES_ORDER + 1):
        t *= theta
        xi += max(0.0, pair.x[j] * t)
        eta += max(0.0, pair.e[j] * t)
    return bool(pair.k * power(xi, pair.s) + pair.gamma * eta < 0.0)


@kernel
def trusted_tau(log_growth: float, tol: float) -> float:
    """Return the τ up to which a power series in τ is accurate to `tol`.

    The coefficients of the series grow by the factor exp(`log_growth`) per order. τ is at most `MAX_STEP_PER_SCALE`.
    """
    return math.exp(min(math.log(MAX_STEP_PER_SCALE), math.log(tol) / SERIES_ORDER - log_growth))


@kernel
def truncation_error(log_growth: float, tau: float) -> float:
    """Return the truncation error of a piece up to τ, relative to its typical speed.

    `log_growth` is ln a from `coefficient_growth`.
    """
    ratio = tau * math.exp(log_growth)
    # 0.5: guard against a ratio close to 1, where the geometric series diverges
    return elapsed_time(ratio, SERIES_ORDER + 1, 1.0) / max(0.5, 1.0 - ratio)

