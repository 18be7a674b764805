"""The compiled queue for large scenes: block after block, each small enough for the processor's cache.

What happens to a ball until the end of a window depends only on balls near by: influence travels with the balls, at
most as fast as the fastest, V. So a block of pairs is run to the end of the window alone, together with a halo on both
sides whose gaps add up to more than 2 V times the window, and of the result only the block is kept. That is exact,
down to the bits, if no ball was faster than V. V is assumed with a margin (light balls may gain speed) and checked
after each sweep; a sweep that was too fast, or in which anything happened that needs the order of the whole scene (a
suspected collapse, a clamped gap, too many events), is thrown away and the window is run as one.
"""

from __future__ import annotations

import math

import numpy as np

from granular._check import Array
from granular._records import Records, copied, raw
from granular._tournament import tournament
from granular.edmd import readout
from granular.edmd.model import Model
from granular.edmd.sorted_queue import Halt, Rows
from granular.edmd.state import NEVER, State
from granular.edmd.ties import RANDOM
from granular.edmd.tree_queue import LATER, TreeQueue, label, loop, refresh

BLOCK = 4096
"""Pairs kept of a block."""
MARGIN = 1.25
"""Speed allowed for, in units of the largest at the start of the window."""


class BlockQueue(TreeQueue):
    """A `TreeQueue` that advances whole windows in blocks where nobody looks at single events."""

    chunk = 1 << 40

    def __init__(self, state: State, model: Model) -> None:
        super().__init__(state, model)
        self.swept = 0
        self.as_one = 0.0  # until then (tau) the present window is run as one

    def rebuild(self) -> None:
        """Predict all pairs anew; this begins a window."""
        self.as_one = 0.0
        super().rebuild()

    def advance(self, limit: float, budget: int, log: Rows | None) -> Halt:
        """Let events up to and including time `limit` act, at most `budget` of them, appending them to `log`."""
        edge = min(limit, math.nextafter(self.state.window, 0.0))
        run = self.state.run
        alone = log is None and run.stop_pair == NEVER and run.order != RANDOM  # nobody looks at single ones
        if alone and edge > self.as_one and self.soonest() <= edge:
            if self._sweep(edge, budget):
                self.swept += 1
                super().rebuild()
            else:
                self.as_one = edge
        return super().advance(limit, min(budget, TreeQueue.chunk), log)

    def _sweep(self, edge: float, budget: int) -> bool:
        """Run all blocks to time `edge`; return whether that was exact, with the state unchanged if not."""
        s, g = self.state, self.model.gravity
        start = max(s.now, 0.0)
        rest = edge - start
        velocity, gap = readout.row(s, start, g)
        speed = MARGIN * (float(np.abs(velocity).max()) + 2.0 * g * rest)
        ends = self._halos(gap, 2.0 * speed * rest)
        if ends is None:
            return False
        pairs, bodies = np.empty_like(s.pairs), np.empty_like(s.bodies)
        for first, last, low, high in ends:
            part = self._run(low, high, edge, speed - g * rest)
            if part is None:
                return False
            top = last + (last == len(pairs))  # the upper body of the last pair belongs to the next block
            raw(pairs)[first:last] = raw(part[0])[first - low : last - low]
            raw(bodies)[first:top] = raw(part[1])[first - low : top - low]
        done = int(pairs["hits"].sum()) - int(s.pairs["hits"].sum())
        if done > budget:
            return False
        s.pairs, s.bodies = pairs, bodies
        s.events += done
        s.now = max(s.now, float(pairs["last"].max()))
        return True

    def _run(self, low: int, high: int, edge: float, speed: float) -> tuple[Records, Records] | None:
        """Run pairs `low` … `high` - 1 alone; return what becomes of them, None if that may not be kept."""
        s, fastest = self.state, np.zeros(1)
        run, pairs, bodies = s.run.copy(), copied(s.pairs[low:high]), copied(s.bodies[low : high + 1])
        tree = tournament(high - low)
        self.kernel(label)(run, pairs, tree, 0, high - low - 1)
        self.kernel(refresh)(run, pairs, bodies, tree, 0, high - low - 1)
        before = run.clamps
        pause, *_ = self.kernel(loop)(run, pairs, bodies, tree, edge, 1 << 40, None, fastest)
        good = pause == LATER and run.clamps == before and fastest[0] <= speed
        return (pairs, bodies) if good else None

    def _halos(self, gap: Array, reach: float) -> list[tuple[int, int, int, int]] | None:
        """Return first and end of each block, and with its halo; None if the halos are longer than the blocks."""
        n = len(gap)
        place = np.concatenate([[0.0], np.cumsum(gap)])
        first = np.arange(0, n, BLOCK)
        last = np.minimum(first + BLOCK, n)
        slack = reach * (1.0 + 1e-9) + 1e-9 * float(place[-1]) / n  # cumulative sums round
        low = np.maximum(np.searchsorted(place, place[first] - slack, side="right") - 2, 0)
        high = np.minimum(np.searchsorted(place, place[last] + slack, side="left") + 2, n)
        if float(np.median(high - low)) > 3 * BLOCK:
            return None
        return list(zip(*(x.tolist() for x in (first, last, low, high)), strict=True))
