"""Walls that close on hard spheres: the run ends when no space is left, and no wall ever changes its velocity."""

import math

import numpy as np
import pytest

from granular import edmd
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Status
from granular.scene import Scene

WALL = math.inf


def press(n, speed=1.0, gap=1.0, gravity=0.0):
    """Balls at rest between two walls that close."""
    velocity = [speed] + [0.0] * n + [-speed]
    return Scene([WALL] + [1.0] * n + [WALL], [0.0] * (n + 2), [gap] * (n + 1), velocity, gravity)


def walls_keep_their_velocity(run):
    assert np.array_equal(run.velocity[:, 0], np.full(len(run.time), run.scene.velocity[0]))
    assert np.array_equal(run.velocity[:, -1], np.full(len(run.time), run.scene.velocity[-1]))


@pytest.mark.parametrize("engine", ["sorted", "compiled"])
@pytest.mark.parametrize("t_end", [None, 1.0, 5.0])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_sticking_balls_stop_closing_walls(n, t_end, engine) -> None:
    if engine == "compiled":
        pytest.importorskip("numba")
    start = -3.0 if t_end is None else 0.0
    run = edmd.simulate(press(n), ConstantRestitution(0.0), t_end=t_end, t_start=start, engine=engine)
    t_close = run.time[0] + 0.5 * (n + 1)
    walls_keep_their_velocity(run)
    if t_end is None or t_end >= t_close:
        assert run.status is Status.collapse
        assert f"the walls close at t = {t_close:.6g} s and leave no room for the balls" in run.message
        assert run.time[-1] == pytest.approx(t_close, abs=1e-8)
        assert run.gap[-1].sum() == pytest.approx(0.0, abs=1e-8)
        with pytest.raises(ValueError, match="collapse"):
            edmd.resume(run)
    else:
        assert run.status is Status.time


def test_merging_balls_stop_closing_walls() -> None:
    scene = Scene([WALL, 1.0, WALL], [0.0, 0.1, 0.0], [0.1, 0.1], [1e-3, 1.0, -1e-3])
    run = edmd.simulate(scene, ConstantRestitution(0.5), t_end=300.0, collapse="merge", samples=[1.0, 99.0, 200.0])
    assert run.status is Status.collapse
    assert run.time.tolist() == pytest.approx([1.0, 99.0, 100.0], rel=1e-8)
    walls_keep_their_velocity(run)


@pytest.mark.parametrize("eps", [0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("ties", ["left", "newton", "poisson"])
def test_bouncing_balls_stop_closing_walls(eps, ties) -> None:
    run = edmd.simulate(press(1), ConstantRestitution(eps), t_end=2.0, ties=ties, max_events=100_000)
    assert run.status is Status.collapse
    assert "the walls close at t = 1 s" in run.message
    walls_keep_their_velocity(run)


def test_elastic_balls_between_closing_walls_say_why_work_runs_out() -> None:
    scene = press(1).replace(velocity=[1.0, 3.0, -1.0])
    run = edmd.simulate(scene, ConstantRestitution(1.0), max_events=10_000)
    assert run.status is Status.max_events
    assert "the walls close at t = 1 s" in run.message


def test_walls_that_have_closed_already() -> None:
    run = edmd.simulate(press(2, gap=0.0), ConstantRestitution(0.5))
    assert run.status is Status.collapse
    assert len(run.contacts) == 0
    walls_keep_their_velocity(run)


def test_piles_between_closing_walls() -> None:
    run = edmd.simulate(press(3, gravity=9.81), ConstantRestitution(0.0))
    assert run.status is Status.collapse
    assert "the walls close at t = 2 s" in run.message
    walls_keep_their_velocity(run)


@pytest.mark.parametrize("velocity", [[1.0, 0.0, 1.0], [-1.0, 3.0, 1.0], [2.0, 3.0, 1.0]])
def test_other_walls_end_nothing(velocity) -> None:
    scene = Scene([WALL, 1.0, WALL], [0.0, 0.1, 0.0], [1.0, 1.0], velocity)
    assert edmd.simulate(scene, ConstantRestitution(1.0), t_end=0.5).status is Status.time


def test_a_closer_look_keeps_the_velocity_of_both_walls() -> None:
    run = edmd.simulate(press(1), ConstantRestitution(0.9999), max_events=100_000)
    walls_keep_their_velocity(run)
