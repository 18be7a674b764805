"""The reference queue: pairs in a `SortedList` of (time, rank)."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

from sortedcontainers import SortedList

from granular.edmd import touching
from granular.edmd.event import SUSPICIOUS, event
from granular.edmd.groups import gave_up
from granular.edmd.merge import rest
from granular.edmd.model import Model
from granular.edmd.motion import Floats, approaching, predicted
from granular.edmd.state import State
from granular.edmd.ties import PAIR, RANDOM, rank

NEVER, APART, INF = -1, -2, math.inf
Rows = list[Any]
"""Rows of the log: pair, tau, velocities before (lower, upper), velocities after, impulse."""


class Pause(Enum):
    """Why a queue hands control back."""

    limit = "the next event is later than asked for, or never"
    window = "the next event lies in a later window"
    budget = "as many events as asked for have acted, or a group that collides as a whole would make it more"
    until = "the next event is the contact to stop at, or all pairs recede"
    suspect = "the last collisions look like a collapse"


class SortedQueue:
    """Advance a `State` event by event.

    Parameters
    ----------
    state : State
        Changed in place.
    model : Model
        The physics.
    stop : (int, int)
        Pause before pair ``stop[0]`` collides when it has collided ``stop[1]`` times; pair `NEVER`: do not; pair
        `APART`: pause after a collision that leaves no pair approaching.
    """

    name = "sorted"
    chunk = 4096
    kernel = staticmethod(lambda function: function)
    rows = staticmethod(lambda n: [[0.0] * 7 for _ in range(n)])

    def __init__(self, state: State, model: Model, stop: tuple[int, int] = (NEVER, 0)) -> None:
        self.state = state
        self.model = model
        self.stop = stop
        self.suspect, self.rebound = -1, 0.0
        self.tie = model.tie
        self.physics = model.physics()
        self.rebuild()

    @staticmethod
    def column(values: list[float]) -> Floats:
        """Return `values` as this queue keeps them."""
        return values

    def rebuild(self) -> None:
        """Predict all pairs anew."""
        pairs = range(len(self.state.gap))
        self.entry = [(math.inf, self._rank(c)) for c in pairs]
        self.queue: SortedList[tuple[float, int]] = SortedList([(math.inf, PAIR)])  # never empty
        self.refresh(0, len(pairs) - 1)

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` … `last` anew. Pairs that never collide are not in the queue."""
        s, queue, entry = self.state, self.queue, self.entry
        u, gap, at, pull, noise = s.u, s.gap, s.at, s.pull, s.noise
        c = first
        while c <= last:
            old, key = entry[c]
            time = predicted(c, u, gap, at, pull, noise)
            if time != old:
                if old < INF:
                    queue.remove((old, key))
                entry[c] = new = (time, key)
                if time < INF:
                    queue.add(new)
            if time == INF and pull[c] > 0.0:
                rest(c, self.model.gravity, u, s.falls, gap, at, pull)
                last = max(last, min(c + 1, len(gap) - 1))
            c += 1

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event of any pair outside `first` … `last`."""
        return float(next(time for time, key in self.queue if not first <= (key & PAIR) <= last))

    def advance(self, limit: float, budget: int, log: Rows | None) -> Pause:
        """Let events up to and including time `limit` act, at most `budget` of them, appending them to `log`."""
        s, m = self.state, self.model
        queue, entry, hits, random = self.queue, self.entry, s.hits, m.order == RANDOM
        bodies, physics, rule, watch, tally = s.bodies(), self.physics, m.rule, s.watch(m.may_collapse), s.tally
        stop_pair, stop_hits = self.stop
        edge = min(limit, math.nextafter(s.window, 0.0))
        until_event, witness, groups = s.events + budget, 0, m.solver is not None
        while True:
            now, key = first_entry = queue.pop(0)
            c = key & PAIR
            if now > edge or s.events >= until_event or (c == stop_pair and hits[c] >= stop_hits):
                queue.add(first_entry)
                return self._pause(now, c, edge, limit)
            entry[c] = (math.inf, key)
            s.now = now
            if groups:
                first, last = touching.group(c, now, s)
                if first < last:
                    pause = self._solve(c, first, last, until_event - s.events, log)
                    if pause is not None:
                        self.refresh(c, c)
                        return pause
                    if self._apart():
                        return Pause.until
                    continue
            row = None if log is None else [0.0] * 7
            first, last, self.rebound = event(c, now, bodies, physics, rule, watch, tally, row)
            s.events += 1
            if log is not None and row is not None:
                log.append(row)
            if random:
                entry[c] = (math.inf, self._rank(c))
            self.refresh(first, last)
            if stop_pair == APART:
                witness = approaching(witness, now, s.u, s.pull, s.noise)
                if witness < 0:
                    return Pause.until
            if s.streak[c] >= SUSPICIOUS:
                self.suspect = c
                return Pause.suspect

    def _pause(self, now: float, c: int, edge: float, limit: float) -> Pause:
        """Return why pair `c`, the next to collide, does not at time `now`."""
        if now > edge:
            return Pause.limit if now > limit or now == math.inf else Pause.window
        if c == self.stop[0] and self.state.hits[c] >= self.stop[1]:
            self.state.now = now
            return Pause.until
        return Pause.budget

    def _solve(self, c: int, first: int, last: int, budget: int, log: Rows | None) -> Pause | None:
        """Let the touching group of pairs `first` … `last` collide as a whole, unless there is a reason not to."""
        s, m = self.state, self.model
        p = touching.impulses(c, first, last, s.now, s, m)
        hit = [k for k in range(first, last + 1) if p[k - first] > 0.0]
        stop_pair, stop_hits = self.stop
        if stop_pair in hit and s.hits[stop_pair] >= stop_hits:
            return Pause.until
        if len(hit) > budget:
            return Pause.budget
        before = touching.velocities(first, last, s.now, s, m)
        touching.apply(first, last, p, s.now, s, m)
        after = touching.velocities(first, last, s.now, s, m)
        for k in hit:
            s.hits[k] += 1
            s.last[k] = s.now
            if log is not None:
                i = k - first
                log.append([k, s.now, before[i], before[i + 1], after[i], after[i + 1], p[i]])
        s.events += len(hit)
        self.refresh(max(first - 1, 0), min(last + 1, len(s.gap) - 1))
        if not hit and self.entry[c][0] <= s.now:
            raise gave_up(m.ties)
        return None

    def _apart(self) -> bool:
        s = self.state
        return self.stop[0] == APART and approaching(0, s.now, s.u, s.pull, s.noise) < 0

    def _rank(self, c: int) -> int:
        return rank(c, self.model.order, self.model.seed, self.state.hits[c])
