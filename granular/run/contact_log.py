"""Log of contacts: public columns, internal columns of the engines, and its file.

The module also computes the momentum that walls transfer to the balls.

The file is a plain ``.npy`` that is complete after every block. Its header (format 1.0 of numpy) contains the number of
rows with space for more digits, and is rewritten after each block. If the process is killed, all counted rows are
therefore in the file, and `numpy.load` can read or memory-map it. (HDF5 offers the same in its single-writer mode, but
after a kill a file must be repaired before it can be extended.)
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy

from granular._engine.check import Array, must
from granular._engine.records import SMALL_RECORD_COUNT, raw
from granular.scene.places import positions, velocities
from granular.scene.state import Scene

CONTACT = np.dtype(
    [
        ("pair", np.int64),
        ("t_begin", np.float64),
        ("t_end", np.float64),
        ("duration", np.float64),
        ("v_in", np.float64, (2,)),
        ("v_out", np.float64, (2,)),
        ("xi_max", np.float64),
        ("force_max", np.float64),
        ("impulse", np.float64),
    ]
)
"""Record of the public contact log: one row per contact, sorted by `t_begin`.

All values are in SI units. `t_begin` and `t_end` are onset and end in s, equal in EDMD. `duration` in s is accumulated
from the onset, so late times cost no digits. `v_in` and `v_out` are the velocities of the lower and the upper body in
m/s before and after the contact. `xi_max` is the largest overlap in m, and `impulse` is in N s. `force_max` is the
largest force in N, or nan in EDMD, where it is infinite. For a contact that is still open at the end of the run,
`t_end` and `v_out` are nan, and duration, maxima and impulse are the values so far.
"""

Rows = np.ndarray[tuple[int], np.dtype[np.void]]
"""Contacts as a structured array, with the columns of an engine or of the log."""
SIDE_COLUMNS = {"lower_in": ("v_in", 0), "upper_in": ("v_in", 1), "lower_out": ("v_out", 0), "upper_out": ("v_out", 1)}
"""Columns of an engine that are one side of a public column with two."""
SOFT_FIELDS = [(name, float) for name in (*SIDE_COLUMNS, "xi_max", "force_max", "impulse")]
"""Columns of soft spheres after the times.

They are velocities of the lower and the upper body at onset and end in m/s, largest overlap in m, largest force in N
and impulse in N s.
"""
CONTACT_ROW = np.dtype(
    [("pair", int), ("t_begin", float), ("t_end", float), ("duration", float), *SOFT_FIELDS], align=True)
"""Record of a contact of soft spheres.

Times are in s. Values that are not yet known are nan.
"""
MOMENTUM_ROUNDING = 1e-9
"""Largest rounding error relative to the largest momentum or velocity."""
COPY_ROWS = 2048
"""Number of contacts that are copied at a time, column by column.

