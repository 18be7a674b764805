"""Driven walls and external forces: closed forms and the energy account."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from bench.stability import truth
from bench.stability.cell import ALL_METHODS, Cell, Rerun, compared_with
from granular import measures, scenes, until
from granular.laws import Hertz, LinearDashpot
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Trajectory
from granular.scene import Scene
from granular.scene.walls import Piecewise, Sine

G, FREQUENCY = 9.81, 50.0
OMEGA = 2.0 * math.pi * FREQUENCY
FULL_TURN = 2.0 * math.pi


def driven() -> Iterator[Cell]:
    """All cells with driven walls or external forces."""
    yield from orbits()
    yield from lift_offs()
    yield from equivalent_gravity()
    yield from energy_accounts()


def orbits() -> Iterator[Cell]:
    """Hard ball on a plate, on its stable bounce of k periods, for 200 bounces.

    The phase of the bounce is cos θ = G_k/Γ.
    """
    for eps, k, share in product((0.2, 0.5, 0.8, 0.95), (1, 2), (0.1, 0.5, 0.9)):
        exists = k * math.pi * (1.0 - eps) / (1.0 + eps)
        doubles = math.hypot(exists, 2.0 * (1.0 + eps * eps) / ((1.0 + eps) * (1.0 + eps)))
        gamma = exists + share * (doubles - exists)
        phase = math.acos(exists / gamma)
        plate = Sine.from_acceleration(gamma, FREQUENCY, G, phase)
        scene = Scene([math.inf, 1.0], [0.0, 0.0], [0.0], [0.0, k * math.pi * G / OMEGA], G, floor=plate)
        yield Cell("driven", f"orbit of {k} periods, ε = {eps:g}, Γ = {gamma:.4g}", scene,
                   same_phase(phase / FULL_TURN), rule=ConstantRestitution(eps), methods=("edmd",),
                   options={"until": until.contact(0, 200)})


@compared_with("orbit in closed form")
def same_phase(run: Trajectory, rerun: Rerun, phase: float) -> float:
    """Largest deviation of a bounce from the phase of the orbit, in turns."""
    apart = measures.section(run)["phase"] - phase
    return float(np.abs(apart - np.round(apart)).max()) if len(apart) else math.inf


def lift_offs() -> Iterator[Cell]:
    """Hard ball that rests on a plate and leaves it at sin θ = 1/Γ.

    The plate then accelerates downwards with g.
    """
    for gamma in (1.01, 1.2, 2.0, 10.0):
        plate = Sine.from_acceleration(gamma, FREQUENCY, G, -0.5 * math.pi)
        leaves = (math.asin(1.0 / gamma) + 0.5 * math.pi) / OMEGA
        end = leaves + 0.3 * (2.0 / OMEGA) * math.sqrt(1.0 - 1.0 / gamma)
        scene = Scene([math.inf, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0], G, floor=plate)
        after = plate.velocity(end), plate.velocity(leaves) - G * (end - leaves)
        yield Cell("driven", f"lift-off at Γ = {gamma:g}", scene, truth.velocities(after, plate.amplitude * OMEGA),
                   rule=ConstantRestitution(0.5), methods=("edmd",), options={"t_end": end})


def equivalent_gravity() -> Iterator[Cell]:
    """Accelerated floors and external forces that are equivalent to gravity."""
    floor = Piecewise([0.0, 1.0], [[0.5 * G], [0.0], [0.0]])
    for law, name in ((LinearDashpot(1e4, 5.0), "dashpot"), (Hertz(1e6), "Hertz")):
        rule = ConstantRestitution(0.6)
        plain = Scene([math.inf, 1.0, 0.5], [0.0, 0.05, 0.05], [0.3, 0.1], [0.0] * 3, G)
        rising = plain.replace(gravity=0.0, floor=floor)
        forced = plain.replace(gravity=0.0, external_force=[0.0, -G, -0.5 * G])
        for scene, what in ((rising, "accelerated floor"), (forced, "forces equal to gravity")):
            yield Cell("driven", f"{what}, {name}", scene, as_under_gravity(plain), law, rule, 1e-11,
                       options={"t_end": 0.6, "samples": 13}, methods=ALL_METHODS)


@compared_with("run with gravity")
def as_under_gravity(run: Trajectory, rerun: Rerun, plain: Scene) -> float:
    """Largest difference from the gaps above a floor at rest, over the first gap."""
    return float(np.abs(run.gap - rerun(scene=plain).gap).max()) / float(plain.gap[0])


def energy_accounts() -> Iterator[Cell]:
    """Shaken columns, and balls between a shaken floor and an approaching ceiling."""
    for n, gamma, eps in product((1, 3), (0.8, 2.0, 10.0), (0.5, 0.9)):
        column = scenes.vibrated_column(n, gamma, FREQUENCY)
        yield energy_account_cell(f"column of {n}, Γ = {gamma:g}, ε = {eps:g}", column, eps, slow=gamma < 5.0)
    for eps in (0.5, 0.9):
        box = Scene([math.inf, 1.0, 2.0, math.inf], [0.0, 0.05, 0.05, 0.0], [0.05, 0.02, 0.1], [0.0, 0.0, 0.0, -0.05],
                    G, external_force=[0.0, 3.0, -1.0, 0.0], floor=Sine(1e-3, FREQUENCY), ceiling=Sine(2e-3, 17.0))
        yield energy_account_cell(f"between two shaken walls, ε = {eps:g}", box, eps)


def energy_account_cell(case: str, scene: Scene, eps: float, slow: bool = False) -> Cell:
    """Cell that checks the energy account."""
    laws: Any = tuple(LinearDashpot.from_restitution(eps, k=1e5, pair=pair) for pair in scene.pairs)
    return Cell("driven", case, scene, account_closes(), laws, ConstantRestitution(eps), methods=ALL_METHODS,
                loose=0.05, options={"t_end": 0.1}, slow=slow)


@compared_with("energy account")
def account_closes(run: Trajectory, rerun: Rerun) -> float:
    """Remainder of the energy account, as a share of all energy turned over.

    Energy - work + dissipated energy must stay constant.
    """
    parts = measures.balance(run)
    turned = sum(abs(parts[name]) for name in ("start", "floor", "ceiling", "dissipated"))
    return abs(parts["remainder"]) / turned
