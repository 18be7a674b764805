"""What holds for every scene of hard spheres: order, momentum, energy, powers of two; see `test_symmetries` too."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from granular import edmd
from granular.laws.rules import ConstantRestitution
from granular.scene import Scene
from tests.helpers.scenes_at_random import HARD, gas, scene, scenes

ANY = scenes(balls=(2, 8), walls=(0.5, 0.4, 0.0), gravity=(0.0, 1.0, 9.81), gaps=(*HARD, "uneven"), decades=4.0)


def run(scene, eps, **options):
    return edmd.simulate(scene, ConstantRestitution(eps), t_end=2.0, max_events=300, **options)


@pytest.mark.rotating
@given(ANY, st.sampled_from([1.0, 0.9, 0.5]))
@settings(max_examples=150, deadline=None)
def test_order_momentum_and_energy(scene, eps) -> None:
    end = run(scene, eps, samples=9)
    assert (end.gap >= 0.0).all()
    reach = scene.radius[1:] + scene.radius[:-1]
    assert (np.diff(end.position, axis=1) - reach >= -1e-15 * abs(end.position).max()).all()
    assert (np.diff(end.contacts["t_begin"]) >= 0.0).all()
    energy = end.energy()
    size = max(float(np.abs(energy).max()), 1e-300)
    rounding = 1e-12 * size
    assert (np.diff(energy) <= rounding).all()
    if eps == 1.0:
        np.testing.assert_allclose(energy, energy[0], atol=rounding, rtol=0)
    if not scene.is_wall.any():
        scale = float(scene.mass @ np.abs(scene.velocity)) + 1e-300
        np.testing.assert_allclose(end.momentum(), end.momentum()[0], atol=1e-13 * scale, rtol=0)
    closing = end.contacts["v_in"] @ [1.0, -1.0]
    heard = np.array([scene.pairs[c].m_eff for c in end.contacts["pair"]]) * (1.0 + eps) * closing
    fastest = max(abs(scene.velocity).max(), abs(end.velocity).max(), abs(end.contacts["v_in"]).max(initial=0.0))
    faint = 1e-14 * float(scene.mass[~scene.is_wall].max() * fastest)
    np.testing.assert_allclose(end.contacts["impulse"], heard, rtol=1e-12, atol=faint)


@pytest.mark.rotating
@given(ANY, st.sampled_from([1.0, 0.9, 0.5]), st.integers(-20, 20), st.integers(-20, 20))
@settings(max_examples=80, deadline=None)
def test_scaling_by_powers_of_two_keeps_the_bits(scene, eps, length, time) -> None:
    s, t = 2.0**length, 2.0**time
    velocity, gravity = scene.velocity * (s / t), scene.gravity * s / (t * t)
    scaled = Scene(4.0 * scene.mass, scene.radius * s, scene.gap * s, velocity, gravity)
    a = run(scene, eps)
    b = edmd.simulate(scaled, ConstantRestitution(eps), t_end=2.0 * t, max_events=300)
    assert a.status is b.status
    assert (a.contacts["t_begin"] * t).tobytes() == b.contacts["t_begin"].tobytes()
    assert (a.velocity * (s / t)).tobytes() == b.velocity.tobytes()
    assert (a.gap * s).tobytes() == b.gap.tobytes()


def test_gaps_that_rounding_makes_negative_are_clamped_and_counted() -> None:
    clamps, options = [], {"walls": (1.0, 0.5, 0.0), "gravity": (9.81,), "gaps": (*HARD, "uneven")}
    for seed in (1, 91, 97, 166, 175, 237, 279):
        end = run(scene(np.random.default_rng(seed), (2, 8), **options), 0.9)
        assert (end.gap >= 0.0).all()
        clamps.append(end.stats["clamps"])
    assert clamps[0] == 0
    assert 0 < sum(clamps) < 100


@pytest.mark.rotating
@pytest.mark.parametrize("spread", [0.0, 9.0 * math.log(10.0)])
def test_a_long_elastic_run_keeps_energy_and_order(spread) -> None:
    box = gas(1, 50, spread)
    scene = box.replace(gap=np.where(np.random.default_rng(1).random(51) < 0.5, 1e-15, box.gap))
    end = edmd.simulate(scene, ConstantRestitution(1.0), max_events=30_000, t_start=1e12, log=False)
    assert (end.gap >= 0.0).all()
    drift = end.energy()[-1] / end.energy()[0] - 1.0
    assert abs(drift) < 1e-13


def test_the_rounding_of_mass_shares_does_not_add_up() -> None:
    """Two rounded shares per pair would make the energy drift by 1e-13 here."""
    pytest.importorskip("numba")
    scene = gas(1, 200, 3.0)
    end = edmd.simulate(scene, ConstantRestitution(1.0), max_events=1_000_000, log=False, engine="compiled")
    energy = [math.fsum((0.5 * scene.mass[1:-1] * row[1:-1] ** 2).tolist()) for row in end.velocity]
    assert abs(energy[1] / energy[0] - 1.0) < 2e-14
