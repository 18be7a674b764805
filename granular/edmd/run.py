"""One run: advance the queue to the next thing that matters, and deal with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from granular._check import Array
from granular._kernels import worth
from granular._records import column
from granular._walls import close_after
from granular.edmd import readout
from granular.edmd.collapse import Verdict, Zoom
from granular.edmd.log import Log
from granular.edmd.model import Model
from granular.edmd.motion import approaching
from granular.edmd.sorted_queue import Pause, Rows, SortedQueue
from granular.edmd.state import APART, State
from granular.edmd.tree_queue import TreeQueue, loop
from granular.edmd.zoom import BUDGET, LIMIT, OUTSIDE, QUIET, RESTS, SPENT, UNTIL
from granular.trajectory import Status

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
    state : State
        What moves; changed in place.
    zoom : Zoom or None
        A closer look that was interrupted.
    model : Model
        How it moves.
    queues : pair of classes
        The queue to begin with, and the one to go over to after `LONG` collisions (or None).
    max_events : int
        How many collisions of this run at most.
    log : Log
        Takes the contacts.
    on_progress : callable or None
        Called with time and number of events now and then.
    """

    def __init__(
        self,
        state: State,
        zoom: Zoom | None,
        model: Model,
        queues: tuple[type[Queue], type[Queue] | None],
        max_events: int,
        log: Log,
        on_progress: Callable[[float, int], object] | None,
    ) -> None:
        self.state, self.zoom, self.model, self.log, self.on_progress = state, zoom, model, log, on_progress
        self._go_on_with(queues[0])
        self.faster = queues[1]
        self.worked = work(state)
        self.last_event = state.events + max_events
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
            rows, pause = self.log.new(), None
            if self.faster is not None and worth(loop, work(state) - self.worked, LONG, VERY_LONG, inline=True):
                self._go_on_with(self.faster)
                self.faster = None
            if self.zoom is None:
                pause = self.queue.advance(limit, budget, rows)
            else:
                pause = self._look_closer(self.zoom, limit, budget, rows)
            self.log.settle(rows, state, self.fall)
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
                state.shift_to(self.queue.soonest(), self.model, self.queue.kernel)
                self.queue.rebuild()
            elif pause is Pause.suspect:
                self.zoom = Zoom.on(state, self.queue)
                self.zoom.keep_as(state)
            idle = pause is Pause.budget and state.events == before  # before a group larger than the budget
            if pause is Pause.budget and (state.events >= self.last_event or (idle and budget == left)):
                return Status.max_events
            self._report()

    def _look_closer(self, zoom: Zoom, limit: float, budget: int, rows: Rows | None) -> Pause | None:
        """Go on with the zoom; close it when it ends, with or without a verdict, and return None."""
        state, model = self.state, self.model
        end = zoom.advance(state, model, self.queue, limit, budget, rows)
        if end in GOES_ON:
            return GOES_ON[end]
        j = int(zoom.look.last)
        if end == RESTS:
            c = zoom.first + j
            self.verdict = Verdict("exact", c, c, 0.0)
        elif end not in (OUTSIDE, QUIET):
            verdict = zoom.verdict(state, model, j)
            if verdict is not None and (end != SPENT or verdict.bound < 1e-9 * state.speed):
                self.verdict = verdict
            elif end == SPENT and zoom.patience_ends(state):
                self.verdict = zoom.faint(state, model, j)
                if self.verdict is None:
                    return None
            else:
                state.run.short = math.ldexp(state.run.short, -4)
                state.allowance *= 2
        zoom.close(state, self.queue)
        self.zoom = None
        if state.run.stop_pair != APART:
            return None
        witness = self.queue.kernel(approaching)(state.pairs, state.bodies, 0, state.now)
        return Pause.until if witness < 0 else None

    def _go_on_with(self, queue: type[Queue]) -> None:
        """Go on with another queue, whatever is going on: what is looked at closely, whose gaps in the state are old,
        stays as it is."""
        self.queue = queue(self.state, self.model)
        if self.zoom is None:
            self.queue.rebuild()
        else:
            self.zoom.keep_as(self.state)
            kept = self.state.copied()
            self.queue.rebuild()
            self.state.pairs, self.state.bodies = kept.pairs, kept.bodies

    def _report(self) -> None:
        if self.on_progress is not None and self.state.events - self.reported >= REPORT:
            self.reported = self.state.events
            self.on_progress(self.time(), self.state.events)

    def bound(self) -> Verdict | None:
        """Return what can be said of the slow pairs of a closer look that is not over."""
        if self.zoom is None or self.zoom.look.events == 0:
            return None
        collided = int(np.argmin(column(self.zoom.near, "gap")))
        verdict = self.zoom.verdict(self.state, self.model, collided)
        return verdict if verdict is not None and math.isfinite(verdict.bound) else None

    def time(self) -> float:
        """Return the time in s up to which the run has got."""
        return self.state.time(self.state.now)

    def row(self) -> tuple[float, Array, Array]:
        """Return the time since the start of the run (s), velocities and gaps now."""
        state = self.state
        if self.zoom is not None and self.zoom.look.events > 0:
            state = state.copied()
            self.zoom.write_back(state, self.queue)
        velocity, gap = readout.row(state, state.now, self.model.gravity)
        elapsed = readout.elapsed(state, state.now)
        return elapsed, velocity - self.fall * elapsed, gap

    def checkpoint(self) -> dict[str, Any]:
        """Return all that is needed to go on."""
        return self.state.checkpoint() | (self.zoom.checkpoint() if self.zoom is not None else {})


def work(state: State) -> int:
    """Return the work done so far in collisions; one looked at closely costs as much as eight."""
    return state.events + 7 * state.zoomed
