"""The compiled queue: a tournament tree over all pairs, with the same event loop.

Events and results are bitwise identical to `sorted_queue`.

Large scenes are advanced block by block, so that each block fits into the processor cache. The motion of a ball until
the end of a window depends only on nearby balls. Influence travels with the balls, at most at the speed V of the
fastest ball. A block of pairs is therefore advanced to the end of the window alone, together with a halo on either
side. The gaps of a halo add up to more than 2 V times the window. Only the block is kept of the result.

The result is exact, bit for bit, if no ball was faster than V. V is assumed with a margin, because light balls can gain
speed, and is checked after each sweep. After a valid sweep, the log rows of all blocks are sorted by time. A sweep is
discarded, and the window is advanced without blocks, in these cases:

* A ball was too fast.
* An event needs the order of the whole scene: a suspected collapse, a clamped gap, or too many events.
* Two blocks have log rows with the same time.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from granular._engine.kernels import FORCED, compiled, kernel, specialised
from granular._engine.records import Record, Records, copied, leaf, one, packed, raw, replay, tournament
from granular.edmd.clusters import rest
from granular.edmd.motion import predicted
from granular.edmd.physics import LEFT, MASK, RANDOM, rank
from granular.edmd.records import BUDGET, LATER, LOG_ROW, NEVER, RUN_FIELDS, Log, Walls
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State

BLOCKS_ABOVE = 100_000
"""Number of bodies from which advancing in blocks is faster."""
PAIRS_PER_BLOCK = 4096
"""Number of pairs per block, without the halo."""
FIRST_LOG_ROWS = 64
"""Number of log rows allocated first."""
LOG_GROWTH_FACTOR = 4
"""Growth factor of the next allocation of log rows, up to `chunk` rows."""
SPEED_MARGIN_FACTOR = 2.0
"""Assumed maximum speed, in units of the largest speed at the start of the window.

A light ball among heavy balls can gain speed.
"""


@kernel
def head(queue: Any) -> tuple[float, int]:
    """Return the time and the pair of the next event."""
    return queue[1].due, queue[1].key & MASK


@kernel
def refresh(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict pairs `first` to `last` again and replay the matches above them."""
    c = first
    while c <= last:
        pair = pairs[c]
        due = predicted(pair, bodies[c], bodies[c + 1], walls)
        leaf(queue, c).due = due
        if run.order != LEFT:  # otherwise the rank is the pair number, which the tree holds
            leaf(queue, c).key = rank(c, run.order, run.seed, pair.contacts)
        pressed = pair.closing_acceleration > 0.0 or (FORCED and pair.wall >= 0)
        if pressed and due == math.inf and (not FORCED or pair.gap == 0.0):  # tested here: a call costs time
            low, high = rest(run, pairs, bodies, c, walls)
            first, last = min(first, low), max(last, high)
            c = low
        else:
            c += 1
    replay(queue, first, last)


loop = specialised(SortedQueue.loop, head=head, refresh=refresh)


