"""Stiff and strongly damped laws near rest: few steps for each bounce and for the creep, and the right motion."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import granular as gr
from granular.md.located import ending
from tests.helpers.solved_by_scipy import counted

INF = math.inf
G = 9.81
ONE = gr.Scene([INF, 1.0], [0.0] * 2, [0.01], [0.0] * 2, G)
TWO = gr.Scene([INF, 1.0, 1.0], [0.0] * 3, [0.01, 0.001], [0.0] * 3, G)
PRESSED = gr.Scene([1.0, 0.7, INF], [0.0] * 3, [0.001, 0.01], [0.0] * 3, external_force=[30.0, 5.0, 0.0])


def laws(k):
    """Damping from weak to far beyond critical."""
    root = math.sqrt(k)
    return {
        "dashpot .3": gr.LinearDashpot.from_restitution(0.3, k=k, pair=ONE.pairs[0]),
        "critical": gr.LinearDashpot(k, 2.0 * root), "dashpot 3": gr.LinearDashpot(k, 6.0 * root),
        "dashpot 30": gr.LinearDashpot(k, 60.0 * root), "viscoelastic -4": gr.ViscoelasticHertz(k, 1e-4 * k),
        "viscoelastic -3": gr.ViscoelasticHertz(k, 1e-3 * k), "tsuji 2": gr.TsujiHertz(k, 2.0),
        "tsuji 60": gr.TsujiHertz(k, 60.0),
    }


def each(*others, few):
    """All laws with all of the others; but for a few, long runs only."""
    return [
        pytest.param(name, *rest, marks=[] if few(i, j) else pytest.mark.soak)
        for i, name in enumerate(laws(1.0)) for j, rest in enumerate(itertools.product(*others))
    ]


@pytest.mark.rotating
@pytest.mark.parametrize(("name", "k", "scene"), each([1e9, 1e16], [ONE, TWO, PRESSED], few=lambda i, j: j == i % 6))
def test_steps_are_bounded(name, k, scene, monkeypatch):
    """Up to the proof of rest by the number of contacts, and from there until the overlaps are static."""
    settled = gr.md.simulate(scene, laws(k)[name], max_steps=5000, engine="plain")
    monkeypatch.setattr(ending, "MAX_STATIC_TESTS", 0)
    proved = gr.md.simulate(scene, laws(k)[name], max_steps=5000, engine="plain")
    assert settled.status is proved.status is gr.Status.resting
    assert len(settled.contacts) == len(proved.contacts)
    assert proved.stats["steps"] <= 60 * len(proved.contacts) + 300
    assert proved.stats["steps"] < settled.stats["steps"] <= proved.stats["steps"] + 600


@pytest.mark.parametrize(("name", "k"), each([1e9, 1e16], few=lambda i, j: i in (3, 5) and j == i // 5))
def test_who_rests_goes_on_to_the_end(name, k):
    run = gr.md.simulate(TWO, laws(k)[name], t_end=10.0, max_steps=5000, engine="plain")
    assert run.status is gr.Status.time
    np.testing.assert_allclose(run.force[-1], [2.0 * G, G], rtol=1e-9)


@pytest.mark.parametrize("k", [1e5, 1e10, 1e15])
def test_creep_of_a_dashpot_is_two_exponentials(k):
    law, v = gr.LinearDashpot(k, 60.0 * math.sqrt(k)), 1e-9
    scene = gr.Scene([INF, 1.0, 1.0], [0.0] * 3, [0.0, 0.01], [0.0, -v, 0.0], G)  # a ball on its way keeps it by pieces
    half, rest = 0.5 * law.gamma, G / k
    root = math.sqrt(half * half - k)
    slow, fast = -k / (half + root), -(half + root)
    a = (v + rest * fast) / (slow - fast)
    t = np.linspace(0.1, 1.0, 7) * min(20.0 / -slow, 0.04)
    run = gr.md.simulate(scene, law, t_end=float(t[-1]), samples=t, engine="plain")
    shape = rest + a * np.exp(slow * t) - (rest + a) * np.exp(fast * t)
    np.testing.assert_allclose(-run.gap[:, 0], shape, rtol=1e-11)
    assert run.stats["steps"] < 200


@pytest.mark.rotating
def test_creep_of_a_curved_law_against_another_solver():
    """Radau's method, implicit, of SciPy."""
    from scipy.integrate import solve_ivp

    law, pair, t = gr.ViscoelasticHertz(1e9, 1e8), ONE.pairs[0], np.array([2e-3, 1e-2, 0.1, 0.3])
    scene = gr.Scene([INF, 1.0], [0.0] * 2, [-1e-6], [0.0] * 2, G)
    run = gr.md.simulate(scene, law, t_end=1.0, samples=np.append(t, 1.0), engine="plain")
    assert run.stats["steps"] < 300

    def move(_t, y):
        return [y[1], G - law.force(y[0] * 1e-6, y[1] * 1e-6, pair)] / np.array([1.0, 1e-6])

    other = solve_ivp(counted(move), (0.0, 0.3), [1.0, 0.0], method="Radau", t_eval=t, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(-run.gap[:-1, 0] * 1e6, other.y[0], rtol=1e-7)


def test_creep_in_other_units():
    """At any power of two of length and time; powers of numbers are rounded."""
    runs = []
    for length, time in ((1.0, 1.0), (2.0**8, 2.0**-6)):
        a, b = length**-0.5 / time**2, length**-0.5 / time
        scene = gr.Scene(TWO.mass, TWO.radius, TWO.gap * length, TWO.velocity, G * length / time**2)
        law = gr.ViscoelasticHertz(2.0**40 * a, 2.0**30 * b)
        run = gr.md.simulate(scene, law, t_end=0.25 * time, samples=9, engine="plain")
        runs.append((run.gap / length, run.velocity / length * time, run.stats["steps"]))
    np.testing.assert_allclose(runs[1][0], runs[0][0], rtol=1e-12)
    np.testing.assert_allclose(runs[1][1], runs[0][1], rtol=1e-9, atol=1e-15)
    assert runs[0][2] == pytest.approx(runs[1][2], rel=0.05)


def test_a_still_pile_waits_for_a_ball_in_one_step():
    law = gr.LinearDashpot.from_restitution(0.3, k=1e15, pair=ONE.pairs[0])
    scene = gr.Scene([INF, 1.0, 1.0], [0.0] * 3, [0.0, 2.0], [0.0] * 3, G)
    run = gr.md.simulate(scene, law, until=gr.until.contact(1, 1), max_steps=1000, engine="plain")
    assert run.status is gr.Status.until
    assert run.time[-1] == pytest.approx(math.sqrt(2.0 * 2.0 / G), rel=1e-14)
    assert run.velocity[-1, 2] == pytest.approx(-math.sqrt(2.0 * 2.0 * G), rel=1e-14)


@pytest.mark.parametrize("name", [
    "viscoelastic -3", *(pytest.param(name, marks=pytest.mark.soak) for name in ("dashpot 30", "tsuji 60")),
])
def test_creep_is_the_same_compiled(name):
    pytest.importorskip("numba")
    one, other = (gr.md.simulate(TWO, laws(1e14)[name], t_end=0.1, samples=7, engine=e) for e in ("plain", "compiled"))
    for field in ("time", "position", "velocity", "gap", "force", "contacts"):
        assert getattr(one, field).tobytes() == getattr(other, field).tobytes()
