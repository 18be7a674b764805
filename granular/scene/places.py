"""Positions and velocities from gaps and their rates, and preparation of walls.

Engines store gaps and their rates. This module computes positions, velocities and the speed scale of a scene. It also
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
from granular.scene.walls.motion import fitted_motion, max_wall_speed
from granular.scene.walls.path import moved


def positions(scene: Scene, gap: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Compute positions of all bodies from gaps.

    Gaps and radii are summed, and the sums are shifted to the position of the anchor (see `Scene.anchor`). Without
    negative gaps the positions are therefore in increasing order.

    Parameters
    ----------
    scene : Scene
        Scene with radii, walls and anchor.
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


def point_positions(scene: Scene, gap: Array, position: Array) -> Array:
    """Compute positions as if all radii were 0, so that touching balls coincide.

    Parameters
    ----------
    gap : (T, n-1) array
        Gaps in m, one row per time.
    position : (T, n) array
        Positions in m at the same times, from which the motion of the anchor is computed.

    Returns
    -------
    (T, n) array
        Positions in m. Body 0 is at 0 at the time of the scene.
    """
    flat = scene.replace(radius=np.zeros(scene.n), origin=0.0)
    offset, shift = flat.offsets(gap), _at_anchor(scene, position) - _at_anchor(scene, scene.position)
    offset += (_at_anchor(flat, flat.position) + shift - _at_anchor(flat, offset))[:, None]
    return offset


def velocities(scene: Scene, rate: Array, elapsed: Array, start: float = 0.0) -> Array:
    """Compute velocities of all bodies from the rates of the gaps.

    The rates are summed, and the sums are shifted to the velocity of the anchor (see `Scene.anchor_velocity`). A second
    wall has the velocity of its own motion. Without a wall, the shift to the velocity of the centre of mass is applied
    twice. In long chains the rounding error of the first shift would change the velocity of every ball.

    Parameters
    ----------
    rate : (T, n-1) array, (T, n) on a ring
        Rates of the gaps in m/s, one row per time. The last rate of a ring is ignored.
    elapsed : (T,) array
        Times in s after `start`.
    start : float
        Time of the scene in s.

    Returns
    -------
    (T, n) array
        Velocities in m/s.
    """
    offset, anchor = cumulative_sums(rate[..., : scene.n - 1]), scene.anchor_velocity(elapsed, start)
    if scene._wall is not None:
        offset += (anchor - offset[:, scene._wall])[:, None]
        if scene._wall < (last := scene.n - 1) and scene.is_wall[last]:  # exact, without the rounding of the sum
            offset[:, last] = scene.velocity[last] + scene._moved(last, elapsed, start)[1]
        return offset
    # the second pass removes the rounding error of the first one
    for _ in range(2):
        offset += (anchor - (offset * scene._mass_fraction).sum(axis=-1))[:, None]
    return offset


def _at_anchor(scene: Scene, of_bodies: Array) -> Any:
    """Return the value at the anchor of a quantity of the bodies with shape (…, n).

    It is the value of the first wall, or without a wall the mean weighted by mass. Each row is summed separately,
    because the rounding error of a matrix product depends on the other rows.
    """
    return (of_bodies * scene._mass_fraction).sum(axis=-1) if scene._wall is None else of_bodies[..., scene._wall]


def speed_scale(scene: Scene) -> float:
    """Return an upper bound of the approach speed at the first contact in m/s.

    It is the sum of the largest difference of the current velocities, the speed after a fall through all gaps, and the
    largest speeds of driven and thermal walls. Pendula add Ω times the largest difference of their displacements.
    """
    v = scene.velocity if isinstance(scene, Scene) else checked(scene).velocity
    # overlaps do not add to the height of fall
    reach = float(scene.gap.clip(min=0.0).sum())
    fall = scene.gravity
    if scene.external_force is not None:
        fall = max(fall, float(np.abs(scene.closing_acceleration).max()))
    speed = float(v.max() - v.min()) + math.sqrt(2.0 * fall * reach)
    if scene.pendulum > 0.0:
        speed += scene.pendulum * float(np.ptp(scene.displacement))
    if scene.heated:
        ends = zip(scene.thermal_walls, scene.mass[[1, -2]].tolist(), strict=True)
        speed += sum(wall.fastest(mass) for wall, mass in ends if wall)
    return speed + sum(map(max_wall_speed, scene.motions)) if scene.driven else speed


def in_order(scene: Scene) -> Scene:
    """Return `scene` if no pair overlaps by more than the sum of its radii.

    The centres of such a pair would be in the wrong order, and `ValueError` is raised. Pairs of point particles are not
    checked.
    """
    reach = sum(checked(scene).sides(scene.radius))
    check.every("gap", scene.gap, (scene.gap >= -reach * (1.0 + 1e-12)) | (reach == 0.0),
                 "at least minus the sum of both radii",
                "Deeper overlaps would exchange the centres.")
    return scene


def cached_in_scene(function: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """Decorate a function of a scene, so that each scene stores its result.

    This saves time for scenes with at most `SMALL_RECORD_COUNT` bodies. For larger scenes nothing is stored.
    """
    name = f"_{function.__name__}"

    @wraps(function)
    def with_cache(scene: Scene) -> Any:
        # the dictionary of a frozen dataclass can still be written
        stored = vars(scene) if scene.n <= SMALL_RECORD_COUNT else {}
        if name not in stored:
            stored[name] = function(scene)
        return stored[name]

    return with_cache


def checked(scene: Any) -> Scene:
    """Return `scene` if it is a `Scene`, else raise `TypeError`."""
    if not isinstance(scene, Scene):
        raise TypeError(check.misuse("scene", scene, "a granular.Scene, such as granular.scenes.three_balls()"))
    return scene


MAX_LENGTH_ERROR = 2.0**-26
"""Maximum accepted error of the sum of gaps, relative to its terms.

