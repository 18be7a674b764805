"""Hard spheres beside moving walls and under forces: against a twin of 30 digits, closed forms and symmetries."""

import math

import mpmath as mp
import numpy as np
import pytest

import granular as gr
from granular.scene.walls import Motion, Piecewise, Sine
from tests.helpers import hard_twin
from tests.helpers.hard_driven import INF, drawn, plate, remainder, run, shaken

# --- against the twin


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(14))
def test_every_hit_of_the_twin_is_found(seed):
    """Random scenes: the same collisions in the same order, at the same times and speeds."""
    scene, start = drawn(seed), float([0.0, 3.7][seed % 2])
    eps = [0.8, 0.9, 1.0][seed % 3]
    with mp.workdps(30):
        rows = hard_twin.events(scene, eps, start + 3.0, 16, start)
        log = run(scene, eps, t_start=start, t_end=start + 3.0, max_events=16).contacts
        assert len(rows) == len(log)
        for (time, pair, speed), row in zip(rows, log, strict=True):
            assert pair == row["pair"]
            assert abs(time - mp.mpf(float(row["t_begin"]))) < 1e-8
            assert abs(speed - mp.mpf(float(row["v_in"][0] - row["v_in"][1]))) < 1e-6


def test_a_stable_bounce_keeps_fifteen_digits():
    """Sixty bounces near a stable orbit, late and early: the exact map in 34 digits."""
    for start in (0.0, 100.0):
        scene = plate(1, shaken(1.3, 20.0, phase=-20.0 * start), gap=0.01, velocity=0.15)
        with mp.workdps(34):
            rows = hard_twin.events(scene, 0.5, start + 20.0, 60, start)
            log = run(scene, 0.5, t_start=start, t_end=start + 20.0, max_events=60).contacts
            assert len(log) == len(rows) == 60
            worst = max(abs(time - mp.mpf(float(row["t_begin"]))) for (time, _, _), row in zip(rows, log, strict=True))
            assert worst < 1.5 * (math.ulp(start + 20.0) + 3e-15)


# --- symmetries and closed forms


def test_an_accelerated_floor_is_gravity():
    """Piecewise parabola without gravity: contacts, gaps and rest are those of a fixed floor under gravity."""
    for pieces in (1, 32):
        breaks = np.linspace(0.0, 16.0, pieces + 1)
        motion = Piecewise(breaks, [[0.5] * pieces, breaks[:-1], 0.5 * breaks[:-1] ** 2])
        for balls in (1, 3):
            fixed = gr.Scene([INF] + [1.0] * balls, [0.0] + [0.1] * balls, [0.5] * balls, [0.0] * (balls + 1), 1.0)
            a = run(fixed, 0.6, t_end=3.9, samples=9, collapse="merge", merge_below=1e-9, max_events=200)
            b = run(plate(balls, motion, gravity=0.0), 0.6, t_end=3.9, samples=9, max_events=200, collapse="merge",
                    merge_below=1e-9)
            n = min(len(a.contacts), len(b.contacts), 40)
            assert n >= 6
            assert (a.contacts["pair"][:n] == b.contacts["pair"][:n]).all()
            assert np.abs(a.contacts["t_begin"][:n] - b.contacts["t_begin"][:n]).max() < 1e-12
    ride = run(plate(1, motion, gravity=0.0), 0.5, t_end=15.0, samples=[10.0, 15.0])
    assert ride.position[:, 1].tolist() == pytest.approx([50.1, 112.6], rel=1e-14)
    assert ride.contacts["t_begin"][-1] == pytest.approx(3.0, abs=1e-6)  # t1 (1 + ε)/(1 - ε)
    assert remainder(ride) < 1e-14


def test_a_boost_changes_no_contact():
    scene = drawn(3)
    assert scene.floor is not None
    moving = scene.replace(velocity=scene.velocity + 0.75)
    a, b = (run(s, 0.9, t_end=3.0, max_events=30) for s in (scene, moving))
    assert (a.contacts["pair"] == b.contacts["pair"]).all()
    assert np.abs(a.contacts["t_begin"] - b.contacts["t_begin"]).max() < 1e-10


@pytest.mark.parametrize("seed", [1, 4, 8])
def test_other_units_give_the_same_bits(seed):
    """Lengths times 4, times times 2, masses times 8: powers of two, so every bit stays."""
    scene = drawn(seed)

    def scaled(motion):
        return None if motion is None else Sine(4.0 * motion.amplitude, 0.5 * motion.frequency, motion.phase)

    force = None if scene.external_force is None else 8.0 * scene.external_force
    other = gr.Scene(8.0 * scene.mass, 4.0 * scene.radius, 4.0 * scene.gap, 2.0 * scene.velocity, scene.gravity,
                     4.0 * scene.origin, external_force=force, floor=scaled(scene.floor),
                     ceiling=scaled(scene.ceiling))
    a, b = run(scene, 0.7, t_end=3.0, samples=7, max_events=300), run(other, 0.7, t_end=6.0, samples=7, max_events=300)
    assert np.array_equal(2.0 * a.contacts["t_begin"], b.contacts["t_begin"])
    assert np.array_equal(2.0 * a.velocity, b.velocity)
    assert np.array_equal(4.0 * a.gap, b.gap)
    assert np.array_equal(8.0 * 4.0 * a.ledger, b.ledger)


