"""Hard spheres: exact rational runs, collapse, Zeno's ball, ties, and the edges of floating point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from granular import scenes, theory
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.stress import truth
from granular.stress.cell import Again, Cell, Truth, judged_by
from granular.trajectory import Status, Trajectory

HARD = ("edmd",)


def exact_runs(seeds: int = 60) -> Iterator[Cell]:
    """Random lines without gravity, compared collision by collision with rational arithmetic."""
    yield from sticky()
    for eps in (1.0, 0.9, 0.5, 0.1, 1e-2, 1e-4, 1e-6):
        for seed in range(seeds // 6):
            rng = np.random.default_rng(seed)
            n, decades = int(rng.integers(3, 6)), float(rng.choice([0.0, 0.5, 2.0, 9.0]))
            mass = 10.0 ** rng.uniform(-decades, decades, n)
            radius, velocity = np.full(n, 0.1), rng.uniform(-1.0, 1.0, n)
            if seed % 2:
                mass[0], radius[0], velocity[0] = math.inf, 0.0, 0.0
            gap = np.array([rng.choice([1e-16, 1e-8, 1e-4, 1.0, 1e3]) * rng.uniform(0.5, 1.0) for _ in range(n - 1)])
            for scale in (1e-9, 1.0, 1e6):
                scene = Scene(mass, radius, gap, velocity * scale)
                yield Cell("exact sequence", f"line {seed}, ε = {eps:g}, v = {scale:.0e}", scene, rational(eps),
                           rule=ConstantRestitution(eps), options={"max_events": 25}, cut=True,
                           methods=HARD)  # fmt: skip


def sticky() -> Iterator[Cell]:
    """Lines whose rates after a few impacts, ε² v and less, are below the rounding of their velocities."""
    for mass, gap, velocity, eps in (
        ([0.3642479594038528, 7.436239814034007e-07, 0.03820219111308472, 0.5509859578714925, 326221605.9008801],
         [1.0, 1e3, 1e-300, 1e-16],
         [-0.24879696929334982, 0.984756275824729, -0.5057857886655219, -0.9725729003002135, -0.8388367801340211],
         1e-6),
        ([2.4, 0.36, 0.55, 1.0], [1.0, 1e-4, 1.0], [0.54, 0.51, -0.59, -0.1], 1e-6),
    ):  # fmt: skip
        scene = Scene(mass, np.full(len(mass), 0.1), gap, velocity)
        yield Cell("exact sequence", f"{len(mass)} balls, ε = {eps:g}, rates below rounding", scene, rational(eps),
                   rule=ConstantRestitution(eps), options={"max_events": 25}, cut=True, methods=HARD)  # fmt: skip


@judged_by("rational arithmetic, collision by collision")
def rational(run: Trajectory, again: Again, eps: float) -> float:
    """The same collisions in rational arithmetic: pairs in the same order, and velocities at the end."""
    pairs, velocity = rational_run(run.scene, eps, 25 if run.status is Status.quiet else len(run.contacts))
    if pairs != run.contacts["pair"].tolist():
        return math.inf
    return float(np.abs(velocity - run.velocity[-1]).max()) / truth.speed_of(run)


def rational_run(scene: Scene, eps: float, most: int) -> tuple[list[int], np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Return the pairs of at most `most` collisions and the velocities after them in m/s, computed without rounding."""
    w = [Fraction(0) if math.isinf(m) else 1 / Fraction(m) for m in scene.mass.tolist()]
    gap, v = [Fraction(x) for x in scene.gap.tolist()], [Fraction(x) for x in scene.velocity.tolist()]
    e, pairs = Fraction(eps), list[int]()
    while len(pairs) < most:
        due = [(gap[c] / (v[c] - v[c + 1]), c) for c in range(len(gap)) if v[c] > v[c + 1]]
        if not due:
            break
        wait, c = min(due)
        gap = [x + (v[i + 1] - v[i]) * wait for i, x in enumerate(gap)]
        impulse = (1 + e) * (v[c + 1] - v[c]) / (w[c] + w[c + 1])
        v[c], v[c + 1] = v[c] + w[c] * impulse, v[c + 1] - w[c + 1] * impulse
        pairs.append(c)
    return pairs, np.array([float(x) for x in v])


def collapse() -> Iterator[Cell]:
    """Zeno's ball to its last bounce; three balls on both sides of the threshold of collapse; columns; sticking."""
    for height in (1e-6, 1.0, 1e3):
        for eps in (1e-6, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999):
            rest, _ = theory.bouncing_ball(height, eps)
            yield Cell("collapse", f"ball from {height:g} m, ε = {eps:g}", scenes.bouncing_ball(height),
                       truth.comes_to_rest(rest, "the sum of all bounces"), rule=ConstantRestitution(eps),
                       tolerance=1e-10, methods=HARD, slow=eps > 0.99)  # fmt: skip
    triple = Scene(np.ones(3), np.zeros(3), [1.0, 1.0], [1.0, 0.0, -1.0])
    for eps in (0.05, 0.0715, 0.0717, 0.0719, 0.0722, 0.1, 0.5):
        ends = Status.collapse if eps < 7.0 - 4.0 * math.sqrt(3.0) else Status.quiet
        yield Cell("collapse", f"three balls, ε = {eps:g}", triple, ended(ends), rule=ConstantRestitution(eps),
                   methods=HARD)  # fmt: skip
    for n in (3, 10, 100, 1000):
        yield Cell("collapse", f"column of {n}, ε = 0", scenes.column(n, gravity=9.81), ended(Status.quiet),
                   rule=ConstantRestitution(0.0), methods=HARD)  # fmt: skip


