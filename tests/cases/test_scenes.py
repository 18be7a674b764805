"""Ready-made scenes: what they contain, and the sentence that answers misuse."""

import inspect
import math

import numpy as np
import pytest

from granular import cases, edmd, scenes
from granular.cases import ready
from granular.cases.ready import first_impact_speed
from granular.laws.rules import ConstantRestitution
from granular.md.binary import restitution
from granular.scene import Scene
from granular.scene.walls import Thermal

pytestmark = pytest.mark.core
READY = [scenes.three_balls, scenes.ball_stack, scenes.newtons_cradle, scenes.chain, scenes.column, scenes.gas,
         scenes.bouncing_ball, scenes.vibrated_column, scenes.compressed_chain, scenes.ring_gas, scenes.heated_gas,
         scenes.pendulum_cradle]


@pytest.mark.parametrize("make", READY, ids=lambda make: make.__name__)
def test_every_scene_stands_by_itself_and_documents_each_parameter(make):
    scene = make(law=None) if make is scenes.compressed_chain else make()  # overlaps follow the law
    assert isinstance(scene, Scene)
    assert (scene.gap >= 0.0).all()
    for name in inspect.signature(make).parameters:
        assert f"\n{name} : " in inspect.getdoc(make), f"{name} is not documented"


@pytest.mark.exact
def test_three_balls_is_the_paper_s_scene():
    scene = scenes.three_balls()
    assert scene.n == 3
    assert math.isinf(scene.mass[0])
    assert scene.mass[1:] == pytest.approx([3.7699111843077517, 0.0037699111843077517], rel=1e-15)
    assert scene.gap.tolist() == [0.5, 1e-4]
    assert scene.position[1] == pytest.approx(0.6)
    assert scene.gravity == 9.81
    assert scene.pairs[0].m_eff == scene.mass[1]
    assert scene.pairs[0].r_eff == 0.1


@pytest.mark.exact
def test_a_stack_is_dropped_or_meets_the_floor_with_a_speed():
    dropped = scenes.ball_stack(4, 0.5, height=2.0)
    thrown = scenes.ball_stack(masses=[3.0, 1.0], speed=2.0, gravity=0.0)
    assert dropped.mass[1:].tolist() == [1.0, 0.5, 0.25, 0.125]
    assert dropped.gap.tolist() == [2.0, 1e-4, 1e-4, 1e-4]
    assert not dropped.velocity.any()
    assert thrown.mass[1:].tolist() == [3.0, 1.0]
    assert thrown.gap.tolist() == [0.0, 1e-4]
    assert thrown.velocity.tolist() == [0.0, -2.0, -2.0]


def test_a_cradle_moves_from_the_left():
    scene = scenes.newtons_cradle(4, moving=2, gap=[0.0, 1e-3, 0.0], speed=3.0)
    assert scene.velocity.tolist() == [3.0, 3.0, 0.0, 0.0]
    assert scene.gap.tolist() == [0.0, 1e-3, 0.0]
    assert scene.gravity == 0.0


def test_a_chain_is_uniform_tapered_or_of_two_masses():
    assert scenes.chain(3, striker=5.0).mass.tolist() == [5.0, 1.0, 1.0]
    assert scenes.chain(4, mass_ratio=0.5).mass.tolist() == [1.0, 0.5, 0.25, 0.125]
    assert scenes.chain(4, dimer=0.25, mass=2.0).mass.tolist() == [2.0, 0.5, 2.0, 0.5]
    assert scenes.chain(4).velocity.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_column_takes_the_floor_s_gap_first():
    scene = scenes.column(3, gap=[0.5, 1e-3, 2e-3], speed=2.0)
    assert scene.gap.tolist() == [0.5, 1e-3, 2e-3]
    assert scene.velocity.tolist() == [0.0, -2.0, -2.0, -2.0]
    assert scenes.column(1).n == 2


def test_a_gas_fills_its_line_and_has_its_temperature():
    scene = scenes.gas(4000, length=80.0, packing=0.25, temperature=3.0, mass=2.0, mass_spread=10.0)
    r, m, v = scene.radius[1:-1], scene.mass[1:-1], scene.velocity[1:-1]
    assert 2.0 * r.sum() == pytest.approx(20.0)
    assert scene.position[-1] - scene.position[0] == pytest.approx(80.0)
    assert (m * v**2).mean() == pytest.approx(3.0, rel=0.1)
    assert m.max() / m.min() <= 10.0
    assert m.max() / m.min() > 9.0
    assert np.exp(np.log(m).mean()) == pytest.approx(2.0, rel=0.05)
    assert r**3 / m == pytest.approx(r[0] ** 3 / m[0])


@pytest.mark.parametrize("speeds", ["maxwell", "uniform", "two"])
def test_every_speed_distribution_has_the_temperature(speeds):
    scene = scenes.gas(4000, speeds=speeds, temperature=2.0, walls=False)
    assert (scene.mass * scene.velocity**2).mean() == pytest.approx(2.0, rel=0.1)


