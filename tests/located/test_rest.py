"""Rest is a remark about a run, not its end: t_end and every sample are kept, and piles decay to their equilibrium."""

from __future__ import annotations

import math

import numpy as np
import pytest

import granular as gr

DAMPED = {
    "dashpot": gr.LinearDashpot(1e4, 50.0),
    "strong dashpot": gr.LinearDashpot(1e4, 2000.0),
    "creep": gr.LinearDashpot(1e4, 1e6),
    "viscoelastic": gr.ViscoelasticHertz(1e6, 1e4),
    "tsuji": gr.TsujiHertz(1e6, 0.5),
}


def drop(n):
    return gr.Scene([math.inf] + [1.0] * n, [0.0] + [0.1] * n, [1e-3] * n, [0.0] * (n + 1), 9.81)


@pytest.mark.rotating
@pytest.mark.parametrize("law", DAMPED.values(), ids=DAMPED)
@pytest.mark.parametrize("n", [1, 3])
def test_t_end_and_samples_are_kept(law, n):
    run = gr.md.simulate(drop(n), law, t_end=3.0, samples=31, engine="plain")
    np.testing.assert_array_equal(run.time, np.linspace(0.0, 3.0, 31))
    assert run.status is gr.Status.time
    for c in range(n):  # the log says what momentum the balls above pair c have been given
        given = (run.velocity[-1, c + 1 :] + 9.81 * 3.0).sum()
        assert run.contacts["impulse"][run.contacts["pair"] == c].sum() == pytest.approx(given, rel=1e-12)
    lasting = run.contacts[np.isnan(run.contacts["t_end"])]
    np.testing.assert_allclose(lasting["t_begin"] + lasting["duration"], 3.0, rtol=1e-14)


@pytest.mark.parametrize("name", ["dashpot", "viscoelastic", "tsuji"])
def test_the_end_of_the_decay_is_the_equilibrium(name):
    run = gr.md.simulate(drop(2), DAMPED[name], t_end=100.0)
    assert run.stats["resting"]
    assert run.velocity[-1].tolist() == [0.0] * 3
    np.testing.assert_allclose(run.force[-1], [2 * 9.81, 9.81], rtol=1e-13)
    assert "rest on each other" in run.message


def test_creep_is_exact_at_any_time():
    """One overdamped ball: ξ - ξ° is a sum of two exponentials."""
    law, m, g = DAMPED["strong dashpot"], 1.0, 9.81
    run = gr.md.simulate(drop(1), law, t_end=3.0, samples=np.linspace(0.5, 3.0, 6))
    half, start = 0.5 * law.gamma / m, float(run.contacts["t_begin"][0])
    root = math.sqrt(half * half - law.k / m)
    slow, fast = -(law.k / m) / (half + root), -(half + root)
    rest, v = m * g / law.k, math.sqrt(2.0 * g * 1e-3)
    a = (v + rest * fast) / (slow - fast)  # ξ = ξ° + a e^(slow t) + b e^(fast t), from 0 at the rate v
    b = -rest - a
    t = run.time - start
    np.testing.assert_allclose(-run.gap[:, 0], rest + a * np.exp(slow * t) + b * np.exp(fast * t), rtol=1e-12)


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e4, 50.0), gr.ViscoelasticHertz(1e6, 1e4)], ids=["linear", "hertz"])
def test_squeezed_between_two_walls(law):
    scene = gr.Scene([math.inf, 1.0, 2.0, math.inf], [0, 0.1, 0.1, 0], [-1e-3, -2e-3, -3e-3], [0.0, 0.3, -0.2, 0.0])
    run = gr.md.simulate(scene, law, t_end=10.0, samples=101)
    assert len(run.time) == 101
    np.testing.assert_allclose(run.gap.sum(axis=1), -6e-3, rtol=1e-12)
    np.testing.assert_allclose(run.force[-1], run.force[-1, 0], rtol=1e-12)
    assert "e+" not in run.message.partition("decays in")[2]
    assert gr.md.simulate(scene, law).status is gr.Status.resting


@pytest.mark.parametrize(("law", "looks"), [("tsuji", math.inf), ("tsuji", 0), ("creep", 0)])
def test_rest_is_the_same_compiled(law, looks, monkeypatch):
    """Whether blocks that may rest are looked at interpreted, or by machine code too."""
    pytest.importorskip("numba")
    monkeypatch.setattr("granular.md.located.pace.TEST_LOAD_SECONDS", looks)
    monkeypatch.setattr("granular.md.located.pace.TEST_COMPILE_SECONDS", looks)
    one, other = (gr.md.simulate(drop(2), DAMPED[law], t_end=5.0, samples=7, engine=engine)
                  for engine in ("plain", "compiled"))
    for name in ("time", "position", "velocity", "gap", "force", "contacts"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e6), gr.Hertz(1e8)], ids=["spring", "hertz"])
def test_a_run_ends_when_only_rounding_moves(law):
    for n in (3, 8, 13):
        run = gr.md.simulate(gr.scenes.newtons_cradle(n, gap=1e-3), law)
        assert run.status is gr.Status.quiet
        assert len(run.contacts) == n - 1
        assert run.time[-1] < 1.0


