"""Stop where a force, a speed or a place passes a level: located as the dense rows of the whole run say, in every
engine; nothing earlier, exactly there, and with the same bits interpreted and compiled."""

from functools import partial

import numpy as np
import pytest
import scenes_at_random

import granular as gr
from granular import until

RULE = gr.ConstantRestitution(0.8)
TOL = 1e-9


def shown(run, level):
    """What is watched, signed so that the level is passed upwards, and that level."""
    if isinstance(level, until.Force):
        return run.force[:, level.pair], level.above
    if isinstance(level, until.Speed):
        return np.abs(run.velocity[:, level.ball]), level.above
    x = run.position[:, level.ball]
    return (x, level.above) if level.below is None else (-x, -level.below)


def at_random(rng, run, force):
    """A level that is passed on the way, or just not."""
    scene = run.scene
    balls = np.flatnonzero(~scene.is_wall)
    ball, pair, part = int(rng.choice(balls)), int(rng.integers(scene.n_pairs)), float(rng.uniform(0.2, 1.05))
    kind = str(rng.choice(["force", "speed", "above", "below"][not force:]))
    if kind == "force":
        return until.force(pair, above=part * float(run.force[:, pair].max()))
    if kind == "speed":
        v = np.abs(run.velocity[:, ball])
        return until.speed(ball, above=float(v[0] + part * (v.max() - v[0])) or 1e-3)
    x = run.position[:, ball]
    far = x.max() if kind == "above" else x.min()
    return until.position(ball, **{kind: float(x[0] + part * (far - x[0]))})


def check(simulate, level, t_end, rows):
    """Where the run stops, against the rows of the whole run; returns the run that stopped."""
    run = simulate(until=level, t_end=t_end)
    q, limit = shown(rows, level)
    scale = max(np.abs(q).max(), abs(limit))
    before = rows.time < run.time[-1]
    assert (q[before] <= limit + TOL * scale).all(), (level, run.time[-1])
    if run.status is not gr.Status.until:
        assert run.time[-1] == t_end
        assert q.max() <= limit + TOL * scale
        return run
    value = shown(run, level)[0][-1]
    assert value >= limit - TOL * scale
    if run.time[-1] > 0.0:
        part = 1e-9 * run.time[-1]
        near = simulate(t_end=t_end, samples=[run.time[-1] - part, run.time[-1]])
        was, now = shown(near, level)[0]
        assert was <= limit + TOL * scale
        slope = 1.0 + abs(now - was) / (TOL * scale)  # a force that begins with a jump
        assert abs(now - value) <= 100.0 * TOL * scale * slope
        jumped = now - was > 1e3 * TOL * scale
        assert jumped or abs(value - limit) <= 1e3 * TOL * scale
    return run


def scenes(rng):
    """A scene of some kind, and a time in which a lot happens."""
    kind = int(rng.integers(6))
    if kind == 0:
        return scenes_at_random.scene(rng, (2, 5), size=1e-2), 0.2
    if kind == 1:
        return scenes_at_random.scene(rng, (2, 5), gravity=(9.81,), size=1e-2), 0.2
    if kind == 2:
        return gr.scenes.vibrated_column(n=3, frequency=30.0, gap=2e-3), 0.1
    if kind == 3:
        return gr.scenes.pendulum_cradle(n=3), 2.0
    if kind == 4:
        return gr.scenes.ring_gas(n=5, seed=int(rng.integers(99))), 0.5
    return gr.scenes.three_balls(gap=1e-3), 0.6


def dense(simulate, t_end):
    return simulate(t_end=t_end, samples=np.linspace(0.0, t_end, 1501))


@pytest.mark.parametrize("seed", range(20))
def test_hard_spheres_stop_where_rows_say(seed):
    rng = np.random.default_rng(seed)
    scene, t_end = scenes(rng)
    go = partial(gr.edmd.simulate, scene, RULE, max_events=3000)
    rows = dense(go, t_end)
    if rows.status is not gr.Status.time:
        t_end = 0.5 * float(rows.time[-1])
        rows = dense(go, t_end)
    check(go, at_random(rng, rows, False), t_end, rows)


LAWS = gr.LinearDashpot(k=1e4, gamma=3.0), gr.Hertz(1e6), gr.LinearDashpot(k=1e5)


def soft_case(seed):
    """A scene of soft spheres, its whole run in dense rows, and a level."""
    rng = np.random.default_rng(seed)
    scene, t_end = scenes(rng)
    go = partial(gr.md.simulate, scene, LAWS[int(rng.integers(3))], engine="plain")
    rows = dense(go, 0.3 * t_end)
    return go, at_random(rng, rows, True), 0.3 * t_end, rows


@pytest.mark.parametrize("seed", range(8))
def test_soft_spheres_stop_where_rows_say(seed):
    go, level, t_end, rows = soft_case(100 + seed)
    check(go, level, t_end, rows)
