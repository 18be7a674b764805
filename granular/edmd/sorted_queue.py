"""Event loop and reference queue: pairs in a `SortedList` of (time, rank)."""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Callable
from functools import cache, partial
from itertools import repeat
from typing import Any

from sortedcontainers import SortedList

from granular._engine.kernels import FORCED, RING, fitted, interpreted, kernel
from granular._engine.records import SMALL_RECORD_COUNT, Record, Records, plain, plain_class
from granular.edmd.clusters import rest
from granular.edmd.collision import SUSPICIOUS_STREAK, event, leave
from granular.edmd.motion import approaching, predicted, velocities
from granular.edmd.physics import GROUP, MASK, RANDOM, Physics, Restitution, rank
from granular.edmd.records import APART, BUDGET, FREE, LATER, LOG_ROW, SUSPECT, TOUCHING, UNTIL, Log, Walls
from granular.edmd.state import State
from granular.edmd.ties import collide_as_one, is_touched
from granular.edmd.wall_state import advance_epoch, date_rows

LAST_ENTRY = (math.inf, MASK)
"""Last entry of every queue, so that no queue is empty."""


@kernel
def loop(
    run: Record, pairs: Records, bodies: Records, queue: Any, rule: Restitution | None, rows: Records | None,
    fastest: Records | None, walls: Walls,
) -> int:
    """Process events until `run.edge`, at most `run.budget` of them.

    Returns the reason of the pause. `rows` receives the contact log. If `fastest` is an array, it receives the largest
    speed after a collision.
    """
    edge, budget, stop, together = run.edge, run.budget, run.stop_pair, run.order == GROUP
    done, closes = 0, 0
    while True:
        now, c = head(queue)
        if now > edge:
            # Beside driven walls a flight can be longer than the window, so the loop moves the zero of time itself.
            if not FORCED or not advance_epoch(run, pairs, bodies, rows, done, now, walls):
                return LATER
            refresh(run, pairs, bodies, queue, 0, len(pairs) - 1, walls)
            edge = run.edge
            continue
        leaves = FORCED and pairs[c].stuck > FREE
        # Before the budget test: a stop condition has priority over a limit.
        if c == stop and pairs[c].contacts >= run.stop_contacts and not leaves:
            run.now = now
            return UNTIL
        if done >= budget:
            return BUDGET
        run.now = now
        if leaves:
            first, last = leave(run, pairs, bodies, c, now, walls)
            refresh(run, pairs, bodies, queue, first, last, walls)
            continue
        # Before `event`: a group is solved as a whole by `collide_as_one`.
        if together and is_touched(pairs, bodies, c, now, walls):
            run.suspect = c
            return TOUCHING
        row = None if rows is None else rows[done]
        first, last, rebound = event(run, pairs, bodies, c, now, rule, row, walls)
        run.events += 1
        done += 1
        if fastest is not None:
            below, above = velocities(bodies[c], bodies[c + 1], run.gravity, now)
            fastest[0] = max(fastest[0], abs(below), abs(above))
        refresh(run, pairs, bodies, queue, first, last, walls)
        if RING:
            refresh_across(run, pairs, bodies, queue, first, last, walls)
        if stop == APART:
            closes = approaching(pairs, bodies, closes, now, walls)
            if closes < 0:
                return UNTIL
        # Last, so that the queue is consistent when the loop returns.
        if pairs[c].streak >= SUSPICIOUS_STREAK:
            run.suspect, run.rebound = c, rebound
            return SUSPECT


@kernel
def head(queue: Any) -> tuple[float, int]:
    """Return the time and the pair of the next event."""
    now, key = queue[0][0]
    return now, key & MASK


