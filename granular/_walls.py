"""Walls that move towards each other: how long there is room between them."""

from __future__ import annotations

import math

from granular.scene import Scene


def close_after(scene: Scene, *, flattened: bool = False) -> float:
    """Time in s until moving walls leave no gap between the balls, or (`flattened`) meet; inf if they never do."""
    closing = float(scene.velocity[0] - scene.velocity[-1])
    if not (scene.is_wall[0] and scene.is_wall[-1] and closing > 0.0):
        return math.inf
    room = float(scene.gap.sum()) + (2.0 * float(scene.radius.sum()) if flattened else 0.0)
    return max(0.0, room) / closing
