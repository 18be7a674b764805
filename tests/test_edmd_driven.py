"""Hard spheres beside moving walls and under forces: against a twin of 30 digits, closed forms and symmetries."""

import json
import math
from pathlib import Path

import hard_twin
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import granular as gr
from granular.walls import Motion, Piecewise, Sine

DOUBLING = json.loads((Path(__file__).parent / "reference" / "plate_period_doubling.json").read_text(encoding="utf-8"))
INF = math.inf


def run(scene, eps=0.9, **options):
    """A run with one coefficient of restitution, by the reference queue."""
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"engine": "sorted"} | options)


def plate(balls, motion, gravity=1.0, gap=0.5, velocity=0.0, mass=1.0, **more):
    """Balls above a moving floor."""
    return gr.Scene([INF] + [mass] * balls, [0.0] + [0.1] * balls, [gap] * balls, [0.0] + [velocity] * balls, gravity,
                    floor=motion, **more)


def shaken(gamma, omega=1.0, gravity=1.0, phase=0.0):
    """A sine of so many g."""
    return Sine.from_acceleration(gamma, omega / (2.0 * math.pi), gravity, phase)


def lift():
    """Balls on a floor at constant speed, under forces."""
    force = [0.0, 1.0, -2.0]
    return gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.5, 0.3], [0.7, 0.0, 0.1], 9.81, external_force=force)


def remainder(result):
    """What the account leaves over, at most, in units of the energy that came and went."""
    account = result.account()
    rest = account["energy"] - account["work"].sum(axis=1) + account["dissipated"]
    return np.abs(rest - rest[0]).max() / (np.abs(account["work"]).max() + np.abs(account["energy"]).max())


def same(a, b, mirrored=False):
    """Whether two runs have the same bits."""
    names = ["time", "position", "velocity", "gap"] + (["ledger"] if a.ledger is not None else [])
    rows = all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in names)
    columns = a.contacts.dtype.names
    return rows and a.message == b.message and len(a.contacts) == len(b.contacts) and all(
        np.array_equal(a.contacts[name], b.contacts[name], equal_nan=True) for name in columns)


def drawn(seed, touching=0.0):
    """One to five balls between walls of which one or two shake, under gravity and forces."""
    rng = np.random.default_rng(seed)
    n, (floor, ceiling) = int(rng.integers(1, 6)), [(1, 0), (0, 1), (1, 1)][int(rng.integers(3))]
    bodies, pairs = n + floor + ceiling, n + floor + ceiling - 1

    def sine():
        return Sine(float(10 ** rng.uniform(-3, -0.7)), float(10 ** rng.uniform(-0.5, 1)), float(rng.uniform(0, 6.28)))

    ball = np.r_[[0.0] * floor, [1.0] * n, [0.0] * ceiling]
    mass = np.where(ball > 0.0, np.exp(rng.normal(size=bodies)), INF)
    gap = rng.uniform(0.5, 1.0, pairs) * (rng.random(pairs) >= touching)
    force = rng.normal(size=bodies) * 3.0 * ball if rng.random() < 0.4 else None
    return gr.Scene(mass, 0.05 * ball, gap, rng.normal(size=bodies) * ball, float(rng.choice([0.0, 1.0, 9.81])),
                    float(rng.normal()), external_force=force, floor=sine() if floor else None,
                    ceiling=sine() if ceiling and (not floor or rng.random() < 0.5) else None)


# --- against the twin


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


# --- the bouncing ball


