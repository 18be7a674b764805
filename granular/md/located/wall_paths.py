"""Driven walls, and pendula, as a run holds them.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._check import Array
from granular._records import packed, plain
from granular.scene import Scene
from granular.scene.walls import driven_walls
from granular.walls import path
from granular.walls.panels import PANEL, TERMS, WALL

Walls = namedtuple("Walls", "start wall panels path push")
"""Time in s at which the run's own clock is 0; records `WALL` of the driven walls and `PANEL` of all their panels; for
each wall scratch: the power series of side·m in m in the time, and that of its acceleration in τ."""
Hung = namedtuple("Hung", "omega square")
"""Ω in 1/s of pendula, and Ω²: what flights need to know of them, as of walls."""


def walls_of(scene: Scene, start: float, terms: int) -> Walls | None:
    """Return the driven walls of a scene whose instant is the time `start` in s, for series of so many `terms`; None if
    none of them ever moves."""
    driven = driven_walls(scene, start, still=False)
    if not driven:
        return None
    _, walls, panels = zip(*driven, strict=True)
    scratch = np.zeros((len(walls), TERMS)), np.zeros((len(walls), terms))
    return Walls(start, np.concatenate(walls), np.concatenate(panels), *scratch)


def numbers_at_ends(walls: Walls) -> tuple[int, int]:
    """Return the numbers from 1 on of the driven walls at the two ends of a scene, 0 without."""
    sides = [float(wall["side"]) for wall in walls.wall]
    return (1 if sides[0] > 0.0 else 0), (len(sides) if sides[-1] < 0.0 else 0)


def with_walls(walls: Walls, velocity: Array) -> Array:
    """Return the velocities (n,) in m/s of a scene's bodies with those of its driven walls at the start."""
    velocity = np.array(velocity)
    wall, panels = plain(walls.wall), plain(walls.panels)
    for one in wall:
        velocity[0 if one.side > 0.0 else -1] = path.wall_at(one, panels, walls.start, 0.0)[1]
    return velocity


def plain_walls(walls: Any) -> Any:
    """Return driven walls for interpreted code."""
    if not isinstance(walls, Walls) or isinstance(walls.wall, list):
        return walls
    return Walls(walls.start, plain(walls.wall), plain(walls.panels), walls.path.tolist(), walls.push.tolist())


def compiled_walls(walls: Any) -> Any:
    """Return driven walls for compiled code."""
    if not isinstance(walls, Walls):
        return walls
    scratch = np.array(walls.path), np.array(walls.push)
    return Walls(walls.start, packed(walls.wall, WALL), packed(walls.panels, PANEL), *scratch)
