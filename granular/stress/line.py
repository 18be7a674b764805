"""Lines of balls: symmetries and invariants of Newton's equation where no closed form is at hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from granular import md, scenes, until
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz, ViscoelasticHertz
from granular.rules import ConstantRestitution
from granular.scene import Pair, Scene
from granular.stress import truth
from granular.stress.cell import FIXED, SOFT, Again, Cell, judged_by
from granular.trajectory import Trajectory

BOTH = ("located", "edmd")


def symmetries(seeds: int = 40) -> Iterator[Cell]:
    """Random lines of 2 to 6 balls, with masses, gaps and stiffness over many decades."""
    yield from close_in_time()
    for seed in range(seeds):
        scene, laws, rule = random_line(seed)
        common: dict[str, Any] = {"scene": scene, "law": laws, "rule": rule, "tolerance": 1e-11,
                                  "options": {"t_end": 4.0, "max_events": 200}}  # fmt: skip
        case = f"line {seed}: {scene.n} bodies, {type(laws[0]).__name__}"
        yield Cell("symmetry", f"{case}, mirror", truth=truth.mirrored(), methods=BOTH, **common)
        yield Cell("symmetry", f"{case}, late", truth=truth.late(4.0), methods=BOTH, **common)
        grows = truth.energy(loses=True)
        yield Cell("invariants", f"{case}, energy", truth=grows, methods=(*BOTH, *FIXED), **common)
        yield Cell("symmetry", f"{case}, as located", truth=as_located(), methods=FIXED, **common)
        if not scene.is_wall.any():
            yield Cell("invariants", f"{case}, momentum", truth=truth.momentum(), methods=(*BOTH, *FIXED), **common)
        if isinstance(laws[0], LinearDashpot):
            exact = common | {"tolerance": 0.0}
            yield Cell("invariants", f"{case}, scaling", truth=truth.scaled(), methods=BOTH, **exact)


def close_in_time() -> Iterator[Cell]:
    """Two impacts closer in time than a float resolves at a late start, in an order that matters."""
    scene = Scene(np.ones(3), np.full(3, 0.1), [3e-5, 1e-5], [1.0, 0.0, -1.0])
    yield Cell("start time", "two impacts 2e-5 s apart at t = 2^40 s", scene, truth.late(1.0), LinearDashpot(1e10),
               ConstantRestitution(0.5), options={"t_end": 1.0}, methods=BOTH)  # fmt: skip


def random_line(seed: int) -> tuple[Scene, list[Any], ConstantRestitution]:
    """Return a line without gravity, one law a pair, and a rule."""
    rng = np.random.default_rng(seed)
    n, decades = int(rng.integers(2, 7)), float(rng.choice([0.0, 0.5, 2.0]))
    mass = 10.0 ** rng.uniform(-decades, decades, n)
    radius, velocity = np.full(n, 0.1), rng.uniform(-1.0, 1.0, n)
    if rng.random() < 0.5:
        mass, radius, velocity = (np.insert(a, 0, x) for a, x in ((mass, math.inf), (radius, 0.0), (velocity, 0.0)))
    gap = 10.0 ** rng.uniform(-12.0, 0.0, len(mass) - 1)
    scene = Scene(mass, radius, gap, velocity)
    k, eps = 10.0 ** rng.uniform(4.0, 14.0), float(rng.choice([1.0, 0.9, 0.3]))
    law = LAWS[seed % len(LAWS)]
    return scene, [law(eps, k, pair) for pair in scene.pairs], ConstantRestitution(eps)


LAWS: tuple[Callable[[float, float, Pair], Any], ...] = (
    lambda eps, k, pair: LinearDashpot.from_restitution(eps, k, pair),
    lambda eps, k, pair: LinearDashpot.from_restitution(eps, k, pair),
    lambda eps, k, pair: ViscoelasticHertz.from_restitution(eps, 1.0, k, pair),
    lambda eps, k, pair: TsujiHertz.from_restitution(eps, k),
    lambda eps, k, pair: Hertz(k),
    lambda eps, k, pair: PowerLaw(k, 2.0),
)
"""What makes the law of a line, by its number."""


@judged_by("the located method")
def as_located(run: Trajectory, again: Again) -> float:
    """The outcome of the located method, which its own cells judge. Divided by the condition number."""
    exact = md.simulate(run.scene, run.law, t_end=4.0, max_events=200)
    return truth.same(run, exact.velocity[-1], exact, again)


def touching() -> Iterator[Cell]:
    """Three balls, hit from one or both sides, that touch to within less than rounding."""
    laws = (LinearDashpot(1e6, 10.0), Hertz(1e6), ViscoelasticHertz(1e6, 1e3), TsujiHertz(1e6, 0.5),
            PowerLaw(1e6, 2.0), PowerLaw(1e6, 1.7))  # fmt: skip
    for law, last, gap in itertools.product(laws, (0.0, -1.0), (0.0, 5e-324, 1e-200, 1e-100, 1e-60, 1e-30, 1e-18)):
        scene = Scene(np.ones(3), np.full(3, 0.1), [0.0, gap], [1.0, 0.0, last])
        case = f"gaps 0 and {gap:g}, {'one side' if last == 0.0 else 'both sides'}, {law}"
        options = {"until": until.separated(), "max_steps": 2_000}
        yield Cell("touching", case, scene, truth.momentum(), law, options=options)
        near = truth.beside(scene.replace(gap=[0.0, 0.0]))
        yield Cell("touching", case, scene, near, law, options=options, tolerance=1e-11)


def known() -> Iterator[Cell]:
    """Outcomes computed elsewhere to more digits than are printed here."""
    unit, end = LinearDashpot(1.0), {"until": until.separated()}
    for n, expected in (
        (3, (-0.1302616951, 0.1502295694, 0.9800321256)),
        (5, (-0.1322794847, -0.0753291698, -0.0310108290, 0.2962177501, 0.9424017334)),
    ):
        target = truth.velocities(expected, words="piecewise exact solution, 10 digits")
        cell = Cell("chains", f"{n} touching balls, linear", scenes.newtons_cradle(n), target, unit,
                    tolerance=2e-10, options=end, methods=SOFT)  # fmt: skip
        yield cell
        yield replace(cell, case=f"{cell.case}, k = 1e16", law=LinearDashpot(1e16))
    law: LinearDashpot | Hertz
    for law, expected in (
        (unit, (-0.17089975, -0.04920079, 0.38202721, 0.66099500, 1.17707832)),
        (Hertz(1.0), (-0.11261497, -0.04195950, 0.21448578, 0.80036667, 1.13972203)),
    ):
        target = truth.velocities(expected, words="another solver, 8 digits")
        case = f"two of five touching balls arrive, {type(law).__name__}"
        yield Cell("chains", case, scenes.newtons_cradle(5, 2), target, law, tolerance=2e-8, options=end, methods=SOFT)


def chains() -> Iterator[Cell]:
    """Chains of up to 1e5 balls."""
    yield from known()
    for n in (10, 100, 1_000, 10_000, 100_000):
        passed = truth.velocities(np.arange(n) == n - 1, words="equal elastic balls hand the velocity on")
        options = {"log": False, "max_events": 10 * n}
        yield Cell("chains", f"{n} balls, gaps", scenes.chain(n, gap=1e-3), passed, rule=ConstantRestitution(1.0),
                   tolerance=1e-12, options=options, methods=("edmd",), slow=n > 1_000)  # fmt: skip
        soft = {"log": False, "t_end": 20.0, "max_steps": 200_000}
        for kept in (truth.energy(), truth.momentum()):
            yield Cell("chains", f"{n} touching balls, Hertz, t = 20", scenes.chain(n), kept, Hertz(1.0),
                       options=soft | {"samples": None}, methods=SOFT, slow=n > 10)  # fmt: skip
