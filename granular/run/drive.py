"""The driver of all runs: it goes from sample to sample, keeps rows and contacts, and tells who wants to know.

An engine is a `Run`: it moves a scene on in time and says why it pauses. Everything else is done here, once: options
that all engines share are checked too (`Request`).
"""

from __future__ import annotations

import math
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

EVENTS = 1_000_000
"""Default of `max_events`, the number of contacts after which a run ends."""


class Request(NamedTuple):
    """What is asked of a run by the options that all engines share; see `granular.md.simulate`."""

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
    """Whether a run pauses after every event."""

    @property
    def rows(self) -> bool:
        """Whether anybody wants the rows of contacts."""
        return self.log or self.on_event is not None


def requested(
    scene: Scene, start: float, t_end: float | None, *, max_steps: int = check.LARGEST, progress: bool = False,
    **given: Any,
) -> Request:
    """Check the options that all engines share."""
    end = math.inf if t_end is None else check.number("t_end", t_end, at_least=start, fix="t_start is the earliest")
    if end < end - start == math.inf:
        raise ValueError(f"t_end is {t_end!r}: a time is needed to which numbers reach from t_start = {start!r}.")
    log = given["log"]
    stream = log if isinstance(log, (str, PathLike)) else None
    return Request(
        start=start,
        end=end,
        until=stop.checked(given["until"], scene),
        samples=_sample_times(given["samples"], start, end),
        log=stream is not None or check.truth("log", log),
        stream=stream,
        max_events=EVENTS if given["max_events"] is None else check.whole("max_events", given["max_events"]),
        on_event=check.callback("on_event", given["on_event"], "row"),
        told=shown(progress, given["on_progress"], end=end, start=start),
        max_steps=check.whole("max_steps", max_steps, at_least=1),
        singly=isinstance(given["until"], stop.LEVELS) or given["on_event"] is one_by_one,
    )


def _sample_times(samples: Any, start: float, end: float) -> check.Array | int | str | None:
    """Return the times of the rows in s, or None for the first and the last; what only the run itself can tell, rows
    about its contacts or a number of them without an end, as it is.

    Raises
    ------
    TypeError, ValueError
        If there is no time, or one outside [start, end], or one before its predecessor.
    """
    if samples is None:
        return None
    if isinstance(samples, str):
        return check.choice("samples", samples, ("contacts",))
    if check.is_one(samples):
        fix = "give None for the first and the last row"
        count = check.whole("samples", samples, at_least=2, at_most=check.MOST, fix=fix)
        return count if end == math.inf else np.linspace(start, end, count)
    times = check.array("samples", samples)
    if len(times) == 0:
        raise ValueError("samples is empty: at least one time is needed; give None for the first and the last row.")
    inside = (times >= start) & (times <= end) & np.isfinite(times)
    check.every("samples", times, inside, f"a time from {start:g} to {end:g} s is needed")
    check.every("samples", times[1:], np.diff(times) >= 0.0, "times must not decrease", "sort them")
    return times


AROUND = np.arange(-2, 11) / 8
"""Where rows about a contact are, in units of its duration from its onset."""


def in_time(solve: Callable[[Request], Trajectory], request: Request) -> Trajectory:
    """Solve what is requested; where only the run can tell the times of its rows, it is solved twice.

    Nobody is told of the first time. Rows change no bit of a run, so the second one is the same. Its last row is that
    of its end: a sample at that instant would show what is still to act there, or the same once more.
    """
    asked = request.samples
    if asked is None or isinstance(asked, np.ndarray):
        return solve(request)
    first = solve(request._replace(samples=None, log=True, stream=None, on_event=None, told=nullcontext()))
    start, end = first.time[[0, -1]].tolist()
    times = np.linspace(start, end, asked) if isinstance(asked, int) else _about(first.contacts, start, end)
    return solve(request._replace(samples=times if end in (request.end, start) else times[:-1]))


def _about(log: Rows, start: float, end: float) -> check.Array:
    """Times in s about each contact, its onset and end among them; before an instant the last number before it."""
    if len(log) * len(AROUND) > check.MOST:
        raise ValueError(f"samples is 'contacts': {len(log)} contacts would give more than {check.MOST} rows; give a "
                         "number of rows, or a t_end or until that stops earlier.")
    begin, over = log["t_begin"], np.where(np.isnan(log["t_end"]), end, log["t_end"])
    spread = (begin[:, None] + (over - begin)[:, None] * AROUND).ravel()
    times = np.concatenate([[start, end], begin, over, spread, np.nextafter(begin[begin == over], -math.inf)])
    return np.unique(times.clip(start, end))


SAME = 1e-9
"""Part of the largest gap or velocity by which a state may show another last row than was saved with it."""
AWHILE = 0.25
"""Seconds of processor time between two looks at a run, about."""


class Pause(Enum):
    """Why a run pauses; the value is the status if it ends there."""

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
    """A buffer is full, or a look at the run is due; it goes on."""