That number of rows fits into the cache of the processor.
"""


def contacts(settled: list[Rows]) -> Rows:
    """Convert contacts with the columns of an engine to the public log.

    A contact without an end of its own is instantaneous and has an infinite force. The list `settled` is emptied, so
    converted blocks release their memory.
    """
    log = np.zeros(sum(map(len, settled)), CONTACT)
    stop = 0
    while settled:
        some = settled.pop(0)
        for k in range(0, len(some), COPY_ROWS):
            rows = some[k : k + COPY_ROWS]
            part, stop = log[stop : stop + len(rows)], stop + len(rows)
            if rows.dtype in (CONTACT, CONTACT_ROW):  # the same bytes
                raw(part)[:] = raw(rows)
                continue
            names = rows.dtype.names or ()
            if "t_end" not in names:
                part["t_end"], part["force_max"] = rows["t_begin"], np.nan
            for name in names:
                column, side = SIDE_COLUMNS.get(name, (name, slice(None)))
                part[column].T[side] = rows[name].T
    return log


class PublicWhenRead:
    """Base of classes whose attribute `contacts` is created on first access.

    The public log is created from the rows that an engine has `settled`. The attribute `state` is likewise created by
    the function `kept`, if there is one.
    """

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            held = vars(self)
            if name == "state" and "kept" in held:
                return held.setdefault(name, held["kept"]())
            if name != "contacts" or "settled" not in held:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            log = contacts(list(held["settled"]))
            log.flags.writeable = False
            log = held.setdefault("contacts", log)  # another thread can have created it
            held["settled"] = ()
            return log

        def __getstate__(self) -> dict[str, Any]:
            return vars(self) | {"state": self.state, "kept": None}


def in_order(log: Rows) -> Rows:
    """Return contacts in order of onset.

    Simultaneous contacts are in order of their pairs.
    """
    if len(log) < 2:
        return log
    onset, pair = np.ascontiguousarray(log["t_begin"]), np.ascontiguousarray(log["pair"])
    if len(log) <= SMALL_RECORD_COUNT:
        return log.take(np.lexsort((pair, onset)))
    if not ((onset[1:] > onset[:-1]) | ((onset[1:] == onset[:-1]) & (pair[1:] > pair[:-1]))).all():
        order = np.argsort(onset, kind="stable")  # a stable sort is fast for nearly sorted onsets
        tied = (np.diff(onset[order]) == 0.0).any()
        log = raw(log)[np.lexsort((pair, onset)) if tied else order].view(CONTACT)
    return log


def given_by_walls(run: Any) -> Array:
    """Return the momentum (T, 2) in N s that both walls have given to the balls.

    `run` is a `Trajectory`, see its `account`. The momentum gained by the bodies up to a pair, without gravity and
    forces, is the sum of the momentum from the floor and the impulses through that pair. For pendula only the contact
    log is used.
    """
    scene, given = run.scene, np.zeros((len(run.time), 2))
    floor, ceiling = scene.is_wall[[0, -1]].tolist()
    if scene.pendulum > 0.0:
        for side in [0] * floor + [1] * ceiling:
            given[:, side] = (1.0 - 2.0 * side) * _passed(run, -side % scene.n_pairs)
        return given
    gained = np.where(scene.is_wall, 0.0, scene.mass) * (
        run.velocity - run.velocity[0] - scene.fall * (run.time - run.time[0])[:, None])
    below = np.cumsum(gained, axis=1)
    if not (floor and ceiling):
        given[:, int(ceiling)] = below[:, -1] * (floor or ceiling)
        return given
    hard = run.law is None  # impulses through stuck balls are not logged; none stick to a ceiling under gravity
    at = np.full(len(below), scene.n_pairs - 1) if hard else run.gap.argmax(axis=1)
    for c in np.unique(at).tolist():
        given[at == c, 0] = (below[:, c] + _passed(run, c))[at == c]
    if hard and (scene.gravity == 0.0 or scene.external_force is not None or scene.motions[1] is not None):
        size = np.abs(gained).sum(axis=1).max() + np.abs(given).max()
        met = run.contacts["t_begin"][run.contacts["pair"] == scene.n_pairs - 1].min(initial=np.inf)
        touched = (run.time >= met) | (run.gap[0, -1] <= 0.0)
        given[touched & (np.abs(given[:, 0] - _passed(run, 0)) > MOMENTUM_ROUNDING * size)] = np.nan
    given[:, 1] = below[:, -1] - given[:, 0]
    return given


def is_logged(run: Any) -> bool:
    """Return whether a run has its contacts in memory.

    Otherwise `stats` contains the path of the log file, or False.
    """
    return "log" not in run.stats


def _passed(run: Any, pair: int) -> Array:
    """Return the impulses (T,) in N s through a pair since the first row.

    The value is nan at rows within one of its contacts.
    """
    rows, time = run.contacts[run.contacts["pair"] == pair], run.time
    end = np.nan_to_num(rows["t_end"], nan=time[-1])  # open contacts count with their impulse so far
    sums = np.concatenate([[0.0], np.cumsum(rows["impulse"][np.argsort(end, kind="stable")])])
    over, begun = np.searchsorted(np.sort(end), time, "right"), np.searchsorted(np.sort(rows["t_begin"]), time)
    passed: Array = np.where((over >= begun) & is_logged(run), sums[over], np.nan)
    sped = np.abs((run.velocity[0] - run.scene.velocity)[~run.scene.is_wall]).max()
    if sped > MOMENTUM_ROUNDING * np.abs(run.velocity).max():  # otherwise the first row precedes all contacts
        passed -= passed[0]
    return passed


class Event(NamedTuple):
    """A finished contact with the state of the run right after it.

    It consists of a row of the log, the time in s and the scene.
    """

    contact: Any
    time: float
    scene: Scene


def one_by_one(run: Any) -> Iterator[Event]:
    """Yield every contact of a run when it ends, with the scene at that time.

    If it is passed as `on_event`, `drive` returns this generator.
    """
    more, still = True, run.scene
    while more:
        more = run.to(run.request.end, True).name == "full"
        for contact in contacts(run.rows()):
            time = run.progress()[0]
            row = run.row(time)
            elapsed = np.array([row.elapsed])
            x = positions(still, row.gap[None], elapsed, run.start)[0]
            v = row.velocity if row.rate is None else velocities(still, row.rate[None], elapsed, run.start)[0]
            v = np.where(still.is_wall, still.velocity, v)
            yield Event(contact, time, still.replace(gap=row.gap, velocity=v, origin=float(x[0])))


class LogFile:
    """File of contact rows that is appended to block by block.

    Parameters
    ----------
    path : path
        Name of a new file that ends in .npy.
    kind : dtype
        Type of the rows of an empty file. Otherwise the type of the first block is used.

    Raises
    ------
    ValueError
        If the name is invalid.
    FileExistsError
        If the file exists. No file is overwritten.
    """

    def __init__(self, path: str | os.PathLike[str], kind: np.dtype[Any]) -> None:
        from granular._engine.files import checked_path, is_stream

        self.path, self.kind, self.count = os.path.abspath(checked_path("log", path)), kind, 0
        if not self.path.lower().endswith(".npy"):
            raise ValueError(must("log", "True, False or the name of a file that ends in .npy", repr(os.fspath(path))))
        if is_stream(self.path) or os.path.lexists(self.path):
            raise FileExistsError(f"`log` must be a new file, got {os.fspath(path)!r}. Give another name, or remove "
                                  "the file.")

    def __enter__(self) -> LogFile:
        try:
            self.file = open(self.path, "xb", buffering=0)
            self._head()
        except OSError as error:
            raise type(error)(f"`log` must be writable, got {self.path!r} ({error.strerror}).") from None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self.file.close()

    def extend(self, blocks: Iterable[Rows]) -> None:
        """Append blocks of rows.

        Raises
        ------
        OSError
            If the device is full. Rows written before remain in the file.
        """
        for rows in blocks:
            if self.count == 0:
                self.kind = rows.dtype
                # the type of the rows can change the length of the header of the empty file
                self.file.truncate(self._head())
                self.file.seek(0, os.SEEK_END)
            data = memoryview(rows.astype(self.kind, copy=False).tobytes())
            try:
                while data.nbytes:
                    # an unbuffered write can be partial
                    data = data[self.file.write(data):]
                self.count += len(rows)
                self._head()
            except OSError as error:
                raise type(error)(f"The log {self.path!r} cannot grow ({error.strerror}), so the run ends here. The "
                                  f"first {self.count} contacts are in the file.") from None

    def _head(self) -> int:
        """Write the header again and return its length."""
        self.file.seek(0)
        head = {"descr": npy.dtype_to_descr(self.kind), "fortran_order": False, "shape": (self.count,)}
        npy.write_array_header_1_0(self.file, head)
        length = self.file.tell()
        self.file.seek(0, os.SEEK_END)
        return length


def mapped(path: str) -> Rows:
    """Return the rows of a log file as a memory map."""
    try:
        rows: Rows = np.load(path, mmap_mode="r")
    except ValueError as error:
        raise ValueError(f"`log` must be a log of contacts, got {path!r} ({error}).") from None
    if not {"pair", "t_begin"} <= set(rows.dtype.names or ()):
        raise ValueError(f"`log` must be a log of contacts, got {path!r}. Its columns pair and t_begin are missing.")
    return rows


def grouped(key: Any, n: int) -> tuple[Any, Any]:
    """Return the order of an array of keys, and the start of each key in that order.

    `key` contains integers 0 … n-1. The order is an array of positions in `key`.
    """
    order = np.argsort(key, kind="stable")
    return order, np.searchsorted(key[order], np.arange(n + 1))


def batches(rows: Rows, size: int) -> Iterator[Rows]:
    """Yield rows of the public log in batches of `size`."""
    for k in range(0, len(rows), size):
        yield contacts([np.array(rows[k : k + size])])
