"""Long runs and long time steps: energy, reversibility and stability."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from bench.stability import truth
from bench.stability.cell import (
    ALL_METHODS,
    DEFAULT_METHODS,
    ELASTIC_RULE,
    FIXED_METHODS,
    SOFT_METHODS,
    Cell,
    Rerun,
    compared_with,
    rerun_function,
)
from granular import md, scenes
from granular.laws import Hertz, LinearDashpot
from granular.laws.kinds import resolved
from granular.md.fixed.integrators import INTEGRATORS
from granular.md.time_step import highest_rate_bound
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene


def runs() -> Iterator[Cell]:
    """Bounces, drops from up to 1 km, oscillations and gases."""
    for e in range(1, 8):
        methods = ALL_METHODS if e <= 4 else DEFAULT_METHODS if e <= 5 else ("edmd",)
        yield replace(bounces(10**e), methods=methods, slow=e > 2)
    for n, height in product((1, 100, 10_000, 100_000), (1e-6, 1.0, 1e3)):
        options = {"max_events": n + 1, "t_end": math.sqrt(2.0 * height / 9.81) * 2.0 * n, "log": False}
        yield Cell("long runs", f"{n} bounces from {height:g} m", scenes.bouncing_ball(height), back_at(height),
                   rule=ELASTIC_RULE, tolerance=1e-13 * (1 + n), options=options, methods=("edmd",),
                   slow=n > 10)
    for e in range(2, 7):
        yield from oscillations(10**e)
    for free, spread in product((1e2, 1e4, 1e6), (1.0, 100.0)):
        yield Cell("long runs", f"gas over {free:g} mean free times, masses 1 : {spread:g}",
                   scenes.gas(10, mass_spread=spread, packing=0.1), truth.energy() if spread > 1.0 else speeds_kept(),
                   Hertz(1e8), ELASTIC_RULE, tolerance=1e-11, methods=DEFAULT_METHODS if free < 1e3 else ("edmd",),
                   options={"t_end": 4.5 * free, "log": False, "max_events": 10**8}, slow=True)


def bounces(n: int, law: LinearDashpot | Hertz | None = None) -> Cell:
    """Ball between two walls 1 m apart, for `n` contacts without gravity."""
    scene = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [0.3, 0.5], [0.0, 1.0, 0.0])
    options = {"max_events": n, "t_end": 0.8 * n, "log": False, "max_steps": 10**8}
    return Cell("long runs", f"{n} bounces between walls", scene, truth.energy(), law or LinearDashpot(1e6),
                ELASTIC_RULE, tolerance=1e-14 + 1e-15 * n, options=options, methods=ALL_METHODS)


@compared_with("height after n bounces")
def back_at(run: Trajectory, rerun: Rerun, height: float) -> float:
    """Relative error of the height of an elastic ball after its n-th bounce."""
    return float(abs(run.gap[-1, 0] / height - 1.0))


def oscillations(n: int) -> Iterator[Cell]:
    """Three pre-compressed balls between walls, with small or large oscillations.

    All contacts stay closed in small oscillations and open in large oscillations.
    """
    methods = SOFT_METHODS if n <= 1_000 else ("located", "verlet") if n <= 100_000 else ("verlet",)
    fast = ((LinearDashpot(1e6), math.sqrt(2e6)), (Hertz(1e8), math.sqrt(2 * 1.5e8 * math.sqrt(1e-3))))
    for (name, speed), (law, omega) in product((("closed", 1e-3), ("opening", 3.0)), fast):
        scene = Scene([math.inf, 1.0, 2.0, 1.0, math.inf], [0.0, 1.0, 1.0, 1.0, 0.0], -np.full(4, 1e-3),
                      [0.0, speed, 0.0, -0.5 * speed, 0.0])
        options = {"t_end": 2.0 * math.pi * n / omega, "log": False, "max_events": 10**8, "max_steps": 10**8}
        options |= {"dt": 0.05 / omega} if methods == ("verlet",) else {}
        yield Cell("long runs", f"{n} oscillations, contacts {name}, {type(law).__name__}", scene, truth.energy(), law,
                   tolerance=1e-12 + 1e-15 * n, options=options, methods=methods, slow=n > 10)


@compared_with("conserved set of speeds (md: energy)")
def speeds_kept(run: Trajectory, rerun: Rerun) -> float:
    """Change of the set of speeds, which equal elastic hard balls only exchange.

    For soft balls the change of energy is returned.
    """
    if run.rule is None:
        return truth.energy().error(run, rerun)
    first, last = np.sort(np.abs(run.velocity[[0, -1]]))
    return float(np.abs(first - last).max())


@dataclass(frozen=True)
class Drift:
    """Drift after a number of contacts of a ball between two walls.

    `energy` is the relative change of energy. `reversal` is the velocity error after time reversal for the same time,
    in units of the speed. Both are dimensionless.
    """

    method: str
    law: str
    contacts: int
    energy: float
    reversal: float


def drifts(methods: Sequence[str] = ALL_METHODS, most: int = 10_000) -> list[Drift]:
    """Drifts of energy and reversibility after 10, 100, … `most` contacts."""
    laws: tuple[LinearDashpot | Hertz, ...] = (LinearDashpot(1e6), Hertz(1e8))
    each = product(methods, laws, range(1, 1 + round(math.log10(most))))
    return [drift(method, law, 10**e) for method, law, e in each if method != "edmd" or isinstance(law, LinearDashpot)]


def drift(method: str, law: LinearDashpot | Hertz, n: int) -> Drift:
    """Drift after `n` contacts."""
    cell = bounces(n, law)
    few = {"engine": "plain"} if method in FIXED_METHODS and n <= 10 else {}  # too short to compile a kernel
    rerun = rerun_function(replace(cell, options=dict(cell.options) | {"max_events": n + 10} | few), method)
    run = rerun()
    kept, returns = (target.error(run, rerun) for target in (truth.energy(), truth.reversal()))
    return Drift(method, "" if method == "edmd" else type(law).__name__, n, kept, returns)


UNIT_SPRING = LinearDashpot(1.0)


@dataclass(frozen=True)
class StabilityLimit:
    """Largest stable dt of a method in units of √(m/k).

    `measured` results from bisection, `theory` from the method. From `reported` on, `granular.md` ends with `unstable`.
    """

    method: str
    balls: int
    measured: float
    theory: float
    reported: float


OSCILLATOR_LIMITS = {"verlet": 2.0, "symplectic-euler": 2.0, "rk4": 2.0 * math.sqrt(2.0)}
"""Largest stable dt·ω of an undamped oscillator, for methods in textbooks."""


def limits(balls: Sequence[int] = (1, 2, 20), methods: Sequence[str] = FIXED_METHODS) -> list[StabilityLimit]:
    """Stability limits of balls held between two walls by compressed springs.

    One ball has ω = √(2k/m), a long chain 2√(k/m). Verlet therefore needs dt < √(m/k) inside a chain.
    """
    return [limit(n, method) for n, method in product(balls, FIXED_METHODS) if method in methods]


def limit(n: int, method: str) -> StabilityLimit:
    """Stability limit of `n` balls of 1 kg with overlaps of 1 m, by bisection.

    The balls start with small random velocities.
    """
    shaken = 1e-6 * np.random.default_rng(n).uniform(-1.0, 1.0, n)
    scene = Scene([math.inf, *np.ones(n), math.inf], [0.0, *np.full(n, 10.0), 0.0], -np.ones(n + 1),
                  [0.0, *shaken, 0.0])
    stable, unstable = 0.05, 3.0
    while unstable - stable > 2e-3 * stable:
        dt = 0.5 * (stable + unstable)
        stable, unstable = (stable, dt) if grows(scene, method, dt) else (dt, unstable)
    bound = highest_rate_bound(scene, resolved([UNIT_SPRING] * scene.n_pairs, scene), np.ones(scene.n_pairs))
    theory = OSCILLATOR_LIMITS.get(method, math.nan) / (2.0 * math.cos(0.5 * math.pi / (n + 1)))
    return StabilityLimit(method, n, stable, theory, INTEGRATORS[method].limit / bound)


def grows(scene: Scene, method: str, dt: float) -> bool:
    """Whether velocities of 1e-6 m/s grow a thousandfold within 200 steps."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        run = md.simulate(scene, UNIT_SPRING, method=method, dt=dt, t_end=200 * dt, log=False)
    speed = np.abs(run.velocity[-1]).max()
    return bool(not speed < 1e-3) or (run.status is Status.unstable and not math.isfinite(speed))
