"""Soft spheres by located events beside driven walls and under forces: numbers, closed forms, and what is refused."""

import math

import numpy as np
import pytest

import granular as gr
from tests.helpers import driven_scenes
from tests.helpers.driven_scenes import ONE_RADIAN, shaken, steady

PERIOD = 1.0 / ONE_RADIAN


@pytest.mark.rotating
def test_lift_off_of_a_resting_ball():
    law = shaken(1.0, 0.5, 10.0)[1]
    gamma = abs(law.k - 1.0 + 1j * law.gamma) / abs(law.k + 1j * law.gamma)
    assert gamma == pytest.approx(0.990026129452817, abs=1e-15)
    for factor, lifts in ((1.0 - 1e-12, False), (1.0 + 1e-12, True)):
        run = gr.md.simulate(*steady(gamma * factor, 0.5, 10.0), t_end=6.4)
        assert np.isfinite(run.contacts["t_end"][0]) == lifts


class ReturnMap:
    """The state after a period of a ball that bounces once in each, from gap and velocity half way between bounces."""

    def __init__(self, gamma, restitution, ratio):
        phase = math.acos(math.pi * (1.0 - restitution) / (1.0 + restitution) / gamma)
        self.start = np.array([2.0 * gamma * math.sin(phase) + 0.5 * math.pi**2, 0.0])
        self.scene, self.law = shaken(gamma, restitution, ratio, phase=phase + math.pi)

    def __call__(self, state):
        scene = self.scene.replace(gap=[state[0]], velocity=[0.0, state[1]])
        run = gr.md.simulate(scene, self.law, t_end=PERIOD, engine="plain", log=False)
        return np.array([run.gap[-1, 0], run.velocity[-1, 1]])

    def jacobian(self, state, h=2e-3):
        columns = []
        for unit in np.eye(2):
            odd = [self(state + j * h * unit) - self(state - j * h * unit) for j in (1, 2, 3)]
            columns.append((45.0 * odd[0] - 9.0 * odd[1] + odd[2]) / (60.0 * h))
        return np.transpose(columns)

    def orbit(self):
        """The fixed point, by Newton's method."""
        state = self.start
        slope = self.jacobian(state)
        for _ in range(12):
            step = np.linalg.solve(np.eye(2) - slope, self(state) - state)
            state = state + step
            if abs(step).max() < 1e-14:
                break
        return state

    def past_doubling(self):
        """det(J + 1): 0 where a multiplier is -1."""
        return float(np.linalg.det(self.jacobian(self.orbit()) + np.eye(2)))


@pytest.mark.rotating
@pytest.mark.parametrize(("restitution", "ratio", "gamma"), [
    (0.5, 1e4, 1.52678914629763), (0.5, 1e3, 1.52647852413489), (0.8, 1e3, 1.07077698948191),
])
def test_period_doubling_of_the_soft_bouncing_ball(restitution, ratio, gamma):
    a, b = gamma * (1.0 + 1e-4), gamma * (1.0 - 1e-4)
    at_a = ReturnMap(a, restitution, ratio).past_doubling()
    for _ in range(6):
        at_b = ReturnMap(b, restitution, ratio).past_doubling()
        a, at_a, b = b, at_b, b - at_b * (b - a) / (at_b - at_a)
        if abs(b - a) < 1e-13:
            break
    assert b == pytest.approx(gamma, abs=1e-11)


@pytest.mark.rotating
def test_where_a_soft_plate_doubles_the_period_and_a_hard_one_does_not():
    scene = ReturnMap(1.525, 0.5, 100.0)
    scene, law = scene.scene.replace(gap=[scene.start[0]]), scene.law
    run = gr.md.simulate(scene, law, t_end=400.0 * PERIOD, samples=np.arange(401.0) * PERIOD, log=False)
    once, twice = abs(np.diff(run.gap[:, 0])), abs(run.gap[2:, 0] - run.gap[:-2, 0])
    assert once[-40:].min() > 0.3  # it settles on period 2, slowly so near to where that begins
    assert twice[-40:].max() < twice[-100:-60].min() < 1e-3


