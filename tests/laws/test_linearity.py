"""A force that computes like a spring and a dashpot is run like one; nothing else is taken for one."""

import math

import numpy as np
import pytest

import granular as gr
from granular.laws.contact_law import _linear_form as traced
from tests.helpers.own_laws import OwnDashpot

PAIR = gr.Pair(0.5, 0.01, 0)


def law(force):
    return type("Own", (), {"force": staticmethod(force)})()


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        (lambda xi, rate, pair: 3.0 * xi + 2 * rate, (3.0, 2.0)),
        (lambda xi, rate, pair: (6.0 * xi - -4.0 * rate) / 2.0, (3.0, 2.0)),
        (lambda xi, rate, pair: 3.0 * xi * pair.m_eff, (1.5, 0.0)),
        (lambda xi, rate, pair: 3.0 * xi + 1.0, None),
        (lambda xi, rate, pair: xi * xi, None),
        (lambda xi, rate, pair: 3.0 * xi if xi > 1e-3 else 2.0 * xi, None),
        (lambda xi, rate, pair: 3.0 * xi if xi == 1e-3 else 2.0 * xi, None),
        (lambda xi, rate, pair: max(3.0 * xi, 0.0), None),
        (lambda xi, rate, pair: xi and 2.0 * xi, None),
        (lambda xi, rate, pair: math.sqrt(xi), None),
        (lambda xi, rate, pair: -3.0 * xi, None),
        (lambda xi, rate, pair: 7.0, None),
    ],
)
def test_only_what_is_linear_everywhere(force, expected):
    assert traced(law(force), PAIR) == expected


@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize("method", ["located", "verlet"])
def test_a_copy_without_traits_gives_the_bits_of_the_built_in(method, engine):
    scene = gr.scenes.three_balls()
    built_in = [gr.LinearDashpot.from_restitution(0.7, 5e7, pair) for pair in scene.pairs]
    own = [OwnDashpot(one.k, one.gamma) for one in built_in]
    options = {"until": gr.until.contact(0, 2), "method": method, "engine": engine}
    runs = [gr.md.simulate(scene, laws, **options) for laws in (built_in, own)]
    assert runs[0].contacts.tobytes() == runs[1].contacts.tobytes()
    np.testing.assert_array_equal(runs[0].velocity, runs[1].velocity)
