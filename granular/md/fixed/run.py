"""Run with a fixed time step: steps during contacts, free flight between them.

While no pair overlaps, the balls move in closed form by a whole number of steps (a flight). At its end,
`granular.md.fixed.ending` checks whether the time step was short enough.
"""

from __future__ import annotations

import math
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from granular._engine.kernels import CompilationCost, have_numba
from granular._engine.records import record_array
from granular.laws.kinds import SceneLaws
from granular.md.fixed.contact_force import CompiledForce, NotCompilableError, reevaluate_laws
from granular.md.fixed.ending import status_and_message
from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.march import CROWDED, UNTIL
from granular.md.fixed.notes import STEP_ROW, part_of_step
from granular.md.fixed.stepper import Stepper
from granular.md.fixed.window import COUNT, ENERGIES, PART, RAW, ROW_NAMES, SHARED, XI, V, copy_state
from granular.run import until as stop
from granular.run.contact_log import CONTACT_ROW, SOFT_FIELDS, Rows
from granular.run.drive import End, Pause, Request, Row, next_portion
from granular.run.levels import first_crossing, observable_value
from granular.scene import Scene
from granular.scene.places import WallMeeting

FIRST_CHUNK_PAIR_STEPS = 1 << 13
"""Work before the first pause of a run: number of pairs times number of steps.

At a pause the run can report its progress and switch to compiled code."""
LOADING_SECONDS, COMPILING_SECONDS = 0.4, 3.0
"""Typical times in s to load cached machine code, and to compile it."""
MAX_STEP_NUMBER = 1 << 53
"""Largest step number. The next integer has no exact float."""


