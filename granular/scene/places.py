"""From gaps and their rates, the state, to positions and velocities of all bodies; the scale of speeds; whether a state
can be one.
May be skipped: sums from one body to the next.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular import _check, walls
from granular._check import Array
from granular.scene.state import Scene, summed


def positions(scene: Scene, gap: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Positions (T, n) in m from gaps (T, n-1), or (T, n) on a ring, `elapsed` (T,) in s after the instant `start`.

    A cumulative sum from the anchor. With no negative gap the order of positions holds by construction.
    """
    offset = scene.offsets(gap)
    offset += (scene.anchor(elapsed, start) - _at_anchor(scene, offset))[:, None]
    return offset


def points(scene: Scene, gap: Array, position: Array) -> Array:
    """Positions (T, n) in m with the radii taken out and from 0 on, where balls that touch coincide, from gaps (T, n-1)
    and `position` (T, n), in m."""
    flat = scene.replace(radius=np.zeros(scene.n), origin=0.0)
    offset, moved = flat.offsets(gap), _at_anchor(scene, position) - _at_anchor(scene, scene.position)
    offset += (_at_anchor(flat, flat.position) + moved - _at_anchor(flat, offset))[:, None]
    return offset


def velocities(scene: Scene, rate: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Velocities (T, n) in m/s from the rates (T, n-1) of the gaps a time `elapsed` (T,) in s after the start.

    A cumulative sum from the anchor: differences are the rates to the last digit. The second look at the centre of
    mass matters in long chains, where the rounding of the first moves every ball.
    """
    offset, anchor = summed(rate[..., : scene.n - 1]), scene.anchor_velocity(elapsed, start)
    if scene._wall is not None:
        offset += (anchor - offset[:, scene._wall])[:, None]
        return offset
    for _ in range(2):
        offset += (anchor - (offset * scene._share).sum(axis=-1))[:, None]
    return offset


def _at_anchor(scene: Scene, of_bodies: Array) -> Any:
    """What an array (…, n) says of the anchor: the first wall, or else the centre of mass, of each row by itself: a
    product of matrices would give a row other digits beside other rows."""
    return (of_bodies * scene._share).sum(axis=-1) if scene._wall is None else of_bodies[..., scene._wall]


def speed_scale(scene: Scene) -> float:
    """Largest speed in m/s at which a pair may first close: current differences, the fall through the gaps, and the
    largest speeds of driven walls."""
    v = scene.velocity
    reach = float(scene.gap.clip(min=0.0).sum())
    fall = scene.gravity if scene.external_force is None else max(scene.gravity, float(np.abs(scene.pull).max()))
    speed = float(v.max() - v.min()) + math.sqrt(2.0 * fall * reach)
    if scene.pendulum > 0.0:
        speed += scene.pendulum * float(np.ptp(scene.displacement))
    if scene.heated:
        speed += sum(heat.fastest(m) for heat, m in zip(scene.heat, scene.mass[[1, -2]].tolist(), strict=True) if heat)
    return speed + sum(map(walls.fastest, scene.motions)) if scene.driven else speed


def in_order(scene: Scene) -> Scene:
    """Return `scene` if no overlap is so deep that two centres have changed places; point particles may."""
    reach = sum(scene.sides(scene.radius))
    _check.every("gap", scene.gap, (scene.gap >= -reach * (1.0 + 1e-12)) | (reach == 0.0),
                 "an overlap cannot be deeper than both radii together", "deeper, the centres have changed places")
    return scene


def checked(scene: Any) -> Scene:
    """Return `scene` if it is one, else raise."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {scene!r}: a granular.Scene is needed, such as granular.scenes.three_balls().")
    return scene


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
