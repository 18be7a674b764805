"""Certain bounds of polynomials on [-1, 1].
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from granular._check import Array


def derived(series: Array, order: int) -> Array:
    """Return the coefficients (n, ·) of a derivative to x of polynomials (n, k)."""
    for _ in range(order):
        series = series[:, 1:] * np.arange(1, series.shape[1]) if series.shape[1] > 1 else 0.0 * series
    return series


def span(series: Array) -> tuple[Array, Array]:
    """Return bounds (n,), below and above, of polynomials (n, k) on [-1, 1]: their Bernstein coefficients, rounding
    allowed for."""
    bernstein, slack = series @ _basis(series.shape[1] - 1), 2.0**-48 * np.abs(series).sum(axis=1)
    return bernstein.min(axis=1) - slack, bernstein.max(axis=1) + slack


@cache
def _basis(n: int) -> Array:
    """Bernstein coefficients (n+1, n+1) on [-1, 1] of 1, x, … x^n: none is above 1, so no digits are lost."""
    rows = np.empty((n + 1, n + 1))
    for i in range(n + 1):
        symmetric = np.polynomial.polynomial.polyfromroots([1.0] * (n - i) + [-1.0] * i) * (-1.0) ** (n - i)
        rows[:, i] = symmetric / [math.comb(n, j) for j in range(n + 1)]
    return rows
