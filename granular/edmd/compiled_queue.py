"""The compiled queue: a tournament tree over all pairs under the same event loop.

Events, and so results, are those of `sorted_queue` bit for bit.

Large scenes are run block after block, each small enough for the processor's cache.
What happens to a ball until the end of a window depends only on balls near by: influence travels with the balls, at
most as fast as the fastest, V. So a block of pairs is run to the end of the window alone, together with a halo on both
sides whose gaps add up to more than 2 V times the window, and of the result only the block is kept. That is exact,
down to the bits, if no ball was faster than V. V is assumed with a margin (light balls may gain speed) and checked
after each sweep; a sweep that was too fast, or in which anything happened that needs the order of the whole scene (a
suspected collapse, a clamped gap, too many events), is thrown away and the window is run as one. The rows that blocks
write are put into the order of their times; where two blocks have rows of the same time, the window is run as one too.
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
from granular.edmd.records import BUDGET, LATER, NEVER, ROW, RUN, Log, Walls
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State

LARGE = 100_000
"""Bodies from which on working in blocks pays."""
BLOCK = 4096
"""Pairs kept of a block."""
ROOM = 64
"""Rows of the log that there is room for at first."""
GROWTH = 4
"""Each next room is so many times as large, up to `chunk` rows."""
MARGIN = 2.0
"""Speed allowed for, in units of the largest at the start of the window: light balls among heavy ones gain some."""


@kernel
def head(queue: Any) -> tuple[float, int]:
    """Return the next event: its time and its pair."""
    return queue[1].due, queue[1].key & MASK


@kernel
def refresh(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict pairs `first` … `last` anew and decide the matches above them again."""
    c = first
    while c <= last:
        pair = pairs[c]
        due = predicted(pair, bodies[c], bodies[c + 1], walls)
        leaf(queue, c).due = due
        if run.order != LEFT:  # else its number, as the tree has it
            leaf(queue, c).key = rank(c, run.order, run.seed, pair.contacts)
        pressed = pair.closing_acceleration > 0.0 or (FORCED and pair.wall >= 0)
        if pressed and due == math.inf and (not FORCED or pair.gap == 0.0):  # asked here, as `rest` is a call
            low, high = rest(run, pairs, bodies, c, walls)
            first, last = min(first, low), max(last, high)
            c = low
        else:
            c += 1
    replay(queue, first, last)


loop = specialised(SortedQueue.loop, head=head, refresh=refresh)


