"""The compiled queue: a tournament tree over all pairs under the same event loop.
May be skipped: faster, same results.

Events, and so results, are those of `sorted_queue` bit for bit.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from granular._kernels import compiled, kernel, specialised, worth
from granular._records import Record, Records, packed
from granular._tournament import leaf, replay, tournament
from granular.edmd import sorted_queue
from granular.edmd.collision import RESTING, ROW, rest
from granular.edmd.motion import Walls, predicted
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.ties import LEFT, MASK, rank

LONG, VERY_LONG = 100_000, 1_000_000
"""Work (in collisions) after which it pays to load the machine code, and to make it if it is not on the disk."""


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
            leaf(queue, c).key = rank(c, run.order, run.seed, pair.hits)
        if due == math.inf and pair.pull > RESTING:
            low, high = rest(run, pairs, bodies, c, walls)
            first, last = min(first, low), max(last, high)
            c = low
        else:
            c += 1
    replay(queue, first, last)


loop = specialised(sorted_queue.loop, head=head, refresh=refresh)


class TreeQueue(SortedQueue):
    """A `SortedQueue` with another queue in it, compiled, on arrays of records."""

    name = "compiled"
    chunk = 65_536
    kernel = staticmethod(partial(compiled, inline=True))
    hold = staticmethod(packed)
    loop, predict = staticmethod(loop), staticmethod(refresh)
    predict_around = staticmethod(specialised(sorted_queue.refresh_around, refresh_on_line=refresh))

    def rows(self, n: int) -> Records:
        """Return room for `n` rows of the log, or for as many as are made at a time."""
        return np.empty(min(n, TreeQueue.chunk), ROW)

    def rebuild(self) -> None:
        """Predict all pairs anew."""
        self.queue = tournament(len(self.state.pairs)) if self.queue is None else self.queue
        self.refresh(0, len(self.state.pairs) - 1)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`, counted round."""
        if last < first:
            return float(self.queue["due"][1])
        due = self.queue["due"][len(self.queue) // 2 :]
        before = max(0, last + 1 - len(self.state.pairs))  # inside too, on a ring
        return min(float(part.min(initial=math.inf)) for part in (due[before:first], due[last + 1 :]))

    def _events(self) -> list[tuple[float, int]]:
        tree: list[tuple[float, int]] = self.queue.tolist()
        leaves, pairs = len(tree) // 2, len(self.state.pairs)
        assert tree[1:leaves] == list(map(min, tree[2::2], tree[3::2])), "matches are not decided"
        return tree[leaves : leaves + pairs]


def pays(work: float) -> bool:
    """Return whether so much work, in collisions, is worth the machine code."""
    return worth(loop, work, LONG, VERY_LONG, inline=True)
