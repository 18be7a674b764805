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
from granular.md.located.pieces import FLOAT_SPACING, shifted, value
from granular.md.located.records import ACTIVE, BEGIN, END, PART, RELOAD, SERIES_ORDER, TURN
from granular.md.located.step_size import amplitude

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
Sign = Callable[..., bool]
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
    pair: Any, pushes: Sign, idles: Sign, doubt: float, span: float, scratch: Any
) -> tuple[float, int]:
    """Return the τ of the first event of an overlapping pair, and the event.

    The search covers [0, span], and τ is inf without an event. `pushes` returns whether the force is positive at τ,
    `idles` whether it is 0 at τ and in a neighbourhood. `doubt` in N is the uncertainty of the interpolated force.
    """
    parts = first_up_crossing(pair.x, span, scratch, -1.0)
    until = min(parts, span)
    if pair.mode != ACTIVE:
        again = regains(pair, pushes, doubt, until, scratch)
        return (again, BEGIN) if again < math.inf else (parts, PART)
    end = loses(pair, pushes, doubt, until, parts < math.inf, scratch)
    if end == math.inf:
        end = pauses(pair, pushes, idles, until, scratch)
    branch, until = math.inf, min(end, until)
    if pair.memory and pair.loading:
        branch = first_up_crossing(pair.e, until, scratch, -1.0)
    elif pair.memory:
        branch = shifted(pair.x, -pair.xi_peak, until, scratch, 1.0)
    if branch < math.inf:
        return branch, TURN if pair.loading else RELOAD
    return (end, END) if end < math.inf else (parts, PART)


def loses(pair: Any, pushes: Sign, doubt: float, span: float, parts: bool, scratch: Any) -> float:
    """Return the first τ up to `span` at which the force of a pair vanishes, or inf.

    If the pair separates at `span` (`parts`), its force just before is smaller than any uncertainty. There the law is
    evaluated at ever smaller distances.
    """
    before, found = 0.0, shifted(pair.g, doubt, span, scratch, -1.0)
    if not parts and (found == math.inf or pushes(found)):
        found = span  # a force that is 0 on a whole interval never crosses zero
    if found < math.inf and not pushes(found):
        return bisected(pushes, *last_push(pushes, found))
    for j in range(1, SEPARATION_TRIALS if parts else 0):
        tau = span * (1.0 - 0.25**j)
        if value(pair.x, tau) > 0.0:
            if not pushes(tau):
                return bisected(pushes, before, tau)
            before = tau
    return math.inf


def pauses(pair: Any, pushes: Sign, idles: Sign, span: float, scratch: Any) -> float:
    """Return the τ at which the force vanishes around a minimum of the overlap.

    The law has zero force on an interval around this minimum, although the pair overlaps. Only τ up to `span` are
    examined. The law is evaluated at the first minimum, and the start of the interval is found by bisection. The result
    is inf if there is no such interval, or if the overlap does not decrease at τ = 0.
    """
    least = first_up_crossing(pair.e, span, scratch) if pair.e[0] < 0.0 else math.inf
    return bisected(pushes, *last_push(pushes, least)) if least < math.inf and idles(least) else math.inf


def last_push(pushes: Sign, tau: float) -> tuple[float, float]:
    """Return an interval (low, high) up to `tau` within which the force vanishes.

    The force is positive at `low`, but not at `high`. The result is (0, 0) if no positive force is found.
    """
    low, high = 0.0, tau
    for _ in range(SEPARATION_TRIALS):
        if pushes(low):
            return low, high
        high *= 0.25  # the force is 0 at the first instant of a contact: search towards it
        if pushes(high):
            return high, 4.0 * high
    return 0.0, 0.0


def regains(pair: Any, pushes: Sign, doubt: float, span: float, scratch: Any) -> float:
    """Return the first τ up to `span` at which the force of a residual pair returns.

    The result is inf if it does not return. The force has to be positive beyond rounding. The law is evaluated at
    points up to the τ where the interpolant becomes positive. After a kink of the law this τ can be too early, so later
    points are evaluated as well.
    """
    found = shifted(pair.g, -doubt, span, scratch, 1.0)
    if found == math.inf and not pushes(span, True):
        return math.inf
    found, clipped = min(found, span), math.inf
    for first, last in ((0.0, found), (found, span)):
        for j in range(RETURN_TRIALS + 1):
            tau = last if j == RETURN_TRIALS else first + (last - first) * j / RETURN_TRIALS
            if pushes(tau, True):
                return 0.0 if clipped == math.inf else bisected(lambda at: not pushes(at), clipped, tau)
            if not pushes(tau):
                clipped = tau
    return math.inf


