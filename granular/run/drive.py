"""Driver of all runs: samples, contact log, callbacks and progress.

An engine implements the protocol `Run`: it advances a scene in time and returns the reason for each pause. All other
tasks are done here once for all engines, including the check of their common options (`Request`).
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
from granular._engine.progress import Told, shown
from granular.run import until as stop
from granular.run.contact_log import CONTACT, CONTACT_ROW, LogFile, Rows, contacts, in_order, one_by_one
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene, positions, velocities
from granular.scene.places import flaw

DEFAULT_MAX_EVENTS = 1_000_000
"""Default of `max_events`, the number of contacts after which a run ends."""


class Request(NamedTuple):
    """Options of a run that all engines share, see `granular.md.simulate`."""

    start: float
    end: float
    until: stop.Until | None
    samples: check.Array | int | str | None
    log: bool
    stream: str | PathLike[str] | None
    max_events: int
    on_event: Callable[[Any], object] | None
    told: AbstractContextManager[Told | None]
    max_steps: int
    singly: bool = False
    """Whether the run pauses after every event."""

    @property
    def rows(self) -> bool:
        """Whether the rows of contacts are needed."""
        return self.log or self.on_event is not None


def requested(
    scene: Scene, start: float, t_end: float | None, *, max_steps: int = check.MAX_INTEGER, progress: bool = False,
    **given: Any,
) -> Request:
    """Return the checked options that all engines share."""
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
        log=stream is not None or check.truth("log", log),
        stream=stream,
        max_events=DEFAULT_MAX_EVENTS if given["max_events"] is None else check.whole(
            "max_events", given["max_events"]),
        on_event=check.callback("on_event", given["on_event"], "row"),
        told=shown(progress, given["on_progress"], end=end, start=start),
        max_steps=check.whole("max_steps", max_steps, at_least=1),
        singly=isinstance(given["until"], stop.LEVEL_TYPES) or given["on_event"] is one_by_one,
    )


def _sample_times(samples: Any, start: float, end: float) -> check.Array | int | str | None:
    """Return the times of the rows in s, or None for the first and the last row.

    "contacts", and a number of rows without an end time, are returned unchanged, because only the run determines the
    times.

    Raises
    ------
    TypeError, ValueError
        If no time is given, or if a time is outside [start, end] or less than the time before it.
    """
    if samples is None:
        return None
    if isinstance(samples, str):
        return check.choice("samples", samples, ("contacts",))
    if check.is_one(samples):
        fix = "Give None for the first and the last state."
        count = check.whole("samples", samples, at_least=2, at_most=check.MAX_REQUESTED_COUNT, fix=fix)
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
"""Times of rows about a contact, in units of its duration from its onset."""


def in_time(solve: Callable[[Request], Trajectory], request: Request) -> Trajectory:
    """Solve a request, twice if the times of its rows depend on the run.

    The first run has no callbacks. Rows do not change any bit of a run, so the second run is identical. If the run
    ends early, the time of its end is not a sample, because the row of the end is added anyway. A sample there would
    show the state before the last collisions, or repeat that row.
    """
    asked = request.samples
    if asked is None or isinstance(asked, np.ndarray):
        return solve(request)
    # the log of the first run determines the times
    first = solve(request._replace(samples=None, log=True, stream=None, on_event=None, told=nullcontext()))
    start, end = first.time[[0, -1]].tolist()
    times = np.linspace(start, end, asked) if isinstance(asked, int) else _about(
        first.contacts, start, end)
    return solve(request._replace(samples=times if end in (request.end, start) else times[:-1]))


def _about(log: Rows, start: float, end: float) -> check.Array:
    """Return times in s about each contact, including its onset and its end.

    For an instantaneous contact they include the last float before it.
    """
    if len(log) * len(CONTACT_SAMPLES) > check.MAX_REQUESTED_COUNT:
        raise ValueError(
            f"`samples` must give at most {check.MAX_REQUESTED_COUNT} samples, got 'contacts' with {len(log)} "
            "contacts. Give a number of samples, or stop earlier with t_end= or until=."
        )
    begin, over = log["t_begin"], np.where(np.isnan(log["t_end"]), end, log["t_end"])
    spread = (begin[:, None] + (over - begin)[:, None] * CONTACT_SAMPLES).ravel()
    times = np.concatenate([[start, end], begin, over, spread, np.nextafter(begin[begin == over], -math.inf)])
    return np.unique(times.clip(start, end))


STATE_TOLERANCE = 1e-9
"""Largest deviation of a state from the last row saved with it.