@pytest.mark.thirds
@pytest.mark.parametrize("case", DOUBLING, ids=str)
def test_period_doubling_where_the_exact_formula_says(case):
    """Γ = √(G_k² + [2(1+ε²)/(1+ε)²]²): a thousandth and more below it the orbit is stable, above it doubles."""
    eps, k = case["restitution"], case["k"]
    exists = k * math.pi * (1.0 - eps) / (1.0 + eps)
    assert math.isclose(exists, case["gamma_exists"], rel_tol=1e-13)
    doubles = math.hypot(exists, 2.0 * (1.0 + eps * eps) / (1.0 + eps) ** 2)
    assert math.isclose(doubles, case["gamma_doubles"], rel_tol=1e-13)
    for share, period in ((-0.002, 1), (0.002, 2)):
        gamma = doubles * (1.0 + share)
        phase = math.acos(exists / gamma)
        orbit = plate(1, shaken(gamma, phase=phase), gap=0.0, velocity=k * math.pi * (1.0 + 1e-4))
        log = run(orbit, eps, t_end=1e6, max_events=2000).contacts
        late = np.mod(log["t_begin"][-64:] / (2.0 * math.pi) + phase / (2.0 * math.pi), 1.0)
        assert np.ptp(late[::period]) < 1e-6 or np.ptp(late[::period]) < 1e-3 * abs(late[0] - late[1])
        assert (np.ptp(late) > 1e-3) == (period == 2)


# --- riding


def test_a_ball_rides_for_ever_below_one_g():
    result = run(plate(1, shaken(0.999)), 0.5, t_end=300.0, samples=np.linspace(100.0, 300.0, 41))
    assert result.status is gr.Status.time
    assert result.contacts["t_begin"][-1] < 60.0
    floor = 0.999 * np.sin(result.time)
    assert np.abs(result.position[:, 1] - floor - 0.1).max() < 1e-12
    assert np.abs(result.velocity[:, 1] - 0.999 * np.cos(result.time)).max() < 1e-13
    assert remainder(result) < 1e-14


@pytest.mark.parametrize("balls", [1, 3])
def test_what_rides_leaves_where_nothing_presses_it(balls):
    """From rest at Γ = 1.2: it leaves where sin ωt = 1/Γ, and comes back on a parabola; a pile as one ball does."""
    gamma = 1.2
    scene = plate(balls, shaken(gamma, phase=-0.5 * math.pi), gap=0.0)
    leaves = math.asin(1.0 / gamma)  # of the phase
    height, speed = gamma * math.sin(leaves), gamma * math.cos(leaves)

    def gap(t):
        return height + speed * t - 0.5 * t * t - gamma * math.sin(leaves + t)

    back = brentq(gap, 0.3, 6.0, xtol=1e-15, rtol=1e-15)
    result = run(scene, 0.5, t_end=leaves + 0.5 * math.pi + back + 1e-9, samples=400, collapse="merge")
    assert len(result.contacts) >= 1
    first = result.contacts[0]
    assert first["pair"] == 0
    assert abs(first["t_begin"] - (leaves + 0.5 * math.pi + back)) < 1e-13
    moving = (result.time > leaves + 0.5 * math.pi) & (result.time < first["t_begin"])
    flown = result.time[moving] - leaves - 0.5 * math.pi
    assert np.abs(result.gap[moving, 0] - [gap(t) for t in flown]).max() < 1e-13
    assert remainder(result) < 1e-14


def test_piles_ride_on_ceilings_too():
    """No gravity: a floor and its mirror image give mirrored runs, to the last bit for one ball."""
    for balls, eps in ((1, 0.5), (3, 0.5), (3, 0.0)):
        motion = Sine(0.1, 1.0, 2.0)
        m, v = [1.0, 2.0, 0.5][:balls], [-0.3, 0.1, -0.7][:balls]
        up = gr.Scene([INF, *m], [0.0] + [0.1] * balls, [0.5] * balls, [0.0, *v], floor=motion)
        down = gr.Scene([*m[::-1], INF], [0.1] * balls + [0.0], [0.5] * balls, [-x for x in v[::-1]] + [0.0],
                        ceiling=Sine(0.1, 1.0, 2.0 + math.pi))
        a, b = (run(s, eps, t_end=4.0, samples=30, max_events=400) for s in (up, down))
        assert len(a.contacts) == len(b.contacts) > 0
        assert np.abs(a.contacts["t_begin"] - b.contacts["t_begin"]).max() < 1e-11
        assert np.abs(a.gap - b.gap[:, ::-1]).max() < 1e-11
        assert np.abs(a.velocity + b.velocity[:, ::-1]).max() < 1e-11


