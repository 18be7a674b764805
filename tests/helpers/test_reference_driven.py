"""The independent reference under forces and beside driven walls: against closed forms, and its two solvers."""

import math

import numpy as np
import pytest

import granular as gr
from bench import reference
from bench.reference.taylor import Taylor
from granular.laws import resolve
from granular.laws.kinds import resolved
from granular.studies.reference import solve_with
from granular.studies.reference_events import Run

pytest.importorskip("mpmath")
from tests.helpers.driven_scenes import MP, ONE_RADIAN, riding, scenes, shaken, steady

pytestmark = pytest.mark.rotating  # tests of what tests compare with


@pytest.mark.parametrize("force", [None, [0.0, -0.25]])
def test_a_ball_that_rides_has_its_closed_form(force):
    scene, law = shaken(0.6, 0.5, 7.0, phase=0.3, gap=-0.02, velocity=0.55)
    scene = scene.replace(external_force=force)
    solved = reference.solve(scene, law, t_end=9.0)
    xi, eta = riding(scene, law, MP.mpf(9))
    assert [row.t_end for row in solved.contacts] == [None]
    assert abs(-MP.mpf(solved.gap[0]) - xi) < 1e-30
    assert abs(MP.mpf(solved.velocity[0] - solved.velocity[1]) - eta) < 1e-30
    other, _ = solve_with(scene, resolved([law], scene), None, 9.0, "DOP853", 3e-14)
    assert abs(-other.gap[0] - xi) < 1e-12


def test_lift_off_of_a_resting_ball():
    law = shaken(1.0, 0.5, 10.0)[1]
    square, damping = law.k, law.gamma
    gamma = abs(square - 1.0 + 1j * damping) / abs(square + 1j * damping)
    assert gamma == pytest.approx(0.990026129452817, abs=1e-15)
    for factor, lifts in ((1.0 - 1e-12, False), (1.0 + 1e-12, True)):
        solved = reference.solve(*steady(gamma * factor, 0.5, 10.0), t_end=6.4, digits=20)
        assert (solved.contacts[0].t_end is not None) is lifts


def jumping(*rates, start=-1.0, at=0.0):
    """A ball of 1 kg at rest on a dashpot floor under g = 2; the floor's velocity jumps then (s), and 1/4 s later."""
    breaks, rates = [*[start, at, at + 0.25][: len(rates) + 1], 9.0], [0.0, *rates]
    path = gr.walls.Piecewise(breaks, [rates, np.cumsum([0.0, *np.diff(breaks)[:-1] * rates[:-1]])])
    return gr.Scene([math.inf, 1.0], [0.0, 0.0], [-0.5], [0.0, 0.0], gravity=2.0, floor=path), DASHPOT


DASHPOT = gr.LinearDashpot(4.0, 3.0)


def on_dashpot(xi, eta, t):
    """Overlap of that ball a time t later, while the force acts and the floor moves steadily."""
    a, fall, swing = xi - MP.mpf(0.5), MP.mpf(1.5), MP.sqrt(MP.mpf(1.75))
    return 0.5 + MP.exp(-fall * t) * (a * MP.cos(swing * t) + (eta + fall * a) / swing * MP.sin(swing * t))


def both(scene, law, t_end):
    """The scene from -1 s on by both solvers, which agree."""
    solved = reference.solve(scene, law, t_start=-1.0, t_end=t_end)
    other, _ = solve_with(scene, resolved([law], scene), None, t_end, "DOP853", 3e-14, t_start=-1.0)
    assert len(other.contacts) == len(solved.contacts)
    assert abs(other.gap[0] - solved.gap[0]) < 1e-12
    return solved


@pytest.mark.parametrize("drop", [1.0, 2.0])
def test_a_floor_that_jumps_away_clips_a_dashpot_at_once(drop):
    solved = both(*jumping(-drop), 4.0)
    first, then, *_ = solved.contacts
    square = MP.mpf(drop) ** 2 - 2
    free = (MP.sqrt(5) - 1) / 4 if square < 0 else (drop + MP.sqrt(square)) / 2
    assert (first.t_end, first.v_out) == (0, (-drop, 0))
    assert abs(then.t_begin - free) < 1e-30
    xi, eta = max(0, MP.mpf(0.5) - drop * free + free**2), 2 * free - drop
    soon = both(*jumping(-drop), float(then.t_begin) + 0.125)
    assert abs(soon.gap[0] + on_dashpot(xi, eta, MP.mpf(soon.t_stop) - free)) < 1e-30


def test_a_floor_that_jumps_against_a_ball_clipped_before_pushes_it_at_once():
    solved = both(*jumping(-1.0, 1.0), 1.0)
    assert [row.t_begin for row in solved.contacts] == [-1, 0.25]
    assert abs(solved.gap[0] + on_dashpot(MP.mpf(0.3125), MP.mpf(1.5), MP.mpf(0.75))) < 1e-30


