"""What must hold in every soft scene: momentum, energy, powers of two, islands; see `test_symmetries` too."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from granular import until, walls
from granular.laws import Hertz, LinearDashpot, PowerLaw
from granular.md import simulate as run
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from tests.helpers.scenes_at_random import soft_scenes

QUICK = settings(max_examples=15, deadline=None)
KINDS = ("spring", "dashpot", "Hertz", "viscoelastic", "Tsuji")
SMALL: dict[str, Any] = {"balls": (2, 4), "walls": (0.5, 0.0, 0.0)}


def go(scene: Scene, laws: tuple[Any, ...], **more: Any) -> Trajectory:
    return run(scene, laws, **{"t_end": 1.0, "engine": "plain", "max_events": 60, "max_steps": 1500} | more)


@pytest.mark.rotating
@QUICK
@given(soft_scenes(KINDS, **SMALL))
def test_momentum_and_energy(given_scene: tuple[Scene, tuple[Any, ...]]) -> None:
    """Momentum is kept without walls, energy never grows; the log agrees with the motion."""
    scene, laws = given_scene
    soft = go(scene, laws, samples=np.linspace(0.0, 1.0, 9))
    balls = ~scene.is_wall
    scale = 0.5 * float((scene.mass[balls] * scene.velocity[balls] ** 2).sum()) + 1e-12
    energy = soft.energy()
    assert np.all(np.diff(energy) <= 1e-12 * (scale + abs(energy[0])))
    if not scene.is_wall.any():
        assert abs(soft.momentum() - soft.momentum()[0]).max() <= 1e-13 * float(scene.mass.sum())
    over = soft.contacts[~np.isnan(soft.contacts["t_end"])]
    assert (over["impulse"] > 0.0).all()
    assert (over["xi_max"] > 0.0).all()
    assert (over["impulse"] <= over["force_max"] * over["duration"] * (1.0 + 1e-12)).all()
    assert over["duration"] == pytest.approx(over["t_end"] - over["t_begin"], rel=1e-12, abs=1e-15)


def test_energy_of_piles_that_come_back_to_a_touch() -> None:
    """Laws of any steepness, balls at rest and at a touch, many returns: the energy of all samples, positions too."""
    rng, steps = np.random.default_rng(3), 0
    for _ in range(80):
        p, g, n = float(rng.choice([1.5, 2.5, *range(2, 17)])), rng.choice([9.81, 1e-3]), rng.integers(1, 4)
        mass = np.array([math.inf, *rng.choice([1.0, 0.5, 2.0, 0.01], n)])
        gap = np.array([rng.choice([0.0, 0.0, 1e-3]), *rng.choice([0.0, 0.1, 0.1], n - 1)])
        scene = Scene(mass, [0.0] + [0.03] * n, gap, [0.0] * (n + 1), g)
        k = 10.0 ** rng.uniform(2, 9)
        static = ((p + 1.0) * mass[1] * g / k) ** (1.0 / p)
        law = Hertz(k) if p == 1.5 else PowerLaw(k, p)
        soft = run(scene, law, t_end=30.0 * math.sqrt(static / g), samples=20, max_steps=5_000, engine="compiled")
        lifted = (mass[1:] * g * (soft.position - soft.position[0])[:, 1:]).sum(axis=1)
        stored = (k * np.maximum(-soft.gap, 0.0) ** (p + 1.0) / (p + 1.0)).sum(axis=1)
        moving = (0.5 * mass[1:] * soft.velocity[:, 1:] ** 2).sum(axis=1)
        spread, largest = np.ptp(lifted + stored + moving), max(moving.max(), stored.max(), abs(lifted).max())
        assert spread <= 5e-13 * largest + 1e-15 * g * mass[1:].sum() * scene.position.max()
        steps += soft.stats["steps"]
    assert steps > 10_000


def test_unequal_islands_do_not_disturb_each_other() -> None:
    """Two groups far apart give the bits that each gives alone, though their clocks differ."""
    law = LinearDashpot(1e5, 20.0)
    left = Scene([1.0, 2.0, 1.5], [0.1] * 3, [0.01, 0.02], [1.0, 0.0, -0.5])
    right = Scene([0.5, 0.1], [0.1] * 2, [0.0301], [0.7, -0.9])
    both = Scene([*left.mass, *right.mass], [0.1] * 5, [*left.gap, 50.0, *right.gap], [*left.velocity, *right.velocity])
    alone = [go(scene, (law,) * (scene.n - 1), t_end=0.1) for scene in (left, right)]
    together = go(both, (law,) * 4, t_end=0.1)
    for part, first in zip(alone, (0, 3), strict=True):
        for pair in range(part.scene.n - 1):
            expected, found = part.of(pair), together.of(pair + first)
            for name in ("t_begin", "t_end", "duration", "v_in", "v_out", "xi_max", "force_max", "impulse"):
                assert expected[name].tobytes() == found[name].tobytes()


def test_until_and_limits() -> None:
    """`separated`, `contact` and the limit on events end a run, with their statuses."""
    scene = Scene([1.0, 1.0, 1.0], [0.1] * 3, [0.1, 0.1], [1.0, 0.0, 0.0])
    law = (LinearDashpot(1e4),) * 2
    assert run(scene, law, until=until.separated(), engine="plain").status is Status.until
    stopped = run(scene, law, until=until.contact(1, 1), engine="plain")
    assert stopped.status is Status.until
    assert stopped.gap[-1, 1] == 0.0
    assert stopped.count(1) == 0
    assert run(scene, law, engine="plain").status is Status.quiet
    assert run(scene, law, max_events=1, engine="plain").status is Status.max_events
    assert run(scene, law, max_steps=1, engine="plain").status is Status.max_events
    assert run(scene, law, t_end=0.01, engine="plain").status is Status.time


@pytest.mark.parametrize(("speed", "shaken"), [(0.0, False), (0.25, False), (0.0, True)])
def test_walls_keep_their_velocity_exactly(speed: float, shaken: bool) -> None:
    """At rest, at a constant speed and driven; before, the upper one had the rounding error of a sum over all gaps."""
    n, random = 12, np.random.default_rng(7)
    mass = np.array([np.inf, *[1.0] * n, np.inf])
    velocity = np.array([speed, *(speed + random.normal(size=n)), speed])
    motion = walls.Sine(0.01, 3.0, 0.5) if shaken else None
    scene = Scene(mass, np.zeros(n + 2), random.uniform(0.05, 0.2, n + 1), velocity, floor=motion, ceiling=motion)
    found = go(scene, tuple(LinearDashpot.from_restitution(0.9, 1e5, pair) for pair in scene.pairs), samples=40,
               t_end=0.5)
    assert len(found.contacts) > 10
    assert np.array_equal(found.velocity[:, -1], found.velocity[:, 0])
    assert shaken or (found.velocity[:, -1] == speed).all()
