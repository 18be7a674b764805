"""Rings, thermal walls and pendula as scenes: what they say of themselves, what is refused, files."""

import math

import numpy as np
import pytest

import granular as gr
from granular._engine.kernels import compiled, have_numba
from granular.scene import positions, velocities
from granular.scene.walls.thermal import threefry

THERMAL = gr.walls.Thermal(2.0, 7)


def ring(**more):
    return gr.Scene([1.0, 2.0, 3.0], [0.1] * 3, [0.1, 0.2, 0.3], [1.0, 2.0, 0.5], ring=True, **more)


def pendula(**more):
    return gr.Scene([1.0, 2.0, 3.0], [0.1] * 3, [0.1, 0.2], [1.0, 2.0, 0.5], pendulum=2.0, **more)


def test_a_ring_has_as_many_pairs_as_balls():
    scene = ring(origin=0.5)
    assert scene.n_pairs == 3
    assert "ring" in repr(scene)
    assert [pair.m_eff for pair in scene.pairs] == pytest.approx([2 / 3, 6 / 5, 3 / 4], abs=1e-15)
    assert scene.across(scene.velocity).tolist() == [1.0, -1.5, 0.5]
    assert [x.tolist() for x in scene.neighbours] == [[0, 1, 2], [1, 2, 0]]
    assert scene.bodies(2) == (2, 0)
    assert np.allclose(scene.position, [0.5, 0.8, 1.2], atol=1e-15)


def test_a_ring_by_its_length_is_a_ring_by_its_gaps():
    scene = gr.Scene.from_positions([1.0] * 3, [0.1] * 3, [0.0, 0.3, 0.7], [1.0, 0.0, 0.0], length=1.2)
    assert scene.ring
    assert np.allclose(scene.gap, [0.1, 0.2, 0.3], atol=1e-15)
    with pytest.raises(ValueError, match=r"`length` must be a finite number of at least 0\.7, got 0\.6\. All "
                                         r"centres lie on the ring\."):
        gr.Scene.from_positions([1.0] * 3, [0.1] * 3, [0.0, 0.3, 0.7], [1.0, 0.0, 0.0], length=0.6)


def test_positions_and_velocities_of_free_balls_on_a_ring():
    scene, t = ring(origin=0.5), np.array([0.0, 0.25, 3.0])
    gap = scene.gap + np.outer(t, scene.across(scene.velocity))
    assert np.allclose(positions(scene, gap, t), scene.position + np.outer(t, scene.velocity), atol=1e-14)
    rate = np.broadcast_to(scene.across(scene.velocity), (3, 3))
    assert np.allclose(velocities(scene, rate, t), np.broadcast_to(scene.velocity, (3, 3)), atol=1e-15)


def test_free_pendula_swing_about_their_rest():
    scene, t = pendula(rest_gap=[0.05, 0.0], origin=0.3), np.linspace(0.0, 5.0, 9)
    y0, v0, c, s = scene.displacement, scene.velocity, np.cos(2.0 * t)[:, None], np.sin(2.0 * t)[:, None]
    assert np.allclose(y0, [0.3, 0.35, 0.55], atol=1e-15)
    y, v = y0 * c + v0 / 2.0 * s, v0 * c - 2.0 * y0 * s
    gap = scene.rest_gap + np.diff(y)
    assert np.allclose(positions(scene, gap, t), scene.at_rest + y, atol=1e-14)
    assert np.allclose(velocities(scene, np.diff(v), t), v, atol=1e-14)


