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
from typing import Any

import numpy as np

from granular._check import Array
from granular.edmd import readout
from granular.edmd.model import Model
from granular.edmd.sorted_queue import NEVER, Pause, Rows
from granular.edmd.state import State
from granular.edmd.tree_queue import LIMIT, WINDOW, TreeQueue, loop, refresh

BLOCK = 4096
"""Pairs kept of a block."""
MARGIN = 1.25
"""Speed allowed for, in units of the largest at the start of the window."""


class BlockQueue(TreeQueue):
    """A `TreeQueue` that advances whole windows in blocks where nobody looks at single events."""

    chunk = 1 << 40

    def __init__(self, state: State, model: Model, stop: tuple[int, int] = (NEVER, 0)) -> None:
        super().__init__(state, model, stop)
        self.swept = 0
        self.as_one = 0.0  # until then (tau) the present window is run as one

    def rebuild(self) -> None:
        """Predict all pairs anew; this begins a window."""
        self.as_one = 0.0
        super().rebuild()

    def advance(self, limit: float, budget: int, log: Rows | None) -> Pause:
        """Let events up to and including time `limit` act, at most `budget` of them, appending them to `log`."""
        edge = min(limit, math.nextafter(self.state.window, 0.0))
        if log is None and self.stop[0] == NEVER and edge > self.as_one and self.soonest() <= edge:
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
        speed = MARGIN * (float(np.abs(readout.velocities(s, start, g)).max()) + 2.0 * g * rest)
        ends = self._halos(readout.gaps(s, start), 2.0 * speed * rest)
        if ends is None:
            return False
        new = tuple(a.copy() for a in s.bodies())
        hits = int(s.hits.sum())
        for first, last, low, high in ends:
            part, ok = self._run(low, high, edge, speed - g * rest)
            if not ok:
                return False
            for old, kept in zip(new, part, strict=True):
                bodies = len(old) > len(s.gap)  # the upper body of the last pair belongs to the next block
                end = last + 1 if bodies and last == len(s.gap) else last
                old[first:end] = kept[first - low : end - low]
        done = int(new[5].sum()) - hits
        if done > budget:
            return False
        for old, now in zip(s.bodies(), new, strict=True):
            old[:] = now
        s.events += done
        s.now = max(s.now, float(s.last.max()))
        return True

    def _run(self, low: int, high: int, edge: float, speed: float) -> tuple[tuple[Any, ...], bool]:
        """Run pairs `low` … `high` - 1 alone; return what becomes of them and whether that may be kept."""
        s, m = self.state, self.model
        pairs = len(s.gap)
        part = tuple(a[low : high + (len(a) > pairs)].copy() for a in s.bodies())
        physics = tuple(a[low : high + (len(a) > pairs)] if isinstance(a, np.ndarray) else a for a in self.physics)
        size = 1 << max(0, high - low - 1).bit_length()
        slot, tree = np.full(size, math.inf), np.full(2 * size, size - 1, dtype=self.tree.dtype)
        tree[size:] = np.arange(size)
        tally, fastest = np.zeros(3, dtype=np.int64), np.zeros(1)
        self.kernel(refresh)(0, high - low - 1, part, m.gravity, slot, tree, self.tie)
        pause, _, _, _, _ = self.kernel(loop)(
            edge, edge, 1 << 40, self.stop, part, physics, None, s.watch(m.may_collapse), tally, slot, tree, self.tie,
            None, fastest,
        )  # fmt: skip
        return part, pause in (LIMIT, WINDOW) and tally[0] == 0 and fastest[0] <= speed

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
