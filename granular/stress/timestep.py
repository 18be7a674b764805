"""The largest stable fixed step: measured, by theory, and as `granular.md` reports it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from granular import md
from granular.laws import LinearDashpot
from granular.laws.kinds import resolved
from granular.md.integrators import INTEGRATORS
from granular.md.stability import sharpest_rate
from granular.scene import Scene
from granular.stress.cell import FIXED
from granular.trajectory import Status

SPRING = LinearDashpot(1.0)


@dataclass(frozen=True)
class StabilityLimit:
    """The largest stable dt in units of √(m/k), measured by bisection, beside the method's theory, and beside the
    step from which `granular.md` says `unstable` (all dimensionless)."""

    method: str
    balls: int
    measured: float
    theory: float
    reported: float


IMAGINARY = {"verlet": 2.0, "symplectic-euler": 2.0, "rk4": 2.0 * math.sqrt(2.0), "gear5": math.nan}
"""Largest stable dt·ω of an undamped oscillator; no textbook number is quoted for the P(EC) form of Gear's method."""


def limits(balls: Sequence[int] = (1, 2, 20), methods: Sequence[str] = FIXED) -> list[StabilityLimit]:
    """Measure the stability limit of balls held between two walls by compressed springs, for each method.

    One ball has ω = √(2k/m), a long chain 2√(k/m): hence dt < √(m/k) for Verlet inside a chain.
    """
    return [limit(n, method) for n, method in product(balls, FIXED) if method in methods]


def limit(n: int, method: str) -> StabilityLimit:
    """Measure that of `n` balls of 1 kg, with overlaps of 1 m, shaken a little, by bisection."""
    shaken = 1e-6 * np.random.default_rng(n).uniform(-1.0, 1.0, n)
    scene = Scene([math.inf, *np.ones(n), math.inf], [0.0, *np.full(n, 10.0), 0.0], -np.ones(n + 1),
                  [0.0, *shaken, 0.0])  # fmt: skip
    stable, unstable = 0.05, 3.0
    while unstable - stable > 2e-3 * stable:
        dt = 0.5 * (stable + unstable)
        stable, unstable = (stable, dt) if grows(scene, method, dt) else (dt, unstable)
    bound = sharpest_rate(scene, resolved([SPRING] * scene.n_pairs, scene), np.ones(scene.n_pairs))
    theory = IMAGINARY[method] / (2.0 * math.cos(0.5 * math.pi / (n + 1)))
    return StabilityLimit(method, n, stable, theory, INTEGRATORS[method].limit / bound)


def grows(scene: Scene, method: str, dt: float) -> bool:
    """Whether the shaking, 1e-6 m/s, has grown a thousandfold after 200 steps."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        run = md.simulate(scene, SPRING, method=method, dt=dt, t_end=200 * dt, log=False)
    speed = np.abs(run.velocity[-1]).max()
    return bool(not speed < 1e-3) or (run.status is Status.unstable and not math.isfinite(speed))
