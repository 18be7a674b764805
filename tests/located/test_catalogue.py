"""Known results for single collisions, cradles, columns and Hertz chains (rows of tests/reference/catalogue.json)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from granular import until
from granular.laws import Hertz, LinearDashpot, PowerLaw, ViscoelasticHertz
from granular.laws.dashpot import reduced_duration, restitution
from granular.md import simulate as run
from granular.run.trajectory import Trajectory
from granular.scene import Scene

PAIR = Scene([2.0, 2.0], [1.0, 1.0], [0.0], [1.0, 0.0])
"""m_eff = 1, relative speed 1."""


def collide(law: object, scene: Scene = PAIR) -> Trajectory:
    return run(scene, (law,) * (scene.n - 1), until=until.separated(), engine="plain")


def epsilon(soft: Trajectory) -> float:
    """Restitution of the one contact of `PAIR`."""
    (row,) = soft.contacts
    return float(row["v_out"][1] - row["v_out"][0])


def cradle(n: int, law: object, strikers: int = 1) -> np.ndarray:
    """Final velocities of n touching balls with m = k = 1, the first of them at speed 1."""
    v = [1.0] * strikers + [0.0] * (n - strikers)
    return collide(law, Scene([1.0] * n, [1.0] * n, [0.0] * (n - 1), v)).velocity[-1]


def column_restitution(n: int, law: object) -> float:
    """Restitution of the centre of mass of n touching balls that fall on a floor at speed 1 without gravity."""
    scene = Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), [0.0] * n, [0.0] + [-1.0] * n)
    return float(collide(law, scene).velocity[-1, 1:].mean())


@pytest.mark.parametrize("zeta", [1e-6, 0.1, 0.3, 0.5, 0.8, 1.0, 1.5, 3.0, 30.0])
def test_dashpot_of_every_damping(zeta: float) -> None:
    """C1: ε and t_c of the clipped dashpot, under-damped, critical and over-damped."""
    soft = collide(LinearDashpot(1.0, 2.0 * zeta))
    assert epsilon(soft) == pytest.approx(restitution(zeta), abs=2e-15, rel=1e-12)
    assert soft.contacts["duration"][0] == pytest.approx(reduced_duration(zeta), rel=1e-13)


@pytest.mark.parametrize("n", [1.0, 1.25, 4.0 / 3.0, 1.5, 1.7, 2.0, 2.5, 3.0, 5.0, 7.5])
def test_elastic_powers(n: float) -> None:
    """C2, C2b: duration, depth, force and impulse of F = k ξ^n; 1.7 and 7.5 run as general laws."""
    (row,) = collide(PowerLaw(1.0, n)).contacts
    deepest = ((n + 1.0) / 2.0) ** (1.0 / (n + 1.0))
    lasts = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / (n + 1.0)) / math.gamma(0.5 + 1.0 / (n + 1.0))
    assert row["duration"] == pytest.approx(deepest * lasts, rel=1e-13)
    assert row["xi_max"] == pytest.approx(deepest, rel=1e-13)
    assert row["force_max"] == pytest.approx(deepest**n, rel=1e-13)
    assert row["impulse"] == pytest.approx(2.0, rel=1e-13)
    assert row["v_out"] == pytest.approx([0.0, 1.0], abs=1e-13)


@pytest.mark.parametrize(
    ("delta", "expected"),
    [(0.01, 0.9885474396), (0.1, 0.8928588755065315), (0.5, 0.5952515011351346), (1.0, 0.39393060322987294),
     (10.0, 0.0250957044)],
)
def test_viscoelastic_restitution(delta: float, expected: float) -> None:
    """C3: ε(δ), δ = γ k^(-3/5) v^(1/5)."""
    assert epsilon(collide(ViscoelasticHertz(1.0, delta))) == pytest.approx(expected, abs=1e-10)


def test_linear_cradles() -> None:
    """E1, E1c: not one in, one out."""
    spring = LinearDashpot(1.0)
    assert cradle(3, spring) == pytest.approx([-0.1302616951, 0.1502295694, 0.9800321256], abs=1e-9)
    five = [-0.13227948470, -0.07532916980, -0.03101082901, 0.29621775014, 0.94240173338]
    assert cradle(5, spring) == pytest.approx(five, abs=1e-10)
    two_in = [-0.170899748, -0.049200786, 0.382027214, 0.660994996, 1.177078324]
    assert cradle(5, spring, 2) == pytest.approx(two_in, abs=1e-8)


def test_hertz_and_steeper_cradles() -> None:
    """E1c, E1d: towards one in, one out as the law gets steeper."""
    two_in = [-0.112614979, -0.041959501, 0.214485776, 0.800366672, 1.139722032]
    assert cradle(5, Hertz(1.0), 2) == pytest.approx(two_in, abs=1e-7)
    assert cradle(5, Hertz(1.0))[-1] == pytest.approx(0.98878, abs=1e-5)
    assert cradle(5, PowerLaw(1.0, 3.0))[-1] == pytest.approx(0.9998796340874192, abs=1e-9)
    assert cradle(5, PowerLaw(1.0, 5.0))[-1] == pytest.approx(0.9999994033453558, abs=1e-11)


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("n", "linear", "hertz"),
    [(2, 0.977462, 0.985183), (3, 0.974662, 0.969997), (5, 0.977709, 0.950965), (10, 0.980442, 0.933698)],
)
def test_elastic_columns_lose_height(n: int, linear: float, hertz: float) -> None:
    """E5: energy goes into inner motion, although nothing is dissipated."""
    assert column_restitution(n, LinearDashpot(1.0)) == pytest.approx(linear, abs=1e-6)
    assert column_restitution(n, Hertz(1.0)) == pytest.approx(hertz, abs=1e-6)


@pytest.mark.rotating
def test_long_chains() -> None:
    """E2 (linear, N to 200) and E2b (Hertz, where N = 30 has reached the limit to 1e-5)."""
    for n, last in ((20, 0.805639), (50, 0.708872), (100, 0.63879), (200, 0.573331)):
        v = cradle(n, LinearDashpot(1.0))
        assert v[-1] == pytest.approx(last, abs=1e-6 if n < 100 else 6e-6)
        assert v[0] == pytest.approx(-0.1322794874, abs=1e-10)
    v = cradle(30, Hertz(1.0))
    assert v[[-1, -2, 0]] == pytest.approx([0.9856788, 0.1486005, -0.07108502], abs=1e-5)


@pytest.mark.rotating
def test_solitary_wave() -> None:
    """F1: speed, peak overlap and force of the wave in a Hertz chain, far from the striker."""
    n = 40
    scene = Scene([1.0] * n, [0.5] * n, [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))
    soft = run(scene, (Hertz(1.0),) * (n - 1), t_end=38.0, samples=np.linspace(20.0, 38.0, 361), engine="plain")
    passed = soft.contacts[np.argsort(soft.contacts["pair"])][20:28]
    assert passed["xi_max"] == pytest.approx(0.74231, abs=2e-5)
    assert passed["force_max"] == pytest.approx(0.63955, abs=2e-5)
    assert soft.force is not None
    arrival = [parabola_top(soft.time, soft.force[:, pair]) for pair in (18, 28)]
    assert 10.0 / (arrival[1] - arrival[0]) == pytest.approx(0.84051, abs=5e-5)


def test_content_of_a_solitary_wave() -> None:
    """F1b: energy, momentum and length of the pulse, between balls 30 and 70 of a Hertz chain."""
    n, mid = 80, 50
    scene = Scene([1.0] * n, [0.5] * n, [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))
    times = np.linspace(54.0, 66.0, 6001)
    soft = run(scene, (Hertz(1.0),) * (n - 1), t_end=66.0, samples=times)
    assert soft.force is not None
    i = int(np.argmax(soft.velocity[:, mid]))
    pulse, contacts = slice(mid - 8, mid + 9), slice(mid - 8, mid + 8)
    overlap = np.maximum(0.0, -soft.gap[i, contacts])
    energy = 0.5 * np.sum(soft.velocity[i, pulse] ** 2) + np.sum(0.4 * overlap**2.5)
    assert 2.0 * energy == pytest.approx(0.993661, abs=1e-4)
    assert soft.velocity[i, pulse].sum() == pytest.approx(1.138305, abs=1e-4)
    force = soft.force[:, mid]
    for share, lasts in ((0.01, 3.56), (0.001, 4.30)):
        within = times[force > share * force.max()]
        assert 0.84051 * (within[-1] - within[0]) == pytest.approx(lasts, abs=0.05)


def parabola_top(t: np.ndarray, y: np.ndarray) -> float:
    """Time of the maximum of sampled values."""
    i = int(np.argmax(y))
    a, b, _ = np.polyfit(t[i - 2 : i + 3] - t[i], y[i - 2 : i + 3], 2)
    return float(t[i] - 0.5 * b / a)
