"""The slow motion of a pile on a driven wall: the polynomial that obeys its equation on a stretch of the wall's path.
May be skipped: rarer, piles that ride on a driven wall.

Among all motions of overlaps that touch forever, ξ'' = p(t) - W F(ξ, ξ'), p of degree 17 on a panel of the path, one is
as slow as the wall is. Of linear laws it is a polynomial too, exactly: its coefficients follow from the last to the
first,

    W K S_j = p_j - (j+1) W Γ S_(j+1) - (j+1)(j+2) S_(j+2) .

Of other laws it is found by collocation at 16 Gauss points without a start: swings are no polynomials, so what obeys
the equation there is the slow motion, if its series has ended. Between two walls W is singular, and the sum of the
overlaps is what the walls make it: this stands for the last row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from granular._check import Array
from granular.md.located.collocation import NODES, POINTS, TO_LEGENDRE, TO_POWERS
from granular.md.located.system import GENERAL, ORDER

TAMED = 4.0
"""A slow motion is no larger than so many times what the forces would bring about at rest."""

ROUNDS = 12
"""Newton's method has converged after so many rounds, or does not."""
ENDED = 4e-15
"""Part of the largest overlap or force below which the last terms of a series are rounding."""
NUDGE = 1e-6
"""Part of an overlap, and of the rate that goes with it, over which a law that is a function is differentiated."""
_SLOPE = legendre.legvander(2.0 * NODES - 1.0, POINTS - 2) @ (2.0 * legendre.legder(TO_LEGENDRE))
"""Derivatives by τ at the nodes of what is given there."""
Forces = Callable[[Array, Array], tuple[Array, Array, Array]]
"""Forces (nodes, pairs) in N at overlaps and rates, and their derivatives by both."""


class Pressed(NamedTuple):
    """What presses on a pile during a stretch of length `h` in s: coefficients in τ, t = hτ, one row each.

    `pull` (ORDER+1, pairs) are accelerations of overlaps in m/s², `total` (ORDER+1,) is the sum of the overlaps in m
    between two walls, else None; `w` (pairs, pairs) are inverse masses in 1/kg.
    """

    h: float
    pull: Array
    total: Array | None
    w: Array


def linear(k: Array, gamma: Array, by: Pressed) -> Array | None:
    """Return overlaps (ORDER+1, pairs) in m as coefficients in τ under laws kξ + γη; None if they are not slow."""
    n, h = len(k), by.h
    static, damping = by.w * k, by.w * gamma / h
    if by.total is not None:
        static[-1], damping[-1] = 1.0, 0.0
    try:
        solve = np.linalg.inv(static)
    except np.linalg.LinAlgError:
        return None
    out, size, still = np.zeros((ORDER + 3, n)), 0.0, 0.0
    for j in range(ORDER, -1, -1):
        bend = (j + 1.0) * (j + 2.0) / (h * h) * out[j + 2]
        right = by.pull[j] - (j + 1.0) * (damping @ out[j + 1]) - bend
        alone = by.pull[j].copy()
        if by.total is not None:
            right[-1] = alone[-1] = by.total[j]
        out[j] = solve @ right
        size += float(abs(out[j]).max())
        still += float(abs(solve @ alone).max())
    return out[: ORDER + 1] if size <= TAMED * still < math.inf else None


