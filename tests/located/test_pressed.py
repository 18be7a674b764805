"""Balls that forces press to a floor, to a ceiling, to both or together come to rest, and balls that leave them do not
matter: rest has no up and down, and no contact follows where none is said to follow."""

from __future__ import annotations

import math

import numpy as np
import pytest

import granular as gr

INF = math.inf
G = 9.81


SEEDS = [seed if seed < 6 else pytest.param(seed, marks=pytest.mark.soak) for seed in range(30)]


def mirrored(scene):
    """The scene upside down; gravity must be 0."""
    force = None if scene.external_force is None else -scene.external_force[::-1]
    return gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], 0.0 - scene.velocity[::-1], 0.0,
                    external_force=force)


def drawn(seed):
    """One to four balls, walls on no, one or both sides, forces of all kinds; and a law."""
    rng = np.random.default_rng([14, seed])
    n, (floor, ceiling) = int(rng.integers(1, 5)), [(1, 0), (0, 1), (1, 1), (0, 0)][int(rng.integers(4))]
    if n == 1 and not ceiling:
        floor = 1
    m = rng.choice([1.0, 0.5, 2.0, 0.3], n)
    f = m * (np.sort(rng.normal(0.0, 10.0, n))[::-1] if rng.random() < 0.3 else rng.choice([0, -G, G, -20, 20], n))
    f = -abs(f) if rng.random() < 0.3 else f
    mass = [INF] * floor + m.tolist() + [INF] * ceiling
    gap, v = rng.choice([1e-3, 1e-2, 0.0, 0.1], len(mass) - 1), rng.choice([0.0, 0.1, -0.2], len(mass))
    force = [0.0] * floor + f.tolist() + [0.0] * ceiling
    scene = gr.Scene(mass, [0.0] * len(mass), gap, np.where(np.isinf(mass), 0.0, v), external_force=force)
    k = float(10.0 ** rng.integers(3, 9))
    laws = [gr.LinearDashpot(k, 0.2 * math.sqrt(k)), gr.LinearDashpot(k, 2.0 * math.sqrt(k)), gr.TsujiHertz(k, 0.5),
            gr.ViscoelasticHertz(k, k * float(10.0 ** rng.integers(-4, -1)))]
    return scene, laws[int(rng.integers(4))]


@pytest.mark.rotating
@pytest.mark.parametrize("seed", SEEDS)
def test_rest_has_no_up_and_down(seed):
    scene, law = drawn(seed)
    up = gr.md.simulate(scene, law, max_steps=1500, engine="plain")
    down = gr.md.simulate(mirrored(scene), law, max_steps=1500, engine="plain")
    assert (up.status, len(up.contacts)) == (down.status, len(down.contacts))
    assert up.stats["resting"] == down.stats["resting"]
    if (scene.mass < INF).sum() == 1:  # then there is no order of sums
        assert up.message == down.message
        assert up.gap.tobytes() == down.gap[:, ::-1].tobytes()
        assert up.contacts["t_end"].tobytes() == down.contacts["t_end"].tobytes()


@pytest.mark.rotating
@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_follows_rest(seed):
    """A run that is said to rest has no contact that begins or ends later."""
    scene, law = drawn(seed)
    run = gr.md.simulate(scene, law, max_steps=1500, engine="plain")
    if run.status is gr.Status.resting:
        on = gr.md.simulate(scene, law, t_end=2.0 * float(run.time[-1]) + 1.0, max_steps=5000, engine="plain")
        assert on.stats["resting"]
        assert len(on.contacts) == len(run.contacts)
        np.testing.assert_array_equal(np.isnan(on.contacts["t_end"]), np.isnan(run.contacts["t_end"]))


LAWS = {"dashpot": gr.LinearDashpot(1e5, 150.0), "strong": gr.LinearDashpot(1e5, 4e3), "tsuji": gr.TsujiHertz(1e6, 1.0)}


