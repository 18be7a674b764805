"""Largest overlap and force of a pair within its piece."""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular._engine.roots import first_up_crossing
from granular.md.located.pieces import power, value
from granular.md.located.records import DAMPED, ELASTIC, SERIES_ORDER

OPPOSED_SLOPE_SHARE = 0.999
"""Fraction of the first slope of a polynomial that the other slopes can cancel.

The rest of the first slope covers the rounding errors of the other slopes."""


@kernel
def update_peaks(pair: Any, tau: float, scratch: Any) -> None:
    """Update `xi_max` and `force_max` of a pair after its piece up to `tau`.

    The pair already has its overlap and rate at the end of the piece, and its coefficients `g` are overwritten.

    A force that does not depend on the rate is computed by the law at the largest overlap. There the law is more
    accurate than a series far below the scale of its island. In a very short piece a force with ξ^(1/4) is negligible,
    and its series need not converge. The force of a damped power law is therefore at most twice the bound k ξ^p + γ ξ^d
    |ξ̇|.
    """
    deepest = max(float(pair.x[0]), float(pair.xi))
    # closing at first and opening at the end: the overlap has a maximum inside the piece
    if pair.e[0] > 0.0 > pair.eta or monotonic_sign(pair.x, tau) == 0.0:
        for j in range(SERIES_ORDER + 1):
            pair.g[j] = pair.e[j]
        deepest = max(deepest, largest_local_maximum(pair.x, pair.g, tau, scratch))
    pair.xi_max = max(pair.xi_max, deepest)
    xi = max(0.0, deepest)
    if pair.kind == ELASTIC:
        pair.force_max = max(pair.force_max, pair.k * power(xi, pair.p))
        return
    force_sign = monotonic_sign(pair.f, tau)
    force = float(pair.f[0]) if force_sign < 0.0 else max(float(pair.f[0]), value(pair.f, tau))
    if force_sign == 0.0:
        pair.g[SERIES_ORDER] = 0.0
        for j in range(SERIES_ORDER):
            pair.g[j] = (j + 1) * pair.f[j + 1]
        force = max(force, largest_local_maximum(pair.f, pair.g, tau, scratch))
    if pair.kind == DAMPED:
        rate = max(abs(pair.e[0]), abs(pair.eta))
        force = min(force, 2.0 * (pair.k * power(xi, pair.p) + pair.gamma * power(xi, pair.d) * rate))
    pair.force_max = max(pair.force_max, force)


@kernel
def monotonic_sign(row: Any, tau: float) -> float:
    """Return 1 if a polynomial increases on [0, τ], -1 if it decreases, or 0.

    The result follows from a bound of the slope, and 0 means that the bound does not decide.
    """
    sign, opposed = 1.0 if row[1] > 0.0 else -1.0, 0.0
    for j in range(SERIES_ORDER, 1, -1):
        # only terms that oppose the first slope can reverse it
        slope = sign * row[j]
        opposed = (opposed + j * slope if slope < 0.0 else opposed) * tau
    return sign if OPPOSED_SLOPE_SHARE * (sign * row[1]) + opposed > 0.0 else 0.0


@kernel
def largest_local_maximum(row: Any, rate: Any, tau: float, scratch: Any) -> float:
    """Return the largest local maximum of a polynomial on (0, τ), or -inf without one.

    `row` has its coefficients. `rate` has the coefficients of a polynomial with the sign of its slope, and is
    overwritten. `scratch` is the storage of the root finder.
    """
    at, largest, sign, rate_sign = 0.0, -math.inf, -1.0 if rate[0] > 0.0 else 1.0, monotonic_sign(rate, tau)
    # a row of order ORDER has fewer than ORDER extrema
    for _ in range(SERIES_ORDER):
        step = first_up_crossing(rate, tau - at, scratch, sign)
        if not at + step < tau:
            break
        at += step
        if sign < 0.0:
            largest = max(largest, value(row, at))
        if rate_sign == sign:  # the slope changes its sign once
            break
        for first in range(SERIES_ORDER - 1, -1, -1):  # expand about the extremum: Horner's scheme, column by column
            for j in range(first, SERIES_ORDER):
                rate[j] += rate[j + 1] * step
        rate[0], sign = 0.0, -sign
    return largest