class Run:
    """Run of soft spheres with a fixed time step (protocol `granular.run.drive.Run`).

    Parameters
    ----------
    scene : Scene
        Initial state.
    laws : SceneLaws
        Force laws of its pairs.
    request : Request
        Options that all engines share.
    method : str
        Name of the integrator, a key of `INTEGRATORS`.
    dt : float
        Time step in s.
    engine : {"auto", "plain", "compiled"}
        See `granular.md.simulate`.

    Notes
    -----
    The run is at time `start` + `k`·`dt`. `k` includes the time steps passed in flights. `steps` counts only the steps
    that were integrated.
    """

    in_order = False
    adds_up = True
    rule = None

    def __init__(self, scene: Scene, laws: SceneLaws, request: Request, method: str, dt: float, engine: str) -> None:
        self.scene, self.law, self.request, self.start = scene, laws.given, request, request.start
        self.integrator, self.dt, self.engine = INTEGRATORS[method], dt, engine
        until = request.until
        self.pair, self.nth = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
        logged: int = ENERGIES if request.energies else request.rows or self.pair >= 0
        self.stepper = Stepper(scene, laws, self.integrator, dt, until=(self.pair, self.nth), logged=logged,
                               at_once=engine == "compiled", start=self.start)
        self.k = self.steps = self.flights = self.contacts = 0
        self.level_time = math.inf  # s, time at which the stop level is passed
        self.is_stopped_at_onset = False  # the run ended between two steps, at the onset of the contact to stop at
        self.has_too_many_hits = False  # a ball would hit a thermal wall too often in one step
        self.flight_start: tuple[int, Any] | None = None  # step and state at the start of the flight that ends here
        self.note = self.step_warning = ""
        self.chunk_steps = max(1, FIRST_CHUNK_PAIR_STEPS // scene.n_pairs)
        if engine == "auto":
            # index 0 is the kernel `march`, index 1 is `take_steps`
            step = self.stepper.fit[self.stepper.parts > 1]
            self.compile_timer = CompilationCost(step, LOADING_SECONDS, COMPILING_SECONDS)
        if scene.driven:
            self.closing = WallMeeting(scene, self.start, flattened=True)

    def time(self) -> float:
        """Return the time in s reached by the run, at its current step."""
        return self.start + self.k * self.dt

    def progress(self) -> tuple[float, int]:
        """Return the time in s reached by the run, and its number of finished contacts."""
        return self.time(), self.contacts

    def row(self, time: float) -> Row:
        """Return the state of the scene at `time` in s, without advancing the run.

        `time` is at most one step after the current step. The state there is computed by one shorter step on a copy.
        If `time` is before the current step, it lies in the flight that ended there, and the flight is evaluated.
        """
        flight = self.flight_start if time < self.time() else None
        k, flight_state = flight or (self.k, None)
        span = max(0.0, time - (self.start + k * self.dt))  # rounding can put k dt after `time`
        state = (self.stepper.after(k, span) if flight_state is None else
                 self.stepper.glide(copy_state(flight_state), k, span))
        return self._row_from_state(time, state, state if flight_state is None else self.stepper.here)

    def _row_from_state(self, time: float, state: Any, account_state: Any) -> Row:
        """Convert the arrays `state` at `time` in s to a `Row`.

        The energies are read from the arrays `account_state`.
        """
        xi, raw, v = (np.array(state[row]) for row in (XI, RAW, V))
        ledger = None if self.stepper.walls is None else self.stepper.account(account_state, xi)
        return Row(time, time - self.start, -xi[1:-1], v[1 : self.scene.n + 1], force=np.fmax(0.0, raw[1:-1]),
                   ledger=ledger)

    def to(self, time: float, last: bool) -> Pause:
        """Advance towards `time` in s, and return the reason for the pause.

        The run pauses at the last whole step before `time`, after a limited number of steps, or where it ends. If
        `last`, no later time is requested, and hits of thermal walls in the partial step before `time` are counted.
        """
        if self.k == 0 and self._clear_stop_contact_at_start():
            return Pause.until
        if self.k == 0:
            self.level_time = self._level_crossing_time()
        limit = self._whole_steps(time - self.start)
        reason = self._advance(limit) if self.k < limit and self.level_time == math.inf else Pause.reached
        if self.level_time < math.inf and self.level_time <= time:
            return Pause.until
        if self.scene.driven:
            self.closing.refuse(time if reason is Pause.reached else self.time(), self.request.end)
        if reason is Pause.reached:
            return self._process_last_partial_step(time) if last and self.stepper.heaters else reason
        if not np.isfinite(self.stepper.balls()).all():
            return Pause.unstable
        return Pause.work if reason is Pause.full and self.steps >= self.request.max_steps else reason

    def _whole_steps(self, span: float) -> float:
        """Return the number of whole time steps in a time span in s, possibly inf.

        Raises `ValueError` if the number of steps in a finite time span overflows.
        """
        steps = span / self.dt
        if span < steps == math.inf:
            raise self._uncountable_step_error(steps)
        return math.floor(steps) if steps < math.inf else steps

    def _uncountable_step_error(self, step: float) -> ValueError:
        """Return the exception for a `dt` so short that step number `step` is not exact."""
        return ValueError(f"`dt` must be large enough that the steps can be counted, got {self.dt:g}: the run reaches "
                          f"step {step:.3g}. Use a larger dt, or method='located'.")

    def _clear_stop_contact_at_start(self) -> bool:
        """Remove the contact to stop at, if it exists already in the initial state.

        Its force and its contact count are set to 0. Return whether the contact existed.
        """
        here, j = self.stepper.here, self.pair + 1
        if j == 0 or here[COUNT][j] < self.nth:
            return False
        here[COUNT][j] = here[RAW][j] = 0.0
        return True

    def _advance(self, limit: float) -> Pause:
        """Fly to the next touch if no pair overlaps, then take steps up to step `limit`.

        At most `chunk_steps` steps are taken. Return the reason for the pause.
        """
        stepper = self.stepper
        if not (stepper.pairs(XI) > 0.0).any():
            if isinstance(self.request.until, stop.Separated) and self.contacts and stepper.receding():
                return Pause.until
            if stepper.settled():
                if self.flight_start is None:  # at most one flight per march
                    if self._fly_to_next_touch():
                        return Pause.quiet
                    self.level_time = self._level_crossing_time()
                if self.k >= limit or self.level_time < math.inf:
                    return Pause.full
        if self.k > MAX_STEP_NUMBER:
            raise self._uncountable_step_error(self.k)
        if self.engine == "auto":
            self._compile_if_worthwhile()
        # 1 << 60 keeps an infinite `max_events` within the integers of the kernel
        contact_budget = int(min(self.request.max_events - self.contacts - 1, 1 << 60))
        step_limit = 1 if self.request.singly else self.chunk_steps
        start_time, steps = process_time(), int(min(step_limit, limit - self.k, self.request.max_steps - self.steps))
        reason, k = stepper.march(self.k, steps, contact_budget)
        self.chunk_steps = next_portion(steps, process_time() - start_time)
        self.flight_start, self.steps, self.k = None, self.steps + k - self.k, k
        self.level_time = self._level_crossing_time()
        self.has_too_many_hits = reason == CROWDED
        if self._count_finished_contacts(halts=reason == UNTIL):
            return Pause.until
        if self.has_too_many_hits:
            return Pause.unstable
        if self.contacts >= self.request.max_events:
            return Pause.work
        return Pause.full

    def _level_crossing_time(self) -> float:
        """Return the first time in s at which a stop condition on a level is met, or inf.

        If a flight ends at the current step, the flight is searched. Otherwise only the current step is checked.
        """
        level, first = self.request.until, self.k if self.flight_start is None else self.flight_start[0]
        if not isinstance(level, stop.LEVEL_TYPES):
            return math.inf
        return first_crossing(
            partial(observable_value, self, level), level, self.scene, self.start + first * self.dt, self.time())

    def _process_last_partial_step(self, end: float) -> Pause:
        """Count and log the hits of thermal walls between the last step and `end` in s.

        Return the reason for the pause: the stop condition if the hit to stop at is among them, else the end time.
        """
        halts = self.stepper.hit_within(self.k, max(0.0, end - self.time()))
        return Pause.until if self._count_finished_contacts(halts) else Pause.reached

    def _count_finished_contacts(self, halts: bool) -> bool:
        """Add the contacts that ended in the last steps to `contacts`, and return `halts`.

        `halts` states whether the run stops at the onset of a contact. Contacts that ended after this onset are not
        counted.
        """
        self.is_stopped_at_onset = halts
        if halts and self.stepper.heaters:
            self._remove_later_hits()
        self.contacts += int(self.stepper.work.ended[0])
        return halts

    def _remove_later_hits(self) -> None:
        """Remove the hits of thermal walls after the onset to stop at from the log.

        Only the current step can contain such hits.
        """
        log, ended, part = self.stepper.work.log, self.stepper.work.ended, self._onset_fraction()
        is_later = [log[i]["step_out"] == self.k and log[i]["part_out"] > part for i in range(ended[0])]
        # move the later hits to the end; a stable sort keeps the order of the remaining rows
        order = sorted(range(ended[0]), key=is_later.__getitem__)
        log[: ended[0]] = [log[i] for i in order] if isinstance(log, list) else log[order]
        ended[0] -= sum(is_later)

    def _onset_fraction(self) -> float:
        """Return the onset of the contact to stop at, as a fraction of the current step."""
        old, new, j = self.stepper.here, self.stepper.there, self.pair + 1
        return float(new[PART][j] if self._stops_at_thermal_wall() else part_of_step(j, old[XI][j], old, new))

    def _stops_at_thermal_wall(self) -> bool:
        """Return whether the contact to stop at is a hit of a thermal wall."""
        return any(wall.pair == self.pair for wall in self.stepper.heaters)

    def _fly_to_next_touch(self) -> bool:
        """Move the balls freely, by whole steps, to the last step before the next touch.

        The flight ends earlier at the end time of the run. Samples do not interrupt it, so the result is bitwise
        independent of them.

        Returns
        -------
        bool
            True if there is neither a next touch nor an end time. The state is then unchanged.
        """
        span, stepper = self.request.end - self.start, self.stepper
        last_step = self._whole_steps(span)
        touch = stepper.time_to_touch(self.k, span - self.k * self.dt)
        if touch == last_step == math.inf:
            return True
        # inf // dt is nan
        step_count = min(touch // self.dt, last_step - self.k) if touch < math.inf else last_step - self.k
        if step_count == math.inf:
            raise self._uncountable_step_error(step_count)
        if step_count > 0.0:
            self.flight_start = self.k, copy_state(stepper.here)
            stepper.glide(stepper.here, self.k, step_count * self.dt)
            self.k += int(step_count)
            self.flights += 1
        return False

    def _compile_if_worthwhile(self) -> None:
        """Switch to compiled steps once the time of the interpreted steps justifies it.

        If the kernels cannot be compiled, the run continues interpreted, and `note` contains the reason.
        """
        if not self.compile_timer.due() and (have_numba() or self.compile_timer.lap() < LOADING_SECONDS):
            return
        self.engine = "plain"
        try:
            self.stepper.compile()
        except ImportError:
            self.note = "numba is not installed"
        except NotCompilableError as reason:
            self.note = str(reason)

    def rows(self) -> list[Rows]:
        """Return the log rows of the contacts that ended since the last call."""
        work = self.stepper.work
        ended, work.ended[0] = work.ended[0], 0
        if ended == 0 or not self.request.rows:
            return []
        log = record_array(work.log[:ended], STEP_ROW)
        return [self._with_times(log[np.lexsort((log["pair"], log["step_out"]))])]

    def _with_times(self, raw: Rows) -> Rows:
        """Return rows of type `STEP_ROW` with their step numbers converted to times in s."""
        rows = np.zeros(len(raw), CONTACT_ROW)
        for name in ("pair", *(name for name, _ in SOFT_FIELDS)):
            rows[name] = raw[name]
        for name, side in (("t_begin", "in"), ("t_end", "out")):
            rows[name] = self.start + (raw[f"step_{side}"] + raw[f"part_{side}"]) * self.dt
        rows["duration"] = ((raw["step_out"] - raw["step_in"]) + (raw["part_out"] - raw["part_in"])) * self.dt
        return rows

    def _unfinished_contacts(self, end: float) -> Rows | None:
        """Return log rows of the contacts that have not ended at `end` in s, or None.

        The values of such a row are its values so far. Its end time and the velocities at its end are nan.
        """
        unfinished = np.flatnonzero(self.stepper.pairs(RAW) > 0.0)
        if not self.request.rows or len(unfinished) == 0:
            return None
        raw = np.zeros(len(unfinished), STEP_ROW)
        raw["pair"], raw["lower_out"], raw["upper_out"] = unfinished, math.nan, math.nan
        state_names = {"step_in": "step", "part_in": "part", "lower_in": "lower", "upper_in": "upper"}
        for name in (*state_names, "xi_max", "force_max", "impulse"):
            raw[name] = self.stepper.pairs(ROW_NAMES.index(state_names.get(name, name)))[unfinished]
        rows = self._with_times(raw)
        rows["t_end"], rows["duration"] = math.nan, end - rows["t_begin"]
        return rows

    def end(self, pause: Pause, seen: float) -> End:
        """Return the last row, the status, the message and the statistics of the run.

        `pause` is the reason for its last pause, and `seen` the time in s of the last sample.
        """
        if self.engine == "auto":
            self.compile_timer.lap()
        end_time = self.request.end if pause is Pause.reached else min(self.level_time, self.time())
        row = self._row_at_onset() if self.is_stopped_at_onset else self.row(end_time)
        if isinstance(self.stepper.physics.laws, CompiledForce):
            reevaluate_laws(self.stepper.laws, self.stepper.physics.laws)
        status, message, dt_lambda = status_and_message(self, pause.value, row.time)
        stats = {
            "method": self.integrator.name,
            "dt": self.dt,
            "dt_lambda": dt_lambda,
            "steps": self.steps,
            "flights": self.flights,
            "evaluations": self.steps * self.integrator.evaluations,
            "contacts": self.contacts,
            "shared_impulse": math.fsum(self.stepper.pairs(SHARED)),
            "engine": "compiled" if self.stepper.compiled else "plain",
        } | ({"note": self.note} if self.note else {})
        return End(row if row.time > seen else None, status, message, stats, {}, self._unfinished_contacts(row.time))

    def _row_at_onset(self) -> Row:
        """Return the state of the scene at the onset of the contact to stop at.

        The onset lies between two steps. The state is interpolated linearly between them. For a hit of a thermal
        wall it is computed by a partial step.
        """
        old, new, part = self.stepper.here, self.stepper.there, self._onset_fraction()
        if self._stops_at_thermal_wall():
            state = self.stepper.after(self.k, part * self.dt)
            return self._row_from_state(self.start + (self.k + part) * self.dt, state, state)
        ends = zip(*((np.asarray(x[XI]), np.fmax(0.0, x[RAW]), np.asarray(x[V])) for x in (old, new)), strict=True)
        return self._row_from_state(self.start + (self.k + part) * self.dt, [a + part * (b - a) for a, b in ends], old)
