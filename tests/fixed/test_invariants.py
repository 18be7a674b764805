"""What must hold in fixed steps, at random: momentum, impulses, energy, reversal, and the order of each integrator."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

import granular as gr
from tests.helpers.scenes_at_random import ALL, ELASTIC, INF, LAWS, built, masses, seeds, soft_scenes

pytestmark = pytest.mark.filterwarnings("ignore:dt = ")
METHODS = ("verlet", "symplectic-euler", "rk4", "gear5")
EACH = pytest.mark.parametrize("method", METHODS)
ORDER = {"verlet": 2.0, "symplectic-euler": 1.0, "rk4": 4.0, "gear5": 2.0}
"""Where nothing opens or closes; Gear's is that of its start, which knows no higher derivatives."""
SMOOTH = ("spring", "dashpot", "Hertz", "viscoelastic", "Tsuji", "power", "own Hertz", "own dashpot", "softening")


def run(scene: gr.Scene, laws: Any, method: str, dt: float, **options: Any) -> gr.Trajectory:
    """Fixed steps."""
    return gr.md.simulate(scene, laws, method=method, dt=dt, **{"t_end": 0.25, "engine": "plain"} | options)


def squeezed(seed: int) -> gr.Scene:
    """One to three balls between walls, so tight that no contact opens."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    mass = np.array(masses(rng, n, 1.0))
    gap = -0.1 * rng.uniform(0.9, 1.1, n + 1)
    return built([INF, *(mass / mass.max()), INF], gap, [0.0, *rng.uniform(-0.3, 0.3, n), 0.0], 0.0)


SQUEEZED = seeds().map(squeezed)


@pytest.mark.rotating
@EACH
@settings(max_examples=6, deadline=None)
@given(SQUEEZED, st.sampled_from(SMOOTH))
def test_the_order_where_nothing_opens_or_closes(method: str, scene: gr.Scene, name: str) -> None:
    law = LAWS[name](1e3, 0.1, 1.0)
    exact = gr.md.simulate(scene, law, t_end=0.25, samples=9, engine="plain")
    assert np.isnan(exact.contacts["t_end"]).all()
    fastest = run(scene, law, method, 0.25 / 64, samples=9).stats["dt_lambda"] * 64  # the sharpest rate times t_end
    coarse = {"rk4": 0.15, "symplectic-euler": 0.02}.get(method, 0.1)
    steps = 2 ** (np.arange(3) + max(5, math.ceil(math.log2(fastest / coarse))))
    off = [abs(run(scene, law, method, 0.25 / n, samples=9).velocity - exact.velocity).max() for n in steps]
    assert -np.polyfit(np.log(steps), np.log(off), 1)[0] == pytest.approx(ORDER[method], abs=0.3)


@settings(max_examples=20, deadline=None)
@given(SQUEEZED, st.sampled_from(ELASTIC))
def test_verlet_runs_back(scene: gr.Scene, name: str) -> None:
    """It is symmetric in time, step by step: what comes back differs by rounding."""
    law = LAWS[name](1e3, 0.1, 1.0)
    there = run(scene, law, "verlet", 2.0**-10)
    back = run(scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1]), law, "verlet", 2.0**-10)
    assert np.allclose(-back.velocity[-1], scene.velocity, rtol=0, atol=1e-11)
    assert np.allclose(back.gap[-1], scene.gap, rtol=0, atol=1e-12)


@pytest.mark.rotating
@pytest.mark.parametrize(("method", "waves"), [("verlet", 4.0), ("symplectic-euler", 2.0)])
@settings(max_examples=5, deadline=None)
@given(SQUEEZED, st.sampled_from(("spring", "Hertz")))
def test_symplectic_methods_keep_energy_for_good(method: str, waves: float, scene: gr.Scene, name: str) -> None:
    """It waves, the less the shorter the step, and does not drift."""
    law, size = LAWS[name](1e3, 0.1, 1.0), []
    for dt in (2.0**-9, 2.0**-10):
        energy = run(scene, law, method, dt, t_end=4.0, samples=801).energy()
        size.append(np.ptp(energy))
        assert abs(energy[-400:].mean() - energy[:400].mean()) < 0.2 * np.ptp(energy)
    assert size[0] / size[1] == pytest.approx(waves, rel=0.2)


@pytest.mark.rotating
@EACH
@settings(max_examples=15, deadline=None)
@given(soft_scenes(tuple(LAWS), walls=(0.4, 0.2, 0.0), gaps=ALL, balls=(2, 5)))
def test_momentum_and_impulses(method: str, drawn: Any) -> None:
    """Momentum is kept, whatever the step; the impulses of Verlet's log make its velocities."""
    scene, laws = drawn
    end = run(scene, laws, method, 2.0**-11, samples=9)
    assume(end.status is gr.Status.time)
    speed = float(abs(end.velocity).max())
    if not scene.is_wall.any():
        assert np.allclose(end.momentum(), scene.momentum(), rtol=0, atol=1e-13 * scene.mass.sum() * (speed + 1.0))
    balls, impulse = ~scene.is_wall, np.zeros(scene.n + 1)
    np.add.at(impulse, end.contacts["pair"] + 1, end.contacts["impulse"])
    gained = scene.mass[balls] * (end.velocity[-1] - scene.velocity + 0.25 * scene.gravity)[balls]
    handed = (impulse[:-1] - impulse[1:])[balls]
    within = 1e-12 if method == "verlet" else 0.2 if end.stats["dt_lambda"] < 0.2 else 1e300  # coarse: nothing holds
    assert abs(gained - handed).max() <= within * impulse.sum() + 1e-12 * (speed + 1.0) * scene.mass[balls].max()