It is relative to the largest gap or velocity.
"""
CHECK_INTERVAL = 0.25
"""Approximate processor time in s between two checks of a run."""


class Pause(Enum):
    """Reason for a pause of a run, with the status as value if the run ends there."""

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
    """A buffer is full, or a check of the run is due. The run continues."""


class Row(NamedTuple):
    """State of the scene at a time in s, `elapsed` s after the start.

    Attributes
    ----------
    gap : array
        Gaps in m.
    velocity, rate : array or None
        Velocities of bodies or rates of gaps in m/s, depending on the engine.
    force : array or None
        Contact forces in N.
    ledger : array or None
        Five energies in J since the start, for driven or thermal walls: work of the floor and of the ceiling, heat of
        both, and dissipated energy.
    """

    time: float
    elapsed: float
    gap: check.Array
    velocity: check.Array | None = None
    rate: check.Array | None = None
    force: check.Array | None = None
    ledger: check.Array | None = None


class End(NamedTuple):
    """End of a run.

    Attributes
    ----------
    row : Row or None
        State at the end, or None if the last sample already contains it.
    status, message, stats, state
        As in `granular.Trajectory`. The state can also be a function that creates it on access.
    running : records or None
        Contacts that have not ended.
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
        Whether the gaps in a box add up to its length. This is false if contacts that begin early are reset to gap 0.
    in_order : bool
        Whether contacts settle in the order of the log. Otherwise they settle in the order of their ends.
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

        If `last` is true, no row is requested after `time`.
        """

    def row(self, time: float) -> Row:
        """Return the state at the start, or at the time just reached."""

    def rows(self) -> list[Rows]:
        """Return the contacts that have settled since the last call and cannot change."""

    def progress(self) -> tuple[float, int]:
        """Return the time reached in s and the number of contacts."""

    def end(self, pause: Pause, seen: float) -> End:
        """Finish the run.

        `seen` is the time of the last sample, or -inf if a row of the end is always needed.
        """


def portion(done: int, spent: float) -> int:
    """Return the amount of work until the next check of a run.

    It is extrapolated from the amount `done` in `spent` seconds of processor time.
    """
    # at most doubled, because one fast part does not predict the next; 1e-9 s guards against division by 0
    return max(1, int(done * min(2.0, CHECK_INTERVAL / max(spent, 1e-9))))


def drive(run: Run) -> Trajectory:
    """Run an engine to its end and return the trajectory."""
    if run.request.on_event is one_by_one:
        return one_by_one(run)  # type: ignore[return-value]
    if run.request.stream is None:
        return _driven(run, [])

    with LogFile(run.request.stream, CONTACT_ROW) as stream:
        return _driven(run, stream)


def _driven(run: Run, log: list[Rows] | LogFile) -> Trajectory:
    """Run an engine to its end, with its contacts in a list or in a file."""
    request = run.request
    samples = request.samples.tolist() if isinstance(request.samples, np.ndarray) else []
    kept = [run.row(request.start)] if request.samples is None else []
    with request.told as tell:
        for time in samples:
            pause = _follow(run, time, False, log, tell)
            if pause is not Pause.reached:
                break
            kept.append(run.row(time))
        else:
            pause = _follow(run, request.end, True, log, tell)
    end = run.end(pause, kept[-1].time if samples and kept else -math.inf)
    later: dict[str, Any] = {"end": request.end} if end.row is None and samples and kept[-1].time < request.end else {}
    if end.row is not None:
        kept.append(end.row)
    if end.running is not None and request.log:
        log.extend([end.running])
    if not (request.log and isinstance(log, list)):
        later["log"] = False if isinstance(log, list) else log.path
    rows = log if isinstance(log, list) else []
    table: Any = tuple(rows) if run.in_order else in_order(  # a single block of the engine is sorted without conversion
        rows[0] if len(rows) == 1 and rows[0].dtype == CONTACT else contacts(rows))
    columns: list[Any] = [None if column[0] is None else np.array(column) for column in zip(*kept, strict=True)]
    kept.clear()  # release memory: rows of a million balls are large
    time, elapsed, gap, velocity, rate, force, ledger = columns
    columns.clear()
    status, message = end.status, end.message
    beyond = end.status is Status.unstable  # values can overflow
    with np.errstate(invalid="ignore", over="ignore") if beyond else nullcontext():
        if velocity is None:
            velocity, rate = velocities(run.scene, rate, elapsed, run.start), None
        position = positions(run.scene, gap, elapsed, run.start)
        wrong = flaw(run.scene, run.start, elapsed[-1:], gap[-1], position[-1], velocity[-1], run.law is None,
                     run.adds_up)
    if wrong and status is not Status.unstable:
        status, message = Status.broken, f"{Status.broken.value}: {wrong}; {message}"
    return Trajectory(
        scene=run.scene, law=run.law, rule=run.rule, time=time, position=position, velocity=velocity, gap=gap,
        force=force, ledger=ledger, contacts=table, status=status, message=message, stats={**end.stats, **later},
        state=end.state,  # type: ignore[arg-type]
    )


def continue_run(run: Run, before: Trajectory) -> Trajectory:
    """Run an engine to its end, starting from the end of the run `before`.

    Raises
    ------
    ValueError
        If the state does not agree with the last row of `before`.
    """
    row = run.row(run.request.start)
    speed: Any = row.velocity if row.rate is None else velocities(
        run.scene, row.rate[None], np.array([row.elapsed]), run.start)[0]
    gap, velocity = before.gap[-1], before.velocity[-1]
    # the last row shows the state, unless it precedes the end or is the scene before the first event
    acted = "end" not in before.stats and before.time[-1] != before.time[0]
    if acted and (row.gap.shape != gap.shape or speed.shape != velocity.shape or not (
            _equal_to_rounding(row.gap, gap)
            and _equal_to_rounding(speed, velocity, float(np.abs(gap).max()) / row.elapsed))):
        raise ValueError("The state of `trajectory` must agree with its last sample. One of them was changed after "
                         "the run.")
    return drive(run)


def _equal_to_rounding(one: check.Array, other: check.Array, scale: float = 0.0) -> bool:
    """Return whether numbers are equal up to the rounding of another release.

    The tolerance is relative to the largest number or to `scale`.
    """
    return bool(np.abs(one - other).max() <= STATE_TOLERANCE * max(float(np.abs(other).max()), scale))


def _follow(run: Run, time: float, last: bool, log: list[Rows] | LogFile, tell: Told | None) -> Pause:
    """Advance to `time` and return the reason for the last pause.

    Settled contacts are logged and passed to callbacks, and progress is reported.
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
        if tell is not None:
            tell(*run.progress())
        if pause is not Pause.full:
            return pause
