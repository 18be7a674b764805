"""The highest rate of many contacts is found among a few of them."""

import math

import numpy as np
import pytest

import granular as gr
from granular.laws.kinds import checked
from granular.md import time_step

LAWS = (gr.Hertz(1e5), gr.LinearDashpot(1e4, 3.0), gr.ViscoelasticHertz(1e5, 20.0), gr.TsujiHertz(1e5, 0.2),
        gr.PowerLaw(1e5, 3.0), gr.PowerLaw(1e6, 8.0))


def random_scene(rng):
    """Balls with any masses on a line, a ring or between walls, and overlaps over decades or nearly equal."""
    n, kind = int(rng.integers(3, 40)), rng.random()
    mass = np.exp(rng.uniform(-3.0, 3.0, n)) if rng.random() < 0.5 else np.ones(n)
    wall = kind < 0.3
    if wall:
        mass[[0, -1]] = math.inf
    ring = kind > 0.8
    pairs = n if ring else n - 1
    scene = gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.5), np.full(pairs, 0.1), np.zeros(n), ring=ring,
                     pendulum=3.0 if 0.3 < kind < 0.5 else 0.0)
    overlap = 10.0 ** rng.uniform(-8.0, -2.0, pairs) if rng.random() < 0.5 else 1e-3 + rng.uniform(-1e-9, 1e-9, pairs)
    overlap[rng.random(pairs) < 0.3] = 0.0
    return scene, overlap, rng.random(pairs) < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_pairs_that_cannot_have_the_highest_rate_are_left_out(seed, monkeypatch):
    rng, left_out = np.random.default_rng(seed), 0
    for _ in range(40):
        scene, overlap, beside = random_scene(rng)
        laws = checked([LAWS[int(i)] for i in rng.integers(0, len(LAWS), scene.n_pairs)], scene)
        exact = time_step.highest_rate_bound(scene, laws, overlap, beside)
        with monkeypatch.context() as patch:
            patch.setattr(time_step, "MAX_EXACT_PAIRS", 0)
            left_out += int((~time_step._can_be_highest(scene, laws, overlap, beside) & (overlap > 0.0)).sum())
            assert time_step.highest_rate_bound(scene, laws, overlap, beside) == exact
    assert left_out > 200
