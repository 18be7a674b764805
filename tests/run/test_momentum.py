"""Momentum that walls give, temperature and height of the centre of mass, each by another way."""

import math

import numpy as np
import pytest

import granular as gr
from granular import measures
from tests.helpers import scenes_at_random as draw
from tests.helpers.fuzz import bounded, driven

ENGINES = {
    "located": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", max_steps=20_000, **end),
    "verlet": lambda scene, laws, **end: gr.md.simulate(scene, laws, engine="plain", dt=2e-4, method="verlet", **end),
    "hard": lambda scene, laws, **end: gr.edmd.simulate(scene, gr.ConstantRestitution(0.8), **end),
    "poisson": lambda scene, laws, **end: gr.edmd.simulate(
        scene, gr.ConstantRestitution(0.8), ties="poisson", engine="sorted", **end),
}
WALLED = {"walls": (0.8, 0.7, 0.5)}


def by_log(run, pair, time):
    """Impulses of a pair up to a time, its contacts one by one; nan within one of them."""
    rows = run.of(pair)
    over = rows["t_end"] <= time
    return math.nan if ((rows["t_begin"] < time) & ~over).any() else math.fsum(rows["impulse"][over])


def closes(run):
    """Whether Δp is what walls, gravity and forces give, and the walls what the log says, at every row; and how many
    rows were compared with the log."""
    scene, given = run.scene, run.account()["momentum"]
    balls, elapsed, compared = ~scene.is_wall, run.time - run.time[0], 0
    m, force = scene.mass[balls], 0.0 if scene.external_force is None else scene.external_force[balls]
    pull = float(np.sum(force - m * scene.gravity))
    ulps = 4.0 * np.spacing(np.abs(run.time).max()) * abs(pull)
    rounding = 1e-13 * (np.abs(run.velocity[:, balls]) @ m).max() + 1e-13 * run.contacts["impulse"].sum() + ulps
    known = np.isfinite(given).all(axis=1)
    if scene.pendulum == 0.0:
        left = run.momentum() - run.momentum()[0] - pull * elapsed - given.sum(axis=1)
        assert (np.abs(left[known]) <= rounding).all()
    first = not np.allclose(run.velocity[0][balls], scene.velocity[balls], rtol=1e-9, atol=1e-9)
    for side, pair in enumerate((0, scene.n_pairs - 1)):
        if not scene.is_wall[-side]:
            assert not given[:, side].any()
            continue
        start = by_log(run, pair, run.time[0]) if first else 0.0
        said = (1 - 2 * side) * (np.array([by_log(run, pair, t) for t in run.time[1:].tolist()]) - start)
        good = np.isfinite(said) & known[1:]
        compared += good.sum()
        assert (np.abs(said - given[1:, side])[good] <= rounding).all()
    return compared


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ENGINES)
def test_the_account_of_momentum_closes(engine):
    """Random rows: dashpots, Hertz, viscoelastic, Tsuji; no, one or two walls, at rest or not; gravity or none."""
    compared = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        scene = draw.scene(rng, (1, 5), **WALLED)
        laws = draw.laws(rng, scene, ("dashpot", "Hertz", "viscoelastic", "Tsuji"), (3.0, 5.0))
        run = ENGINES[engine](scene, laws, t_end=float(rng.uniform(0.05, 0.3)), samples=13)
        if run.status is gr.Status.time:
            compared += closes(run)
    assert compared > 50


@pytest.mark.rotating
@pytest.mark.parametrize("kind", range(3), ids=["ring", "thermal walls", "pendula"])
def test_it_closes_in_bounded_scenes(kind):
    compared = 0
    for seed in range(kind, 18, 3):
        one = bounded.generate(seed)
        compared += closes(one.run(samples=13))
        if one.scene.gap.min() >= 0.0 and not (one.scene.ring and one.scene.external_force is not None):
            span = {"t_start": one.start, "t_end": one.end, "samples": 13}
            hard = gr.edmd.simulate(one.scene, gr.ConstantRestitution(0.9), **span)
            compared += closes(hard) if hard.status is gr.Status.time else 0
    assert compared > 20 or kind == 0


