"""What scenes are made of: masses and radii of spheres, gaps, and balls above a floor.
May be skipped: ready-made scenes, to be looked up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import _check
from granular._check import Array
from granular.scene import Scene, in_order


def mass_of(radius: Array, density: float) -> Array:
    """Masses in kg of spheres of some radii in m and a density in kg/m³."""
    return 4.0 / 3.0 * math.pi * _check.number("density", density, above=0.0) * radius**3


def radius_of(mass: Array, density: float) -> Array:
    """Radii in m of spheres of some masses in kg and a density in kg/m³."""
    return np.asarray(np.cbrt(mass * 0.75 / (math.pi * _check.number("density", density, above=0.0))))


def count_of(n: int, at_least: int = 1) -> int:
    """Number of balls."""
    return _check.whole("n", n, at_least=at_least, at_most=_check.MOST)


def geometric(n: int, mass_ratio: float) -> Array:
    """Masses from 1 on, each a multiple of the one before."""
    count = count_of(n)
    return np.asarray(np.power(_check.number("mass_ratio", mass_ratio, above=0.0), np.arange(count, dtype=np.float64)))


def masses_of(masses: Sequence[float]) -> Array:
    """Masses of balls as they are given."""
    m = _check.array("masses", masses)
    _check.every("masses", m, np.isfinite(m) & (m > 0.0), "a mass must be positive and finite", "the floor is built in")
    return m


def gaps_of(gap: float | Sequence[float], n_pairs: int, name: str = "gap") -> Array:
    """Gaps in m of so many pairs."""
    if np.ndim(gap) == 0:
        return np.full(n_pairs, _check.number(name, gap))
    return _check.array(name, gap, (n_pairs,), fix="one gap for all, or one per pair from the bottom up")


def above_floor(
    mass: Array, radius: Array, drop: float, gap: float | Sequence[float], speed: float, gravity: float,
    plate: Any = None,
) -> Scene:
    """Balls that all move down at `speed`, the lowest point of the lowest at height `drop` above a floor."""
    n = len(mass)
    velocity = [0.0] + [0.0 - speed] * n  # not -speed, which makes -0.0 of rest
    gaps = [drop, *gaps_of(gap, n - 1)]
    return in_order(Scene([math.inf, *mass], [0.0, *radius], gaps, velocity, gravity, floor=plate))