def curved(forces: Forces, xi: Array, by: Pressed) -> tuple[Array, Array] | None:
    """Return overlaps in m and forces in N (ORDER+1, pairs) as coefficients in τ, from overlaps `xi` (pairs,) nearby;
    None if they are not slow, or the stretch is too long to show them."""
    n, h, size = len(xi), by.h, POINTS * len(xi)
    pull = polynomial.polyval(NODES, by.pull).T
    slope, bend = _SLOPE / h, _SLOPE @ _SLOPE / (h * h)
    x, change, one = np.tile(xi, (POINTS, 1)), math.inf, np.eye(POINTS)[:, None, :, None]
    for _ in range(ROUNDS):
        force, stiff, damp = forces(x, slope @ x)
        missing = pull - bend @ x - force @ by.w.T
        jacobian = bend[:, None, :, None] * np.eye(n)[None, :, None, :]
        jacobian = jacobian + one * (by.w[None] * stiff[:, None, :])[:, :, None, :]
        jacobian = jacobian + slope[:, None, :, None] * (by.w[None] * damp[:, None, :])[:, :, None, :]
        if by.total is not None:
            missing[:, -1] = polynomial.polyval(NODES, by.total) - x.sum(axis=1)
            jacobian[:, -1] = np.broadcast_to(one[:, 0], (POINTS, POINTS, n))
        try:
            step = np.linalg.solve(jacobian.reshape(size, size), missing.reshape(size)).reshape(POINTS, n)
        except np.linalg.LinAlgError:
            return None
        x, before, change = x + step, change, float((abs(step).max(axis=0) / abs(x).max(axis=0)).max())
        if not (x.min() > 0.0 and change < 1e3):
            return None
        if change < ENDED or (change < 1e-13 and change >= before):
            break
    force = forces(x, slope @ x)[0]
    for rows in (x, force):
        if (abs(TO_LEGENDRE[-2:] @ rows).max(axis=0) > ENDED * abs(rows).max(axis=0)).any():
            return None
    return _in_powers(x), _in_powers(force)


def _in_powers(at_nodes: Array) -> Array:
    """Coefficients in τ of what is given at the nodes."""
    rows = TO_POWERS.T @ (TO_LEGENDRE @ at_nodes)
    return np.pad(rows, ((0, ORDER + 1 - POINTS), (0, 0)))


def forces_of(pairs: list[Any], laws: Any) -> Forces:
    """Return the forces of touching pairs (records, from the bottom up); `laws` knows those that are no powers."""
    k, p, gamma, d = np.array([(m.k, m.p, m.gamma, m.d) for m in pairs]).T

    def of_powers(xi: Array, eta: Array) -> tuple[Array, Array, Array]:
        stiff, damp = k * xi ** (p - 1.0), gamma * xi**d
        return stiff * xi + damp * eta, p * stiff + d * damp * eta / xi, damp

    def of_laws(xi: Array, eta: Array) -> tuple[Array, Array, Array]:
        pace = np.array([math.sqrt(m.inverse * laws.force(m, m.xi) / m.xi) for m in pairs])
        by_xi, by_eta = NUDGE * xi, NUDGE * xi * pace
        at, deeper, faster = (_asked(pairs, laws, x, e) for x, e in
                              ((xi, eta), (xi + by_xi, eta), (xi, eta + by_eta)))  # fmt: skip
        return at, (deeper - at) / by_xi, (faster - at) / by_eta

    return of_laws if any(m.kind == GENERAL for m in pairs) else of_powers


def _asked(pairs: list[Any], laws: Any, xi: Array, eta: Array) -> Array:
    rows = [[laws.force(m, x, e) for x, e in zip(xi[:, i].tolist(), eta[:, i].tolist(), strict=True)]
            for i, m in enumerate(pairs)]  # fmt: skip
    return np.array(rows).T


def fastest(forces: Forces, xi: Array, eta: Array, w: Array) -> float:
    """Return a bound in 1/s of all rates of a pile about its overlaps in m and their rates in m/s."""
    _, stiff, damp = forces(xi[None], eta[None])
    a, b = (float((abs(w) * abs(row)).sum(axis=1).max()) for row in (stiff, damp))
    return 0.5 * (b + math.sqrt(b * b + 4.0 * a))


def inverse_masses(pairs: list[Any]) -> Array:
    """W: how the forces of touching pairs (rows of records, from the bottom up) bend their overlaps apart, in 1/kg."""
    lower, own, upper = np.array([(p.lower, p.inverse, p.upper) for p in pairs]).T
    w: Array = np.diag(own) - np.diag(lower[1:], -1) - np.diag(upper[:-1], 1)
    return w