@kernel
def refresh(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict pairs `first` to `last` again.

    Pairs that never collide are not in the queue.
    """
    order, entry, add = queue
    due, c = order[0][1] & MASK, first
    if first <= due <= last:  # the first entry needs no search
        entry[due] = (math.inf, order.pop(0)[1])
    while c <= last:
        old, pair = entry[c], pairs[c]
        time = predicted(pair, bodies[c], bodies[c + 1], walls)
        new = (time, rank(c, RANDOM, run.seed, pair.contacts) if run.order == RANDOM else old[1])
        if new != old:
            if old[0] < math.inf:
                order.remove(old)
            entry[c] = new
            if time < math.inf:
                add(new)
        pressed = pair.closing_acceleration > 0.0 or (FORCED and pair.wall >= 0)
        if pressed and time == math.inf and (not FORCED or pair.gap == 0.0):  # tested here: a call costs time
            low, high = rest(run, pairs, bodies, c, walls)
            last = max(last, high)
            c = low
        else:
            c += 1


@kernel
def refresh_across(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict the two pairs at the seam of a ring again.

    Does nothing unless one of them is among pairs `first` to `last`.
    """
    end = len(pairs) - 1
    if first == 0 or last == end:
        refresh(run, pairs, bodies, queue, 0, 0, walls)
        refresh(run, pairs, bodies, queue, end, end, walls)


@cache
def made(
    how: Callable[[Any], Callable[..., Any]], has: tuple[str, ...], kernel: Callable[..., Any]
) -> Callable[..., Any]:
    """Return a kernel specialised for scenes with the flags `has`.

    `how` makes it an interpreted or a compiled function.
    """
    return how(fitted(kernel, **dict.fromkeys(has, True)))


class SortedQueue:
    """Advance a `State` event by event.

    Parameters
    ----------
    state : State
        State of the run, changed in place.
    physics : Physics
        Scene, rules and options of the run.
    """

    name = "sorted"
    chunk = 256
    """Events per call of the event loop, and log rows allocated at a time."""
    kernel: Callable[[Any], Any] = staticmethod(interpreted)
    hold: Callable[[Records], Records] = staticmethod(plain)
    loop, predict = staticmethod(loop), staticmethod(refresh)
    queue: Any

    def __init__(self, state: State, physics: Physics) -> None:
        state.keep(self.hold)
        self.state, self.physics = state, physics
        self.fit: Callable[[Any], Any] = partial(made, interpreted, physics.has)
        self.use: Callable[[Any], Any] = partial(made, self.kernel, physics.has)
        self.go, self.foresee = self.use(self.loop), self.use(self.predict)
        self.begin(len(state.pairs))
        self.rebuild()

    def rows(self, n: int) -> Records:
        """Return room for `n` rows of the log, at most `chunk` rows."""
        return list(map(object.__new__, repeat(plain_class(LOG_ROW), min(n, self.chunk))))

    def kept(self, rows: Records) -> Records:
        """Return rows of the log as they are stored, without the unused room behind them."""
        return rows

    def begin(self, n: int) -> None:
        """Create an empty queue for `n` pairs."""
        run = self.state.run
        entry = [(math.inf, rank(c, run.order, run.seed, self.state.pairs[c].contacts)) for c in range(n)]
        # a list is faster for few pairs
        order: Any = [LAST_ENTRY] if n < SMALL_RECORD_COUNT else SortedList([LAST_ENTRY])
        self.queue = order, entry, partial(insort, order) if n < SMALL_RECORD_COUNT else order.add

    def rebuild(self) -> None:
        """Predict all pairs again."""
        s = self.state
        self.foresee(s.run, s.pairs, s.bodies, self.queue, 0, len(s.pairs) - 1, s.walls)

    def shift_to(self, tau: float, whole: bool = True, shrink: float = 1.0) -> None:
        """Move the zero of time (see `State.shift_to`) and predict all pairs again."""
        self.state.shift_to(tau, self.use, whole, shrink)
        self.rebuild()

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` to `last` again, counted modulo the number of pairs."""
        s, n = self.state, len(self.state.pairs)
        around = [(0, max(0, last - n)), (n - 1, n - 1)] if s.ring else []
        for low, high in [(first, min(last, n - 1)), *around]:
            self.foresee(s.run, s.pairs, s.bodies, self.queue, low, high, s.walls)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time of the next event outside pairs `first` to `last`.

        Pairs are counted modulo the number of pairs. By default all pairs are included.
        """
        order, n = self.queue[0], len(self.state.pairs)
        if last < first:
            return float(order[0][0])
        return float(next(time for time, key in order if not first <= (key & MASK) <= last and (key & MASK) > last - n))

    def apart(self) -> bool:
        """Return whether no pair approaches."""
        s = self.state
        return bool(self.use(approaching)(s.pairs, s.bodies, 0, s.run.now, s.walls) < 0)

    def advance(self, edge: float, budget: int, log: Log | None) -> int:
        """Process events up to and including time `edge` and append them to `log`.

        At most `budget` events are processed, plus the rest of a touching group. Returns the reason of the pause.
        """
        s, run = self.state, self.state.run
        enough = run["events"] + budget
        while True:
            begin = run["events"]
            rows = None if log is None else self.rows(enough - begin)
            run["edge"], run["budget"] = edge, enough - begin if rows is None else len(rows)
            s.clock.dated = 0
            why: int = self.go(run, s.pairs, s.bodies, self.queue, self.physics.rule, rows, None, s.walls)
            if log is not None and rows is not None and run["events"] > begin:
                if s.clock.goal > -math.inf:
                    self.use(date_rows)(s.clock, rows, int(run["events"] - begin))
                log.append(self.kept(rows[: run["events"] - begin]))
            if why != TOUCHING:
                return why
            why, first, last = collide_as_one(s, self.physics, self.fit, log)
            self.refresh(first, last)
            if why == TOUCHING and run.stop_pair == APART and self.apart():
                why = UNTIL
            if why != TOUCHING:
                return why
