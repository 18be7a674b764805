"""The reference queue: pairs in a `SortedList` of (time, rank)."""

from __future__ import annotations

import math
from typing import Any

from sortedcontainers import SortedList

from granular._records import plain, twin
from granular.edmd import touching
from granular.edmd.event import ROW, SUSPICIOUS, event
from granular.edmd.groups import gave_up
from granular.edmd.merge import rest
from granular.edmd.model import Model
from granular.edmd.motion import approaching, predicted
from granular.edmd.state import APART, BUDGET, LATER, SUSPECT, UNTIL, State
from granular.edmd.ties import GROUP, PAIR, RANDOM, rank

INF = math.inf
Rows = list[Any]
"""The log: chunks of records `ROW`, as arrays or as lists of plain objects."""
Row: Any = twin(ROW)
SHORT = 256
"""Rows made for a closer look at a time."""



class SortedQueue:
    """Advance a `State` event by event.

    Parameters
    ----------
    state : State
        Changed in place.
    model : Model
        The physics.
    """

    name = "sorted"
    chunk = 4096
    kernel = staticmethod(lambda function: function)
    hold = staticmethod(plain)
    rows = staticmethod(lambda n: [object.__new__(Row) for _ in range(min(n, SHORT))])

    def __init__(self, state: State, model: Model) -> None:
        state.keep(plain)
        self.state = state
        self.model = model
        self.suspect, self.rebound = -1, 0.0

    def rebuild(self) -> None:
        """Predict all pairs anew."""
        s = self.state
        self.entry = [(INF, rank(c, s.run.order, s.run.seed, pair.hits)) for c, pair in enumerate(s.pairs)]
        self.queue: SortedList[tuple[float, int]] = SortedList([(INF, PAIR)])  # never empty
        self.refresh(0, len(s.pairs) - 1)

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` … `last` anew. Pairs that never collide are not in the queue."""
        s, queue, entry = self.state, self.queue, self.entry
        pairs, bodies, random = s.pairs, s.bodies, s.run.order == RANDOM
        c = first
        while c <= last:
            old, pair = entry[c], pairs[c]
            time = predicted(pair, bodies[c], bodies[c + 1])
            new = (time, rank(c, RANDOM, s.run.seed, pair.hits) if random else old[1])
            if new != old:
                if old[0] < INF:
                    queue.remove(old)
                entry[c] = new
                if time < INF:
                    queue.add(new)
            if time == INF and pair.pull > 0.0:
                rest(s.run, pairs, bodies, c)
                last = max(last, min(c + 1, len(pairs) - 1))
            c += 1

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`."""
        return float(next(time for time, key in self.queue if not first <= (key & PAIR) <= last))

    def advance(self, edge: float, budget: int, log: Rows | None) -> int:
        """Let events up to and including time `edge` act, `budget` of them or one more group, appending them to `log`.

        Returns why it pauses.
        """
        s, rule, groups = self.state, self.model.rule, self.state.run.order == GROUP
        queue, entry, run, pairs, bodies = self.queue, self.entry, s.run, s.pairs, s.bodies
        enough, witness, rows, row = s.events + budget, 0, Rows(), None
        if log is not None:
            log.append(rows)
        while True:
            now, key = queue[0]
            c = key & PAIR
            if now > edge:
                return LATER
            if c == run.stop_pair and pairs[c].hits >= run.stop_hits:
                s.now = now
                return UNTIL
            if s.events >= enough:
                return BUDGET
            del queue[0]
            entry[c] = (INF, key)
            s.now = now
            if groups:
                first, last = touching.group(c, now, s)
                if first < last:
                    pause = self._solve(c, first, last, rows)
                    if pause is not None:
                        return pause
                    continue
            if log is not None:
                row = object.__new__(Row)
                rows.append(row)
            first, last, self.rebound = event(run, pairs, bodies, c, now, rule, row)
            s.events += 1
            self.refresh(first, last)
            if run.stop_pair == APART:
                witness = approaching(pairs, bodies, witness, now)
                if witness < 0:
                    return UNTIL
            if pairs[c].streak >= SUSPICIOUS:
                self.suspect = c
                return SUSPECT

    def _solve(self, c: int, first: int, last: int, rows: Rows) -> int | None:
        """Let the touching group of pairs `first` … `last` collide as a whole; return why to pause, if so.

        Before it: the contact to stop at is among its own, or they are more than the run may still have.
        """
        s, now = self.state, self.state.now
        p = touching.impulses(c, first, last, s, self.model)
        hit = [k for k in range(first, last + 1) if p[k - first] > 0.0]
        stops = s.run.stop_pair in hit and s.pairs[s.run.stop_pair].hits >= s.run.stop_hits
        if stops or s.events + len(hit) > s.last_event:
            self.refresh(c, c)
            return UNTIL if stops else BUDGET
        before = touching.velocities(first, last, now, s)
        touching.apply(first, last, p, s)
        after = touching.velocities(first, last, now, s)
        for k in hit:
            s.pairs[k].hits += 1
            s.pairs[k].last = now
            i = k - first
            rows.append(Row(k, now, before[i], before[i + 1], after[i], after[i + 1], p[i]))
        s.events += len(hit)
        self.refresh(max(first - 1, 0), min(last + 1, len(s.pairs) - 1))
        if not hit and self.entry[c][0] <= now:
            raise gave_up(self.model.ties)
        return UNTIL if s.run.stop_pair == APART and approaching(s.pairs, s.bodies, 0, now) < 0 else None
