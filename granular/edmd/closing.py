"""Walls that move towards each other: until when they leave room for the balls between them.
May be skipped: rarer, walls that meet.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._flight import time_to_contact
from granular._records import plain
from granular.edmd import sides
from granular.edmd.driven import place
from granular.scene import Scene, close_after

MARGIN = 2.0**-30
"""Closing walls end a run when this part of the free length between them is left: balls that bounce between them at
2/(1 - ε) times the speed of the walls make their sum of gaps uncertain by not much less."""


class Closing:
    """When two walls leave no room; of driven ones, as far ahead as it is asked for.

    Parameters
    ----------
    scene : Scene
        Its walls.
    start : float
        Time in s at which it stood as it says.

    Attributes
    ----------
    after : float
        s from the start until they meet; inf if they never do, or not as far as was looked.
    horizon : float
        Time in s at which the run has to end, for there is no room; inf like `after`.
    """

    def __init__(self, scene: Scene, start: float) -> None:
        self.start, self.looked = start, math.inf
        self.after = math.inf if scene.driven else close_after(scene)
        self.horizon = start + (1.0 - MARGIN) * self.after
        if not (scene.driven and scene.is_wall[[0, -1]].all()):
            return
        self.room = float(scene.gap.sum())
        walls, panels = sides.walls(scene, start)
        walls["epoch"] = start
        self.most = float(walls["stiff"].sum())
        reach, closing = 2.0 * float(walls["extent"].sum()), float(walls["velocity"] @ [1.0, -1.0])
        if self.room <= reach:
            self.looked = 0.0
        elif closing > 0.0:
            self.looked = (self.room - reach) / closing
        self.walls: Any = plain(walls), plain(panels)

    def look(self, time: float) -> float:
        """Return `horizon`, having looked as far as `time` in s: step by step, never over it."""
        until = time - self.start if time < math.inf else 0.0
        while self.looked <= until and self.horizon == math.inf:
            gap, rate = self._at(self.looked)
            if gap <= MARGIN * self.room and rate <= 0.0:
                self.after, self.horizon = self.looked, self.start + self.looked
                break
            step = time_to_contact(max(0.0, gap - 0.5 * MARGIN * self.room), rate, self.most)
            self.looked = max(self.looked + step, np.nextafter(self.looked, math.inf))
        return self.horizon

    def _at(self, elapsed: float) -> tuple[float, float]:
        (below, floor), (above, ceiling) = (place(self.walls, which, elapsed) for which in (0, 1))
        return self.room + (above - below), ceiling - floor
