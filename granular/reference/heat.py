"""Thermal walls for the slow solvers: which pairs they are of, and the next speed that each draws.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

from granular.scene import Scene
from granular.walls import Thermal


class Heat:
    """One thermal wall.

    Attributes
    ----------
    wall, ball : int
        The bodies of its pair.
    side : int
        0 of a floor, 1 of a ceiling.
    """

    def __init__(self, scene: Scene, side: int, how: Thermal) -> None:
        self.wall, self.ball, self.side = (scene.n - 1) * side, 1 if side == 0 else scene.n - 2, side
        self.how, self.mass, self.hits = how, float(scene.mass[self.ball]), 0

    def next_speed(self) -> float:
        """The speed in m/s away from the wall that its next hit gives."""
        self.hits += 1
        return self.how.drawn(self.side, self.hits - 1, self.mass)


def heats(scene: Scene) -> dict[int, Heat]:
    """The thermal walls of a scene, by their pairs."""
    ends = zip((0, 1), (0, scene.n_pairs - 1), scene.heat, strict=True)
    return {pair: Heat(scene, side, how) for side, pair, how in ends if how is not None}
