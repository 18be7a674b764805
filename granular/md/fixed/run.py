"""One run with a fixed time step: steps while pairs are closed, else a flight.

At its end the run reports whether the time step was short enough to be trusted.
"""

from __future__ import annotations

import math
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from granular._engine.kernels import Toll, have_numba
from granular._engine.records import packed
from granular.laws.kinds import SceneLaws
from granular.md.fixed.contact_force import Called, NotCompilableError, reevaluate_laws
from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.march import CROWDED, UNTIL
from granular.md.fixed.notes import STEP_ROW, part_of_step
from granular.md.fixed.stepper import Stepper
from granular.md.fixed.walls import MAX_HITS_PER_STEP
from granular.md.fixed.window import BESIDE, COUNT, DEEPEST, PART, RAW, ROW_NAMES, SHARED, XI, V, copied
from granular.md.time_step import DOUBTFUL_DT_LAMBDA, expected_rate, sharpest_rate
from granular.run import until as stop
from granular.run.contact_log import CONTACT_ROW, SOFT_FIELDS, Rows
from granular.run.drive import End, Pause, Request, Row, portion
from granular.run.levels import first_met, shown
from granular.run.trajectory import Status
from granular.run.until import raised
from granular.scene import Scene, positions
from granular.scene.places import Closing

FIRST_CHUNK_PAIR_STEPS = 1 << 15
"""Number of pair steps before the clock is checked for the first time.

The checks serve progress reports and the switch to compiled code."""
LOADING_SECONDS, COMPILING_SECONDS = 0.4, 3.0
"""Time in s to load cached machine code, and to compile it."""
MAX_STEP_NUMBER = 1 << 53
"""Largest step number. The next one has no exact float."""


