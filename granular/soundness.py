"""Whether the last state of a run can be one: it is of numbers, and its gaps add up.
May be skipped: a check, no physics.
"""

from __future__ import annotations

import math

import numpy as np

from granular._check import Array
from granular.scene import Scene

HALF = 2.0**-26
"""Share of the length of a box by which the sum of its gaps may be off: half of its digits, much more than rounding
takes, and much less than what a wrong state makes of it."""


def flaw(
    scene: Scene, start: float, elapsed: Array, gap: Array, position: Array, velocity: Array, hard: bool, adds_up: bool
) -> str:
    """Return what is wrong with a state (of gaps (n-1,) or, on a ring, (n,), positions (n,) and velocities (n,)) a time
    `elapsed` (1,) in s after the instant `start` of the scene; "" if nothing is.

    Numbers are finite; gaps of `hard` spheres are not negative; between two walls and on a ring Σ gap is what it was
    at the start and what the walls have come farther apart, to rounding.
    """
    room = float(gap.sum())
    if not math.isfinite(room + float(position.sum()) + float(velocity.sum())):
        return "a position or a velocity is not a finite number"
    if hard and gap.min() < 0.0:
        return f"gap {gap.argmin()} is {gap.min():.6g} m"
    if not adds_up or (not scene.ring and not (scene.is_wall[0] and scene.is_wall[-1])):
        return ""
    below, above = (0.0, 0.0) if scene.ring else (_came(scene, wall, start, elapsed) for wall in (0, scene.n - 1))
    due = float(scene.gap.sum()) + (above - below)
    size = float(np.abs(scene.gap).sum() + 2.0 * scene.radius.sum()) + abs(below) + abs(above)
    return "" if abs(room - due) <= HALF * size else f"gaps add up to {room:.12g} m instead of {due:.12g} m"


def _came(scene: Scene, wall: int, start: float, elapsed: Array) -> float:
    """Return how far a wall has come, in m."""
    return float((scene.velocity[wall] * elapsed + scene._moved(wall, elapsed, start)[0])[0])
