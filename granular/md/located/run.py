"""Simulation of one scene by the located integrator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular._engine.kernels import CompilationCost, compiled, fitted
from granular._engine.records import column, copied, plain, record_array, set_event_time, update_tournament
from granular.laws.kinds import SceneLaws
from granular.md.located import blocks
from granular.md.located.checkpoint import MAX_FULL_COPY_PAIRS, Checkpoint, RecordsBeforeEnd
from granular.md.located.ending import message_of, settle_overlaps, stats_of, unlogged_contacts
from granular.md.located.log import drop_settled_rows
from granular.md.located.one_contact.inside import request_state, write_and_request_states, write_integrated_state
from granular.md.located.pace import PAUSE_REASONS, Pace
from granular.md.located.plan import follow_contact, integrate_wanted_contact, make_table, plan_all_due
from granular.md.located.power_form import power_form
from granular.md.located.records import (
    BINDING,
    CRAMPED,
    DUE_TO_PLAN,
    ENERGIES,
    GENERAL,
    IGNORE,
    MAX_INITIAL_LOG_ROWS,
    MORE,
    NO_LOG,
    PEAKS,
    QUIET,
    REACHED,
    STOP,
    STOPPED,
    UNTIL_ANY_EVENT,
    WANTS_CONTACT,
    WANTS_TABLE,
)
from granular.md.located.system import (
    system_of,
    to_compiled,
    to_plain,
    with_longer_log,
    with_more_room,
    with_room_for_a_table,
)
from granular.run.contact_log import CONTACT_ROW, Rows
from granular.run.drive import End, Pause, Request, Row
from granular.run.trajectory import CONTACT
from granular.scene import Scene
from granular.scene.places import WallMeeting

LOCATED_LOAD_SECONDS, LOCATED_COMPILE_SECONDS, LAUNCH_SECONDS_PER_PAIR = 0.6, 13.0, 2e-5
"""Times in s to load the machine code, to compile it, and to start one pair.

