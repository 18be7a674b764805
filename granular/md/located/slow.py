"""The slow motion of a pile on a driven wall: the polynomial that obeys its equation on a stretch of the wall's path.
May be skipped: rarer, piles that ride on a driven wall.

Among all motions of overlaps that touch forever, ξ'' = p(t) - W F(ξ, ξ'), p of degree 17 on a panel of the path, one is
as slow as the wall is. Of linear laws it is a polynomial too, exactly: its coefficients follow from the last to the
first,

    W K S_j = p_j - (j+1) W Γ S_(j+1) - (j+1)(j+2) S_(j+2) .

Of other laws it is found by implicit collocation from where the pile is, at 16 Radau points (Radau IIA, which damps
what is fast): it is the slow motion if its series has ended, and if that of its values at the points alone leads back
to where the pile is, for then nothing swings. Between two walls W is singular, and the sum of the overlaps is what the
walls make it: this stands for the last row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from granular._check import Array
from granular.md.located.nodes import POINTS, TO_POWERS
from granular.md.located.records import GENERAL, ORDER

TAMED = 4.0
"""A slow motion is no larger than so many times what the forces would bring about at rest."""

ROUNDS = 12
"""Newton's method has converged after so many rounds, or does not."""
ENDED = 4e-15
"""Part of the largest overlap or force below which the last terms of a series are rounding."""
NUDGE = 1e-6
"""Part of an overlap, and of the rate that goes with it, over which a law that is a function is differentiated."""
_X = legendre.legroots([0.0] * (POINTS - 1) + [-1.0, 1.0])
_X[-1] = 1.0
NODES = 0.5 * (_X + 1.0)
"""Radau points: the last one is the end."""
TO_LEGENDRE = np.linalg.inv(legendre.legvander(_X, POINTS - 1))
ONCE, TWICE = (legendre.legvander(_X, POINTS - 1 + m) @ (0.5**m * legendre.legint(TO_LEGENDRE, m, lbnd=-1))
               for m in (1, 2))  # fmt: skip
"""Integrals from 0 to each node of what is given there, and integrals of these."""
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


class Curved(NamedTuple):
    """Overlaps in m and forces in N (ORDER+1, pairs) as coefficients in τ, and the overlaps in m and rates in m/s to
    which the values at the nodes alone lead back at the start."""

    xi: Array
    force: Array
    first: Array
    rate: Array


def curved(forces: Forces, xi: Array, eta: Array, by: Pressed) -> Curved | None:
    """Return the motion from overlaps `xi` and rates `eta` (pairs,) on; None if the stretch is too long to show it."""
    n, h, size = len(xi), by.h, POINTS * len(xi)
    pull = polynomial.polyval(NODES, by.pull).T
    free, change, one = xi + np.multiply.outer(h * NODES, eta), math.inf, np.eye(POINTS)[:, None, :, None]
    bends = np.linalg.solve(h * h * TWICE, xi - free)  # as if they did not move
    for _ in range(ROUNDS):
        x, rate = free + h * h * TWICE @ bends, eta + h * ONCE @ bends
        if not x.min() > 0.0:
            return None
        force, stiff, damp = forces(x, rate)
        missing = pull - bends - force @ by.w.T
        jacobian = one * np.eye(n)[None, :, None, :]
        jacobian = jacobian + (h * h * TWICE)[:, None, :, None] * (by.w[None] * stiff[:, None, :])[:, :, None, :]
        jacobian = jacobian + (h * ONCE)[:, None, :, None] * (by.w[None] * damp[:, None, :])[:, :, None, :]
        if by.total is not None:
            missing[:, -1] = polynomial.polyval(NODES, polynomial.polyder(by.total, 2)) / (h * h) - bends.sum(axis=1)
            jacobian[:, -1] = np.broadcast_to(one[:, 0], (POINTS, POINTS, n))
        try:
            step = np.linalg.solve(jacobian.reshape(size, size), missing.reshape(size)).reshape(POINTS, n)
        except np.linalg.LinAlgError:
            return None
        bends, before = bends + step, change
        change = float((abs(h * h * TWICE @ step).max(axis=0) / x.max(axis=0)).max())
        if change < ENDED or (change < 1e-13 and change >= before):
            break
    else:
        return None
    x = free + h * h * TWICE @ bends
    force, _, _ = forces(x, eta + h * ONCE @ bends)
    for rows in (x, force):
        if (abs(TO_LEGENDRE[-2:] @ rows).max(axis=0) > ENDED * abs(rows).max(axis=0)).any():
            return None
    back = _in_powers(x)
    return Curved(_integral(_integral(_in_powers(bends), h, eta), h, xi), _in_powers(force), back[0], back[1] / h)


def _in_powers(at_nodes: Any) -> Array:
    """Coefficients in τ of what is given at the nodes."""
    rows = TO_POWERS.T @ (TO_LEGENDRE @ at_nodes)
    return np.pad(rows, ((0, ORDER + 1 - POINTS), (0, 0)))


def _integral(rows: Array, h: float, start: Array) -> Array:
    """Coefficients in τ of start + ∫ rows dt, t = hτ."""
    return np.vstack([start, h * rows[:ORDER] / np.arange(1.0, ORDER + 1.0)[:, None]])


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
