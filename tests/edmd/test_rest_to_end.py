"""A ball that comes to rest on a wall stays there until the end of the run; closing walls; constant forces."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import granular as gr

INF = math.inf
ENGINES = ("sorted", "compiled")
FORCED = [
    ("compiled", "force"), ("sorted", "force"), ("compiled", "ceiling"), ("sorted", "gravity"), ("compiled", "gravity"),
    ("compiled", "both"), ("sorted", "both"), ("sorted", "ceiling"),
]
"""Engines, and what presses a ball down.

Compiled "force" and "both" need the same machine code, so both are in one share of `tests.conftest.SHARES`."""


def pressed(kind, rng):
    """One ball that gravity or a constant force presses on a floor or against a ceiling, and the acceleration."""
    h, m, a = (float(rng.uniform(*span)) for span in ((0.05, 2.0), (0.1, 5.0), (0.5, 20.0)))
    v = float(rng.normal())
    u = float(rng.choice([0.0, 0.5, -2.0]))
    if kind == "gravity":
        return gr.Scene([INF, m], [0.0, 0.1], [h], [u, u + v], a), h, a, v
    if kind == "force":
        return gr.Scene([INF, m], [0.0, 0.1], [h], [u, u + v], external_force=[0.0, -m * a]), h, a, v
    if kind == "both":
        return gr.Scene([INF, m], [0.0, 0.1], [h], [u, u + v], 0.25 * a, external_force=[0.0, -0.75 * m * a]), h, a, v
    return gr.Scene([m, INF], [0.1, 0.0], [h], [u - v, u], external_force=[m * a, 0.0]), h, a, v


def rest_time(h, a, v, eps):
    """Time at which infinitely many bounces are over: the first hit, then a geometric series."""
    hit = math.sqrt(v * v + 2.0 * a * h)
    return (v + hit) / a + 2.0 * eps * hit / (a * (1.0 - eps))


@pytest.mark.rotating
@pytest.mark.parametrize(("engine", "kind"), FORCED)
def test_forces_and_gravity_bring_a_ball_to_rest_exactly(kind, engine):
    for seed in range(6):
        rng = np.random.default_rng([51, seed])
        (scene, h, a, v), eps = pressed(kind, rng), float(rng.uniform(0.05, 0.95))
        due = rest_time(h, a, v, eps)
        rule, times = gr.ConstantRestitution(eps), np.array([0.0, 0.5, 1.5, 2.0]) * due
        run = gr.edmd.simulate(scene, rule, t_end=2.0 * due, samples=times, engine=engine)
        assert (run.status, run.stats["verdict"]) == (gr.Status.collapse, "exact")
        assert run.stats["collapse_time"] == pytest.approx(due, rel=1e-12)
        assert run.time.tolist() == times.tolist()
        assert not run.gap[2:].any()
        assert not np.ptp(run.velocity[2:], axis=1).any()
        ends = gr.edmd.simulate(scene, rule, engine=engine)
        assert (ends.time[-1], ends.message) == (run.stats["collapse_time"], run.message)


@pytest.mark.parametrize("kind", ["gravity", "force", "ceiling"])
@pytest.mark.parametrize("cut", [0.5, 1.0, 1.5])
def test_a_run_resumed_before_at_or_after_the_rest_equals_one_run(kind, cut):
    scene, h, a, v = pressed(kind, np.random.default_rng(3))
    rule, due = gr.ConstantRestitution(0.6), rest_time(h, a, v, 0.6)
    whole = gr.edmd.simulate(scene, rule, t_end=2.0 * due)
    first = gr.edmd.simulate(scene, rule, t_end=cut * due)
    resumed = gr.edmd.resume(first, t_end=2.0 * due)
    assert (resumed.status, resumed.message, resumed.stats) == (whole.status, whole.message, whole.stats)
    assert resumed.velocity[-1].tolist() == whole.velocity[-1].tolist()
    assert np.concatenate([first.contacts, resumed.contacts]).tobytes() == whole.contacts.tobytes()


def test_a_state_at_rest_in_which_balls_move_is_refused():
    scene, *_ = pressed("gravity", np.random.default_rng(3))
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.6), t_end=0.01)
    changed = dict(run.state) | {"collapse_time": np.array(0.005), "collapse_pair": np.array(0)}
    with pytest.raises(ValueError, match="has a collapse_time although balls move"):
        gr.edmd.resume(replace(run, state=changed), t_end=1.0)


def test_a_collapse_ends_the_run_if_another_ball_still_moves():
    scene = gr.Scene([INF, 2.0, 1.0], [0.0, 0.1, 0.1], [0.1, 0.2], [0.0] * 3, 9.81)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=3.0)
    assert run.status is gr.Status.collapse
    assert run.time[-1] == run.stats["collapse_time"] < 3.0


def between_closing_walls(t_end, speed):
    """Place and velocity of an elastic ball between a floor at rest and a ceiling that approaches; 60 digits."""
    with mpmath.workdps(60):
        x, v, t, u = mpmath.mpf(0.1), mpmath.mpf(1), mpmath.mpf(0), mpmath.mpf(speed)
        room = mpmath.mpf(0.1) + mpmath.mpf(0.1)
        while True:
            wait = (room - u * t - x) / (v + u) if v > 0 else x / -v
            if t + wait > t_end:
                return x + v * (t_end - t), v
            t, x = t + wait, x + v * wait
            v = -v - 2 * u if v > 0 else -v


@pytest.mark.rotating
@pytest.mark.parametrize(("compression", "off"), [(10, 1e-10), (100, 1e-7), (1000, 1e-5)])
def test_an_elastic_ball_between_closing_walls_keeps_its_digits(compression, off):
    """The error grows with the square of the compression: collisions per space left, times rounding of the clock."""
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.1, 0.1], [0.0, 1.0, -0.05])
    t_end = 4.0 * (1.0 - 0.93 / compression)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=t_end)
    x, v = between_closing_walls(t_end, 0.05)
    assert run.status is gr.Status.time
    assert abs(run.gap[-1][0] - float(x)) < off * 0.2 / compression
    assert run.velocity[-1][1] == pytest.approx(float(v), rel=1e-9)


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ENGINES)
def test_closing_walls_and_an_elastic_ball_reach_the_limit_unbroken(engine):
    scene = gr.Scene([INF, 1.0, INF], [0.0, 0.1, 0.0], [0.1, 0.1], [0.0, 1.0, -0.05])
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=4.1, max_events=100_000, engine=engine)
    assert run.status is gr.Status.max_events
    assert "the walls close at t = 4 s" in run.message
    part = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=3.9, engine=engine)
    whole = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=3.99, engine=engine)
    assert gr.edmd.resume(part, t_end=3.99, engine=engine).velocity[-1].tolist() == whole.velocity[-1].tolist()


@pytest.mark.parametrize("seed", range(12))
def test_closing_walls_with_forces_resume_bit_for_bit(seed):
    """Elastic balls, some under gravity and forces; the run is cut between two halvings of the room."""
    rng = np.random.default_rng([53, seed])
    n = int(rng.integers(1, 4))
    force = [0.0, *rng.normal(size=n), 0.0] if seed % 2 else None
    scene = gr.Scene([INF, *rng.uniform(0.3, 2.0, n), INF], [0.0] * (n + 2), rng.uniform(0.1, 0.5, n + 1),
                     [0.1, *rng.normal(size=n), -0.3], float(rng.choice([0.0, 9.81])), external_force=force)
    meet = float(scene.gap.sum()) / 0.4
    rule = gr.ConstantRestitution(1.0)
    first = gr.edmd.simulate(scene, rule, t_end=0.8 * meet, max_events=20_000)
    whole = gr.edmd.simulate(scene, rule, t_end=0.97 * meet, max_events=20_000)
    assert first.status is whole.status is gr.Status.time
    resumed = gr.edmd.resume(first, t_end=0.97 * meet)
    assert resumed.velocity[-1].tobytes() == whole.velocity[-1].tobytes()
    assert np.concatenate([first.contacts, resumed.contacts]).tobytes() == whole.contacts.tobytes()


@pytest.mark.parametrize("eps", [0.9, 1.0])
@pytest.mark.parametrize("seed", range(8))
def test_forces_like_weights_between_closing_walls_act_like_gravity(seed, eps):
    """The forces -m g and the gravity g are the same scene, but different code re-bases the clock."""
    rng = np.random.default_rng([54, seed])
    n, g = int(rng.integers(1, 4)), float(rng.uniform(1.0, 10.0))
    mass, gap = [INF, *rng.uniform(0.3, 2.0, n), INF], rng.uniform(0.1, 0.5, n + 1)
    velocity, t_end = [0.1, *rng.normal(size=n), -0.3], 0.9 * float(gap.sum()) / 0.4
    force = [0.0 if math.isinf(m) else -m * g for m in mass]
    scenes = [gr.Scene(mass, [0.0] * (n + 2), gap, velocity, **pull) for pull in (
        {"gravity": g}, {"external_force": force})]
    one, other = (gr.edmd.simulate(scene, gr.ConstantRestitution(eps), t_end=t_end) for scene in scenes)
    assert one.status is other.status
    assert one.status is gr.Status.time or eps < 1.0
    assert one.contacts["pair"].tolist() == other.contacts["pair"].tolist()
    fastest = float((one.contacts["v_in"][:, 0] - one.contacts["v_in"][:, 1]).max())
    assert np.abs(one.velocity[-1] - other.velocity[-1]).max() <= 1e-7 * fastest
