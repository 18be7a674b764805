"""Collocation at Gauss points, and events of general laws.

General laws are force laws that power series cannot represent. Their force vanishes or returns where the law itself
changes sign. The interpolant of the force (`g` of a pair) indicates where to search. Near ξ = 0, where every force is
small, its sign is unreliable. The law is therefore evaluated, and the root is found by bisection. A pair whose force
stays positive up to ξ = 0 separates there and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import Legendre, Polynomial, legendre

from granular._engine.check import Array
from granular._engine.roots import first_up_crossing
from granular.md.located.pieces import FLOAT_SPACING, shifted_crossing, value
from granular.md.located.records import ACTIVE, BEGIN, END, PART, RELOAD, SERIES_ORDER, TURN
from granular.md.located.step_size import stopping_overlap

GAUSS_POINTS = 16
"""Number of Gauss points per step."""
_LEGENDRE_NODES, GAUSS_WEIGHTS = legendre.leggauss(GAUSS_POINTS)
_LEGENDRE_BASIS = [Legendre.basis(k, domain=[0.0, 1.0]).convert(kind=Polynomial).coef for k in range(GAUSS_POINTS)]
GAUSS_NODES = 0.5 * (_LEGENDRE_NODES + 1.0)
TO_LEGENDRE = (
    legendre.legvander(_LEGENDRE_NODES, GAUSS_POINTS - 1).T * GAUSS_WEIGHTS * (np.arange(GAUSS_POINTS)[:, None] + 0.5)
)
"""Matrix from values at the nodes to Legendre coefficients."""
TO_POWERS = np.array([np.pad(np.round(row), (0, GAUSS_POINTS - len(row))) for row in _LEGENDRE_BASIS])
"""Coefficients in τ of the Legendre polynomials in 2τ - 1, one polynomial per row."""
CHECK_POINTS = np.concatenate([[0.0], 0.5 * (GAUSS_NODES[1:] + GAUSS_NODES[:-1]), [1.0]])
"""τ at which the interpolant is checked: both ends, and between the nodes."""
TO_CHECK_POINTS = legendre.legvander(2.0 * CHECK_POINTS - 1.0, GAUSS_POINTS - 1) @ TO_LEGENDRE
"""Matrix from values at the nodes to values at `CHECK_POINTS`."""
CHECK_POINT_SHARES = np.array(
    [1.0 - GAUSS_NODES[-1], *[1.0 / GAUSS_POINTS] * (GAUSS_POINTS - 1), 1.0 - GAUSS_NODES[-1]]
)
"""Fraction of the step that each point of `CHECK_POINTS` represents."""
ForceSign = Callable[..., bool]
"""Type of functions that return whether the law gives a positive force at τ.

If a second argument is True, the force must be positive beyond rounding errors."""
SEPARATION_TRIALS = 26
"""Number of points at which a law is evaluated before its pair separates.

The distance to the separation decreases by a factor of 4 per point: 4⁻²⁶ = 2⁻⁵²."""
RETURN_TRIALS = 16
"""Number of points at which a law is evaluated before its force returns."""


def _integrals(places: Array) -> Array:
    """Return the matrix from values at the nodes to integrals over a part of the step.

    The integrals extend from the start of the step to `places`, which are in [-1, 1] from its start to its end. The
    length of the step is 1.
    """
    powers = [(legendre.legint([0.0] * k + [0.5], lbnd=-1), k + 1) for k in range(GAUSS_POINTS)]
    primitive = [row @ legendre.legvander(places, degree).T for row, degree in powers]
    out: Array = np.array(primitive).T @ TO_LEGENDRE
    return out


INTEGRATE_TO_NODES, INTEGRATE_TO_CHECK_POINTS = _integrals(_LEGENDRE_NODES), _integrals(2.0 * CHECK_POINTS - 1.0)
"""Matrices from values at the nodes to integrals from the start of a step.