class Row(NamedTuple):
    """The scene at a time in s, `elapsed` seconds after the start: gaps in m; velocities of bodies or rates of gaps in
    m/s, whatever the engine goes by; forces in N if there are any; in J since the start, where walls are driven or
    thermal: work of the floor and of the ceiling, heat of both, what was dissipated."""

    time: float
    elapsed: float
    gap: check.Array
    velocity: check.Array | None = None
    rate: check.Array | None = None
    force: check.Array | None = None
    ledger: check.Array | None = None


class End(NamedTuple):
    """How a run ended.

    Attributes
    ----------
    row : Row or None
        The scene at the end; None where a sample shows it.
    status, message, stats, state
        As in `granular.Trajectory`; what makes the state once it is read will do.
    running : records or None
        Contacts still open.
    """

    row: Row | None
    status: Status
    message: str
    stats: Mapping[str, Any]
    state: Mapping[str, Any] | Callable[[], Any]
    running: Rows | None = None


class Run(Protocol):
    """One run under way.

    Attributes
    ----------
    request : Request
        What is asked of it.
    start : float
        Time in s at which the scene stood as it says.
    law, rule : tuple or None
        As in `granular.Trajectory`.
    adds_up : bool
        Gaps in a box add up to it: not where contacts that begin early are set back to gap 0.
    in_order : bool
        Contacts settle in the order of the log, else in the order in which they end.
    """

    request: Request
    scene: Scene
    start: float
    law: Any
    rule: Any
    adds_up: bool
    in_order: bool

    def to(self, time: float, last: bool) -> Pause:
        """Go on towards `time` in s (`last`: no row is asked for later) and say why to pause."""

    def row(self, time: float) -> Row:
        """Return the scene at the start, or at the time just reached."""

    def rows(self) -> list[Rows]:
        """Hand over the contacts settled since the last call: nothing can change them any more."""

    def progress(self) -> tuple[float, int]:
        """Return how far the run has come: time in s, and number of contacts."""

    def end(self, pause: Pause, seen: float) -> End:
        """Bring the run to its end; `seen` is the time of the last sample, -inf if a row is wanted in any case."""


def portion(done: int, spent: float) -> int:
    """Return how much to do until the next look at a run, as so much took so many seconds of processor time."""
    return max(1, int(done * min(2.0, AWHILE / max(spent, 1e-9))))


def drive(run: Run) -> Trajectory:
    """Take a run to its end."""
    if run.request.on_event is one_by_one:
        return one_by_one(run)  # type: ignore[return-value]
    if run.request.stream is None:
        return _driven(run, [])

    with LogFile(run.request.stream, CONTACT_ROW) as stream:
        return _driven(run, stream)


def _driven(run: Run, log: list[Rows] | LogFile) -> Trajectory:
    """Take a run to its end, with its contacts in a list or in a file."""
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
    table: Any = tuple(rows) if run.in_order else in_order(  # what an engine keeps is the least that tells all
        rows[0] if len(rows) == 1 and rows[0].dtype == CONTACT else contacts(rows))
    columns: list[Any] = [None if column[0] is None else np.array(column) for column in zip(*kept, strict=True)]
    kept.clear()  # rows of a million balls are large
    time, elapsed, gap, velocity, rate, force, ledger = columns
    columns.clear()
    status, message = end.status, end.message
    beyond = end.status is Status.unstable  # beyond all numbers, perhaps
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


def go_on(run: Run, before: Trajectory) -> Trajectory:
    """Take a run to its end that goes on from that of another one.

    Raises
    ------
    ValueError
        If its state does not show what the last row of `before` does.
    """
    row = run.row(run.request.start)
    speed: Any = row.velocity if row.rate is None else velocities(
        run.scene, row.rate[None], np.array([row.elapsed]), run.start)[0]
    gap, velocity = before.gap[-1], before.velocity[-1]
    # its last row shows its state, but for one before its end, or at the start: the scene before anything acts
    acted = "end" not in before.stats and before.time[-1] != before.time[0]
    if acted and (row.gap.shape != gap.shape or speed.shape != velocity.shape or not (
            _alike(row.gap, gap) and _alike(speed, velocity, float(np.abs(gap).max()) / row.elapsed))):
        raise ValueError("state of trajectory does not show its last row: one of them was changed after the run.")
    return drive(run)


def _alike(one: check.Array, other: check.Array, scale: float = 0.0) -> bool:
    """Whether numbers are equal apart from the rounding of another release, relative to the largest or to `scale`."""
    return bool(np.abs(one - other).max() <= SAME * max(float(np.abs(other).max()), scale))


def _follow(run: Run, time: float, last: bool, log: list[Rows] | LogFile, tell: Told | None) -> Pause:
    """Go on to `time`; take contacts as they settle and hand them on, tell of progress; return why that is the end."""
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