def test_it_closes_at_driven_walls_and_under_forces():
    compared = 0
    for seed in (4, 10, 17):
        one = driven.generate(seed)
        compared += closes(one.run(samples=13))
    assert compared > 20


def test_a_floor_carries_the_weight_of_what_rests_on_it():
    """A pile below a ball that flies up to a ceiling; the floor rises, so it works on what it carries."""
    mass, velocity = [np.inf, 1.0, 2.0, 0.5, np.inf], [0.25, 0.25, 0.25, 5.0, 0.0]
    scene = gr.Scene(mass, [0.0] * 5, [0.0, 0.0, 1.0, 1.0], velocity, 10.0)
    rule = gr.ConstantRestitution(0.5)
    run = gr.edmd.simulate(scene, rule, t_end=0.4, samples=9, collapse="merge")
    account, hits = run.account(), run.of(3)
    np.testing.assert_allclose(account["momentum"][:, 0], 30.0 * run.time, rtol=1e-13)
    assert account["momentum"][-1, 1] == pytest.approx(-hits["impulse"].sum(), rel=1e-13)
    np.testing.assert_allclose(account["work"][:, 0], 7.5 * run.time, rtol=1e-13)
    speed = -hits["v_in"][0, 0] / 2
    assert account["dissipated"][-1] == pytest.approx(0.5 * 0.5 * 3.0 * speed * speed, rel=1e-12)


def test_pendula_swing_as_what_a_wall_gave_them_says():
    """Σ m v turns with Ω, and each impulse of the wall from then on."""
    scene = gr.Scene([np.inf, 1.0, 3.0], [0.0] * 3, [0.0, 0.0], [0.0, 1.0, -2.0], pendulum=3.0, rest_gap=[0.0, 0.1])
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=5.0, samples=40)
    hits, turn, m = run.of(0), 3.0 * run.time, np.array([0.0, 1.0, 3.0])
    since = 3.0 * np.maximum(run.time[:, None] - hits["t_begin"], 0.0)
    after = run.time[:, None] >= hits["t_begin"]
    free = m @ scene.velocity * np.cos(turn) - 3.0 * (m @ scene.displacement) * np.sin(turn)
    by_hand = free + (after * np.cos(since)) @ hits["impulse"]  # the first row shows what was before the first hit
    np.testing.assert_allclose(run.momentum()[1:], by_hand[1:], atol=1e-12)
    np.testing.assert_allclose(run.account()["momentum"][1:, 0], after[1:] @ hits["impulse"], rtol=1e-14)
    assert len(hits) > 3


def test_it_is_nan_where_nobody_knows():
    """Between two walls: without a log; where every pair is in contact, but for the last row; for hard balls that may
    have stuck to a ceiling."""
    box = gr.Scene([np.inf, 1.0, 1.0, np.inf], [0.0] * 4, [0.5, 0.5, 0.5], [0.0, 1.0, -2.0, 0.0])
    unlogged = gr.edmd.simulate(box, gr.ConstantRestitution(0.9), t_end=2.0, samples=5, log=False)
    assert np.isnan(unlogged.account()["momentum"][1:]).all()
    pressed = gr.Scene([np.inf, 1.0, np.inf], [0.0] * 3, [-0.1, -0.1], [0.0, 1.0, 0.0])
    run = gr.md.simulate(pressed, gr.LinearDashpot(100.0), t_end=0.2, samples=5)
    given = run.account()["momentum"]
    assert not given[0].any()
    assert np.isnan(given[1:-1]).all()
    assert given[-1] == pytest.approx(run.contacts["impulse"] * [1.0, -1.0])
    assert given[-1].sum() == pytest.approx(run.momentum()[-1] - 1.0)
    lifted = gr.Scene([np.inf, 1.0, np.inf], [0.0] * 3, [0.5, 0.5], [0.0, 0.0, 0.0], external_force=[0.0, 3.0, 0.0])
    run = gr.edmd.simulate(lifted, gr.ConstantRestitution(0.5), t_end=4.0, samples=9, collapse="merge")
    given = run.account()["momentum"]
    assert np.isnan(given[-1]).all()
    assert np.isfinite(given[:2]).all()
    alone = gr.edmd.simulate(gr.Scene(lifted.mass[1:], [0.0] * 2, [0.5], [0.0, 0.0], external_force=[3.0, 0.0]),
                             gr.ConstantRestitution(0.5), t_end=4.0, samples=9, collapse="merge")
    np.testing.assert_allclose(alone.account()["momentum"][:, 1], alone.momentum() - 3.0 * alone.time, atol=1e-13)