class TreeQueue(SortedQueue):
    """A `SortedQueue` with another queue in it, compiled, on arrays of records."""

    name = "compiled"
    chunk = 65_536
    room, size = np.empty(0, ROW), ROOM
    kernel = staticmethod(partial(compiled, inline=True))
    hold = staticmethod(packed)
    loop, predict = staticmethod(loop), staticmethod(refresh)

    def rows(self, n: int) -> Records:
        """Return room for `n` rows of the log, or for as many as there still are of those made at a time."""
        if len(self.room) < min(n, ROOM):
            self.room, self.size = np.empty(self.size, ROW), min(GROWTH * self.size, TreeQueue.chunk)
        return self.room[:n]

    def kept(self, rows: Records) -> Records:
        """Return rows of the log, which are kept where they were written; the next ones come behind them."""
        self.room = self.room[len(rows) :]
        return rows

    def begin(self, n: int) -> None:
        """Begin with a tree in which nothing is due."""
        self.queue = tournament(n)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`, counted round."""
        if last < first:
            return float(self.queue["due"][1])
        due = self.queue["due"][len(self.queue) // 2 :]
        before = max(0, last + 1 - len(self.state.pairs))  # inside too, on a ring
        return min(float(part.min(initial=math.inf)) for part in (due[before:first], due[last + 1 :]))


def in_order(rows: Any, sizes: list[int]) -> Any:
    """Return rows of blocks, parts of these sizes, in the order of their times, of equal ones within a part in its own,
    some at a time; None if parts have rows of the same time."""
    time = rows["t_begin"].copy()
    order = np.argsort(time)
    later = time[order]
    same = later[1:] == later[:-1]
    if same.any():  # rare: what keeps the order of equal ones takes twice as long
        order = np.argsort(time, kind="stable")
        part = np.repeat(np.arange(len(sizes)), sizes)[order]
        if (part[1:] != part[:-1])[same].any():
            return None
    del time, later, same
    return [raw(rows)[order[k : k + TreeQueue.chunk]].view(ROW) for k in range(0, len(order), TreeQueue.chunk)]


class BlockQueue(TreeQueue):
    """A `TreeQueue` that advances whole windows in blocks where nobody looks at single events."""

    chunk = 1 << 40
    as_one = 0.0  # until then (tau) the current window is run as one
    spare = np.empty(0, ROW)  # rows of a window, block after block; kept, as new memory costs more than they

    def rebuild(self) -> None:
        """Predict all pairs anew; this begins a window."""
        self.as_one = 0.0
        super().rebuild()

    def advance(self, edge: float, budget: int, log: Log | None) -> int:
        """Let events up to and including time `edge` act, at most `budget` of them, appending them to `log`."""
        run = self.state.run
        alone = run.stop_pair == NEVER and run.order != RANDOM  # nobody looks at single ones
        if alone and edge > self.as_one and self.soonest() <= edge:
            swept = self._sweep(edge, budget, log)
            self.begin(len(self.state.pairs))
            self.rebuild()
            if not swept:
                self.as_one = edge
        return super().advance(edge, min(budget, TreeQueue.chunk), log)

    def _sweep(self, edge: float, budget: int, log: Log | None) -> bool:
        """Run all blocks to time `edge`; return whether that was exact, with state and log unchanged if not.

        The tree is given up, for there are two states for a while.
        """
        s, done, sizes, page = self.state, 0, list[int](), np.empty(0 if log is None else TreeQueue.chunk, ROW)
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
            if done * len(ends) > budget * k:  # all of them would be too many
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
        """Keep rows of a block behind the `at` of those before it, of so many blocks in all."""
        if at + len(rows) > len(self.spare):
            held, self.spare = self.spare[:at], np.empty(max(at + len(rows), blocks * len(rows)) * 5 // 4, ROW)
            raw(self.spare)[:at] = raw(held)
        raw(self.spare)[at : at + len(rows)] = rows

    def _run(
        self, low: int, high: int, edge: float, speed: float, log: Log | None = None, page: Any = TreeQueue.room
    ) -> State | None:
        """Run pairs `low` … `high` - 1 alone; return what becomes of them, None if that may not be kept. Rows are
        appended to `log`; the first of them stand on `page`."""
        s, fastest = self.state, np.zeros(1)
        part = State(one(np.array([s.run], RUN)), s.clock, copied(s.pairs[low:high]), copied(s.bodies[low : high + 1]))
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
        """Return the speed allowed for, and first and end of each block, and with its halo; none if those are long."""
        s = self.state
        start, n, g = max(s.run.now, 0.0), len(s.pairs), s.run.gravity
        rest = edge - start
        velocity, gap = s.row(start)
        speed = MARGIN * (float(np.abs(velocity).max()) + 2.0 * g * rest)
        place = np.concatenate([[0.0], np.cumsum(gap)])
        first = np.arange(0, n, BLOCK)
        last = np.minimum(first + BLOCK, n)
        slack = 2.0 * speed * rest * (1.0 + 1e-9) + 1e-9 * float(place[-1]) / n  # cumulative sums round
        low = np.maximum(np.searchsorted(place, place[first] - slack, side="right") - 2, 0)
        high = np.minimum(np.searchsorted(place, place[last] + slack, side="left") + 2, n)
        longer = float(np.median(high - low)) > 3 * BLOCK
        ends = [] if longer else list(zip(*(x.tolist() for x in (first, last, low, high)), strict=True))
        return speed - g * rest, ends
