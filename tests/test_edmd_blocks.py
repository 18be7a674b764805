"""Blocks within a causal halo give the bits of the scene run as one."""

import math

import numpy as np
import pytest

from granular import edmd
from granular.edmd import blocks, engines
from granular.rules import ConstantRestitution
from granular.scene import Scene

pytest.importorskip("numba")


def gas(n, spread, gravity):
    random = np.random.default_rng(n)
    mass = np.exp(random.uniform(-spread, spread, n))
    v = random.normal(size=n) / np.sqrt(mass)
    return Scene([math.inf, *mass, math.inf], np.zeros(n + 2), random.uniform(0.5, 1.5, n + 1), [0, *v, 0], gravity)


@pytest.mark.parametrize(
    ("spread", "gravity", "eps"),
    [(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (2.0, 0.01, 0.99), (0.0, 1.0, 1.0), (0.0, 0.0, 0.7)],
)
def test_blocks_give_the_bits_of_one(monkeypatch, spread, gravity, eps) -> None:
    swept = []
    sweep = blocks.BlockQueue._sweep
    monkeypatch.setattr(blocks.BlockQueue, "_sweep", lambda self, *a: swept.append(sweep(self, *a)) or swept[-1])
    monkeypatch.setattr(blocks, "BLOCK", 256)
    scene, runs = gas(4000, spread, gravity), []
    for large in (10**9, 100):
        monkeypatch.setattr(engines, "LARGE", large)
        times = {"t_end": 20.0, "samples": [0.0, 3.3, 3.4, 20.0], "max_events": 10**9}
        runs.append(edmd.simulate(scene, ConstantRestitution(eps), engine="compiled", log=False, **times))
    one, many = runs
    assert len(swept) >= 3
    if spread == 0.0 and eps > 0.9:
        assert any(swept)
    assert one.stats == many.stats
    for key, value in one.state.items():
        assert np.array_equal(value, many.state[key], equal_nan=not isinstance(value, str)), key


def test_a_limit_on_the_events_is_exact_in_blocks(monkeypatch) -> None:
    monkeypatch.setattr(blocks, "BLOCK", 256)
    monkeypatch.setattr(engines, "LARGE", 100)
    end = edmd.simulate(gas(2000, 1.0, 0.0), ConstantRestitution(1.0), engine="compiled", log=False, max_events=30_001)
    assert end.stats["events"] == end.state["hits"].sum() == 30_001


def test_ties_at_random_are_drawn_for_the_pairs_of_the_scene_not_of_a_block(monkeypatch) -> None:
    """Balls on a lattice at whole speeds, which collide three at a time."""
    monkeypatch.setattr(blocks, "BLOCK", 256)
    random, n = np.random.default_rng(5), 2000
    scene = Scene([math.inf, *[1.0] * n, math.inf], np.zeros(n + 2), np.ones(n + 1), [0, *random.integers(-2, 3, n), 0])
    ends = []
    for large in (10**9, 100):
        monkeypatch.setattr(engines, "LARGE", large)
        options = {"engine": "compiled", "log": False, "ties": "random", "seed": 3, "t_end": 4.0}
        ends.append(edmd.simulate(scene, ConstantRestitution(0.9), **options))
    assert ends[0].velocity[-1].tobytes() == ends[1].velocity[-1].tobytes()
