"""From gaps and their rates, the state, to positions and velocities of all bodies; the scale of speeds; whether a state
can be one; driven walls as a run keeps them, and until when walls that move towards each other leave room.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.check import Array
from granular._engine.flight import time_to_contact
from granular._engine.records import FEW, plain
from granular.scene.state import Scene, summed
from granular.scene.walls.motion import fastest, fitted as fitted_motion
from granular.scene.walls.path import moved


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
    v = scene.velocity if isinstance(scene, Scene) else checked(scene).velocity
    reach = float(scene.gap.clip(min=0.0).sum())
    fall = scene.gravity if scene.external_force is None else max(scene.gravity, float(np.abs(scene.pull).max()))
    speed = float(v.max() - v.min()) + math.sqrt(2.0 * fall * reach)
    if scene.pendulum > 0.0:
        speed += scene.pendulum * float(np.ptp(scene.displacement))
    if scene.heated:
        speed += sum(heat.fastest(m) for heat, m in zip(scene.heat, scene.mass[[1, -2]].tolist(), strict=True) if heat)
    return speed + sum(map(fastest, scene.motions)) if scene.driven else speed


def in_order(scene: Scene) -> Scene:
    """Return `scene` if no overlap is so deep that two centres have changed places; point particles may."""
    reach = sum(checked(scene).sides(scene.radius))
    check.every("gap", scene.gap, (scene.gap >= -reach * (1.0 + 1e-12)) | (reach == 0.0),
                 "an overlap cannot be deeper than both radii together", "deeper, the centres have changed places")
    return scene


def remembered(function: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """Have a function of a scene alone asked once of a scene of few balls, which never changes."""
    name = f"_{function.__name__}"

    @wraps(function)
    def asked(scene: Scene) -> Any:
        known = vars(scene) if scene.n <= FEW else {}
        if name not in known:
            known[name] = function(scene)
        return known[name]

    return asked


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
    if not math.isfinite(float(position.sum()) + float(velocity.sum())):
        return "a position or a velocity is not a finite number"
    if hard and gap.min() < 0.0:
        return f"gap {gap.argmin()} is {gap.min():.6g} m"
    if not adds_up or (not scene.ring and not (scene.is_wall[0] and scene.is_wall[-1])):
        return ""
    below, above = (0.0, 0.0) if scene.ring else (
        float((scene.velocity[wall] * elapsed + scene._moved(wall, elapsed, start)[0])[0]) for wall in (0, scene.n - 1))
    room, due = float(gap.sum()), float(scene.gap.sum()) + (above - below)
    size = float(np.abs(scene.gap).sum() + 2.0 * scene.radius.sum()) + abs(below) + abs(above)
    return "" if abs(room - due) <= HALF * size else f"gaps add up to {room:.12g} m instead of {due:.12g} m"


def unending(scene: Scene) -> str:
    """Return why the contacts of elastic balls in this scene never end, or "" if this is not proved.

    Two cases are proved, for walls at constant velocity. A ball that accelerates towards the wall next to it returns
    to the wall after every contact. Between two walls at the same velocity, kinetic energy relative to them persists.
    """
    walls, pull, rate = scene.is_wall[[0, -1]], scene.pull, scene.across(scene.velocity)
    enclosed = bool(walls.all())
    if enclosed and scene.velocity[0] > scene.velocity[-1]:
        return ""  # walls that meet end the run
    for c, wall in zip((0, -1), walls.tolist(), strict=True):
        moves = scene.gap[c] > 0.0 or (scene.gap[c] == 0.0 and rate[c] != 0.0)
        if wall and moves and pull[c] > 2.0**-50 * scene.gravity:  # more than the rounding of forces f = m g
            return "of elastic balls that fall back to a wall"
    boxed = enclosed and scene.velocity[0] == scene.velocity[-1] and not scene.fall.any()
    # overlaps that walls hold closed can vibrate without ever opening
    return "of elastic balls between walls" if boxed and rate.any() and scene.gap.sum() >= 0.0 else ""


def fitted(scene: Scene, t_start: float, t_end: float) -> Scene:
    """Return `scene` as a run from `t_start` to `t_end` (s) keeps it: motions given as functions are panels; raise
    `ValueError` where a wall's path does not last."""
    if not scene.driven:
        return scene
    paths = [fitted_motion(motion, t_start, t_end) for motion in scene.motions]
    floor, ceiling = (heat if path is None else path for path, heat in zip(paths, scene.heat, strict=True))
    return scene.replace(floor=floor, ceiling=ceiling)


