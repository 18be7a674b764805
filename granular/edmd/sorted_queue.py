"""Event loop of a run, and the reference event queue.

The queue is a `SortedList` of pairs of numbers (time, rank), one entry per pair of balls that will collide. The rank
contains the number of the pair and decides between simultaneous collisions, see `physics.rank`. For the epoch see
`granular.edmd.motion`.
"""

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
from granular.edmd.clusters import bring_to_rest
from granular.edmd.collision import SUSPICIOUS_STREAK, collide_pair, leave_wall
from granular.edmd.motion import approaching_pair_from, next_event_time, velocities
from granular.edmd.physics import GROUP, MASK, RANDOM, Physics, Restitution, rank
from granular.edmd.records import APART, BUDGET, FREE, LATER, LOG_ROW, SUSPECT, TOUCHING, UNTIL, Log, Walls
from granular.edmd.state import State
from granular.edmd.ties import collide_as_one, is_touched
from granular.edmd.wall_state import advance_epoch, date_rows

LAST_ENTRY = (math.inf, MASK)
"""Last entry of every queue, so that a queue is never empty."""


@kernel
def loop(
    run: Record, pairs: Records, bodies: Records, queue: Any, rule: Restitution | None, rows: Records | None,
    fastest: Records | None, walls: Walls,
) -> int:
    """Process events until the time `run.edge`, at most `run.budget` events.

    `rule` returns the coefficient of restitution, or is None for constant rules. If `rows` is not None, it receives
    the contact log. If `fastest` is an array, its entry is raised to the largest speed (m/s) after any collision.
    Returns the reason of the pause, such as `LATER` or `BUDGET` of `granular.edmd.records`.
    """
    edge, budget, stop, together = run.edge, run.budget, run.stop_pair, run.order == GROUP
    done, approaching_pair = 0, 0
    while True:
        now, c = head(queue)
        if now > edge:
            # With driven walls a flight can be longer than the window, so the loop moves the epoch itself.
            if not FORCED or not advance_epoch(run, pairs, bodies, rows, done, now, walls):
                return LATER
            refresh(run, pairs, bodies, queue, 0, len(pairs) - 1, walls)
            edge = run.edge
            continue
        opens = FORCED and pairs[c].stuck > FREE
        # Before the budget test: a stop condition has priority over a limit.
        if c == stop and pairs[c].contacts >= run.stop_contacts and not opens:
            run.now = now
            return UNTIL
        if done >= budget:
            return BUDGET
        run.now = now
        if opens:
            first, last = leave_wall(run, pairs, bodies, c, now, walls)
            refresh(run, pairs, bodies, queue, first, last, walls)
            continue
        # Before `collide_pair`: a group is solved as a whole by `collide_as_one`.
        if together and is_touched(pairs, bodies, c, now, walls):
            run.suspect = c
            return TOUCHING
        row = None if rows is None else rows[done]
        first, last, rebound = collide_pair(run, pairs, bodies, c, now, rule, row, walls)
        run.events += 1
        done += 1
        if fastest is not None:
            below, above = velocities(bodies[c], bodies[c + 1], run.gravity, now)
            fastest[0] = max(fastest[0], abs(below), abs(above))
        refresh(run, pairs, bodies, queue, first, last, walls)
        if RING:
            refresh_across(run, pairs, bodies, queue, first, last, walls)
        if stop == APART:
            approaching_pair = approaching_pair_from(pairs, bodies, approaching_pair, now, walls)
            if approaching_pair < 0:
                return UNTIL
        # Last, so that the queue is consistent when the loop returns.
        if pairs[c].streak >= SUSPICIOUS_STREAK:
            run.suspect, run.rebound = c, rebound
            return SUSPECT


@kernel
def head(queue: Any) -> tuple[float, int]:
    """Return the time (s since the epoch) and the pair of the next event."""
    now, key = queue[0][0]
    return now, key & MASK