def test_a_gas_is_the_same_for_the_same_seed_only():
    assert (scenes.gas(seed=3).gap == scenes.gas(seed=3).gap).all()
    assert (scenes.gas(seed=3).gap != scenes.gas(seed=4).gap).any()


def test_a_gas_without_walls_lies_where_the_one_with_walls_does():
    free, walled = scenes.gas(7, walls=False), scenes.gas(7)
    assert free.n == 7
    assert free.position == pytest.approx(walled.position[1:-1])
    assert (free.velocity == walled.velocity[1:-1]).all()


def test_a_bouncing_ball_starts_with_its_lowest_point_at_the_drop_height():
    scene = scenes.bouncing_ball(height=2.0, radius=0.1, speed=1.0)
    assert scene.gap.tolist() == [2.0]
    assert scene.velocity.tolist() == [0.0, -1.0]
    assert not np.signbit(scenes.bouncing_ball().velocity).any()


@pytest.mark.parametrize(("call", "sentence"), [
    (lambda: scenes.three_balls((0.1,)),
        r"`radii` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give the lower and the upper"),
    (lambda: scenes.three_balls((0.1, -0.01)), r"`radii\[1\]` must be positive.*, got -0\.01"),
    (lambda: scenes.three_balls(height=0.05), r"`height` must be .*at least 0\.1, got 0\.05\. It is .*centre"),
    (lambda: scenes.three_balls(density=0.0), r"`density` must be .*above 0, got 0\.0"),
    (lambda: scenes.three_balls(gravity=-9.81),
        r"`gravity` must be a finite number of at least 0, got -9\.81\. It always points downwards\."),
    (lambda: scenes.ball_stack(height=1.0, speed=1.0),
        r"Only one of `height` and `speed` can be given, got 1\.0 and 1\.0\. A stack with a speed starts at the "
        r"floor\."),
    (lambda: scenes.ball_stack(masses=[1.0, math.inf]),
        r"`masses\[1\]` must be positive and finite, got inf\. The floor is part of the scene\."),
    (lambda: scenes.ball_stack(n=2.5), r"`n` must be an integer of at least 1, got 2\.5"),
    (lambda: scenes.ball_stack(3, gap=[1e-4]),
        r"`gap` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give one gap for all pairs, or "
        r"one per pair from the bottom up\."),
    (lambda: scenes.newtons_cradle(3, moving=3),
        r"`moving` must be an integer from 1 to 2, got 3\. At least one ball has to be at rest\."),
    (lambda: scenes.chain(1), r"`n` must be an integer of at least 2, got 1"),
    (lambda: scenes.chain(striker=0.0), r"`striker` must be .*above 0, got 0\.0"),
    (lambda: scenes.column(speed=-1.0),
        r"`speed` must be a finite number of at least 0, got -1\.0\. It always points downwards\."),
    (lambda: scenes.gas(packing=1.0), r"`packing` must be a fraction of the length below 1, got 1\.0\."),
    (lambda: scenes.gas(speeds="maxwel"),
        r"`speeds` must be one of maxwell, uniform, two, got 'maxwel'\. Did you mean 'maxwell'\?"),
    (lambda: scenes.gas(mass_spread=0.5), r"`mass_spread` must be .*at least 1, got 0\.5"),
    (lambda: scenes.gas(seed=-1), r"`seed` must be an integer of at least 0, got -1"),
])
def test_misuse_is_a_sentence(call, sentence):
    with pytest.raises(ValueError, match=sentence):
        call()


@pytest.mark.parametrize("speeds", ["maxwell", "uniform", "two"])
def test_a_gas_on_a_ring_is_at_rest_and_has_its_temperature(speeds):
    scene = scenes.ring_gas(7, length=3.0, packing=0.2, temperature=2.0, speeds=speeds, mass_spread=4.0, seed=3)
    assert scene.ring
    assert scene.n_pairs == 7
    assert scene.gap.sum() == pytest.approx(2.4)
    assert 2.0 * scene.radius.sum() == pytest.approx(0.6)
    assert scene.momentum() == pytest.approx(0.0, abs=1e-14)
    assert scene.mass @ scene.velocity**2 == pytest.approx(7 * 2.0)
    assert not scenes.ring_gas(3, temperature=0.0).velocity.any()


def test_a_heated_gas_between_walls_or_above_a_floor():
    scene = scenes.heated_gas(40, lower=4.0, mass=2.0, dimer=0.5, seed=2)
    assert (scene.floor, scene.ceiling) == (Thermal(4.0, 2), Thermal(2.0, 2))
    assert scene.mass[1:-1].tolist() == [2.0, 1.0] * 20
    assert scene.gap.sum() == pytest.approx(45.0)
    assert scenes.heated_gas(upper=7.0, gravity=1.0).ceiling == Thermal(7.0, 1)
    inside = scenes.heated_gas(20_000, lower=4.0, dimer=0.5)
    assert inside.mass[1:-1] @ inside.velocity[1:-1] ** 2 / 20_000 == pytest.approx(math.sqrt(8.0), rel=0.03)