def test_a_slow_approach_that_is_given_is_no_rounding():
    scene = gr.Scene([1.0] * 4, [0.1] * 4, [0.01, 1.0, 1e-18], [1.0, 0.0, 3.0, 3.0 - 4e-16])
    assert gr.md.simulate(scene, gr.LinearDashpot(1e6)).count(2) == 1


SLOW = ("strong dashpot", "compiled"), ("creep", "compiled")


@pytest.mark.rotating
@pytest.mark.parametrize(("law", "engine"), [
    pytest.param(name, engine, marks=[pytest.mark.soak] * ((name, engine) in SLOW))
    for name in DAMPED for engine in ("plain", "compiled")])
def test_walls_move_on_while_a_pile_rests(law, engine):
    pytest.importorskip("numba")
    law = DAMPED[law]
    scene = gr.Scene([math.inf, 1.0, 1.0, math.inf], [0, 0.1, 0.1, 0], [1e-3, 1e-3, 0.5], [-0.02, 0, 0, 0.01], 9.81)
    run = gr.md.simulate(scene, law, t_end=100.0, samples=11, engine=engine)
    np.testing.assert_allclose(run.velocity[:, 3], 0.01, rtol=1e-12)
    np.testing.assert_allclose(run.gap.sum(axis=1), 0.502 + 0.03 * run.time, rtol=1e-12)
    np.testing.assert_allclose(run.velocity[-1, 1:3], -0.02, rtol=1e-3)
    without = gr.md.simulate(scene, law, t_end=100.0, engine=engine)
    np.testing.assert_allclose(without.gap[-1], run.gap[-1], rtol=1e-13)


@pytest.mark.rotating
def test_a_plastic_ball_ends_in_an_elastic_bounce_within_its_dent():
    """Walton-Braun's law loses energy only where an overlap exceeds all before: what is left is a periodic bounce whose
    height is below the dent; so a run needs an end."""
    ball = gr.scenes.bouncing_ball()
    law = gr.WaltonBraun.from_restitution(0.7, k_load=1e5)
    log = gr.md.simulate(ball, law, t_end=2.6, engine="plain").contacts
    inward, outward, deepest = -log["v_in"][:, 1], log["v_out"][:, 1], log["xi_max"]
    first = int(np.flatnonzero(np.diff(inward) > -1e-9 * inward[1:])[0])  # from here on nothing is lost
    assert 10 < first < 25
    assert np.abs(outward[first:-1] / outward[first] - 1.0).max() < 1e-12
    assert np.abs(deepest[first:] / deepest[first] - 1.0).max() < 1e-12
    dent = (1.0 - law.k_load / law.k_unload) * deepest[first]
    assert inward[first] ** 2 / (2.0 * 9.81) < dent < inward[first - 1] ** 2 / (2.0 * 9.81)
    m = float(ball.mass[1])  # the line through the dent: a spring from release to the turning point and back
    left = 0.5 * m * outward[first] ** 2 + m * 9.81 * (deepest[first] - dent)
    assert left == pytest.approx(0.5 * law.k_unload * (deepest[first] - dent) ** 2, rel=1e-9)
    with pytest.raises(ValueError, match=r"`t_end` must be given, got None\. A run under gravity with laws that "
                                         r"dissipate only at the largest overlap so far does not end by itself\. "
                                         r"Give t_end=, until= or max_events=\."):
        gr.md.simulate(ball, law)


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e6), gr.Hertz(1e8), gr.PowerLaw(1e7, 2.0)])
def test_an_elastic_ball_from_a_touch_at_rest_stays_in_contact(law):
    """It returns to the touch at rest, and would otherwise be followed until the limit of steps."""
    touching = gr.Scene([math.inf, 1.0], [0.0] * 2, [0.0], [0.0] * 2, 9.81)
    pressed = gr.Scene([1.0, 2.0], [0.0] * 2, [0.0], [0.0] * 2, external_force=[30.0, 5.0])
    for scene in (touching, pressed):
        for end in ({"max_events": 5}, {"until": gr.until.contact(0, 3)}):
            run = gr.md.simulate(scene, law, max_steps=1000, engine="plain", **end)
            assert run.status is gr.Status.quiet
            assert run.stats["contacts"] == len(run.contacts) == 1
            assert math.isnan(run.contacts["t_end"][0])
            assert " J, equals the " in run.message
    at_rest = (9.81 / law.k) ** (1.0 / getattr(law, "exponent", 1.5 if isinstance(law, gr.Hertz) else 1.0))
    for rise in (1e-12, 1e-6, 0.1):  # more than rounding: the ball leaves the floor
        falls = touching.replace(gap=[rise * at_rest])
        run = gr.md.simulate(falls, law, max_events=5, max_steps=5000, engine="plain")
        assert (run.status, run.stats["contacts"]) == (gr.Status.max_events, 5)
    still = gr.md.simulate(touching.replace(gap=[-at_rest]), law, max_events=5, max_steps=1000, engine="plain")
    assert " J, is less than the " in still.message
    assert " inf J" not in still.message
