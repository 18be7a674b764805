"""Driven walls of a scene as a run keeps them.
May be skipped: rarer, walls that shake.
"""

from __future__ import annotations

from typing import Any

from granular import walls
from granular.scene.state import Scene


def fitted(scene: Scene, t_start: float, t_end: float) -> Scene:
    """Return `scene` as a run from `t_start` to `t_end` (s) keeps it: motions given as functions are panels; raise
    `ValueError` where a wall's path does not last."""
    if not scene.driven:
        return scene
    paths = [walls.fitted(motion, t_start, t_end) for motion in scene.motions]
    floor, ceiling = (heat if path is None else path for path, heat in zip(paths, scene.heat, strict=True))
    return scene.replace(floor=floor, ceiling=ceiling)


def driven_walls(scene: Scene, t_start: float, *, still: bool = True) -> list[tuple[int, Any, Any]]:
    """Return of each driven wall its body, its record `WALL` (in an array) and its records `PANEL`, numbered on from
    wall to wall, of a scene that is `fitted` and whose instant is `t_start` (s); of all, or of those that ever move."""
    found, first = list[tuple[int, Any, Any]](), 0
    for body, side, motion in zip((0, scene.n - 1), (1.0, -1.0), scene.motions, strict=True):
        if motion is not None and (still or walls.fastest(motion) > 0.0):
            stands = {"start": float(scene.position[body]), "velocity": float(scene.velocity[body])}
            panels = motion.panels(t_start, t_start)
            found.append((body, *panels.records(side, **stands, t_start=t_start, first=first)))
            first += len(found[-1][2])
    return found