def ended(status: Status) -> Truth:
    """The run ends in that status."""
    return Truth(f"ends in {status.name}", lambda run, again: 0.0 if run.status is status else math.inf)


def ties() -> Iterator[Cell]:
    """Simultaneous contacts under every rule for them."""
    one_leaves, all_move = (0.0, 0.0, 1.0), (-1 / 3, 2 / 3, 2 / 3)
    for rule in ("left", "right", "random", "reflect", "newton", "poisson"):
        expected = all_move if rule in ("newton", "poisson") else one_leaves
        options = {"ties": rule, "max_events": 20_000}
        yield Cell("ties", f"cradle of 3, {rule}", scenes.newtons_cradle(3), truth.velocities(expected),
                   rule=ConstantRestitution(1.0), options=options, methods=HARD)  # fmt: skip
        for n, eps in ((5, 1.0), (5, 0.5), (50, 0.5), (50, 0.9)):
            scene = scenes.newtons_cradle(n, n // 2)
            for kept in (truth.momentum(), truth.energy(loses=True)):
                yield Cell("ties", f"cradle of {n}, ε = {eps:g}, {rule}", scene, kept, rule=ConstantRestitution(eps),
                           options=options, methods=HARD)  # fmt: skip
        wedged = Scene([math.inf, 1, 1, math.inf], [0, 0.1, 0.1, 0], [0, 0, 0], [0, 1, -1, 0])
        for eps in (1.0, 0.5):
            yield Cell("ties", f"wedged, ε = {eps:g}, {rule}", wedged, truth.energy(loses=True),
                       rule=ConstantRestitution(eps), options=options, methods=HARD)  # fmt: skip


def edges() -> Iterator[Cell]:
    """The edges of floating point, and walls that leave no way out."""
    for speed in (5e-324, 1e-300, 1e-150, 1e150, 1e300, 1e308):
        scene = Scene([1.0, 1.0], [0.1, 0.1], [0.0], [speed, 0.0])
        yield Cell("float edges", f"v = {speed:g}", scene, truth.velocities((0.0, speed), speed),
                   rule=ConstantRestitution(1.0), methods=HARD)  # fmt: skip
        scene = Scene([1.0, 1.0], [0.1, 0.1], [1.0], [speed, -speed])
        yield Cell("float edges", f"v = ±{speed:g}, gap 1 m", scene, truth.velocities((-speed, speed), speed),
                   rule=ConstantRestitution(1.0), methods=HARD)  # fmt: skip
    for mass in (5e-324, 1e-300, 1e300, 1e308):
        scene = Scene([mass, mass], [0.1, 0.1], [1.0], [1.0, 0.0])
        yield Cell("float edges", f"m = {mass:g}", scene, truth.velocities((0.0, 1.0)), rule=ConstantRestitution(1.0),
                   methods=HARD)  # fmt: skip
    for g in (1e-300, 1e-9, 1e9, 1e300):
        rest = math.sqrt(2.0 / g) * 3.0
        yield Cell("float edges", f"g = {g:g}", scenes.bouncing_ball(1.0, gravity=g),
                   truth.comes_to_rest(rest, "the sum of all bounces"), rule=ConstantRestitution(0.5),
                   tolerance=1e-10, methods=HARD)  # fmt: skip
    closing = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [1.0, 1.0], [1.0, 0.0, -1.0])
    yield Cell("float edges", "walls that close", closing, ended(Status.max_events), rule=ConstantRestitution(1.0),
               options={"t_end": 2.0, "max_events": 10_000}, methods=HARD)  # fmt: skip
    for ratio, count in ((1e2, 31), (1e4, 314), (1e6, 3141), (1e8, 31415), (1e10, 314159), (1e12, 3141592)):
        scene = Scene([math.inf, 1.0, ratio], [0.0, 0.1, 0.1], [1.0, 1.0], [0.0, 0.0, -1.0])
        yield Cell("float edges", f"collisions of 1 : {ratio:g} at a wall", scene, counted(count),
                   rule=ConstantRestitution(1.0), options={"max_events": 10**7, "log": False}, methods=HARD,
                   slow=ratio > 1e8)  # fmt: skip


def counted(n: int) -> Truth:
    """The digits of π: that many collisions in all (Galperin)."""
    return Truth("digits of π", lambda run, again: float(abs(run.stats["events"] - n)))
