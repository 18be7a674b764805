"""Driven walls of a scene as a run keeps them, and until when walls that move towards each other leave room.
May be skipped: rarer, walls that move.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular import walls
from granular._flight import time_to_contact
from granular._records import plain
from granular.scene.state import Scene
from granular.walls.path import moved


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


MARGIN = 2.0**-30
"""Closing walls meet when this part of the free length between them is left: hard balls that bounce between them at
2/(1 - ε) times the speed of the walls make their sum of gaps uncertain by not much less."""


class Closing:
    """When two walls leave no room; of driven ones, as far ahead as it is asked for.

    Parameters
    ----------
    scene : Scene
        Its walls; `fitted` if they are driven.
    start : float
        Time in s at which it stood as it says.
    flattened : bool
        Whether balls give way: then the walls leave no room when they meet themselves. Points that overlap so much
        that the walls stand beyond each other at the start are never asked.

    Attributes
    ----------
    after : float
        s from the start until they meet; inf if they never do, or not as far as was looked.
    horizon : float
        Time in s at which hard balls have to end, for there is no room; inf like `after`.
    """

    def __init__(self, scene: Scene, start: float, *, flattened: bool = False) -> None:
        self.start, self.looked, self.after = start, math.inf, math.inf
        self.room = float(scene.gap.sum()) + (2.0 * float(scene.radius.sum()) if flattened else 0.0)
        self.speed = float(scene.velocity[0] - scene.velocity[-1])
        enclosed = bool(scene.is_wall[[0, -1]].all()) and self.room >= 0.0
        if enclosed and not scene.driven and self.speed > 0.0:
            self.after = self.room / self.speed
        self.horizon = start + (1.0 - MARGIN) * self.after
        if not (enclosed and scene.driven):
            return
        _, walls, panels = zip(*driven_walls(scene, start), strict=True)
        self.most = float(sum(wall["stiff"][0] for wall in walls))
        jumps = np.unique(np.concatenate([rows["left"][rows["jump"] != 0.0] for rows in panels]))
        self.jumps = (jumps - start) + 2.0**-50 * (abs(start) + np.abs(jumps))  # s from the start, after them for sure
        self.walls, self.panels = plain(np.concatenate(walls)), plain(np.concatenate(panels))
        reach = 2.0 * float(sum(wall["extent"][0] for wall in walls))
        if self.room <= reach:
            self.looked = 0.0
        elif self.speed > 0.0:
            self.looked = (self.room - reach) / self.speed

    def look(self, time: float) -> float:
        """Return `horizon`, having looked as far as `time` in s: step by step, never over it."""
        until = time - self.start if time < math.inf else 0.0
        while self.looked <= until and self.horizon == math.inf:
            gap, rate = self._at(self.looked)
            if gap <= MARGIN * self.room and rate <= 0.0:
                self.after, self.horizon = self.looked, self.start + self.looked
                break
            step = time_to_contact(max(0.0, gap - 0.5 * MARGIN * self.room), rate, self.most)
            later = self.jumps[np.searchsorted(self.jumps, self.looked, side="right") :]  # where the rate changes
            step = min(self.looked + step, float(later[0]) if len(later) else math.inf)
            self.looked = max(step, math.nextafter(self.looked, math.inf))
        return self.horizon

    def refuse(self, time: float, end: float) -> None:
        """Raise `ValueError` if the walls of a run to `end` meet by `time`, in s."""
        self.look(time)
        if self.start + self.after <= time and self.after < math.inf:
            given = "None" if end == math.inf else repr(end)
            raise ValueError(f"t_end is {given}: the walls meet at t = {self.start + self.after:.12g} s; give a t_end "
                             "before that, or walls that come less far.")

    def _at(self, elapsed: float) -> tuple[float, float]:
        gap, rate = self.room - self.speed * elapsed, -self.speed
        for wall in self.walls:
            m, v, _ = moved(wall, self.panels, self.start, elapsed)
            gap, rate = gap - (m - wall.origin), rate - v
        return gap, rate