def bisected(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return the point between `low` and `high` at which `holds` becomes False."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if holds(middle) else (low, middle)
    return high


def _own_speeds(pairs: list[Any]) -> Array:
    """Return the typical speeds of pairs in m/s, 1 for pairs without a typical speed."""
    return np.array([p.own_speed if p.own_speed > 0.0 else 1.0 for p in pairs])


def _errors(pairs: list[Any], force: Array, off: Array, noise: Array) -> tuple[Array, float]:
    """Return the mean error of each pair's force, and the largest relative error.

    The mean over the step is in N. The second result is relative to the largest force of the contact, and is computed
    for active pairs. `force` has the forces at the nodes, shape (pairs, nodes). `off` has the errors of the
    interpolants at `CHECK_POINTS`. Values up to `noise` in N are rounding errors and count as 0.
    """
    last_terms = abs(force @ TO_LEGENDRE[-2:].T).max(axis=1)
    last_terms, off = np.where(last_terms > noise, last_terms, 0.0), np.where(off > noise[:, None], off, 0.0)
    stops = [v * v / (p.inverse * amplitude(p, v * v)) for p, v in zip(pairs, _own_speeds(pairs), strict=True)]
    strength = np.maximum(np.array(stops), abs(force).max(axis=1))
    rough = np.maximum(last_terms, off.max(axis=1)) * np.array([p.mode == ACTIVE for p in pairs]) / strength
    return np.maximum(last_terms / GAUSS_POINTS, (off * CHECK_POINT_SHARES).max(axis=1)), float(rough.max())


def _beside(force: Array, closed: bool) -> Array:
    """Return forces (pairs, nodes) with one more row before and after all pairs.

    These rows are 0, or on a whole ring (`closed`) the forces of the last and the first pair.
    """
    return np.concatenate([force[-1:], force, force[:1]]) if closed else np.pad(force, ((1, 1), (0, 0)))


def _integrate(pairs: list[Any], shaken: Any, square: float, closed: bool) -> None:
    """Write the coefficients of rates and overlaps from the coefficients of forces.

    The accelerations of driven walls (`shaken`: number of the pair in the island, and path) and Ω² of pendula
    (`square`) are included.
    """
    q, rows = pairs[0].clock, _beside(np.array([p.f for p in pairs]), closed).tolist()
    sigma = q * pairs[0].h ** q
    for below, p, above in zip(rows, pairs, rows[2:], strict=False):
        p.x, p.e = [p.xi] + [0.0] * SERIES_ORDER, [p.eta] + [0.0] * SERIES_ORDER
        for n in range(GAUSS_POINTS):
            push = p.lower * below[n] - p.inverse * p.f[n] + p.upper * above[n] + (p.pull if n == 0 else 0.0)
            p.e[n + q] = sigma * push / (n + q)
        for path in (path for i, path in shaken if pairs[i] is p):
            for j in range(1, min(len(path) - 2, (SERIES_ORDER - q) // q + 1)):
                push = (j + 1) * (j + 2) * path[j + 2] * math.pow(pairs[0].h, q * j)
                p.e[(j + 1) * q] += sigma * push / ((j + 1) * q)
        for n in range(SERIES_ORDER + 1 - q):
            if square:
                p.e[n + q] -= sigma * square * p.x[n] / (n + q)
            p.x[n + q] = sigma * p.e[n] / (n + q)


def shown(shaken: Any, holds: float, q: int) -> float:
    """Return a time up to `holds` (s) in which a series represents the wall paths.

    The series has order 20 in τ, with t = (hτ)^q. `shaken` lists the pairs at driven walls and their paths.
    """
    for _, path in shaken:
        terms = [abs((j + 1) * (j + 2) * path[j + 2]) for j in range(len(path) - 2)]
        while q > 1 and 0.0 < holds < math.inf:
            sizes = [term * holds**j for j, term in enumerate(terms)]
            # the omitted terms must be far below one rounding of the largest term
            if sum(sizes[(SERIES_ORDER - q) // q + 1 :]) <= 0.1 * FLOAT_SPACING * max(sizes):
                break
            holds *= 0.5
    return holds


def _shaking(shaken: Any, count: int, times: Array) -> Array:
    """Return the accelerations in m/s² of driven walls towards the balls.

    The shape is (`count` pairs, times). `times` are in s from the start of the step. The values at the start are
    excluded, because they are part of the pulls.
    """
    out = np.zeros((count, len(times)))
    for i, path in shaken:
        out[i] = np.polynomial.polynomial.polyval(times, [0.0, *((j + 1) * (j + 2) * path[j + 2]
                                                                 for j in range(1, len(path) - 2))])
    return out

