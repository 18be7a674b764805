"""Driver of all runs: samples, contact log, callbacks and progress.

An engine implements the protocol `Run`: it advances a scene in time and returns the reason for each pause. This module
does all other tasks for all engines, including the check of their common options (`Request`).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from enum import Enum
from os import PathLike
from typing import Any, NamedTuple, Protocol

import numpy as np

from granular._engine import check
from granular._engine.callables import callback
from granular._engine.progress import ProgressCallback, progress_callback
from granular.run import until as stop
from granular.run.contact_log import CONTACT, CONTACT_ROW, LogFile, Rows, contacts, in_order, yield_contacts
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene, positions, velocities
from granular.scene.places import invalid_reason

DEFAULT_MAX_EVENTS = 1_000_000
"""Default of `max_events`, the maximum number of contacts of a run."""


class Request(NamedTuple):
    """Checked options of a run that all engines share, see `granular.md.simulate`.

    Attributes
    ----------
    start, end : float
        Start and end time in s. `end` is inf without an end time.
    until : stop condition or None
        Condition of `granular.until`.
    samples : array, int, str or None
        Sample times in s, see `_sample_times`.
    log : bool
        Whether contacts are logged, in memory or in a file.
    stream : path or None
        File of the contact log.
    max_events, max_steps : int
        Limits on the number of contacts and of steps.
    on_event : callable or None
        Function to call with each row of the log.
    progress_report : context manager
        It yields a function of the time reached and the number of contacts, or None.
    singly : bool
        Whether the run pauses after every event.
    energies : bool
        Whether the column `force_max` of the contact log contains dissipated energies in J instead of forces.
    """

    start: float
    end: float
    until: stop.Until | None
    samples: check.Array | int | str | None
    log: bool
    stream: str | PathLike[str] | None
    max_events: int
    on_event: Callable[[Any], object] | None
    progress_report: AbstractContextManager[ProgressCallback | None]
    max_steps: int
    singly: bool = False
    energies: bool = False

    @property
    def rows(self) -> bool:
        """Whether the engine has to record the rows of contacts."""
        return self.log or self.on_event is not None


def checked_request(
    scene: Scene, start: float, t_end: float | None, *, max_steps: int = check.MAX_INTEGER, progress: bool = False,
    **given: Any,
) -> Request:
    """Check the options that all engines share, and return them as a `Request`.

    `start` is the start time of the run in s. `given` are `until`, `samples`, `log`, `max_events`, `on_event` and
    `on_progress`.
    """
    end = math.inf if t_end is None else check.number("t_end", t_end, at_least=start, fix="The run starts there.")
    if end < end - start == math.inf:
        raise ValueError(f"`t_end` must be less than {sys.float_info.max:.3g} s after the start of the run, {start!r} "
                         f"s, got {t_end!r}.")
    log = given["log"]
    stream = log if isinstance(log, (str, PathLike)) else None
    return Request(
        start=start,
        end=end,
        until=stop.checked(given["until"], scene),
        samples=_sample_times(given["samples"], start, end),
        log=stream is not None or check.boolean("log", log),
        stream=stream,
        max_events=DEFAULT_MAX_EVENTS if given["max_events"] is None else check.integer(
            "max_events", given["max_events"]),
        on_event=callback("on_event", given["on_event"], "row"),
        progress_report=progress_callback(progress, given["on_progress"], end=end, start=start),
        max_steps=check.integer("max_steps", max_steps, at_least=1),
        singly=isinstance(given["until"], stop.LEVEL_TYPES) or given["on_event"] is yield_contacts,
    )


def _sample_times(samples: Any, start: float, end: float) -> check.Array | int | str | None:
    """Return the sample times in s, or None for the first and the last state.

    "contacts", and a number of samples without an end time, are returned unchanged, because their times depend on the
    run.

    Raises
    ------
    TypeError, ValueError
        If the array of times is empty, or if a time is outside [start, end] or less than the time before it.
    """
    if samples is None:
        return None
    if isinstance(samples, str):
        return check.choice("samples", samples, ("contacts",))
    if check.is_single(samples):
        fix = "Give None for the first and the last state."
        count = check.integer("samples", samples, at_least=2, at_most=check.MAX_REQUESTED_COUNT, fix=fix)
        return count if end == math.inf else np.linspace(start, end, count)
    times = check.array("samples", samples)
    if len(times) == 0:
        raise ValueError("`samples` must have at least one time, got an empty array. Give None for the first and the "
                         "last state.")
    inside = (times >= start) & (times <= end) & np.isfinite(times)
    check.every("samples", times, inside, f"a time in [{start:g}, {end:g}] s")
    check.every("samples", times, np.diff(times, prepend=-math.inf) >= 0.0, "at least as large as the entry before it",
                "Sort the times.")
    return times


CONTACT_SAMPLES = np.arange(-2, 11) / 8
"""Times of samples around a contact after its onset, in units of its duration."""


def solve_with_sample_times(solve: Callable[[Request], Trajectory], request: Request) -> Trajectory:
    """Solve a request with `solve`, twice if its sample times depend on the run.

    The first run has no callbacks. Runs are bitwise independent of their samples, so the second run is identical. If
    the run ends early, its end time is not a sample time, because the final state is recorded in any case. A sample at
    this time would repeat the final state, or show the state before the last collisions.
    """
    samples = request.samples
    if samples is None or isinstance(samples, np.ndarray):
        return solve(request)
    # the log of the first run determines the times
    first = solve(request._replace(samples=None, log=True, stream=None, on_event=None, progress_report=nullcontext()))
    start, end = first.time[[0, -1]].tolist()
    times = np.linspace(start, end, samples) if isinstance(samples, int) else _times_around_contacts(
        first.contacts, start, end)
    return solve(request._replace(samples=times if end in (request.end, start) else times[:-1]))


def solve_soft_spheres(solve: Callable[[Request], Trajectory], request: Request) -> Trajectory:
    """Solve a request of soft spheres, and prepare the energies of its contacts.

    They are computed on first access to `Trajectory.dissipated` by solving the request again. The attribute `again` of
    the trajectory is the function that does this.
    """
    run = solve_with_sample_times(solve, request)
    if isinstance(run, Trajectory):
        vars(run)["again"] = lambda: solve(request._replace(
            samples=None, log=True, stream=None, on_event=None, progress_report=nullcontext(), energies=True))
    return run


def _times_around_contacts(log: Rows, start: float, end: float) -> check.Array:
    """Return sample times in s around each contact of a log, and at its onset and end.

    `start` and `end` are the limits of the run in s, and are included. For an instantaneous contact the last float
    before it is included.
    """
    if len(log) * len(CONTACT_SAMPLES) > check.MAX_REQUESTED_COUNT:
        raise ValueError(
            f"`samples` must give at most {check.MAX_REQUESTED_COUNT} samples, got 'contacts' with {len(log)} "
            "contacts. Give a number of samples, or stop earlier with t_end= or until=."
        )
    begin, finish = log["t_begin"], np.where(np.isnan(log["t_end"]), end, log["t_end"])
    times_around = (begin[:, None] + (finish - begin)[:, None] * CONTACT_SAMPLES).ravel()
    times = np.concatenate([[start, end], begin, finish, times_around, np.nextafter(begin[begin == finish], -math.inf)])
    return np.unique(times.clip(start, end))


STATE_TOLERANCE = 1e-9
"""Largest difference between a saved state and the last sample saved with it.

