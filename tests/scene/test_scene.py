"""The scene itself: checks, pairs, walls, gravity."""

import copy
import math
import pickle

import numpy as np
import pytest

from granular import ConstantRestitution, edmd, scenes
from granular.scene import Pair, Scene, positions

pytestmark = pytest.mark.core
INF = math.inf


def floor_and_two(**changes) -> Scene:
    values = {"mass": [INF, 2.0, 1.0], "radius": [0.0, 0.1, 0.2], "gap": [0.5, 1e-3], "velocity": [0.0, -1.0, 2.0],
              "gravity": 9.81}
    return Scene(**(values | changes))


def test_pairs_know_their_effective_mass_and_radius():
    floor, balls = floor_and_two().pairs
    assert floor == Pair(2.0, 0.1, 0)
    assert balls.m_eff == pytest.approx(2.0 / 3.0, rel=1e-15)
    assert balls.r_eff == pytest.approx(0.1 * 0.2 / 0.3, rel=1e-15)
    assert balls.index == 1


@pytest.mark.exact
def test_effective_mass_of_extreme_ratios_neither_overflows_nor_cancels():
    assert Scene([1e300, 1e-300], [0.0, 0.0], [1.0], [0.0, 0.0]).pairs[0].m_eff == 1e-300
    assert Scene([1e300, 1e300], [0.0, 0.0], [1.0], [0.0, 0.0]).pairs[0].m_eff == 0.5e300


def test_gravity_pulls_gaps_at_walls_only():
    scene = Scene([INF, 1.0, 1.0, INF], [0.0] * 4, [1.0] * 3, [0.0] * 4, gravity=9.81)
    assert scene.closing_acceleration.tolist() == [9.81, 0.0, -9.81]
    assert Scene([1.0, 1.0], [0.0] * 2, [1.0], [0.0] * 2, gravity=9.81).closing_acceleration.tolist() == [0.0]


def test_positions_are_centres_of_balls_and_surfaces_of_walls():
    scene = floor_and_two(origin=10.0)
    assert scene.position == pytest.approx([10.0, 10.6, 10.901])
    rows = positions(scene, np.array([[0.5, 1e-3], [0.0, 0.0]]), np.zeros(2))
    assert rows == pytest.approx(np.array([[10.0, 10.6, 10.901], [10.0, 10.1, 10.4]]))


def test_from_positions_finds_the_gaps():
    scene = floor_and_two()
    again = Scene.from_positions(scene.mass, scene.radius, scene.position, scene.velocity, scene.gravity)
    assert again.gap == pytest.approx(scene.gap, abs=1e-15)
    assert again.origin == scene.origin


def test_a_scene_cannot_be_changed_only_replaced():
    scene = floor_and_two()
    with pytest.raises(ValueError, match="read-only"):
        scene.mass[1] = 3.0
    with pytest.raises(AttributeError):
        scene.gravity = 1.0
    lunar = scene.replace(gravity=1.62)
    assert (lunar.gravity, scene.gravity) == (1.62, 9.81)
    assert (lunar.mass == scene.mass).all()


def test_a_scene_keeps_its_own_copy():
    gap = np.array([0.5, 1e-3])
    scene = floor_and_two(gap=gap)
    gap[0] = 7.0
    assert scene.gap[0] == 0.5


def test_momentum_and_name_leave_out_the_walls():
    scene = floor_and_two(velocity=[3.0, -1.0, 2.0])
    assert scene.momentum() == 0.0
    assert str(scene) == "Scene(2 balls, floor, g = 9.81 m/s²)"
    assert str(Scene([1.0, INF], [0.0, 0.0], [1.0], [0.0, 0.0])) == "Scene(1 ball, ceiling)"


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"mass": [INF, -2.0, 1.0]}, r"`mass\[1\]` must be positive, got -2\.0\. Use math\.inf for a wall"),
    ({"mass": [INF, math.nan, 1.0]}, r"`mass\[1\]` must be positive.*, got nan"),
    ({"mass": [1.0, INF, 1.0]},
        r"`mass\[1\]` must be finite, got inf\. Only the first and the last body can be walls\."),
    ({"mass": [1.0]}, r"`mass` must be an array of at least 2 bodies, got 1\. A floor counts as a body \(mass inf\)\."),
    ({"mass": [INF, INF], "radius": [0, 0], "gap": [1], "velocity": [0, 0]},
        r"`mass` must be finite for at least one body, got inf for every body\."),
    ({"mass": [[1.0, 2.0]]}, r"`mass` must be a one-dimensional array, got an array of shape \(1, 2\)"),
    ({"radius": [0.0, -0.1, 0.2]}, r"`radius\[1\]` must be finite and non-negative.*, got -0\.1"),
    ({"radius": [0.1, 0.1, 0.2]}, r"`radius\[0\]` must be 0, got 0\.1\. A wall is flat and has radius 0\."),
    ({"gap": [0.5]},
        r"`gap` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give one gap per pair of "
        r"neighbours\."),
    ({"gap": [0.5, math.nan]}, r"`gap\[1\]` must be finite.*, got nan"),
    ({"velocity": [0.0, INF, 0.0]}, r"`velocity\[1\]` must be finite.*, got inf"),
    ({"gravity": -9.81},
        r"`gravity` must be a finite number of at least 0, got -9\.81\. It always points downwards\."),
    ({"origin": INF}, r"`origin` must be a finite number, got inf"),
])
def test_misuse_is_a_sentence(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        floor_and_two(**changes)


def test_words_are_not_numbers():
    with pytest.raises(TypeError, match=r"`mass` must be an array of numbers, got \['a', 'b'\]"):
        Scene(["a", "b"], [0.0, 0.0], [1.0], [0.0, 0.0])


def test_positions_must_rise():
    with pytest.raises(ValueError, match=r"`position\[1\]` must be at least as large as the entry before it, got "
                                         r"0\.0\. Number the bodies from bottom to top\."):
        Scene.from_positions([1.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0])


def test_scenes_with_the_same_numbers_are_equal():
    one, same, other = (scenes.three_balls(gap=gap) for gap in (1e-3, 1e-3, 1e-4))
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert one != "three-balls"
    assert {one: 1}[pickle.loads(pickle.dumps(same))] == 1
    still = one.replace(velocity=[0.0, -0.0, 0.0])
    assert still == one
    assert hash(still) == hash(one)


@pytest.mark.parametrize("made", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_copies_know_nothing_yet_and_cannot_be_written_into(made):
    scene = floor_and_two()
    edmd.simulate(scene, ConstantRestitution(0.5), t_end=0.1)
    assert "_initial_records" in vars(scene)
    again = made(scene)
    assert again == scene
    assert not [name for name in vars(again) if name in ("_initial_records", "_scales", "_check_scene")]
    with pytest.raises(ValueError, match="read-only"):
        again.velocity[:] = 3.0


def test_point_particles_may_have_changed_places():
    assert scenes.gas(3, packing=0.0).replace(gap=[-1.0] * 4).gap[0] == -1.0


def test_a_scene_is_shown_as_a_table_in_its_own_order_and_long_ones_are_abridged():
    rows = [line.split() for line in repr(floor_and_two(velocity=[0.0, -1.0, 2.5])).splitlines()[2:]]
    assert [(row[0], row[-1]) for row in rows] == [("0", "0"), ("1", "-1"), ("2", "2.5")]
    many = repr(Scene(np.ones(1000), np.zeros(1000), np.zeros(999), np.zeros(1000)))
    assert [line.split()[0] for line in many.splitlines()[2:]] == [*"012345", "…", *map(str, range(994, 1000))]
