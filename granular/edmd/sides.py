"""What a state holds of driven walls, and of forces: how it begins, its rows, and the account of its energy.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

import math
from copy import copy
from typing import Any

import numpy as np

from granular._check import Array
from granular._records import column, plain
from granular.edmd.account import ledger as entries
from granular.edmd.driven import BOTH, CEILING, FLOOR, FREE, SIDE, carry, place, rounding
from granular.scene import Scene
from granular.scene.walls import driven_walls
from granular.walls.panels import PANEL


def walls(scene: Scene, t_start: float) -> tuple[Any, Any]:
    """Return records of both walls, `SIDE`, and of the panels of both."""
    sides = np.zeros(2, SIDE)
    sides["velocity"] = np.where(scene.is_wall, scene.velocity, 0.0)[[0, -1]]
    driven = driven_walls(scene, t_start)
    for body, one, _ in driven:
        for name in one.dtype.names or ():
            sides[name][0 if body == 0 else 1] = one[name][0]
    for side, heat in zip(sides, scene.heat, strict=True):
        if heat is not None:
            side["temperature"], side["seed"] = heat.temperature, heat.seed
    sides["begin"] = t_start
    panels = [rows for _, _, rows in driven] or [np.zeros(1, PANEL)]  # kernels want one to know their kind
    return sides, np.concatenate(panels)


def begin(state: Any, scene: Scene) -> None:
    """Set what forces and walls add to a new state."""
    sides, forces, (pairs, bodies) = state.walls[0], scene.external_force, (state.pairs, state.bodies)
    bodies["own"] = 0.0 if forces is None else forces * scene.inverse_mass
    bodies["push"] = bodies["own"]
    pairs["wall"], pairs["wait"], pairs["heat"] = -1, 0.0, -1
    if forces is not None:
        pairs["pull"] -= scene.across(bodies["own"])
    sides["forces"] = forces is not None
    sides["lands"] = scene.driven or (forces is not None and state.run.slow < 0.0)
    date(state)
    seen = plain(sides), plain(state.walls[1])
    for which in (0, 1):
        if sides["temperature"][which] > 0.0:
            pairs["heat"][-which] = which
        if sides["panels"][which]:
            pairs["wall"][-which] = which
            bodies["u"][-which] = place(seen, which, 0.0)[1]
            bodies["noise"][-which] = rounding(float(sides["speed"][which]))


def date(state: Any) -> None:
    """Tell the walls the zero of times."""
    for side in state.walls[0]:
        side["epoch"], side["low"] = state.clock.epoch, state.clock.epoch_low


def show(state: Any, tau: float, velocity: Array, gap: Array) -> None:
    """Put into a row what forces and walls do to velocities and gaps, at `tau`."""
    velocity += column(state.bodies, "push") * tau
    seen = _seen(state)
    shut, beside = column(state.pairs, "shut"), column(state.pairs, "wall")
    gap[shut > 0] = 0.0
    for c in np.flatnonzero((beside >= 0) & (shut == 0)).tolist():
        pair, lower, upper = map(copy, (*plain(state.pairs[c : c + 1]), *plain(state.bodies[c : c + 2])))
        carry(pair, lower, upper, tau, seen)
        gap[c] = pair.gap
    for i, which in bound(state):
        if seen[0][which].panels:
            velocity[i] = place(seen, which, tau)[1]


def ledger(state: Any, tau: float) -> Array:
    """Return work, heat and what was dissipated since the start, at `tau`, in J."""
    bodies = [(plain(state.bodies[i : i + 1])[0], which) for i, which in bound(state)]
    resting = [(body, which) for body, which in bodies if body.mass < math.inf]
    entered: Array = entries(state.run, resting, _seen(state), tau)
    return entered


def bound(state: Any) -> list[tuple[int, int]]:
    """Return the bodies that are walls or rest on one, each with the wall: 0 the floor, 1 the ceiling."""
    mass, shut = column(state.bodies, "mass"), column(state.pairs, "shut")
    n, below, above = len(mass), int((shut == FLOOR).sum()), int((shut == CEILING).sum())
    floor = [(i, 0) for i in range(below + 1)] if math.isinf(mass[0]) else []
    return floor + ([(i, 1) for i in range(n - 1 - above, n)] if math.isinf(mass[-1]) else [])


def sound(state: Any, pairs: Any, bodies: Any) -> bool:
    """Whether what rests hangs together and falls by nothing, and pairs are beside walls that are there."""
    rests, shut = bodies["falls"] == 0.0, pairs["shut"]
    joined = [i for i, _ in bound(state)]
    free = (shut == FREE) & (pairs["wall"] < 0)
    driven = [which for which in (0, 1) if column(state.walls[0], "panels")[which] > 0]
    pull = state.run.gravity * np.diff(bodies["falls"]) - np.diff(bodies["push"])
    whole = [
        rests[joined].all() and rests.sum() == len(joined),
        not bodies["push"][rests].any() and not pairs["gap"][shut != FREE].any(),
        (pairs["pull"][free] == pull[free]).all(),
        np.isin(pairs["wall"], [-1, *driven, *([BOTH] if len(driven) == 2 else [])]).all(),
    ]
    return all(whole)


def _seen(state: Any) -> tuple[Any, Any]:
    return plain(state.walls[0]), plain(state.walls[1])