It is relative to the largest gap or velocity.
"""
CHECK_INTERVAL = 0.25
"""Approximate processor time in s between two progress reports of a run."""


class Pause(Enum):
    """Reason for a pause of a run.

    The value is the status with which the run ends, or None if it continues.
    """

    reached = Status.time
    until = Status.until
    quiet = Status.quiet
    resting = Status.resting
    collapse = Status.collapse
    bounded = Status.bounded
    disturbed = Status.disturbed
    unstable = Status.unstable
    work = Status.max_events
    full = None
    """A buffer is full, or a progress report is due. The run continues."""


class Row(NamedTuple):
    """State of the scene at one time, as an engine provides it.

    Attributes
    ----------
    time, elapsed : float
        Time in s, and time in s since the start of the scene.
    gap : (p,) array
        Gaps in m.
    velocity, rate : array or None
        Velocities of bodies (n,) or rates of gaps (p,) in m/s. The engine provides one of them.
    force : (p,) array or None
        Contact forces in N.
    ledger : (5,) array or None
        Energies in J since the start, for driven or thermal walls: work of the floor, work of the ceiling, heat of the
        floor, heat of the ceiling, and dissipated energy.
    """

    time: float
    elapsed: float
    gap: check.Array
    velocity: check.Array | None = None
    rate: check.Array | None = None
    force: check.Array | None = None
    ledger: check.Array | None = None


class End(NamedTuple):
    """Final state, status and statistics of a run.

    Attributes
    ----------
    row : Row or None
        State at the end, or None if the last sample already contains it.
    status, message, stats, state
        As in `granular.Trajectory`. The state can also be a function that creates the state on first access.
    running : records or None
        Log rows of the contacts that have not ended.
    """

    row: Row | None
    status: Status
    message: str
    stats: Mapping[str, Any]
    state: Mapping[str, Any] | Callable[[], Any]
    running: Rows | None = None


class Run(Protocol):
    """Protocol of a run in progress, which each engine implements.

    Attributes
    ----------
    request : Request
        Options of the run.
    start : float
        Time in s of the initial scene.
    law, rule : tuple or None
        As in `granular.Trajectory`.
    adds_up : bool
        Whether the gaps between two walls add up to the distance of the walls. This is false if gaps of contacts that
        begin early are reset to 0.
    in_order : bool
        Whether the method `rows` returns contacts in the order of the public log. Otherwise it returns them in the
        order of their ends.
    """

    request: Request
    scene: Scene
    start: float
    law: Any
    rule: Any
    adds_up: bool
    in_order: bool

    def to(self, time: float, last: bool) -> Pause:
        """Advance towards `time` in s, and return the reason for the pause.

        If `last` is true, no state after `time` is requested later.
        """

    def row(self, time: float) -> Row:
        """Return the state at `time` in s: the start, or the time just reached."""

    def rows(self) -> list[Rows]:
        """Return the log rows that have become final since the last call."""

    def progress(self) -> tuple[float, int]:
        """Return the time reached in s and the number of contacts."""

    def end(self, pause: Pause, seen: float) -> End:
        """Return final state, status and statistics of the run.

        `pause` is the reason for its last pause. `seen` is the time of the last sample in s, or -inf if the final state
        is always recorded.
        """


def next_portion(done: int, spent: float) -> int:
    """Return the amount of work, such as steps, until the next pause of a run.

    It is extrapolated from the amount `done` in `spent` seconds of processor time, so that pauses are about
    `CHECK_INTERVAL` apart.
    """
    # at most doubled, because one fast part does not predict the next; 1e-9 s guards against division by 0
    return max(1, int(done * min(2.0, CHECK_INTERVAL / max(spent, 1e-9))))


def drive(run: Run) -> Trajectory:
    """Run an engine to its end, and return the trajectory."""
    if run.request.on_event is yield_contacts:
        return yield_contacts(run)  # type: ignore[return-value]
    if run.request.stream is None:
        return _run_to_end(run, [])

    with LogFile(run.request.stream, CONTACT_ROW) as stream:
        return _run_to_end(run, stream)


def _run_to_end(run: Run, log: list[Rows] | LogFile) -> Trajectory:
    """Run an engine to its end, and return the trajectory.

    `log` is the list or the file to which its contacts are added.
    """
    request = run.request
    samples = request.samples.tolist() if isinstance(request.samples, np.ndarray) else []
    recorded = [run.row(request.start)] if request.samples is None else []
    with request.progress_report as report:
        for time in samples:
            pause = _advance_to(run, time, False, log, report)
            if pause is not Pause.reached:
                break
            recorded.append(run.row(time))
        else:
            pause = _advance_to(run, request.end, True, log, report)
    end = run.end(pause, recorded[-1].time if samples and recorded else -math.inf)
    more_stats: dict[str, Any] = (
        {"end": request.end} if end.row is None and samples and recorded[-1].time < request.end else {})
    if end.row is not None:
        recorded.append(end.row)
    if end.running is not None and request.log:
        log.extend([end.running])
    if not (request.log and isinstance(log, list)):
        more_stats["log"] = False if isinstance(log, list) else log.path
    rows = log if isinstance(log, list) else []
    table: Any = tuple(rows) if run.in_order else in_order(  # a single block of the engine is sorted without conversion
        rows[0] if len(rows) == 1 and rows[0].dtype == CONTACT else contacts(rows))
    columns: list[Any] = [None if column[0] is None else np.array(column) for column in zip(*recorded, strict=True)]
    recorded.clear()  # release memory: rows of a million balls are large
    time, elapsed, gap, velocity, rate, force, ledger = columns
    columns.clear()
    status, message = end.status, end.message
    is_unstable = end.status is Status.unstable  # values can overflow
    with np.errstate(invalid="ignore", over="ignore") if is_unstable else nullcontext():
        if velocity is None:
            velocity, rate = velocities(run.scene, rate, elapsed, run.start), None
        position = positions(run.scene, gap, elapsed, run.start)
        defect = invalid_reason(
            run.scene, run.start, elapsed=elapsed[-1:], gap=gap[-1], position=position[-1], velocity=velocity[-1],
            hard=run.law is None, adds_up=run.adds_up)
    if defect and status is not Status.unstable:
        status, message = Status.broken, f"{Status.broken.value}: {defect}; {message}"
    return Trajectory(
        scene=run.scene, law=run.law, rule=run.rule, time=time, position=position, velocity=velocity, gap=gap,
        force=force, ledger=ledger, contacts=table, status=status, message=message, stats={**end.stats, **more_stats},
        state=end.state,  # type: ignore[arg-type]
    )


def continue_run(run: Run, before: Trajectory) -> Trajectory:
    """Run an engine that was created from the state of the run `before`, to its end.

    Raises
    ------
    ValueError
        If the state does not agree with the last sample of `before`.
    """
    row = run.row(run.request.start)
    speed: Any = row.velocity if row.rate is None else velocities(
        run.scene, row.rate[None], np.array([row.elapsed]), run.start)[0]
    gap, velocity = before.gap[-1], before.velocity[-1]
    # the last sample shows the state, except if it precedes the end or is the scene before the first event
    is_comparable = "end" not in before.stats and before.time[-1] != before.time[0]
    if is_comparable and (row.gap.shape != gap.shape or speed.shape != velocity.shape or not (
            _equal_to_rounding(row.gap, gap)
            and _equal_to_rounding(speed, velocity, float(np.abs(gap).max()) / row.elapsed))):
        raise ValueError("The state of `trajectory` must agree with its last sample. One of them was changed after "
                         "the run.")
    return drive(run)


def _equal_to_rounding(values: check.Array, reference: check.Array, scale: float = 0.0) -> bool:
    """Return whether numbers differ by at most `STATE_TOLERANCE`.

    The tolerance is relative to the largest reference value or to `scale`. It allows for the rounding errors of another
    release.
    """
    return bool(np.abs(values - reference).max() <= STATE_TOLERANCE * max(float(np.abs(reference).max()), scale))


def _advance_to(run: Run, time: float, last: bool, log: list[Rows] | LogFile, report: ProgressCallback | None) -> Pause:
    """Advance a run to `time` in s, and return the reason for its last pause.

    At each pause, contacts that have become final are logged and passed to the callback, and progress is reported.
    """
    request = run.request
    while True:
        pause = run.to(time, last)
        rows = run.rows()
        if request.log:
            log.extend(rows)
        if request.on_event is not None:
            for row in contacts(rows):
                request.on_event(row)
        if report is not None:
            report(*run.progress())
        if pause is not Pause.full:
            return pause