def test_a_solver_that_ends_just_short_of_a_jump_sees_it():
    start, at = -0.9, 0.75
    assert start + (at - start) < at
    scene, law = jumping(-1.0, start=start, at=at)
    solved, _ = solve_with(scene, resolved([law], scene), None, 2.0, "DOP853", 3e-14, t_start=start)
    first, then = solved.contacts
    assert (first.t_end, then.t_begin) == pytest.approx((at, at + (math.sqrt(5.0) - 1.0) / 4.0), abs=1e-12)


def test_equivalence_of_a_rising_floor_and_gravity():
    mass, gap, velocity = [math.inf, 1.0, 0.3], [0.125, 0.0625], [0.0, -0.5, 0.25]
    law = [gr.LinearDashpot(4000.0, 12.0), gr.ViscoelasticHertz(1e5, 30.0)]
    parabola = gr.walls.Piecewise([0.0, 0.25, 1.0], [[1.25, 1.25], [0.0, 0.625], [0.0, 0.078125]])  # 2.5 t²/2
    still = gr.Scene(mass, np.zeros(3), gap, velocity, gravity=2.5)
    rising = gr.Scene(mass, np.zeros(3), gap, velocity, floor=parabola)
    one, other = (reference.solve(scene, law, t_end=0.9, digits=24) for scene in (still, rising))
    assert len(one.contacts) > 2
    assert reference.distance(one, other, MP.mpf)[1] < 1e-20
    assert max(abs(a - b) for a, b in zip(one.gap, other.gap, strict=True)) < 1e-20
    speeds = [a - b for a, b in zip(one.velocity, other.velocity, strict=True)]
    assert max(abs(a - speeds[0]) for a in speeds) < 1e-20


def test_forces_on_free_balls_move_their_mass_centre_and_press_them_together():
    scene = gr.Scene([1.0, 3.0], [0.0, 0.0], [0.5], [0.0, 0.0], external_force=[2.0, -1.0])
    solved = reference.solve(scene, gr.LinearDashpot(100.0, 2.0), t_end=4.0, digits=24)
    touch = MP.sqrt(1 / (2 + MP.mpf(1) / 3))
    assert abs(solved.contacts[0].t_begin - touch) < 1e-23
    assert abs(solved.velocity[0] + 3 * solved.velocity[1] - 4) < 1e-23


@pytest.mark.parametrize("seed", [1, pytest.param(0, marks=pytest.mark.soak)])
def test_both_solvers_agree_under_forces_and_beside_driven_walls(seed):
    scene, law = scenes(seed)
    solved = reference.solve(scene, law, t_end=0.3, digits=20)
    fitted = gr.scene.places.with_fitted_walls(scene, 0.0, 0.3)
    other, _ = solve_with(fitted, resolved(law, fitted), None, 0.3, "DOP853", 1e-10)
    assert len(solved.contacts) > 2
    assert [row.pair for row in other.contacts] == [row.pair for row in solved.contacts]
    assert max(abs(float(a - b)) for a, b in zip(solved.gap, other.gap, strict=True)) < 1e-7
    assert max(abs(float(a - b)) for a, b in zip(solved.velocity, other.velocity, strict=True)) < 1e-6


def energy(scene, solved, t_end):
    """Energy in J at the end, relative to the origin of the scene, by the positions from a wall at its place."""
    x = MP.mpf(scene.velocity[0]) * MP.mpf(t_end)
    if scene.floor is not None:
        angle, a = 2 * MP.pi * MP.mpf(scene.floor.frequency), MP.mpf(scene.floor.amplitude)
        phase = MP.mpf(scene.floor.phase)
        x += a * (MP.sin(angle * MP.mpf(t_end) + phase) - MP.sin(phase))
    total = MP.zero
    for gap, m, v, f in zip(solved.gap, scene.mass[1:], solved.velocity[1:], scene.external_force[1:], strict=True):
        x += MP.mpf(gap)
        total += MP.mpf(m) * (MP.mpf(v) ** 2 / 2 + MP.mpf(scene.gravity) * x) - MP.mpf(f) * x
    return total


@pytest.mark.parametrize("law", [
    gr.LinearDashpot(3e3, 20.0),
    *(pytest.param(law, marks=pytest.mark.soak) for law in (gr.ViscoelasticHertz(3e4, 100.0), gr.Hertz(3e4))),
])
def test_the_account_of_the_energy_closes_to_all_digits(law):
    scene = gr.Scene([math.inf, 1.0, 0.5], [0.0] * 3, [0.02, 0.03], [0.125, -0.5, 0.25], 9.81,
                     external_force=[0.0, 1.0, -2.0], floor=gr.walls.Sine(0.01, 6.0, 0.5))
    for t_end in (0.34,):
        start, end = (reference.solve(scene, law, t_end=t, digits=20) for t in (0.0, t_end))
        floor, ceiling, _, _, lost = end.account
        stored = sum(law.k * max(-gap, 0) ** (MP.mpf(law.exponent) + 1) / (MP.mpf(law.exponent) + 1) for gap in end.gap)
        gained = energy(scene, end, t_end) - energy(scene, start, 0.0) + stored
        assert abs(gained - floor - ceiling + lost) < 1e-18
        assert ceiling == 0
        assert floor > 0.1
        assert (lost > 0.1) is (not isinstance(law, gr.Hertz))
        steps = gr.md.simulate(scene, law, t_end=t_end, method="rk4", dt=1e-4).ledger[-1]
        np.testing.assert_allclose(steps, [float(floor), 0.0, 0.0, 0.0, float(lost)], rtol=0.0, atol=2e-4)


