"""The located engine against solutions found twice independently, and random scenes beside the reference solver."""

from __future__ import annotations

import json
import math
import random
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.reference import solve
from granular import until
from granular.laws import LinearDashpot, ViscoelasticHertz
from granular.md import simulate as run
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from tests.helpers.condition import response

pytestmark = pytest.mark.core
SETS = json.loads((Path(__file__).parents[1] / "reference" / "reference_soft.json").read_text())


def two_balls(one: dict[str, Any], speed: float) -> Scene:
    """Floor, lower and upper ball at the first touch of the floor."""
    masses, radii = [math.inf, one["m1"], one["m2"]], [0.0, one["R1"], one["R2"]]
    return Scene(masses, radii, [0.0, one["gap"]], [0.0, -speed, -speed], one["g"])


def agrees(soft: Trajectory, one: dict[str, Any], speed: float, tolerance: float) -> None:
    """Check sequence, times and outcome of a two-ball run that stopped at the second floor contact."""
    floor, upper = soft.of(0), soft.of(1)
    duration = one["contacts01"][0][1] if one["contacts01"] else 1.0
    expected = np.array(one["contacts12"]).reshape(-1, 2)
    assert len(upper) == one["n"]
    duration *= max(1.0, one.get("sens_time", 1.0))
    assert upper["t_begin"] == pytest.approx(expected[: len(upper), 0], abs=tolerance * duration, rel=0)
    assert len(floor) == 1
    if one["ongoing"]:
        assert math.isnan(upper["t_end"][-1])
        return
    assert upper["t_end"] == pytest.approx(expected[: len(upper), 1], abs=tolerance * duration, rel=0)
    if one["n"]:
        bound = tolerance * speed * max(1.0, one.get("sens", 1.0))
        assert upper["v_out"][-1] == pytest.approx([one["v1"], one["v2"]], abs=bound, rel=0)
        parting = upper["v_out"][-1, 1] - upper["v_out"][-1, 0]
        assert parting == pytest.approx(one["v2"] - one["v1"], abs=bound, rel=0)
    if one["second"] is not None:
        assert soft.status is Status.until
        assert soft.time[-1] == pytest.approx(one["second"], rel=max(tolerance, 2e-14))
    else:
        assert soft.status in (Status.quiet, Status.resting)


@pytest.mark.rotating
@pytest.mark.parametrize("one", SETS["linear"], ids=lambda one: str(one["id"]))
def test_linear_sets(one: dict[str, Any]) -> None:
    """Machine precision: 1e-14 of the impact speed times the condition number; times to 1e-14 of the floor contact."""
    laws = tuple(LinearDashpot(one["k"], gamma) for gamma in one["gamma"])
    soft = run(two_balls(one, -one["v10"]), laws, until=until.contact(0, 2), engine="plain", max_steps=50_000)
    agrees(soft, one, -one["v10"], 1e-14)


def test_linear_set_from_the_drop() -> None:
    """Started from rest at its height, the scene gives the same outcome; times are good to an ulp of the clock."""
    one = SETS["linear"][0]
    scene = Scene([math.inf, one["m1"], one["m2"]], [0.0, one["R1"], one["R2"]],
                  [one["height"] - one["R1"], one["gap"]], [0.0, 0.0, 0.0], one["g"])
    laws = tuple(LinearDashpot(one["k"], gamma) for gamma in one["gamma"])
    soft = run(scene, laws, until=until.contact(0, 2), engine="plain")
    upper, expected = soft.of(1), np.array(one["contacts12"])
    assert upper["t_begin"] == pytest.approx(expected[:, 0] + one["t10"], abs=2e-16, rel=0)
    assert upper["duration"] == pytest.approx(expected[:, 1] - expected[:, 0], abs=1e-14 * one["contacts01"][0][1])
    assert upper["v_out"][-1] == pytest.approx([one["v1"], one["v2"]], abs=1e-14 * 3.2, rel=0)


def test_samples_are_read_from_the_pieces() -> None:
    """Forces and velocities at 44 times of the paper's Figure 1, to rounding."""
    one = SETS["linear"][0]
    laws = tuple(LinearDashpot(one["k"], gamma) for gamma in one["gamma"])
    wanted = one["samples"]
    soft = run(two_balls(one, -one["v10"]), laws, t_end=0.01, samples=np.array(wanted["t"]), engine="plain")
    assert soft.force is not None
    for c, name in enumerate(("F01", "F12")):
        largest = max(wanted[name])
        assert soft.force[:, c] == pytest.approx(wanted[name], abs=1e-13 * largest, rel=0)
    for b, name in ((1, "v1"), (2, "v2")):
        assert soft.velocity[:, b] == pytest.approx(wanted[name], abs=1e-14 * 3.2, rel=0)


