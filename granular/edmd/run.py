"""One hard-sphere run: advance the event queue from pause to pause.

`Run` implements the protocol `granular.run.drive.Run`. For epoch, window and slice see `granular.edmd.motion`.
"""

from __future__ import annotations

import math
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import EDITED_STATE
from granular._engine.records import record_array
from granular.edmd import wall_state
from granular.edmd.ending import end_of_run
from granular.edmd.epoch import LATEST_TIME
from granular.edmd.physics import GROUP, TIE_ORDERS, Physics, scales
from granular.edmd.queue_choice import compilation_pays, compiled_queue_class, expected_work, work_before_start
from granular.edmd.records import APART, BUDGET, EACH, LATER, LOG_ROW, NEVER, SUSPECT, UNTIL
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import State
from granular.run.contact_log import Rows
from granular.run.drive import End, Pause, Request, Row, next_portion
from granular.run.until import Contact, Force, Separated
from granular.scene import velocities
from granular.scene.places import WallMeeting

if TYPE_CHECKING:
    from granular.edmd import collapse
    from granular.edmd.watch import Watch

TAIL_DIVISOR = 8
"""Divisor of `max_events` that gives the length of the last part of a run.

If a run ends at `max_events`, the pace of the last part is compared with the pace before.
"""
REPORT_EVENTS = 4096
"""Number of events after which log rows and the progress are reported."""
FIRST_CHUNK_EVENTS = 8
"""Number of events per call of the event loop before its speed has been measured."""