class Run:
    """State of one run, `k` steps after its start. Free flights are not `steps`."""

    in_order = False
    adds_up = True
    rule = None

    def __init__(self, scene: Scene, laws: SceneLaws, request: Request, method: str, dt: float, engine: str) -> None:
        self.scene, self.law, self.request, self.start = scene, laws.given, request, request.start
        self.integrator, self.dt, self.engine = INTEGRATORS[method], dt, engine
        until = request.until
        self.pair, self.nth = (until.pair, until.nth) if isinstance(until, stop.Contact) else (-1, 0)
        logged = request.rows or self.pair >= 0
        self.stepper = Stepper(scene, laws, self.integrator, dt, (self.pair, self.nth), logged, engine == "compiled",
                               self.start)
        self.k = self.steps = self.flights = self.contacts = 0
        self.met = math.inf  # s, time at which the stop level is passed
        self.halted = False  # between two steps, at the onset of the contact to stop at
        self.crowded = False  # a ball would hit a thermal wall too often in one step
        self.take_off: tuple[int, Any] | None = None  # step and state at the start of the flight that ends here
        self.note = self.doubt = ""
        self.chunk = max(1, FIRST_CHUNK_PAIR_STEPS // scene.n_pairs)
        if engine == "auto":
            # march, or take_steps
            self.toll = Toll(self.stepper.fit[self.stepper.parts > 1], LOADING_SECONDS, COMPILING_SECONDS)
        if scene.driven:
            self.closing = Closing(scene, self.start, flattened=True)

    def time(self) -> float:
        """Return the time in s of the current step."""
        return self.start + self.k * self.dt

    def progress(self) -> tuple[float, int]:
        """Return the time in s and the number of contacts so far."""
        return self.time(), self.contacts

    def row(self, time: float) -> Row:
        """Return the scene at `time`, at most one step ahead, by a shorter step on a copy.

        An earlier time within the flight just completed is evaluated on that flight.
        """
        behind = self.take_off if time < self.time() else None
        k, flying = behind or (self.k, None)
        ahead = max(0.0, time - (self.start + k * self.dt))  # rounding can put k dt after `time`
        state = self.stepper.after(k, ahead) if flying is None else self.stepper.glide(copied(flying), k, ahead)
        return self._row(time, state, state if flying is None else self.stepper.here)

    def _row(self, time: float, state: Any, booked: Any) -> Row:
        xi, raw, v = (np.array(state[row]) for row in (XI, RAW, V))
        ledger = None if self.stepper.walls is None else self.stepper.account(booked, xi)
        return Row(time, time - self.start, -xi[1:-1], v[1 : self.scene.n + 1], force=np.fmax(0.0, raw[1:-1]),
                   ledger=ledger)

    def to(self, time: float, last: bool) -> Pause:
        """Take steps up to `time`, to the end of a chunk, or to a final event."""
        if self.k == 0 and self._halts_at_start():
            return Pause.until
        if self.k == 0:
            self.met = self._meets()
        limit = self._steps(time - self.start)
        pause = self._advance(limit) if self.k < limit and self.met == math.inf else Pause.reached
        if self.met < math.inf and self.met <= time:
            return Pause.until
        if self.scene.driven:
            self.closing.refuse(time if pause is Pause.reached else self.time(), self.request.end)
        if pause is Pause.reached:
            return self._last_part(time) if last and self.stepper.heaters else pause
        if not np.isfinite(self.stepper.balls()).all():
            return Pause.unstable
        return Pause.work if pause is Pause.full and self.steps >= self.request.max_steps else pause

    def _steps(self, span: float) -> float:
        """Return the number of whole steps in a time span in s."""
        steps = span / self.dt
        if span < steps == math.inf:
            raise self._beyond(steps)
        return math.floor(steps) if steps < math.inf else steps

    def _beyond(self, step: float) -> ValueError:
        """Return the error for a step number that has no exact float."""
        return ValueError(f"`dt` must be large enough that the steps can be counted, got {self.dt:g}: the run reaches "
                          f"step {step:.3g}. Use a larger dt, or method='located'.")

    def _halts_at_start(self) -> bool:
        """Return whether the contact to stop at exists at the start.

        If so, its force is set to 0, because the contact must not act.
        """
        here, j = self.stepper.here, self.pair + 1
        if j == 0 or here[COUNT][j] < self.nth:
            return False
        here[COUNT][j] = here[RAW][j] = 0.0
        return True

    def _advance(self, limit: float) -> Pause:
        """Complete a free flight, then take steps until step number `limit`."""
        stepper = self.stepper
        if not (stepper.pairs(XI) > 0.0).any():
            if isinstance(self.request.until, stop.Separated) and self.contacts and stepper.receding():
                return Pause.until
            if stepper.settled():
                if self.take_off is None:  # at most one flight per march
                    if self._fly():
                        return Pause.quiet
                    self.met = self._meets()
                if self.k >= limit or self.met < math.inf:
                    return Pause.full
        if self.k > MAX_STEP_NUMBER:
            raise self._beyond(self.k)
        if self.engine == "auto":
            self._compile_if_worth_it()
        # 1 << 60 keeps an infinite `max_events` within the integers of the kernel
        room = int(min(self.request.max_events - self.contacts - 1, 1 << 60))
        most = 1 if self.request.singly else self.chunk
        begun, steps = process_time(), int(min(most, limit - self.k, self.request.max_steps - self.steps))
        why, k = stepper.march(self.k, steps, room)
        self.chunk = portion(steps, process_time() - begun)
        self.take_off, self.steps, self.k = None, self.steps + k - self.k, k
        self.met = self._meets()
        self.crowded = why == CROWDED
        if self._counted(halts=why == UNTIL):
            return Pause.until
        if self.crowded:
            return Pause.unstable
        if self.contacts >= self.request.max_events:
            return Pause.work
        return Pause.full

    def _meets(self) -> float:
        """Return the time in s at which a level is passed, or inf.

        The flight that ends at the current step is searched, or else the step itself.
        """
        level, first = self.request.until, self.k if self.take_off is None else self.take_off[0]
        if not isinstance(level, stop.LEVEL_TYPES):
            return math.inf
        return first_met(partial(shown, self, level), level, self.scene, self.start + first * self.dt, self.time())

    def _last_part(self, end: float) -> Pause:
        """Count the hits of thermal walls in the partial step before the end."""
        halts = self.stepper.hit_within(self.k, max(0.0, end - self.time()))
        return Pause.until if self._counted(halts) else Pause.reached

    def _counted(self, halts: bool) -> bool:
        """Count the finished contacts, and return whether the run halts at an onset.

        If it does, the counted contacts ended before that onset.
        """
        self.halted = halts
        if halts and self.stepper.heaters:
            self._forget_later_hits()
        self.contacts += int(self.stepper.work.ended[0])
        return halts

    def _forget_later_hits(self) -> None:
        """Remove later hits of thermal walls in the current step from the log.

        A hit is later if it follows the onset to stop at.
        """
        log, ended, part = self.stepper.work.log, self.stepper.work.ended, self._part()
        late = [log[i]["step_out"] == self.k and log[i]["part_out"] > part for i in range(ended[0])]
        # a stable sort keeps the order of the remaining rows
        order = sorted(range(ended[0]), key=late.__getitem__)
        log[: ended[0]] = [log[i] for i in order] if isinstance(log, list) else log[order]
        ended[0] -= sum(late)

    def _part(self) -> float:
        """Return the fraction of the step at which the contact to stop at begins."""
        old, new, j = self.stepper.here, self.stepper.there, self.pair + 1
        return float(new[PART][j] if self._at_thermal_wall() else part_of_step(j, old[XI][j], old, new))

    def _at_thermal_wall(self) -> bool:
        """Return whether the contact to stop at belongs to a thermal wall."""
        return any(wall.pair == self.pair for wall in self.stepper.heaters)

    def _fly(self) -> bool:
        """Advance by whole steps while all pairs are open.

        Return whether no touch follows and no end time is set. A flight extends to the next touch or to the end of the
        run. Samples do not interrupt it, so they do not change any bit of the result.
        """
        span, stepper = self.request.end - self.start, self.stepper
        last = self._steps(span)
        touch = stepper.time_to_touch(self.k, span - self.k * self.dt)
        if touch == last == math.inf:
            return True
        jump = min(touch // self.dt, last - self.k) if touch < math.inf else last - self.k  # inf // dt is nan
        if jump == math.inf:
            raise self._beyond(jump)
        if jump > 0.0:
            self.take_off = self.k, copied(stepper.here)
            stepper.glide(stepper.here, self.k, jump * self.dt)
            self.k += int(jump)
            self.flights += 1
        return False

    def _compile_if_worth_it(self) -> None:
        if not self.toll.due() and (have_numba() or self.toll.lap() < LOADING_SECONDS):
            return
        self.engine = "plain"
        try:
            self.stepper.compile()
        except ImportError:
            self.note = "numba is not installed"
        except NotCompilableError as reason:
            self.note = str(reason)

    def rows(self) -> list[Rows]:
        """Return the contacts that ended since the last call."""
        work = self.stepper.work
        ended, work.ended[0] = work.ended[0], 0
        if ended == 0 or not self.request.rows:
            return []
        log = packed(work.log[:ended], STEP_ROW)
        return [self._settled(log[np.lexsort((log["pair"], log["step_out"]))])]

    def _settled(self, raw: Rows) -> Rows:
        """Convert step numbers and fractions to times."""
        rows = np.zeros(len(raw), CONTACT_ROW)
        for name in ("pair", *(name for name, _ in SOFT_FIELDS)):
            rows[name] = raw[name]
        for name, side in (("t_begin", "in"), ("t_end", "out")):
            rows[name] = self.start + (raw[f"step_{side}"] + raw[f"part_{side}"]) * self.dt
        rows["duration"] = ((raw["step_out"] - raw["step_in"]) + (raw["part_out"] - raw["part_in"])) * self.dt
        return rows

    def _running(self, end: float) -> Rows | None:
        """Return the contacts that are not finished at the end."""
        going = np.flatnonzero(self.stepper.pairs(RAW) > 0.0)
        if not self.request.rows or len(going) == 0:
            return None
        raw = np.zeros(len(going), STEP_ROW)
        raw["pair"], raw["lower_out"], raw["upper_out"] = going, math.nan, math.nan
        found = {"step_in": "step", "part_in": "part", "lower_in": "lower", "upper_in": "upper"}
        for name in (*found, "xi_max", "force_max", "impulse"):
            raw[name] = self.stepper.pairs(ROW_NAMES.index(found.get(name, name)))[going]
        rows = self._settled(raw)
        rows["t_end"], rows["duration"] = math.nan, end - rows["t_begin"]
        return rows

    def end(self, pause: Pause, seen: float) -> End:
        """Return how the run ended: at its end time, before an onset, or at its step."""
        if self.engine == "auto":
            self.toll.lap()
        at = self.request.end if pause is Pause.reached else min(self.met, self.time())
        row = self._onset() if self.halted else self.row(at)
        if isinstance(self.stepper.physics.laws, Called):
            reevaluate_laws(self.stepper.laws, self.stepper.physics.laws)
        status, message, trust = self._judge(pause.value, row.time)
        stats = {
            "method": self.integrator.name,
            "dt": self.dt,
            "dt_lambda": trust,
            "steps": self.steps,
            "flights": self.flights,
            "evaluations": self.steps * self.integrator.evaluations,
            "contacts": self.contacts,
            "shared_impulse": math.fsum(self.stepper.pairs(SHARED)),
            "engine": "compiled" if self.stepper.compiled else "plain",
        } | ({"note": self.note} if self.note else {})
        return End(row if row.time > seen else None, status, message, stats, {}, self._running(row.time))

    def _onset(self) -> Row:
        """Return the scene between two steps, at the onset of the contact to stop at."""
        old, new, part = self.stepper.here, self.stepper.there, self._part()
        if self._at_thermal_wall():
            state = self.stepper.after(self.k, part * self.dt)
            return self._row(self.start + (self.k + part) * self.dt, state, state)
        ends = zip(*((np.asarray(x[XI]), np.fmax(0.0, x[RAW]), np.asarray(x[V])) for x in (old, new)), strict=True)
        return self._row(self.start + (self.k + part) * self.dt, [a + part * (b - a) for a, b in ends], old)

    # -- judgement ------------------------------------------------------------------------------------------------

    @np.errstate(all="ignore")
    def _judge(self, status: Status, end: float) -> tuple[Status, str, float]:
        """Return status, message and dt·λ of the contacts that took place.

        If the step was too long, `doubt` is set as well.
        """
        scene, dt, laws, pairs = self.scene, self.dt, self.stepper.laws, self.stepper.pairs
        trust = dt * sharpest_rate(scene, laws, pairs(DEEPEST), pairs(BESIDE)) if pairs(DEEPEST).any() else 0.0
        if trust == 0.0 and self.steps and self._deflected():  # contacts shorter than a step leave no overlap
            trust = dt * expected_rate(scene, laws)
        gain = self._energy_gain() if self.steps else 0.0
        limit = f"dt = {dt:.3g} s times the highest rate of the contacts is {trust:.3g}"
        if self.crowded:
            return status, (f"dt = {dt:.3g} s is so long that a ball hits a thermal wall more than {MAX_HITS_PER_STEP} "
                            "times per step; use a shorter step."), trust
        # an energy gain of 50 % cannot be truncation error of a stable step
        if trust > (most := self.integrator.limit) or status is Status.unstable or gain > 0.5:
            fold = f"{gain + 1.0:.3g}-fold" if gain < math.inf else "beyond the range of numbers"
            grown = f", and the energy grew {fold}" * (gain > 0.5)
            known = 0.0 < trust < math.inf  # otherwise the force jumps or is constant at its last overlap
            shorter = f"use dt ≤ {DOUBTFUL_DT_LAMBDA * dt / trust:.2g} s" if trust > DOUBTFUL_DT_LAMBDA else (
                "the force of a law jumps or is not finite")
            return Status.unstable, (
                f"{limit}, the stability limit is {most:g}{grown}; {shorter}." if known else
                f"dt = {dt:.3g} s is too long for a force that jumps{grown}; use a shorter step."), trust
        if trust > DOUBTFUL_DT_LAMBDA:
            self.doubt = (f"{limit}; above {DOUBTFUL_DT_LAMBDA} errors are visible, so use "
                          f"dt ≤ {DOUBTFUL_DT_LAMBDA * dt / trust:.2g} s.")
        if status is Status.max_events:
            option = "max_steps" if self.steps >= self.request.max_steps else "max_events"
            work = f"{self.contacts} contacts, {self.steps} steps"
            return status, f"{status.value} (t = {end:.6g} s, {work}); {raised(option, self.request.end)}.", trust
        return status, f"{status.value} at t = {end:.6g} s.", trust

    def _deflected(self) -> bool:
        """Return whether any ball deviates from free fall or free swing.

        Scenes with thermal walls always return False.
        """
        scene, balls = self.scene, ~self.scene.is_wall
        if scene.heated:
            return False
        free, v = scene.free_velocity(self.k * self.dt)[balls], self.stepper.balls()[balls]
        return not bool((np.abs(v - free) <= 1e-9 * float(np.abs(free).max())).all())

    def _energy_gain(self) -> float:
        """Return the unexplained growth of kinetic energy, relative to the largest supply.

        Work of gravity, forces and pendula is explained. With walls that move or heat the result is 0.
        """
        scene, balls = self.scene, ~self.scene.is_wall
        if scene.fed:
            return 0.0
        m, v0, v = scene.mass[balls], scene.velocity[balls], self.stepper.balls()[balls]
        x = positions(scene, -self.stepper.pairs(XI)[None], np.array([self.k * self.dt]), self.start)[0][balls]
        kind, each = self.stepper.laws.in_pairs
        stored = (each[kind[c]].energy(-float(scene.gap[c])) for c in np.flatnonzero(scene.gap < 0.0).tolist())
        fallen = max(0.0, (m * scene.fall[balls]) @ (x - scene.position[balls])) if scene.pendulum == 0.0 else (
            0.5 * scene.pendulum**2 * (m @ scene.displacement[balls] ** 2))
        supply = 0.5 * m @ v0**2 + sum(stored) + fallen
        return float(0.5 * m @ v**2 / supply - 1.0) if supply > 0.0 else 0.0