See `invalid_reason`. It corresponds to half of the digits of a float. Rounding errors are much smaller, errors of
invalid states much larger.
"""


def invalid_reason(
    scene: Scene, start: float, elapsed: Array, gap: Array, position: Array, velocity: Array, hard: bool, adds_up: bool
) -> str:
    """Return the reason why a state is invalid, or "" if it is valid.

    All numbers must be finite. Gaps of hard spheres must not be negative. Between two walls and on a ring, the sum of
    the gaps must equal its initial value plus the increase of the distance between the walls.

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
        Whether to check the sum of the gaps.
    """
    # the sums are finite only if all entries are
    if not math.isfinite(float(position.sum()) + float(velocity.sum())):
        return "a position or a velocity is not a finite number"
    if hard and gap.min() < 0.0:
        return f"gap {gap.argmin()} is {gap.min():.6g} m"
    if not adds_up or (not scene.ring and not (scene.is_wall[0] and scene.is_wall[-1])):
        return ""
    # a ring has no walls, so its length is constant
    lower_wall, upper_wall = (0.0, 0.0) if scene.ring else (
        float((scene.velocity[wall] * elapsed + scene._moved(wall, elapsed, start)[0])[0]) for wall in (0, scene.n - 1))
    gap_sum, expected_sum = float(gap.sum()), float(scene.gap.sum()) + (upper_wall - lower_wall)
    # the rounding error of the sum is proportional to the lengths in it; initially they are all 0 if points touch
    lengths = np.abs(scene.gap).sum() + np.abs(gap).sum() + 2.0 * scene.radius.sum()
    length_scale = float(lengths) + abs(lower_wall) + abs(upper_wall)
    return "" if abs(gap_sum - expected_sum) <= MAX_LENGTH_ERROR * length_scale else (
        f"gaps add up to {gap_sum:.12g} m instead of {expected_sum:.12g} m")


def endless_reason(scene: Scene, soft: bool) -> str:
    """Return the reason why contacts of elastic balls never end, or "" if unproved.

    The walls must have constant velocities. There are two cases. The gap of a pair accelerates towards contact: it
    cannot stay open, and elastic balls do not come to rest. Between two walls of the same velocity and without forces,
    the kinetic energy relative to the walls is conserved. The reason is a phrase such as "of elastic balls between
    walls".

    Parameters
    ----------
    soft : bool
        Whether the balls are soft spheres. Those that touch at rest sink under their load, and vibrate forever.
    """
    walls, pull, rate = scene.is_wall[[0, -1]], scene.closing_acceleration, scene.across(scene.velocity)
    has_two_walls = bool(walls.all())
    if has_two_walls and scene.velocity[0] > scene.velocity[-1]:
        return ""  # walls that meet end the run
    moves = (scene.gap > 0.0) | ((scene.gap == 0.0) & (soft | (rate != 0.0)))
    # more than the rounding of forces f = m g
    returns = moves & (pull > 2.0**-50 * max(scene.gravity, float(np.abs(scene.lift).max())))
    if returns.any():
        at_wall = (walls[0] and returns[0]) or (walls[1] and returns[-1])
        return "of elastic balls that " + ("fall back to a wall" if at_wall else "forces press together")
    conserves_energy = has_two_walls and scene.velocity[0] == scene.velocity[-1] and not scene.fall.any()
    # overlaps that walls hold closed can vibrate without ever opening
    return "of elastic balls between walls" if conserves_energy and rate.any() and scene.gap.sum() >= 0.0 else ""


def with_fitted_walls(scene: Scene, t_start: float, t_end: float) -> Scene:
    """Return `scene` with each wall `Motion` replaced by polynomials (`Panels`).

    The polynomials cover a run from `t_start` to `t_end` (s). Other motions are kept. `ValueError` is raised if the
    path of a wall does not cover this interval, or if its polynomials do not converge.
    """
    if not scene.driven:
        return scene
    motions = [fitted_motion(motion, t_start, t_end) for motion in scene.motions]
    floor, ceiling = (heat if path is None else path for path, heat in zip(motions, scene.thermal_walls, strict=True))
    return scene.replace(floor=floor, ceiling=ceiling)


def driven_walls(scene: Scene, t_start: float, *, still: bool = True) -> list[tuple[int, Any, Any]]:
    """Return the body and the kernel records of each driven wall.

    Parameters
    ----------
    scene : Scene
        Scene that was prepared by `with_fitted_walls`.
    t_start : float
        Time of the scene in s.
    still : bool
        Whether to include driven walls that never move.

    Returns
    -------
    list of (int, array, array)
        Number of the body, its record of `WALL_DTYPE` in an array, and its records of `PANEL_DTYPE`. Panels are
        numbered consecutively over all walls.
    """
    walls, first = list[tuple[int, Any, Any]](), 0
    for body, side, motion in zip((0, scene.n - 1), (1.0, -1.0), scene.motions, strict=True):
        if motion is not None and (still or max_wall_speed(motion) > 0.0):
            at_start = {"start": float(scene.position[body]), "velocity": float(scene.velocity[body])}
            panels = motion.panels(t_start, t_start)
            walls.append((body, *panels.records(side, **at_start, t_start=t_start, first=first)))
            first += len(walls[-1][2])
    return walls


CLOSING_MARGIN = 2.0**-30
"""Fraction of the initial free length at which two approaching walls meet.