class TreeQueue(SortedQueue):
    """A `SortedQueue` with a compiled tournament tree, on arrays of records."""

    name = "compiled"
    chunk = 65_536
    room, size = np.empty(0, LOG_ROW), FIRST_LOG_ROWS
    kernel = staticmethod(partial(compiled, inline=True))
    hold = staticmethod(packed)
    loop, predict = staticmethod(loop), staticmethod(refresh)

    def rows(self, n: int) -> Records:
        """Return room for `n` rows of the log, at most the rest of the current allocation."""
        if len(self.room) < min(n, FIRST_LOG_ROWS):
            self.room, self.size = np.empty(self.size, LOG_ROW), min(LOG_GROWTH_FACTOR * self.size, TreeQueue.chunk)
        return self.room[:n]

    def kept(self, rows: Records) -> Records:
        """Return rows of the log without a copy; the next rows are written behind them."""
        self.room = self.room[len(rows) :]
        return rows

    def begin(self, n: int) -> None:
        """Create a tree in which no event is due."""
        self.queue = tournament(n)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event outside pairs `first` to `last`.

        Pairs are counted modulo the number of pairs.
        """
        if last < first:
            return float(self.queue["due"][1])
        due = self.queue["due"][len(self.queue) // 2 :]
        before = max(0, last + 1 - len(self.state.pairs))  # the excluded range continues there on a ring
        return min(float(part.min(initial=math.inf)) for part in (due[before:first], due[last + 1 :]))


def in_order(rows: Any, sizes: list[int]) -> Any:
    """Sort log rows of several blocks by time, and return them in chunks.

    `sizes` are the numbers of rows per part. Rows of one part with equal times keep their order. Returns None if two
    parts have rows with the same time.
    """
    time = rows["t_begin"].copy()
    order = np.argsort(time)
    later = time[order]
    same = later[1:] == later[:-1]
    if same.any():  # rare: a stable sort takes twice as long
        order = np.argsort(time, kind="stable")
        part = np.repeat(np.arange(len(sizes)), sizes)[order]
        if (part[1:] != part[:-1])[same].any():
            return None
    del time, later, same
    return [raw(rows)[order[k : k + TreeQueue.chunk]].view(LOG_ROW) for k in range(0, len(order), TreeQueue.chunk)]


class BlockQueue(TreeQueue):
    """A `TreeQueue` that advances whole windows in blocks.

    Blocks are used only if no single event has to be observed.
    """

    # Practically unlimited, so that the budget never splits a window.
    chunk = 1 << 40
    as_one = 0.0  # tau until which the current window is advanced without blocks
    spare = np.empty(0, LOG_ROW)  # log rows of a window by block; reused, because allocating is slower

    def rebuild(self) -> None:
        """Predict all pairs again, which begins a window."""
        self.as_one = 0.0
        super().rebuild()

    def advance(self, edge: float, budget: int, log: Log | None) -> int:
        """Process events up to and including time `edge` and append them to `log`.

        At most `budget` events are processed.
        """
        run = self.state.run
        alone = run.stop_pair == NEVER and run.order != RANDOM  # no single event is observed
        if alone and edge > self.as_one and self.soonest() <= edge:
            swept = self._sweep(edge, budget, log)
            self.begin(len(self.state.pairs))
            self.rebuild()
            if not swept:
                self.as_one = edge
        return super().advance(edge, min(budget, TreeQueue.chunk), log)

    def _sweep(self, edge: float, budget: int, log: Log | None) -> bool:
        """Advance all blocks to time `edge` and return whether the result is exact.

        If it is not, state and log are unchanged. The tree is deleted, because two states are in memory during the
        sweep.
        """
        s, done, sizes, page = self.state, 0, list[int](), np.empty(0 if log is None else TreeQueue.chunk, LOG_ROW)
        speed, ends = self._blocks(edge)
        if not ends:
            return False
        del self.queue
        pairs, bodies = np.empty_like(s.pairs), np.empty_like(s.bodies)
        for k, (first, last, low, high) in enumerate(ends, 1):
            room = None if log is None else list[Any]()
            part = self._run(low, high, edge, speed, room, page)
            if part is None:
                return False
            for rows in room or ():
                rows["pair"] += low
                inside = raw(rows)[(rows["pair"] >= first) & (rows["pair"] < last)]
                self._keep(inside, sum(sizes), len(ends))
                sizes.append(len(inside))
            top = last + (last == len(pairs))  # the upper body of the last pair belongs to the next block
            raw(pairs)[first:last] = raw(part.pairs)[first - low : last - low]
            raw(bodies)[first:top] = raw(part.bodies)[first - low : top - low]
            done += int(pairs["contacts"][first:last].sum() - s.pairs["contacts"][first:last].sum())
            if done * len(ends) > budget * k:  # extrapolated to all blocks
                return False
        if log is not None and done:
            rows = in_order(self.spare[: sum(sizes)], sizes)
            if rows is None:
                return False
            log += rows
        s.pairs, s.bodies = pairs, bodies
        s.run.events += done
        s.run.now = max(s.run.now, float(pairs["last"].max()))
        return True

    def _keep(self, rows: Any, at: int, blocks: int) -> None:
        """Store the log rows of a block behind the first `at` rows.

        `blocks` is the number of all blocks, from which the necessary room is estimated.
        """
        if at + len(rows) > len(self.spare):
            # A quarter more than estimated, so that few blocks cause another copy.
            old, self.spare = self.spare[:at], np.empty(max(at + len(rows), blocks * len(rows)) * 5 // 4, LOG_ROW)
            raw(self.spare)[:at] = raw(old)
        raw(self.spare)[at : at + len(rows)] = rows

    def _run(
        self, low: int, high: int, edge: float, speed: float, log: Log | None = None, page: Any = TreeQueue.room
    ) -> State | None:
        """Advance pairs `low` to `high` - 1 alone, to the time `edge`.

        Times are in s after the epoch. Returns the final state, or None if a ball was faster than `speed` (m/s), if a
        gap was replaced by 0, if balls merged, or if the run paused earlier. Log rows are appended to `log` in any
        case, with pairs counted from `low`, and the first of them are stored in `page`.
        """
        s, fastest = self.state, np.zeros(1)
        part = State(
            one(np.array([s.run], RUN_FIELDS)), s.clock, copied(s.pairs[low:high]), copied(s.bodies[low : high + 1])
        )
        # Practically unlimited: only the end of the window stops a block.
        part.run.edge, part.run.budget = edge, 1 << 40
        queue = TreeQueue(part, self.physics)
        if log is None:
            pause = queue.go(part.run, part.pairs, part.bodies, queue.queue, None, None, fastest, None)
        else:
            pause, queue.room = BUDGET, page
            while pause == BUDGET:
                pause = queue.advance(edge, TreeQueue.chunk, log)
            for rows in log:
                fastest[0] = max(fastest[0], np.abs(rows["lower_out"]).max(), np.abs(rows["upper_out"]).max())
        same = (part.run.clamps, part.run.merged) == (s.run.clamps, s.run.merged)
        return part if pause == LATER and same and fastest[0] <= speed else None

    def _blocks(self, edge: float) -> tuple[float, list[tuple[int, int, int, int]]]:
        """Return the assumed maximum speed, and the limits of each block and its halo.

        The limits are the first pair and the end of the block, then those with its halo. The list is empty if the
        blocks with their halos are too long.
        """
        s = self.state
        start, n, g = max(s.run.now, 0.0), len(s.pairs), s.run.gravity
        left = edge - start
        velocity, gap = s.row(start)
        speed = SPEED_MARGIN_FACTOR * (float(np.abs(velocity).max()) + 2.0 * g * left)
        place = np.concatenate([[0.0], np.cumsum(gap)])
        first = np.arange(0, n, PAIRS_PER_BLOCK)
        last = np.minimum(first + PAIRS_PER_BLOCK, n)
        slack = 2.0 * speed * left * (1.0 + 1e-9) + 1e-9 * float(place[-1]) / n  # cumulative sums round
        low = np.maximum(np.searchsorted(place, place[first] - slack, side="right") - 2, 0)
        high = np.minimum(np.searchsorted(place, place[last] + slack, side="left") + 2, n)
        # Beyond this length, more than two thirds of the work would be discarded with the halos.
        longer = float(np.median(high - low)) > 3 * PAIRS_PER_BLOCK
        ends = [] if longer else list(zip(*(x.tolist() for x in (first, last, low, high)), strict=True))
        return speed - g * left, ends
