"""The stage of a film: the balls of both engines side by side while they touch, with a glass on the contact.
May be skipped: pictures, no physics.

Balls are drawn by the square root of their radii, paths and overlaps by a common factor so large that they can be seen.
Where nothing pulls down, the balls stand in a row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._check import Array
from granular.comparison.reel import INK, PAPER
from granular.drawing import HARD, SOFT
from granular.scene import Scene

COLOURS = {"hard": HARD, "soft": SOFT}
THICK = 0.14
"""Largest radius of a ball in the drawing, in its units."""
LEAST = 0.16
"""Smallest radius of a ball beside the largest."""
Moving = list[tuple[Any, Array]]


def stage(axis: Any, scene: Scene, paths: dict[str, Array], name: str, length: float = 1.0) -> Moving:
    """Draw the balls of one engine on a stage so long; return each with its path.

    `paths` are the places (count, n) in m with the radii taken out, of both engines. What soft spheres do fits on the
    stage; hard spheres may leave it.
    """
    from matplotlib.patches import Circle

    colour, upright, soft = COLOURS[name], scene.gravity > 0.0, paths["soft"]
    radius = _radii(scene, length)
    low, high = float(soft.min()), float(soft.max())
    top = min(max(float(places.max()) for places in paths.values()), high + 0.35 * (high - low))
    room = length - 0.06 - 2.0 * float(radius.sum())
    deepest = np.maximum(0.0, -scene.across(soft).min(axis=0))
    sinks = deepest / (0.6 * np.minimum(*scene.sides(np.where(radius > 0.0, radius, np.inf))))
    scale = min(room / max(high - low, top - low, 1e-300), 1.0 / max(float(sinks.max()), 1e-300))
    free = 0.0 if upright else 0.5 * (room - (high - low) * scale)
    along = free + np.cumsum(2.0 * radius) - radius + (paths[name] - low) * scale
    side, ends = (-0.16, 0.16), (-0.03, length)
    axis.set(xlim=side if upright else ends, ylim=ends if upright else side, aspect="equal")
    axis.set_axis_off()
    axis.set_title(f"{name} spheres", color=colour, fontsize=11, loc="center" if upright else "left", pad=2)
    moving: Moving = []
    for body, (wall, r, place) in enumerate(zip(scene.is_wall, radius, along.T, strict=True)):
        where = np.column_stack([0.0 * place, place] if upright else [place, 0.0 * place])
        if wall:
            across = ([-0.14, 0.14], [0.0, 0.0])
            moving.append((axis.plot(*(across if upright else across[::-1]), color=INK, lw=2)[0], where))
            continue
        moving.append((axis.add_patch(Circle((0.0, 0.0), r, facecolor=colour + "30", edgecolor=colour, lw=1.4)), where))
        if scene.n <= 12:
            moving.append((axis.text(0.0, 0.0, str(body), color=colour, fontsize=8, ha="center", va="center"), where))
    return moving


def _radii(scene: Scene, length: float) -> Array:
    """Radii in the drawing; walls have none."""
    radius = relative_radii(scene)
    radii: Array = radius * min(THICK, 0.28 * length / max(float(radius.sum()), 1e-9))
    return radii


def relative_radii(scene: Scene) -> Array:
    """Radii by which balls are drawn, of the largest one: square roots, none very small; those of points are alike."""
    largest = float(scene.radius.max()) or 1.0
    drawn = np.maximum(LEAST, np.sqrt(scene.radius / largest))
    return np.where(scene.is_wall, 0.0, drawn)


def glass(axis: Any, distance: Array, pair: str, name: str) -> Moving:
    """A lens on the contact of a pair: two great balls, whose distance is 1 at the height of the highest hop."""
    from matplotlib.patches import Circle

    colour, big = COLOURS[name], 3.0
    axis.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05), aspect="equal")
    axis.set_axis_off()
    rim = axis.add_patch(Circle((0.0, 0.0), 1.0, facecolor=PAPER, edgecolor=INK, lw=1.0, zorder=0))
    axis.set_title(f"contact {pair}", fontsize=8, color=INK, pad=1)
    half = 0.5 * np.clip(distance, -2.0, 4.0)
    moving: Moving = []
    for sign in (-1.0, 1.0):
        ball = axis.add_patch(Circle((0.0, sign * big), big, facecolor=colour + "30", edgecolor=colour, lw=1.2))
        ball.set_clip_path(rim)
        moving.append((ball, np.column_stack([0.0 * half, sign * half])))
    return moving
