"""One run: advance the queue to the next thing that matters, and deal with it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._kernels import worth
from granular._records import column, packed
from granular._walls import close_after
from granular.drive import End, Pause, Row, Rows
from granular.edmd import options, outcome, readout
from granular.edmd.collapse import Verdict, Zoom
from granular.edmd.event import ROW
from granular.edmd.model import Model
from granular.edmd.motion import approaching
from granular.edmd.sorted_queue import Halt, SortedQueue
from granular.edmd.state import APART, State
from granular.edmd.tree_queue import TreeQueue, loop
from granular.edmd.zoom import BUDGET, LIMIT, OUTSIDE, QUIET, RESTS, SPENT, UNTIL
from granular.request import Request
from granular.trajectory import Status

Queue = SortedQueue | TreeQueue
LONG, VERY_LONG = 100_000, 1_000_000
"""Work (in collisions) after which it pays to load the machine code, and to make it if it is not on the disk."""
TAIL = 8
"""The last of so many parts of a run that ends at `max_events` tells whether it has slowed down."""
LOOK = 4096
"""Events after which rows are handed over and progress is told."""
MARGIN = 2.0**-30
"""Closing walls end a run when this part of the free length between them is left: balls that bounce between them at
2/(1 - ε) times the speed of the walls make their sum of gaps uncertain by not much less."""
GOES_ON = {LIMIT: Halt.limit, UNTIL: Halt.until, BUDGET: Halt.budget}


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
    request : Request
        What is asked of it.
    """

    in_order = True
    law = None

    def __init__(
        self, state: State, zoom: Zoom | None, model: Model, queues: tuple[type[Queue], type[Queue] | None],
        request: Request,
    ) -> None:  # fmt: skip
        self.state, self.zoom, self.model, self.request = state, zoom, model, request
        self.scene, self.rule = model.scene, model.rules
        state.stop_at(request.until)
        self._go_on_with(queues[0])
        self.faster = queues[1]
        self.worked = work(state)
        self.last_event = state.events + request.max_events
        self.tail = self.last_event - request.max_events // TAIL
        self.pace = [(state.events, state.time(state.now))]  # at the beginning and where the tail begins
        self.verdict: Verdict | None = None
        self.settled: list[Rows] = []
        self.fall = model.scene.gravity - model.gravity  # m/s², with which the frame of the run falls
        self.close_after = close_after(model.scene)
        self.horizon = state.start + (1.0 - MARGIN) * self.close_after  # s, the last time with room between the walls

    def to(self, time: float, last: bool) -> Pause:
        """Advance to `time`, some thousand events towards it, or to what ends the run.

        A row at the start shows the scene before anything acts.
        """
        state, idle, seen = self.state, False, self.state.events
        while last or time > self.request.start:
            limit = state.tau(min(time, self.horizon))
            goal = self.tail if state.events < self.tail else self.last_event
            if time >= self.horizon and limit <= state.now:
                return Pause.collapse
            left = self.last_event - state.events
            budget = left if idle else max(0, min(self.queue.chunk, goal - state.events))
            before = state.events
            rows: list[Any] | None = [] if self.request.rows else None
            halt = None
            if self.faster is not None and worth(loop, work(state) - self.worked, LONG, VERY_LONG, inline=True):
                self._go_on_with(self.faster)
                self.faster = None
            if self.zoom is None:
                halt = self.queue.advance(limit, budget, rows)
            else:
                halt = self._look_closer(self.zoom, limit, budget, rows)
            self._settle(rows or [])
            if len(self.pace) == 1 and state.events >= self.tail:
                self.pace.append((state.events, self.time()))
            if halt is Halt.limit:
                if time == self.horizon == math.inf:
                    return Pause.quiet
                state.now = limit
                return Pause.reached if time <= self.horizon else Pause.collapse
            if self.verdict is not None:
                return Pause.collapse
            if halt is Halt.until:
                return Pause.until
            if halt is Halt.window:
                state.shift_to(self.queue.soonest(), self.model, self.queue.kernel)
                self.queue.rebuild()
            elif halt is Halt.suspect:
                self.zoom = Zoom.on(state, self.queue)
                self.zoom.keep_as(state)
            idle = halt is Halt.budget and state.events == before  # before a group larger than the budget
            if halt is Halt.budget and (state.events >= self.last_event or (idle and budget == left)):
                return Pause.work
            if state.events - seen >= LOOK:
                return Pause.full
        return Pause.reached

    def _settle(self, written: list[Any]) -> None:
        """Take rows that were written since the last re-basing; the frame of the run may fall."""
        for chunk in written:
            if len(chunk) == 0:
                continue
            rows = packed(chunk, ROW) if isinstance(chunk, list) else chunk
            tau = rows["t_begin"].copy()
            rows["t_begin"] = self.state.time(tau)
            if self.fall > 0.0:
                fallen = self.fall * readout.elapsed(self.state, tau)
                for name in ("lower_in", "upper_in", "lower_out", "upper_out"):
                    rows[name] -= fallen
            self.settled.append(rows)

    def rows(self) -> list[Rows]:
        """Hand over the contacts since the last call."""
        settled, self.settled = self.settled, []
        return settled

    def _look_closer(self, zoom: Zoom, limit: float, budget: int, rows: list[Any] | None) -> Halt | None:
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
        return Halt.until if witness < 0 else None

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

    def progress(self) -> tuple[float, int]:
        """Return time in s and number of collisions so far."""
        return self.time(), self.state.events

    def row(self, time: float) -> Row:
        """Return the scene now."""
        state = self.state
        if self.zoom is not None and self.zoom.look.events > 0:
            state = state.copied()
            self.zoom.write_back(state, self.queue)
        velocity, gap = readout.row(state, state.now, self.model.gravity)
        elapsed = readout.elapsed(state, state.now)
        return Row(time, elapsed, gap, velocity - self.fall * elapsed)

    def end(self, pause: Pause, seen: float) -> End:
        """Return how the run ended, with all that is needed to go on."""
        stop = self.request.end if pause is Pause.reached else self.time()
        wanted = seen == -math.inf or (pause is not Pause.reached and stop > seen)
        saved = self.state.checkpoint() | (self.zoom.checkpoint() if self.zoom is not None else {})
        status: Status = pause.value
        return End(
            self.row(stop) if wanted else None, status, outcome.message(self, status), outcome.stats(self),
            saved | options.saved(self.model),
        )  # fmt: skip


def work(state: State) -> int:
    """Return the work done so far in collisions; one looked at closely costs as much as eight."""
    return state.events + 7 * state.zoomed
