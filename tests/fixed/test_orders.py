"""Fixed-step methods: measured orders, errors and limits of stability."""

import math
from functools import partial

import numpy as np
import pytest

import granular as gr
from tests.helpers.fixed_steps import ALL, pair_scene, restitution, verlet

EPS = 0.9


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("method", "worst"), [("verlet", (1.60e-5, 2.0e-6)), ("symplectic-euler", (1.60e-5, 2.0e-6)),
                          ("rk4", (2.4e-7, 1.4e-8)), ("gear5", (5.3e-7, 2.8e-8))]
)
def test_restitution_error_of_a_spring(method, worst):
    """Catalogue G1: worst of the sub-step phases at 50 and 100 steps a contact."""
    for n, expected in zip((50, 100), worst, strict=True):
        dt = math.pi / n
        errors = [
            abs(restitution(verlet(pair_scene(dt * j / 50), gr.LinearDashpot(1.0), dt=dt, method=method)) - 1.0)
            for j in range(50)
        ]
        assert expected / 1.25 < max(errors) < 1.25 * expected


def order(law, method, steps, exact):
    """Slope of log(worst error over phases) against log(dt)."""
    t_c = gr.binary.collision(law, pair_scene().pairs[0], 1.0).duration
    worst = []
    for n in steps:
        dt = t_c / n
        runs = [verlet(pair_scene(dt * j / 16), law, dt=dt, method=method) for j in range(16)]
        worst.append(max(abs(restitution(run) - exact) for run in runs))
    return -np.polyfit(np.log(steps), np.log(worst), 1)[0]


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
def test_force_jump_reduces_every_method_to_order_one(method):
    law = gr.LinearDashpot.from_restitution(EPS, 1.0, pair_scene().pairs[0])
    assert order(law, method, (50, 100, 200, 400), EPS) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("method", ["verlet", "rk4"])
def test_hertz_converges_with_order_two_and_a_half(method):
    assert order(gr.Hertz(1.0), method, (50, 100, 200, 400), 1.0) == pytest.approx(2.5, abs=0.25)


@pytest.mark.parametrize(("method", "slope"), [("verlet", 2.0), ("rk4", 4.0), ("gear5", 2.0)])
def test_order_of_a_run_that_starts_in_contact(method, slope):
    """Against x cos t + u sin t; Gear's higher derivatives are not known at the start."""
    scene, steps = gr.Scene([2.0, 2.0], [0.5, 0.5], [-0.5], [0.1, -0.2]), (32, 64, 128)
    runs = [gr.md.simulate(scene, gr.LinearDashpot(1.0), method=method, dt=1.0 / n, t_end=1.0) for n in steps]
    errors = [abs(run.gap[-1, 0] + 0.5 * math.cos(1.0) + 0.3 * math.sin(1.0)) for run in runs]
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(slope, abs=0.05)


def on_floor(shift, **options):
    return gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.02 + shift], [0.0, -1.0], **options)


def hung(shift):
    return gr.Scene([1.0, 1.0], [0.1] * 2, [0.02 + shift], [1.0, -0.3], pendulum=8.0, rest_gap=[0.2])


def on_ring(shift):
    return gr.Scene([1.0, 2.0, 1.5], [0.1] * 3, [0.02 + shift, 0.3, 0.4], [1.0, 0.0, 0.2], ring=True)


FELT = {"gravity": (partial(on_floor, gravity=9.81), 0.08), "pendula": (hung, 0.08), "within": (on_floor, 0.03)}
UNFELT = {"flight": on_floor, "ring": on_ring, "sine": partial(on_floor, floor=gr.walls.Sine(1e-3, 20.0))}
ELASTIC = [gr.LinearDashpot(1e4), gr.Hertz(1e5)]


@pytest.mark.parametrize("where", FELT)
def test_symplectic_euler_has_order_one_where_forces_act(where):
    """Against located events; Verlet is of order 2 there, and far better."""
    (make, t_end), steps, errors = FELT[where], (4e-4, 2e-4, 1e-4), []
    for dt in steps:
        scenes = [make(0.5 * dt * (j + 0.37)) for j in range(2)]
        runs = [gr.md.simulate(scene, ELASTIC[0], t_end=t_end, log=False, **how) for scene in scenes
                for how in ({}, {"method": "symplectic-euler", "dt": dt}, {"dt": dt})]
        v = np.array([run.velocity[-1] for run in runs]).reshape(2, 3, -1)
        errors.append(np.abs(v - v[:, :1]).max(axis=(0, 2)))
    euler, verlet_ = np.array(errors).T[1:]
    assert np.polyfit(np.log(steps), np.log(euler), 1)[0] == pytest.approx(1.0, abs=0.2)
    assert verlet_[-1] < 0.1 * euler[-1]