@pytest.mark.rotating
@pytest.mark.parametrize("start", [0.0, 1e7 * PERIOD])
def test_a_ball_that_rides_has_its_closed_form_after_many_periods(start):
    mp = pytest.importorskip("mpmath").MPContext()
    mp.dps = 40
    scene, law = shaken(0.6, 0.5, 7.0, phase=0.3, gap=-0.02, velocity=0.55)
    end = start + 100.0 * PERIOD
    run = gr.md.simulate(scene, law, t_start=start, t_end=end)
    omega, elapsed = 2 * mp.pi * scene.floor.frequency, mp.mpf(end) - mp.mpf(start)
    square, damping = mp.mpf(law.k), mp.mpf(law.gamma)
    sway = -scene.floor.amplitude * omega**2 / (square - omega**2 + 1j * damping * omega)
    angle = mp.expj(omega * mp.mpf(end) + mp.mpf(scene.floor.phase))  # the rest has decayed: exp(-0.2 · 7 · 628)
    assert elapsed > 600
    assert abs(-run.gap[-1, 0] - (1 / square + (sway * angle).imag)) < 1e-16
    rate = run.velocity[-1, 0] - run.velocity[-1, 1]
    assert abs(rate - (1j * omega * sway * angle).imag) < 1e-15
    books = run.account()
    closes = books["energy"][-1] - books["energy"][0] - books["work"][-1, 0] + books["dissipated"][-1]
    assert abs(closes) < 1e-13 * 100.0 * 0.01


def test_a_wall_that_jerks_kicks_what_rests_on_it_and_lets_it_fly():
    law = gr.LinearDashpot(1e4, 20.0)
    floor = gr.walls.Piecewise([0.0, 1.0, 1.25, 3.0], [[0.0, 0.5, 0.0], [0.0, 0.0, 0.125]])
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [-9.81e-4], [0.0, 0.0], gravity=9.81, floor=floor)
    run = gr.md.simulate(scene, law, t_end=3.0, samples=[0.0, 1.0, 1.25, 3.0])
    still = gr.md.simulate(
        scene.replace(floor=None, velocity=[0.0, -0.5]), law, t_end=0.25, samples=[0.0, 0.25]
    )  # as the wall sees it while it rises
    assert run.gap[1, 0] == pytest.approx(-9.81e-4, rel=1e-15)
    assert run.gap[2, 0] == pytest.approx(still.gap[-1, 0], rel=1e-12)
    assert len(run.contacts) > 2
    books = run.account()
    assert abs(np.diff(books["energy"] - books["work"].sum(axis=1) + books["dissipated"])).max() < 1e-13


def test_a_ball_at_rest_on_a_wall_that_stands_still_is_kicked_when_it_moves():
    floor = gr.walls.Piecewise([0.0, 1.0, 2.0], [[0.0, 0.5], [0.0, 0.0], [0.0, 0.0]])  # then t²/2
    for law in (gr.LinearDashpot(1e4, 0.0), gr.Hertz(1e6), gr.ViscoelasticHertz(1e6, 1e3)):
        scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0], floor=floor)
        run = gr.md.simulate(scene, law, t_end=2.0)
        assert len(run.contacts)
        assert run.velocity[-1, 1] == pytest.approx(1.0, abs=0.05)


def test_gravity_force_and_acceleration_of_the_floor_press_a_touching_ball_alike():
    """Only their sum counts: a damped oscillation about its static overlap, or a fall off the floor."""
    rng, pressed = np.random.default_rng(0), 0
    for _ in range(20):
        weight, rises, m = rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0), rng.uniform(0.5, 2.0)
        g, net, end = float(rng.choice([0.0, 1.0])), weight + rises, 1.0
        floor = gr.walls.Piecewise([0.0, 4.0], [[0.5 * rises], [0.0], [0.0]])
        scene = gr.Scene([math.inf, m], [0.0, 0.0], [0.0], [0.0, 0.0], g, external_force=[0.0, m * (g - weight)],
                         floor=floor)
        law = gr.LinearDashpot.from_restitution(rng.uniform(0.3, 0.9), 10.0 ** rng.uniform(2.0, 4.0), scene.pairs[0])
        run = gr.md.simulate(scene, law, t_end=end, engine="plain")
        square, fall = law.k / m, 0.5 * law.gamma / m
        swing = math.sqrt(square - fall**2)
        turn = math.cos(swing * end) + fall / swing * math.sin(swing * end)
        overlap = net / square * (1.0 - math.exp(-fall * end) * turn) if net > 0.0 else 0.5 * net * end**2
        assert -run.gap[-1, 0] == pytest.approx(overlap, rel=1e-12)
        assert len(run.contacts) == (net > 0.0)
        pressed += net > 0.0 > weight
    assert pressed > 2