def test_accounts_of_walls_at_constant_speed():
    """Columns on a lift, boxes that are pressed: with and without a collapse."""
    lift = gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.5, 0.3], [0.7, 0.0, 0.1], 9.81)
    box = gr.Scene([INF, 1.0, 2.0, INF], [0.0, 0.1, 0.1, 0.0], [0.5, 0.3, 1.0], [0.4, 0.0, 0.1, -0.1])
    for scene in (lift, lift.replace(mass=[INF, 1.0, 1e-3]), box):
        for eps, options in ((0.5, {}), (0.5, {"collapse": "merge"}), (0.9, {"ties": "poisson"}), (0.0, {})):
            result = run(scene, eps, t_end=3.0, samples=20, **options)
            assert remainder(result) < 1e-13
            assert np.abs(result.account()["work"]).max() > 0.01


def test_a_motion_is_what_it_says():
    """A function, and the sine it is: the same contacts."""
    sine = Sine(0.1, 0.7, 0.4)
    a = run(plate(2, sine), 0.9, t_end=4.0)
    b = run(plate(2, Motion(lambda t: 0.1 * math.sin(2.0 * math.pi * 0.7 * t + 0.4))), 0.9, t_end=4.0)
    assert (a.contacts["pair"][:20] == b.contacts["pair"][:20]).all()
    assert np.abs(a.contacts["t_begin"][:20] - b.contacts["t_begin"][:20]).max() < 1e-11


def test_late_pieces_keep_their_digits():
    """The middle of a piece need not be a float: read from there, paths made steps of 1e-13 v at late breaks."""
    start, rng = 1234.5, np.random.default_rng(3)
    for _ in range(6):
        breaks = start + np.concatenate([[0.0], np.sort(rng.uniform(0.002, 0.098, 6)), [0.11]])
        c = np.vstack([rng.normal(0.0, 6.0, 7), rng.normal(0.0, 0.2, 7), np.zeros(7)])
        for j in range(6):
            c[2, j + 1] = np.polyval(c[:, j], breaks[j + 1] - breaks[j])
        scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [1e-3], [0.0, 0.0], 9.81, floor=gr.walls.Piecewise(breaks, c))
        rule = gr.ConstantRestitution(0.5)
        run = gr.edmd.simulate(scene, rule, t_start=start, t_end=start + 0.1, samples=40, engine="sorted")
        account = run.account()
        balance = account["energy"] - account["work"].sum(axis=1) + account["dissipated"]
        assert np.abs(balance - balance[0]).max() < 1e-13 * np.abs(np.diff(account["work"], axis=0)).sum()


# --- forces


def test_forces_are_gravity():
    """f = -m g above a fixed floor: contacts, status and the sentence of the collapse are those of gravity."""
    m = np.array([INF, 1.0, 3.0, 0.5])
    parts = [0.0, 0.1, 0.1, 0.1], [0.5, 0.1, 0.2], [0.0, 0.3, -0.1, 0.2]
    heavy = gr.Scene(m, *parts, 9.81)
    pulled = gr.Scene(m, *parts, external_force=np.where(np.isinf(m), 0.0, -9.81) * np.where(np.isinf(m), 0.0, m))
    for options in ({}, {"collapse": "merge"}, {"ties": "poisson"}):
        a, b = (run(s, 0.8, max_events=3000, **options) for s in (heavy, pulled))
        assert a.status is b.status
        n = min(40, len(a.contacts))
        assert (a.contacts["pair"][:n] == b.contacts["pair"][:n]).all()
        assert np.allclose(a.contacts["t_begin"][:n], b.contacts["t_begin"][:n], rtol=0.0, atol=1e-10)
        assert len(a.energy()) == len(b.energy())
        assert np.allclose(a.energy(), b.energy(), atol=1e-9)


def test_balls_pressed_together_in_mid_air_move_as_one():
    """Two balls that forces drive together: they collapse, and move on with the mean acceleration until one is hit."""
    scene = gr.Scene([1.0, 3.0, 1.0], [0.1] * 3, [0.2, 5.0], [0.0, 0.0, -2.0], external_force=[2.0, -2.5, 0.0])
    result = run(scene, 0.5, t_end=2.5, samples=[1.5, 2.0, 2.5], collapse="merge", merge_below=1e-3)
    assert result.status is gr.Status.time
    assert result.gap[:, 0].tolist() == [0.0, 0.0, 0.0]
    acceleration = np.diff(result.velocity[:, :2], axis=0) / 0.5
    assert np.abs(acceleration + 0.125).max() < 1e-12
    assert np.abs(result.momentum() + 0.5 * result.time + 2.0).max() < 1e-13
    stopped = run(scene, 0.5, t_end=2.5)
    assert stopped.status is gr.Status.bounded
    assert "pair 0–1" in stopped.message
    hit = run(scene, 0.5, t_end=8.0, collapse="merge", merge_below=1e-3)
    assert hit.count(1) >= 1
    assert hit.count(0) > result.count(0)


def test_a_piston_rests_on_a_column():
    """A heavy ball under a force presses a row of light ones on a shaken floor: it leaves where the force says."""
    scene = gr.Scene([INF, 1.0, 1.0, 2.0], [0.0, 0.1, 0.1, 0.0], [0.0] * 3, [0.0] * 4, 1.0,
                     external_force=[0.0, 0.0, 0.0, -4.0], floor=shaken(1.6, phase=-0.5 * math.pi))
    result = run(scene, 0.5, t_end=2.0 * math.pi, collapse="merge", samples=50)
    # the whole pile is pressed on by 1 + 4/4 = 2 g, so it rides all the time
    assert len(result.contacts) == 0
    light = scene.replace(external_force=[0.0, 0.0, 0.0, 2.6])  # the piston alone is pressed on by -0.3 g: it leaves
    assert run(light, 0.5, t_end=2.0, samples=3).gap[-1, 2] > 0.0
