"""The independent reference under forces and beside driven walls: against closed forms, and its two solvers."""

import math

import numpy as np
import pytest

import granular as gr
from granular import reference
from granular.laws.kinds import resolved
from granular.reference import restarted

mpmath = pytest.importorskip("mpmath")
MP = mpmath.MPContext()
MP.dps = 45
F = 1.0 / (2.0 * math.pi)


def shaken(gamma, restitution, ratio, *, phase=0.0, gap=0.0, velocity=0.0):
    """A ball of 1 kg on a soft floor shaken at 1 rad/s under g = 1: the scene, its law."""
    floor = gr.walls.Sine.from_acceleration(gamma, F, gravity=1.0, phase=phase)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [gap], [0.0, velocity], gravity=1.0, floor=floor)
    return scene, gr.LinearDashpot.from_restitution(restitution, ratio**2, scene.pairs[0])


def riding(scene, law, t):
    """Overlap and rate at time t of a ball that rides for good, in closed form."""
    floor, mp = scene.floor, MP
    omega, phase, m = 2 * mp.pi * floor.frequency, mp.mpf(floor.phase), mp.mpf(scene.mass[1])
    square, damping = law.k / m, mp.mpf(law.gamma) / m
    sway = -floor.amplitude * omega**2 / (square - omega**2 + 1j * damping * omega)
    push = scene.gravity - mp.mpf(0.0 if scene.external_force is None else scene.external_force[1]) / m

    def steady(t):
        turn = sway * mp.expj(omega * t + phase)
        return push / square + turn.imag, (1j * omega * turn).imag

    xi, eta = -mp.mpf(scene.gap[0]), floor.amplitude * omega * mp.cos(phase) - mp.mpf(scene.velocity[1])
    a, rate = xi - steady(mp.zero)[0], eta - steady(mp.zero)[1]
    fall, swing = damping / 2, mp.sqrt(square - damping**2 / 4)
    b = (rate + fall * a) / swing
    c, s, e = mp.cos(swing * t), mp.sin(swing * t), mp.exp(-fall * t)
    free = e * (a * c + b * s), e * (swing * (b * c - a * s) - fall * (a * c + b * s))
    return [x + y for x, y in zip(steady(t), free, strict=True)]


@pytest.mark.parametrize("force", [None, [0.0, -0.25]])
def test_a_ball_that_rides_has_its_closed_form(force):
    scene, law = shaken(0.6, 0.5, 7.0, phase=0.3, gap=-0.02, velocity=0.55)
    scene = scene.replace(external_force=force)
    solved = reference.solve(scene, law, t_end=9.0)
    xi, eta = riding(scene, law, MP.mpf(9))
    assert [row.t_end for row in solved.contacts] == [None]
    assert abs(-MP.mpf(solved.gap[0]) - xi) < 1e-30
    assert abs(MP.mpf(solved.velocity[0] - solved.velocity[1]) - eta) < 1e-30
    other, _ = restarted.solve(scene, resolved([law], scene), None, 9.0, "DOP853", 3e-14)
    assert abs(-other.gap[0] - xi) < 1e-12


def steady_start(gamma, restitution, ratio):
    """A ball that rides steadily from the start."""
    scene, law = shaken(gamma, restitution, ratio)
    omega, square, damping = scene.floor.omega, law.k, law.gamma
    sway = -scene.floor.amplitude * omega**2 / (square - omega**2 + 1j * damping * omega)
    velocity = scene.floor.velocity(0.0) - (1j * omega * sway).imag
    return scene.replace(gap=[-(1.0 / square + sway.imag)], velocity=[0.0, velocity]), law


def test_lift_off_of_a_resting_ball():
    law = shaken(1.0, 0.5, 10.0)[1]
    square, damping = law.k, law.gamma
    gamma = abs(square - 1.0 + 1j * damping) / abs(square + 1j * damping)
    assert gamma == pytest.approx(0.990026129452817, abs=1e-15)
    for factor, lifts in ((1.0 - 1e-12, False), (1.0 + 1e-12, True)):
        solved = reference.solve(*steady_start(gamma * factor, 0.5, 10.0), t_end=6.4, digits=20)
        assert (solved.contacts[0].t_end is not None) is lifts


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


def scenes(seed):
    """A random scene with forces, one or two driven walls, and laws."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    mass = np.exp(rng.uniform(-1.0, 1.0, n))
    mass[0], both = math.inf, rng.random() < 0.5
    mass[-1] = math.inf if both else mass[-1]
    breaks = np.linspace(0.0, 1.0, 6)
    heights = rng.uniform(-0.05, 0.05, 6)
    sine = gr.walls.Sine(rng.uniform(0.01, 0.05), rng.uniform(1.0, 4.0), rng.uniform(0.0, 6.0))
    corners = gr.walls.Piecewise(breaks, [np.diff(heights) / np.diff(breaks), heights[:-1]])
    smooth = gr.walls.Motion(lambda t: 0.03 * math.exp(-t) * math.sin(9.0 * t), 1e-13)
    floor, ceiling = ([sine, corners, smooth][i] for i in rng.permutation(3)[:2])
    force = np.where(np.isinf(mass), 0.0, rng.uniform(-2.0, 2.0, n))
    scene = gr.Scene(mass, np.where(np.isinf(mass), 0.0, 0.01), rng.uniform(0.01, 0.08, n - 1),
                     np.where(np.isinf(mass), 0.1, rng.normal(size=n)), gravity=float(rng.choice([0.0, 3.0])),
                     external_force=force, floor=floor, ceiling=ceiling if both else None)  # fmt: skip
    laws = [gr.LinearDashpot(3e3, 10.0), gr.ViscoelasticHertz(3e4, 100.0), gr.Hertz(3e4)]
    return scene, [laws[int(i)] for i in rng.integers(3, size=n - 1)]


@pytest.mark.parametrize("seed", range(4))
def test_both_solvers_agree_under_forces_and_beside_driven_walls(seed):
    scene, law = scenes(seed)
    solved = reference.solve(scene, law, t_end=0.5, digits=20)
    fitted = gr.scene.fitted(scene, 0.0, 0.5)
    other, _ = restarted.solve(fitted, resolved(law, fitted), None, 0.5, "DOP853", 1e-10)
    assert len(solved.contacts) > 2
    assert [row.pair for row in other.contacts] == [row.pair for row in solved.contacts]
    assert max(abs(float(a - b)) for a, b in zip(solved.gap, other.gap, strict=True)) < 1e-7
    assert max(abs(float(a - b)) for a, b in zip(solved.velocity, other.velocity, strict=True)) < 1e-6


def test_late_times_cost_no_digits():
    scene, law = shaken(1.4, 0.5, 50.0, gap=0.1)
    periods = 2.0**20 / scene.floor.frequency
    late = scene.replace(floor=gr.walls.Sine(scene.floor.amplitude, scene.floor.frequency, 0.0))
    one = reference.solve(scene, law, t_end=5.0, digits=20)
    other = reference.solve(late, law, t_start=periods, t_end=periods + 5.0, digits=20)
    shift = float(other.contacts[-1].t_begin - periods - one.contacts[-1].t_begin)
    assert abs(shift) < 1e-8  # the period, rounded, so many times over
