"""Hard spheres: rational arithmetic, collapse, ties, limits of floating point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from itertools import chain, product
from typing import Any

import numpy as np

from bench.stability import truth
from bench.stability.cell import Cell, Rerun, Truth, compared_with
from granular import scenes, theory
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene


def hard_cell(axis: str, case: str, scene: Scene, expected: Truth, eps: float = 1.0, **more: Any) -> Cell:
    """Cell of hard spheres with restitution `eps`."""
    return Cell(axis, case, scene, expected, rule=ConstantRestitution(eps), methods=("edmd",), **more)


def exact_runs(seeds: int = 60) -> Iterator[Cell]:
    """Random lines without gravity, compared with rational arithmetic."""
    return (
        hard_cell("exact sequence", f"{case}, ε = {eps:g}, {more}", scene, rational(eps), eps, cut=True,
                  options={"max_events": 25})
        for case, more, scene, eps in chain(sticky(), lines(seeds))
    )


def lines(seeds: int) -> Iterator[tuple[str, str, Scene, float]]:
    """Lines of balls with masses and gaps over many decades, slow and fast."""
    for eps, seed in product((1.0, 0.9, 0.5, 0.1, 1e-2, 1e-4, 1e-6), range(seeds // 6)):
        rng = np.random.default_rng(seed)
        n, decades = int(rng.integers(3, 6)), float(rng.choice([0.0, 0.5, 2.0, 9.0]))
        mass = 10.0 ** rng.uniform(-decades, decades, n)
        radius, velocity = np.full(n, 0.1), rng.uniform(-1.0, 1.0, n)
        if seed % 2:
            mass[0], radius[0], velocity[0] = math.inf, 0.0, 0.0
        gap = np.array([rng.choice([1e-16, 1e-8, 1e-4, 1.0, 1e3]) * rng.uniform(0.5, 1.0) for _ in range(n - 1)])
        for scale in (1e-9, 1.0, 1e6):
            yield f"line {seed}", f"v = {scale:.0e}", Scene(mass, radius, gap, velocity * scale), eps


def sticky() -> Iterator[tuple[str, str, Scene, float]]:
    """Lines whose rates fall below the rounding error of velocities.

    After a few impacts the rates are ε² v and smaller.
    """
    for mass, gap, velocity in (
        ([0.3642479594038528, 7.436239814034007e-07, 0.03820219111308472, 0.5509859578714925, 326221605.9008801],
         [1.0, 1e3, 1e-300, 1e-16],
         [-0.24879696929334982, 0.984756275824729, -0.5057857886655219, -0.9725729003002135, -0.8388367801340211]),
        ([2.4, 0.36, 0.55, 1.0], [1.0, 1e-4, 1.0], [0.54, 0.51, -0.59, -0.1]),
    ):
        yield f"{len(mass)} balls", "rates below rounding", Scene(mass, np.full(len(mass), 0.1), gap, velocity), 1e-6


@compared_with("rational arithmetic, collision by collision")
def rational(run: Trajectory, rerun: Rerun, eps: float) -> float:
    """Largest error of the final velocities against rational arithmetic.

    The error is infinite if the pairs collide in another order.
    """
    pairs, velocity = rational_run(run.scene, eps, 25 if run.status is Status.quiet else len(run.contacts))
    if pairs != run.contacts["pair"].tolist():
        return math.inf
    return float(np.abs(velocity - run.velocity[-1]).max()) / truth.largest_speed(run)


def rational_run(scene: Scene, eps: float, most: int) -> tuple[list[int], np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Pairs of at most `most` collisions, and the final velocities in m/s.

    The collisions are computed without rounding.
    """
    w = [Fraction(0) if math.isinf(m) else 1 / Fraction(m) for m in scene.mass.tolist()]
    gap, v = ([Fraction(x) for x in column.tolist()] for column in (scene.gap, scene.velocity))
    e, pairs = Fraction(eps), list[int]()
    while len(pairs) < most and (due := [(gap[c] / (v[c] - v[c + 1]), c) for c in range(len(gap)) if v[c] > v[c + 1]]):
        wait, c = min(due)
        gap = [x + (v[i + 1] - v[i]) * wait for i, x in enumerate(gap)]
        impulse = (1 + e) * (v[c + 1] - v[c]) / (w[c] + w[c + 1])
        v[c], v[c + 1] = v[c] + w[c] * impulse, v[c + 1] - w[c + 1] * impulse
        pairs.append(c)
    return pairs, np.array([float(x) for x in v])