@pytest.mark.parametrize("law", ELASTIC, ids=["spring", "Hertz"])
@pytest.mark.parametrize("where", UNFELT)
def test_symplectic_euler_is_verlet_from_flight_to_flight_without_other_forces(where, law):
    """And so of order 2: the half step between them shows only where something pulls."""
    runs = [gr.md.simulate(UNFELT[where](1e-5), law, t_end=0.08, method=method, dt=2e-4)
            for method in ("symplectic-euler", "verlet")]
    assert len(runs[0].contacts) == len(runs[1].contacts) > 0
    assert not np.isnan(runs[0].contacts["t_end"]).any()
    assert runs[0].velocity[-1] == pytest.approx(runs[1].velocity[-1], rel=0, abs=1e-12)


def test_damped_error_of_the_catalogue():
    """Catalogue G2, n = 100: 9.6e-4 (Verlet)."""
    law = gr.LinearDashpot.from_restitution(EPS, 1.0, pair_scene().pairs[0])
    dt = gr.binary.collision(law, pair_scene().pairs[0], 1.0).duration / 100
    runs = [verlet(pair_scene(dt * j / 50), law, dt=dt) for j in range(50)]
    assert max(abs(restitution(run) - EPS) for run in runs) == pytest.approx(9.6e-4, rel=0.2)


def test_stability_limit_of_a_pair():
    """Catalogue G4: dt < 2/ω0 for a pair, here a ball that keeps oscillating on the floor (ω0 = 1)."""
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.5], [-1.1], [0.0, 0.0], gravity=1.0)
    with pytest.warns(RuntimeWarning, match=r"times the highest rate of the contacts is .*above 0\.2"):
        below = verlet(scene, gr.LinearDashpot(1.0), dt=1.99, t_end=1000.0)
    above = verlet(scene, gr.LinearDashpot(1.0), dt=2.01, t_end=1000.0)
    assert below.status is gr.Status.time
    assert above.status is gr.Status.unstable
    assert "the stability limit is 2" in above.message
    assert "use dt ≤" in above.message


def spectral_radius_of_gear(dt_omega):
    """Of the amplification matrix of the five values on x'' = -ω² x, with corrector 19/90, 3/4, 1, 1/2, 1/12."""
    predict = np.array([[math.comb(j, i) for j in range(5)] for i in range(5)], float)
    miss = -0.5 * dt_omega**2 * predict[0] - predict[2]
    corrected = predict + np.outer([19 / 90, 3 / 4, 1, 1 / 2, 1 / 12], miss)
    return np.abs(np.linalg.eigvals(corrected)).max()


def test_stability_limit_of_gear():
    """A compressed ball on the floor (ω = 1) grows as the spectral radius says; `unstable` begins where it turns up."""
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.5], [-1.1], [0.0, 0.0], gravity=1.0)
    assert spectral_radius_of_gear(1.0) < 1.011 < 1.03 < spectral_radius_of_gear(1.065)
    with pytest.warns(RuntimeWarning):
        below = gr.md.simulate(scene, gr.LinearDashpot(1.0), method="gear5", dt=1.04, t_end=40.0)
    above = gr.md.simulate(scene, gr.LinearDashpot(1.0), method="gear5", dt=1.06, t_end=40.0)
    assert below.status is gr.Status.time
    assert above.status is gr.Status.unstable
    assert "the stability limit is 1.05" in above.message


@pytest.mark.parametrize("method", ALL)
def test_a_contact_jumped_over_in_one_step_is_judged(method):
    """dt = t_c: at the ends of steps nothing overlaps any more, and still the run is called unstable."""
    contact = math.pi
    run = gr.md.simulate(pair_scene(), gr.LinearDashpot(1.0), method=method, dt=contact, t_end=20 * contact)
    assert run.status is gr.Status.unstable
    assert "use dt ≤" in run.message


def test_more_steps_than_can_be_counted_are_refused():
    scene = gr.Scene([1.0, 1e-9], [0.1, 0.1], [1000.0], [1e-9, 0.0])
    with pytest.raises(ValueError, match="`dt` must be large enough that the steps can be counted, got 1e-08: the "
                                         r"run reaches step 1e\+20\. Use a larger dt, or method='located'\."):
        verlet(scene, gr.LinearDashpot(1.0), dt=1e-8, t_end=1e13)


def test_energy_made_by_a_long_step_is_noticed():
    run = verlet(pair_scene(), gr.LinearDashpot(1.0), dt=1.9)
    assert run.status is gr.Status.unstable
    assert "energy grew" in run.message


def test_stability_limit_inside_a_chain():
    """Catalogue G4: √(m/k) inside a chain of equal balls; pre-compressed, so that every contact stays closed."""
    n, m, k = 30, 1.0, 1.0
    compressed = gr.Scene([math.inf, *[m] * n, math.inf], [0.0, *[0.5] * n, 0.0], [-0.5] * (n + 1), [0.0] * (n + 2))
    kicked = compressed.replace(velocity=np.where(np.arange(n + 2) == 5, 0.01, 0.0))
    above = verlet(kicked, gr.LinearDashpot(k), t_end=400.0, dt=1.01 * math.sqrt(m / k))
    with pytest.warns(RuntimeWarning):
        below = verlet(kicked, gr.LinearDashpot(k), t_end=400.0, dt=0.99 * math.sqrt(m / k))
    assert above.status is gr.Status.unstable
    assert below.status is gr.Status.time
    assert np.abs(below.velocity[-1]).max() < 0.1