def test_flights_beside_a_wall_may_be_made_at_once(monkeypatch):
    floor = gr.walls.Sine(0.01, 9.0, 2.0)
    scene = gr.Scene([math.inf, 1.0, 2.0], [0.0] * 3, [0.3, 0.2], [0.0, 0.5, -1.0], 9.81, floor=floor)
    one = reference.solve(scene, gr.LinearDashpot(1e5, 20.0), t_end=0.8, digits=20)
    monkeypatch.setattr(Taylor, "advance_free_flight", lambda self, end: False)
    other = reference.solve(scene, gr.LinearDashpot(1e5, 20.0), t_end=0.8, digits=20)
    assert len(one.contacts) > 3
    assert max(abs(a - b) for a, b in zip(one.gap, other.gap, strict=True)) < 1e-24


def test_late_times_cost_no_digits():
    scene, law = shaken(1.4, 0.5, 50.0, gap=0.1)
    periods = 2.0**20 / scene.floor.frequency
    late = scene.replace(floor=gr.walls.Sine(scene.floor.amplitude, scene.floor.frequency, 0.0))
    one = reference.solve(scene, law, t_end=5.0, digits=20)
    other = reference.solve(late, law, t_start=periods, t_end=periods + 5.0, digits=20)
    shift = float(other.contacts[-1].t_begin - periods - one.contacts[-1].t_begin)
    assert abs(shift) < 1e-8  # the period, rounded, so many times over


# the soft bouncing ball: where its orbit of period 1 doubles

def bounce(gamma, restitution, ratio, phase, v):
    """Phase less a turn, and velocity of the ball, as it hits the floor the next time."""
    scene, law = shaken(gamma, restitution, ratio, phase=phase, velocity=v)
    motion = Taylor(scene, [resolve(law, scene.pairs[0]).form], 22)
    Run(motion, gr.until.contact(0, 2), None).solve("")
    return MP.mpf(phase) + 2 * MP.pi * (MP.mpf(ONE_RADIAN) * motion.t - 1), MP.mpf(motion.v[1])


def jacobian(f, x, step):
    """Central differences, extrapolated once."""
    columns = []
    for i in range(2):
        slopes = []
        for d in (step, 2.0 * step):
            ends = [[a + sign * d * (i == j) for j, a in enumerate(x)] for sign in (1, -1)]
            one, other = (f(*end) for end in ends)
            width = MP.mpf(ends[0][i]) - MP.mpf(ends[1][i])
            slopes.append([(p - q) / width for p, q in zip(one, other, strict=True)])
        columns.append([(4 * a - b) / 3 for a, b in zip(*slopes, strict=True)])
    return MP.matrix(columns).T


def doubling(gamma, restitution, ratio, x):
    """det(J + 1) of the return map on its orbit of period 1, which is 0 where a multiplier is -1; the orbit; det J."""
    def f(phase, v):
        return bounce(gamma, restitution, ratio, phase, v)

    for _ in range(6):
        away = [b - MP.mpf(a) for a, b in zip(x, f(*x), strict=True)]
        if max(map(abs, away)) < 1e-14:
            break
        step = MP.lu_solve(jacobian(f, x, 1e-5) - MP.eye(2), MP.matrix(away))
        x = [float(a - b) for a, b in zip(x, step, strict=True)]
    j = jacobian(f, x, 2e-4)
    return MP.det(j + MP.eye(2)), x, MP.det(j)


@pytest.mark.parametrize(("restitution", "ratio", "gamma"), [
    (0.5, 1000.0, 1.52647852413489), (0.8, 1000.0, 1.07077698948191),
])
@pytest.mark.soak
def test_a_soft_bouncing_ball_doubles_its_period(restitution, ratio, gamma):
    start = [math.acos(math.pi * (1.0 - restitution) / (1.0 + restitution) / gamma), -math.pi]
    here, orbit, det = doubling(gamma, restitution, ratio, start)
    beyond, _, _ = doubling(gamma + 1e-5, restitution, ratio, orbit)
    assert float(here) * 1e-5 / float(beyond - here) == pytest.approx(0.0, abs=1e-12)  # what is missing in gamma
    assert float(det) == pytest.approx(restitution**2, abs=2e-5)