@kernel
def refresh(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict pairs `first` to `last` again and update their entries in the queue.

    Pairs without a next event have no entry. If bodies are pressed together but have no next event, they can have come
    to rest, see `clusters.bring_to_rest`. The pairs that this changes are predicted again as well.
    """
    order, entry, add = queue
    due, c = order[0][1] & MASK, first
    if first <= due <= last:  # the first entry needs no search
        entry[due] = (math.inf, order.pop(0)[1])
    while c <= last:
        old, pair = entry[c], pairs[c]
        time = next_event_time(pair, bodies[c], bodies[c + 1], walls)
        new = (time, rank(c, RANDOM, run.seed, pair.contacts) if run.order == RANDOM else old[1])
        if new != old:
            if old[0] < math.inf:
                order.remove(old)
            entry[c] = new
            if time < math.inf:
                add(new)
        pressed = pair.closing_acceleration > 0.0 or (FORCED and pair.wall >= 0)
        if pressed and time == math.inf and (not FORCED or pair.gap == 0.0):  # tested here: a call costs time
            low, high = bring_to_rest(run, pairs, bodies, c, walls)
            last = max(last, high)
            c = low
        else:
            c += 1


@kernel
def refresh_across(
    run: Record, pairs: Records, bodies: Records, queue: Any, first: int, last: int, walls: Walls
) -> None:
    """Predict both pairs at the seam of a ring again.

    The function does nothing if neither of them is in the range from pair `first` to pair `last`.
    """
    end = len(pairs) - 1
    if first == 0 or last == end:
        refresh(run, pairs, bodies, queue, 0, 0, walls)
        refresh(run, pairs, bodies, queue, end, end, walls)


@cache
def specialised_kernel(
    convert: Callable[[Any], Callable[..., Any]], flags: tuple[str, ...], kernel: Callable[..., Any]
) -> Callable[..., Any]:
    """Return a kernel that is specialised for scenes with the kernel flags `flags`.

    `convert` turns the specialised kernel into an interpreted or a compiled function. Results are cached.
    """
    return convert(fitted(kernel, **dict.fromkeys(flags, True)))


class SortedQueue:
    """Event queue that advances a `State` event by event, interpreted.

    Parameters
    ----------
    state : State
        State of the run, changed in place.
    physics : Physics
        Scene, rules and options of the run.

    Attributes
    ----------
    fit, specialise : callable
        Specialise a kernel for the flags of the scene. `fit` returns an interpreted function. `specialise` returns a
        function of the kind of this queue, interpreted or compiled.
    convert : callable
        Converts records to the kind that this queue uses, objects or arrays.
    run_loop, predict_pairs : callable
        The event loop and the function `refresh`, both specialised by `specialise`.
    """

    name = "sorted"
    chunk = 256
    """Maximum number of events per call of the event loop.

    It is also the maximum number of log rows per allocation.
    """
    kernel: Callable[[Any], Any] = staticmethod(interpreted)
    convert: Callable[[Records], Records] = staticmethod(plain)
    loop, predict = staticmethod(loop), staticmethod(refresh)
    queue: Any

    def __init__(self, state: State, physics: Physics) -> None:
        state.convert_records(self.convert)
        self.state, self.physics = state, physics
        self.fit: Callable[[Any], Any] = partial(specialised_kernel, interpreted, physics.has)
        self.specialise: Callable[[Any], Any] = partial(specialised_kernel, self.kernel, physics.has)
        self.run_loop, self.predict_pairs = self.specialise(self.loop), self.specialise(self.predict)
        self.begin(len(state.pairs))
        self.rebuild()

    def rows(self, n: int) -> Records:
        """Return `n` empty log rows, or `chunk` rows if `n` is larger."""
        return list(map(object.__new__, repeat(plain_class(LOG_ROW), min(n, self.chunk))))

    def filled_rows(self, rows: Records) -> Records:
        """Return filled log rows in the form in which the log stores them."""
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
        self.predict_pairs(s.run, s.pairs, s.bodies, self.queue, 0, len(s.pairs) - 1, s.walls)

    def shift_to(self, tau: float, whole: bool = True, shrink: float = 1.0) -> None:
        """Move the epoch as `State.shift_to` does, and predict all pairs again."""
        self.state.shift_to(tau, self.specialise, whole, shrink)
        self.rebuild()

    def refresh(self, first: int, last: int) -> None:
        """Predict pairs `first` to `last` again, counted modulo the number of pairs."""
        s, n = self.state, len(self.state.pairs)
        ranges = [(0, max(0, last - n)), (n - 1, n - 1)] if s.ring else []
        for low, high in [(first, min(last, n - 1)), *ranges]:
            self.predict_pairs(s.run, s.pairs, s.bodies, self.queue, low, high, s.walls)

    def soonest(self, first: int = 0, last: int = -1) -> float:
        """Return the time (s since the epoch) of the next event, or inf.

        Events of pairs `first` to `last`, counted modulo the number of pairs, are ignored. By default no pair is
        ignored.
        """
        order, n = self.queue[0], len(self.state.pairs)
        if last < first:
            return float(order[0][0])
        return float(next(time for time, key in order if not first <= (key & MASK) <= last and (key & MASK) > last - n))

    def all_recede(self) -> bool:
        """Return whether no pair approaches at the current time."""
        s = self.state
        return bool(self.specialise(approaching_pair_from)(s.pairs, s.bodies, 0, s.run.now, s.walls) < 0)

    def advance(self, edge: float, budget: int, log: Log | None) -> int:
        """Process events up to and including `edge` (s since the epoch), and log them.

        At most `budget` events are processed, plus the rest of a touching group. Log rows are appended to `log`.
        Returns the reason of the pause.
        """
        s, run = self.state, self.state.run
        enough = run["events"] + budget
        while True:
            begin = run["events"]
            rows = None if log is None else self.rows(enough - begin)
            run["edge"], run["budget"] = edge, enough - begin if rows is None else len(rows)
            s.clock.dated = 0
            why: int = self.run_loop(run, s.pairs, s.bodies, self.queue, self.physics.rule, rows, None, s.walls)
            if log is not None and rows is not None and run["events"] > begin:
                if s.clock.goal > -math.inf:
                    self.specialise(date_rows)(s.clock, rows, int(run["events"] - begin))
                log.append(self.filled_rows(rows[: run["events"] - begin]))
            if why != TOUCHING:
                return why
            why, first, last = collide_as_one(s, self.physics, self.fit, log)
            self.refresh(first, last)
            if why == TOUCHING and run.stop_pair == APART and self.all_recede():
                why = UNTIL
            if why != TOUCHING:
                return why
