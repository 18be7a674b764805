"""One run: advance the queue to the next thing that matters, and deal with it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._records import column, packed
from granular.drive import End, Pause, Row, Rows
from granular.edmd import outcome
from granular.edmd.collapse import Verdict, Zoom
from granular.edmd.event import ROW
from granular.edmd.model import OPTIONS, Model
from granular.edmd.motion import approaching
from granular.edmd.sorted_queue import SortedQueue
from granular.edmd.state import APART, BUDGET, LATER, OUTSIDE, QUIET, RESTS, SPENT, SUSPECT, UNTIL, State
from granular.edmd.tree_queue import TreeQueue, pays
from granular.request import Request
from granular.scene import close_after
from granular.trajectory import Status

Queue = SortedQueue | TreeQueue
TAIL = 8
"""The last of so many parts of a run that ends at `max_events` tells whether it has slowed down."""
LOOK = 4096
"""Events after which rows are handed over and progress is told."""
MARGIN = 2.0**-30
"""Closing walls end a run when this part of the free length between them is left: balls that bounce between them at
2/(1 - ε) times the speed of the walls make their sum of gaps uncertain by not much less."""


class Run:
    """A run in progress.

    Parameters
    ----------
    model : Model
        How it moves.
    state : State
        What moves; changed in place.
    zoom : Zoom or None
        A closer look that was interrupted.
    queues : pair of classes
        The queue to begin with, and the one to go over to in a long run (or None).
    request : Request
        What is asked of it.
    """

    in_order = True
    law = None

    def __init__(
        self, model: Model, state: State, zoom: Zoom | None, queues: tuple[type[Queue], type[Queue] | None],
        request: Request,
    ) -> None:  # fmt: skip
        self.model, self.state, self.zoom, self.request = model, state, zoom, request
        self.scene, self.rule = model.scene, model.rules
        state.stop_at(request.until, request.max_events)
        first, self.faster = queues
        self._go_on_with(first)
        self.worked = state.work()
        self.tail = state.last_event - request.max_events // TAIL
        self.pace = [(state.events, state.time(state.now))]  # at the beginning and where the tail begins
        self.verdict: Verdict | None = None
        self.settled: list[Rows] = []
        self.fall = self.scene.gravity - state.run.gravity  # m/s², with which the frame of the run falls
        self.close_after = close_after(self.scene)
        self.horizon = state.start + (1.0 - MARGIN) * self.close_after  # s, the last time with room between the walls

    def to(self, time: float, last: bool) -> Pause:
        """Advance to `time`, some thousand events towards it, or to what ends the run.

        A row at the start shows the scene before anything acts.
        """
        state, seen = self.state, self.state.events
        while last or time > self.request.start:
            limit, before = state.tau(min(time, self.horizon)), state.events
            if time >= self.horizon and limit <= state.now:
                return Pause.collapse
            why = self._advance(limit)
            if self.verdict is not None:
                return Pause.collapse
            if why == UNTIL:
                return Pause.until
            if why == LATER:
                due = math.inf if self.zoom is not None else self.queue.soonest()
                if due > limit or due == math.inf:
                    return self._reached(time, limit)
                state.shift_to(due, self.queue.kernel)
                self.queue.rebuild()
            elif why == SUSPECT:
                self.zoom = Zoom.on(state, self.queue)
            elif why == BUDGET and state.events in (before, state.last_event):  # or a group that is too large
                return Pause.work
            if state.events - seen >= LOOK:
                return Pause.full
        return Pause.reached

    def _reached(self, time: float, limit: float) -> Pause:
        """Stand at `time`, tau = `limit`, or where the walls leave no room, since nothing happens before."""
        if time == self.horizon == math.inf:
            return Pause.quiet
        self.state.now = limit
        return Pause.reached if time <= self.horizon else Pause.collapse

    def _advance(self, limit: float) -> int:
        """Go on towards tau = `limit` for a while, with the faster queue if that pays now; return why it pauses."""
        state = self.state
        if self.faster is not None and pays(state.work() - self.worked):
            self._go_on_with(self.faster)
            self.faster = None
        goal = self.tail if state.events < self.tail else state.last_event
        budget = min(self.queue.chunk, goal - state.events)
        rows: list[Any] | None = [] if self.request.rows else None
        if self.zoom is None:
            why = self.queue.advance(min(limit, math.nextafter(state.window, 0.0)), budget, rows)
        else:
            why = self._look_closer(self.zoom, limit, budget, rows)
        self._settle(rows or [])
        if len(self.pace) == 1 and state.events >= self.tail:
            self.pace.append((state.events, self.time()))
        return why

    def _settle(self, written: list[Any]) -> None:
        """Take rows that were written since the last re-basing; the frame of the run may fall."""
        for chunk in filter(len, written):
            rows = packed(chunk, ROW)
            tau = rows["t_begin"].copy()
            rows["t_begin"] = self.state.time(tau)
            if self.fall > 0.0:
                fallen = self.fall * self.state.elapsed(tau)
                for name in ("lower_in", "upper_in", "lower_out", "upper_out"):
                    rows[name] -= fallen
            self.settled.append(rows)

    def rows(self) -> list[Rows]:
        """Hand over the contacts since the last call."""
        settled, self.settled = self.settled, []
        return settled

    def _look_closer(self, zoom: Zoom, limit: float, budget: int, rows: list[Any] | None) -> int:
        """Go on with the zoom; close it when it ends, with or without a verdict."""
        state, model = self.state, self.model
        end = zoom.advance(state, model, self.queue, limit, budget, rows)
        if end in (LATER, UNTIL, BUDGET):
            return end
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
                    return end
            else:
                state.run.short = math.ldexp(state.run.short, -4)
                state.allowance *= 2
        zoom.close(state, self.queue)
        self.zoom = None
        if state.run.stop_pair != APART:
            return end
        witness = self.queue.kernel(approaching)(state.pairs, state.bodies, 0, state.now)
        return UNTIL if witness < 0 else end

    def _go_on_with(self, queue: type[Queue]) -> None:
        """Go on with another queue, whatever is going on: what is looked at closely, whose gaps in the state are old,
        stays as it is."""
        self.queue = queue(self.state, self.model)
        if self.zoom is None:
            self.queue.rebuild()
        else:
            self.zoom.keep(self.queue.hold)
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
        velocity, gap = state.row(state.now)
        elapsed = state.elapsed(state.now)
        return Row(time, elapsed, gap, velocity - self.fall * elapsed)

    def end(self, pause: Pause, seen: float) -> End:
        """Return how the run ended, with all that is needed to go on."""
        stop = self.request.end if pause is Pause.reached else self.time()
        wanted = seen == -math.inf or (pause is not Pause.reached and stop > seen)
        saved = self.state.checkpoint() | {name: getattr(self.model, name) for name in OPTIONS}
        status: Status = pause.value
        return End(
            self.row(stop) if wanted else None, status, outcome.message(self, status), outcome.stats(self),
            saved | (self.zoom.checkpoint() if self.zoom is not None else {}),
        )  # fmt: skip
