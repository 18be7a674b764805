"""The compiled event queue: a tournament tree over all pairs.

It uses the event loop of `sorted_queue`, and its events and results are bitwise identical. For epoch and window see
`granular.edmd.motion`.

Scenes with many balls are advanced block by block, so that each block fits into the processor cache. Until the end of
a window, the motion of a ball depends only on nearby balls, because a collision can influence other balls only as fast
as the fastest ball moves. Let V be an upper bound of all speeds. A block of pairs is advanced to the end of the window
together with a halo of pairs on either side. The gaps of each halo add up to more than 2 V times the window. Only the
results of the block itself are kept.

The result is bitwise exact if no ball was faster than V. V contains a margin, because light balls can gain speed. The
assumption is checked after each sweep over all blocks. After a valid sweep, the log rows of all blocks are sorted by
time. In these cases the sweep is discarded, and the window is advanced without blocks:

* A ball was faster than V.
* An event depends on the order of events in the whole scene: a suspected collapse, a gap set to 0 after rounding made
  it negative, merged balls, or too many events.
* Log rows of two blocks have the same time.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from granular._engine.kernels import FORCED, compiled, kernel, specialised
from granular._engine.records import (
    Record,
    Records,
    as_bytes,
    copied,
    leaf,
    one,
    record_array,
    tournament,
    update_tournament,
)
from granular.edmd.clusters import bring_to_rest
from granular.edmd.motion import next_event_time
from granular.edmd.physics import LEFT, MASK, RANDOM, rank
from granular.edmd.records import BUDGET, LATER, LOG_ROW, NEVER, RUN_FIELDS, Log, Walls
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State

BLOCKS_ABOVE = 100_000
"""Number of bodies above which a scene is advanced in blocks."""
PAIRS_PER_BLOCK = 4096
"""Number of pairs per block, without the halo."""
FIRST_LOG_ROWS = 64
"""Number of log rows in the first allocation."""
LOG_GROWTH_FACTOR = 4
"""Ratio of the sizes of successive allocations of log rows, up to `chunk` rows."""
SPEED_MARGIN_FACTOR = 2.0
"""Assumed maximum speed, in units of the largest speed at the start of the window.

The factor allows for light balls among heavy balls, which can gain speed.
"""


@kernel
def head(queue: Any) -> tuple[float, int]:
    """Return the time (s since the epoch) and the pair of the next event."""
    return queue[1].due, queue[1].key & MASK


@kernel
def refresh(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict pairs `first` to `last` again and update the tree.

    If bodies are pressed together but have no next event, they can have come to rest, see `clusters.bring_to_rest`. The
    pairs that this changes are predicted again as well.
    """
    c = first
    while c <= last:
        pair = pairs[c]
        due = next_event_time(pair, bodies[c], bodies[c + 1], walls)
        leaf(queue, c).due = due
        if run.order != LEFT:  # otherwise the rank is the pair number, which the tree holds
            leaf(queue, c).key = rank(c, run.order, run.seed, pair.contacts)
        pressed = pair.closing_acceleration > 0.0 or (FORCED and pair.wall >= 0)
        if pressed and due == math.inf and (not FORCED or pair.gap == 0.0):  # tested here: a call costs time
            low, high = bring_to_rest(run, pairs, bodies, c, walls)
            first, last = min(first, low), max(last, high)
            c = low
        else:
            c += 1
    update_tournament(queue, first, last)


loop = specialised(SortedQueue.loop, head=head, refresh=refresh)


