"""The independent reference on rings, beside thermal walls, of pendula: against closed forms; its two solvers."""

import math

import numpy as np
import pytest

import granular as gr
from bench import reference
from granular.laws.kinds import resolved
from granular.studies.reference import solve_with
from granular.studies.reference_events import ACTIVE, DORMANT, OPEN, reached_by_force

pytest.importorskip("mpmath")
pytestmark = pytest.mark.rotating  # tests of what tests compare with
MP = __import__("mpmath").MPContext()
MP.dps = 40


def both(scene, law, t_end, digits=20, close=1e-11):
    """The scene by both solvers, which agree in every contact and at the end."""
    solved = reference.solve(scene, law, t_end=t_end, digits=digits)
    other, _ = solve_with(scene, resolved([law] * scene.n_pairs, scene), None, t_end, "DOP853", 3e-14)
    assert [row.pair for row in other.contacts] == [row.pair for row in solved.contacts]
    ends = zip((*other.gap, *other.velocity), (*solved.gap, *solved.velocity), strict=True)
    assert max(abs(float(x - y)) for x, y in ends) < close
    return solved


def energy(scene, solved, law):
    """Energy in J at the end of a solution above a floor, with a linear law."""
    balls, gap = ~scene.is_wall, np.array(solved.gap, float)
    v, x = np.array(solved.velocity, float)[balls], scene.offsets(gap)[balls] + scene.velocity[0] * solved.t_stop
    m = scene.mass[balls]
    return 0.5 * m @ v**2 + scene.gravity * (m @ x) + 0.5 * law.k * (np.minimum(gap, 0.0) ** 2).sum()


def test_two_balls_on_a_ring():
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [0.3, 0.7], [1.0, 0.0], ring=True)
    law = gr.LinearDashpot.from_restitution(0.9, 1e4, pair=scene.pairs[0])
    solved = both(scene, law, 3.0)
    lasts, u, t = solved.contacts[0].t_end - solved.contacts[0].t_begin, MP.mpf(1), MP.mpf(scene.gap[0])
    eps = solved.contacts[0].v_out[1] - solved.contacts[0].v_out[0]
    assert [row.pair for row in solved.contacts] == [0, 1, 0]
    free = MP.mpf(scene.gap[0]) + MP.mpf(scene.gap[1])
    for row in solved.contacts:
        assert abs(row.t_begin - t) < 1e-18
        t += lasts + (free + law.gamma * eps * u / law.k) / (eps * u)
        u *= eps
    assert abs(solved.velocity[0] + solved.velocity[1] - 1) < 1e-25


@pytest.mark.parametrize("j", [1, 3, 4])
def test_modes_of_a_ring_under_pressure(j):
    n, k, m = 8, 1e4, 2.0
    x = 1e-3 * np.cos(2.0 * np.pi * j * np.arange(n) / n)
    scene = gr.Scene([m] * n, [0.0] * n, np.roll(x, -1) - x - 0.1, [0.0] * n, ring=True)
    period = 2.0 * math.pi / (2.0 * math.sqrt(k / m) * math.sin(math.pi * j / n))
    solved = reference.solve(scene, gr.LinearDashpot(k, 0.0), t_end=period, digits=20)
    assert [row.t_end for row in solved.contacts] == [None] * n
    assert max(abs(a - b) for a, b in zip(solved.gap, scene.gap.tolist(), strict=True)) < 3e-17  # as exact as π
    assert max(abs(float(v)) for v in solved.velocity) < 1e-14


def test_a_row_at_rest_is_felt_around_a_ring():
    modes = [ACTIVE, OPEN, DORMANT, DORMANT]
    assert reached_by_force(modes, [0.0] * 4) == [True, False, False, False]
    assert reached_by_force(modes, [0.0] * 4, ring=True) == [True, False, True, True]
    assert reached_by_force([DORMANT, OPEN, ACTIVE, DORMANT], [0.0] * 4, ring=True) == [True, False, True, True]


def test_the_soft_cradle_of_pendula():
    scene = gr.Scene([1.0] * 5, [0.0] * 5, [1.0, 0.0, 0.0, 0.0], [0.0] * 5, origin=-1.0, pendulum=1.0)
    law = gr.LinearDashpot.from_restitution(0.9, 1e6, pair=scene.pairs[0])
    solved = both(scene, law, 2.0 * math.pi)
    y = np.cumsum([0.0, *map(float, solved.gap)])
    y += -0.2 - y.mean()  # the mass centre is one pendulum, after one period
    assert np.abs(y - [-0.689972, -0.443893, -0.079961, 0.068495, 0.145331]).max() < 6e-7
    v = np.array(solved.velocity, float)
    assert (v @ v + y @ y) == pytest.approx(0.705361, abs=6e-7)
    assert abs(sum(solved.velocity)) < 1e-15  # t_end is 2π to 2e-16


