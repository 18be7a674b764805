"""The state of a run: all that is needed to go on with it, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.edmd.motion import Bodies, Floats, Ints, rebase
from granular.scene import Scene

COUNTS = ("hits", "streak", "tally")


@dataclass
class State:
    """Bodies, pairs, clock and counters of a run in progress.

    The time is ``epoch + epoch_low + tau``: the epoch is kept in two parts and moved on in windows of a fixed length,
    a power of two, so that late times cost no digits. Per-body and per-pair entries are lists (plain engine) or
    arrays (compiled engine).
    """

    # per body
    u: Floats  # free-fall velocity of the epoch, m/s
    falls: Floats  # 1 falls; 0 a wall, or a ball that rests on a wall
    noise: Floats  # (m/s)², square of what rounding may have left in u
    # per pair
    gap: Floats  # m, at time `at`
    at: Floats  # s, since the epoch
    pull: Floats  # m/s²
    hits: Ints  # collisions so far
    last: Floats  # s, time of the last collision
    streak: Ints  # how often a collision in a row looked like a collapse
    # clock and scales
    start: float  # s, time of the first row
    epoch: float
    epoch_low: float
    length: float  # m, the mean gap at the start
    window: float  # s, a power of two; grows as the balls slow down
    speed: float  # m/s, scale of the relative velocities
    fall: float  # m/s, what falling through the mean gap gives: `speed` never gets smaller
    short: float  # s, an interval that looks like a collapse
    now: float  # s, tau of the last event
    # counters
    tally: Ints  # gaps clamped at 0, collisions merged, rates lost to rounding
    events: int = 0
    rebases: int = 0
    zooms: int = 0
    zoomed: int = 0
    allowance: int = 20_000  # events of a closer look without a decision; doubled after each such

    @classmethod
    def of(cls, scene: Scene, t_start: float) -> State:
        """Return the state at the start of a run of `scene`."""
        pairs = scene.n - 1
        speed, fall, length = scales(scene)
        window = span(length, speed, felt_gravity(scene))
        return cls(
            u=scene.velocity.tolist(),
            falls=np.where(scene.is_wall, 0.0, 1.0).tolist(),
            noise=[0.0] * scene.n,
            gap=scene.gap.tolist(),
            at=[0.0] * pairs,
            pull=scene.pull.tolist(),
            hits=[0] * pairs,
            last=[-math.inf] * pairs,
            streak=[0] * pairs,
            start=t_start,
            epoch=t_start,
            epoch_low=0.0,
            length=length,
            window=window,
            speed=speed,
            fall=fall,
            short=math.ldexp(window, -30),
            now=0.0,
            tally=[0, 0, 0],
        )

    @classmethod
    def restored(cls, saved: Mapping[str, Any]) -> State:
        """Return the state that `checkpoint` saved."""
        return cls(**{f.name: np.asarray(saved[f.name]).tolist() for f in fields(cls)})

    def checkpoint(self) -> dict[str, Any]:
        """Return a copy of everything as arrays and numbers, for `Trajectory.state`."""
        raw = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: value if isinstance(value, (int, float)) else np.array(value) for name, value in raw.items()}

    def to_arrays(self) -> None:
        """Turn all lists into arrays."""
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, list):
                setattr(self, f.name, np.array(value, dtype=np.int64 if f.name in COUNTS else np.float64))

    def bodies(self) -> Bodies:
        """Return what a collision changes."""
        return self.u, self.falls, self.gap, self.at, self.pull, self.hits, self.last, self.streak, self.noise

    def watch(self, may_collapse: bool) -> tuple[float, float]:
        """Return the speed (m/s) and the interval (s) below which a collision looks like part of a collapse."""
        return (math.ldexp(self.speed, -16), self.short) if may_collapse else (-1.0, -1.0)

    def time(self, tau: float) -> float:
        """Return the time in s that is `tau` after the epoch."""
        return self.epoch + (self.epoch_low + tau)

    def tau(self, time: float) -> float:
        """Return how long after the epoch `time` is."""
        return (time - self.epoch) - self.epoch_low

    def shift_to(self, tau: float, gravity: float, compiler: Callable[[Any], Any]) -> None:
        """Move the epoch on by whole windows, so that `tau` comes to lie in the first one."""
        shift = tau - math.fmod(tau, self.window)
        self.tally[0] += compiler(rebase)(
            shift, gravity, self.u, self.falls, self.gap, self.at, self.pull, self.last, self.noise
        )
        total = self.epoch + shift
        back = total - self.epoch
        self.epoch_low += (self.epoch - (total - back)) + (shift - back)
        self.epoch = total
        self.now -= shift
        self.rebases += 1
        self.speed = max(compiler(largest_rate)(self.u), self.fall)
        if self.speed > 0.0:
            self.window = max(self.window, span(self.length, self.speed, gravity))


def felt_gravity(scene: Scene) -> float:
    """Return gravity (m/s²) in the frame of a run: without a wall that frame falls too, and velocities keep digits."""
    return scene.gravity if scene.is_wall.any() else 0.0


def scales(scene: Scene) -> tuple[float, float, float]:
    """Return the speed scale (m/s), the speed of falling through the mean gap, and the mean gap (m) of a scene."""
    length = float(np.mean(scene.gap)) or float(np.mean(scene.radius))
    fall = math.sqrt(2.0 * felt_gravity(scene) * length)
    return max(float(np.abs(np.diff(scene.velocity)).max()), fall), fall, length


def span(length: float, speed: float, g: float) -> float:
    """Return the window (s): the power of two near 64 times the mean time to cross a gap, less if gravity is strong.

    Then it is the time in which gravity doubles the speed. A power of two keeps the bits of a scene scaled by powers
    of two.
    """
    if speed == 0.0:
        return 1.0
    window = 64.0 * length / speed if length > 0.0 else speed / g if g > 0.0 else 1.0
    if g > 0.0:
        window = min(window, speed / g)
    return math.ldexp(1.0, math.frexp(window)[1])


@kernel
def largest_rate(u: Floats) -> float:
    """Return the largest relative velocity of neighbours (m/s)."""
    largest = 0.0
    for c in range(len(u) - 1):
        largest = max(largest, abs(u[c + 1] - u[c]))
    return largest
