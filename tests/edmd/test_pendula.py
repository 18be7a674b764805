"""Pendula of hard spheres: against a twin of 30 digits, closed forms, symmetries and rows on a line."""

import math

import mpmath as mp
import numpy as np
import pytest

import granular as gr
from tests.helpers.fuzz import bounded
from tests.helpers.hard_runs import INF, QUEUES, follows_the_twin, goes_on, loss, run


def hanging(seed, walls=True):
    """Two to six pendula of unequal masses, perhaps between fixed walls, some at gaps of rest 0."""
    rng = np.random.default_rng(seed)
    floor, ceiling = (bool(x) for x in rng.random(2) < 0.4 * walls)
    n, omega = int(rng.integers(2 - floor, 7)), float(np.exp(rng.normal()))
    ball = np.r_[[0.0] * floor, [1.0] * n, [0.0] * ceiling]
    rest = rng.uniform(0.0, 0.2, len(ball) - 1) * (rng.random(len(ball) - 1) < 0.7)
    gap = np.exp(rng.uniform(-7.0, 0.0, len(rest)))
    if floor and ceiling:
        rest *= gap.sum() / (rest.sum() or 1.0)
        rest[0] += gap.sum() - rest.sum()
    mass = np.where(ball > 0.0, np.exp(rng.normal(size=len(ball))), INF)
    return gr.Scene(mass, 0.05 * ball, gap, rng.normal(size=len(ball)) * ball * omega, origin=float(rng.normal()),
                    pendulum=omega, rest_gap=rest)


def cradle(n, d, eps, periods=1.0, y=-1.0, **options):
    """Equal pendula at rest that touch or nearly do, but for the first, which is drawn aside."""
    gap = np.full(n - 1, d)
    gap[0] -= y
    scene = gr.Scene([1.0] * n, [0.1] * n, gap, [0.0] * n, origin=y, pendulum=1.0, rest_gap=[d] * (n - 1))
    return run(scene, eps, **{"t_end": 2.0 * math.pi * periods} | options)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(10))
def test_of_pendula_every_hit_of_the_twin_is_found(seed):
    scene, eps = hanging(seed), [0.8, 0.9, 1.0][seed % 3]
    result = run(scene, eps, t_end=12.0 / scene.pendulum, max_events=14)
    follows_the_twin(scene, eps, result, 14)


@pytest.mark.parametrize("seed", [83, 200, 227])
def test_the_twin_steps_on_from_a_gap_that_opens_faster_than_it_can_fall_back(seed):
    """It divided by zero."""
    one = bounded.generate(seed)
    result = run(one.scene, 0.8, t_start=one.start, t_end=one.end, max_events=14)
    follows_the_twin(one.scene, 0.8, result, 14)


@QUEUES
@pytest.mark.parametrize("seed", range(6))
def test_of_pendula_every_queue_and_a_run_that_goes_on_are_the_same(seed, engine, tmp_path):
    scene, eps = hanging(seed), [0.7, 1.0][seed % 2]
    options = {"collapse": ["stop", "merge"][seed // 2 % 2], "ties": ["left", "random", "right"][seed // 2]}
    asked = {"t_end": 80.0 / scene.pendulum, "max_events": 1500, "samples": 7}
    goes_on(scene, eps, engine, tmp_path, asked, **options)


def test_a_cradle_of_five_after_one_period():
    """Computed by counted events in 30 digits."""
    narrow, touching = cradle(5, 1e-3, 0.95), cradle(5, 0.0, 0.95)
    assert len(narrow.contacts) == 8
    assert loss(narrow) == pytest.approx(0.678909767959, abs=1e-12)
    assert loss(touching) == pytest.approx(0.678908431195, abs=1e-12)


@pytest.mark.parametrize("n", [2, 5])
def test_in_the_end_pendula_swing_together(n):
    """E/E0 → 1/N; without gaps at rest to the last digits, merged ones after the first hits."""
    assert loss(cradle(n, 0.0, 0.7, 100.0)) == pytest.approx(1.0 / n, rel=1e-14)
    assert loss(cradle(n, 0.0, 0.0, 1.0)) == pytest.approx(1.0 / n, rel=1e-14)
    assert loss(cradle(n, 1e-3, 0.7, 100.0)) == pytest.approx(1.0 / n, rel=2e-5)


def test_an_infinite_sequence_of_pendula_has_an_end():
    """Three equal balls meet at ε below 7 - 4√3: their rates fall to nothing, and they go on with their gaps."""
    scene = gr.Scene([1.0] * 3, [0.1] * 3, [0.5, 0.5], [1.0, 0.0, -1.0], pendulum=1.0, rest_gap=[0.1, 0.1])
    result = run(scene, 0.05, t_end=7.0, samples=50)
    burst = result.contacts["t_begin"][:200]
    assert result.status is gr.Status.time
    assert len(burst) > 100
    assert np.ptp(burst) < 0.5
    assert (result.gap[-20:] > 0.0).any()


@pytest.mark.parametrize("seed", range(4))
def test_elastic_pendula_keep_their_energy_and_go_back_in_time(seed):
    scene = hanging([102, 103, 105, 107][seed])
    span = 6.0 / scene.pendulum
    there = run(scene, t_end=span, samples=20)
    energy = there.energy()
    assert len(there.contacts) > 5
    assert np.abs(energy / energy[0] - 1.0).max() < 5e-16 * (20 + len(there.contacts))
    ball = ~scene.is_wall
    middle = scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1], origin=there.position[-1, 0])
    back = run(middle, t_end=span)
    assert len(back.contacts) == len(there.contacts)
    assert np.abs(back.position[-1] - scene.position).max() < 1e-9
    assert np.abs(back.velocity[-1] + scene.velocity)[ball].max() < 1e-9 * scene.pendulum


