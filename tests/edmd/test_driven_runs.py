"""Runs of hard spheres beside driven walls: accounts close, cut ones go on, queues agree; options, and what is said."""

import math

import numpy as np
import pytest

import granular as gr
from granular.scene.walls import Motion, Piecewise, Sine
from tests.helpers.hard_driven import INF, drawn, plate, remainder, run, shaken


def lift():
    """Balls on a floor at constant speed, under forces."""
    force = [0.0, 1.0, -2.0]
    return gr.Scene([INF, 1.0, 2.0], [0.0, 0.1, 0.1], [0.5, 0.3], [0.7, 0.0, 0.1], 9.81, external_force=force)


def same(a, b, mirrored=False):
    """Whether two runs have the same bits."""
    names = ["time", "position", "velocity", "gap"] + (["ledger"] if a.ledger is not None else [])
    rows = all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in names)
    columns = a.contacts.dtype.names
    return rows and a.message == b.message and len(a.contacts) == len(b.contacts) and all(
        np.array_equal(a.contacts[name], b.contacts[name], equal_nan=True) for name in columns)


@pytest.mark.rotating
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
    assert "; watch: " in result.message
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
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run with a driven wall does not end "
                                         r"by itself\. Give t_end=, until= or max_events=\."):
        run(wall)
    assert run(wall, max_events=50).status is gr.Status.max_events
    with pytest.raises(ValueError, match="t_end"):
        run(plate(1, Motion(math.sin)), until=gr.until.contact(0, 3))
    with pytest.raises(ValueError, match="The path of the wall covers only this interval"):
        run(plate(1, Piecewise([0.0, 1.0], [[0.0]])), t_end=2.0)
    first = run(plate(1, Piecewise([0.0, 1.0], [[0.0]])), t_end=0.5)
    with pytest.raises(ValueError, match="The path of the wall covers only this interval"):
        gr.edmd.resume(first, t_end=2.0)
    with pytest.raises(ValueError, match="`t_end` must be given, got None"):
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


@pytest.mark.rotating
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


@pytest.mark.parametrize("seed", range(6))
def test_the_scene_of_an_event_is_that_of_its_time(seed):
    """A plate that shakes harder than gravity holds the balls lets them go between two of their collisions."""
    rng = np.random.default_rng(seed)
    n = 1 + seed % 2
    floor = Sine(float(rng.uniform(5e-3, 2e-2)), float(rng.uniform(4.0, 8.0)))
    scene = gr.Scene([INF] + [1.0] * n, [0.0] * (n + 1), rng.uniform(1e-3, 5e-2, n), [0.0] * (n + 1), 9.81, floor=floor)
    shown = gr.edmd.events(scene, gr.ConstantRestitution(0.5), collapse="merge", merge_below=1e-2, t_end=1.5)
    for row, time, then in shown:
        balls = [body for body in then.bodies(row["pair"]) if body > 0]
        assert time == pytest.approx(row["t_begin"], rel=1e-14)
        assert then.gap[row["pair"]] == pytest.approx(0.0, abs=1e-12)
        assert then.velocity[balls] == pytest.approx(row["v_out"][-len(balls) :], rel=1e-9, abs=1e-12)
