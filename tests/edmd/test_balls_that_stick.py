"""Balls that stick move as clusters, and rest on the floor until they are hit."""

import math

import numpy as np
import pytest

from granular import edmd
from granular.run.trajectory import Status
from granular.scene import Scene
from tests.helpers.collapsing import column, run
from tests.helpers.scenes_at_random import scene


def pool_adjacent(mass, position, velocity, t):
    """Positions at t of free sticky balls: the pool-adjacent-violators solution of x + v t (obviously right)."""
    blocks = []
    for m, x, v in zip(mass, position, velocity, strict=True):
        block = [m, m * (x + v * t), 1]
        while blocks and blocks[-1][1] / blocks[-1][0] >= block[1] / block[0]:
            last = blocks.pop()
            block = [block[0] + last[0], block[1] + last[1], block[2] + last[2]]
        blocks.append(block)
    return np.concatenate([[p / m] * k for m, p, k in blocks])


@pytest.mark.parametrize("seed", range(10))
def test_balls_that_stick_move_as_clusters(seed) -> None:
    one = scene(np.random.default_rng(seed), (2, 59), walls=(0.0, 0.0, 0.0), gaps=("wide",), size=0.1)
    gravity = float(seed % 2)
    end = run(one.replace(gravity=gravity), 0.0, t_end=3.0)
    x = np.concatenate([[0.0], np.cumsum(one.gap)])
    want = pool_adjacent(one.mass, x, one.velocity, 3.0) - 4.5 * gravity
    np.testing.assert_allclose(end.position[-1] - np.arange(one.n), want, atol=1e-12 * x[-1])
    assert end.momentum()[-1] == pytest.approx(end.momentum()[0] - 3.0 * gravity * one.mass.sum(), rel=1e-11)
    assert end.stats["events"] <= one.n - 1


def test_balls_that_stick_come_to_rest_on_the_floor() -> None:
    end = run(column(50), 0.0)
    assert end.status is Status.quiet
    assert end.stats["events"] == 50
    assert not end.velocity[-1].any()
    height = math.fsum(column(50).gap.tolist())
    assert end.time[-1] == pytest.approx(math.sqrt(2 * height), rel=1e-14)
    assert end.contacts["impulse"][0] == pytest.approx(math.sqrt(2 * column(50).gap[0]), rel=1e-14)


def test_a_pile_at_rest_stays_until_it_is_hit() -> None:
    scene = Scene([math.inf, 1.0, 1.0, 1.0], [0.0, 0.1, 0.1, 0.1], [0.0, 0.0, 2.0], [0.0] * 4, gravity=1.0)
    before = run(scene, 1.0, t_end=1.5, samples=4)
    np.testing.assert_array_equal(before.velocity[:, 1:3], 0.0)
    assert not np.ptp(before.position[:, 1:3], axis=0).any()
    after = run(scene, 1.0, t_end=3.0, samples=7)
    assert after.contacts["t_begin"][0] == 2.0
    assert after.contacts["pair"].tolist() == [2, 1, 0, 1, 2]  # the push runs down, comes back, and throws the ball up
    np.testing.assert_allclose(after.energy(), after.energy()[0], rtol=1e-14)
    assert after.velocity[-1, 3] == pytest.approx(1.0, rel=1e-14)


def test_a_rule_that_returns_zero_at_low_speed_lets_a_ball_rest() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=9.81)
    end = edmd.simulate(scene, lambda v, pair: 0.5 if v > 0.1 else 0.0, t_end=10.0)
    assert end.status is Status.time
    assert end.gap[-1, 0] == 0.0
    assert end.velocity[-1, 1] == 0.0
    assert end.stats["events"] == 7