The integrals end at each node, and at each point of `CHECK_POINTS`."""


def next_event_of_law(
    pair: Any, is_repulsive: ForceSign, is_force_zero: ForceSign, doubt: float, span: float, scratch: Any
) -> tuple[float, int]:
    """Return the τ of the first event of an overlapping pair, and the event.

    The search covers [0, span], and τ is inf without an event. `is_repulsive` returns whether the force is positive at
    τ, `is_force_zero` whether it is 0 at τ and in a neighbourhood. `doubt` in N is the uncertainty of the interpolated
    force.
    """
    separates_at = first_up_crossing(pair.x, span, scratch, -1.0)
    search_end = min(separates_at, span)
    if pair.mode != ACTIVE:
        returns_at = return_of_force(pair, is_repulsive, doubt, search_end, scratch)
        return (returns_at, BEGIN) if returns_at < math.inf else (separates_at, PART)
    end = end_of_force(pair, is_repulsive, doubt, search_end, separates_at < math.inf, scratch)
    if end == math.inf:
        end = start_of_zero_force(pair, is_repulsive, is_force_zero, search_end, scratch)
    branch_end, search_end = math.inf, min(end, search_end)
    if pair.memory and pair.loading:
        branch_end = first_up_crossing(pair.e, search_end, scratch, -1.0)
    elif pair.memory:
        branch_end = shifted_crossing(pair.x, -pair.xi_peak, search_end, scratch, 1.0)
    if branch_end < math.inf:
        return branch_end, TURN if pair.loading else RELOAD
    return (end, END) if end < math.inf else (separates_at, PART)


def end_of_force(pair: Any, is_repulsive: ForceSign, doubt: float, span: float, separates: bool, scratch: Any) -> float:
    """Return the first τ up to `span` at which the force of a pair vanishes, or inf.

    The interpolant `pair.g` of the force shows where to look; `doubt` in N is its uncertainty. If the overlap reaches 0
    at `span` (`separates`), the force just before is smaller than `doubt`. The law itself is then evaluated at points
    that approach `span`.
    """
    positive_at, crossing = 0.0, shifted_crossing(pair.g, doubt, span, scratch, -1.0)
    if not separates and (crossing == math.inf or is_repulsive(crossing)):
        crossing = span  # a force that is 0 on a whole interval never crosses zero
    if crossing < math.inf and not is_repulsive(crossing):
        return bisection_point(is_repulsive, *last_force_interval(is_repulsive, crossing))
    for j in range(1, SEPARATION_TRIALS if separates else 0):
        tau = span * (1.0 - 0.25**j)
        if value(pair.x, tau) > 0.0:
            if not is_repulsive(tau):
                return bisection_point(is_repulsive, positive_at, tau)
            positive_at = tau
    return math.inf


def start_of_zero_force(
    pair: Any, is_repulsive: ForceSign, is_force_zero: ForceSign, span: float, scratch: Any
) -> float:
    """Return the τ at which the force vanishes around a minimum of the overlap.

    The law has zero force on an interval around this minimum, although the pair overlaps. Only τ up to `span` are
    examined. The law is evaluated at the first minimum, and the start of the interval is found by bisection. The result
    is inf if there is no such interval, or if the overlap does not decrease at τ = 0.
    """
    minimum = first_up_crossing(pair.e, span, scratch) if pair.e[0] < 0.0 else math.inf
    return (
        bisection_point(is_repulsive, *last_force_interval(is_repulsive, minimum))
        if minimum < math.inf and is_force_zero(minimum)
        else math.inf
    )


def last_force_interval(is_repulsive: ForceSign, tau: float) -> tuple[float, float]:
    """Return an interval (low, high) up to `tau` within which the force vanishes.

    The force is positive at `low`, but not at `high`. The result is (0, 0) if no positive force is found.
    """
    low, high = 0.0, tau
    for _ in range(SEPARATION_TRIALS):
        if is_repulsive(low):
            return low, high
        high *= 0.25  # the force is 0 at the first instant of a contact: search towards it
        if is_repulsive(high):
            return high, 4.0 * high
    return 0.0, 0.0


def return_of_force(pair: Any, is_repulsive: ForceSign, doubt: float, span: float, scratch: Any) -> float:
    """Return the first τ up to `span` at which the force of a residual pair returns.

    The result is inf if it does not return. The force has to be positive beyond rounding. The law is evaluated at
    points up to the τ where the interpolant becomes positive. After a kink of the law this τ can be too early, so later
    points are evaluated as well.
    """
    crossing = shifted_crossing(pair.g, -doubt, span, scratch, 1.0)
    if crossing == math.inf and not is_repulsive(span, True):
        return math.inf
    crossing, zero_at = min(crossing, span), math.inf
    for first, last in ((0.0, crossing), (crossing, span)):
        for j in range(RETURN_TRIALS + 1):
            tau = last if j == RETURN_TRIALS else first + (last - first) * j / RETURN_TRIALS
            if is_repulsive(tau, True):
                return 0.0 if zero_at == math.inf else bisection_point(lambda at: not is_repulsive(at), zero_at, tau)
            if not is_repulsive(tau):
                zero_at = tau
    return math.inf


def bisection_point(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return the point between `low` and `high` at which `holds` becomes False."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if holds(middle) else (low, middle)
    return high


def own_speeds(pairs: list[Any]) -> Array:
    """Return the typical speeds of pairs in m/s, 1 for pairs without a typical speed."""
    return np.array([p.own_speed if p.own_speed > 0.0 else 1.0 for p in pairs])


def force_errors(pairs: list[Any], force: Array, deviations: Array, noise: Array) -> tuple[Array, float]:
    """Return the mean error of each pair's force, and the largest relative error.

    The mean over the step is in N. The second result is relative to the largest force of the contact, and is computed
    for active pairs. `force` has the forces at the nodes, shape (pairs, nodes). `deviations` has the errors of the
    interpolants at `CHECK_POINTS`. Values up to `noise` in N are rounding errors and count as 0.
    """
    last_terms = abs(force @ TO_LEGENDRE[-2:].T).max(axis=1)
    last_terms, deviations = (
        np.where(last_terms > noise, last_terms, 0.0), np.where(deviations > noise[:, None], deviations, 0.0)
    )
    scales = [v * v / (p.inverse * stopping_overlap(p, v * v)) for p, v in zip(pairs, own_speeds(pairs), strict=True)]
    strength = np.maximum(np.array(scales), abs(force).max(axis=1))
    relative = np.maximum(last_terms, deviations.max(axis=1)) * np.array([p.mode == ACTIVE for p in pairs]) / strength
    return np.maximum(last_terms / GAUSS_POINTS, (deviations * CHECK_POINT_SHARES).max(axis=1)), float(relative.max())


def forces_with_neighbours(force: Array, closed: bool) -> Array:
    """Return forces (pairs, nodes) with one more row before and after all pairs.

    These rows are 0, or on a whole ring (`closed`) the forces of the last and the first pair.
    """
    return np.concatenate([force[-1:], force, force[:1]]) if closed else np.pad(force, ((1, 1), (0, 0)))


def integrate_forces(pairs: list[Any], wall_paths: Any, square: float, closed: bool) -> None:
    """Write the coefficients of rates and overlaps from the coefficients of forces.

    The accelerations of driven walls (`wall_paths`: number of the pair in the island, and path) and Ω² of pendula
    (`square`) are included.
    """
    q, rows = pairs[0].clock, forces_with_neighbours(np.array([p.f for p in pairs]), closed).tolist()
    sigma = q * pairs[0].h ** q
    for below, p, above in zip(rows, pairs, rows[2:], strict=False):
        p.x, p.e = [p.xi] + [0.0] * SERIES_ORDER, [p.eta] + [0.0] * SERIES_ORDER
        for n in range(GAUSS_POINTS):
            push = p.lower * below[n] - p.inverse * p.f[n] + p.upper * above[n] + (p.pull if n == 0 else 0.0)
            p.e[n + q] = sigma * push / (n + q)
        for path in (path for i, path in wall_paths if pairs[i] is p):
            for j in range(1, min(len(path) - 2, (SERIES_ORDER - q) // q + 1)):
                push = (j + 1) * (j + 2) * path[j + 2] * math.pow(pairs[0].h, q * j)
                p.e[(j + 1) * q] += sigma * push / ((j + 1) * q)
        for n in range(SERIES_ORDER + 1 - q):
            if square:
                p.e[n + q] -= sigma * square * p.x[n] / (n + q)
            p.x[n + q] = sigma * p.e[n] / (n + q)


def valid_series_time(wall_paths: Any, holds: float, q: int) -> float:
    """Return a time up to `holds` (s) in which a series represents the wall paths.

    The series has order 20 in τ, with t = (hτ)^q. `wall_paths` lists the pairs at driven walls and their paths.
    """
    for _, path in wall_paths:
        terms = [abs((j + 1) * (j + 2) * path[j + 2]) for j in range(len(path) - 2)]
        while q > 1 and 0.0 < holds < math.inf:
            sizes = [term * holds**j for j, term in enumerate(terms)]
            # the omitted terms must be far below one rounding of the largest term
            if sum(sizes[(SERIES_ORDER - q) // q + 1 :]) <= 0.1 * FLOAT_SPACING * max(sizes):
                break
            holds *= 0.5
    return holds


def wall_accelerations(wall_paths: Any, count: int, times: Array) -> Array:
    """Return the accelerations in m/s² of driven walls towards the balls.

    The shape is (`count` pairs, times). `times` are in s from the start of the step. The values at the start are
    excluded, because they are part of the pulls.
    """
    out = np.zeros((count, len(times)))
    for i, path in wall_paths:
        out[i] = np.polynomial.polynomial.polyval(times, [0.0, *((j + 1) * (j + 2) * path[j + 2]
                                                                 for j in range(1, len(path) - 2))])
    return out