The rounding error of the sum of gaps is similar, if hard balls bounce between the walls at 2/(1 - ε) times their speed.
"""


class WallMeeting:
    """Time at which two approaching walls meet, with no free length between them.

    For walls at constant velocity it is computed immediately. For driven walls, `search_until` searches step by step.

    Parameters
    ----------
    scene : Scene
        Scene with the walls, prepared by `with_fitted_walls` if they are driven.
    start : float
        Time of the scene in s.
    flattened : bool
        Whether balls can be compressed to zero radius. Then the free length is the distance between the walls, else the
        sum of the gaps. Walls whose free length is negative at the start are not checked. Defaults to False.

    Attributes
    ----------
    after : float
        Time in s from the start until the walls meet. It is inf if they never meet, or not within the time searched.
    horizon : float
        Time in s at which a run of hard balls must end, slightly before the free length is 0. It is inf if `after` is.
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
        """Store the data of driven walls that `search_until` needs.

        These are the paths of the walls, the bound of their closing acceleration (m/s²) and the times of their velocity
        jumps (s from the start). `looked` is set to the earliest time at which the walls could meet. `driven` is the
        result of `driven_walls`.
        """
        _, walls, panels = zip(*driven, strict=True)
        self.walls, self.panels = plain(np.concatenate(walls)), plain(np.concatenate(panels))
        self.max_acceleration = float(sum(wall["stiff"][0] for wall in walls))
        jumps = np.unique(np.concatenate([rows["left"][rows["jump"] != 0.0] for rows in panels]))
        # in s from the start, rounded up so that the time is certainly not before the jump
        self.jumps = (jumps - self.start) + 2.0**-50 * (abs(self.start) + np.abs(jumps))
        # m(t) - m(t_start) is at most twice the largest |m|
        min_distance = self.room - 2.0 * float(sum(wall["extent"][0] for wall in walls))
        self.looked = 0.0 if min_distance <= 0.0 else min_distance / self.speed if self.speed > 0.0 else math.inf

    def search_until(self, time: float) -> float:
        """Search for the meeting of driven walls up to `time` in s, and return `horizon`.

        No step goes beyond the meeting. If `time` is inf, only the start is checked.
        """
        # without an end time only the start is checked
        until = time - self.start if time < math.inf else 0.0
        while self.looked <= until and self.horizon == math.inf:
            gap, rate = self._at(self.looked)
            if gap <= CLOSING_MARGIN * self.room and rate <= 0.0:
                self.after, self.horizon = self.looked, self.start + self.looked
                break
            # the bound of the acceleration excludes an earlier meeting; half of the margin keeps the step positive
            safe_time = self.looked + time_to_contact(
                max(0.0, gap - 0.5 * CLOSING_MARGIN * self.room), rate, self.max_acceleration)
            later_jumps = self.jumps[np.searchsorted(self.jumps, self.looked, side="right") :]  # where the rate changes
            next_time = min(safe_time, float(later_jumps[:1].min(initial=math.inf)))
            # at least one float forward, so that the loop ends
            self.looked = max(next_time, math.nextafter(self.looked, math.inf))
        return self.horizon

    def refuse(self, time: float, end: float) -> None:
        """Raise `ValueError` if the walls meet at or before `time` in s.

        `end` is the end time of the run in s, for the message.
        """
        self.search_until(time)
        if self.start + self.after <= time and self.after < math.inf:
            raise ValueError(f"`t_end` must be before the walls meet at t = {self.start + self.after:.12g} s, got "
                             f"{None if end == math.inf else end!r}.")

    def _at(self, elapsed: float) -> tuple[float, float]:
        """Return the free length (m) and its rate (m/s), `elapsed` s after the start."""
        gap, rate = self.room - self.speed * elapsed, -self.speed
        for wall in self.walls:
            m, v, _ = moved(wall, self.panels, self.start, elapsed)
            gap, rate = gap - (m - wall.origin), rate - v
        return gap, rate
