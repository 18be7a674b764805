"""Positions and velocities from gaps and rates, and checks of states and walls.

The state consists of gaps and their rates. This module computes positions, velocities and the speed scale of a scene,
checks states, prepares driven walls for a run, and predicts when approaching walls meet.
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
from granular._engine.records import SMALL_RECORD_COUNT, plain
from granular.scene.state import Scene, cumulative_sums
from granular.scene.walls.motion import fastest, fitted as fitted_motion
from granular.scene.walls.path import moved


def positions(scene: Scene, gap: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Compute positions of all bodies from gaps.

    The positions are a cumulative sum from the anchor (see `Scene.anchor`). Without negative gaps they are in
    increasing order by construction.

    Parameters
    ----------
    gap : (T, n-1) array, (T, n) on a ring
        Gaps in m, one row per time.
    elapsed : (T,) array
        Times in s after `start`.
    start : float
        Time of the scene in s.

    Returns
    -------
    (T, n) array
        Positions in m.
    """
    offset = scene.offsets(gap)
    offset += (scene.anchor(elapsed, start) - _at_anchor(scene, offset))[:, None]
    return offset


def points(scene: Scene, gap: Array, position: Array) -> Array:
    """Compute positions with all radii subtracted, so that touching balls coincide.

    Parameters
    ----------
    gap : (T, n-1) array
        Gaps in m.
    position : (T, n) array
        Positions in m, which give the motion of the anchor.

    Returns
    -------
    (T, n) array
        Positions in m. Body 0 is at 0 at the time of the scene.
    """
    flat = scene.replace(radius=np.zeros(scene.n), origin=0.0)
    offset, moved = flat.offsets(gap), _at_anchor(scene, position) - _at_anchor(scene, scene.position)
    offset += (_at_anchor(flat, flat.position) + moved - _at_anchor(flat, offset))[:, None]
    return offset


