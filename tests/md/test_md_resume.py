"""Soft runs that are cut, in the middle of contacts too, and gone on with: the same bits as the run in one."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import granular as gr
from granular._engine.kernels import have_numba
from tests.helpers.scenes_at_random import OwnHertz, scene

LAWS: list[Any] = [
    gr.LinearDashpot(1e5, 5.0), gr.Hertz(1e7), gr.ViscoelasticHertz(1e7, 1e3), gr.TsujiHertz(1e7, 0.3),
    gr.WaltonBraun(1e5, 2e5), OwnHertz(1e7),
]
ENGINES = ["plain", "compiled"] if have_numba() else ["plain"]


def cut(rng: Any, whole: gr.Trajectory, start: float, end: float) -> float:
    """A time at random, in the middle of a contact if there is one."""
    lasting = whole.contacts[whole.contacts["duration"] > 0.0]
    if not len(lasting) or rng.random() < 0.3:
        return float(rng.uniform(start, end))
    contact = lasting[rng.integers(len(lasting))]
    return float(min(end, contact["t_begin"] + rng.random() * contact["duration"]))


def check_same(whole: gr.Trajectory, one: gr.Trajectory, two: gr.Trajectory) -> None:
    """State at the end, account of the work, and all contacts."""
    assert two.gap[-1].tobytes() == whole.gap[-1].tobytes()
    assert two.velocity[-1].tobytes() == whole.velocity[-1].tobytes()
    assert two.force[-1].tobytes() == whole.force[-1].tobytes()
    assert repr(dict(two.stats)) == repr(dict(whole.stats))
    log = np.concatenate([one.contacts[~np.isnan(one.contacts["t_end"])], two.contacts])
    assert log[np.lexsort((log["pair"], log["t_begin"]))].tobytes() == whole.contacts.tobytes()


@pytest.mark.rotating
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("engine", ENGINES)
def test_two_halves_are_the_whole(law, engine, tmp_path):
    if engine == "compiled" and isinstance(law, gr.WaltonBraun | OwnHertz):
        pytest.skip("not compiled")
    rng = np.random.default_rng(3)
    done = 0
    for _ in range(9 if engine == "compiled" or isinstance(law, gr.LinearDashpot) else 4):
        balls, start, end = scene(rng, gaps=("wide", "touching", "overlapping")), rng.uniform(-5.0, 5.0), 0.0
        end = start + rng.uniform(0.005, 0.1)
        options = {"engine": engine, "max_steps": 3000}
        whole = gr.md.simulate(balls, law, t_start=start, t_end=end, **options)
        if whole.status is not gr.Status.time:
            continue
        one = gr.md.simulate(balls, law, t_start=start, t_end=cut(rng, whole, start, end), **options)
        if one.time[-1] == end or not one.state:
            continue
        if done % 2:
            one.save(tmp_path / "one.npz")
            one = gr.Trajectory.load(tmp_path / "one.npz", law=law)
        check_same(whole, one, gr.md.resume(one, t_end=end, **options))
        done += 1
    assert done


@pytest.mark.rotating
def test_a_pile_that_creeps_is_gone_on_with():
    column = gr.scenes.column(4, gravity=9.81)
    law = gr.LinearDashpot(1e5, 300.0)
    whole = gr.md.simulate(column, law, t_end=1.0, engine="plain")
    assert whole.stats["resting"]
    for time in (0.1, 0.5, 0.9):
        one = gr.md.simulate(column, law, t_end=time, engine="plain")
        check_same(whole, one, gr.md.resume(one, t_end=1.0, engine="plain"))


@pytest.mark.parametrize("nth", [1, 2, 3, 4])
def test_a_run_that_has_stopped_goes_on(nth):
    """At a contact, whose count goes on from the beginning; and at the horizon of isolated contacts."""
    scene = gr.scenes.three_balls()
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    whole = gr.md.simulate(scene, law, t_end=0.6)
    check_same(whole, *halves(gr.md.simulate(scene, law, until=gr.until.contact(1, nth))))
    check_same(whole, *halves(gr.md.simulate(scene, law, disturbed="stop")))
    again = gr.md.resume(gr.md.simulate(scene, law, t_end=0.1), until=gr.until.contact(1, nth))
    assert again.time[-1] == gr.md.simulate(scene, law, until=gr.until.contact(1, nth)).time[-1]


def halves(one: gr.Trajectory) -> tuple[gr.Trajectory, gr.Trajectory]:
    """A run, and how it goes on."""
    return one, gr.md.resume(one, t_end=0.6)


def test_limits_count_from_the_cut():
    gas = gr.scenes.gas(n=20)
    one = gr.md.simulate(gas, gr.Hertz(1e8), max_events=10)
    two = gr.md.resume(one, max_events=15)
    assert two.stats["contacts"] == 25
    whole = gr.md.simulate(gas, gr.Hertz(1e8), max_events=25)
    assert two.gap[-1].tobytes() == whole.gap[-1].tobytes()
    assert two.contacts[-10:].tobytes() == whole.contacts[-10:].tobytes()
    assert gr.md.resume(one, max_steps=2**63 - 1, max_events=1).stats["contacts"] == 11


@pytest.mark.parametrize("run", [
    gr.edmd.simulate(gr.scenes.bouncing_ball(), gr.ConstantRestitution(0.5), t_end=0.1),
    gr.md.simulate(gr.scenes.bouncing_ball(), gr.Hertz(1e6), t_end=0.1, method="verlet"),
    gr.md.simulate(gr.Scene([1.0, 1.0], [0.1] * 2, [-0.01], [0.0, 0.0]), gr.Hertz(1e6), until=gr.until.contact(0, 1)),
], ids=["hard", "fixed steps", "not begun"])
def test_what_cannot_be_gone_on_from_is_refused(run):
    with pytest.raises(ValueError, match=r"`trajectory` must be a run of granular\.md\.simulate by method "
                                         r"'located' that has begun, got a run (of hard spheres|without a checkpoint)"
                                         r"\. For hard spheres use "
                                         r"granular\.edmd\.resume\."):
        gr.md.resume(run, t_end=1.0)


def test_an_end_before_the_cut_is_refused():
    run = gr.md.simulate(gr.scenes.bouncing_ball(), gr.Hertz(1e6), t_end=0.1)
    with pytest.raises(ValueError, match=r"`t_end` must be a finite number of at least 0\.1, got 0\.05\. The run "
                                         r"starts there\."):
        gr.md.resume(run, t_end=0.05)


def test_disturbed_is_checked():
    ball = gr.scenes.bouncing_ball()
    with pytest.raises(ValueError, match="`disturbed` must be one of resolve, stop, ignore, got 'halt'"):
        gr.md.simulate(ball, gr.Hertz(1e6), t_end=0.1, disturbed="halt")
    with pytest.raises(ValueError, match=r"`disturbed` must be 'resolve' for method 'verlet', got 'stop'\. Use "
                                         r"method='located'\."):
        gr.md.simulate(ball, gr.Hertz(1e6), t_end=0.1, method="verlet", disturbed="stop")


@pytest.mark.rotating
@pytest.mark.parametrize("law", [gr.LinearDashpot(1e4, 3.0), gr.Hertz(1e5), OwnHertz(1e5)])
def test_ignored_contacts_are_soft_event_driven(law):
    """Every contact has the speeds of an isolated one, each pair one contact at a time, and neighbours wait for it."""
    rng = np.random.default_rng(5)
    balls = gr.Scene([math.inf, *rng.uniform(0.5, 2, 4), math.inf], [0.0] * 6, rng.uniform(0.001, 0.02, 5),
                     [0.0, *rng.normal(size=4), 0.0])
    run = gr.md.simulate(balls, law, t_end=0.3, disturbed="ignore", max_events=100)
    log = run.contacts[~np.isnan(run.contacts["t_end"])]
    assert run.stats["isolated"] < len(run.contacts)
    for row in log:
        pair = balls.pairs[int(row["pair"])]
        speed = row["v_in"][0] - row["v_in"][1]
        alone = gr.binary.collision(law, pair, float(speed))
        assert row["v_out"][1] - row["v_out"][0] == pytest.approx(alone.restitution * speed, rel=1e-11)
        assert row["duration"] == pytest.approx(alone.duration, rel=1e-11)
        near = log[abs(log["pair"] - row["pair"]) == 1]
        assert not ((near["t_begin"] > row["t_begin"]) & (near["t_begin"] < row["t_end"])).any()


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
def test_a_run_of_an_earlier_version_that_crept_by_modes_goes_on():
    """Its records are those of the start of the creep, earlier than the end of its first part."""
    scene, law, end = gr.scenes.column(4, gravity=9.81), gr.LinearDashpot(1e5, 3e4), 3.0
    start, one = (gr.md.simulate(scene, law, t_end=time) for time in (0.5, 2.0))
    old = dataclasses.replace(one, state=dict(start.state) | {"creeping": True})
    again, whole = gr.md.resume(old, t_end=end, samples=[2.0, 2.5, end]), gr.md.simulate(scene, law, t_end=end)
    assert again.status is gr.Status.time
    assert again.time.tolist() == [2.0, 2.5, end]
    np.testing.assert_allclose(again.gap[-1], whole.gap[-1], rtol=1e-13)
    np.testing.assert_allclose(again.gap[0], one.gap[-1], rtol=1e-13)
    assert again.contacts["t_begin"].tolist() == whole.contacts["t_begin"].tolist()