def test_a_wall_is_where_pendula_beside_it_rest():
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, 1.0], origin=2.0, pendulum=1.0, rest_gap=[0.2])
    assert scene.at_rest.tolist() == [2.0, 2.3]
    assert scene.displacement.tolist() == [0.0, 0.3]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: gr.walls.Thermal(-1.0),
            r"`temperature` must be a finite number above 0, got -1\.0\. It is k_B T in J\. A wall that only "
            r"reflects balls is not thermal\."),
        (lambda: gr.walls.Thermal(0.0),
            r"`temperature` must be a finite number above 0, got 0\.0\. It is k_B T in J\. A wall that only "
            r"reflects balls is not thermal\."),
        (lambda: gr.walls.Thermal(1.0, -1), r"`seed` must be an integer of at least 0, got -1\."),
        (lambda: gr.Scene([math.inf, 1.0], [0.0, 0.1], [-0.5], [0.0, 1.0], floor=THERMAL),
         r"`gap\[0\]` must be at least 0 at a thermal wall, got -0\.5\. A thermal wall acts at the onset of "
         r"contact, so balls cannot overlap it\."),
        (lambda: ring(gravity=9.81),
            r"`gravity` must be 0 on a ring, got 9\.81\. Gravity would accelerate the balls around the ring "
            r"forever\. Use external_force\."),
        (lambda: ring(pendulum=1.0), r"`pendulum` must be 0 on a ring, got 1\.0\."),
        (lambda: ring(floor=THERMAL),
            r"`floor` must be None if the first body is a ball, got Thermal\(temperature=2\.0, seed=7\)\. Give the "
            r"body the mass math\.inf\."),
        (lambda: ring().replace(mass=[math.inf, 1.0, 1.0], radius=[0.0, 0.1, 0.1]),
            r"`mass\[0\]` must be finite on a ring, got inf\. A ring has no walls\."),
        (lambda: ring().replace(ring=False), r"`gap` must be an array of shape \(2,\), got an array of shape \(3,\)"),
        (lambda: ring().replace(ring=1), "`ring` must be True or False, got 1"),
        (lambda: ring().replace(gap=[0.1, 0.2]),
            r"`gap` must be an array of shape \(3,\), got an array of shape \(2,\)\. Give one gap per pair; the "
            r"last pair joins the last ball and ball 0\."),
        (lambda: ring(rest_gap=[0.0, 0.0]),
            r"`rest_gap` must be None without pendula, got \[0\.0, 0\.0\]\. Give `pendulum`, Ω in rad/s\."),
        (lambda: pendula(rest_gap=[0.0]),
            r"`rest_gap` must be an array of shape \(2,\), got an array of shape \(1,\)\. Give one per pair\."),
        (lambda: pendula(rest_gap=[0.0, -1.0]), r"`rest_gap\[1\]` must be finite and non-negative, got -1\.0\."),
        (lambda: pendula(gravity=9.81),
            r"`gravity` must be 0 for pendula, got 9\.81\. Gravity acts on them by Ω² = g/l\."),
        (lambda: pendula(external_force=[1.0, 0.0, 0.0]),
            r"`external_force` must be None for pendula, got forces and pendulum = 2\.0\. A constant force shifts "
            r"their rest positions: change `gap` and `rest_gap` instead\."),
        (lambda: pendula().replace(pendulum=-1.0), r"`pendulum` must be a finite number of at least 0, got -1\.0\."),
        (lambda: gr.Scene([math.inf, 1.0, math.inf], [0.0] * 3, [0.5, 0.5], [0.0] * 3, pendulum=1.0,
                          rest_gap=[0.5, 0.4]),
         r"The sum of `rest_gap` must equal the sum of `gap` between two walls, 1\.0, got 0\.9\."),
        (lambda: pendula().replace(pendulum=1e200),
            r"`pendulum` must be a frequency whose square is finite, got 1e\+200\."),
        (lambda: gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, 1.0], pendulum=1.0, floor=THERMAL),
         r"Walls next to pendula must be at rest, got pendulum = 1\.0 and a moving wall\. Leave out `floor`, "
         r"`ceiling` and the velocity of the wall\."),
        (lambda: gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [1.0, 1.0], pendulum=1.0),
         r"Walls next to pendula must be at rest, got pendulum = 1\.0 and a moving wall\. Leave out `floor`, "
         r"`ceiling` and the velocity of the wall\."),
    ],
)
def test_what_cannot_be_is_a_sentence(make, words):
    with pytest.raises((TypeError, ValueError), match=words):
        make()


HEATED = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, 1.0], floor=THERMAL)


@pytest.mark.parametrize("scene", [ring(), pendula(rest_gap=[0.05, 0.0]), HEATED])
def test_scenes_are_equal_by_what_they_say_and_go_through_toml(scene):
    assert scene == scene.replace()
    assert hash(scene) == hash(scene.replace())
    case = gr.Case(scene, gr.LinearDashpot(1e6, 0.1), t_end=0.5)
    assert gr.cases.loads(gr.cases.dumps(case)).scene == scene
    plain = {"ring": False, "pendulum": 0.0, "rest_gap": None, "floor": None, "gap": scene.gap[: scene.n - 1]}
    assert scene != scene.replace(**plain)


def test_known_answers_of_the_random_numbers():
    ones, pi = (0xFFFFFFFF,) * 4, (0x13198A2E, 0x03707344, 0x243F6A88, 0x85A308D3)
    known = {(0,) * 4: (0x6B200159, 0x99BA4EFE), ones: (0x1CB996FC, 0xBB002BE7), pi: (0xC4923A9C, 0x483DF7A0)}
    for given, words in known.items():
        assert threefry(*given) == words
        if have_numba():
            assert compiled(threefry)(*given) == words


def test_a_thermal_wall_draws_the_maxwellian_of_the_flux():
    speeds = np.array([THERMAL.drawn(0, hit, 0.5) for hit in range(20_000)])
    scale = 2.0 / 0.5  # T/m
    assert abs((speeds**2).mean() / (2.0 * scale) - 1.0) < 4.0 / math.sqrt(20_000)
    assert abs(speeds.mean() / math.sqrt(math.pi / 2.0 * scale) - 1.0) < 4.0 * 0.523 / math.sqrt(20_000)
    assert speeds.min() > 0.0
    assert speeds.max() < THERMAL.fastest(0.5)
    others = [THERMAL.drawn(1, 0, 0.5), gr.walls.Thermal(2.0, 8).drawn(0, 0, 0.5), THERMAL.drawn(0, 2**32, 0.5),
              gr.walls.Thermal(2.0, 7 + 2**32).drawn(0, 0, 0.5), speeds[0]]
    assert len(set(others)) == 5