def driven_walls(scene: Scene, t_start: float, *, still: bool = True) -> list[tuple[int, Any, Any]]:
    """Return of each driven wall its body, its record `WALL` (in an array) and its records `PANEL`, numbered on from
    wall to wall, of a scene that is `fitted` and whose instant is `t_start` (s); of all, or of those that ever move."""
    found, first = list[tuple[int, Any, Any]](), 0
    for body, side, motion in zip((0, scene.n - 1), (1.0, -1.0), scene.motions, strict=True):
        if motion is not None and (still or fastest(motion) > 0.0):
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
    looked : float
        s from the start up to which it is known that driven walls do not meet; inf if they never do.
    """

    def __init__(self, scene: Scene, start: float, *, flattened: bool = False) -> None:
        self.start, self.looked, self.after = start, math.inf, math.inf
        self.room = float(scene.gap.sum()) + (2.0 * float(scene.radius.sum()) if flattened else 0.0)
        self.speed = float(scene.velocity[0] - scene.velocity[-1])
        enclosed = bool(scene.is_wall[[0, -1]].all()) and self.room >= 0.0
        if enclosed and scene.driven:
            self._read(driven_walls(scene, start))
        elif enclosed and self.speed > 0.0:
            self.after = self.room / self.speed
        self.horizon = start + (1.0 - MARGIN) * self.after

    def _read(self, driven: list[tuple[int, Any, Any]]) -> None:
        """Keep what is to be known of driven walls: their paths, the bound of their acceleration, when their velocities
        jump, and up to when they are too far apart to meet."""
        _, walls, panels = zip(*driven, strict=True)
        self.walls, self.panels = plain(np.concatenate(walls)), plain(np.concatenate(panels))
        self.most = float(sum(wall["stiff"][0] for wall in walls))
        jumps = np.unique(np.concatenate([rows["left"][rows["jump"] != 0.0] for rows in panels]))
        # in s from the start, after them for sure
        self.jumps = (jumps - self.start) + 2.0**-50 * (abs(self.start) + np.abs(jumps))
        apart = self.room - 2.0 * float(sum(wall["extent"][0] for wall in walls))
        self.looked = 0.0 if apart <= 0.0 else apart / self.speed if self.speed > 0.0 else math.inf

    def look(self, time: float) -> float:
        """Return `horizon`, having looked as far as `time` in s: step by step, never over it."""
        until = time - self.start if time < math.inf else 0.0
        while self.looked <= until and self.horizon == math.inf:
            gap, rate = self._at(self.looked)
            if gap <= MARGIN * self.room and rate <= 0.0:
                self.after, self.horizon = self.looked, self.start + self.looked
                break
            near = self.looked + time_to_contact(max(0.0, gap - 0.5 * MARGIN * self.room), rate, self.most)
            later = self.jumps[np.searchsorted(self.jumps, self.looked, side="right") :]  # where the rate changes
            step = min(near, float(later[:1].min(initial=math.inf)))
            self.looked = max(step, math.nextafter(self.looked, math.inf))
        return self.horizon

    def refuse(self, time: float, end: float) -> None:
        """Raise `ValueError` if the walls of a run to `end` meet by `time`, in s."""
        self.look(time)
        if self.start + self.after <= time and self.after < math.inf:
            raise ValueError(f"t_end is {None if end == math.inf else end!r}: the walls meet at t = "
                             f"{self.start + self.after:.12g} s; give a t_end before that, or walls that come less "
                             "far.")

    def _at(self, elapsed: float) -> tuple[float, float]:
        """Room in m between driven walls a time `elapsed` in s after the start, and its rate in m/s."""
        gap, rate = self.room - self.speed * elapsed, -self.speed
        for wall in self.walls:
            m, v, _ = moved(wall, self.panels, self.start, elapsed)
            gap, rate = gap - (m - wall.origin), rate - v
        return gap, rate
