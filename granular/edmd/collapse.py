"""Is it an inelastic collapse? The suspects of the event loop are looked at closely, and a verdict is given or not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular._check import Array
from granular._flight import time_to_contact
from granular._records import Record, Records, column, one, packed, plain
from granular.edmd.model import Model
from granular.edmd.sorted_queue import Rows
from granular.edmd.state import State, gaps
from granular.edmd.zoom import DIAL, LOOK, NEAR, write_back, zoom

REACH = 64
"""Pairs looked at on each side of a suspect."""
SLOW = 2.0**-20
"""Rates below this, in units of the scale, make a pair part of a collapse."""
ROUNDING = 1e-12
"""Speeds below this, in units of the scale, count for nothing."""
ALONE = 64.0
"""Such a run is judged while nothing outside collides for so many times the wait for its own next collision."""
PATIENCE, STEP = 64, 16_384
"""Collisions looked at closely, in units of the square of the pairs looked at, before a run may be judged by that; and
how many lie between two such judgements."""


@dataclass(frozen=True)
class Verdict:
    """An inelastic collapse.

    Attributes
    ----------
    kind : str
        *exact*: infinitely many bounces of one ball on a wall, summed; *proved*: two pairs that alternate for ever;
        *bounded*: not claimed to be infinite, but no body involved will be faster than `bound`.
    first, last : int
        The pairs involved.
    bound : float
        Largest possible speed in m/s of the bodies involved, relative to each other (to the wall), from now on,
        unless another body hits them.
    """

    kind: str
    first: int
    last: int
    bound: float


@dataclass
class Zoom:
    """A slice of pairs being looked at closely, in relative state."""

    look: Record
    near: Records

    @classmethod
    def on(cls, state: State, queue: Any) -> Zoom:
        """Return a zoom on the neighbourhood of the suspect of `queue`, which has just collided."""
        c = queue.suspect
        first, end = max(0, c - REACH), min(len(state.pairs), c + REACH + 1)
        zoom = cls._made(first, state.now, end - first)
        pairs, bodies = zoom.slices(state)
        state.zooms += 1
        if state.zoomed >= PATIENCE * (end - first) ** 2:
            state.allowance = STEP
        u, noise, pull, at = column(bodies, "u"), column(bodies, "noise"), column(pairs, "pull"), column(pairs, "at")
        rate = (np.diff(u) - pull * at) - pull * (state.now - at)
        rounding = (pull == 0.0) & (rate < 0.0) & (rate * rate < noise[:-1] + noise[1:])
        zoom.near["gap"] = gaps(pairs, u, state.now)
        zoom.near["rate"] = np.where(rounding, 0.0, rate)
        zoom.near["rate"][c - first] = queue.rebound
        zoom.keep(queue.hold)
        return zoom

    @classmethod
    def restored(cls, saved: Mapping[str, Any]) -> Zoom | None:
        """Return the zoom in progress that `checkpoint` saved, if any; an older one has less on its dial."""
        if "zoom_gap" not in saved:
            return None
        zoom = cls._made(saved["zoom_first"], saved["zoom_base"], len(saved["zoom_gap"]), saved["zoom_dial"].tolist())
        zoom.near["gap"], zoom.near["rate"] = saved["zoom_gap"], saved["zoom_rate"]
        return zoom

    @classmethod
    def _made(cls, first: int, began: float, pairs: int, dial: Iterable[float] = ()) -> Zoom:
        look = np.zeros(1, LOOK)
        for name, value in zip(("first", "began", *DIAL), (first, began, *dial), strict=False):
            look[name] = value
        return cls(plain(look)[0], np.zeros(pairs, NEAR))

    @property
    def first(self) -> int:
        """The lowest pair."""
        return int(self.look.first)

    def keep(self, how: Callable[..., Any]) -> None:
        """Keep the slice as `State.keep` does its records."""
        self.near = how(self.near)
        if isinstance(self.near, np.ndarray):
            self.look = one(packed([self.look], LOOK))

    def checkpoint(self) -> dict[str, Any]:
        """Return everything as arrays and numbers."""
        dial = np.array([getattr(self.look, name) for name in DIAL], dtype=np.float64)
        near = {f"zoom_{name}": column(self.near, name) for name in ("gap", "rate")}
        return {"zoom_first": np.array(self.first), "zoom_base": np.array(self.look.began), "zoom_dial": dial} | near

    def slices(self, state: State) -> tuple[Records, Records]:
        """Return the records of the pairs of the slice, and of their bodies."""
        end = self.first + len(self.near)
        return state.pairs[self.first : end], state.bodies[self.first : end + 1]

    def advance(self, state: State, model: Model, queue: Any, limit: float, budget: int, log: Rows | None) -> int:
        """Go on until time `limit`; return how it ended."""
        look, before = self.look, int(self.look.events)
        rows = None if log is None else queue.rows(budget)
        outside = queue.soonest(self.first, self.first + len(self.near) - 1)
        look.room, look.limit = min(outside, state.window) - look.began, limit - look.began
        look.budget, look.allowance = budget if rows is None else len(rows), state.allowance
        end: int = queue.kernel(zoom)(state.run, look, self.near, *self.slices(state), model.rule, rows)
        done = int(look.events) - before
        if log is not None and rows is not None:
            log.append(rows[:done])
        state.now = float(look.began + look.elapsed)
        state.events += done
        state.zoomed += done
        return end

    def close(self, state: State, queue: Any) -> None:
        """Put the slice back into the state."""
        self.write_back(state, queue)
        if self.look.events > 0:
            state.run.lost += self._lost(state)
            queue.refresh(self.first, self.first + len(self.near) - 1)
        state.run.clamps += int(self.look.clamps)

    def write_back(self, state: State, queue: Any) -> None:
        """Put gaps and velocities of the slice back into the state."""
        queue.kernel(write_back)(state.run, self.look, self.near, *self.slices(state))

    def _lost(self, state: State) -> int:
        """Return how many of the rates just put back the velocities cannot hold."""
        pairs, bodies = self.slices(state)
        rate = column(self.near, "rate")
        held = np.diff(column(bodies, "u")) - column(pairs, "pull") * column(pairs, "at")
        return int((np.abs(held - rate) > 0.5 * np.abs(rate)).sum())

    def patience_ends(self, state: State) -> bool:
        """Return whether so much has been looked at closely that `faint` is due; then it is due again after a while."""
        if state.zoomed < PATIENCE * len(self.near) ** 2:
            return False
        state.allowance = int(self.look.events) + STEP
        return True

    def faint(self, state: State, model: Model, j: int) -> Verdict | None:
        """Return the verdict on the longest run about pair `j` whose speeds will count for nothing, if there is one.

        It must be so twice in a row, or the end of a finite sequence would be taken for a collapse.
        """
        for k in range(0, 40, 4):
            verdict = self.verdict(state, model, j, SLOW * 2.0**-k)
            if verdict is None:
                break
            if verdict.bound < ROUNDING * state.speed and self._is_alone(state, verdict):
                self.look.faint += 1
                return verdict if self.look.faint >= 2 else None
        self.look.faint = 0
        return None

    def _is_alone(self, state: State, run: Verdict) -> bool:
        """Return whether no pair outside `run` collides before it has had time for many collisions of its own."""
        pull = column(self.slices(state)[0], "pull").tolist()
        near = zip(column(self.near, "gap").tolist(), column(self.near, "rate").tolist(), pull, strict=True)
        wait = [time_to_contact(gap, rate, a) for gap, rate, a in near]
        first, end = run.first - self.first, run.last + 1 - self.first
        return min(wait[:first] + wait[end:], default=math.inf) > ALONE * min(wait[first:end])

    def verdict(self, state: State, model: Model, j: int, share: float = SLOW) -> Verdict | None:
        """Return what can be said of the neighbours of pair `j` (in the slice) with rates below `share` of the scale.

        Proved, bounded, or nothing.
        """
        gap, rate = column(self.near, "gap"), column(self.near, "rate")
        tiny = state.speed * share
        slow = (np.abs(rate) < tiny) & (gap < tiny * state.window)
        low = high = j
        while low > 0 and slow[low - 1]:
            low -= 1
        while high + 1 < len(slow) and slow[high + 1]:
            high += 1
        (pairs, bodies), end = self.slices(state), high + 1
        pairs, bodies = pairs[low:end], bodies[low : end + 1]
        pulled = bool((column(pairs, "pull")[[0, -1]] > 0.0).any())
        if low == high and not pulled:
            return None  # two free bodies collide once
        kind, bound = "bounded", largest_speed(bodies, gap[low:end], rate[low:end], state.run.gravity)
        if high == low + 1 and not pulled and model.rule is None and alternates(pairs, rate[low], rate[high], j == low):
            kind = "proved"
        return Verdict(kind, self.first + low, self.first + high, bound)


def largest_speed(bodies: Records, gap: Array, rate: Array, gravity: float) -> float:
    """Return √(2E/m_min) in m/s, which no body of a run of pairs exceeds while nobody hits the run.

    E is the energy of its bodies relative to the wall among them (with gravity), else to their centre of mass.
    """
    mass = np.ascontiguousarray(column(bodies, "mass"))
    ball = np.isfinite(mass)
    velocity = np.concatenate([[0.0], np.cumsum(rate)])
    height = np.concatenate([[0.0], np.cumsum(gap)])
    if ball.all():
        velocity -= (mass @ velocity) / mass.sum()
        height = np.zeros_like(height)  # they fall together
    elif ball[0]:
        velocity -= velocity[-1]
        if gravity > 0.0:
            return math.inf  # they fall off the ceiling
    energy = 0.5 * mass[ball] @ velocity[ball] ** 2 + gravity * (mass[ball] @ height[ball])
    return math.sqrt(2.0 * float(energy) / float(mass[ball].min()))


def alternates(pairs: Records, rate_a: float, rate_b: float, lower_collided: bool) -> bool:
    """Return whether two pairs of constant restitution, free but for each other, collide in turn for ever.

    Two collisions map the ratio of the rates by a Möbius map; for ever means that its fixed points are real and the
    ratio lies on the right side of the unstable one.
    """
    e1, e2 = column(pairs, "eps").tolist()
    onto_lower = column(pairs, "low")[1] * (1.0 + e2)  # what a collision of the upper pair gives the rate of the lower
    onto_upper = column(pairs, "high")[0] * (1.0 + e1)
    p, q, opening, closing = onto_lower, onto_upper, rate_a, -rate_b
    if not lower_collided:
        p, q, e1, e2, opening, closing = q, p, e2, e1, rate_b, -rate_a
    trace, det = p * q - e1 - e2, e1 * e2
    if not (opening > 0.0 and closing > 0.0 and trace > 0.0 and trace * trace >= 4.0 * det):
        return False
    unstable = 0.5 * (trace - math.sqrt(trace * trace - 4.0 * det))
    return bool(opening < (p * q - e2 - unstable) / q * closing)
