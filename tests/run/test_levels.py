"""Stop where a force, a speed or a place passes a level: located as the dense rows of the whole run say, in every
engine; nothing earlier, exactly there, and with the same bits interpreted and compiled."""

from functools import partial

import numpy as np
import pytest

import granular as gr
from granular import until
from tests.helpers import scenes_at_random

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
    return simulate(t_end=t_end, samples=np.linspace(0.0, t_end, 201))


@pytest.mark.parametrize("seed", range(4))
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


@pytest.mark.parametrize("seed", range(4))
def test_soft_spheres_stop_where_rows_say(seed):
    go, level, t_end, rows = soft_case(100 + seed)
    check(go, level, t_end, rows)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [2, 4])
def test_hard_spheres_have_the_same_bits_compiled(seed):
    rng = np.random.default_rng(seed)
    scene, t_end = scenes(rng)
    go = partial(gr.edmd.simulate, scene, RULE, max_events=3000, t_end=t_end)
    level = at_random(rng, dense(partial(gr.edmd.simulate, scene, RULE, max_events=3000), t_end), False)
    alike(go(until=level, engine="sorted"), go(until=level, engine="compiled"))


def alike(one, other):
    assert (one.status, one.time[-1]) == (other.status, other.time[-1])
    assert (one.position[-1] == other.position[-1]).all()
    assert (one.velocity[-1] == other.velocity[-1]).all()


def test_soft_spheres_have_the_same_bits_compiled():
    scene = gr.scenes.newtons_cradle(n=4)
    for level in (until.force(2, above=500.0), until.speed(3, above=0.3), until.position(3, above=0.1)):
        go = partial(gr.md.simulate, scene, gr.Hertz(1e9), until=level, t_end=0.002)
        alike(go(engine="plain"), go(engine="compiled"))


@pytest.mark.parametrize("method", ["verlet", "rk4"])
def test_fixed_steps_stop_at_the_step_or_within_a_flight(method):
    scene, law, dt = gr.scenes.three_balls(), gr.LinearDashpot(k=1e6, gamma=50.0), 5e-6
    go = partial(gr.md.simulate, scene, law, method=method, dt=dt)
    flight = go(until=until.speed(1, above=2.5), t_end=0.4, samples=[0.0, 0.2, 0.4])
    assert flight.status is gr.Status.until
    assert len(flight.time) == 3
    assert flight.time[-1] == pytest.approx(2.5 / 9.81, rel=1e-12)
    push = go(until=until.force(0, above=300.0), t_end=0.4)
    steps = push.time[-1] / dt
    assert steps == pytest.approx(round(steps), abs=1e-6)
    before = go(t_end=0.4, samples=[push.time[-1] - dt, push.time[-1]])
    assert before.force[0, 0] <= 300.0 < push.force[-1, 0]
    assert go(until=until.position(1, below=9.0), t_end=0.4).time[-1] == 0.0


def test_what_cannot_be_watched_is_refused():
    scene, law = gr.scenes.three_balls(), gr.LinearDashpot(k=1e6)
    row = gr.md.simulate(gr.scenes.newtons_cradle(n=4), gr.Hertz(1e9), until=until.contact(2))
    assert "to stop at a given force use granular.until.force(2, above=...)" in row.message
    with pytest.raises(ValueError, match="`until` must not be a force for hard spheres, whose collisions are "
                                         r"instantaneous, got Force\(pair=0, above=1\.0\)\. Use until\.speed or "
                                         r"until\.contact, or soft spheres \(granular\.md\)\."):
        gr.compare(scene, law, until=until.force(0, above=1.0))
    with pytest.raises(ValueError, match=r"`ball` of until\.speed must be a ball, 1 to 2 in this scene, got 0, "
                                         r"which is a wall\."):
        gr.md.simulate(scene, law, until=until.speed(0, above=1.0))
    with pytest.raises(ValueError, match=r"`ball` of until.position must be .* got 3\. The lowest body is 0"):
        gr.md.simulate(scene, law, until=until.position(3, above=1.0))
    with pytest.raises(ValueError, match=r"`pair` of until.force must be .*, got 2"):
        gr.md.simulate(scene, law, until=until.force(2, above=1.0))
    with pytest.raises(ValueError, match=r"`above` must be a finite number of at least 0, got -1"):
        until.speed(1, above=-1.0)
    with pytest.raises(
        TypeError, match=r"One of `above` and `below` must be given, a position in m, got None and None"
    ):
        until.position(1)
    with pytest.raises(ValueError, match=r"`until` must be until\.contact or until\.separated for frontier"):
        gr.frontier(scene, law, until=until.speed(1, above=1.0))


