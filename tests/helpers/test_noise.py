"""What judges the suite on other machines: inputs moved by a unit in the last place, and a scene's own condition."""

import math

import numpy as np
import pytest

import granular as gr
from tests.helpers import noise
from tests.helpers.condition import response

RANDOM = np.random.default_rng(0).normal(size=1000)


def test_numbers_move_by_one_unit_or_none_and_only_once():
    moved = noise.moved(RANDOM)
    units = (moved - RANDOM) / np.spacing(abs(RANDOM))
    assert set(units) == {-1.0, 0.0, 1.0}
    assert (units > 0.0).sum() > 200 < (units < 0.0).sum()
    assert np.array_equal(noise.moved(moved), moved)
    assert np.array_equal(noise.moved(-RANDOM), -moved)
    assert np.array_equal(noise.moved(0.25 * RANDOM), 0.25 * moved)


def test_numbers_of_few_digits_stay():
    few = np.array([0.0, -0.0, 1.0, 0.5, -3.0, 9.75, math.inf])
    assert noise.moved(few).tobytes() == few.tobytes()


def test_touches_overlaps_and_walls_stay():
    scene = gr.Scene([math.inf, 0.1, 0.1], [0.0, 0.1, 0.1], [0.0, -1e-3], [0.0, 0.1, 0.3])
    gap = scene.gap.tobytes()
    noise.move_state(scene)
    noise.move_masses(scene)
    assert scene.gap.tobytes() == gap
    assert np.isinf(scene.mass).tolist() == [True, False, False]
    assert scene.mass[1] == scene.mass[2] == noise.moved(0.1)
    assert not scene.mass.flags.writeable


def test_the_condition_of_a_time_of_flight():
    """Of t = gap/speed: 2 t per unit relative change of both."""
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.7], [0.0, -0.3])
    hits = response(lambda one: gr.edmd.simulate(one, gr.ConstantRestitution(1.0)).contacts["t_begin"], scene)
    assert hits == pytest.approx(2.0 * 0.7 / 0.3, rel=0.1)
