"""One run: advance the queue to the next thing that matters, and deal with it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from granular import until as conditions
from granular._check import Array
from granular._kernels import worth
from granular._walls import close_after
from granular.edmd import readout
from granular.edmd.collapse import Verdict, Zoom
from granular.edmd.model import Model
from granular.edmd.motion import approaching
from granular.edmd.sorted_queue import APART, NEVER, Pause, Rows, SortedQueue
from granular.edmd.state import State
from granular.edmd.tree_queue import TreeQueue, loop
from granular.edmd.zoom import BUDGET, LIMIT, OUTSIDE, QUIET, RESTS, SPENT, UNTIL, write_back
from granular.trajectory import CONTACT, Status

Queue = SortedQueue | TreeQueue
LONG, VERY_LONG = 100_000, 1_000_000
"""Work (in collisions) after which it pays to load the machine code, and to make it if it is not on the disk."""
TAIL = 8
"""The last of so many parts of a run that ends at `max_events` tells whether it has slowed down."""
REPORT = 4096
"""Events between two reports of progress."""
MARGIN = 2.0**-30
"""Closing walls end a run when this part of the free length between them is left: balls that bounce between them at
2/(1 - ε) times the speed of the walls make their sum of gaps uncertain by not much less."""
GOES_ON = {LIMIT: Pause.limit, UNTIL: Pause.until, BUDGET: Pause.budget}


class Run:
    """A run in progress.

    Parameters
    ----------
    state, model : State, Model
        What moves, and how; `state` is changed in place.
    zoom : Zoom or None
        A closer look that was interrupted.
    queue : pair of classes
        The queue to begin with, and the one to go over to after `LONG` collisions (or None).
    until : condition or None
        When to stop.
    max_events : int
        How many collisions of this run at most.
    log : bool
        Whether to keep the contacts.
    on_event, on_progress : callable or None
        Called with each contact; with time and number of events now and then.
    """

    def __init__(
        self,
        state: State,
        model: Model,
        zoom: Zoom | None,
        queue: tuple[type[Queue], type[Queue] | None],
        until: conditions.Until | None,
        max_events: int,
        log: bool,
        on_event: Callable[[Any], object] | None,
        on_progress: Callable[[float, int], object] | None,
    ) -> None:
        stop = (until.pair, until.nth - 1) if isinstance(until, conditions.Contact) else (NEVER, 0)
        if isinstance(until, conditions.Separated):
            stop = (APART, 0)
        self.state, self.model, self.zoom = state, model, zoom
        self.queue, self.faster = self._made(queue[0], stop), queue[1]
        self.worked = work(state)
        if zoom is not None:
            zoom.keep(self.queue.column)
        self.last_event = state.events + max_events
        self.keep, self.on_event, self.on_progress = log, on_event, on_progress
        self.contacts: list[np.ndarray[tuple[int], np.dtype[np.void]]] = []
        self.reported = state.events
        self.tail = self.last_event - max_events // TAIL
        self.pace = [(state.events, state.time(state.now))]  # at the beginning and where the tail begins
        self.verdict: Verdict | None = None
        self.fall = model.scene.gravity - model.gravity  # m/s², with which the frame of the run falls
        self.close_after = close_after(model.scene)
        self.horizon = state.start + (1.0 - MARGIN) * self.close_after  # s, the last time with room between the walls

    def to(self, time: float) -> Status | None:
        """Advance to `time` (s; may be inf); return why the run is over, None if `time` was reached."""
        state, idle = self.state, False
        while True:
            limit = state.tau(min(time, self.horizon))
            goal = self.tail if state.events < self.tail else self.last_event
            if time >= self.horizon and limit <= state.now:
                return Status.collapse
            left = self.last_event - state.events
            budget = left if idle else max(0, min(self.queue.chunk, goal - state.events))
            before = state.events
            log: Rows | None = [] if self.keep or self.on_event is not None else None
            pause: Pause | None
            if self.faster is not None and worth(loop, work(state) - self.worked, LONG, VERY_LONG, inline=True):
                self._go_over(self.faster)
            if self.zoom is None:
                pause = self.queue.advance(limit, budget, log)
            else:
                pause = self._look_closer(limit, budget, log)
            self._record(log)
            if len(self.pace) == 1 and state.events >= self.tail:
                self.pace.append((state.events, self.time()))
            if pause is Pause.limit:
                if time == self.horizon == math.inf:
                    return Status.quiet
                state.now = limit
                return None if time <= self.horizon else Status.collapse
            if self.verdict is not None:
                return Status.collapse
            if pause is Pause.until:
                return Status.until
            if pause is Pause.window:
                state.shift_to(self.queue.soonest(), self.model.gravity, self.queue.kernel)
                self.queue.rebuild()
            elif pause is Pause.suspect:
                self.zoom = Zoom.on(state, self.queue)
            idle = pause is Pause.budget and state.events == before  # before a group larger than the budget
            if pause is Pause.budget and (state.events >= self.last_event or (idle and budget == left)):
                return Status.max_events
            self._report()

    def _look_closer(self, limit: float, budget: int, log: Rows | None) -> Pause | None:
        """Go on with the zoom; close it when it ends, with or without a verdict, and return None."""
        zoom, state, model = self.zoom, self.state, self.model
        assert zoom is not None
        end, j = zoom.advance(state, model, self.queue, limit, budget, log)
        if end in GOES_ON:
            return GOES_ON[end]
        if end == RESTS:
            self.verdict = zoom.settle(state, model, j)
        elif end not in (OUTSIDE, QUIET):
            verdict = zoom.verdict(state, model, j)
            if verdict is not None and (end != SPENT or verdict.bound < 1e-9 * state.speed):
                self.verdict = verdict
            elif end == SPENT and zoom.patience_ends(state):
                self.verdict = zoom.faint(state, model, j)
                if self.verdict is None:
                    return None
            else:
                state.short = math.ldexp(state.short, -4)
                state.allowance *= 2
        zoom.close(state, self.queue)
        self.zoom = None
        if self.queue.stop[0] == APART and approaching(0, state.now, state.u, state.pull, state.noise) < 0:
            return Pause.until
        return None

    def _made(self, queue: type[Queue], stop: tuple[int, int]) -> Queue:
        """Return a new queue; to what is looked at closely, whose gaps in the state are old, it does nothing."""
        state = self.state
        before = [list(x) for x in (state.u, state.falls, state.gap, state.at, state.pull)]
        made = queue(state, self.model, stop)
        if self.zoom is not None:
            for now, old in zip((state.u, state.falls, state.gap, state.at, state.pull), before, strict=True):
                now[:] = old
        return made

    def _go_over(self, queue: type[Queue]) -> None:
        """Go on with another queue, whatever is going on."""
        self.queue, self.faster = self._made(queue, self.queue.stop), None
        if self.zoom is not None:
            self.zoom.keep(self.queue.column)

    def _record(self, log: Rows | None) -> None:
        """Keep and stream the contacts of `log`, which were seen since the last re-basing."""
        if not log:
            return
        raw = np.concatenate(log) if isinstance(log[0], np.ndarray) else np.array(log)
        rows = np.zeros(len(raw), CONTACT)
        rows["pair"] = raw[:, 0]
        rows["t_begin"] = rows["t_end"] = self.state.epoch + (self.state.epoch_low + raw[:, 1])
        rows["v_in"], rows["v_out"] = raw[:, 2:4], raw[:, 4:6]
        if self.fall > 0.0:
            fallen = self.fall * readout.elapsed(self.state, raw[:, 1:2])
            rows["v_in"] -= fallen
            rows["v_out"] -= fallen
        rows["force_max"] = np.nan
        rows["impulse"] = raw[:, 6]
        if self.keep:
            self.contacts.append(rows)
        if self.on_event is not None:
            for row in rows:
                self.on_event(row)

    def _report(self) -> None:
        if self.on_progress is not None and self.state.events - self.reported >= REPORT:
            self.reported = self.state.events
            self.on_progress(self.time(), self.state.events)

    def bound(self) -> Verdict | None:
        """Return what can be said of the slow pairs of a closer look that is not over."""
        if self.zoom is None or self.zoom.dial[1] == 0.0:
            return None
        collided = int(np.argmin(self.zoom.gap))
        verdict = self.zoom.verdict(self.state, self.model, collided)
        return verdict if verdict is not None and math.isfinite(verdict.bound) else None

    def log(self) -> np.ndarray[tuple[int], np.dtype[np.void]]:
        """Return all contacts kept."""
        return np.concatenate(self.contacts) if self.contacts else np.zeros(0, CONTACT)

    def time(self) -> float:
        """Return the time in s up to which the run has got."""
        return self.state.time(self.state.now)

    def row(self) -> tuple[float, Array, Array]:
        """Return the time since the start of the run (s), velocities and gaps now."""
        state = self.state
        if self.zoom is not None and self.zoom.dial[1] > 0.0:
            state = dataclasses.replace(
                state, u=state.u.copy(), noise=state.noise.copy(), gap=state.gap.copy(), at=state.at.copy(),
                streak=state.streak.copy(),
            )  # fmt: skip
            zoom = self.zoom
            tau = zoom.base + zoom.dial[0]
            write_back(zoom.first, zoom.gap, zoom.rate, tau, self.model.mass, state.u, state.noise, state.gap,
                       state.at, state.pull, state.streak)  # fmt: skip
        velocity = readout.velocities(state, state.now, self.model.gravity)
        elapsed = readout.elapsed(state, state.now)
        return elapsed, velocity - self.fall * elapsed, readout.gaps(state, state.now)

    def checkpoint(self) -> dict[str, Any]:
        """Return all that is needed to go on."""
        return self.state.checkpoint() | (self.zoom.checkpoint() if self.zoom is not None else {})


def work(state: State) -> int:
    """Return the work done so far in collisions; one looked at closely costs as much as eight."""
    return state.events + 7 * state.zoomed
