"""Laws as kernels know them: the coefficients of their power forms, and which maps their isolated contacts have.
May be skipped: how laws are read, no motion.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from granular._check import Array
from granular.laws.contact_law import Form, PairLaw
from granular.laws.kinds import SceneLaws
from granular.md.located.records import (
    DAMPED,
    DASHPOT,
    ELASTIC,
    GENERAL,
    LARGEST_Q,
    LINEAR,
    NO_MAP,
    SIMILAR,
    STEEPEST,
    VISCOELASTIC,
)
from granular.md.located.similar import Shape, damped, elastic
from granular.scene import Scene


def mapped(kinds: Any, m_eff: Array) -> None:
    """Note which maps isolated contacts of laws that are power forms have, and their shapes."""
    k, p, gamma, d = (kinds[name] for name in ("k", "p", "gamma", "d"))
    linear = p == 1.0
    kinds["map"] = np.where(linear, DASHPOT, np.where((p == 1.5) & (gamma > 0.0) & (d == 0.5), VISCOELASTIC, NO_MAP))
    if linear.all():
        return
    shapes = np.full((*k.shape, len(Shape._fields)), np.nan)
    for one in np.unique(p[~linear]):
        free, alike = (p == one) & (gamma == 0.0), (p == one) & (gamma > 0.0) & (d == 0.5 * (p - 1.0))
        shapes[free] = np.transpose(elastic(one))
        if alike.any():
            zeta = gamma[alike] / np.sqrt(2.0 * (one + 1.0) * k[alike] * m_eff[alike])
            shapes[alike] = np.transpose(damped(one, zeta))
    kinds["map"][shapes[..., 0] > 0.0] = SIMILAR
    for name, values in zip(Shape._fields, np.moveaxis(shapes, -1, 0), strict=True):
        kinds[name] = values


def write_maps(kinds: Any, laws: SceneLaws, scene: Scene) -> None:
    """Note the maps of all kinds of laws that have one; a damping ratio must be the same in all pairs of a kind."""
    mapped(kinds, np.array([law.pair.m_eff for law in laws.each]))
    kinds["map"][kinds["kind"] == GENERAL] = NO_MAP
    damped = (kinds["map"] == SIMILAR) & (kinds["gamma"] > 0.0)
    if damped.any():
        lightest, heaviest = np.full(len(kinds), np.inf), np.zeros(len(kinds))
        np.minimum.at(lightest, laws.kind, scene.pairs.m_eff)
        np.maximum.at(heaviest, laws.kind, scene.pairs.m_eff)
        kinds["map"][damped & (lightest < heaviest)] = NO_MAP


def described(law: PairLaw, speed: float, gravity: float) -> tuple[float, ...]:
    """What kind of law it is, and its coefficients: a row of `KIND`."""
    form = power_form(law)
    if form is None:
        k, p, q = _rough_form(law, speed, gravity)
        return GENERAL, q, law.memory, k, 0.0, p, 0.0, 0.0
    k, p, gamma, d = form
    d = factor(p, gamma, d)
    return *kind_and_q(*form), law.memory, k, gamma, p, d, p - d


def power_form(law: PairLaw) -> Form | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ if a power series can follow it, else None."""
    return law.form if law.form is not None and kind_and_q(*law.form)[0] != GENERAL else None


def _rough_form(law: PairLaw, speed: float, gravity: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law`, and 1 if its force begins smoothly in time, else 2.

    It sets scales, as of first steps; matched at the overlap that an impact at `speed` reaches, or a weight at rest.
    """
    pair = law.pair
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    typical = xi
    for factor in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and speed + gravity > 0.0:
            stops = abs(_bounded(law, xi)) * xi >= pair.m_eff * (speed * speed + gravity * xi)
            if stops == (factor > 1.0):
                break
            xi *= factor
    if not 1e-100 < xi < 1e100:  # it cannot bear the weight, or stops nothing
        return _rough_form(law, speed, 0.0) if gravity > 0.0 else _at_overlap(law, typical)
    return _at_overlap(law, xi)


def _at_overlap(law: PairLaw, xi: float) -> tuple[float, float, int]:
    """Return k and p of a power law of about the size of `law` at an overlap in m, and q, see `_rough_form`."""
    p, onset = (_slope(law, x) for x in (xi, 1e-6 * xi))
    k = abs(_bounded(law, xi)) / math.pow(xi, p)
    return (k if 0.0 < k < math.inf else 1.0), p, (1 if abs(onset - round(onset)) < 1e-3 else 2)


def _slope(law: PairLaw, xi: float) -> float:
    """Return d ln F / d ln ξ at rest at overlap `xi`, within [1, 3]; 1.5 where it cannot be told."""
    near, far = abs(_bounded(law, xi)), abs(_bounded(law, 1.01 * xi))
    if not 0.0 < near < math.inf or not 0.0 < far < math.inf:
        return 1.5
    return min(max(1.0, math.log(far / near) / math.log(1.01)), 3.0)


def _bounded(law: PairLaw, xi: float) -> float:
    """Return the force at rest at overlap `xi`, 0 if it is too large for a number."""
    try:
        return law.force(xi, 0.0, xi)
    except OverflowError:
        return 0.0


def kind_and_q(k: float, p: float, gamma: float, d: float) -> tuple[int, int]:
    """Return the kind of the law F = k ξ^p + γ ξ^d ξ̇, and the q of the clock its contacts start on."""
    if p == 1.0 and (gamma == 0.0 or d == 0.0):
        return LINEAR, 1
    q = _denominator(p) if gamma == 0.0 else math.lcm(_denominator(p), _denominator(d))
    if k > 0.0 and q <= LARGEST_Q and q * p <= STEEPEST and (gamma == 0.0 or 0.0 <= d < p):
        return (ELASTIC if gamma == 0.0 else DAMPED), q
    return GENERAL, min(q, LARGEST_Q)


def factor(p: float, gamma: float, d: float) -> float:
    """Return the d of F = ξ^d (k ξ^(p-d) + γ ξ̇); without damping it is free: ½ for Hertz's law, else 0."""
    return d if gamma != 0.0 else 0.5 if p == 1.5 else 0.0


@cache
def _denominator(exponent: float) -> int:
    """Return the smallest q with q·exponent whole, or one that is too large."""
    found = (q for q in range(1, LARGEST_Q + 1) if abs(q * exponent - round(q * exponent)) < 1e-12)
    return next(found, LARGEST_Q + 1)