def test_balls_pressed_together_by_forces_come_to_rest_on_each_other():
    law = [gr.LinearDashpot(1e4, 30.0), gr.LinearDashpot(2e4, 40.0), gr.LinearDashpot(1e4, 30.0)]
    scene = gr.Scene([1.0, 2.0, 1.5, 0.5], [0.0] * 4, [0.0] * 3, [0.0] * 4, external_force=[5.0, 1.0, 0.0, -4.0])
    run = gr.md.simulate(scene, law)
    assert run.status is gr.Status.resting
    mean = 2.0 / 5.0
    force = np.cumsum(scene.external_force - mean * scene.mass)[:-1]
    assert (run.force[-1] > 0.0).all()
    late = gr.md.simulate(scene, law, t_end=50.0)
    assert late.force[-1] == pytest.approx(force, rel=1e-12)
    assert late.velocity[-1] == pytest.approx(np.full(4, 20.0), rel=1e-12)


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e4, 50.0), gr.ViscoelasticHertz(1e6, 1e3)])
def test_a_chain_under_end_forces_between_wall_and_force(law):
    scene = gr.Scene([math.inf, 1.0, 1.0, 1.0], [0.0] * 4, [0.0] * 3, [0.0] * 4, external_force=[0.0, 0.0, 0.0, -20.0])
    run = gr.md.simulate(scene, law, t_end=30.0)
    assert run.force[-1] == pytest.approx(np.full(3, 20.0), rel=1e-11)
    lifted = gr.md.simulate(scene.replace(external_force=[0.0, 0.0, 0.0, 20.0]), law, t_end=0.25)
    assert lifted.velocity[-1, 3] == pytest.approx(5.0, rel=1e-12)


def test_what_is_refused():
    scene, law = shaken(2.0, 0.5, 100.0, gap=0.1)
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run with a driven wall does not end "
                                         r"by itself\. Give t_end=, until= or max_events=\."):
        gr.md.simulate(scene, law)
    short = gr.walls.Piecewise([0.0, 1.0], [[1.0], [0.0]])
    with pytest.raises(ValueError, match="`t_end` must be a number in \\[0, 1\\], got 2"):
        gr.md.simulate(scene.replace(floor=short), law, t_end=2.0)
    with pytest.raises(ValueError, match="`t_start` must be a number in \\[0, 1\\], got -1"):
        gr.md.simulate(scene.replace(floor=short), law, t_start=-1.0, t_end=0.5)
    motion = gr.walls.Motion(lambda t: math.nan if t > 0.5 else 0.0)
    with pytest.raises(ValueError, match="function"):
        gr.md.simulate(scene.replace(floor=motion), law, t_end=1.0)
    with pytest.raises(ValueError, match="requires t_end="):
        gr.md.simulate(scene.replace(floor=motion), law, until=gr.until.contact(0, 2))
    box = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.01, 0.0], [0.05, 0.05], [0.0] * 3, floor=gr.walls.Sine(0.3, 1.0))
    with pytest.raises(ValueError, match="the walls meet at t = "):
        gr.md.simulate(box, gr.LinearDashpot(1e4, 1.0), t_end=0.25)


def test_until_and_limits_beside_a_driven_wall():
    scene, law = shaken(2.0, 0.5, 100.0, gap=0.1)
    run = gr.md.simulate(scene, law, until=gr.until.contact(0, 5))
    assert (run.status, len(run.contacts)) == (gr.Status.until, 4)
    run = gr.md.simulate(scene, law, t_end=1e9, max_events=7)
    assert (run.status, len(run.contacts)) == (gr.Status.max_events, 7)
    away = scene.replace(gravity=0.0, velocity=[0.0, 10.0])
    assert gr.md.simulate(away, law, until=gr.until.contact(0, 5)).status is gr.Status.quiet


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [0, 3, 5, 6, 8])
def test_samples_change_no_bit_of_the_last_row(seed):
    """The ledger and the forces too, in the middle of contacts."""
    scene, laws = driven_scenes.scenes(seed)
    bare = gr.md.simulate(scene, laws, t_end=0.9, engine="plain")
    for samples in (2, 9, [0.2, 0.9]):
        run = gr.md.simulate(scene, laws, t_end=0.9, engine="plain", samples=samples)
        for name in ("position", "velocity", "gap", "force", "ledger"):
            assert (getattr(run, name)[-1] == getattr(bare, name)[-1]).all(), name