@pytest.mark.parametrize("text", [
    '{ type = "speed", ball = 2, above = 1.5 }', '{ type = "force", pair = 1, above = 10.0 }',
    '{ type = "position", ball = 1, below = 0.25 }', "{ pair = 0, nth = 2 }", '"separated"'])
def test_files_say_when_to_stop(text):
    case = gr.cases.loads(f'[scene]\nname = "three-balls"\n[run]\nuntil = {text}')
    assert f"until = {text}" in gr.cases.dumps(case)
    assert gr.cases.loads(gr.cases.dumps(case)).until == case.until


def test_the_command_stops_at_a_level(capsys):
    from granular.app.cli import main

    assert main(["run", "three-balls", "--until", "type=speed", "ball=2", "above=2.5"]) == 0
    assert "ended (until): the stop condition was met (t = 0.254842 s" in capsys.readouterr().out
    assert main(["compare", "three-balls", "--until", "separated"]) == 0


def test_a_sweep_stops_every_cell_at_its_level():
    scene = gr.scenes.three_balls()
    data = gr.sweep(scene, {"gap[1]": [1e-4, 1e-3]}, ["v_final"], law=gr.LinearDashpot(k=1e6, gamma=50.0),
                    until=until.speed(2, above=2.5))
    assert np.allclose(np.abs(np.asarray(data["v_final"])[:, 2]), 2.5)


def test_collisions_one_at_a_time():
    scene = gr.scenes.three_balls()
    whole = gr.edmd.simulate(scene, RULE, t_end=1.0)
    events = list(gr.edmd.events(scene, RULE, t_end=1.0))
    assert [one.contact.tobytes() for one in events] == [row.tobytes() for row in whole.contacts]
    for contact, time, after in events:
        assert time == contact["t_begin"]
        assert after.velocity[contact["pair"] :][:2] == pytest.approx(contact["v_out"], rel=1e-13)
        assert after.gap[contact["pair"]] == 0.0
    forever = gr.edmd.events(gr.scenes.ring_gas(n=5), gr.ConstantRestitution(1.0))
    assert len([next(forever) for _ in range(5)]) == 5


def test_soft_contacts_one_at_a_time():
    scene, law = gr.scenes.three_balls(), gr.LinearDashpot(k=1e6, gamma=50.0)
    whole = gr.md.simulate(scene, law, t_end=0.35).contacts
    events = list(gr.md.events(scene, law, t_end=0.35))
    assert len(events) == len(whole) > 2
    for one, row in zip(sorted(events, key=lambda e: e.contact["t_begin"]), whole, strict=True):
        assert one.time == one.contact["t_end"] == pytest.approx(row["t_end"], rel=1e-10)
        assert one.scene.velocity[row["pair"] :][:2] == pytest.approx(row["v_out"], rel=1e-9)
    with pytest.raises(TypeError, match=r"md\.events has no option `dt`; available: disturbed, engine, max_events, "
                                        r"max_steps, on_progress, progress, t_end, t_start, tol, until\."):
        gr.md.events(scene, law, dt=1e-6)
    with pytest.raises(TypeError, match=r"edmd\.events has no option `samples`; available: collapse, "
                                        "elastic_below, engine, max_events, merge_below, on_progress, progress, "
                                        r"seed, t_end, t_start, tc, ties, until, watch\."):
        gr.edmd.events(scene, RULE, samples=3)