class TreeQueue(SortedQueue):
    """Compiled event queue: a tournament tree, with the records of the run as arrays."""

    name = "compiled"
    chunk = 65_536
    room, size = np.empty(0, LOG_ROW), FIRST_LOG_ROWS
    kernel = staticmethod(partial(compiled, inline=True))
    convert = staticmethod(record_array)
    loop, predict = staticmethod(loop), staticmethod(refresh)

    def rows(self, n: int) -> Records:
        """Return at most `n` unused log rows, a part of the current allocation."""
        if len(self.room) < min(n, FIRST_LOG_ROWS):
            self.room, self.size = np.empty(self.size, LOG_ROW), min(LOG_GROWTH_FACTOR * self.size, TreeQueue.chunk)
        return self.room[:n]

    def filled_rows(self, rows: Records) -> Records:
        """Return filled log rows without a copy. The next rows are written after them."""
        self.room = self.room[len(rows) :]
        return rows

    def begin(self, n: int) -> None:
        """Create a tree for `n` pairs, in which no pair has an event."""
        self.queue = tournament(n)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time (s since the epoch) of the next event, or inf.

        Events of pairs `first` to `last`, counted modulo the number of pairs, are ignored. By default no pair is
        ignored.
        """
        if last < first:
            return float(self.queue["due"][1])
        due = self.queue["due"][len(self.queue) // 2 :]
        wrapped_end = max(0, last + 1 - len(self.state.pairs))  # the excluded range continues there on a ring
        return min(float(part.min(initial=math.inf)) for part in (due[wrapped_end:first], due[last + 1 :]))


def rows_by_time(rows: Any, sizes: list[int]) -> Any:
    """Return the log rows of all blocks sorted by time, as a list of chunks, or None.

    `rows` are the rows of one block after the other, and `sizes` the number of rows of each block. Rows of one block
    with equal times keep their order. The result is None if rows of two blocks have the same time, because their order
    is then unknown. A chunk has at most `TreeQueue.chunk` rows.
    """
    time = rows["t_begin"].copy()
    order = np.argsort(time)
    sorted_time = time[order]
    is_equal = sorted_time[1:] == sorted_time[:-1]
    if is_equal.any():  # rare: a stable sort takes twice as long
        order = np.argsort(time, kind="stable")
        block = np.repeat(np.arange(len(sizes)), sizes)[order]
        if (block[1:] != block[:-1])[is_equal].any():
            return None
    del time, sorted_time, is_equal
    return [as_bytes(rows)[order[k : k + TreeQueue.chunk]].view(LOG_ROW) for k in range(0, len(order), TreeQueue.chunk)]


class BlockQueue(TreeQueue):
    """`TreeQueue` for large scenes that advances whole windows block by block.

    Blocks are used only if the run neither pauses at a particular event nor draws the order of simultaneous collisions.
    """

    # Practically unlimited, so that the budget never splits a window.
    chunk = 1 << 40
    as_one = 0.0  # tau until which the current window is advanced without blocks
    spare = np.empty(0, LOG_ROW)  # log rows of a window by block; reused, because allocating is slower

    def rebuild(self) -> None:
        """Predict all pairs again at the beginning of a window."""
        self.as_one = 0.0
        super().rebuild()

    def advance(self, edge: float, budget: int, log: Log | None) -> int:
        """Process events up to and including `edge` (s since the epoch), and log them.

        At most `budget` events are processed. Returns the reason of the pause.
        """
        run = self.state.run
        can_sweep = run.stop_pair == NEVER and run.order != RANDOM  # no single event is observed
        if can_sweep and edge > self.as_one and self.soonest() <= edge:
            swept = self._sweep(edge, budget, log)
            self.begin(len(self.state.pairs))
            self.rebuild()
            if not swept:
                self.as_one = edge
        return super().advance(edge, min(budget, TreeQueue.chunk), log)

    def _sweep(self, edge: float, budget: int, log: Log | None) -> bool:
        """Advance all blocks to time `edge`, and return whether the result is exact.

        `edge` is in s since the epoch. At most about `budget` events are accepted, and `log` receives the rows. If the
        result is not exact, state and log are unchanged. The tree is deleted before the first block is advanced,
        because two states are in memory during the sweep.
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
                inside = as_bytes(rows)[(rows["pair"] >= first) & (rows["pair"] < last)]
                self._keep(inside, sum(sizes), len(ends))
                sizes.append(len(inside))
            top = last + (last == len(pairs))  # the upper body of the last pair belongs to the next block
            as_bytes(pairs)[first:last] = as_bytes(part.pairs)[first - low : last - low]
            as_bytes(bodies)[first:top] = as_bytes(part.bodies)[first - low : top - low]
            done += int(pairs["contacts"][first:last].sum() - s.pairs["contacts"][first:last].sum())
            if done * len(ends) > budget * k:  # extrapolated to all blocks
                return False
        if log is not None and done:
            rows = rows_by_time(self.spare[: sum(sizes)], sizes)
            if rows is None:
                return False
            log += rows
        s.pairs, s.bodies = pairs, bodies
        s.run.events += done
        s.run.now = max(s.run.now, float(pairs["last"].max()))
        return True

    def _keep(self, rows: Any, at: int, blocks: int) -> None:
        """Store the log rows of one block after the first `at` rows of `spare`.

        `blocks` is the number of all blocks. It serves to estimate the total number of rows.
        """
        if at + len(rows) > len(self.spare):
            # A quarter more than estimated, so that few blocks cause another copy.
            old, self.spare = self.spare[:at], np.empty(max(at + len(rows), blocks * len(rows)) * 5 // 4, LOG_ROW)
            as_bytes(self.spare)[:at] = as_bytes(old)
        as_bytes(self.spare)[at : at + len(rows)] = rows

    def _run(
        self, low: int, high: int, edge: float, speed: float, log: Log | None = None, page: Any = TreeQueue.room
    ) -> State | None:
        """Advance only the pairs `low` to `high` - 1 to the time `edge`.

        Returns their final state. Returns None if a ball was faster than `speed` (m/s), if a negative gap was set to
        0, if balls merged, or if the run paused before `edge` (s since the epoch). The log rows are appended to `log`
        in any case. Their pairs are counted from `low`. The first rows are stored in the array `page`.
        """
        s, fastest = self.state, np.zeros(1)
        part = State(
            one(np.array([s.run], RUN_FIELDS)), s.clock, copied(s.pairs[low:high]), copied(s.bodies[low : high + 1])
        )
        # Practically unlimited: only the end of the window stops a block.
        part.run.edge, part.run.budget = edge, 1 << 40
        queue = TreeQueue(part, self.physics)
        if log is None:
            pause = queue.run_loop(part.run, part.pairs, part.bodies, queue.queue, None, None, fastest, None)
        else:
            pause, queue.room = BUDGET, page
            while pause == BUDGET:
                pause = queue.advance(edge, TreeQueue.chunk, log)
            for rows in log:
                fastest[0] = max(fastest[0], np.abs(rows["lower_out"]).max(), np.abs(rows["upper_out"]).max())
        is_unclamped = (part.run.clamps, part.run.merged) == (s.run.clamps, s.run.merged)
        return part if pause == LATER and is_unclamped and fastest[0] <= speed else None

    def _blocks(self, edge: float) -> tuple[float, list[tuple[int, int, int, int]]]:
        """Return the assumed maximum speed (m/s), and the limits of all blocks.

        Each block has four limits: its first pair, the pair after its last pair, and the same two numbers with the
        halo. The list is empty if the blocks with their halos are too long to be worthwhile.
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
        is_too_long = float(np.median(high - low)) > 3 * PAIRS_PER_BLOCK
        ends = [] if is_too_long else list(zip(*(x.tolist() for x in (first, last, low, high)), strict=True))
        return speed - g * left, ends