@pytest.mark.parametrize("seed", range(4))
def test_a_mirror_image_of_pendula_does_the_mirror_image(seed):
    scene = hanging(seed, walls=False)
    end = scene.displacement[-1]
    other = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1], origin=-end,
                     pendulum=scene.pendulum, rest_gap=scene.rest_gap[::-1])
    a = run(scene, 0.9, t_end=9.0 / scene.pendulum, samples=30)
    b = run(other, 0.9, t_end=9.0 / scene.pendulum, samples=30, ties="right")
    assert len(a.contacts) == len(b.contacts)
    assert np.abs(a.gap - b.gap[:, ::-1]).max() < 1e-10
    assert np.abs(a.velocity + b.velocity[:, ::-1]).max() < 1e-10 * scene.pendulum


def test_between_walls_the_gaps_of_pendula_keep_their_sum():
    gap, rest, velocity = [0.3, 0.1, 0.2, 0.4], [0.1, 0.2, 0.3, 0.4], [0.0, 3.0, 0.0, -1.0, 0.0]
    scene = gr.Scene([INF, 1.0, 2.0, 1.5, INF], np.zeros(5), gap, velocity, pendulum=2.0, rest_gap=rest)
    result = run(scene, t_end=2000.0, samples=50, log=False)
    assert result.stats["events"] > 10_000
    assert np.abs(result.gap.sum(axis=1) - 1.0).max() < 1e-13
    assert np.abs(result.energy() / result.energy()[0] - 1.0).max() < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_a_run_of_pendula_without_a_log_goes_on_with_one(seed):
    """Nothing follows the velocities of single balls meanwhile; they are those of a run that was logged all along."""
    scene = hanging(seed)
    logged, silent = (run(scene, 0.98, max_events=200, t_start=1.3, log=log) for log in (True, False))
    assert (logged.gap == silent.gap).all()
    assert (logged.velocity == silent.velocity).all()
    a, b = (gr.edmd.resume(one, max_events=100, engine="sorted").contacts for one in (logged, silent))
    assert (a["t_begin"] == b["t_begin"]).all()
    scale = max(np.abs(scene.velocity).max(), scene.pendulum * np.abs(scene.displacement).max())
    for name in ("v_in", "v_out"):
        assert np.abs(a[name] - b[name]).max() < 1e-13 * scale


@pytest.mark.parametrize("ties", ["newton", "poisson", "reflect"])
def test_touching_pendula_collide_as_a_row_on_a_line_does(ties):
    for eps in (1.0, 0.6):
        hung = cradle(4, 0.0, eps, 0.4, ties=ties)
        line = run(gr.Scene([1.0] * 4, [0.1] * 4, [0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), eps, t_end=0.75, ties=ties)
        assert hung.contacts["pair"].tolist() == line.contacts["pair"].tolist()
        for name in ("v_in", "v_out", "impulse"):
            assert np.abs(hung.contacts[name] - line.contacts[name]).max() < 1e-15
        longer = cradle(4, 0.0, eps, 6.0, ties=ties)
        assert longer.status is gr.Status.time
        assert loss(longer) == pytest.approx(1.0, rel=1e-13) or eps < 1.0


def test_the_root_of_pendula_has_all_digits():
    """Against the smallest positive root in 50 digits of it, for gaps down to 1e-150 and rates of both signs."""
    rng = np.random.default_rng(5)
    with mp.workdps(200):
        for _ in range(200):
            gap = float(10.0 ** rng.uniform(*[(-150.0, 0.0), (-12.0, 1.0)][int(rng.integers(2))]))
            d = float(rng.choice([0.0, 10.0 ** rng.uniform(-6.0, 1.0)]))
            omega, rate = float(np.exp(rng.normal())), float(rng.normal())
            scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [gap], [0.0, rate], pendulum=omega, rest_gap=[d])
            log = run(scene, max_events=1, t_end=20.0 / omega).contacts
            x, u = mp.mpf(gap) - d, mp.mpf(rate) / omega
            far = mp.hypot(x, u)
            if far <= d:
                assert len(log) == 0
                continue
            turns = [mp.atan2(u, x) + sign * mp.acos(-d / far) for sign in (-1, 1)]
            exact = min((turn % (2 * mp.pi)) for turn in turns) / omega
            condition = 1 + abs((2 * mp.mpf(d) - gap) * gap) / (u * u - (2 * mp.mpf(d) - gap) * gap)
            assert abs(mp.mpf(float(log["t_begin"][0])) - exact) < 4e-15 * condition * exact