A pair is started interpreted: its first block is formed and planned."""
DISTURBED_OPTIONS = ("resolve", "stop", "ignore")
"""Options for disturbed contacts, in the order of RESOLVE, STOP, IGNORE."""


class Run:
    """Simulation of one scene by the located integrator.

    It implements the protocol `granular.run.drive.Run`. Its times are counted from `start`, so that a late start
    costs no digits. A resumed run takes `start` from its checkpoint.

    Parameters
    ----------
    scene, laws : Scene, SceneLaws
        Scene and force laws.
    request : Request
        Options that all integrators share.
    engine : str
        "auto", "plain" or "compiled".
    tol : float
        Truncation error of a step under nonlinear laws, relative to the current speed and overlap. Linear laws are
        always integrated to rounding error.
    disturbed : str
        One of `DISTURBED_OPTIONS`. Defaults to "resolve".
    state : mapping, optional
        Checkpoint from which the run continues.

    Raises
    ------
    ValueError
        If `disturbed` is "ignore" for pendula, or if the checkpoint does not fit the scene.
    TypeError
        If `engine` is "compiled" and a law is not a power form.
    """

    in_order, rule = False, None

    def __init__(
        self, scene: Scene, laws: SceneLaws, request: Request, engine: str, tol: float, disturbed: str = "resolve",
        state: Mapping[str, Any] | None = None,
    ) -> None:
        if scene.pendulum > 0.0 and disturbed == "ignore":
            raise ValueError("`disturbed` must be 'resolve' or 'stop' for pendula, got 'ignore'. Setting pendula that "
                             "touch early back to gap 0 would change their energy.")
        # energies need other machine code, which is compiled only if that saves time
        engine = "auto" if request.energies and engine == "compiled" else engine
        self.scene, self.laws, self.law, self.request, self.engine = scene, laws, laws.given, request, engine
        self.start = request.start if state is None else float(state["origin"])  # s, origin of its own times
        self.closing = WallMeeting(scene, self.start, flattened=True) if scene.driven else None
        self.bound, self.seen, self.now = False, 0.0, 0.0  # s, times of the last sample and of the run
        limits = {"max_events": request.max_events, "max_steps": request.max_steps,
                  "until_pair": UNTIL_ANY_EVENT if request.singly else -1}
        codes, level = [DISTURBED_OPTIONS.index(disturbed)], (
            ENERGIES if request.energies else PEAKS if request.rows else NO_LOG)
        s = system_of(scene, laws, request.until, self.start, tol=tol, disturbing=codes[0], log_level=level, **limits)
        self.collocation = None
        if s.kinds["kind"][0] == GENERAL:  # imported only for general laws
            from granular.md.located.own_law import Collocation

            self.collocation = Collocation(laws, scene.ring)
        if state is not None:
            from granular.md.located.restore import restored_records

            s = restored_records(s, state)
            codes.append(int(np.asarray(state["run"])["disturbing"][0]))
        self.s: Any = s
        flags = [*scene._flags, "METERED"][: None if request.energies else -1]
        self.special = {flag: True for flag in flags if flag != "DRIVEN" or s.field is not None}  # a wall moves
        self.adds_up = IGNORE not in codes
        self.pace = Pace(self)
        if engine == "auto":
            self.toll = CompilationCost(self.fit(blocks.advance), LOCATED_LOAD_SECONDS, LOCATED_COMPILE_SECONDS)
        if engine == "compiled" or self.compilation_pays(LAUNCH_SECONDS_PER_PAIR * scene.n_pairs):
            self.compile()
        else:
            self.s = to_plain(s)
        self.launched = state is not None or self.launch()
        if state is not None:
            self.continue_from_checkpoint(state)

    def launch(self) -> bool:
        """Form and plan the first blocks of a run.

        Returns false if the run has to stop at its start.
        """
        return bool(self.kernels(blocks.start_blocks)(self.s, self.collocation))

    def continue_from_checkpoint(self, state: Mapping[str, Any]) -> None:
        """Continue from the records of the checkpoint `state`."""
        self.kernels(update_tournament)(self.s.queue, 0, self.scene.n_pairs - 1)
        # an earlier version saved the start of the creep, and had other pieces for piles on driven walls
        if any(state.get(name, False) for name in ("creeping", "riding")):
            self.replan_driven_blocks(self.request.start)

    def fit(self, kernel: Any) -> Any:
        """Return the version of a kernel for the flags of the scene, such as `DRIVEN`."""
        return fitted(kernel, **self.special) if self.special else kernel

    def kernels(self, kernel: Any) -> Any:
        """Return the version of a kernel that fits the scene and the form of the records.

        It is compiled if the records are numpy arrays, else interpreted.
        """
        fit = fitted(kernel, **self.special) if self.special else kernel
        return fit if isinstance(self.s.run, list) else compiled(fit)

    @property
    def is_plain(self) -> bool:
        """Whether the records are in the form for interpreted code."""
        return isinstance(self.s.run, list)

    @property
    def counters(self) -> Any:
        """Record of counters and limits, with fields such as ``counters["steps"]``."""
        return self.s.run[0]

    @property
    def is_disturbed(self) -> bool:
        """Whether the run has stopped before its first disturbed contact."""
        return bool(self.counters["disturbing"] == STOP and self.counters["first"] >= 0)

    def compilation_pays(self, ahead: float = 0.0) -> bool:
        """Return whether compilation pays off for an interpreted run with engine "auto".

        `ahead` is a lower bound of the remaining interpreted time in s.
        """
        return self.engine == "auto" and self.collocation is None and self.toll.due(ahead)

    def compile(self) -> None:
        """Continue with compiled instead of interpreted code from the current state.

        Results are bitwise identical. Raises `TypeError` if a law is not a power form.
        """
        compiled(self.fit(blocks.advance))  # raises before any record is changed
        if self.collocation is not None:
            general_law = next(law.law for law in self.laws.each if power_form(law) is None)
            raise TypeError(
                f"engine='compiled' requires laws of the form k ξ^p + γ ξ^d ξ̇, got {general_law!r}. Use engine='auto' "
                "or 'plain'."
            )
        self.s, self.engine = to_compiled(self.s), "compiled"

    def to(self, time: float, last: bool) -> Pause:
        """Advance to `time` in s, or by a portion of the way.

        `last` is true if no sample follows after `time`. Returns the reason of the pause: `Pause.reached` at `time`,
        `Pause.full` if the run continues (a portion is done, or records had to be enlarged), or the reason why the run
        ends. `Pause.work` (status max_events) is such a reason: the work limit, or a run that stalls with tiny steps.
        """
        limit = time - self.start
        if not self.launched:  # stopped at its start
            return Pause.disturbed if self.is_disturbed else Pause.until
        if limit == math.inf and self.counters["rests"] == 1:
            return Pause.resting  # proved before: a resumed run ends at the same state
        code, counters = self.pace.advance_portion(limit, last), self.counters
        reached = code == REACHED or (code == QUIET and limit < math.inf)
        self.now = limit if reached else float(counters["t"])
        if self.closing is not None and self.now < math.inf:
            self.closing.refuse(self.start + self.now, self.request.end)
        # the kernel stopped for work that it cannot do itself; the next call continues
        if code == WANTS_TABLE:
            self.s = with_room_for_a_table(self.s)
            make_table(self.s, self.collocation, self.kernels)
            return Pause.full
        if code == WANTS_CONTACT:
            integrate_wanted_contact(self.s, self.collocation, self.kernels)
        elif code == CRAMPED:  # the records are full
            self.s = with_more_room(self.s)
        if code in (WANTS_CONTACT, CRAMPED):
            return Pause.full
        if reached:
            return Pause.reached
        if code == STOPPED and self.is_disturbed:
            return Pause.disturbed
        if code != MORE:  # BINDING: the balls stay in contact, but not every contact is damped
            self.bound = code == BINDING
            return PAUSE_REASONS[code]
        if self.compilation_pays():
            self.compile()
        return Pause.work if self.pace.stalls() else Pause.full

    def progress(self) -> tuple[float, int]:
        """Return the time in s and the number of contacts so far."""
        return self.start + float(self.counters["t"]), int(self.counters["contacts"])

    def rows(self) -> list[Rows]:
        """Remove finished contacts from the log buffer, and return them.

        A contact is removed if it has ended and can no longer change. The result is a list of at most one array.
        """
        counters = self.counters
        row_count = int(counters["rows"])
        if row_count == 0:
            return []
        log = self.s.log[:row_count]
        rows = record_array(log, CONTACT_ROW) if isinstance(log, list) else copied(log)
        is_finished = (rows["pair"] >= 0) & (rows["t_end"] <= self.now)
        if is_finished.all():
            counters["rows"] = 0
        else:
            self.kernels(drop_settled_rows)(self.s, self.now)
            rows = rows[is_finished]
        log_length = len(self.s.log)
        # longer if half of the rows belong to contacts that continue, or if a short buffer is full
        if 2 * counters["rows"] > log_length or row_count + 2 > log_length < MAX_INITIAL_LOG_ROWS:
            self.s = with_longer_log(self.s)
        if self.request.on_event is not None:
            rows = rows[np.argsort(rows["t_end"], kind="stable")]
        return [self.with_scene_times(rows)]

    def with_scene_times(self, rows: Rows) -> Rows:
        """Convert the times of log rows from times since the start to times of the scene.

        `rows` is modified.
        """
        if self.start != 0.0:
            rows["t_begin"] += self.start
            rows["t_end"] += self.start
        return rows.view(CONTACT)

    def row(self, time: float) -> Row:
        """Return the state of the scene at `time` in s. It is not after the next event."""
        return self.row_after(time - self.start, time)

    def row_after(self, elapsed: float, time: float) -> Row:
        """Return the state of the scene a time `elapsed` in s after the start of the run.

        The state is labelled with `time` in s. Raises `OverflowError` if it is not finite.
        """
        n = self.scene.n_pairs
        state: Any = np.zeros((3, n))
        rows = state.tolist() if self.is_plain else state
        sums: Any = None if self.s.ledger is None else [0.0] * 5 if self.is_plain else np.zeros(5)
        c = self.kernels(write_and_request_states)(self.s, elapsed, *rows, sums, self.collocation)
        while c < n:  # pair c is inside a contact solved as one event: integrate this contact up to `elapsed`
            self.kernels(follow_contact)(self.s, self.collocation)
            self.kernels(write_integrated_state)(self.s, c, *rows, sums)
            c = self.kernels(request_state)(self.s, c + 1, elapsed)
        state = np.asarray(rows)
        if not np.isfinite(state[:2]).all():  # interpreted code raises earlier
            raise OverflowError("an overlap or its rate")
        np.negative(state[:2], out=state[:2])  # gaps and their rates are minus the overlaps and their rates
        self.seen = elapsed
        ledger = None if sums is None else np.array(sums)
        return Row(time, elapsed, state[0], rate=state[1], force=state[2], ledger=ledger)

    def end(self, pause: Pause, seen: float) -> End:
        """Advance every pair to the end of the run, and return how the run ended.

        `pause` is the reason of the end. `seen` is the time in s of the last sample, or -inf if a final sample is
        needed in any case.
        """
        if pause is Pause.resting:
            settle_overlaps(self)
        if self.engine == "auto":
            self.toll.lap()
        end = self.request.end - self.start if pause is Pause.reached else max(float(self.counters["t"]), self.seen)
        all_apart = bool(self.kernels(blocks.is_all_apart)(self.s, end))
        if not all_apart:
            self.pace.test_all_for_creep()
        row, needs_row = None, seen == -math.inf or (pause is not Pause.reached and self.start + end > seen)
        if needs_row and pause is Pause.reached:  # bitwise identical to a sample there
            row = self.row(self.request.end)
        untouched = None if all_apart else self.advance_to_end(end)
        if needs_row and row is None:
            row = self.row_after(end, self.start + end)
        running, r = unlogged_contacts(self, end) if self.request.log and not all_apart else None, plain(self.s.run)[0]
        stats, message = stats_of(self, r), message_of(self, pause.value, r, self.start + end)
        before, self.s, self.pace.run = self.s, None, None  # frees memory for the log
        before = untouched.put_back() if untouched else before
        state = Checkpoint(before, {"origin": self.start}) if self.launched else {}
        return End(row, pause.value, message, stats, state, running)

    def advance_to_end(self, end: float) -> RecordsBeforeEnd:
        """Advance every pair to the end of the run, a time `end` in s after its start.

        Returns a copy of the records before, for the checkpoint.
        """
        untouched = RecordsBeforeEnd(self.s, end)
        while not self.kernels(blocks.continue_contacts_by_pieces)(self.s, end, self.collocation):
            self.s = with_more_room(self.s)
        self.pace.test_all_for_creep()
        # no event follows, so the queue of a large run is no longer needed
        if len(self.s.queue) > MAX_FULL_COPY_PAIRS:
            self.s = self.s._replace(queue=copied(self.s.queue[:1]))
        self.kernels(blocks.advance_islands_to_end)(self.s, end, self.collocation)
        if column(self.s.pool, "manner").any():
            self.pace.rare_kernel(blocks.expand_resting_blocks)(self.s)
        # the remaining valid rows of the log buffer belong to contacts that are over, so all of them are collected
        self.now = math.inf
        return untouched

    def replan_driven_blocks(self, time: float) -> None:
        """Plan the pieces of blocks at driven walls again, and continue the run to `time`.

        Only checkpoints of earlier versions need this.
        """
        for c in np.flatnonzero(column(self.s.pairs, "wall") > 0).tolist():
            if self.s.pairs[c]["slot"] >= 0:
                self.kernels(set_event_time)(self.s.queue, int(self.s.pairs[c]["first"]), DUE_TO_PLAN)
        self.kernels(plan_all_due)(self.s, self.collocation)
        while self.to(time, False) is Pause.full:
            pass
