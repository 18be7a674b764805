"""The fixed step: from a thousandth of a contact to beyond the stability limit, and that limit against theory."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from granular import binary, md
from granular.laws import LinearDashpot
from granular.laws.kinds import resolved
from granular.md.integrators import INTEGRATORS
from granular.md.stability import sharpest_rate
from granular.scene import Scene
from granular.stress.cell import FIXED, Cell
from granular.stress.contact import LAWS, meeting
from granular.trajectory import Status

PARTS = (1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.63, 0.65, 1.0, 3.0)
"""dt as parts of the duration of the contact; for an elastic spring 2/ω₀ is 0.637 of it."""


def steps() -> Iterator[Cell]:
    """One contact, with dt from 1e-3 t_c to 3 t_c and touching at three phases of a step."""
    for law, eps, part, phase in itertools.product(LAWS, (1.0, 0.7, 0.1), PARTS, (0.0, 0.31, 0.83)):
        if law == "hertz" and eps < 1.0:
            continue
        cell = meeting("time step", f"dt = {part:g} t_c, ε = {eps:g}, phase {phase:g}", law, eps=eps)
        dt = part * binary.collision(cell.law, cell.scene.pairs[0], 1.0).duration
        scene = cell.scene.replace(gap=[phase * dt])
        yield Cell(cell.axis, cell.case, scene, cell.truth, cell.law, loose=cell.loose, methods=FIXED,
                   options={"dt": dt, "t_end": phase * dt + 20.0 * max(dt, dt / part)})  # fmt: skip


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


def limits(balls: tuple[int, ...] = (1, 2, 20)) -> list[StabilityLimit]:
    """Measure the stability limit of balls held between two walls by compressed springs, for each method.

    One ball has ω = √(2k/m), a long chain 2√(k/m): hence dt < √(m/k) for Verlet inside a chain.
    """
    return [_limit(n, method) for n, method in itertools.product(balls, FIXED)]


def _limit(n: int, method: str) -> StabilityLimit:
    scene, fastest = _held(n), 2.0 * math.cos(0.5 * math.pi / (n + 1))
    bound = sharpest_rate(scene, resolved([LinearDashpot(1.0)] * scene.n_pairs, scene), np.ones(scene.n_pairs))
    theory, reported = IMAGINARY[method] / fastest, INTEGRATORS[method].limit / bound
    return StabilityLimit(method, n, _bisect(scene, method), theory, reported)


def _held(n: int) -> Scene:
    """Balls of 1 kg, pressed between two walls with overlaps of 1 m, shaken a little."""
    ends = [math.inf, *np.ones(n), math.inf]
    shaken = 1e-6 * np.random.default_rng(n).uniform(-1.0, 1.0, n)
    return Scene(ends, [0.0, *np.full(n, 10.0), 0.0], -np.ones(n + 1), [0.0, *shaken, 0.0])


def _bisect(scene: Scene, method: str) -> float:
    stable, grows = 0.05, 3.0
    while grows - stable > 2e-3 * stable:
        dt = 0.5 * (stable + grows)
        stable, grows = (stable, dt) if _grows(scene, method, dt) else (dt, grows)
    return stable


def _grows(scene: Scene, method: str, dt: float) -> bool:
    """Whether the shaking, 1e-6 m/s, has grown a thousandfold after 200 steps."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        run = md.simulate(scene, LinearDashpot(1.0), method=method, dt=dt, t_end=200 * dt, log=False)
    speed = np.abs(run.velocity[-1]).max()
    return bool(not speed < 1e-3) or (run.status is Status.unstable and not math.isfinite(speed))
