"""The compiled queue: a winner tree over all pairs, and the event loop around it.

Node i of the tree holds the pair that collides first among those below nodes 2i and 2i + 1; the leaves are the pairs,
padded to a power of two. Events, and so results, are those of `sorted_queue` bit for bit.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from granular._kernels import compiled, kernel
from granular.edmd.event import SUSPICIOUS, event
from granular.edmd.merge import rest
from granular.edmd.model import Model
from granular.edmd.motion import Bodies, Floats, Ints, Physics, approaching, predicted
from granular.edmd.sorted_queue import APART, NEVER, Pause, Rows
from granular.edmd.state import State
from granular.edmd.ties import rank

PAUSES = (Pause.limit, Pause.window, Pause.budget, Pause.until, Pause.suspect)
LIMIT, WINDOW, BUDGET, UNTIL, SUSPECT = range(len(PAUSES))


class TreeQueue:
    """Advance a `State` of arrays event by event, compiled. See `SortedQueue` for the parameters."""

    name = "compiled"
    chunk = 65_536
    kernel = staticmethod(partial(compiled, inline=True))
    rows = staticmethod(lambda n: np.zeros((n, 7)))

    def __init__(self, state: State, model: Model, stop: tuple[int, int] = (NEVER, 0)) -> None:
        state.to_arrays()
        self.state = state
        self.model = model
        self.stop = stop
        self.suspect, self.rebound = -1, 0.0
        self.tie = model.tie
        self.physics = arrays(model.physics())
        size = 1
        while size < len(state.gap):
            size *= 2
        self.slot = np.full(size, math.inf)
        self.tree = np.full(2 * size, size - 1, dtype=np.uint32)  # above padding: a pair that never collides
        self.tree[size:] = np.arange(size)
        self.rebuild()

    @staticmethod
    def column(values: list[float]) -> Floats:
        """Return `values` as this queue keeps them."""
        return np.array(values)

    def rebuild(self) -> None:
        """Predict all pairs anew."""
        self.refresh(0, len(self.state.gap) - 1)

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` … `last` anew."""
        self.kernel(refresh)(
            first, last, self.state.bodies(), self.model.gravity, self.slot, self.tree, self.tie
        )  # fmt: skip

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`."""
        if last < first:
            return float(self.slot[self.tree[1]])
        around = (self.slot[:first], self.slot[last + 1 :])
        return min(float(slots.min()) if len(slots) else math.inf for slots in around)

    def advance(self, limit: float, budget: int, log: Rows | None) -> Pause:
        """Let events up to and including time `limit` act, at most `budget` of them, appending them to `log`."""
        s, m = self.state, self.model
        rows = None if log is None else self.rows(budget)
        edge = min(limit, math.nextafter(s.window, 0.0))
        pause, c, now, done, self.rebound = self.kernel(loop)(
            limit, edge, budget, self.stop, s.bodies(), self.physics, None, s.watch(m.may_collapse), s.tally,
            self.slot, self.tree, self.tie, rows, None,
        )  # fmt: skip
        s.events += done
        if done or pause == UNTIL:
            s.now = now
        if log is not None and rows is not None:
            log.append(rows[:done])
        self.suspect = c
        return PAUSES[pause]


def arrays(physics: Physics) -> Physics:
    """Return what a collision needs to know with arrays for lists."""
    low, high, m_eff, mass, eps, *rest = physics
    return (*(np.array(x) for x in (low, high, m_eff, mass, eps)), *rest)  # type: ignore[return-value]


@kernel
def loop(
    limit: float, edge: float, budget: int, stop: tuple[int, int], bodies: Bodies, physics: Physics, rule: Any,
    watch: tuple[float, float], tally: Ints, slot: Floats, tree: Ints, tie: tuple[int, int], rows: Any,
    fastest: Any,
) -> tuple[int, int, float, int, float]:
    """Let events act; return why it pauses, the last pair, its time, the number of events, and the last rate after one.

    `fastest`, if it is an array, takes the largest speed after a collision.
    """
    hits, streaks, g = bodies[5], bodies[7], physics[8]
    acted, done, witness, rebound = 0.0, 0, 0, 0.0
    while True:
        c = int(tree[1])
        now = slot[c]
        if now > edge:
            return LIMIT if now > limit or now == math.inf else WINDOW, c, acted, done, rebound
        if c == stop[0] and hits[c] >= stop[1]:
            return UNTIL, c, now, done, rebound
        if done >= budget:
            return BUDGET, c, acted, done, rebound
        row = None if rows is None else rows[done]
        first, last, rebound = event(c, now, bodies, physics, rule, watch, tally, row)
        acted = now
        done += 1
        if fastest is not None:
            speeds = abs(bodies[0][c] - bodies[1][c] * (g * now)), abs(bodies[0][c + 1] - bodies[1][c + 1] * (g * now))
            fastest[0] = max(fastest[0], speeds[0], speeds[1])
        refresh(first, last, bodies, g, slot, tree, tie)
        if stop[0] == APART:
            witness = approaching(witness, now, bodies[0], bodies[4], bodies[8])
            if witness < 0:
                return UNTIL, c, now, done, rebound
        if streaks[c] >= SUSPICIOUS:
            return SUSPECT, c, acted, done, rebound


@kernel
def refresh(
    first: int, last: int, bodies: Bodies, g: float, slot: Floats, tree: Ints, tie: tuple[int, int]
) -> None:
    """Predict pairs `first` … `last` anew and decide the matches above them again."""
    u, falls, gap, at, pull, hits, _, _, noise = bodies
    c = first
    while c <= last:
        slot[c] = predicted(c, u, gap, at, pull, noise)
        if slot[c] == math.inf and pull[c] > 0.0:
            rest(c, g, u, falls, gap, at, pull)
            last = max(last, min(c + 1, len(gap) - 1))
        c += 1
    low, high = (len(slot) + first) >> 1, (len(slot) + last) >> 1
    while low < high:
        for node in range(low, high + 1):
            tree[node] = winner(tree[2 * node], tree[2 * node + 1], slot, tie, hits)
        low >>= 1
        high >>= 1
    best = tree[2 * low]
    node = 2 * low
    while node > 1:
        best = winner(best, tree[node ^ 1], slot, tie, hits)
        node >>= 1
        tree[node] = best


@kernel
def winner(a: int, b: int, slot: Floats, tie: tuple[int, int], hits: Ints) -> int:
    """Return which of pairs `a` and `b` collides first."""
    if slot[b] < slot[a]:
        return b
    if slot[b] > slot[a] or slot[a] == math.inf:
        return a
    return a if rank(a, tie[0], tie[1], hits[a]) < rank(b, tie[0], tie[1], hits[b]) else b
