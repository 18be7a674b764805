"""Hard spheres at awkward moments: a stop inside a closer look, a row at a collision, balls that stick on strings."""

import math

import numpy as np
import pytest

import granular as gr

ENGINES = ["sorted", "compiled"]


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", range(20))
def test_a_run_stopped_inside_a_closer_look_goes_on_as_if_it_had_not_been(seed, engine) -> None:
    rng = np.random.default_rng(seed)
    gravity = 9.81 * (seed % 2)
    wall = [math.inf] if gravity else []
    scene = gr.Scene([*wall, *rng.uniform(0.5, 2.0, 4)], [*[0.0] * len(wall), *[0.05] * 4],
                     rng.uniform(0.05, 0.5, 3 + len(wall)), [*[0.0] * len(wall), *rng.normal(size=4)], gravity)
    rule = gr.ConstantRestitution(float(rng.uniform(0.05, 0.2)))
    whole = gr.edmd.simulate(scene, rule, engine=engine)
    pair = int(whole.contacts["pair"][-1])
    for nth in {1, whole.count(pair) // 2, whole.count(pair)} - {0}:
        part = gr.edmd.simulate(scene, rule, until=gr.until.contact(pair, nth), engine=engine)
        row = whole.of(pair)[nth - 1]
        assert part.time[-1] == row["t_begin"]
        bodies = list(scene.bodies(pair))
        assert part.velocity[-1][bodies] == pytest.approx(row["v_in"], rel=1e-9, abs=1e-12)
        more = gr.edmd.resume(part, engine=engine)
        assert more.time[-1] == whole.time[-1]
        both = np.concatenate([part.contacts, more.contacts])
        assert all(np.array_equal(both[name], whole.contacts[name]) for name in ("pair", "t_begin", "v_out", "impulse"))


def test_a_bystander_flies_on_while_others_are_looked_at() -> None:
    scene = gr.Scene([1.0] * 4, [0.1] * 4, [1.0] * 3, [1.0, 0.0, 0.0, 5.0])
    rule = gr.ConstantRestitution(0.072)
    n = int((gr.edmd.simulate(scene, rule).contacts["pair"] == 1).sum())
    part = gr.edmd.simulate(scene, rule, until=gr.until.contact(1, n))
    assert part.position[-1][3] == pytest.approx(scene.position[3] + 5.0 * part.time[-1], rel=1e-14)


@pytest.mark.parametrize("ceiling", [False, True])
def test_pendula_that_stick_beside_a_wall_swing_as_they_do_in_the_limit(ceiling) -> None:
    wall, n = [math.inf] * ceiling, 3 + ceiling
    scene = gr.Scene([math.inf, 1.0, 1.0, *wall], [0.0] * n, [0.5] * (n - 1), [0.0, 1.0, -1.0, *[0.0] * ceiling],
                     pendulum=1.0, rest_gap=[0.5] * (n - 1))
    stuck, nearly = (gr.edmd.simulate(scene, gr.ConstantRestitution(eps), t_end=0.8) for eps in (0.0, 1e-9))
    assert stuck.status is gr.Status.time
    assert stuck.velocity[-1] == pytest.approx(nearly.velocity[-1], abs=1e-8)
    assert stuck.gap[-1] == pytest.approx(nearly.gap[-1], abs=1e-8)


@pytest.mark.parametrize("start", [0.0, 1e3])
def test_a_collision_at_the_time_of_a_row_has_acted(start) -> None:
    scene, rule = gr.Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], 9.81), gr.ConstantRestitution(0.95)
    log = gr.edmd.simulate(scene, rule, t_start=start, t_end=start + 5.0).contacts
    for i, row in enumerate(log):
        t = float(row["t_begin"])
        run = gr.edmd.simulate(scene, rule, t_start=start, t_end=start + 5.0, samples=[t])
        assert run.velocity[0][1] == pytest.approx(row["v_out"][1], rel=1e-9)
        assert len(gr.edmd.simulate(scene, rule, t_start=start, t_end=t).contacts) == i + 1


def test_nobody_says_that_no_collision_can_follow_while_some_are_looked_at() -> None:
    scene, rule = gr.scenes.newtons_cradle(n=3, gap=1.0), gr.ConstantRestitution(0.0719)
    run = gr.edmd.resume(gr.edmd.simulate(scene, rule, t_end=5.0), t_end=50.0)
    assert "no further collision is possible" not in run.message
    assert len(gr.edmd.resume(run).contacts) == 1


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", range(8))
def test_infinitely_many_bounces_are_the_same_whatever_is_asked(seed, engine) -> None:
    """A geometric series, with rows and a stop ever closer to its end; a ball that hovers above changes nothing."""
    rng = np.random.default_rng(seed)
    eps, height, g = float(rng.uniform(0.05, 0.9)), float(rng.uniform(0.1, 2.0)), float(rng.uniform(1.0, 20.0))
    scene = gr.Scene([math.inf, 1.0, 1.0], [0.0] * 3, [height, 1e4], [0.0] * 3, g)
    fall, rule = math.sqrt(2.0 * height / g), gr.ConstantRestitution(eps)
    rests = fall * (1.0 + eps) / (1.0 - eps)
    whole = gr.edmd.simulate(scene, rule, engine=engine)
    log = whole.contacts
    assert whole.status is gr.Status.collapse
    assert whole.time[-1] == pytest.approx(rests, rel=1e-14)
    left = 2.0 * fall * eps ** np.arange(1, len(log) + 1) / (1.0 - eps)
    assert rests - log["t_begin"] == pytest.approx(left, rel=1e-9, abs=1e-14 * rests)
    times = rests - (rests - fall) * np.logspace(0.0, -15.0, 40)
    rows = gr.edmd.simulate(scene, rule, engine=engine, samples=times, t_end=rests + 1.0)
    part = gr.edmd.simulate(scene, rule, engine=engine, t_end=float(times[seed + 5]))
    more = gr.edmd.resume(part, engine=engine)
    for run, found in ((rows, rows.contacts), (more, np.concatenate([part.contacts, more.contacts]))):
        assert run.status is whole.status
        assert found.tobytes() == log.tobytes()
        for last in ("time", "gap", "velocity"):
            assert getattr(run, last)[-1].tolist() == getattr(whole, last)[-1].tolist()
