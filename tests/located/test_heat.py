"""Soft spheres between thermal walls by located events: draws, heat, hits within contacts, and how they conduct."""

import math

import numpy as np
import pytest

import granular as gr

pytestmark = pytest.mark.core
LAWS = [gr.LinearDashpot(1e3), gr.LinearDashpot(30.0, 0.3), gr.Hertz(1e3), gr.ViscoelasticHertz(1e3, 10.0)]


def gas(n, seed, cold=1.0, hot=2.0):
    """Points of 1 kg, one to a metre, between walls of two temperatures."""
    rng = np.random.default_rng(seed)
    mass = np.concatenate([[math.inf], np.ones(n), [math.inf]])
    velocity = np.concatenate([[0.0], (hot * cold) ** 0.25 * rng.normal(size=n), [0.0]])
    return gr.Scene(mass, np.zeros(n + 2), n * rng.dirichlet(np.ones(n + 1)), velocity,
                    floor=gr.walls.Thermal(hot, seed), ceiling=gr.walls.Thermal(cold, seed + 1))


@pytest.mark.parametrize("law", LAWS)
def test_hits_draw_in_order_and_the_account_closes(law):
    scene = gas(4, 0)
    run = gr.md.simulate(scene, law, t_end=20.0, samples=50)
    books = run.account()
    sums = books["energy"] - books["heat"].sum(axis=1) - books["work"].sum(axis=1) + books["dissipated"]
    hits = run.contacts[np.isin(run.contacts["pair"], (0, scene.n_pairs - 1))]
    passed = abs(0.5 * (hits["v_out"] ** 2 - hits["v_in"] ** 2)).sum()
    assert abs(sums - sums[0]).max() < 1e-13 * passed
    assert books["work"].tolist() == np.zeros((50, 2)).tolist()
    for side, pair in enumerate((0, scene.n_pairs - 1)):
        rows = run.of(pair)
        ball = scene.thermal_walls[side]
        away = rows["v_out"][:, 1 - side] * (1 - 2 * side)
        assert away.tolist() == [ball.drawn(side, hit, 1.0) for hit in range(len(rows))]
        given = 0.5 * (rows["v_out"] ** 2 - rows["v_in"] ** 2).sum()
        assert books["heat"][-1, side] == pytest.approx(given, abs=1e-12)
        assert rows["impulse"] == pytest.approx(abs(rows["v_out"] - rows["v_in"])[:, 1 - side], abs=1e-12)
        assert len(rows) > 1
    assert (run.gap[:, [0, -1]] >= 0.0).all()


@pytest.mark.parametrize("law", LAWS[1:3])
def test_resumed_bit_for_bit_with_the_numbers_that_would_have_come(law, tmp_path):
    scene = gas(4, 3)
    whole = gr.md.simulate(scene, law, t_end=12.0)
    inside = whole.contacts[(whole.contacts["duration"] > 0.0) & (whole.contacts["t_begin"] > 4.0)]
    first = gr.md.simulate(scene, law, t_end=float(inside["t_begin"][0] + 0.3 * inside["duration"][0]))
    first.save(tmp_path / "first.npz")
    for start in (first, gr.Trajectory.load(tmp_path / "first.npz")):
        rest = gr.md.resume(start, t_end=12.0)
        assert rest.velocity[-1].tobytes() == whole.velocity[-1].tobytes()
        assert rest.gap[-1].tobytes() == whole.gap[-1].tobytes()
        assert rest.ledger[-1].tobytes() == whole.ledger[-1].tobytes()


def test_stopped_before_a_force_that_a_hit_brings_back():
    scene, law = gas(3, 3), gr.ViscoelasticHertz(50.0, 2.0)
    whole = gr.md.simulate(scene, law, t_end=8.0)
    stop = gr.md.simulate(scene, law, until=gr.until.contact(1, 4))
    assert stop.time[-1] in whole.of(0)["t_begin"]  # pair 1 was in its run-off
    rest = gr.md.resume(stop, t_end=8.0)
    assert rest.velocity[-1] == pytest.approx(whole.velocity[-1], abs=1e-13)


def test_a_wall_that_moves_and_heats_does_work_too():
    scene = gas(3, 5)
    scene = scene.replace(velocity=np.array([0.05, *scene.velocity[1:-1], -0.02]))
    run = gr.md.simulate(scene, gr.LinearDashpot(50.0, 0.2), t_end=15.0, samples=9)
    books = run.account()
    sums = books["energy"] - books["heat"].sum(axis=1) - books["work"].sum(axis=1) + books["dissipated"]
    impulse = [run.of(pair)["impulse"].sum() for pair in (0, 3)]
    assert abs(sums - sums[0]).max() < 1e-12
    assert books["work"][-1] == pytest.approx([0.05 * impulse[0], 0.02 * impulse[1]], rel=1e-12)


def test_until_limits_and_disturbance():
    scene = gas(3, 1)
    run = gr.md.simulate(scene, LAWS[1], until=gr.until.contact(0, 3))
    assert (run.status, run.count(0)) == (gr.Status.until, 2)
    assert run.gap[-1, 0] == pytest.approx(0.0, abs=1e-15)
    run = gr.md.simulate(scene, LAWS[1], t_end=1e9, max_events=30)
    assert (run.status, len(run.contacts)) == (gr.Status.max_events, 30)
    whole = gr.md.simulate(scene, LAWS[1], t_end=30.0)
    run = gr.md.simulate(scene, LAWS[1], t_end=30.0, disturbed="stop")
    assert run.status is gr.Status.disturbed
    assert run.first_disturbed == whole.first_disturbed
    alone = gr.md.simulate(scene, LAWS[1], t_end=30.0, disturbed="ignore")
    assert alone.status is gr.Status.time
    assert (alone.gap[-1, [0, -1]] >= 0.0).all()
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run with a thermal wall does not "
                                         r"end by itself\. Give t_end=, until= or max_events=\."):
        gr.md.simulate(scene, LAWS[0])


def test_a_ball_at_rest_on_a_thermal_floor_is_thrown_up():
    floor = gr.walls.Thermal(1.5, 3)
    scene = gr.Scene([math.inf, 2.0, 1.0], [0.0] * 3, [0.0, 0.0], [0.0] * 3, gravity=1.0, floor=floor)
    run = gr.md.simulate(scene, gr.LinearDashpot(1e3, 1.0), t_end=5.0)
    assert run.contacts["t_begin"][0] == 0.0
    assert run.of(0)["v_out"][0, 1] == scene.floor.drawn(0, 0, 2.0)
    assert run.count(0) > 3