def test_a_jump_of_the_wall_hits_or_leaves_what_rides():
    """A floor that starts and stops: it hits the ball on it, or lets it fly on."""
    rises = Piecewise([0.0, 1.0, 1.5, 3.0], [[0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    result = run(plate(1, rises, gap=0.0), 0.5, t_end=2.9, samples=[0.99, 1.1, 1.4])
    assert result.contacts["t_begin"][0] == pytest.approx(1.0, abs=1e-14)
    assert result.contacts["v_in"][0].tolist() == [2.0, 0.0]
    assert result.velocity[1, 1] == pytest.approx(3.0 - 0.1, abs=1e-13)
    thrown = run(plate(1, Piecewise([0.0, 0.5, 3.0], [[2.0, 0.0], [0.0, 1.0]]), gap=0.0, velocity=2.0), 0.5, t_end=2.0,
                 samples=[0.49, 0.75])
    assert len(thrown.contacts) == 0
    assert thrown.gap[1, 0] == pytest.approx(0.25 * 2.0 - 0.5 * 0.25**2, abs=1e-14)


def test_what_rides_on_a_driven_floor_meets_a_driven_ceiling_when_there_is_no_room():
    """Both walls drive one ball: it rides on the floor until they leave it no room."""
    floor, ceiling = Sine(0.05, 0.5), Sine(0.5, 0.11, 0.3)
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.05, 0.55], [0.0] * 3, 9.81, floor=floor, ceiling=ceiling)

    def room(t):
        return 0.6 + ceiling.displacement(t) - ceiling.displacement(0.0) - floor.displacement(t)

    meet = brentq(room, 4.0, 6.0, xtol=1e-14)
    result = run(scene, 0.2, t_end=12.0, samples=60)
    assert result.status is gr.Status.collapse
    assert abs(result.time[-1] - meet) < 1e-8
    assert np.abs(result.gap.sum(axis=1) - [room(t) for t in result.time]).max() < 1e-14
    assert remainder(result) < 1e-13
    assert run(scene.replace(gap=[0.05, 0.65]), 0.2, t_end=40.0).status is gr.Status.time


def straight(breaks, slopes, gap, v, g, eps):
    """Hits (time, speed) of a ball above a floor that moves along straight lines, by hand."""
    t, x, y, j, rows, rests = 0.0, gap, 0.0, 0, [], False
    while j < len(slopes):
        w, left = slopes[j], breaks[j + 1] - t
        d, u = x - y, v - w
        if rests:
            v, h = w, math.inf
        elif d <= 0.0 and u < 0.0:
            h = 0.0
        elif g == 0.0:
            h = d / -u if u < 0.0 else math.inf
        else:
            s = math.sqrt(u * u + 2.0 * g * max(d, 0.0))
            h = (u + s) / g if u > 0.0 else 2.0 * max(d, 0.0) / (s - u)
        step = min(h, left)
        x, v = (x + w * step, v) if rests else (x + v * step - 0.5 * g * step * step, v - g * step)
        y, t = y + w * step, t + step
        if h <= left:
            rows.append((t, w - v))
            x, v = y, w + eps * (w - v)
            rests = v - w < 1e-13 and g > 0.0
        else:
            j, rests = j + 1, False
    return rows, x


@pytest.mark.parametrize("seed", range(20))
def test_floors_along_straight_lines(seed):
    """Every kind of jump, at times at which the clock is re-based too: all hits, and where the ball is at the end."""
    rng = np.random.default_rng(seed)
    breaks = np.r_[0.0, np.cumsum(rng.choice([0.25, 0.5, 1.0, 0.3], 6))]
    slopes = rng.normal(size=6) * rng.choice([0.2, 1.0])
    path = Piecewise(breaks, [slopes, np.r_[0.0, np.cumsum(slopes * np.diff(breaks))][:-1]])
    g, gap, v, eps = float(rng.choice([0.0, 1.0, 9.81])), float(rng.choice([0.3, 0.01])), float(rng.normal()), 0.3
    rows, x = straight(breaks, slopes, gap, v, g, eps)
    scene = gr.Scene([INF, 1.0], [0.0, 0.1], [gap], [0.0, v], g, floor=path)
    result = run(scene, eps, t_end=float(breaks[-1]))
    speed = result.contacts["v_in"][:, 0] - result.contacts["v_in"][:, 1]
    mine = [row for row in zip(result.contacts["t_begin"], speed, strict=True) if row[1] > 1e-9]
    assert np.allclose(mine, [row for row in rows if row[1] > 1e-9], rtol=0.0, atol=1e-12)
    assert abs(result.position[-1, 1] - 0.1 - x) < 1e-12
    assert remainder(result) < 1e-13


@pytest.mark.parametrize("seed", [210, 220])
def test_merging_at_an_instant_leaves_the_account_closed(seed):
    """Dozens of merges in one instant: what rounding may have left of velocities does not grow with each."""
    result = run(drawn(seed, touching=0.3), 0.5, t_end=5.0, samples=400, collapse="merge", merge_below=0.3,
                 max_events=2000)
    assert remainder(result) < 1e-12


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
    assert "pair 0" in stopped.message
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


# --- queues, resumed runs, accounts


@pytest.mark.thirds
@pytest.mark.parametrize("seed", range(24))
def test_accounts_close_and_resumed_runs_go_on(seed):
    """Every option: energy - work + dissipated stays, gaps stay positive, cut and uncut runs have the same bits."""
    scene = drawn(100 + seed, touching=0.3)
    options = [{}, {"ties": "right"}, {"ties": "random", "seed": 7}, {"ties": "poisson"}, {"collapse": "merge"},
               {"tc": 1e-3}, {"elastic_below": 1e-2}, {"collapse": "merge", "merge_below": 0.3}][seed % 8]
    for eps in (0.05, 0.5, 0.9, 1.0):
        times = np.linspace(1.0, 3.0, 5)
        whole = run(scene, eps, t_end=3.0, samples=times, max_events=400, **options)
        assert remainder(whole) < 1e-12
        assert (whole.gap >= 0.0).all()
        cut = run(scene, eps, t_end=0.7, max_events=400, **options)
        if cut.status is gr.Status.time:
            rest = gr.edmd.resume(cut, t_end=3.0, samples=times, max_events=400 - len(cut.contacts), engine="sorted")
            for name in ("position", "velocity", "gap", "ledger"):
                assert np.array_equal(getattr(whole, name), getattr(rest, name)), name


@pytest.mark.soak  # to compile what driven scenes need takes half a minute
def test_queues_agree_to_the_last_bit():
    """Interpreted and compiled, in pieces and at once."""
    pytest.importorskip("numba")
    for scene, eps in ((drawn(5), 0.8), (drawn(7, touching=0.5), 0.5), (plate(5, shaken(3.0)), 0.9),
                       (plate(2, shaken(0.9)), 0.5), (lift(), 0.5)):
        for options in ({}, {"collapse": "merge"}, {"ties": "random"}, {"until": gr.until.contact(0, 9)}):
            given = {"t_end": 20.0, "samples": 9, "max_events": 600} | options
            a, b = (run(scene, eps, engine=engine, **given) for engine in ("sorted", "compiled"))
            assert same(a, b)
            assert remainder(b) < 1e-12


@pytest.mark.soak
def test_a_condensed_column_goes_on():
    """N(1-ε) from .1 to 2: no stall, and the account of a hundred thousand collisions."""
    pytest.importorskip("numba")
    for balls, eps in ((10, 0.99), (10, 0.9), (10, 0.8)):
        column = plate(balls, shaken(3.0))
        result = run(column, eps, engine="compiled", t_end=1e9, collapse="merge", max_events=30_000, log=False)
        assert result.time[-1] > 500.0
        assert remainder(result) < 1e-14


def test_options_beside_a_driven_wall():
    """Watching, stopping, talking."""
    law = gr.LinearDashpot(1e6, 10.0)
    seen = []
    result = run(plate(3, shaken(3.0)), 0.9, t_end=20.0, watch=law, on_event=lambda row: seen.append(row["t_begin"]))
    assert "watched" in result.message
    assert len(seen) == len(result.contacts)
    stop = run(plate(3, shaken(3.0)), 0.9, until=gr.until.contact(1, 2))
    assert stop.status is gr.Status.until
    assert stop.count(1) == 1
    apart = run(plate(1, Sine(0.1, 1.0), gravity=0.0, velocity=-1.0), 1.0, until=gr.until.separated())
    assert apart.status is gr.Status.until
    assert len(apart.contacts) >= 1
    rule = gr.edmd.simulate(plate(1, shaken(3.0)), lambda speed, pair: 1.0 / (1.0 + speed), t_end=30.0)
    assert remainder(rule) < 1e-13
    assert len(rule.contacts) > 3


def test_what_does_not_last_is_said():
    wall = plate(1, shaken(2.0))
    with pytest.raises(ValueError, match="t_end is None: beside a driven wall"):
        run(wall)
    assert run(wall, max_events=50).status is gr.Status.max_events
    with pytest.raises(ValueError, match="t_end"):
        run(plate(1, Motion(math.sin)), until=gr.until.contact(0, 3))
    with pytest.raises(ValueError, match="there the path of the wall ends"):
        run(plate(1, Piecewise([0.0, 1.0], [[0.0]])), t_end=2.0)
    first = run(plate(1, Piecewise([0.0, 1.0], [[0.0]])), t_end=0.5)
    with pytest.raises(ValueError, match="there the path of the wall ends"):
        gr.edmd.resume(first, t_end=2.0)
    with pytest.raises(ValueError, match="t_end is None"):
        gr.edmd.resume(run(wall, t_end=1.0))


def test_driven_walls_that_meet_end_the_run():
    """A floor that swings up to a fixed ceiling: the balls between are shut in."""
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.3] * 2, [0.0, 0.3, 0.0], floor=Sine(1.0, 0.1))
    result = run(scene, 0.2, t_end=10.0)
    assert result.status is gr.Status.collapse
    assert "the walls close at t = " in result.message
    meet = math.asin(0.6) / (0.2 * math.pi)
    assert f"{meet:.6g}"[:7] in result.message
    assert run(scene.replace(floor=Sine(0.5, 0.1)), 0.2, t_end=10.0).status is gr.Status.time


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


@pytest.mark.parametrize(("n", "eps", "gamma"), [(1, 1.0, 20.0), (1, 0.8, 3.0), (5, 0.9, 5.0)])
def test_the_zero_of_times_moves_within_the_event_loop(n, eps, gamma):
    """To the bits as it does from outside, which a run that is watched needs; the log says the same times."""
    plate = gr.walls.Sine.from_acceleration(gamma, 0.5 / math.pi, 1.0)
    start = [0.0, *(0.3 * (-1.0) ** i for i in range(n))]
    scene = gr.Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), [1.0] * n, start, 1.0, floor=plate)
    law = gr.LinearDashpot(1e9, 1.0)
    options = {"t_end": 6e3, "collapse": "merge", "max_events": 400}
    for more in ({}, {"samples": [10.0, 70.0, 300.0]}, {"log": False}):
        inside, outside = (
            gr.edmd.simulate(scene, gr.ConstantRestitution(eps), engine="sorted", **options, **more, **watched)
            for watched in ({}, {"watch": law})
        )
        assert inside.stats["rebases"] == outside.stats["rebases"] > 10
        for name in ("time", "gap", "velocity", "ledger", "contacts"):
            assert getattr(inside, name).tobytes() == getattr(outside, name).tobytes(), name
