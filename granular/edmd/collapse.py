"""Is it an inelastic collapse? The suspects of the event loop are looked at closely, and a verdict is given or not."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from granular._flight import time_to_contact
from granular.edmd import zoom as zoomed
from granular.edmd.model import Model
from granular.edmd.motion import Floats
from granular.edmd.sorted_queue import Rows
from granular.edmd.state import State

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
    """A slice of pairs being looked at closely, in relative state; its clock starts at `base` (tau, s)."""

    first: int
    base: float
    gap: Floats
    rate: Floats
    dial: Floats

    @classmethod
    def on(cls, state: State, queue: Any) -> Zoom:
        """Return a zoom on the neighbourhood of the suspect of `queue`, which has just collided."""
        c = queue.suspect
        first, end = max(0, c - REACH), min(len(state.gap), c + REACH + 1)
        u = np.array(state.u[first : end + 1])
        gap, at, pull = (np.array(a[first:end]) for a in (state.gap, state.at, state.pull))
        rate, dt = np.diff(u) - pull * at, state.now - at
        moved = np.where(pull == 0.0, gap + rate * dt, gap + dt * (rate - 0.5 * pull * dt))
        state.zooms += 1
        if state.zoomed >= PATIENCE * (end - first) ** 2:
            state.allowance = STEP
        noise = np.array(state.noise[first : end + 1])
        rounding = (pull == 0.0) & (rate < 0.0) & (rate * rate < noise[:-1] + noise[1:])
        moved, rate = np.maximum(0.0, moved), np.where(rounding, 0.0, rate - pull * dt)
        rate[c - first] = queue.rebound
        zoom = cls(first, state.now, moved.tolist(), rate.tolist(), [0.0] * 5)
        zoom.keep(queue.column)
        return zoom

    @classmethod
    def restored(cls, saved: Mapping[str, Any]) -> Zoom | None:
        """Return the zoom in progress that `checkpoint` saved, if any."""
        if "zoom_gap" not in saved:
            return None
        return cls(**{f.name: np.asarray(saved["zoom_" + f.name]).tolist() for f in fields(cls)})

    def keep(self, column: Callable[[Any], Floats]) -> None:
        """Keep the slice as the queue keeps its lists."""
        self.gap, self.rate, self.dial = column(self.gap), column(self.rate), column(self.dial)

    def checkpoint(self) -> dict[str, Any]:
        """Return everything as arrays and numbers."""
        return {"zoom_" + f.name: np.array(getattr(self, f.name)) for f in fields(self)}

    def advance(
        self, state: State, model: Model, queue: Any, limit: float, budget: int, log: Rows | None
    ) -> tuple[int, int]:
        """Go on until time `limit`; return how it ended and the last pair (numbered in the slice)."""
        outside = queue.soonest(self.first, self.first + len(self.gap) - 1)
        rows = None if log is None else queue.rows(budget)
        low, high, m_eff, _, eps = queue.physics[:5]
        end, last, done = queue.kernel(zoomed.zoom)(
            self.first, self.gap, self.rate, self.dial, min(outside, state.window) - self.base, limit - self.base,
            state.allowance, budget, state.watch(True), queue.stop, state.pull, low, high, m_eff, eps, model.rule,
            queue.tie, state.hits, state.u, state.falls, self.base,
            model.gravity, rows,
        )  # fmt: skip
        if log is not None and rows is not None:
            log.extend(rows[:done]) if isinstance(rows, list) else log.append(rows[:done])
        state.now = float(self.base + self.dial[0])
        state.events += done
        state.zoomed += done
        return end, last

    def close(self, state: State, queue: Any) -> None:
        """Put the slice back into the state."""
        if self.dial[1] > 0.0:
            queue.kernel(zoomed.write_back)(
                self.first, self.gap, self.rate, self.base + self.dial[0], queue.physics[3], state.u,
                state.noise, state.gap, state.at, state.pull, state.streak,
            )  # fmt: skip
            state.tally[2] += self._lost(state)
            queue.refresh(self.first, self.first + len(self.gap) - 1)
        state.tally[0] += int(self.dial[3])
        for c in range(self.first, self.first + len(self.gap)):
            state.streak[c] = 0

    def _lost(self, state: State) -> int:
        """Return how many of the rates just put back the velocities cannot hold."""
        first, end = self.first, self.first + len(self.gap)
        u, rate = np.array(state.u[first : end + 1]), np.asarray(self.rate)
        held = np.diff(u) - np.asarray(state.pull[first:end]) * np.asarray(state.at[first:end])
        return int((np.abs(held - rate) > 0.5 * np.abs(rate)).sum())

    def settle(self, state: State, model: Model, j: int) -> Verdict:
        """Let the ball above the wall of pair `j` (in the slice) come to rest; the bounces until then are summed."""
        c = self.first + j
        end = zoomed.rest_time(j, self.first, self.gap, self.rate, state.pull, model.low, model.eps[c])
        zoomed.settle(j, self.first, end, self.gap, self.rate, state.u, state.falls, state.pull)
        self.dial[0] += end
        state.now = float(self.base + self.dial[0])
        return Verdict("exact", c, c, 0.0)

    def patience_ends(self, state: State) -> bool:
        """Return whether so much has been looked at closely that `faint` is due; then it is due again after a while."""
        if state.zoomed < PATIENCE * len(self.gap) ** 2:
            return False
        state.allowance = int(self.dial[1]) + STEP
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
                self.dial[4] += 1.0
                return verdict if self.dial[4] >= 2.0 else None
        self.dial[4] = 0.0
        return None

    def _is_alone(self, state: State, run: Verdict) -> bool:
        """Return whether no pair outside `run` collides before it has had time for many collisions of its own."""
        wait = [time_to_contact(d, r, state.pull[self.first + i])
                for i, (d, r) in enumerate(zip(self.gap, self.rate, strict=True))]  # fmt: skip
        first, end = run.first - self.first, run.last + 1 - self.first
        return min(wait[:first] + wait[end:], default=math.inf) > ALONE * min(wait[first:end])

    def verdict(self, state: State, model: Model, j: int, share: float = SLOW) -> Verdict | None:
        """Return what can be said of the neighbours of pair `j` (in the slice) with rates below `share` of the scale.

        Proved, bounded, or nothing.
        """
        low, high = j, j
        tiny = state.speed * share
        while low > 0 and self._is_slow(state, low - 1, tiny):
            low -= 1
        while high + 1 < len(self.gap) and self._is_slow(state, high + 1, tiny):
            high += 1
        first, last = self.first + low, self.first + high
        pulled = any(state.pull[c] > 0.0 for c in (first, last))
        if first == last and not pulled:
            return None  # two free bodies collide once
        bound = largest_speed(model, first, self.gap[low : high + 1], self.rate[low : high + 1])
        if last == first + 1 and not pulled and alternates(model, first, self.rate[low], self.rate[high], j == low):
            return Verdict("proved", first, last, bound)
        return Verdict("bounded", first, last, bound)

    def _is_slow(self, state: State, i: int, tiny: float) -> bool:
        return bool(abs(self.rate[i]) < tiny and self.gap[i] < tiny * state.window)


def largest_speed(model: Model, first: int, gap: Sequence[float], rate: Sequence[float]) -> float:
    """Return √(2E/m_min) in m/s, which no body of a run of pairs exceeds while nobody hits the run.

    E is the energy of its bodies relative to the wall among them (with gravity), else to their centre of mass.
    """
    top = first + len(gap)
    mass = np.asarray(model.mass[first : top + 1])
    ball = np.isfinite(mass)
    velocity = np.concatenate([[0.0], np.cumsum(rate)])
    height = np.concatenate([[0.0], np.cumsum(gap)])
    if ball.all():
        velocity -= (mass @ velocity) / mass.sum()
        height = np.zeros_like(height)  # they fall together
    elif ball[0]:
        velocity -= velocity[-1]
        if model.gravity > 0.0:
            return math.inf  # they fall off the ceiling
    energy = 0.5 * mass[ball] @ velocity[ball] ** 2 + model.gravity * (mass[ball] @ height[ball])
    return math.sqrt(2.0 * float(energy) / float(mass[ball].min()))


def alternates(model: Model, first: int, rate_a: float, rate_b: float, lower_collided: bool) -> bool:
    """Return whether pairs `first` and `first` + 1, free but for each other, collide in turn for ever.

    Two collisions map the ratio of the rates by a Möbius map; for ever means that its fixed points are real and the
    ratio lies on the right side of the unstable one.
    """
    if model.rule is not None:
        return False
    e1, e2 = model.eps[first], model.eps[first + 1]
    onto_lower = model.low[first + 1] * (1.0 + e2)  # what a collision of the upper pair gives the rate of the lower
    onto_upper = model.high[first] * (1.0 + e1)
    p, q, opening, closing = onto_lower, onto_upper, rate_a, -rate_b
    if not lower_collided:
        p, q, e1, e2, opening, closing = q, p, e2, e1, rate_b, -rate_a
    trace, det = p * q - e1 - e2, e1 * e2
    if not (opening > 0.0 and closing > 0.0 and trace > 0.0 and trace * trace >= 4.0 * det):
        return False
    unstable = 0.5 * (trace - math.sqrt(trace * trace - 4.0 * det))
    return bool(opening < (p * q - e2 - unstable) / q * closing)