@pytest.mark.parametrize("origin", [0.0, 1.5])
def test_free_pendula_with_a_wall_at_rest(origin):
    scene = gr.Scene([math.inf, 1.0, 2.0], [0.0] * 3, [0.5, 0.75], [0.0, 0.5, 0.0], pendulum=2.0, rest_gap=[0.25, 0.5],
                     origin=origin)
    over = gr.Scene([2.0, 1.0, math.inf], [0.0] * 3, [0.75, 0.5], [0.0, -0.5, 0.0], pendulum=2.0, rest_gap=[0.5, 0.25],
                    origin=origin)
    solved, mirrored = (reference.solve(one, gr.LinearDashpot(1e6, 0.0), t_end=0.25) for one in (scene, over))
    assert mirrored.gap == solved.gap[::-1]
    angle = 2 * MP.mpf(0.25)
    lower = MP.mpf(0.25) * (MP.cos(angle) + MP.sin(angle))
    upper = MP.mpf(0.5) * MP.cos(angle)
    assert abs(solved.gap[0] - 0.25 - lower) < 1e-33
    assert abs(solved.gap[1] - 0.5 - upper + lower) < 1e-33
    assert abs(solved.velocity[2] + 2 * MP.mpf(0.5) * MP.sin(angle)) < 1e-33


def test_one_ball_between_thermal_walls():
    floor, ceiling = gr.walls.Thermal(2.0, 3), gr.walls.Thermal(1.0, 4)
    scene = gr.Scene([math.inf, 1.5, math.inf], [0.0] * 3, [0.25, 0.75], [0.0, 1.0, 0.0], floor=floor, ceiling=ceiling)
    solved = both(scene, gr.LinearDashpot(1e3, 1.0), 30.0, close=1e-13)
    t, hits, side = MP.mpf(0.75), [0, 0], 1
    heat, was = [0.0, 0.0], 1.0
    for row in solved.contacts:
        speed = (floor, ceiling)[side].drawn(side, hits[side], 1.5)
        hits[side] += 1
        heat[side] += 0.75 * (speed**2 - was**2)
        assert row.pair == side
        assert row.t_begin == row.t_end
        assert abs(row.t_begin - t) < 1e-17
        assert abs(float(row.v_out[1 - side])) == speed
        t, was, side = t + 1 / MP.mpf(speed), speed, 1 - side
    assert len(solved.contacts) > 20
    assert [float(x) for x in solved.account] == pytest.approx([0.0, 0.0, *heat, 0.0], abs=1e-13)


def test_a_heated_column_keeps_its_account():
    law, floor = gr.LinearDashpot(1e5, 50.0), gr.walls.Thermal(2.0, 3)
    scene = gr.Scene([math.inf, 1.0, 2.0, 0.5], [0.0] * 4, [0.3, 0.1, 0.1], [0.25, 1.0, 0.0, -1.0], 9.81, floor=floor)
    solved = both(scene, law, 0.7)
    start = reference.solve(scene, law, t_end=0.0, digits=20)
    work, _, heat, _, lost = map(float, solved.account)
    gained = energy(scene, solved, law) - energy(scene, start, law)
    assert gained - work - heat + lost == pytest.approx(0.0, abs=3e-14)
    assert min(abs(work), 100 * abs(heat), lost) > 1.0


def test_what_rests_on_a_thermal_floor_is_thrown_up():
    scene = gr.Scene([math.inf, 1.0, 2.0], [0.0] * 3, [0.0, 0.0], [0.0] * 3, 9.81, floor=gr.walls.Thermal(0.05, 5))
    solved = both(scene, gr.LinearDashpot(1e5, 0.0), 0.12)
    assert solved.contacts[0].pair == 0
    assert solved.contacts[0].t_begin == 0
    until = reference.solve(scene, gr.LinearDashpot(1e5, 0.0), until=gr.until.contact(0, 3))
    assert [row.pair for row in until.contacts].count(0) == 2


def test_what_rests_forever_says_so():
    scene = gr.Scene([1.0, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0], pendulum=1.0)
    with pytest.raises(ValueError, match=r"`t_end` must be given.*All balls are at rest"):
        reference.solve(scene, gr.LinearDashpot(1e3, 0.0))