class Run:
    """A hard-sphere run in progress.

    Parameters
    ----------
    physics : Physics
        Scene, rules and options.
    state : State
        State of the run, changed in place.
    engine : str
        Engine as returned by `checked_engine`.
    request : Request
        End time, stop condition, samples and log of the run.
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
        self.counts_at_start = request.start, self.events, int(state.run.zoomed)
        self.may_compile = engine == "auto"
        is_compiled = engine == "compiled" or (
            self.may_compile and compilation_pays(work_before_start(request, len(self.scene.gap)), physics.has))
        self._replace_queue(compiled_queue_class(state, self.scene) if is_compiled else SortedQueue)
        self.event_limit = 1 if request.singly else request.max_events
        self.last_part_start = state.clock.last_event - request.max_events // TAIL_DIVISOR
        self.pace = [(self.events, request.start)]  # at the start and where the last part begins
        self.verdict: collapse.Verdict | None = None
        self.ended, self.at_rest = math.nan, False  # s, time of a collapse; whether all balls rest after it
        self.converted_rows: list[Rows] = []
        self.fall = self.scene.gravity - float(state.run.gravity)  # m/s², acceleration of the falling frame of the run
        self.drift = float(state.clock.frame)  # m/s
        enclosed = bool(self.scene.is_wall[0] and self.scene.is_wall[-1])
        self.closing = WallMeeting(self.scene, self.start) if enclosed else None
        self.horizon = math.inf if self.closing is None else self.closing.horizon  # s, then no room is left
        self.halvings = 0  # number of times that closing walls have halved the room
        if self.horizon < math.inf and state.clock.length > 0.0:
            self.halvings = round(math.log2(scales(self.scene)[2] / state.clock.length))
        can_move_epoch = TIE_ORDERS[physics.options["ties"]] != GROUP and not enclosed
        self.keeps_rows = request.rows or watch is not None
        # the kernels then move the epoch themselves
        self.kernels_move_epoch = self.scene.driven and can_move_epoch and watch is None

    def _replace_queue(self, queue: type[SortedQueue]) -> None:
        """Replace the event queue by a queue of the class `queue`.

        If the run is in relative coordinates, the gaps in the state are outdated, and the slice is kept.
        """
        state = self.state
        if state.near is None:
            self.queue = queue(state, self.physics)
        else:
            state.convert_records(queue.convert)
            self.queue = queue(state.copied(), self.physics)
            self.queue.state = state
        if queue is SortedQueue:
            self.queue.chunk = FIRST_CHUNK_EVENTS  # a user's rule can be slow
        else:
            self.may_compile = False

    def to(self, time: float, last: bool) -> Pause:
        """Advance the run towards the time `time` (s), and return the reason of the pause.

        A call processes at most several thousand events, and ends earlier if the run ends. `last` is True if no later
        sample is requested. If it is False, no event is processed at the start time.
        """
        state, events_before, rounded_due = self.state, self.events, -math.inf
        while last or time > self.request.start:
            halving_time = self._next_halving_time(time) if self.scene.driven or self.horizon < math.inf else math.inf
            limit, events_at_pause, rounded_due = max(
                state.tau(min(time, self.horizon, halving_time)), rounded_due), self.events, -math.inf
            if time >= self.horizon and limit <= state.run["now"]:
                return Pause.collapse
            reason, due = self._advance(limit, time, last)
            if self.request.singly and self.events > events_before and reason == LATER:
                return Pause.full
            limit = state.tau(time) if self.kernels_move_epoch else limit
            if self.verdict is not None and not self.at_rest and not self._comes_to_rest(self.verdict):
                return Pause.bounded if self.verdict.kind == "bounded" else Pause.collapse
            if reason == UNTIL:
                return Pause.until
            if reason == LATER:
                if halving_time < min(time, self.horizon) and due > limit:
                    self._halve_window(limit)
                    continue
                rounds_to_time, is_beyond_window = (
                    limit < due <= limit + 2.0 * math.ulp(time) < math.inf, due >= state.clock.window)
                if rounds_to_time and not is_beyond_window and state.time(due) <= time < self.horizon:
                    rounded_due = due  # rounds to `time`, so it is processed as an event at `time`
                    continue
                if not (rounds_to_time and is_beyond_window) and (due > limit or due == math.inf):
                    if self.events == state.clock.last_event and not last and self._is_budget_spent(due):
                        time, last = self.request.end, True
                    elif not self._finds_meeting_before(time):
                        return self._set_time_reached(time, limit)
                    continue
                if state.clock.epoch + due > LATEST_TIME:
                    return Pause.work
                self.queue.shift_to(due)
            elif reason == SUSPECT:
                self._handle_suspicion()
            # no event was processed (a group exceeds the budget), or the limit is reached
            elif reason == BUDGET and self.events in (events_at_pause, state.clock.last_event):
                self.verdict = self._collapse_module.verdict_at_limit(state, self.physics)
                return Pause.work if self.verdict is None else Pause.bounded
            if self.events - events_before >= min(
                self.event_limit, self.queue.chunk if self.queue.chunk < SortedQueue.chunk else REPORT_EVENTS
            ):
                return Pause.full
        return Pause.reached

    def _next_halving_time(self, time: float) -> float:
        """Return the time in s of the next halving of the window by closing walls, or inf.

        For driven walls the result is inf. The search for the time at which they meet is then extended to the end of
        the window, but not beyond `time` (s).
        """
        if self.scene.driven and self.closing is not None:
            self._finds_meeting_before(min(time, float(self.state.time(self.state.clock.window))))
        return self.horizon if self.horizon == math.inf else self._undriven_halving_time()

    def _halve_window(self, limit: float) -> None:
        """Move the epoch to the time `limit` (s since the epoch), and halve the window."""
        self.queue.shift_to(limit, whole=False, shrink=0.5)
        self.halvings += 1

    def _comes_to_rest(self, verdict: collapse.Verdict) -> bool:
        """Record the time of a collapse, and return whether the run continues at rest.

        It continues if the collapse is *exact*, if all balls then rest on a wall, and if the end time is finite.
        """
        self.ended = self.time()
        self.at_rest = verdict.kind == "exact" and self.request.end < math.inf and self.state.is_still()
        return self.at_rest

    def _handle_suspicion(self) -> None:
        """Move the epoch, or start relative coordinates, after a suspected collapse.

        The epoch is moved if balls can merge and collide too soon for the resolution of the clock.
        """
        if self.state.run["slow"] < 0.0:  # balls that merge faster than the resolution of the clock
            self.queue.shift_to(float(self.state.run["now"]), whole=False)
        else:
            self._collapse_module.begin(self.state, self.queue)

    @property
    def _collapse_module(self) -> Any:
        """The module `collapse`, imported at the first suspicion of an inelastic collapse."""
        from granular.edmd import collapse

        return collapse

    def rest(self, pair: Any, time: Any) -> None:
        """Prepare a resumed run whose balls all came to rest before it.

        The last ball came to rest on the wall of `pair` at the time `time` in s. Raises `ValueError` if a ball of the
        state moves.
        """
        self.verdict = self._collapse_module.Verdict("exact", int(pair), int(pair), 0.0)
        self.ended, self.at_rest = float(time), True
        if not self.state.is_still():
            raise ValueError(f"The state of `trajectory` has a collapse_time although balls move. {EDITED_STATE}")

    def _undriven_halving_time(self) -> float:
        """Return the time in s at which closing undriven walls have halved the room again.

        The room is the sum of all gaps. At this time the epoch is moved and the window is halved. Otherwise the
        rounding error of a collision time would become larger than the time between two collisions. The result is inf
        if the walls do not meet, if they are driven, or if the run is in relative coordinates.
        """
        assert self.closing is not None
        if self.scene.driven or not 0.0 < self.closing.after < math.inf or self.state.near is not None:
            return math.inf
        after = self.closing.after
        return self.start + after - math.ldexp(after, -self.halvings - 1)

    def _finds_meeting_before(self, time: float) -> bool:
        """Return whether driven walls are newly found to meet before the time `time` in s."""
        horizon_before = self.horizon
        if self.closing is not None:
            self.horizon = self.closing.search_until(min(time, self.request.end))
        return self.horizon < horizon_before

    def _is_budget_spent(self, due: float) -> bool:
        """Return whether `max_events` ends the run before its next event.

        `due` is the time of this event in s since the epoch. If the result is True, no further sample is recorded. The
        result is False if no further event is due before the end of the run, or if the next event meets the stop
        condition. It is also False with driven walls and in relative coordinates, where the next event is not known.
        """
        end, stop = min(self.request.end, self.horizon), self.state.run.stop_pair
        if not due < math.inf or self.state.time(due) > end or self.scene.driven:
            return False
        has_stop_pair = stop >= 0 and self.state.pairs[stop].contacts >= self.state.run.stop_contacts
        return not (has_stop_pair and self.queue.soonest(stop, stop) > due)

    def _set_time_reached(self, time: float, limit: float) -> Pause:
        """Set the current time to `time` (s), or to the time at which no room is left.

        `limit` is this time in s since the epoch. No event is due before it. Returns the reason of the pause, which is
        `Pause.quiet` if no event follows and the run has no end time.
        """
        if time == self.horizon == math.inf:
            return Pause.quiet
        self.state.run["now"] = max(limit, float(self.state.run["now"]))
        return Pause.reached if time <= self.horizon else Pause.collapse

    def _advance(self, limit: float, time: float, last: bool) -> tuple[int, float]:
        """Process the events that are due up to `limit` (s since the epoch).

        `time` and `last` are the arguments of `to`. The number of events per call is limited. The run switches to the
        compiled queue as soon as this saves time. Returns the reason of the pause, and the time of the next event if
        the reason is `LATER`. This time is inf in relative coordinates, where the next event is not known.
        """
        state = self.state
        if self.kernels_move_epoch:
            state.clock.goal = time
        due = self.queue.soonest()
        is_due = due <= limit and (self.kernels_move_epoch or due < state.clock.window)
        if not is_due and state.near is None and not (last and self.kernels_move_epoch):
            return LATER, due
        if self.may_compile and compilation_pays(expected_work(self), self.physics.has):
            self._replace_queue(compiled_queue_class(state, self.scene))
        # pause where the last part of the allowed events begins, so that its pace can be compared with the pace before
        goal = self.last_part_start if self.events < self.last_part_start else state.clock.last_event
        budget, begun, before = min(self.queue.chunk, self.event_limit, goal - self.events), process_time(), self.events
        rows: list[Any] | None = [] if self.keeps_rows else None
        if state.near is None:
            # an event at the end of the window belongs to the next window (see granular.edmd.motion)
            reason = self.queue.advance(min(limit, math.nextafter(state.clock.window, 0.0)), budget, rows)
        else:
            reason, self.verdict = self._collapse_module.advance_slice(
                state, self.physics, self.queue, limit, budget, rows)
        self.events = int(state.run["events"])
        if self.events > before and self.queue.chunk < SortedQueue.chunk:  # slow rules report more often
            self.queue.chunk = min(SortedQueue.chunk, next_portion(budget, process_time() - begun))
        if rows and self.events > before:
            self._convert_rows(rows)
        if len(self.pace) == 1 and self.events >= self.last_part_start:
            self.pace.append((self.events, self.time()))
        if reason == LATER:
            due = math.inf if state.near is not None else self.queue.soonest()
        return reason, due

    def _convert_rows(self, written: list[Any]) -> None:
        """Convert new log rows to times in s and to velocities in the frame of the scene.

        Queues write times since the epoch, and velocities in the frame of the run, which can be falling.
        """
        for chunk in filter(len, written):
            rows = record_array(chunk, LOG_ROW)
            if self.kernels_move_epoch:
                self.converted_rows.extend([rows] if self.request.rows else [])
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
            self.converted_rows.append(rows)

    def rows(self) -> list[Rows]:
        """Return the log rows of the collisions since the last call."""
        settled, self.converted_rows = self.converted_rows, []
        return settled

    def time(self) -> float:
        """Return the current time of the run in s."""
        return float(self.state.time(self.state.run["now"]))

    def progress(self) -> tuple[float, int]:
        """Return the current time in s and the number of collisions so far."""
        return self.time(), self.events

    def row(self, time: float) -> Row:
        """Return the sample at the current time, which is `time` in s."""
        state = self.state
        if time == self.start and self.events == 0 and state.walls is None and not state.hung:
            return Row(time, 0.0, self.scene.gap, self.scene.velocity)
        if state.near is not None and state.run["looked"] > 0:
            state = state.copied()
            self._collapse_module.write_slice_back(state, self.queue)
        now = float(state.run["now"])
        velocity, gap = state.row(now)
        elapsed = float(state.elapsed(now))
        ledger = wall_state.energy_account(state, now) if self.scene.driven or self.scene.heated else None
        if state.hung:  # rates of gaps, not velocities of balls
            velocity = velocities(self.scene, velocity[None], np.array([elapsed]), self.start)[0]
            return Row(time, elapsed, gap, np.where(self.scene.is_wall, 0.0, velocity))
        fallen = self.fall * elapsed - self.drift
        return Row(time, elapsed, gap, velocity - fallen if fallen != 0.0 else velocity, ledger=ledger)

    def end(self, pause: Pause, seen: float) -> End:
        """Finish the run and return its `End`, see `end_of_run`."""
        return end_of_run(self, pause, seen)
