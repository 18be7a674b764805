"""The state of a run: all that is needed to go on with it, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from granular import until as conditions
from granular._check import Array
from granular._records import Record, Records, column, copied, one, packed, twin
from granular.edmd.model import Model, felt_gravity, scales, shares
from granular.edmd.motion import rebase
from granular.edmd.ties import ORDER

FloatOrArray = TypeVar("FloatOrArray", float, Array)
PAIR = np.dtype(
    [
        ("gap", float), ("at", float),  # m, at that time in s since the epoch
        ("pull", float),  # gravity's closing acceleration, m/s²
        ("hits", int), ("last", float),  # collisions so far, and the time of the last one in s
        ("streak", int),  # how often a collision in a row looked like a collapse
        ("low", float), ("high", float),  # shares of the lower and the upper body in a change of the rate
        ("eps", float),  # where rules are constant
    ],
    align=True,
)  # fmt: skip
BODY = np.dtype(
    [
        ("u", float),  # free-fall velocity of the epoch, m/s
        ("falls", float),  # 1 falls; 0 a wall, or a ball that rests on a wall
        ("noise", float),  # (m/s)², square of what rounding may have left in u
        ("mass", float),
    ],
    align=True,
)
RUN = np.dtype(
    [
        ("pairs", int), ("gravity", float), ("tc", float), ("elastic_below", float), ("merge_below", float),
        ("order", int), ("seed", int),  # of ties
        ("stop_pair", int), ("stop_hits", int),  # pause before this pair, which has collided so often, collides again
        ("slow", float), ("short", float),  # what looks like a collapse, m/s (< 0: nothing does) and s
        ("clamps", int), ("merged", int), ("lost", int),  # gaps set to 0, collisions merged, rates lost to rounding
    ],
    align=True,
)  # fmt: skip
OF_PAIRS, OF_BODIES = ("gap", "at", "pull", "hits", "last", "streak"), ("u", "falls", "noise")
"""What changes, by the names under which it is saved."""
TALLY = ("clamps", "merged", "lost")
NEVER, APART = -1, -2
"""`stop_pair` of a run that does not stop at a contact, and of one that stops when no pair approaches."""
LATER, UNTIL, BUDGET, SUSPECT, OUTSIDE, QUIET, RESTS, TINY, SPENT = range(9)
"""Why a queue or a closer look hands control back. The next event is later than asked for; it is the contact to stop
at, or all pairs recede; as many events as asked for have acted. Of a queue: the last collisions look like a collapse.
Of a closer look, for good: something outside the slice comes next; no collapse; a ball has come to rest on a wall;
rates below 2^-200 of the scale; no decision within the allowance."""


@dataclass
class State:
    """Records of bodies and pairs, clock and counters of a run in progress.

    The time is ``epoch + epoch_low + tau``: the epoch is kept in two parts and moved on in windows of a fixed length,
    a power of two, so that late times cost no digits.
    """

    run: Record
    pairs: Records
    bodies: Records
    # clock and scales
    start: float  # s, time of the first row
    epoch: float
    epoch_low: float
    length: float  # m, the mean gap at the start
    window: float  # s, a power of two; grows as the balls slow down
    speed: float  # m/s, scale of the relative velocities
    fall: float  # m/s, what falling through the mean gap gives: `speed` never gets smaller
    now: float  # s, tau of the last event
    # counters
    events: int = 0
    rebases: int = 0
    zooms: int = 0
    zoomed: int = 0
    allowance: int = 20_000  # events of a closer look without a decision; doubled after each such
    last_event: int = 0  # events at which the run ends

    @classmethod
    def of(cls, model: Model, t_start: float) -> State:
        """Return the state at the start of a run."""
        scene, g = model.scene, felt_gravity(model.scene)
        pairs, bodies = np.zeros(scene.n_pairs, PAIR), np.zeros(scene.n, BODY)
        bodies["u"], bodies["falls"], bodies["mass"] = scene.velocity, ~scene.is_wall, scene.mass
        pairs["gap"], pairs["eps"], pairs["last"] = scene.gap, model.eps, -math.inf
        pairs["pull"] = g * scene.across(bodies["falls"])
        pairs["low"], pairs["high"] = shares(scene)
        speed, fall, length = scales(scene)
        window, remedied = span(length, speed, g), max(model.tc, model.elastic_below, model.merge_below) > 0.0
        slow = -1.0 if remedied or model.eps.min() == 1.0 else math.ldexp(speed, -16)  # else no collapse is possible
        run = twin(RUN)(
            pairs=len(pairs), gravity=g, tc=model.tc, elastic_below=model.elastic_below,
            merge_below=model.merge_below, order=ORDER[model.ties], seed=model.seed & 0x7FFFFFFF, stop_pair=NEVER,
            stop_hits=0, slow=slow, short=math.ldexp(window, -30), clamps=0, merged=0, lost=0,
        )  # fmt: skip
        return cls(run, pairs, bodies, t_start, t_start, 0.0, length, window, speed, fall, 0.0)

    @classmethod
    def restored(cls, model: Model, saved: Mapping[str, Any]) -> State:
        """Return the state that `checkpoint` saved."""
        state = cls.of(model, float(saved["start"]))
        for name in OF_PAIRS:
            state.pairs[name] = saved[name]
        for name in OF_BODIES:
            state.bodies[name] = saved[name]
        for name in CLOCK:
            setattr(state, name, np.asarray(saved[name]).item())
        state.run.short = float(saved["short"])
        for name, count in zip(TALLY, saved["tally"], strict=True):
            setattr(state.run, name, int(count))
        state.scale(state.speed)
        return state

    def checkpoint(self) -> dict[str, Any]:
        """Return everything as arrays and numbers, for `Trajectory.state`; nothing of it is copied."""
        raw: dict[str, Any] = {name: column(self.bodies, name) for name in OF_BODIES}
        raw |= {name: column(self.pairs, name) for name in OF_PAIRS}
        raw |= {name: getattr(self, name) for name in CLOCK}
        tally = np.array([getattr(self.run, name) for name in TALLY])
        return raw | {"short": float(self.run.short), "tally": tally}

    def keep(self, how: Callable[..., Any]) -> None:
        """Keep the records as plain objects for interpreted code, or `packed` for compiled code: the same bits."""
        self.pairs, self.bodies = how(self.pairs), how(self.bodies)
        if isinstance(self.pairs, np.ndarray):
            self.run = one(packed([self.run], RUN))

    def copied(self) -> State:
        """Return a state whose bodies and pairs can be changed without changing these."""
        return replace(self, pairs=copied(self.pairs), bodies=copied(self.bodies))

    def stop_at(self, until: conditions.Until | None, max_events: int) -> None:
        """Set what the run stops at, if anything, and after how many collisions from here."""
        self.last_event = self.events + max_events
        if isinstance(until, conditions.Contact):
            self.run.stop_pair, self.run.stop_hits = until.pair, until.nth - 1
        elif isinstance(until, conditions.Separated):
            self.run.stop_pair = APART

    def scale(self, speed: float) -> None:
        """Set the scale of speeds (m/s), and with it, where one may come, what looks like part of a collapse."""
        self.speed = speed
        if self.run.slow >= 0.0:
            self.run.slow = math.ldexp(speed, -16)

    def work(self) -> int:
        """Return the work done so far in collisions; one looked at closely costs as much as eight."""
        return self.events + 7 * self.zoomed

    def time(self, tau: FloatOrArray) -> FloatOrArray:
        """Return the time in s that is `tau` after the epoch."""
        return self.epoch + (self.epoch_low + tau)

    def tau(self, time: float) -> float:
        """Return how long after the epoch `time` is."""
        return (time - self.epoch) - self.epoch_low

    def elapsed(self, tau: FloatOrArray) -> FloatOrArray:
        """Return the time in s from the start of the run to `tau`; it has all its digits however late the start."""
        return ((self.epoch - self.start) + self.epoch_low) + tau

    def shift_to(self, tau: float, compiler: Callable[[Any], Any]) -> None:
        """Move the epoch on by whole windows, so that `tau` comes to lie in the first one."""
        shift = tau - math.fmod(tau, self.window)
        speed = compiler(rebase)(self.run, self.pairs, self.bodies, shift)
        total = self.epoch + shift
        back = total - self.epoch
        self.epoch_low += (self.epoch - (total - back)) + (shift - back)
        self.epoch = total
        self.now -= shift
        self.rebases += 1
        self.scale(max(speed, self.fall))
        if self.speed > 0.0:
            self.window = max(self.window, span(self.length, self.speed, self.run.gravity))

    def row(self, tau: float) -> tuple[Array, Array]:
        """Return velocities in m/s, and gaps in m, never negative, at `tau`; nothing moves."""
        g, velocity = self.run.gravity, np.array(column(self.bodies, "u"))
        gap = gaps(self.pairs, velocity, tau)
        if g > 0.0:
            velocity -= column(self.bodies, "falls") * (g * tau)
        return velocity, gap


def gaps(pairs: Records, u: Array, tau: float) -> Array:
    """Return the gaps in m, never negative, at `tau` between bodies of free-fall velocities `u`."""
    pull, at = column(pairs, "pull"), column(pairs, "at")
    rate, dt = np.diff(u) - pull * at, tau - at
    gap: Array = column(pairs, "gap") + dt * (rate - 0.5 * pull * dt)
    return gap.clip(0.0)


CLOCK = [one.name for one in fields(State) if one.name not in ("run", "pairs", "bodies", "last_event")]
"""Clock, scales and counters: numbers that are saved under their names."""


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
