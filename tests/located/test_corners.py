"""Corners of the event-located method: simultaneous ends, gaps below rounding, late starts, cold starts."""

import math
import subprocess
import sys

import numpy as np
import pytest

import granular as gr

SEPARATED = gr.until.separated()
LAWS = [
    gr.LinearDashpot(1e6, 100.0), gr.Hertz(1e6), gr.ViscoelasticHertz(1e6, 1e3), gr.TsujiHertz(1e6, 0.5),
    gr.PowerLaw(1e6, 2.0),
]


def three(gap, velocity):
    return gr.Scene([1.0] * 3, [0.1] * 3, gap, velocity)


@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_two_contacts_that_end_at_once(law, engine):
    run = gr.md.simulate(three([0.0, 0.0], [1.0, 0.0, -1.0]), law, until=SEPARATED, engine=engine, max_steps=1000)
    assert run.status is gr.Status.until
    np.testing.assert_allclose(run.velocity[-1], -run.velocity[-1][::-1], atol=1e-14)
    assert run.count(0) == run.count(1) == 1


@pytest.mark.rotating
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("velocity", [[1.0, 0.0, 0.0], [1.0, 0.0, -1.0]], ids=["struck", "squeezed"])
def test_a_gap_below_rounding_is_a_touch(law, velocity):
    touching = gr.md.simulate(three([0.0, 0.0], velocity), law, until=SEPARATED, engine="plain")
    for gap in (5e-324, 1e-200, 1e-60, 1e-30, 1e-20):
        run = gr.md.simulate(three([0.0, gap], velocity), law, until=SEPARATED, engine="plain", max_steps=3000)
        assert run.status is gr.Status.until
        np.testing.assert_allclose(run.velocity[-1], touching.velocity[-1], atol=1e-12)


def test_a_late_start_costs_no_digits():
    scene = three([3e-5, 1e-5], [1.0, 0.0, -1.0])
    early, late = (gr.md.simulate(scene, gr.LinearDashpot(1e10), until=SEPARATED, t_start=t) for t in (0.0, 2.0**40))
    assert early.velocity[-1].tobytes() == late.velocity[-1].tobytes()
    np.testing.assert_array_equal(np.sort(early.contacts["duration"]), np.sort(late.contacts["duration"]))
    assert late.time[0] == 2.0**40