def test_the_temperature_is_that_of_the_wall_whatever_the_masses():
    """Of 20000 draws of three balls at T, and of one row by hand; a wind changes nothing."""
    rng, m = np.random.default_rng(1), np.array([0.1, 1.0, 7.0])
    v = rng.normal(size=(20_000, 3)) * np.sqrt(2.5 / m)
    scene = gr.Scene(m, [0.0] * 3, [1.0, 1.0], v[0])
    time, gap = np.arange(20_000.0), np.ones((20_000, 2))
    found = measures.temperature(gr.Trajectory.from_arrays(scene, time, gap=gap, velocity=v))
    assert found.mean() == pytest.approx(2.5, abs=4.0 * found.std() / math.sqrt(20_000))
    windy = measures.temperature(gr.Trajectory.from_arrays(scene, time, gap=gap, velocity=v + 100.0))
    np.testing.assert_allclose(windy, found, rtol=1e-9)
    two = gr.Scene([np.inf, 1.0, 3.0], [0.0] * 3, [1.0, 1.0], [0.0, 2.0, -2.0])
    assert measures.temperature(gr.edmd.simulate(two, gr.ConstantRestitution(1.0)))[0] == pytest.approx(9.0 + 3.0)
    alone = gr.scenes.bouncing_ball()
    assert np.isnan(measures.temperature(gr.edmd.simulate(alone, gr.ConstantRestitution(0.5), t_end=0.1))).all()


@pytest.mark.parametrize("walls", [(False, False), (True, False), (True, True)])
def test_the_height_of_the_centre_of_mass_is_that_of_points(walls):
    """0 of balls that lie on a floor; else the sum of gaps below each ball; it falls as the mass centre does."""
    n = 3 + sum(walls)
    mass = np.array([np.inf] * walls[0] + [1.0, 2.0, 4.0] + [np.inf] * walls[1])
    radius = np.where(np.isinf(mass), 0.0, 0.1)
    scene = gr.Scene(mass, radius, [0.5] * (n - 1), [0.0] * n, 10.0 * walls[0], origin=2.0)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.3, samples=7)
    points = np.concatenate([np.zeros((7, 1)), np.cumsum(run.gap, axis=1)], axis=1)
    m = np.where(scene.is_wall, 0.0, mass)
    np.testing.assert_allclose(measures.height(run), points @ m / 7.0, rtol=1e-14)
    piled = gr.Scene([np.inf, 1.0, 2.0], [0.0, 0.1, 0.2], [0.0, 0.0], [0.0] * 3, 9.81, origin=5.0)
    rest = gr.edmd.simulate(piled, gr.ConstantRestitution(0.5), t_end=1.0, collapse="merge")
    assert measures.height(rest).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("measure", [gr.measures.temperature, gr.measures.height])
def test_what_is_no_run_is_refused(measure):
    with pytest.raises(TypeError, match=r"`run` must be a granular\.Trajectory, got Scene\(.*"):
        measure(gr.scenes.three_balls())