def velocities(scene: Scene, rate: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Compute velocities of all bodies from the rates of the gaps.

    The velocities are a cumulative sum from the anchor, so their differences equal the rates to the last digit. The
    correction of the centre of mass is applied twice: in long chains the rounding error of the first one shifts every
    ball.

    Parameters
    ----------
    rate : (T, n-1) array
        Rates of the gaps in m/s, one row per time.
    elapsed : (T,) array
        Times in s after `start`.

    Returns
    -------
    (T, n) array
        Velocities in m/s.
    """
    offset, anchor = cumulative_sums(rate[..., : scene.n - 1]), scene.anchor_velocity(elapsed, start)
    if scene._wall is not None:
        offset += (anchor - offset[:, scene._wall])[:, None]
        return offset
    # the second pass removes the rounding error of the first one
    for _ in range(2):
        offset += (anchor - (offset * scene._share).sum(axis=-1))[:, None]
    return offset


def _at_anchor(scene: Scene, of_bodies: Array) -> Any:
    """Evaluate an array (…, n) of values per body at the anchor.

    The anchor is the first wall, or else the centre of mass. Each row is summed by itself. The rounding of a matrix
    product would depend on the other rows.
    """
    return (of_bodies * scene._share).sum(axis=-1) if scene._wall is None else of_bodies[..., scene._wall]


def speed_scale(scene: Scene) -> float:
    """Return an upper bound in m/s of the speed at which a pair can first close.

    It adds the current velocity differences, the fall through all gaps, and the largest speeds of driven and thermal
    walls.
    """
    v = scene.velocity if isinstance(scene, Scene) else checked(scene).velocity
    # overlaps add no height of fall
    reach = float(scene.gap.clip(min=0.0).sum())
    fall = scene.gravity if scene.external_force is None else max(scene.gravity, float(np.abs(scene.pull).max()))
    speed = float(v.max() - v.min()) + math.sqrt(2.0 * fall * reach)
    if scene.pendulum > 0.0:
        speed += scene.pendulum * float(np.ptp(scene.displacement))
    if scene.heated:
        speed += sum(heat.fastest(m) for heat, m in zip(scene.heat, scene.mass[[1, -2]].tolist(), strict=True) if heat)
    return speed + sum(map(fastest, scene.motions)) if scene.driven else speed


def in_order(scene: Scene) -> Scene:
    """Return `scene` if no overlap is so deep that two centres change places.

    Point particles are exempt. Else raise `ValueError`.
    """
    reach = sum(checked(scene).sides(scene.radius))
    check.every("gap", scene.gap, (scene.gap >= -reach * (1.0 + 1e-12)) | (reach == 0.0),
                 "at least minus the sum of both radii",
                "Deeper overlaps would exchange the centres.")
    return scene


def remembered(function: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """Cache the result of a function of a scene, for scenes of few balls.

    The result is stored in the scene, which is immutable.
    """
    name = f"_{function.__name__}"

    @wraps(function)
    def asked(scene: Scene) -> Any:
        # the dictionary of a frozen dataclass can still be written
        known = vars(scene) if scene.n <= SMALL_RECORD_COUNT else {}
        if name not in known:
            known[name] = function(scene)
        return known[name]

    return asked


def checked(scene: Any) -> Scene:
    """Return `scene` if it is a `Scene`, else raise `TypeError`."""
    if not isinstance(scene, Scene):
        raise TypeError(check.misuse("scene", scene, "a granular.Scene, such as granular.scenes.three_balls()"))
    return scene


MAX_LENGTH_ERROR = 2.0**-26
"""Largest accepted relative error of the sum of gaps of a box.

It is half of the digits of a float, much more than rounding causes, and much less than the error of a wrong state.
"""


def flaw(
    scene: Scene, start: float, elapsed: Array, gap: Array, position: Array, velocity: Array, hard: bool, adds_up: bool
) -> str:
    """Return the reason why a state is invalid, or "" if it is valid.

    Numbers must be finite. Gaps of `hard` spheres must not be negative. Between two walls and on a ring, Σ gap must
    equal its initial value plus the increase of the distance between the walls, to rounding.

    Parameters
    ----------
    scene : Scene
        Scene at the time `start`.
    start : float
        Time of the scene in s.
    elapsed : (1,) array
        Time of the state in s after `start`.
    gap : (n-1,) array, (n,) on a ring
        Gaps in m.
    position, velocity : (n,) arrays
        Positions in m and velocities in m/s.
    hard : bool
        Whether negative gaps are invalid.
    adds_up : bool
        Whether to check Σ gap.
    """
    # the sums are finite only if all entries are
    if not math.isfinite(float(position.sum()) + float(velocity.sum())):
        return "a position or a velocity is not a finite number"
    if hard and gap.min() < 0.0:
        return f"gap {gap.argmin()} is {gap.min():.6g} m"
    if not adds_up or (not scene.ring and not (scene.is_wall[0] and scene.is_wall[-1])):
        return ""
    # a ring has no walls, so its length is constant
    below, above = (0.0, 0.0) if scene.ring else (
        float((scene.velocity[wall] * elapsed + scene._moved(wall, elapsed, start)[0])[0]) for wall in (0, scene.n - 1))
    room, due = float(gap.sum()), float(scene.gap.sum()) + (above - below)
    # the rounding error of the sum is proportional to the lengths in it
    size = float(np.abs(scene.gap).sum() + 2.0 * scene.radius.sum()) + abs(below) + abs(above)
    return "" if abs(room - due) <= MAX_LENGTH_ERROR * size else f"gaps add up to {room:.12g} m instead of {due:.12g} m"


def unending(scene: Scene) -> str:
    """Return why the contacts of elastic balls never end, or "" if this is not proved.

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
    """Return `scene` with panels in place of wall motions given as functions.

    The panels cover a run from `t_start` to `t_end` (s). `ValueError` is raised if the path of a wall is shorter.
    """
    if not scene.driven:
        return scene
    paths = [fitted_motion(motion, t_start, t_end) for motion in scene.motions]
    floor, ceiling = (heat if path is None else path for path, heat in zip(paths, scene.heat, strict=True))
    return scene.replace(floor=floor, ceiling=ceiling)


def driven_walls(scene: Scene, t_start: float, *, still: bool = True) -> list[tuple[int, Any, Any]]:
    """Return the body and the kernel records of each driven wall.

    Parameters
    ----------
    scene : Scene
        Scene that was prepared by `fitted`.
    t_start : float
        Time of the scene in s.
    still : bool
        Whether to include driven walls that never move.

    Returns
    -------
    list of (int, array, array)
        Number of the body, its record `WALL` in an array, and its records `PANEL`. Panels are numbered consecutively
        over all walls.
    """
    found, first = list[tuple[int, Any, Any]](), 0
    for body, side, motion in zip((0, scene.n - 1), (1.0, -1.0), scene.motions, strict=True):
        if motion is not None and (still or fastest(motion) > 0.0):
            stands = {"start": float(scene.position[body]), "velocity": float(scene.velocity[body])}
            panels = motion.panels(t_start, t_start)
            found.append((body, *panels.records(side, **stands, t_start=t_start, first=first)))
            first += len(found[-1][2])
    return found


CLOSING_MARGIN = 2.0**-30
"""Share of the free length between two closing walls at which they count as met.

Hard balls that bounce between the walls at 2/(1 - ε) times the speed of the walls give their sum of gaps a rounding
error of similar size.
"""


class Closing:
    """Time at which two approaching walls leave no room for the balls between them.

    For driven walls the search proceeds only as far as requested.

    Parameters
    ----------
    scene : Scene
        Scene with the walls, prepared by `fitted` if they are driven.
    start : float
        Time of the scene in s.
    flattened : bool
        Whether balls give way, so that no room is left only when the walls themselves meet. Walls that have changed
        places at the start, because points overlap that much, are not checked.

    Attributes
    ----------
    after : float
        Time in s from the start until the walls meet. It is inf if they never meet, or not within the time searched.
    horizon : float
        Time in s at which a run of hard balls must end because there is no room left, inf like `after`.
    looked : float
        Time in s from the start up to which driven walls are proved not to meet, inf if they never meet.
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
        self.horizon = start + (1.0 - CLOSING_MARGIN) * self.after

    def _read(self, driven: list[tuple[int, Any, Any]]) -> None:
        """Store the paths of driven walls and the bounds that the search needs.

        The bounds are the largest acceleration, the times of velocity jumps, and the time up to which the walls are
        too far apart to meet.
        """
        _, walls, panels = zip(*driven, strict=True)
        self.walls, self.panels = plain(np.concatenate(walls)), plain(np.concatenate(panels))
        self.most = float(sum(wall["stiff"][0] for wall in walls))
        jumps = np.unique(np.concatenate([rows["left"][rows["jump"] != 0.0] for rows in panels]))
        # in s from the start, rounded up so that the time is certainly not before the jump
        self.jumps = (jumps - self.start) + 2.0**-50 * (abs(self.start) + np.abs(jumps))
        # m(t) - m(t_start) is at most twice the largest |m|
        apart = self.room - 2.0 * float(sum(wall["extent"][0] for wall in walls))
        self.looked = 0.0 if apart <= 0.0 else apart / self.speed if self.speed > 0.0 else math.inf

    def look(self, time: float) -> float:
        """Return `horizon` after a search up to `time` in s, in steps that never pass it."""
        # without an end time only the start is checked
        until = time - self.start if time < math.inf else 0.0
        while self.looked <= until and self.horizon == math.inf:
            gap, rate = self._at(self.looked)
            if gap <= CLOSING_MARGIN * self.room and rate <= 0.0:
                self.after, self.horizon = self.looked, self.start + self.looked
                break
            # safe because of the bound `most`; half of the margin keeps the step positive
            near = self.looked + time_to_contact(max(0.0, gap - 0.5 * CLOSING_MARGIN * self.room), rate, self.most)
            later = self.jumps[np.searchsorted(self.jumps, self.looked, side="right") :]  # where the rate changes
            step = min(near, float(later[:1].min(initial=math.inf)))
            # at least one float forward, so that the loop ends
            self.looked = max(step, math.nextafter(self.looked, math.inf))
        return self.horizon

    def refuse(self, time: float, end: float) -> None:
        """Raise `ValueError` if the walls of a run to `end` meet by `time`, in s."""
        self.look(time)
        if self.start + self.after <= time and self.after < math.inf:
            raise ValueError(f"`t_end` must be before the walls meet at t = {self.start + self.after:.12g} s, got "
                             f"{None if end == math.inf else end!r}.")

    def _at(self, elapsed: float) -> tuple[float, float]:
        """Return the room between driven walls in m and its rate in m/s.

        The time is `elapsed` s after the start."""
        gap, rate = self.room - self.speed * elapsed, -self.speed
        for wall in self.walls:
            m, v, _ = moved(wall, self.panels, self.start, elapsed)
            gap, rate = gap - (m - wall.origin), rate - v
        return gap, rate