def test_rows_of_a_bound_elastic_scene_are_delivered():
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [-1e-3], [0.0, 0.001], 9.81)
    run = gr.md.simulate(scene, gr.LinearDashpot(1e4), t_end=1.0, samples=5)
    np.testing.assert_array_equal(run.time, [0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(run.energy(), run.energy()[0], rtol=1e-13)


@pytest.mark.rotating
def test_a_newcomer_does_not_wait_for_a_compiler():
    code = (
        "import sys, granular as gr; s = gr.scenes.column(n=20, gap=1e-3); "
        "law = [gr.LinearDashpot.from_restitution(.9, k=1e7, pair=p) for p in s.pairs]; "
        "run = gr.md.simulate(s, law, until=gr.until.separated()); print(run.stats['engine'], 'numba' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == ["plain", "False"]


def test_a_stop_while_another_contact_is_under_way_gives_the_state_of_that_time():
    scene = gr.scenes.three_balls(radii=(0.1, 0.17), gap=2.13e-3, height=1.0373730950628357)
    law = [gr.LinearDashpot.from_restitution(0.98, 4.9e8, pair) for pair in scene.pairs]
    stopped = gr.md.simulate(scene, law, until=gr.until.contact(0, 2))
    assert np.isnan(stopped.contacts["t_end"]).any()
    reached = gr.md.simulate(scene, law, t_end=float(stopped.time[-1]))
    np.testing.assert_allclose(stopped.velocity[-1], reached.velocity[-1], rtol=1e-9)
    np.testing.assert_allclose(stopped.gap[-1], reached.gap[-1], atol=1e-15)


class OwnHertz:
    """Hertz as a user writes it: no more than the force."""

    def force(self, xi, xi_dot, pair):
        return 1e9 * xi**1.5


@pytest.mark.parametrize(("law", "p"), [(gr.Hertz(1e9), 1.5), (gr.PowerLaw(1e9, 2.0), 2.0), (OwnHertz(), 1.5)])
def test_a_slow_contact_beside_a_fast_ball_is_as_good_as_alone(law, p):
    """Its peak by energy, ξ = ((p+1) m_eff v² / 2k)^(1/(p+1)), and what the fast ball leaves to the slow one."""
    rng = np.random.default_rng(11)
    for _ in range(5):
        fast, slow = 10.0 ** rng.uniform(1, 4), 10.0 ** rng.uniform(-6, -3)
        light, one, two = 10.0 ** rng.uniform([-4, -1, -1], [-2, 1, 1])
        scene = gr.Scene([light, one, two], [0.0] * 3, [1.0, 1e-9], [-fast, slow, 0.0])
        run = gr.md.simulate(scene, law)
        (contact,) = run.contacts
        m_eff = one * two / (one + two)
        deepest = ((p + 1.0) * m_eff * slow * slow / 2e9) ** (1.0 / (p + 1.0))
        assert contact["xi_max"] == pytest.approx(deepest, rel=2e-14)
        out = slow * (one - two) / (one + two), 2.0 * slow * one / (one + two)
        assert contact["v_out"][1] - contact["v_out"][0] == pytest.approx(slow, rel=1e-13)
        assert contact["v_out"] == pytest.approx(out, abs=1e-13 * slow)


class OwnPower:
    """k ξ^p as a user writes it."""

    def __init__(self, k, p):
        self.k, self.p = k, p

    def force(self, xi, xi_dot, pair):
        return self.k * xi**self.p


TWELFTHS = [(n / 12, "auto") for n in (59, 72, 73, 127, 154)]
MORE = [pytest.param(n / 12, "auto", marks=pytest.mark.soak) for n in np.random.default_rng(19).integers(13, 193, 6)]
POWERS = [(p, "compiled") for p in (1.25, 1.5, 7 / 3, 3.0, 4.5, 11.0, 13.0, 16.0)] + [(1.5, "plain"), (11.0, "plain")]


@pytest.mark.rotating
@pytest.mark.parametrize(("p", "engine"), [*POWERS, *TWELFTHS, *MORE, (1.5, "own"), (8 / 3, "own"), (12.5, "own")])
def test_a_ball_dropped_from_a_touch_comes_back_to_it(p, engine):
    """m g ξ = k ξ^(p+1)/(p+1) at the turn, every time; ξ is zero for an instant in between, which ends no contact."""
    rng = np.random.default_rng(13)
    for _ in range(3 if engine in ("plain", "compiled") else 1):
        m, g, k = 10.0 ** rng.uniform([-2, -1, 3], [1, 1, 9])
        deepest = ((p + 1.0) * m * g / k) ** (1.0 / p)
        scene = gr.Scene([math.inf, m], [0.0, 0.1], [0.0], [0.0, 0.0], g)
        law = OwnPower(k, p) if engine == "own" else gr.Hertz(k) if p == 1.5 else gr.PowerLaw(k, p)
        how = "auto" if engine == "own" else engine
        run = gr.md.simulate(scene, law, t_end=40.0 * math.sqrt(deepest / g), samples=60, engine=how)
        (contact,) = run.contacts
        assert contact["xi_max"] == pytest.approx(deepest, rel=3e-14)
        xi = np.maximum(-run.gap[:, 0], 0.0)
        energy = 0.5 * m * run.velocity[:, 1] ** 2 + k * xi ** (p + 1.0) / (p + 1.0) - m * g * -run.gap[:, 0]
        assert abs(energy).max() < 2e-13 * m * g * deepest


@pytest.mark.rotating
@pytest.mark.parametrize(("engine", "runs"), [("plain", 8), ("compiled", 60), ("own", 6)])
def test_a_ball_that_touches_floor_and_ceiling_comes_back_to_the_ceiling_without_a_contact(engine, runs):
    """It is at rest there, except for rounding of its energy; that is no impact, and no reason to refuse the scene."""
    rng = np.random.default_rng(1)
    for _ in range(runs):
        p = float(rng.choice([1.5, 2, 3, 4, 5, 8, 12, 14, 16]))
        m, g, k = (10.0 ** rng.uniform([-2, -1, 2], [1, 2, 8])).tolist()
        deepest = ((p + 1.0) * m * g / k) ** (1.0 / p)
        scene = gr.Scene([math.inf, m, math.inf], [0.0, 0.1, 0.0], [0.0, 0.0], [0.0] * 3, g)
        law = OwnPower(k, p) if engine == "own" else gr.Hertz(k) if p == 1.5 else gr.PowerLaw(k, p)
        returns = rng.uniform(1, 3 if engine == "own" else 20)
        how = "auto" if engine == "own" else engine
        run = gr.md.simulate(scene, law, t_end=2.9 * returns * math.sqrt(deepest / g), engine=how)
        (contact,) = run.contacts
        assert contact["pair"] == 0
        assert contact["xi_max"] == pytest.approx(deepest, rel=3e-14)
        assert contact["force_max"] == pytest.approx(k * deepest**p, rel=1e-12)


def test_steep_powers_may_start_in_overlap_at_rest():
    """k ξ^(p+1)/(p+1) - m g ξ goes into speed, upwards or down; forces of any smallness were refused."""
    rng = np.random.default_rng(2)
    for _ in range(60):
        p, m = float(rng.integers(2, 17)), rng.uniform(0.1, 10.0)
        g, k, xi = (10.0 ** rng.uniform([-3, 0, -5], [2, 9, -2])).tolist()
        scene = gr.Scene([m, math.inf], [0.1, 0.0], [-xi], [0.0, 0.0], g)  # under a ceiling: force and weight part them
        run = gr.md.simulate(scene, gr.PowerLaw(k, p), t_end=10.0 * math.sqrt(xi / g), engine="compiled")
        (contact,) = run.contacts
        part = math.sqrt(2.0 * (k * xi ** (p + 1.0) / (p + 1.0) / m + g * xi))
        assert contact["v_out"][0] == pytest.approx(-part, rel=1e-13)
        assert contact["xi_max"] == xi


class Stiffening:
    """k ξ + k3 ξ³ + γ ξ̇ as a user writes it."""

    def __init__(self, k, k3, gamma):
        self.k, self.k3, self.gamma = k, k3, gamma

    def force(self, xi, xi_dot, pair):
        return self.k * xi + self.k3 * xi**3 + self.gamma * xi_dot


@pytest.mark.rotating
def test_stiff_own_laws_come_to_rest_in_few_steps():
    """A ball hits where k3 ξ³ counts and creeps to m g = k ξ, overdamped; steps shrank with its speed, to 20 000."""
    rng = np.random.default_rng(3)
    for _ in range(2):
        m, speed, k = (10.0 ** rng.uniform([-1, -2, 7], [1, 0, 9])).tolist()
        reached = speed * math.sqrt(m / k)
        law = Stiffening(k, 100.0 * k / reached**2, rng.uniform(6.0, 12.0) * math.sqrt(m * k))
        g = 1e-3 * reached * k / m
        scene = gr.Scene([math.inf, m], [0.0, 0.1], [0.0], [0.0, -speed], g)
        run = gr.md.simulate(scene, law, t_end=60.0 * law.gamma / k, max_steps=2000)
        assert run.status is gr.Status.time
        at = -run.gap[-1, 0]
        assert law.force(at, 0.0, None) == pytest.approx(m * g, rel=1e-12)


@pytest.mark.rotating
def test_own_laws_at_rest_have_scales_of_any_size():
    """Weights set them where nothing moves at first; a law far from usual sizes once let its ball fall through."""
    rng = np.random.default_rng(1)
    for _ in range(12):
        p = float(rng.choice([1.0, 1.5, 2.0, 3.3, 5.0, 8.0, 12.0, 16.0]))
        m, g, k = (10.0 ** rng.uniform([-6, -6, -3], [6, 6, 18])).tolist()
        deepest = ((p + 1.0) * m * g / k) ** (1.0 / p)
        scene = gr.Scene([math.inf, m], [0.0, 10.0 ** rng.uniform(-6, 1)], [0.0], [0.0, 0.0], g)
        run = gr.md.simulate(scene, OwnPower(k, p), t_end=4.0 * math.sqrt(deepest / g), max_steps=3000)
        (contact,) = run.contacts
        assert contact["xi_max"] == pytest.approx(deepest, rel=1e-13)


@pytest.mark.parametrize("p", [12.0, 13.0, 14.0, 15.0, 16.0])
def test_the_largest_force_of_an_elastic_contact_is_that_of_its_largest_overlap(p):
    """However far it lies below the scale of the motion: it was read off a series, and 99.9 % too small."""
    xi = (p + 1.0) * 9.81 / 1e6
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.0], [0.0, 0.0], 9.81)
    for part in (0.1, 0.3, 1.0):
        run = gr.md.simulate(scene, gr.PowerLaw(1e6, p), t_end=part * math.sqrt(xi ** (1.0 / p) / 9.81))
        (contact,) = run.contacts
        assert contact["force_max"] == pytest.approx(1e6 * contact["xi_max"] ** p, rel=1e-13)
        assert contact["impulse"] >= 0.0


@pytest.mark.rotating
@pytest.mark.parametrize("law", [gr.Hertz(5e7), gr.PowerLaw(5e7, 13 / 6), OwnPower(5e7, 1.5)])
def test_a_ball_that_comes_back_to_a_touch_leaves_the_ball_above_in_free_fall(law):
    """Where its rate, no more than rounding in energy, is set to zero, the gap above must see it: 1e-11 m before."""
    scene = gr.Scene([math.inf, 0.5, 0.5], [0.0, 0.0791, 0.02404], [0.0, 0.1], [0.0] * 3, 0.1)
    run = gr.md.simulate(scene, law, t_end=0.4, samples=20)
    z = run.position[:, 2]
    np.testing.assert_allclose(z, z[0] - 0.05 * run.time**2, atol=2e-15)
    np.testing.assert_allclose(run.velocity[:, 2], -0.1 * run.time, atol=1e-15)


@pytest.mark.rotating
def test_a_run_may_stop_where_a_ball_arrives_at_one_that_lies_still():
    """Its piece would end at once; it was refused as beyond the range of numbers."""
    scene = gr.Scene([math.inf, 1.7, 1.7], [0.0, 0.1, 0.1], [1e-4, 0.05], [0.0, 0.1, 0.0], 14.0)
    laws = [gr.LinearDashpot(1e9, 1.4e5), OwnPower(1e9, 1.5)]
    run = gr.md.simulate(scene, laws, until=gr.until.contact(1))
    assert run.status is gr.Status.until
    assert run.gap[-1] == pytest.approx([-1.7 * 14.0 / 1e9, 0.0], rel=1e-9, abs=1e-15)
    assert run.velocity[-1, 2] == pytest.approx(-math.sqrt(2.0 * 14.0 * 0.05), rel=1e-3)
    assert run.velocity[-1, 1] == pytest.approx(0.0, abs=1e-12)


def test_peaks_of_laws_that_begin_at_once_are_what_their_laws_allow():
    """Their series need clocks that do not go together; F ≤ k ξ^1.5 + γ ξ^(1/4) |η| bounds what is read off them."""
    rng = np.random.default_rng(17)
    kinds = [gr.PowerLaw(3e7, 1.5), gr.PowerLaw(7.6e7, 4 / 3), gr.PowerLaw(1e8, 1.25), gr.TsujiHertz(4e7, 0.02)]
    once_wrong = [0, 1, 3], [2.0, 0.0, -2.0]  # 16 times too large
    others = [(rng.integers(0, 4, 3), rng.choice([-2.0, 0.0, 1.0, 2.0], 3)) for _ in range(12)]
    for which, speeds in (once_wrong, *others):
        laws = [kinds[i] for i in which]
        scene = gr.Scene([math.inf, 1.8, 1.8, 1.8], [0.0, 0.1, 0.1, 0.1], [0.0] * 3, [0.0, *speeds], 9.81)
        run = gr.md.simulate(scene, laws, t_end=0.2)
        end = np.where(np.isnan(run.contacts["t_end"]), run.time[-1], run.contacts["t_end"])
        np.testing.assert_allclose(run.contacts["duration"], end - run.contacts["t_begin"], rtol=0, atol=1e-15)
        for row in run.contacts:
            law, pair, xi = laws[row["pair"]], scene.pairs[row["pair"]], row["xi_max"]
            if isinstance(law, gr.TsujiHertz):
                assert row["force_max"] <= law.force(xi, 8.0, pair)
            else:
                assert row["force_max"] == pytest.approx(law.force(xi, 0.0, pair), rel=1e-11)


@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_no_step_leaves_the_range_of_numbers(engine):
    """A pair wakes 1e17 times less deep than it will be; powers of a step over that time once made the estimate nan."""
    masses, speeds = [math.inf, 0.07070751476290486, math.inf], [0.0, 0.08717864939464268, 0.0]
    scene = gr.Scene(masses, [0.0, 0.1, 0.0], [0.0, 0.0], speeds, 9.81)
    laws = [gr.TsujiHertz(273643416.5451523, 0.0245764090442006), gr.TsujiHertz(301829304.494987, 2.0)]
    run = gr.md.simulate(scene, laws, t_end=0.0118, engine=engine)
    assert 0.0 < run.stats["error_estimate"] < 1e-13


@pytest.mark.rotating
@pytest.mark.parametrize("law", [gr.Hertz(1e6), gr.ViscoelasticHertz(1e6, 1e3), gr.PowerLaw(1e6, 2.0)],
                         ids=lambda law: type(law).__name__)
def test_rows_that_touch_at_a_coarse_tolerance(law):
    """What steps leave out must not wake pairs that lie still: no contacts of rounding, errors of tol."""
    rng = np.random.default_rng(29)
    for _ in range(2):
        n = int(rng.integers(4, 10))
        scene = gr.Scene(np.ones(n), np.full(n, 0.1), np.zeros(n - 1), rng.uniform(0.1, 10.0) * np.eye(n)[0])
        fine = gr.md.simulate(scene, law, until=SEPARATED, max_events=60, engine="plain")
        for tol in (1e-3, 1e-5, 1e-7, 1e-10):
            run = gr.md.simulate(scene, law, until=SEPARATED, max_events=60, engine="plain", tol=tol)
            assert len(run.contacts) <= len(fine.contacts)  # damped balls may drift together again, late or not at all
            assert np.abs(run.velocity[-1] - fine.velocity[-1]).max() < 1e3 * tol * scene.velocity[0]
            assert run.stats["steps"] < fine.stats["steps"]


def test_a_run_whose_numbers_ran_out_of_range_does_not_stand_forever(monkeypatch):
    """As a wave so weak ahead that its speeds are denormal was seen to, with another machine's powers."""
    from granular.md.located.pace import MORE, Pace

    def stands(pace, limit, last):
        run = pace.run
        c = next(c for c, pair in enumerate(run.s.pairs) if pair.slot >= 0)
        member = run.s.pool[run.s.pairs[c].slot]
        for name in (name for name in dir(member) if isinstance(getattr(member, name), float)):
            setattr(member, name, math.nan)
        return MORE

    scene = gr.Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.0, 0.0], [1.0, 0.0, -1.0])
    monkeypatch.setattr(Pace, "advance_portion", stands)
    with pytest.raises(ValueError, match="within the range of floating-point numbers"):
        gr.md.simulate(scene, gr.Hertz(1e9), t_end=1.0, engine="plain")
