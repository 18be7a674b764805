"""Laws as users write them, one step beside the built-in ones: late forces, jumps, dead zones, cohesion, rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

import granular as gr
from tests.helpers.own_laws import Shell


class Late:
    """No force up to an overlap of 1 cm, then a spring."""

    rate_dependent = False

    def force(self, xi, xi_dot, pair):
        return max(0.0, 1e3 * (xi - 0.01))


class Flat:
    """The same force at every overlap."""

    rate_dependent = False

    def force(self, xi, xi_dot, pair):
        return 10.0


class Step:
    """A spring whose force jumps by 5 N at 2 cm."""

    rate_dependent = False

    def force(self, xi, xi_dot, pair):
        return 100.0 * xi + (5.0 if xi > 0.02 else 0.0)


class Hole:
    """A spring with a hole."""

    rate_dependent = False

    def __init__(self, start):
        self.start = start

    def force(self, xi, xi_dot, pair):
        return 0.0 if self.start < xi < self.start + 0.03 else xi


class Stiffening:
    """A damped spring that gets stiffer."""

    def force(self, xi, xi_dot, pair):
        return 1e4 * xi + 1e6 * xi**3 + 30.0 * xi_dot


class Cohesive:
    """An overdamped spring that would pull below an overlap of 0.3 mm."""

    def force(self, xi, xi_dot, pair):
        return 95000.0 * xi + 617.0 * xi_dot - 30.8


def on_a_wall(mass, speed):
    return gr.Scene([math.inf, mass], [0.0, 0.5], [0.1], [0.0, -speed])


@pytest.mark.rotating
@pytest.mark.parametrize("tol", [1e-16, 1e-13])
@pytest.mark.parametrize("speed", np.linspace(0.3, 3.0, 8))
def test_a_late_force_is_felt_from_its_first_moment(speed, tol):
    run = gr.md.simulate(on_a_wall(1.0, speed), Late(), tol=tol)
    assert run.velocity[-1, 1] == pytest.approx(speed, rel=1e-14)
    (row,) = run.contacts
    assert row["t_begin"] == pytest.approx(0.11 / speed, rel=1e-15)
    assert row["duration"] == pytest.approx(math.pi / math.sqrt(1e3), rel=1e-13)


def test_a_constant_force_has_its_own_peak():
    (row,) = gr.md.simulate(on_a_wall(1.0, 1.0), Flat()).contacts
    assert row["force_max"] == pytest.approx(10.0, rel=1e-14)
    assert row["duration"] == pytest.approx(0.2, rel=1e-14)
    assert row["v_out"][1] == pytest.approx(1.0, rel=1e-14)


def test_the_peak_beside_a_jump_is_that_of_the_law():
    (row,) = gr.md.simulate(on_a_wall(2.0, 0.2), Step()).contacts
    assert row["force_max"] == pytest.approx(Step().force(row["xi_max"], 0.0, None), rel=1e-12)
    assert row["v_out"][1] == pytest.approx(0.2, rel=1e-12)


@pytest.mark.rotating
@pytest.mark.parametrize("start", [0.1, 0.434, 0.65, 0.8])
def test_a_hole_in_the_force_is_seen_both_ways(start):
    run = gr.md.simulate(on_a_wall(1.0, 1.0), Hole(start))
    assert run.velocity[-1, 1] == pytest.approx(1.0, rel=1e-11)
    assert len(run.contacts) == 3


@pytest.mark.rotating
@pytest.mark.parametrize("t_end", [10.0, 1e6, None])
def test_a_ball_on_a_damped_law_comes_to_rest(t_end):
    run = gr.md.simulate(gr.Scene([math.inf, 1.0], [0, 0.5], [0.01], [0, 0], 9.81), Stiffening(), t_end=t_end)
    assert run.stats["steps"] < 1000
    assert run.status is (gr.Status.resting if t_end is None else gr.Status.time)
    assert run.velocity[-1].tolist() == [0.0, 0.0]
    assert run.force[-1, 0] == pytest.approx(9.81, rel=1e-13)
    if t_end is not None:
        assert run.time[-1] == t_end
        assert run.contacts["impulse"].sum() == pytest.approx(9.81 * t_end, rel=1e-13)


@pytest.mark.rotating
def test_a_pile_at_rest_wakes_when_it_is_hit():
    scene = gr.Scene([math.inf, 1.0, 1.0], [0, 0.5, 0.5], [0.01, 9.0], [0, 0, 0], 9.81)
    run = gr.md.simulate(scene, Stiffening(), t_end=20.0, samples=5)
    assert run.count(1) > 0
    assert run.contacts["impulse"][run.contacts["pair"] == 0].sum() == pytest.approx(2.0 * 9.81 * 20.0, rel=1e-12)
    assert run.velocity[-1].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.rotating
def test_balls_that_settle_where_the_force_is_zero_stay_there():
    scene = gr.Scene([0.07, 1.0], [0.5, 0.5], [0.01], [0.9, 0.0])
    run = gr.md.simulate(scene, Cohesive(), t_end=0.1, until=gr.until.contact(0, 2))
    assert run.status is gr.Status.time
    assert len(run.contacts) == 1


@pytest.mark.rotating
def test_a_contact_that_takes_all_speed_is_a_rule_of_zero():
    law = gr.LinearDashpot(1e4, 30.0)
    assert gr.binary.restitution_of([law, law])(1.0, gr.scenes.three_balls().pairs[0]) > 0.0

    class Overdamped:
        def force(self, xi, xi_dot, pair):
            return 500.0 * xi**2.5 + 2.0 * xi_dot

    scene = gr.Scene([math.inf, 1.0], [0, 0.5], [0.1], [0, -1.0], 9.81)
    rule = gr.binary.restitution_of([Overdamped()])
    assert 0.5 < rule(1.0, scene.pairs[0]) < 0.6
    assert rule(1e-25, scene.pairs[0]) == pytest.approx(0.0, abs=1e-12)
    assert gr.compare(scene, Overdamped(), t_end=0.4).verdict


@pytest.mark.parametrize("how", [{}, {"dt": 1e-6}])
def test_a_touch_without_a_push_is_no_contact(how):
    """The log begins with the push, and `until` counts it as the first; a hole in the force parts two pushes."""
    law = Shell(1e6, 2e-4)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.5], [0.1], [0.0, -1.0])
    run = gr.md.simulate(scene, law, until=gr.until.contact(0, 2), t_end=0.2, **how)
    (row,) = run.contacts
    assert (row["t_begin"], row["duration"]) == pytest.approx((0.1002, 1e-3 * math.pi), rel=1e-6)
    assert run.status is gr.Status.time
    before = gr.md.simulate(scene, law, until=gr.until.contact(0, 1), t_end=0.2, **how)
    assert (before.status, len(before.contacts)) == (gr.Status.until, 0)
    assert (before.time[-1], before.gap[-1, 0]) == pytest.approx((0.1002, -2e-4), rel=1e-6)
