"""The compiled queue: a tournament tree over all pairs, and the event loop around it.

Events, and so results, are those of `sorted_queue` bit for bit.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from granular._kernels import compiled, kernel, worth
from granular._records import Record, Records, packed
from granular._tournament import leaf, replay, tournament
from granular.edmd.event import ROW, SUSPICIOUS, event
from granular.edmd.merge import rest
from granular.edmd.model import Model
from granular.edmd.motion import approaching, predicted, velocities
from granular.edmd.sorted_queue import Rows
from granular.edmd.state import APART, BUDGET, LATER, SUSPECT, UNTIL, State
from granular.edmd.ties import LEFT, PAIR, rank

CHUNK = 65_536
"""Events after which the loop hands control back."""
LONG, VERY_LONG = 100_000, 1_000_000
"""Work (in collisions) after which it pays to load the machine code, and to make it if it is not on the disk."""


class TreeQueue:
    """Advance a `State` of records event by event, compiled. See `SortedQueue` for the parameters."""

    name = "compiled"
    chunk = CHUNK
    kernel = staticmethod(partial(compiled, inline=True))
    hold = staticmethod(packed)
    rows = staticmethod(lambda n: np.zeros(min(n, CHUNK), ROW))

    def __init__(self, state: State, model: Model) -> None:
        state.keep(packed)
        self.state = state
        self.model = model
        self.suspect, self.rebound = -1, 0.0
        self.tree = tournament(len(state.pairs))

    def rebuild(self) -> None:
        """Predict all pairs anew."""
        self.refresh(0, len(self.state.pairs) - 1)

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` … `last` anew."""
        s = self.state
        self.kernel(refresh)(s.run, s.pairs, s.bodies, self.tree, first, last)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`."""
        if last < first:
            return float(self.tree["due"][1])
        due = self.tree["due"][len(self.tree) // 2 :]
        return min(float(part.min()) if len(part) else math.inf for part in (due[:first], due[last + 1 :]))

    def advance(self, edge: float, budget: int, log: Rows | None) -> int:
        """Let events up to and including time `edge` act, at most `budget` of them, appending them to `log`.

        Returns why it pauses.
        """
        s, rows = self.state, None if log is None else self.rows(budget)
        pause, self.suspect, now, done, self.rebound = self.kernel(loop)(
            s.run, s.pairs, s.bodies, self.tree, edge, budget, rows, None
        )
        s.events += done
        if done or pause == UNTIL:
            s.now = now
        if log is not None and rows is not None:
            log.append(rows[:done].copy())
        return pause  # type: ignore[no-any-return]


def pays(work: int) -> bool:
    """Return whether so much work, in collisions, is worth the machine code."""
    return worth(loop, work, LONG, VERY_LONG, inline=True)


@kernel
def loop(
    run: Record, pairs: Records, bodies: Records, tree: Records, edge: float, budget: int, rows: Records | None,
    fastest: Records | None,
) -> tuple[int, int, float, int, float]:
    """Let events act; return why it pauses, the last pair, its time, the number of events, and the last rate after one.

    `rows` takes the log; `fastest`, if it is an array, the largest speed after a collision.
    """
    acted, done, witness, rebound = 0.0, 0, 0, 0.0
    while True:
        now, c = tree[1].due, tree[1].key & PAIR
        if now > edge:
            return LATER, c, acted, done, rebound
        if c == run.stop_pair and pairs[c].hits >= run.stop_hits:
            return UNTIL, c, now, done, rebound
        if done >= budget:
            return BUDGET, c, acted, done, rebound
        first, last, rebound = event(run, pairs, bodies, c, now, None, None if rows is None else rows[done])
        acted = now
        done += 1
        if fastest is not None:
            below, above = velocities(bodies[c], bodies[c + 1], run.gravity, now)
            fastest[0] = max(fastest[0], abs(below), abs(above))
        refresh(run, pairs, bodies, tree, first, last)
        if run.stop_pair == APART:
            witness = approaching(pairs, bodies, witness, now)
            if witness < 0:
                return UNTIL, c, now, done, rebound
        if pairs[c].streak >= SUSPICIOUS:
            return SUSPECT, c, acted, done, rebound


@kernel
def refresh(run: Record, pairs: Records, bodies: Records, tree: Records, first: int, last: int) -> None:
    """Predict pairs `first` … `last` anew and decide the matches above them again."""
    c = first
    while c <= last:
        pair = pairs[c]
        due = predicted(pair, bodies[c], bodies[c + 1])
        leaf(tree, c).due = due
        if run.order != LEFT:  # else its number, as the tree has it
            leaf(tree, c).key = rank(c, run.order, run.seed, pair.hits)
        if due == math.inf and pair.pull > 0.0:
            rest(run, pairs, bodies, c)
            last = max(last, min(c + 1, len(pairs) - 1))
        c += 1
    replay(tree, first, last)
