"""What a pile of linear contacts swings about its slow motion: exact over any time, by one exponential.
May be skipped: rarer, piles that ride on a driven wall.

The overlaps of a pile whose contacts all push are ξ = S + B u, S any motion that obeys the equations (see `slow`), and
u what the balls are away from it in the frame of their wall: free, whatever the wall does,

    M u'' + BᵀΓB u' + BᵀKB u = 0 ,    r = (u, u') ,    r' = A r ,    r(t) = e^(At) r(0) .

Its force Σ_m a_cm e^(λ_m t) never exceeds Σ |a_cm|, for Re λ_m < 0. What it adds to the account is in closed form: its
energy falls by what it dissipates itself, and with a polynomial g of the slow motion, by parts,

    ∫ g·r dt = Σ_k (-1)^k [ g^(k)·A^-(k+1) r ] .
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from granular._check import Array
from granular.md.located.creep import columns, exponential_minus_one

DOUBTFUL = 1e8
"""Condition of the modes beyond which their bounds are not trusted."""
SURE = 1e-6
"""Part by which bounds are raised, against rounding in the modes."""
STRETCHES, FINE, MOST_LOOKS, PEAKS = 32, 8, 4000, 4
"""Of the search for the largest force: parts of a stretch; looks in half a swing, at most so many in a part; places from
which it is then found exactly."""


class Swing:
    """Free swings of a pile: its matrices.

    Parameters
    ----------
    pairs : list of records
        Touching pairs from the bottom up, all linear, all damped.
    inverse : list of float
        Inverse masses in 1/kg of the bodies from the lowest one on, 0 of walls.
    """

    def __init__(self, pairs: list[Any], inverse: list[float]) -> None:
        self.k, self.gamma, _, _ = columns(pairs)
        free = np.array(inverse) > 0.0
        self.balls = np.flatnonzero(free)
        n = len(pairs)
        self.shape = (np.eye(n, n + 1) - np.eye(n, n + 1, 1))[:, free]  # B
        self.mass, self.n = 1.0 / np.array(inverse)[free], len(self.balls)
        self.stiff = self.shape.T @ (self.k[:, None] * self.shape)
        self.damp = self.shape.T @ (self.gamma[:, None] * self.shape)
        zero, one, w = np.zeros((self.n, self.n)), np.eye(self.n), 1.0 / self.mass[:, None]
        self.matrix = np.block([[zero, one], [-w * self.stiff, -w * self.damp]])
        soft = np.linalg.inv(self.stiff)
        self.inverse = np.block([[-soft @ self.damp, -soft * self.mass], [one, zero]])
        self.force = np.hstack([self.k[:, None] * self.shape, self.gamma[:, None] * self.shape])
        self.rates, self.modes = np.linalg.eig(self.matrix)
        size = np.repeat([math.sqrt(abs(self.matrix[self.n :, : self.n]).max()), 1.0], self.n)
        self.known = bool(np.linalg.cond(size[:, None] * self.modes) < DOUBTFUL and self.rates.real.max() < 0.0)
        self.to_balls = np.linalg.pinv(self.shape)

    def of(self, xi: Array, eta: Array) -> Array:
        """Return r of what overlaps (m) and rates (m/s) are away from the slow motion."""
        return np.concatenate([self.to_balls @ xi, self.to_balls @ eta])

    def after(self, r: Array, dt: float) -> Array:
        """Return r a time `dt` in s later."""
        return r + exponential_minus_one(self.matrix, dt) @ r  # type: ignore[no-any-return]

    def overlap(self, r: Array) -> Array:
        """Overlaps in m."""
        return self.shape @ r[: self.n]  # type: ignore[no-any-return]

    def rate(self, r: Array) -> Array:
        """Their rates in m/s."""
        return self.shape @ r[self.n :]  # type: ignore[no-any-return]

    def bounds(self, r: Array) -> tuple[Array, float]:
        """Bounds, from now on, of the part of each force (N), and of the sum of overlaps (m)."""
        part = self.parts(r)
        force, total = abs((self.force @ self.modes) * part), abs((self.shape.sum(axis=0) @ self.modes[: self.n]) * part)
        return (1.0 + SURE) * force.sum(axis=1), float((1.0 + SURE) * total.sum())

    def impulse(self, r: Array, later: Array) -> Array:
        """Return ∫ F dt in N s of each contact between two moments."""
        return self.force @ (self.inverse @ (later - r))  # type: ignore[no-any-return]

    def integral(self, g: Array, r: Array, later: Array, h: float, tau: float) -> float:
        """Return ∫ g·r dt from τ = 0 to `tau`, t = hτ; `g` has coefficients in τ, lowest first, one row each."""
        total, sign = [], 1.0
        while len(g):
            r, later = self.inverse @ r, self.inverse @ later
            total += [sign * float(polynomial.polyval(tau, g) @ later), -sign * float(g[0] @ r)]
            g, sign = polynomial.polyder(g) / h if len(g) > 1 else g[:0], -sign
        return math.fsum(total)

    def energy(self, r: Array) -> float:
        """Energy in J, which falls by what the swing dissipates."""
        u, v = r[: self.n], r[self.n :]
        return float(0.5 * (u @ self.stiff @ u + v @ (self.mass * v)))

    def parts(self, r: Array) -> Array:
        """Return the part that each mode has in r."""
        return np.linalg.solve(self.modes, r.astype(complex))  # type: ignore[no-any-return]


def highest(slow: Array, swings: tuple[Array, Array], tau: float, so_far: float) -> float:
    """Return the largest of `so_far` and Σ_j slow_j τ^j + Re Σ_m a_m e^(λ_m τ) on [0, τ], for `swings` (a, λ).

    Stretches where the swings' bound cannot take the slow part above what has been found are not looked at; a largest
    value that is seen is then found to rounding.
    """
    edges = np.linspace(0.0, tau, STRETCHES + 1)
    bend = abs(polynomial.polyder(slow, 2)) @ tau ** np.arange(len(slow) - 2)
    at_edges, (part, rates) = polynomial.polyval(edges, slow), swings
    bound = np.maximum(at_edges[1:], at_edges[:-1]) + bend * (tau / STRETCHES) ** 2 / 8.0
    bound += np.exp(np.multiply.outer(edges[:-1], rates.real)) @ abs(part)
    for i in np.argsort(-bound):
        if bound[i] <= so_far:
            break
        so_far = max(so_far, _highest_between(slow, swings, float(edges[i]), float(edges[i + 1])))
    return so_far


def _highest_between(slow: Array, swings: tuple[Array, Array], first: float, last: float) -> float:
    """Return the largest value between two times: looked for, then found by Newton's method."""
    part, rates = swings
    count = int(min(MOST_LOOKS, FINE * (last - first) * abs(rates.imag).max() / math.pi)) + 4
    at = np.linspace(first, last, count + 1)

    def value(at: Array, order: int) -> Array:
        swing = (np.exp(np.multiply.outer(at, rates)) @ (part * rates**order)).real
        return polynomial.polyval(at, polynomial.polyder(slow, order)) + swing  # type: ignore[no-any-return]

    seen = value(at, 0)
    top = at[np.argsort(seen)[-PEAKS:]]
    for _ in range(6):
        slope, bend = value(top, 1), value(top, 2)
        top = np.clip(top - np.where(bend < 0.0, slope / np.where(bend < 0.0, bend, 1.0), 0.0), first, last)
    return float(max(seen.max(), value(top, 0).max()))