def test_a_hot_floor_begins_with_the_barometric_height():
    points = [scenes.heated_gas(50, packing=0.0, lower=3.0, gravity=2.0, mass=0.5, seed=seed) for seed in range(200)]
    assert not any(scene.is_wall[-1] for scene in points)
    height = np.mean([scene.position[1:].mean() for scene in points])
    assert height == pytest.approx(3.0 / (0.5 * 2.0), abs=4.0 * 3.0 / math.sqrt(50 * 200))


def test_a_cradle_on_strings_is_pulled_aside():
    scene = scenes.pendulum_cradle(4, moving=2, amplitude=0.1, rest_gap=[0.0, 0.01, 0.02], length=2.0, gravity=8.0)
    assert scene.pendulum == 2.0
    assert scene.displacement == pytest.approx([-0.1, -0.1, 0.0, 0.0], abs=1e-15)
    assert scene.gap == pytest.approx([0.0, 0.11, 0.02])
    assert not scene.velocity.any()
    assert cases.make("pendulum-cradle").t_end == pytest.approx(20.0 * math.pi * math.sqrt(1.0 / 9.81))
    assert first_impact_speed(scenes.pendulum_cradle(amplitude=0.3, rest_gap=0.1)) == pytest.approx(
        math.sqrt(9.81 * (0.3**2 - 0.1**2)))


LONE_PAIRS = {  # made of mass, gap, velocity, and how far apart pendula hang
    "above a floor": lambda m, gap, v, rest: Scene([math.inf, m], [0.0, 0.1], [gap], [0.0, v], gravity=9.81),
    "below a ceiling": lambda m, gap, v, rest: Scene([m, math.inf], [0.1, 0.0], [gap], [v, 0.0], gravity=9.81),
    "without gravity": lambda m, gap, v, rest: Scene([m, 1.0], [0.1, 0.1], [gap], [v, 0.0]),
    "pendula": lambda m, gap, v, rest: Scene(
        [m, 1.0], [0.1, 0.1], [gap], [v, 0.0], origin=-1.0, pendulum=2.0, rest_gap=[rest]),
}


@pytest.mark.parametrize("make", LONE_PAIRS.values(), ids=LONE_PAIRS)
def test_a_first_impact_is_as_fast_as_that_of_a_pair_alone_also_of_one_that_parts_before(make):
    rng, met = np.random.default_rng(5), 0
    for _ in range(100):
        scene = make(rng.uniform(0.5, 2.0), rng.uniform(0.01, 1.0), rng.uniform(-5.0, 5.0), rng.uniform(0.0, 2.0))
        log = edmd.simulate(scene, ConstantRestitution(0.7), t_end=1e4, max_events=1).contacts
        fast = float(log["v_in"][0, 0] - log["v_in"][0, 1]) if len(log) else 0.0
        met += len(log)
        assert first_impact_speed(scene) == pytest.approx(fast, rel=1e-9)
    assert met > 5


def test_a_viscoelastic_ball_thrown_up_has_its_restitution_where_it_lands():
    scene = Scene([math.inf, 1.0], [0.0, 0.1], [1.0], [0.0, 5.0], gravity=9.81)
    (law,), _ = ready.of_restitution(scene, 0.7, law="ViscoelasticHertz")
    assert restitution(law, scene.pairs[0], math.sqrt(25.0 + 2.0 * 9.81)) == pytest.approx(0.7, rel=1e-6)


@pytest.mark.parametrize(("make", "sentence"), [
    (lambda: scenes.ring_gas(1), r"`n` must be .*at least 2.*, got 1"),
    (lambda: scenes.ring_gas(temperature=-1.0), r"`temperature` must be .*at least 0.*, got -1\.0"),
    (lambda: scenes.ring_gas(packing=1.0), r"`packing` must be a fraction of the length below 1, got 1\.0\."),
    (lambda: scenes.heated_gas(0), r"`n` must be .*at least 1.*, got 0"),
    (lambda: scenes.heated_gas(lower=0.0), r"`lower` must be a finite number above 0, got 0\.0\. It is k_B T in J\."),
    (lambda: scenes.heated_gas(upper=-1.0), r"`upper` must be a finite number above 0, got -1\.0\. It is k_B T in J\."),
    (lambda: scenes.heated_gas(gravity=-1.0), r"`gravity` must be .*at least 0.*, got -1\.0"),
    (lambda: scenes.pendulum_cradle(3, moving=3),
        r"`moving` must be an integer from 1 to 2, got 3\. At least one ball has to be at rest\."),
    (lambda: scenes.pendulum_cradle(rest_gap=[0.1]),
        r"`rest_gap` must be an array of shape \(4,\), got an array of shape \(1,\)"),
    (lambda: scenes.pendulum_cradle(rest_gap=-0.1), r"`rest_gap\[0\]` must be finite and non-negative, got -0\.1\."),
    (lambda: scenes.pendulum_cradle(amplitude=-0.1),
        r"`amplitude` must be a finite number of at least 0, got -0\.1\. Positive is to the left\."),
    (lambda: scenes.pendulum_cradle(gravity=0.0), r"`gravity` must be .*above 0.*, got 0\.0"),
])
def test_misuse_of_bounded_scenes_is_a_sentence(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()