def collapse() -> Iterator[Cell]:
    """Zeno's ball, three balls near the threshold of collapse, columns, sticking."""
    for height, eps in product((1e-6, 1.0, 1e3), (1e-6, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999)):
        rest = truth.comes_to_rest(theory.bouncing_ball(height, eps)[0])
        yield hard_cell("collapse", f"ball from {height:g} m, ε = {eps:g}", scenes.bouncing_ball(height), rest, eps,
                        tolerance=1e-10, slow=eps > 0.99)
    triple = Scene(np.ones(3), np.zeros(3), [1.0, 1.0], [1.0, 0.0, -1.0])
    for eps in (0.05, 0.0715, 0.0717, 0.0719, 0.0722, 0.1, 0.5):
        ends = Status.collapse if eps < 7.0 - 4.0 * math.sqrt(3.0) else Status.quiet
        yield hard_cell("collapse", f"three balls, ε = {eps:g}", triple, ends_with(ends), eps)
    for n in (3, 10, 100, 1000):
        column = scenes.column(n, gravity=9.81)
        yield hard_cell("collapse", f"column of {n}, ε = 0", column, ends_with(Status.quiet), 0.0)


def ends_with(status: Status) -> Truth:
    """Reference: the run ends in this status."""
    return Truth(f"status {status.name}", lambda run, rerun: 0.0 if run.status is status else math.inf)


def ties() -> Iterator[Cell]:
    """Simultaneous contacts under every tie rule."""
    wedged = Scene([math.inf, 1, 1, math.inf], [0, 0.1, 0.1, 0], [0, 0, 0], [0, 1, -1, 0])
    for rule in ("left", "right", "random", "reflect", "newton", "poisson"):
        after = (-1 / 3, 2 / 3, 2 / 3) if rule in ("newton", "poisson") else (0.0, 0.0, 1.0)
        options = {"ties": rule, "max_events": 20_000}
        cradle, cases = scenes.newtons_cradle(3), ((5, 1.0), (5, 0.5), (50, 0.5), (50, 0.9))
        yield hard_cell("ties", f"cradle of 3, {rule}", cradle, truth.velocities(after), options=options)
        for (n, eps), kept in product(cases, (truth.momentum(), truth.ENERGY_LOSS)):
            yield hard_cell("ties", f"cradle of {n}, ε = {eps:g}, {rule}", scenes.newtons_cradle(n, n // 2), kept, eps,
                            options=options)
        for eps in (1.0, 0.5):
            yield hard_cell("ties", f"wedged, ε = {eps:g}, {rule}", wedged, truth.ENERGY_LOSS, eps, options=options)


def edges() -> Iterator[Cell]:
    """Limits of floating point, and walls that close on a ball."""
    ones, radii = [1.0, 1.0], [0.1, 0.1]
    for v in (5e-324, 1e-300, 1e-150, 1e150, 1e300, 1e308):
        passed, turned = truth.velocities((0.0, v), v), truth.velocities((-v, v), v)
        yield hard_cell("float edges", f"v = {v:g}", Scene(ones, radii, [0.0], [v, 0.0]), passed)
        yield hard_cell("float edges", f"v = ±{v:g}, gap 1 m", Scene(ones, radii, [1.0], [v, -v]), turned)
    for mass in (5e-324, 1e-300, 1e300, 1e308):
        scene = Scene([mass, mass], radii, [1.0], [1.0, 0.0])
        yield hard_cell("float edges", f"m = {mass:g}", scene, truth.velocities((0.0, 1.0)))
    for g in (1e-300, 1e-9, 1e9, 1e300):
        rest = truth.comes_to_rest(math.sqrt(2.0 / g) * 3.0)
        yield hard_cell("float edges", f"g = {g:g}", scenes.bouncing_ball(1.0, gravity=g), rest, 0.5, tolerance=1e-10)
    closing = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [1.0, 1.0], [1.0, 0.0, -1.0])
    yield hard_cell("float edges", "walls that close", closing, ends_with(Status.max_events),
                    options={"t_end": 2.0, "max_events": 10_000})
    for ratio, count in ((1e2, 31), (1e4, 314), (1e6, 3141), (1e8, 31415), (1e10, 314159), (1e12, 3141592)):
        scene = Scene([math.inf, 1.0, ratio], [0.0, 0.1, 0.1], [1.0, 1.0], [0.0, 0.0, -1.0])
        yield hard_cell("float edges", f"collisions of 1 : {ratio:g} at a wall", scene, collision_count(count),
                        slow=ratio > 1e8, options={"max_events": 10**7, "log": False})


def collision_count(n: int) -> Truth:
    """Reference: this number of collisions, the digits of π (Galperin)."""
    return Truth("digits of π", lambda run, rerun: float(abs(run.stats["events"] - n)))
