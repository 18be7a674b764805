"""What is rounding does not collide: numbers of collisions equal those of exact rational arithmetic."""

import math
from fractions import Fraction

import numpy as np
import pytest

from granular import edmd, until
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.trajectory import Status

ELASTIC = ConstantRestitution(1.0)
ENGINES = ("sorted", "compiled")


def exactly(scene):
    """Return the pairs that collide, elastically, in their order, and the time of the last, in rational arithmetic."""
    m, v = [Fraction(x) for x in scene.mass.tolist()], [Fraction(x) for x in scene.velocity.tolist()]
    gap, now, pairs = [Fraction(x) for x in scene.gap.tolist()], Fraction(0), []
    while True:
        closing = [(gap[c] / (v[c] - v[c + 1]), c) for c in range(len(gap)) if v[c] > v[c + 1]]
        if not closing:
            return pairs, float(now)
        dt, c = min(closing)
        gap = [d + dt * (v[k + 1] - v[k]) for k, d in enumerate(gap)]
        gap[c], now = Fraction(0), now + dt
        mean = (m[c] * v[c] + m[c + 1] * v[c + 1]) / (m[c] + m[c + 1])
        v[c], v[c + 1] = 2 * mean - v[c], 2 * mean - v[c + 1]
        pairs.append(c)


def free(seed, kind):
    """Return balls without walls; of whole masses and velocities many come to move in parallel."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    gap = random.uniform(0.1, 1.0, n - 1)
    if kind == "whole":
        gap *= random.random(n - 1) > 0.2  # some touch
        return Scene(random.integers(1, 7, n), np.zeros(n), gap, random.integers(-3, 4, n))
    return Scene(np.exp(random.uniform(-3, 3, n)), np.zeros(n), gap, random.normal(size=n))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["whole", "any"])
def test_collisions_are_those_of_exact_arithmetic(kind, engine) -> None:
    if engine == "compiled":
        pytest.importorskip("numba")
    for seed in range(150):
        scene = free(seed, kind)
        pairs, last = exactly(scene)
        run = edmd.simulate(scene, ELASTIC, engine=engine)
        assert run.status is Status.quiet, seed
        assert run.contacts["pair"].tolist() == pairs, seed
        assert float(run.time[-1]) == pytest.approx(last, rel=1e-6), seed
