"""One run: advance the event queue to the next pause and handle the pause."""

from __future__ import annotations

import math
from functools import partial
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import EDITED_STATE
from granular._engine.kernels import fitted, worth
from granular._engine.records import SMALL_RECORD_COUNT, column, packed
from granular.edmd import hanging, wall_state
from granular.edmd.ending import counters, sentence
from granular.edmd.motion import LATEST_TIME
from granular.edmd.physics import GROUP, TIE_ORDERS, Physics, scales
from granular.edmd.records import APART, BUDGET, EACH, LATER, LOG_ROW, NEVER, SUSPECT, UNTIL
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State
from granular.run.contact_log import Rows
from granular.run.drive import End, Pause, Request, Row, portion
from granular.run.trajectory import Status
from granular.run.until import Contact, Force, Separated
from granular.scene import velocities
from granular.scene.places import Closing

if TYPE_CHECKING:
    from granular.edmd import collapse
    from granular.edmd.watch import Watch

TAIL_DIVISOR = 8
"""Divisor of the last part of a run whose pace at `max_events` is compared."""
REPORT_EVENTS = 4096
"""Number of events between two calls that hand over rows and report progress."""
FIRST_CHUNK_EVENTS = 8
"""Number of events before the duration of a collision has been measured."""
LOADING_WORK, COMPILING_WORK = 100_000, 500_000
"""Work (in collisions) from which compiled code pays.

`LOADING_WORK` applies if the machine code is in the cache, `COMPILING_WORK` if it has to be compiled.
"""
EXPECTED_PER_PAIR = 25
"""Assumed number of collisions per pair before the run."""
EXTRAPOLATION_WORK = 2048
"""Work (in collisions) from which the remaining work is extrapolated."""