@pytest.mark.rotating
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_ceiling_is_a_floor_upside_down(law):
    below = gr.Scene([INF, 1.0, 2.0], [0] * 3, [0.01, 0.001], [0] * 3, external_force=[0, -30.0, -7.0])
    runs = [gr.md.simulate(s, law, t_end=t, engine="plain") for s in (below, mirrored(below)) for t in (None, 30.0)]
    assert [run.status.name for run in runs] == ["resting", "time", "resting", "time"]
    assert all(run.stats["resting"] for run in runs)
    for i in (0, 1):
        np.testing.assert_allclose(runs[i].gap, runs[2 + i].gap[:, ::-1], rtol=1e-9)
        assert runs[i].stats["steps"] == pytest.approx(runs[2 + i].stats["steps"], rel=0.1)
    np.testing.assert_allclose(runs[3].force[-1], [7.0, 37.0], rtol=1e-12)


@pytest.mark.rotating
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_pressed_between_walls_and_in_flight(law):
    gap = [-1e-3, -2e-3, -1e-3]
    between = gr.Scene([INF, 1.0, 1.0, INF], [0.0] * 4, gap, [0] * 4, external_force=[0, 5.0, -3.0, 0])
    free = gr.Scene([1.0, 2.0, 3.0], [0.0] * 3, [1e-3, 2e-3], [0] * 3, 9.81, external_force=[20.0, 0.0, -20.0])
    for scene in (between, free):
        assert gr.md.simulate(scene, law, engine="plain").status is gr.Status.resting
        run = gr.md.simulate(scene, law, t_end=30.0, engine="plain")
        force, fall = run.force[-1], scene.external_force * scene.inverse_mass
        given = np.diff(np.concatenate([[0.0], force, [0.0]])) * -scene.inverse_mass + fall  # acceleration of each ball
        balls = scene.mass < INF
        np.testing.assert_allclose(given[balls], given[balls][0], rtol=0.0, atol=1e-10)
        assert (force > 0.0).all()


@pytest.mark.rotating
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.usefixtures("interpreted")
def test_a_ball_that_leaves_does_not_matter(law, way):
    """The lower ball of two comes to rest as if alone, while the upper one flies away, is far, or hangs where it is."""
    alone = gr.Scene([INF, 1.0], [0] * 2, [0.001], [0] * 2, external_force=[0, -G])
    one = gr.md.simulate(alone, law)
    for gap, force in ((0.01, 20.0), (0.01, 0.0), (0.5, 1e-9)):
        scene = gr.Scene([INF, 1.0, 1.0], [0] * 3, [0.001, gap], [0] * 3, external_force=[0, -G, force])
        two = gr.md.simulate(scene if way > 0.0 else mirrored(scene), law)
        assert two.status is one.status is gr.Status.resting
        assert len(two.contacts) == len(one.contacts)
        np.testing.assert_allclose(two.contacts["t_begin"], one.contacts["t_begin"], rtol=1e-12)
    touching = gr.Scene([INF, 1, 1], [0] * 3, [0.001, 0.01], [0] * 3, G, external_force=[0, 0, 30])
    assert gr.md.simulate(touching, law).stats["steps"] < 300


@pytest.mark.rotating
def test_several_piles_and_what_flies_between_them():
    law = gr.LinearDashpot(1e5, 400.0)
    force = [0, -10.0, -10.0, 0.0, 10.0, 10.0, 0]
    gap = [1e-3, 1e-3, 0.2, 0.2, 1e-3, 1e-3]
    scene = gr.Scene([INF, 1, 1, 1, 1, 1, INF], [0.0] * 7, gap, [0] * 7, external_force=force)
    assert gr.md.simulate(scene, law, engine="plain").status is gr.Status.resting
    drifts = scene.replace(velocity=[0, 0, 0, 0.01, 0, 0, 0])
    run = gr.md.simulate(drifts, law, t_end=1000.0, max_steps=20_000, engine="plain")
    assert run.count(2) + run.count(3) > 1
    assert not run.stats["resting"]


@pytest.mark.parametrize(("speed", "meet"), [(0.0, False), (-0.1, False), (0.1, True)])
def test_pressed_groups_in_flight(speed, meet):
    """Two pairs of balls, each pressed together, that meet, or part, or stay where they are."""
    law, v = gr.LinearDashpot(1e5, 100.0), speed
    scene = gr.Scene([1.0] * 4, [0.0] * 4, [1e-3, 1.0, 1e-3], [v, v, -v, -v], external_force=[4.0, -4.0, 4.0, -4.0])
    run = gr.md.simulate(scene, law, max_steps=20_000)
    assert run.status is gr.Status.resting
    assert (run.count(1) > 0) is meet
