"""Isolated contacts that are alike at all speeds: elastic powers, and powers damped with the exponent d = (p-1)/2.
May be skipped: faster, same results to rounding.

With s = ξ^((p+1)/2) and the time dτ = ξ^((p-1)/2) dt, the contact m ξ̈ = -k ξ^p - γ ξ^((p-1)/2) ξ̇ is that of a dashpot,

    s″ + 2 ζ ω s′ + ω² s = 0 ,  ω² = (p+1) k / (2m) ,  ζ = γ / √(2 (p+1) k m) ,

so that its restitution is the dashpot's (Tsuji, Tanaka & Ishida 1992 found ε = ε(α) so), and t = ∫ s^(-β) dτ with
β = (p-1)/(p+1). In units of the length X = (m v²/k)^(1/(p+1)) and the time X/v all contacts of one p and one ζ are one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array

NODES = 40
"""Points of the quadratures: their errors are rounding."""
STEEP = 3.0
"""Largest exponent of a damped law that has a shape: the integrals of steeper ones lose digits."""
STRONG = 0.3
"""Damping ratio from which the integral is taken up to its end, and not as a half period less what is missing."""


class Shape(NamedTuple):
    """Contacts in units of X and X/v: when the force and when the overlap is zero, ε, peaks (the force in k X^p)."""

    force_ends: Array
    parts: Array
    restitution: Array
    deepest: Array
    strongest: Array


def elastic(p: float) -> Shape:
    """Return the elastic contact of exponent `p`."""
    part = 1.0 / (p + 1.0)
    deepest = math.pow(0.5 * (p + 1.0), part)
    arc = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + part) / math.gamma(0.5 + part) * deepest
    return Shape(*(np.array([x]) for x in (arc, arc, 1.0, deepest, math.pow(deepest, p))))


def damped(p: float, zeta: Array) -> Shape:
    """Return contacts of exponent `p` and damping ratios `zeta` > 0; no numbers where it has no half period, ζ ≥ 1."""
    zeta = np.where((zeta < 1.0) & (p <= STEEP), zeta, np.nan)[:, None]
    beta, root, omega = (p - 1.0) / (p + 1.0), np.sqrt((1.0 - zeta) * (1.0 + zeta)), math.sqrt(0.5 * (p + 1.0))
    fade, height = zeta / root, omega / root
    end, missing = 2.0 * np.arctan2(root, zeta), 2.0 * np.arctan2(zeta, root)  # phases; together half a period

    def s(phase: Any) -> Any:
        return height * np.exp(-fade * phase) * np.sin(phase)

    def late(phase: Any) -> Any:  # counted backwards from the half period
        return height * np.exp(-fade * (math.pi - phase)) * np.sin(phase)

    def force(phase: Any) -> Any:
        rate = (np.cos(phase) - fade * np.sin(phase)) * np.exp(-fade * phase)  # ξ̇
        return s(phase) ** beta * (s(phase) + 2.0 * zeta * omega * rate)

    half = np.full_like(zeta, 0.5 * math.pi)
    whole = _integral(s, half, beta) + _integral(late, half, beta) - _integral(late, missing, beta)
    integral = np.where(zeta < STRONG, whole, _integral(s, end, beta))
    duration, restitution = integral / (omega * root), np.exp(-fade * end)
    left = height * restitution * np.sin(missing)  # s where the force is zero
    parts = duration + left ** (2.0 / (p + 1.0)) / restitution
    deepest = s(0.5 * end) ** (2.0 / (p + 1.0))
    return Shape(*(x[:, 0] for x in (duration, parts, restitution, deepest, _largest(force, 0.5 * end))))


def _integral(s: Callable[[Any], Any], high: Array, beta: float) -> Array:
    """∫ s^(-β) dφ from 0, where s is zero, to `high`."""
    x, weight = _points(beta)
    half = 0.5 * high
    total: Array = half * np.sum(weight * (s(half * (1.0 + x)) / (1.0 + x)) ** -beta, axis=1, keepdims=True)
    return total


@cache
def _points(beta: float) -> tuple[Array, Array]:
    """Points and weights on [-1, 1] of the quadrature for (1+x)^-β (Golub & Welsch 1969)."""
    k = np.arange(1.0, NODES)
    middle = beta * beta / ((2.0 * k - beta) * (2.0 * k - beta + 2.0))
    beside = 4.0 * (k * (k - beta)) ** 2 / ((2.0 * k - beta) ** 2 * ((2.0 * k - beta) ** 2 - 1.0))
    beside[0] = 4.0 * (1.0 - beta) / ((2.0 - beta) ** 2 * (3.0 - beta))
    rows = np.diag(np.append(-beta / (2.0 - beta), middle)) + np.diag(np.sqrt(beside), 1) + np.diag(np.sqrt(beside), -1)
    x, vectors = np.linalg.eigh(rows)
    return x, 2.0 ** (1.0 - beta) / (1.0 - beta) * vectors[0] ** 2


def _largest(force: Callable[[Any], Any], high: Array) -> Array:
    """Return the largest value of a force that rises and then falls before the phase `high`, by golden section."""
    low = np.zeros_like(high)
    for _ in range(50):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        rises = force(a) < force(b)
        low, high = np.where(rises, a, low), np.where(rises, high, b)
    top: Array = force(0.5 * (low + high))
    return top
