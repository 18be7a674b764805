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
PARTS, FINE, MOST_LOOKS, PEAKS, NEWTON = 32, 8, 4000, 4, 4
"""Of the search for the largest force: parts of a stretch; looks in half a swing, at most so many in a part; places
from which it is then found, in so many rounds."""


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
        out: Array = r + exponential_minus_one(self.matrix, dt) @ r
        return out

    def overlap(self, r: Array) -> Array:
        """Overlaps in m."""
        out: Array = self.shape @ r[: self.n]
        return out

    def rate(self, r: Array) -> Array:
        """Their rates in m/s."""
        out: Array = self.shape @ r[self.n :]
        return out

    def bounds(self, r: Array) -> tuple[Array, float]:
        """Bounds, from now on, of the part of each force (N), and of the sum of overlaps (m)."""
        part = self.parts(r)
        force = abs((self.force @ self.modes) * part).sum(axis=1)
        total = abs((self.shape.sum(axis=0) @ self.modes[: self.n]) * part).sum()
        return (1.0 + SURE) * force, float((1.0 + SURE) * total)

    def impulse(self, r: Array, later: Array) -> Array:
        """Return ∫ F dt in N s of each contact between two moments."""
        out: Array = self.force @ (self.inverse @ (later - r))
        return out

    def integral(self, g: Array, r: Array, later: Array, h: float, tau: float) -> float:
        """Return ∫ g·r dt from τ = 0 to `tau`, t = hτ; `g` has coefficients in τ, lowest first, one row each."""
        total, sign, rows = [], 1.0, np.array(g)
        while len(rows):
            r, later = self.inverse @ r, self.inverse @ later
            total += [sign * float((tau ** np.arange(len(rows)) @ rows) @ later), -sign * float(rows[0] @ r)]
            rows, sign = np.arange(1.0, len(rows))[:, None] * rows[1:] / h, -sign
        return math.fsum(total)

    def energy(self, r: Array) -> float:
        """Energy in J, which falls by what the swing dissipates."""
        u, v = r[: self.n], r[self.n :]
        return float(0.5 * (u @ self.stiff @ u + v @ (self.mass * v)))

    def parts(self, r: Array) -> Array:
        """Return the part that each mode has in r."""
        out: Array = np.linalg.solve(self.modes, r.astype(complex))
        return out


def highest(slow: Array, swings: tuple[Array, Array], tau: float, so_far: float) -> float:
    """Return the largest of `so_far` and Σ_j slow_j τ^j + Re Σ_m a_m e^(λ_m τ) on [0, τ], for `swings` (a, λ).

    Parts of the stretch where the swings' bound cannot take the slow motion above what has been found are not looked
    at; a largest value that is seen is then found to rounding.
    """
    edges, (part, rates) = np.linspace(0.0, tau, PARTS + 1), swings
    rows = [slow, polynomial.polyder(slow), polynomial.polyder(slow, 2)]
    bend, at_edges = float(abs(rows[2]) @ tau ** np.arange(len(rows[2]))), polynomial.polyval(edges, slow)
    bound = np.maximum(at_edges[1:], at_edges[:-1]) + bend * (tau / PARTS) ** 2 / 8.0
    bound += np.exp(np.multiply.outer(edges[:-1], rates.real)) @ abs(part)
    bend += float(abs(part) @ abs(rates * rates))
    for i in np.argsort(-bound):
        if bound[i] <= so_far:
            break
        so_far = max(so_far, _highest_between(rows, swings, (edges[i], edges[i + 1], bend), so_far))
    return so_far


def _highest_between(rows: list[Any], swings: tuple[Array, Array], where: Any, so_far: float) -> float:
    """Return the largest value between two times, if it is above `so_far`: looked for, then found by Newton's method.

    Given are the slow motion and its derivatives, and the two times with a bound of the second derivative of the sum.
    """
    (part, rates), (first, last, bend) = swings, where
    count = int(min(MOST_LOOKS, FINE * (last - first) * abs(rates.imag).max() / math.pi)) + 4
    at = np.linspace(first, last, count + 1)
    seen = polynomial.polyval(at, rows[0]) + (np.exp(np.multiply.outer(at, rates)) @ part).real
    if seen.max() + bend * ((last - first) / count) ** 2 / 8.0 <= so_far:
        return so_far
    top = at[np.argsort(seen)[-PEAKS:]]
    for _ in range(NEWTON):
        turns = np.exp(np.multiply.outer(top, rates)) * part
        slope = polynomial.polyval(top, rows[1]) + (turns @ rates).real
        bent = polynomial.polyval(top, rows[2]) + (turns @ (rates * rates)).real
        top = np.clip(top - np.where(bent < 0.0, slope / np.where(bent < 0.0, bent, 1.0), 0.0), first, last)
    best = polynomial.polyval(top, rows[0]) + (np.exp(np.multiply.outer(top, rates)) @ part).real
    return float(max(seen.max(), best.max()))
