"""Class `Scene`: initial state of a simulation, with gaps instead of positions."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular._engine.check import Array, ByNumbers
from granular.scene.given import check_exclusive, checked_bodies, checked_forces, checked_positions, checked_rest_gaps
from granular.scene.pair import Pairs, body_name
from granular.scene.walls.motion import checked_motion, displacement_since
from granular.scene.walls.thermal import Thermal

GAP_INDEPENDENT = ("inverse_mass", "is_wall", "pairs", "driven", "heated", "_flags", "worked", "fed", "_wall",
                   "_mass_fraction")
"""Cached properties of `Scene` that do not depend on the gaps."""


@signature.face
@dataclass(frozen=True, eq=False)
class Scene(ByNumbers):
    """Balls on a line at one instant, numbered bottom to top (left to right).

    The coordinate x grows upwards.

    Parameters
    ----------
    mass : (n,) array
        Masses in kg, all positive. ``inf`` makes a body a wall (floor, ceiling). Only the first and the
        last body can be walls. A wall does not fall and can move at constant speed.
    radius : (n,) array
        Radii in m. The radius of a wall is 0 (flat, no offset). A ball of radius 0 is a point particle.
    gap : (n-1,) array, (n,) on a ring
        Distances between the surfaces of neighbours in m. A negative gap is an initial overlap, which
        `granular.md` accepts and `granular.edmd` rejects.
    velocity : (n,) array
        Velocities in m/s, upwards positive.
    gravity : float
        Acceleration g ≥ 0 in m/s², directed downwards (towards smaller x). Defaults to 0.
    origin : float
        Position of body 0 in m: the centre of a ball or the surface of a wall. Defaults to 0.
    external_force : (n,) array, optional
        Constant forces in N on the balls, upwards positive, 0 for a wall. Stored as None if all are 0.
    floor, ceiling : granular.walls.Sine, Piecewise, Motion or Thermal, optional
        Behaviour of the first and the last body, if they are walls. By default they move at their constant velocity v.
        A `Sine`, `Piecewise` or `Motion` m(t) is added: x_w(t) = start + v·(t - t_start) + m(t) - m(t_start).
        Here start is the position of the wall according to `origin` and the gaps.
        A `Thermal` wall gives every ball that hits it a random speed.
    ring : bool
        Whether the line is closed. Then pair n-1 joins the last ball and ball 0, and walls and gravity are not allowed.
        Positions are unwrapped, not taken modulo the length. Defaults to False.
    pendulum : float
        Angular frequency Ω ≥ 0 in rad/s of all balls, which hang as pendula: ÿ = -Ω² y for small displacements y from
        their rest positions, Ω² = g/l. Then gravity must be 0. Body 0 rests at x = 0, and `origin` is its displacement.
        Defaults to 0, without pendula.
    rest_gap : (n-1,) array, optional
        Distances d ≥ 0 in m between the surfaces of neighbouring pendula at rest, or of a wall and a pendulum at rest.
        Defaults to 0. Stored as zeros if there are pendula, else as None.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid. The message gives its name, its value and the requirement.

    Notes
    -----
    The state consists of gaps instead of positions: a gap of 1e-4 m at a height of 1 m would lose four digits as a
    difference of positions. Two scenes are equal, and have the same hash, if all their numbers are equal.
    """

    mass: Array
    radius: Array
    gap: Array
    velocity: Array
    gravity: float = 0.0
    origin: float = 0.0
    external_force: Array | None = None
    floor: Any = None
    ceiling: Any = None
    ring: bool = False
    pendulum: float = 0.0
    rest_gap: Array | None = None

    def __init__(
        self, mass: ArrayLike, radius: ArrayLike, gap: ArrayLike, velocity: ArrayLike, gravity: float = 0.0,
        origin: float = 0.0, *, external_force: ArrayLike | None = None, floor: Any = None, ceiling: Any = None,
        ring: bool = False, pendulum: float = 0.0, rest_gap: ArrayLike | None = None,
    ) -> None:
        self.__dict__.update(checked_bodies(mass, radius, gap, velocity, ring))
        walls = np.isinf(self.mass)
        self.__dict__.update(
            gravity=check.number("gravity", gravity, at_least=0.0, fix="It always points downwards."),
            origin=check.number("origin", origin), external_force=checked_forces(external_force, walls),
            floor=checked_motion("floor", floor, bool(walls[0])),
            ceiling=checked_motion("ceiling", ceiling, bool(walls[-1])),
            pendulum=check.number("pendulum", pendulum, at_least=0.0),
        )
        self.__dict__["rest_gap"] = checked_rest_gaps(rest_gap, self.pendulum, len(walls))
        check_exclusive(self, walls)

    @classmethod
    def from_positions(
        cls, mass: ArrayLike, radius: ArrayLike, position: ArrayLike, velocity: ArrayLike, gravity: float = 0.0, *,
        external_force: ArrayLike | None = None, floor: Any = None, ceiling: Any = None, length: float | None = None,
        pendulum: float = 0.0, rest_gap: ArrayLike | None = None,
    ) -> Scene:
        """Create a scene from positions instead of gaps.

        Each gap is the difference of two positions minus the radii. Its rounding error is about 1e-16 of the largest
        position.

        Parameters
        ----------
        position : (n,) array
            Centres of balls and surfaces of walls in m, bottom to top.
        length : float, optional
            Circumference in m of a ring. By default the line is not closed.
        mass, radius, velocity, gravity, external_force, floor, ceiling, pendulum, rest_gap
            See `Scene`.

        Returns
        -------
        Scene
        """
        m, r, x, gap = checked_positions(mass, radius, position, length)
        return cls(m, r, gap, velocity, gravity, float(x[0]) if len(x) else 0.0,
                   external_force=external_force, floor=floor, ceiling=ceiling, ring=length is not None,
                   pendulum=pendulum, rest_gap=rest_gap)

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed.

        All fields are checked again.
        """
        return Scene(**({f.name: getattr(self, f.name) for f in fields(self)} | changes))

    def _with_valid_gaps(self, gap: Array) -> Scene:
        """Return a copy with other gaps, without checking them.

        The copy keeps cached properties that do not depend on the gaps.
        """
        copy, values = object.__new__(type(self)), vars(self)
        kept = [name for name in (*self.__dataclass_fields__, *GAP_INDEPENDENT) if name in values]
        vars(copy).update({name: values[name] for name in kept}, gap=gap)
        gap.flags.writeable = False
        return copy

    @property
    def n(self) -> int:
        """Number of bodies, including walls."""
        return len(self.mass)

    @cached_property
    def inverse_mass(self) -> Array:
        """Inverse masses 1/m in 1/kg, shape (n,), 0 for a wall."""
        # a subnormal mass has no finite inverse
        with np.errstate(over="ignore"):
            return 1.0 / self.mass

    @cached_property
    def is_wall(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """True for bodies of infinite mass, shape (n,)."""
        return np.isinf(self.mass)

    @property
    def n_pairs(self) -> int:
        """Number of pairs of neighbours."""
        return len(self.gap)

    def bodies(self, pair: Any) -> tuple[Any, Any]:
        """Return the numbers of the lower and the upper body of a pair.

        `pair` can be an array. On a ring the upper body of the last pair is ball 0.
        """
        return pair, (pair + 1) % len(self.mass)

    def sides(self, of_bodies: Any) -> tuple[Any, Any]:
        """Return the values of the lower and of the upper body of every pair.

        Parameters
        ----------
        of_bodies : (…, n) array
            One value per body.

        Returns
        -------
        lower, upper : arrays
            One value per pair, with the shape of the gaps.
        """
        return (of_bodies, np.roll(of_bodies, -1, axis=-1)) if self.ring else (of_bodies[..., :-1], of_bodies[..., 1:])

    def across(self, of_bodies: Array) -> Array:
        """Return the differences of values, upper minus lower body of every pair.

        `of_bodies` has one value per body, shape (…, n). Velocities give the rates of the gaps.
        """
        lower, upper = self.sides(of_bodies)
        return np.asarray(upper - lower)

    @property
    def neighbours(self) -> tuple[Any, Any]:
        """Numbers of the lower and the upper pair of every ball that has two pairs.

        Two int arrays. On a ring of two balls, pairs 0 and 1 share both balls and occur twice, as (0, 1) and (1, 0).
        """
        number = np.arange(self.n_pairs)
        return (number, np.roll(number, -1)) if self.ring else (number[:-1], number[1:])

    @cached_property
    def pairs(self) -> Pairs:
        """All pairs of neighbours, bottom to top."""
        ends = body_name(self, 0), body_name(self, 0 if self.ring else self.n - 1)
        return Pairs.between(self.sides(self.mass), self.sides(np.where(self.is_wall, math.inf, self.radius)), ends)

    @property
    def motions(self) -> tuple[Any, Any]:
        """Motions m(t) of floor and ceiling, which are added to their constant velocities.

        An entry is None for a ball, for a thermal wall and for a wall at constant velocity.
        """
        return self._ends(thermal=False)

    @property
    def thermal_walls(self) -> tuple[Any, Any]:
        """`Thermal` objects of floor and ceiling.

        An entry is None if that body is not a thermal wall.
        """
        return self._ends(thermal=True)

    def _ends(self, thermal: bool) -> tuple[Any, Any]:
        floor, ceiling = (wall if wall and isinstance(wall, Thermal) is thermal else None
                          for wall in (self.floor, self.ceiling))
        return floor, ceiling

    @cached_property
    def driven(self) -> bool:
        """Whether a wall moves at a velocity that is not constant."""
        return self.motions != (None, None)

    @cached_property
    def heated(self) -> bool:
        """Whether a wall is thermal."""
        return self.thermal_walls != (None, None)

    @cached_property
    def _flags(self) -> dict[str, bool]:
        """Flags of `granular._engine.kernels` that are true, as {name: True}."""
        worked = self.driven or self.heated
        flags = {"DRIVEN": self.driven, "HEATED": self.heated, "WORKED": worked, "HUNG": self.pendulum > 0.0,
                 "FORCED": worked or self.external_force is not None, "RING": self.ring}
        return {name: True for name, is_true in flags.items() if is_true}

    @property
    def endless(self) -> bool:
        """Whether contacts can continue forever.

        This is possible with a driven or thermal wall, on a ring, and for pendula.
        """
        return self.driven or self.heated or self.ring or self.pendulum > 0.0

    @cached_property
    def worked(self) -> bool:
        """Whether a wall moves, also at constant velocity, and thus does work."""
        return self.driven or bool((self.is_wall & (self.velocity != 0.0)).any())

    @cached_property
    def fed(self) -> bool:
        """Whether a wall moves or is thermal, and thus exchanges energy with the balls."""
        return self.worked or self.heated

    def free_velocity(self, elapsed: float) -> Array:
        """Return velocities in m/s, shape (n,), after `elapsed` s without contacts.

        Walls keep their constant velocity. The motion of a driven wall is not included.
        """
        if self.pendulum == 0.0:
            return np.asarray(self.velocity + self.fall * elapsed)
        angle = self.pendulum * elapsed
        return np.asarray(self.velocity * math.cos(angle) - self.pendulum * self.displacement * math.sin(angle))

    @property
    def fall(self) -> Array:
        """Acceleration of every body by gravity and external forces in m/s², shape (n,).

        Upwards is positive. The value is 0 for a wall.
        """
        fall = np.where(self.is_wall, 0.0, -self.gravity)
        return fall if self.external_force is None else fall + self.lift

    @property
    def lift(self) -> Array:
        """Acceleration f/m of every body by external forces in m/s², shape (n,).

        Upwards is positive. Accelerations of neighbours that differ only by rounding are set equal. Forces f = -m g
        therefore give all balls exactly the same acceleration, as gravity g does.
        """
        lift = np.zeros(self.n) if self.external_force is None else self.external_force * self.inverse_mass
        # 2⁻⁵⁰ exceeds the rounding of f = m g and of f/m
        differs = np.append(True, np.abs(np.diff(lift)) > 2.0**-50 * np.abs(lift[1:]))
        return np.asarray(lift[differs][np.cumsum(differs) - 1])

    @property
    def closing_acceleration(self) -> Array:
        """Closing acceleration of each gap in free flight in m/s², shape of the gaps.

        A positive value closes the gap. It is g at a floor, -g at a ceiling and 0 between two balls, where uniform
        gravity cancels. External forces add f_c/m_c - f_(c+1)/m_(c+1). The accelerations of driven walls and the term
        Ω² (gap - d) of pendula are not included.
        """
        pull = self.gravity * self.across(np.where(self.is_wall, 0.0, 1.0))
        return pull if self.external_force is None else pull - self.across(self.lift)

    @property
    def position(self) -> Array:
        """Positions in m, shape (n,): centres of balls, surfaces of walls."""
        return np.asarray(self.origin + self.offsets(self.gap))

    def offsets(self, gap: Array) -> Array:
        """Return the distances (…, n) in m of all bodies from body 0.

        Distances are measured between centres of balls and surfaces of walls.

        Parameters
        ----------
        gap : (…, n-1) array, (…, n) on a ring
            Gaps in m. The last gap of a ring is ignored, because it closes the ring.
        """
        out = np.zeros((*gap.shape[:-1], self.n))
        # in place: this is called with one row per recorded state
        steps = np.add(self.radius[:-1], gap[..., : self.n - 1], out=out[..., 1:])
        steps += self.radius[1:]
        steps.cumsum(axis=-1, out=steps)
        return out

    def anchor(self, elapsed: Any, start: float = 0.0) -> Any:
        """Return the position in m of the anchor, from which positions are measured.

        The anchor is the first wall. Without a wall it is the centre of mass, whose motion does not depend on contacts.

        Parameters
        ----------
        elapsed : float or array
            Time in s after the instant of the scene.
        start : float
            Time of the scene in s, at which the motion of a driven wall begins. Defaults to 0.
        """
        if (wall := self._wall) is not None:
            return self._anchor_wall_position + self.velocity[wall] * elapsed + self._moved(wall, elapsed, start)[0]
        speed = self._mass_fraction @ self.velocity
        if self.pendulum > 0.0:
            angle, rest = self.pendulum * elapsed, self._mass_fraction @ self.at_rest
            displacement = self._mass_fraction @ self.displacement
            return rest + (displacement * np.cos(angle) + speed / self.pendulum * np.sin(angle))
        return (self._mass_fraction * self.position).sum() + (speed + 0.5 * self._fall * elapsed) * elapsed

    def anchor_velocity(self, elapsed: Any, start: float = 0.0) -> Any:
        """Return the velocity of the anchor in m/s. The parameters are as in `anchor`."""
        if self._wall is not None:
            return self.velocity[self._wall] + self._moved(self._wall, elapsed, start)[1]
        speed = (self._mass_fraction * self.velocity).sum()
        if self.pendulum > 0.0:
            angle, displacement = self.pendulum * elapsed, self._mass_fraction @ self.displacement
            return speed * np.cos(angle) - displacement * self.pendulum * np.sin(angle)
        return speed + self._fall * elapsed

    @property
    def at_rest(self) -> Array:
        """Rest positions of pendula in m, shape (n,).

        They are measured from the position of the wall. Without a wall, body 0 rests at 0.
        """
        rest = self.offsets(np.zeros(self.n_pairs) if self.rest_gap is None else self.rest_gap)
        return rest if self._wall is None else rest + (self.position[self._wall] - rest[self._wall])

    @property
    def displacement(self) -> Array:
        """Displacements y (m) of pendula from rest positions, shape (n,), 0 for a wall."""
        from_first = cumulative_sums((self.gap - (0.0 if self.rest_gap is None else self.rest_gap))[: self.n - 1])
        start = self.origin if self._wall is None else -from_first[self._wall]
        return np.where(self.is_wall, 0.0, start + from_first)

    def _moved(self, wall: int, elapsed: Any, start: float) -> tuple[Any, Any]:
        """Return m(t) - m(start) in m and m'(t) in m/s of the motion m of body `wall`.

        The time t is `elapsed` s after `start`. Both values are 0 for a wall that is not driven.
        """
        return displacement_since(self.motions[wall == self.n - 1], start, elapsed) if self.driven else (0.0, 0.0)

    @property
    def _fall(self) -> float:
        """Upward acceleration of the centre of mass in m/s², for a scene without walls."""
        if self.external_force is None:
            return -self.gravity
        return float(self.external_force.sum() / self.mass.sum()) - self.gravity

    @cached_property
    def _wall(self) -> int | None:
        """Number of the first wall, or None without walls.

        Positions and velocities are computed from the motion of this wall, see `anchor`.
        """
        return int(self.is_wall.argmax()) if self.is_wall.any() else None

    @cached_property
    def _anchor_wall_position(self) -> float:
        """Position in m of the first wall at the instant of the scene."""
        return float(self.position[self._wall])

    @cached_property
    def _mass_fraction(self) -> Array:
        """Fraction of the total mass of each body, shape (n,), for a scene without walls."""
        return np.asarray(self.mass / self.mass.sum())

    def momentum(self) -> float:
        """Return the total momentum of the balls in kg m/s."""
        return float(self.mass[~self.is_wall] @ self.velocity[~self.is_wall])

    def __repr__(self) -> str:
        from granular._engine.reports import aligned

        return f"{self}\n{aligned(self._table, indent='  ')}"

    def _repr_html_(self) -> str:
        from granular._engine.reports import html

        return html(str(self), self._table)

    @property
    def _table(self) -> Any:
        """Rows of text: a header, the bodies and their gaps above, abridged if long."""
        from granular._engine.reports import abridged_rows

        gaps = [f"{gap:.6g}" for gap in self.gap.tolist()] + [""] * (self.n - self.n_pairs)
        bodies = zip(self.mass.tolist(), self.radius.tolist(), gaps, self.velocity.tolist(), strict=True)
        rows = [[str(i), f"{m:.6g}", f"{r:.6g}", gap, f"{v:.6g}"] for i, (m, r, gap, v) in enumerate(bodies)]
        return [["body", "mass / kg", "radius / m", "gap above / m", "velocity / (m/s)"], *abridged_rows(rows)]

    def __str__(self) -> str:
        floor, ceiling = self.is_wall[[0, -1]].tolist()
        walls = ", floor and ceiling" if floor and ceiling else ", floor" * floor + ", ceiling" * ceiling
        balls = int((~self.is_wall).sum())
        pull = f", g = {self.gravity:g} m/s²" if self.gravity else ""
        special = ", ring" * self.ring + ", forces" * (self.external_force is not None) + (
            f", pendula of {self.pendulum:g} rad/s" * (self.pendulum > 0.0))
        walled = zip(("floor", "ceiling"), (self.floor, self.ceiling), strict=True)
        driven = "".join(f", {name} {wall!r}" for name, wall in walled if wall is not None)
        return f"Scene({balls} ball{'s' * (balls != 1)}{walls}{pull}{special}{driven})"


def cumulative_sums(steps: Array) -> Array:
    """Return the cumulative sums (…, n) of `steps` (…, n-1). The first sum is 0."""
    out = np.zeros((*steps.shape[:-1], steps.shape[-1] + 1))
    steps.cumsum(axis=-1, out=out[..., 1:])
    return out
