"""Proof by modes that a linear pile rests: what energy cannot see in a strongly damped pile that creeps to its place.

A pile of linear contacts moves about its equilibrium as y = (ξ - ξ°, η) = Σ c_m V_m e^(λ_m t); the force of pair c is

    F_c(t) = F°_c + Σ_m a_cm e^(λ_m t) ,   a_cm = c_m (k V_cm + γ V_(n+c)m) ,

and with Re λ_m ≤ 0 it never falls below F°_c + Σ min(0, a_cm) over real λ_m - Σ |a_cm| over complex ones. If that is
positive for every pair, no force ever vanishes, hence nothing else can happen. A creeping mode has a large amplitude,
hence energy, but moves no force: k ξ and γ η cancel.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._check import Array
from granular.md.located.records import LINEAR
from granular.md.located.resting import pile, weight

LARGEST = 100
"""Pairs beyond which the proof is not tried: it costs their number cubed."""
SURE = 1e-6
"""Part of the static force by which the bound must be positive, against rounding in the modes."""


def matrices(pairs: list[Any]) -> Array:
    """The matrix A of ẏ = A y for small motions y = (ξ, η) about the present overlaps of touching pairs."""
    n = len(pairs)
    out = np.zeros((2 * n, 2 * n))
    out[:n, n:] = np.eye(n)
    for c, p in enumerate(pairs):
        k = p.k if p.p == 1.0 else p.k * p.p * p.xi ** (p.p - 1.0)
        gamma = p.gamma if p.d == 0.0 else p.gamma * p.xi**p.d
        for i, w in ((c - 1, p.lower), (c, -p.inverse), (c + 1, p.upper)):
            if 0 <= i < n:
                out[n + i, c], out[n + i, n + c] = w * k, w * gamma
    return out


def creeps_to_rest(pairs: list[Any], bodies: list[Any]) -> bool:
    """Return whether the scene is a pile on a floor whose contact forces are proved positive for ever."""
    n = len(bodies) - 1
    piled = pile(pairs, bodies, n, n)
    damped = all(p.kind == LINEAR and p.gamma > 0.0 for p in pairs[:piled])
    if piled == 0 or bodies[piled].inverse_mass == 0.0 or not damped:
        return False
    static = np.cumsum([weight(body) for body in bodies[piled:0:-1]])[::-1]
    k, gamma = (np.array([getattr(p, name) for p in pairs[:piled]]) for name in ("k", "gamma"))
    y = np.array([p.xi for p in pairs[:piled]] + [p.eta for p in pairs[:piled]])
    y[:piled] -= static / k
    rates, modes = np.linalg.eig(matrices(pairs[:piled]))
    if np.linalg.cond(modes) > 1e12 or rates.real.max() > 0.0:
        return False
    part = np.linalg.solve(modes, y.astype(complex))
    force = (k[:, None] * modes[:piled] + gamma[:, None] * modes[piled:]) * part
    lowest = np.where(rates.imag == 0.0, np.minimum(0.0, force.real), -abs(force)).sum(axis=1)
    return bool(np.all(static + lowest > SURE * static))


def slowest_decay(pairs: list[Any]) -> float:
    """Return the time in s in which the slowest motion about the present state of a pile falls by e (inf: never)."""
    rates = np.linalg.eigvals(matrices(pairs))
    moving = rates[abs(rates) > 1e-9 * abs(rates).max()].real  # between two walls the sum of overlaps cannot move
    slowest = -float(moving.max())
    return 1.0 / slowest if slowest > 0.0 else float("inf")