@pytest.mark.parametrize("one", SETS["viscoelastic"], ids=lambda one: str(one["id"]))
def test_viscoelastic_sets(one: dict[str, Any]) -> None:
    """Hertz-type laws: 1e-12 of the impact speed."""
    laws = tuple(ViscoelasticHertz(k, 1.5 * a * k) for k, a in zip(one["k"], one["A"], strict=True))
    soft = run(two_balls(one, one["v"]), laws, until=until.contact(0, 2), engine="plain")
    agrees(soft, one, one["v"], 1e-12)


@pytest.mark.parametrize("one", SETS["chains"], ids=lambda one: str(one["id"]))
def test_chains(one: dict[str, Any]) -> None:
    """Chains with gaps, touching, on a floor: the same contacts, velocities to 1e-12."""
    floor, law = one["floor"], LinearDashpot if one["p"] == 0 else ViscoelasticHertz
    masses, speeds = [math.inf] * floor + one["m"], [0.0] * floor + one["v0"]
    scene = Scene(masses, [0.0] * len(masses), [-x for x in one["xi0"]], speeds, one["g"])
    laws = tuple(law(k, gamma) for k, gamma in zip(one["k"], one["gamma"], strict=True))
    soft = run(scene, laws, samples=np.array([one["t_final"]]), t_end=one["t_final"], engine="plain")
    scale = max(map(abs, speeds))
    assert soft.velocity[-1, int(floor):] == pytest.approx(one["v_final"], abs=1e-14 * scale * (100 if one["p"] else 1))
    for pair, contacts in one["contacts"].items():
        found = soft.of(int(pair))[: len(contacts)]  # equal balls at rest part and meet with what rounding left them
        assert found["t_begin"] == pytest.approx([c[0] for c in contacts], abs=1e-12 * one["t_final"])
        ends = np.where(np.isnan(found["t_end"]), one["t_final"], found["t_end"])
        assert ends == pytest.approx([c[1] for c in contacts], abs=1e-12 * one["t_final"])


def random_scene(seed: int) -> tuple[Scene, tuple[LinearDashpot, ...]]:
    """Two balls over a floor: radii, gap, speed, stiffness and restitution over wide ranges."""
    pick = random.Random(seed)
    r1, r2 = 0.1, 0.1 / 10 ** pick.uniform(-0.5, 1.5)
    m1, m2 = (4.0 / 3.0 * math.pi * r**3 * 900.0 for r in (r1, r2))
    speed, k = 10 ** pick.uniform(-1.0, 1.0), 10 ** pick.uniform(5.0, 9.0)
    contact = math.pi * math.sqrt(m1 / k)
    scene = Scene([math.inf, m1, m2], [0.0, r1, r2], [0.0, speed * contact * 10 ** pick.uniform(-3.0, 0.5)],
                  [0.0, -speed, -speed], pick.choice([0.0, 9.81]))
    eps = 1.0 if pick.random() < 0.2 else pick.uniform(0.3, 1.0)
    return scene, tuple(LinearDashpot.from_restitution(eps, k * pick.choice([1.0, 0.3, 4.0]), p) for p in scene.pairs)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [
    1, *range(3, 10), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(100, 600))])
def test_random_scenes(seed: int) -> None:
    """The same contacts, at the same times, with the same velocities, as far as the scene's condition lets them be."""
    pytest.importorskip("mpmath")
    scene, laws = random_scene(seed)
    speed, duration = abs(float(scene.velocity[1])), math.pi * math.sqrt(float(scene.mass[1]) / laws[0].k)
    simulated = partial(run, law=laws, until=until.contact(0, 2), engine="plain")

    def numbers(rows: Any) -> Any:
        rows = rows[~np.isnan(rows["t_end"])]
        return np.column_stack([rows["t_begin"] / duration, rows["t_end"] / duration, rows["v_out"] / speed])

    soft = simulated(scene)
    truth = solve(scene, list(laws), until=until.contact(0, 2), t_end=3.0 * float(soft.time[-1]))
    over = [row for row in truth.contacts if row.t_end is not None]
    expected = np.zeros(len(over), soft.contacts.dtype)
    for name in ("pair", "t_begin", "t_end", "v_out"):
        expected[name] = np.array([getattr(row, name) for row in over], float).reshape(expected[name].shape)
    assert expected["pair"].tolist() == soft.contacts["pair"][~np.isnan(soft.contacts["t_end"])].tolist()
    moved = np.maximum.accumulate(response(lambda one: numbers(simulated(one).contacts), scene).max(axis=1))
    assert (np.abs(numbers(soft.contacts) - numbers(expected)).max(axis=1) < 4e-15 * (1.0 + moved)).all()
