"""State of a hard-sphere run: all data needed to continue it bitwise identically.

`granular.edmd.checkpoint` saves and restores a state. For epoch, tau, window and slice see `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.records import SMALL_RECORD_COUNT, Record, Records, column, copied, one, plain_class, selected
from granular.edmd import hanging, wall_state
from granular.edmd.epoch import rebase, window_length
from granular.edmd.physics import TIE_ORDERS, Physics, frame_gravity, frame_velocity, mass_fractions, scales
from granular.edmd.records import (
    CLOCK_FIELDS,
    FORCED_RECORDS,
    NEVER,
    PENDULUM_RECORDS,
    PLAIN_RECORDS,
    RUN_FIELDS,
    Walls,
)
from granular.scene import Scene
from granular.scene.places import cached_in_scene

RUN_NUMBER_NAMES = (*(RUN_FIELDS.names or ()), *(CLOCK_FIELDS.names or ()))
ZERO_RECORDS = {kind: np.zeros((), kind).item() for kind in (RUN_FIELDS, CLOCK_FIELDS)}
RUN_READER, CLOCK_READER = attrgetter(*(RUN_FIELDS.names or ())), attrgetter(*(CLOCK_FIELDS.names or ()))
"""Functions that read all numbers of a run, or of its clock, from an object."""
FIRST_ALLOWANCE = 20_000
"""Collisions in relative coordinates after which an undecided first attempt ends."""
SHORT_BITS, SLOW_BITS = -30, -16
"""Binary exponents of the limits below which a collision looks like a collapse.