class Run:
    """A run in progress.

    Parameters
    ----------
    physics : Physics
        Scene, rules and options.
    state : State
        State of the run, changed in place.
    engine : str
        Engine as returned by `checked_engine`.
    request : Request
        End, samples and log that are requested.
    watch : Watch, optional
        Counts the collisions whose soft contacts would overlap.
    """

    in_order = True
    adds_up = True
    law = None

    def __init__(
        self, physics: Physics, state: State, engine: str, request: Request, watch: Watch | None = None
    ) -> None:
        self.physics, self.state, self.request, self.watch = physics, state, request, watch
        self.scene, self.rule, self.start = physics.scene, physics.rules, float(state.clock.start)
        pair, contacts = APART if isinstance(request.until, Separated) else EACH if request.singly else NEVER, 0
        if isinstance(request.until, Force):
            raise ValueError(f"`until` must not be a force for hard spheres, whose collisions are instantaneous, got "
                             f"{request.until!r}. Use until.speed or until.contact, or soft spheres (granular.md).")
        if isinstance(request.until, Contact):
            pair, contacts = request.until.pair, request.until.nth - 1
        state.run.stop_pair, state.run.stop_contacts = pair, contacts
        self.events = int(state.run.events)
        state.clock.last_event = self.events + request.max_events
        self.began = request.start, self._work()
        self.may_compile = engine == "auto"
        n = len(self.scene.gap)  # setting up a ball costs as much as a collision, a sample of it 1/16
        shown = 0 if request.samples is None else n * np.size(request.samples) // 16
        work = n + min(EXPECTED_PER_PAIR * n, request.max_events) + shown
        fast = engine == "compiled" or (self.may_compile and pays(work, physics.has))
        self._go_on_with(self._compiled() if fast else SortedQueue)
        self.most = 1 if request.singly else request.max_events
        self.tail = state.clock.last_event - request.max_events // TAIL_DIVISOR
        self.pace = [(self.events, request.start)]  # at the start and where the last part begins
        self.verdict: collapse.Verdict | None = None
        self.ended, self.at_rest = math.nan, False  # s, time of a collapse; whether all balls rest after it
        self.settled: list[Rows] = []
        self.fall = self.scene.gravity - float(state.run.gravity)  # m/s², acceleration of the falling frame of the run
        self.drift = float(state.clock.frame)  # m/s
        enclosed = bool(self.scene.is_wall[0] and self.scene.is_wall[-1])
        self.closing = Closing(self.scene, self.start) if enclosed else None
        self.horizon = math.inf if self.closing is None else self.closing.horizon  # s, then no room is left
        self.halvings = 0  # number of times that closing walls have halved the room
        if self.horizon < math.inf and state.clock.length > 0.0:
            self.halvings = round(math.log2(scales(self.scene)[2] / state.clock.length))
        single = TIE_ORDERS[physics.options["ties"]] != GROUP and not enclosed
        self.keeps_rows = request.rows or watch is not None
        self.moves_on = self.scene.driven and single and watch is None  # kernels move the zero of time themselves

    def _compiled(self) -> type[SortedQueue]:
        from granular.edmd import compiled_queue

        self.may_compile = False
        in_blocks = self.scene.n > compiled_queue.BLOCKS_ABOVE and self.state.walls is None and not self.scene.endless
        return compiled_queue.BlockQueue if in_blocks else compiled_queue.TreeQueue

    def _go_on_with(self, queue: type[SortedQueue]) -> None:
        """Continue with another queue.

        A slice in relative coordinates, whose gaps in the state are outdated, is kept.
        """
        state = self.state
        if state.near is None:
            self.queue = queue(state, self.physics)
        else:
            state.keep(queue.hold)
            self.queue = queue(state.copied(), self.physics)
            self.queue.state = state
        if queue is SortedQueue:
            self.queue.chunk = FIRST_CHUNK_EVENTS  # a user's rule can be slow

    def to(self, time: float, last: bool) -> Pause:
        """Advance towards `time`, by some thousand events at most.

        Stops earlier at the end of the run. At the start of the run no event is processed.
        """
        state, seen, late = self.state, self.events, -math.inf
        while last or time > self.request.start:
            halved = self._next_halving(time) if self.scene.driven or self.horizon < math.inf else math.inf
            limit, before, late = max(state.tau(min(time, self.horizon, halved)), late), self.events, -math.inf
            if time >= self.horizon and limit <= state.run["now"]:
                return Pause.collapse
            if self.moves_on:
                state.clock.goal = time
            due = self.queue.soonest()
            acts = due <= limit and (self.moves_on or due < state.clock.window)  # saves a call if no event is due
            why = self._advance(limit) if acts or state.near is not None or (last and self.moves_on) else LATER
            if self.request.singly and self.events > seen and why == LATER:
                return Pause.full
            limit = state.tau(time) if self.moves_on else limit
            if self.verdict is not None and not self.at_rest and not self._comes_to_rest(self.verdict):
                return Pause.bounded if self.verdict.kind == "bounded" else Pause.collapse
            if why == UNTIL:
                return Pause.until
            if why == LATER:
                due = math.inf if state.near is not None else self.queue.soonest()
                if halved < min(time, self.horizon) and due > limit:
                    self._halve(limit)
                    continue
                close, later = limit < due <= limit + 2.0 * math.ulp(time) < math.inf, due >= state.clock.window
                if close and not later and state.time(due) <= time < self.horizon:
                    late = due  # rounds to `time`, so it is processed as an event at `time`
                    continue
                if not (close and later) and (due > limit or due == math.inf):
                    if self.events == state.clock.last_event and not last and self._is_spent(due):
                        time, last = self.request.end, True
                    elif not self._meet_before(time):
                        return self._reached(time, limit)
                    continue
                if state.clock.epoch + due > LATEST_TIME:
                    return Pause.work
                self.queue.shift_to(due)
            elif why == SUSPECT:
                self._look_closer()
            elif why == BUDGET and self.events in (before, state.clock.last_event):  # or a group exceeds the budget
                self.verdict = self._closer.left(state, self.physics)
                return Pause.work if self.verdict is None else Pause.bounded
            if self.events - seen >= min(
                self.most, self.queue.chunk if self.queue.chunk < SortedQueue.chunk else REPORT_EVENTS
            ):
                return Pause.full
        return Pause.reached

    def _next_halving(self, time: float) -> float:
        """Return the time of the next halving of the clock before walls meet, or inf."""
        if self.scene.driven and self.closing is not None:
            self._meet_before(min(time, float(self.state.time(self.state.clock.window))))
        return self.horizon if self.horizon == math.inf else self._halving()

    def _halve(self, limit: float) -> None:
        """Re-base the clock at `limit`, and halve its unit."""
        self.queue.shift_to(limit, whole=False, shrink=0.5)
        self.halvings += 1

    def _comes_to_rest(self, verdict: collapse.Verdict) -> bool:
        """Record the time of a collapse, and return whether the run continues at rest.

        The run continues if the collapse is exact, if all balls then rest on a wall, and if the end time is finite.
        """
        self.ended = self.time()
        self.at_rest = verdict.kind == "exact" and self.request.end < math.inf and self._is_still()
        return self.at_rest

    def _look_closer(self) -> None:
        """Shift the clock, or rescale coordinates near a possible collapse."""
        if self.state.run["slow"] < 0.0:  # balls that merge faster than the resolution of the clock
            self.queue.shift_to(float(self.state.run["now"]), whole=False)
        else:
            self._closer.begin(self.state, self.queue)

    @property
    def _closer(self) -> Any:
        """The module that detects an inelastic collapse; imported at the first suspicion."""
        from granular.edmd import collapse

        return collapse

    def rest(self, pair: Any, time: Any) -> None:
        """Continue a run whose last ball came to rest on the wall of `pair`.

        `time` is the time in s at which it came to rest.
        """
        self.verdict = self._closer.Verdict("exact", int(pair), int(pair), 0.0)
        self.ended, self.at_rest = float(time), True
        if not self._is_still():
            raise ValueError(f"The state of `trajectory` has a collapse_time although balls move. {EDITED_STATE}")

    def _is_still(self) -> bool:
        """Return whether all balls are at rest on a wall."""
        return not (column(self.state.bodies, "is_free").any() or np.ptp(column(self.state.bodies, "fall_velocity")))

    def _halving(self) -> float:
        """Return the time in s at which closing undriven walls have halved the room again.

        The result is inf if the clock cannot be re-based. The clock is re-based at this time, with a shorter window. A
        collision time with a rounding error of the first window would be uncertain by more than the time between two
        collisions.
        """
        assert self.closing is not None
        if self.scene.driven or not 0.0 < self.closing.after < math.inf or self.state.near is not None:
            return math.inf
        after = self.closing.after
        return self.start + after - math.ldexp(after, -self.halvings - 1)

    def _meet_before(self, time: float) -> bool:
        """Return whether driven walls are newly found to meet before `time`."""
        known = self.horizon
        if self.closing is not None:
            self.horizon = self.closing.look(min(time, self.request.end))
        return self.horizon < known

    def _is_spent(self, due: float) -> bool:
        """Return whether `max_events` ends the run before the event at `due` (tau).

        Then no later sample is recorded. Beside driven walls and in relative coordinates the answer is not known, and
        the result is False.
        """
        end, stop = min(self.request.end, self.horizon), self.state.run.stop_pair
        if not due < math.inf or self.state.time(due) > end or self.scene.driven:
            return False
        stops = stop >= 0 and self.state.pairs[stop].contacts >= self.state.run.stop_contacts
        return not (stops and self.queue.soonest(stop, stop) > due)

    def _reached(self, time: float, limit: float) -> Pause:
        """Set the time to `time` (tau = `limit`), or to the time at which no room is left.

        No event happens before.
        """
        if time == self.horizon == math.inf:
            return Pause.quiet
        self.state.run["now"] = max(limit, float(self.state.run["now"]))
        return Pause.reached if time <= self.horizon else Pause.collapse

    def _advance(self, limit: float) -> int:
        """Process events towards tau = `limit`, and return the reason of the pause.

        The run switches to the compiled queue as soon as that pays.
        """
        state = self.state
        if self.may_compile and pays(self._expected(), self.physics.has):
            self._go_on_with(self._compiled())
        goal = self.tail if self.events < self.tail else state.clock.last_event
        budget, begun, before = min(self.queue.chunk, self.most, goal - self.events), process_time(), self.events
        rows: list[Any] | None = [] if self.keeps_rows else None
        if state.near is None:
            why = self.queue.advance(min(limit, math.nextafter(state.clock.window, 0.0)), budget, rows)
        else:
            why, self.verdict = self._closer.advance_slice(state, self.physics, self.queue, limit, budget, rows)
        self.events = int(state.run["events"])
        if self.events > before and self.queue.chunk < SortedQueue.chunk:  # slow rules report more often
            self.queue.chunk = min(SortedQueue.chunk, portion(budget, process_time() - begun))
        if rows and self.events > before:
            self._settle(rows)
        if len(self.pace) == 1 and self.events >= self.tail:
            self.pace.append((self.events, self.time()))
        return why

    def _expected(self) -> float:
        """Return the expected remaining work in collisions.

        It is extrapolated from the pace so far, and is at least the work done so far.
        """
        begin, worked = self.began
        done, took, left = self._work() - worked, self.time() - begin, self.request.end - self.time()
        ahead = done / took * left if done >= EXTRAPOLATION_WORK and took > 0.0 and left < math.inf else 0.0
        return max(done, min(ahead, float(self.state.clock.last_event - self.events)))

    def _work(self) -> int:
        """Return the work so far in collisions.

        A collision in relative coordinates costs as much as eight others.
        """
        return int(self.state.run["events"] + 7 * self.state.run["zoomed"])

    def _settle(self, written: list[Any]) -> None:
        """Convert rows written since the last re-basing to times in s.

        Velocities are converted from the frame of the run, which can be falling.
        """
        for chunk in filter(len, written):
            rows = packed(chunk, LOG_ROW)
            if self.moves_on:
                self.settled.extend([rows] if self.request.rows else [])
                continue
            tau = rows["t_begin"].copy()
            rows["t_begin"] = self.state.time(tau)
            if self.watch is not None:
                self.watch.take(rows, tau, self.state, self.queue)
            if not self.request.rows:
                continue
            if self.fall > 0.0 or self.drift != 0.0:
                fallen = self.fall * self.state.elapsed(tau) - self.drift
                for name in ("lower_in", "upper_in", "lower_out", "upper_out"):
                    rows[name] -= fallen
            self.settled.append(rows)

    def rows(self) -> list[Rows]:
        """Return the contacts since the last call."""
        settled, self.settled = self.settled, []
        return settled

    def time(self) -> float:
        """Return the current time of the run in s."""
        return float(self.state.time(self.state.run["now"]))

    def progress(self) -> tuple[float, int]:
        """Return the current time in s and the number of collisions."""
        return self.time(), self.events

    def row(self, time: float) -> Row:
        """Return the sample at the current time."""
        state = self.state
        if time == self.start and self.events == 0 and state.walls is None and not state.hung:
            return Row(time, 0.0, self.scene.gap, self.scene.velocity)
        if state.near is not None and state.run["looked"] > 0:
            state = state.copied()
            self._closer.put_back(state, self.queue)
        now = float(state.run["now"])
        velocity, gap = state.row(now)
        elapsed = float(state.elapsed(now))
        ledger = wall_state.ledger(state, now) if self.scene.driven or self.scene.heated else None
        if state.hung:  # rates of gaps, not velocities of balls
            velocity = velocities(self.scene, velocity[None], np.array([elapsed]), self.start)[0]
            return Row(time, elapsed, gap, np.where(self.scene.is_wall, 0.0, velocity))
        fallen = self.fall * elapsed - self.drift
        return Row(time, elapsed, gap, velocity - fallen if fallen != 0.0 else velocity, ledger=ledger)

    def end(self, pause: Pause, seen: float) -> End:
        """Return the end of the run, with all data needed to continue."""
        now, status = self.time(), Status.collapse if self.at_rest else pause.value
        stop = self.request.end if pause is Pause.reached else now
        wanted = seen == -math.inf or (pause is not Pause.reached and (
            stop > seen or (seen == self.request.start and self.events > 0)))  # at the start: the initial state
        row, numbers = self.row(stop) if wanted else None, self.state.numbers()
        if self.scene.pendulum > 0.0 and not self.keeps_rows:
            hanging.settle(self.state, self.scene, self.row(now))
        when = now if math.isnan(self.ended) else self.ended
        message, stats, more = sentence(self, status, numbers, when), counters(self, numbers), self.physics.options
        if self.at_rest and self.verdict is not None:
            more = more | {"collapse_time": self.ended, "collapse_pair": self.verdict.first}
        if self.watch is not None:
            message, stats = message + self.watch.message(), stats | self.watch.stats()
            more = more | self.watch.checkpoint(self.state, self.queue)
        state = partial(self.state.checkpoint, numbers, more)
        # arrays save memory
        return End(row, status, message, stats, state if self.scene.n <= SMALL_RECORD_COUNT else state())


def pays(work: float, has: tuple[str, ...]) -> bool:
    """Return whether this work, in collisions, justifies compiled code.

    `has` are the kernel flags of the scene. The compiler is imported only if the work is sufficient.
    """
    if work < LOADING_WORK:
        return False
    from granular.edmd.compiled_queue import loop

    return worth(fitted(loop, **dict.fromkeys(has, True)), work, LOADING_WORK, COMPILING_WORK, inline=True)
