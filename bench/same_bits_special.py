"""Scenes of `same_bits` with driven or thermal walls, forces, rings or pendula."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from same_bits_cases import FIXED_METHODS, WORK_LIMITS, Case, random_scene, run_options, soft_laws

ENGINE_NAMES = ("plain", "compiled")
LAW_NAMES = ("dashpot", "viscoelastic", "own Hertz")


def driven_scene(rng: Any) -> Any:
    """Scene with driven walls, external forces, or both."""
    from tests.helpers.scenes_at_random import driven

    scene = random_scene(rng)
    while not scene.is_wall.any():
        scene = random_scene(rng)
    still = scene.replace(velocity=np.where(scene.is_wall, 0.0, scene.velocity))
    return driven(rng, still)


def thermal_scene(rng: Any) -> Any:
    """Balls between two thermal walls of different temperatures."""
    import granular as gr

    n = int(rng.integers(1, 6))
    walls = {"floor": gr.walls.Thermal(1.0, seed=int(rng.integers(9))), "ceiling": gr.walls.Thermal(0.3, seed=9)}
    mass, gap = [math.inf, *rng.uniform(0.5, 2.0, n), math.inf], rng.uniform(0.01, 0.2, n + 1)
    return gr.Scene(mass, [0.0, *[0.05] * n, 0.0], gap, [0.0, *rng.normal(size=n), 0.0], **walls)


def ring_scene(rng: Any) -> Any:
    """Balls on a ring, some of which touch."""
    import granular as gr

    n = int(rng.integers(2, 7))
    gap = rng.uniform(0.01, 0.2, n) * (rng.random(n) < 0.8)
    gap[0] = 0.1
    return gr.Scene(rng.uniform(0.5, 2.0, n), [0.05] * n, gap, rng.normal(size=n), ring=True)


def pendulum_scene(rng: Any) -> Any:
    """Pendula, apart or touching."""
    import granular as gr

    n = int(rng.integers(2, 6))
    gap, omega = rng.uniform(0.0, 0.02, n - 1) * (rng.random(n - 1) < 0.7), float(rng.uniform(2.0, 6.0))
    return gr.Scene(rng.uniform(0.5, 2.0, n), [0.05] * n, gap, 0.3 * rng.normal(size=n), pendulum=omega)


def family(number: int, seeds: int, kinds: dict[str, Callable[[Any], Any]]) -> Iterator[Case]:
    """Runs of both engines and of fixed steps on several kinds of scenes.

    Each run is interpreted and compiled where both exist.
    """
    import granular as gr

    for which, (kind, make) in enumerate(kinds.items()):
        for seed in range(seeds):
            rng = np.random.default_rng([number, which, seed])
            scene, laws, rule = make(rng), soft_laws(rng), gr.ConstantRestitution(float(rng.choice([0.5, 0.9, 1.0])))
            given = run_options(rng, scene.n_pairs) or {"t_end": 0.5}
            for queue in ("sorted", "compiled"):
                options = {"max_events": 300} | given | {"engine": queue}
                yield f"edmd {kind}, {queue}", seed, lambda s=scene, r=rule, o=options: gr.edmd.simulate(s, r, **o)
            law, method = laws[LAW_NAMES[seed % len(LAW_NAMES)]], FIXED_METHODS[seed % len(FIXED_METHODS)]
            for engine in ENGINE_NAMES:
                options = WORK_LIMITS | given | {"engine": engine if law is not laws["own Hertz"] else "plain"}
                yield f"located {kind}, {engine}", seed, lambda s=scene, w=law, o=options: gr.md.simulate(s, w, **o)
                yield f"fixed {kind}, {engine}", seed, lambda s=scene, w=law, m=method, o=options: gr.md.simulate(
                    s, w, **o | {"method": m, "dt": 1e-3})


def driven(seeds: int) -> Iterator[Case]:
    """Driven walls, external forces and thermal walls."""
    yield from family(7, seeds, {"driven": driven_scene, "thermal": thermal_scene})


def bounded(seeds: int) -> Iterator[Case]:
    """Rings and pendula."""
    yield from family(8, seeds, {"ring": ring_scene, "pendula": pendulum_scene})


SPECIAL_FAMILIES = {"driven": driven, "bounded": bounded}