`SHORT_BITS` gives the limit of the time between two collisions, relative to the window at the start. `SLOW_BITS` gives
the limit of the approach speed, relative to the scale of speeds.
"""


@dataclass
class State:
    """Records of a hard-sphere run in progress.

    The time in s is ``epoch + epoch_low + tau``, where tau is the time in the records. The epoch is stored in two
    parts, so late times keep all their digits. It is moved by whole windows. A window is a power of two in s.

    Attributes
    ----------
    run, clock : record
        Numbers of the run that kernels use (`RUN_FIELDS`), and numbers of the clock (`CLOCK_FIELDS`).
    pairs, bodies : records
        Records of all pairs and bodies, as objects or as arrays.
    near : records or None
        Gaps and rates of the slice, while a possible collapse is followed in relative coordinates. The data of these
        pairs in `pairs` and `bodies` are then outdated.
    """

    run: Record
    clock: Record
    pairs: Records
    bodies: Records
    near: Records | None = None
    ring: bool = False
    """Whether the balls are on a ring, so that the last body is a copy of the first."""
    hung: bool = False
    """Whether the balls are pendula."""
    walls: Any = None
    """Records `WALL_FIELDS` of floor and ceiling, their path panels, and the clock.

    None in scenes without forces and without driven or thermal walls.
    """

    @classmethod
    def of(cls, physics: Physics, t_start: float) -> State:
        """Return the state of the scene at the start of a run, at the time `t_start` in s."""
        scene, options, kind = physics.scene, physics.options, physics.has
        walls = wall_state.walls(scene, t_start) if "FORCED" in kind else None
        pairs, bodies = initial_records(scene)
        if len(scene.mass) <= SMALL_RECORD_COUNT:  # cached by `initial_records`
            pairs, bodies = copied(pairs), copied(bodies)
        pairs["eps"], frame = physics.eps, frame_velocity(scene)
        bodies["fall_velocity"] -= frame
        speed, fall, length, strength = scales(scene)
        tc, elastic_below, merge_below = options["tc"], options["elastic_below"], options["merge_below"]
        no_collapse = scene.driven or scene.pendulum > 0.0 or max(tc, elastic_below, merge_below) > 0.0 or (
            physics.eps.min() == 1.0)
        window = window_length(length, speed, strength)
        run = _new_record(
            RUN_FIELDS, pairs=len(pairs), gravity=frame_gravity(scene), tc=tc, elastic_below=elastic_below,
            merge_below=merge_below, order=TIE_ORDERS[options["ties"]], seed=options["seed"] & 0x7FFFFFFF,
            short=math.ldexp(window, SHORT_BITS), stop_pair=NEVER, suspect=-1,  # -1: no pair has collided
            allowance=FIRST_ALLOWANCE, slow=-1.0 if no_collapse else math.ldexp(speed, SLOW_BITS),  # -1: none is slow
        )
        clock = _new_record(CLOCK_FIELDS, frame=frame, start=t_start, epoch=t_start, goal=-math.inf, strength=strength,
                       length=length, window=window, speed=speed, fall=fall)
        state = cls(run, clock, pairs, bodies, ring=scene.ring, hung="HUNG" in kind,
                    walls=walls and Walls(*walls, clock))
        if state.walls is not None:
            wall_state.begin(state, scene)
        if state.hung:
            hanging.begin_pendula(pairs, bodies, scene)
        if scene.ring or (state.hung and scene.is_wall[[0, -1]].all()):
            run.gap_sum = math.fsum(scene.gap.tolist())
        return state

    def set(self, **numbers: Any) -> None:
        """Set numbers of the run or of the clock by their names."""
        for name, value in numbers.items():
            setattr(self.run if hasattr(self.run, name) else self.clock, name, value)

    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the run and of the clock by their names."""
        run: Any = self.run.item() if isinstance(self.run, np.void) else RUN_READER(self.run)
        clock: Any = self.clock.item() if isinstance(self.clock, np.void) else CLOCK_READER(self.clock)
        return dict(zip(RUN_NUMBER_NAMES, run + clock, strict=True))

    def convert_records(self, convert: Callable[..., Any]) -> None:
        """Convert all records to the kind of records that the queue needs.

        `convert` is `plain` for objects, which interpreted code uses, or `record_array` for arrays, which compiled code
        uses. The values are bitwise identical.
        """
        self.pairs, self.bodies = convert(self.pairs), convert(self.bodies)
        self.near = self.near if self.near is None else convert(self.near)
        if isinstance(self.pairs, np.ndarray) and not isinstance(self.run, np.void):
            self.run = one(np.array([RUN_READER(self.run)], RUN_FIELDS))
            if self.walls is not None:  # with driven walls, kernels change the clock too
                self.clock = one(np.array([CLOCK_READER(self.clock)], CLOCK_FIELDS))
        if self.walls is not None:
            self.walls = Walls(convert(self.walls.sides), convert(self.walls.panels), self.clock)

    def copied(self) -> State:
        """Return a state with copies of the records of pairs, bodies and walls."""
        walls = self.walls if self.walls is None else self.walls._replace(sides=copied(self.walls.sides))
        return replace(self, pairs=copied(self.pairs), bodies=copied(self.bodies), walls=walls)

    def slices(self) -> tuple[Records, Records]:
        """Return the records of the pairs and of the bodies of the slice.

        On a ring they can be copies.
        """
        assert self.near is not None
        first, n = int(self.run.first), len(self.pairs)
        end = first + len(self.near)
        if self.ring:
            return selected(self.pairs, np.arange(first, end) % n), selected(self.bodies, np.arange(first, end + 1) % n)
        return self.pairs[first:end], self.bodies[first : end + 1]

    def write_slice(self, pairs: Records, bodies: Records) -> None:
        """Write changed records of the slice back into the state.

        Only on a ring are they copies. The motion of the first body is then also copied to the last body.
        """
        if not self.ring:
            return
        n, first = len(self.pairs), int(self.run.first)
        if isinstance(self.pairs, np.ndarray):
            self.pairs[np.arange(first, first + len(pairs)) % n] = pairs
            self.bodies[np.arange(first, first + len(bodies)) % n] = bodies
        (ball,), (seam,) = self.bodies[:1], self.bodies[n:]
        seam["fall_velocity"], seam["noise"] = ball["fall_velocity"], ball["noise"]

    def scale(self, speed: float) -> None:
        """Set the scale of speeds (m/s), and the speed limit of a suspected collapse.

        The limit is unchanged if no collapse is possible in the scene.
        """
        self.clock.speed = speed
        if self.run["slow"] >= 0.0:
            self.run["slow"] = math.ldexp(speed, SLOW_BITS)

    def time(self, tau: Any) -> Any:
        """Return the time in s that corresponds to `tau`, the time since the epoch in s."""
        return self.clock.epoch + (self.clock.epoch_low + tau)

    def tau(self, time: float) -> float:
        """Return the time since the epoch in s that corresponds to `time` in s."""
        return float((time - self.clock.epoch) - self.clock.epoch_low)

    def elapsed(self, tau: Any) -> Any:
        """Return the time in s from the start of the run to `tau` (s since the epoch).

        It keeps all its digits, however late the start of the run is.
        """
        return ((self.clock.epoch - self.clock.start) + self.clock.epoch_low) + tau

    def shift_to(
        self, tau: float, compiler: Callable[[Any], Any], whole: bool = True, shrink: float = 1.0
    ) -> None:
        """Move the epoch forward so that `tau` lies in the window after the new epoch.

        By default the epoch is moved by whole windows. If `whole` is False, it is moved to `tau` itself. `compiler`
        turns a kernel into its interpreted or compiled form, as the records need it.

        The window becomes longer if the balls have become slower. It becomes shorter only by the factor `shrink`, a
        power of two, with which the caller reports that the mean gap is smaller.
        """
        clock = self.clock
        clock.length, clock.window = shrink * clock.length, shrink * clock.window
        before, by = math.nan if whole else self.time(tau), tau - math.fmod(tau, clock.window) if whole else tau
        # for driven walls, this kernel does all of the following
        if self.walls is not None:
            compiler(wall_state.shift_epoch)(self.run, self.pairs, self.bodies, by, self.walls)
            return
        speed = compiler(rebase)(self.run, self.pairs, self.bodies, by, self.walls)
        total = clock.epoch + by
        # Compensated sum: `epoch_low` collects the rounding error of the epoch.
        back = total - clock.epoch
        clock.epoch_low += (clock.epoch - (total - back)) + (by - back)
        clock.epoch = total
        if not whole and self.time(0.0) < before:  # rounding must not move the clock back
            clock.epoch_low = before - total
        clock.rebases += 1
        self.run["now"] -= by
        self.scale(max(speed, clock.fall))
        if clock.speed > 0.0:
            clock.window = max(clock.window, window_length(clock.length, clock.speed, clock.strength))

    def row(self, tau: float) -> tuple[Array, Array]:
        """Return velocities (m/s) and gaps (m, never negative) at the time `tau`.

        `tau` is in s since the epoch. For pendula, the first array contains the rates of the gaps instead. The state
        is not changed.
        """
        if self.hung:
            return hanging.rates_and_gaps(self.pairs, tau)
        g, (u, is_free) = float(self.run["gravity"]), columns(self.bodies, "fall_velocity", "is_free")
        pulled = g > 0.0 or self.walls is not None
        gap, velocity = gaps(self.pairs, u, tau, pulled), np.array(u[:-1] if self.ring else u)
        if g > 0.0:
            velocity -= is_free * (g * tau)
        if self.walls is not None:
            wall_state.add_to_sample(self, tau, velocity, gap)
        return velocity, gap

    def is_still(self) -> bool:
        """Return whether all balls are at rest on a wall."""
        return not (column(self.bodies, "is_free").any() or np.ptp(column(self.bodies, "fall_velocity")))


@cached_in_scene
def initial_records(scene: Scene) -> tuple[Records, Records]:
    """Return the records of pairs and bodies of a scene at the start of a run.

    The restitutions of the pairs are not set.
    """
    kind, n, g = scene._flags, scene.n, frame_gravity(scene)
    of_pair, of_body = FORCED_RECORDS if "FORCED" in kind else PENDULUM_RECORDS if "HUNG" in kind else PLAIN_RECORDS
    pairs, bodies = np.zeros(len(scene.gap), of_pair), np.zeros(len(scene.gap) + 1, of_body)
    for name, value in (("fall_velocity", scene.velocity), ("is_free", ~scene.is_wall), ("mass", scene.mass)):
        bodies[name][:n] = value
    if scene.ring:
        bodies[-1] = bodies[0]
    pairs["gap"], pairs["last"] = scene.gap, -math.inf
    pairs["closing_acceleration"] = g * (bodies["is_free"][1:] - bodies["is_free"][:-1])
    pairs["low"], pairs["high"] = mass_fractions(scene)
    return pairs, bodies


def gaps(pairs: Records, u: Array, tau: float, pulled: bool) -> Array:
    """Return the gaps (m, never negative) of all pairs at `tau` (s since the epoch).

    `u` are the fall velocities of the bodies (m/s). `pulled` is False only if no gap has an acceleration.
    """
    gap_then, at, pull = columns(pairs, "gap", "at", "closing_acceleration")
    rate, dt = u[1:] - u[:-1], tau - at
    # Without accelerations these terms are 0 and only cost time.
    if pulled:
        rate -= pull * at
        rate -= 0.5 * pull * dt
    gap: Array = gap_then + dt * rate
    return np.maximum(gap, 0.0, out=gap)


def columns(records: Records, *names: str) -> Any:
    """Return several fields of all records as arrays of floats.

    The arrays are views if `records` is an array. Otherwise they are copies.
    """
    if isinstance(records, np.ndarray):
        return list(map(records.__getitem__, names))
    return np.array(list(map(attrgetter(*names), records))).T


def _new_record(kind: np.dtype[Any], **numbers: Any) -> Record:
    """Return an object with the fields of the record type `kind`.

    Fields that are not in `numbers` are 0.
    """
    record = plain_class(kind)(*ZERO_RECORDS[kind])
    for name, number in numbers.items():
        setattr(record, name, number)
    return record
