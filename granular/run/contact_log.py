"""Contact log: public columns, internal columns of the engines, and the log file.

The module also computes the momentum that walls transfer to the balls.

A log file is a plain ``.npy`` file that is complete after every block. Its header (format 1.0 of numpy) contains the
number of rows with space for more digits, and is rewritten after each block. If the process is killed, all counted rows
are therefore in the file, and `numpy.load` can read or memory-map it. (HDF5 offers the same in its single-writer mode,
but then a file must be repaired before it can be extended.)
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy

from granular._engine.check import Array, must
from granular._engine.records import SMALL_RECORD_COUNT, as_bytes
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

`t_begin` and `t_end` are onset and end in s. For hard spheres they are equal. `duration` in s is accumulated from the
onset, so it does not lose digits at late times. `v_in` and `v_out` are the velocities of the lower and the upper body
in m/s before and after the contact. `xi_max` is the largest overlap in m, and `impulse` is in N s. `force_max` is the
largest force in N. It is nan for hard spheres, where it is infinite. For a contact that has not ended at the end of the
run, `t_end` and `v_out` are nan, and duration, maxima and impulse are the values so far.
"""

Rows = np.ndarray[tuple[int], np.dtype[np.void]]
"""Type of contacts in a structured array, with columns of an engine or of the log."""
SIDE_COLUMNS = {"lower_in": ("v_in", 0), "upper_in": ("v_in", 1), "lower_out": ("v_out", 0), "upper_out": ("v_out", 1)}
"""Public column and index of the engine columns with the velocity of one body."""
SOFT_FIELDS = [(name, float) for name in (*SIDE_COLUMNS, "xi_max", "force_max", "impulse")]
"""Columns that a soft-sphere contact has in addition to its pair and times.

They are the velocities of the lower and the upper body at onset and end in m/s. The largest overlap in m, the largest
force in N and the impulse in N s follow.
"""
CONTACT_ROW = np.dtype(
    [("pair", int), ("t_begin", float), ("t_end", float), ("duration", float), *SOFT_FIELDS], align=True)
"""Record of a soft-sphere contact in the engines.

Times are in s. Values that are not known before the end of the contact are nan.
"""
MOMENTUM_ROUNDING = 1e-9
"""Largest rounding error, relative to the largest momentum or velocity of a run."""
COPY_ROWS = 2048
"""Number of contacts that are copied at a time, column by column.

They fit into the cache of the processor.
"""


def contacts(settled: list[Rows]) -> Rows:
    """Convert blocks of contacts with the columns of an engine to the public log.

    Contacts in blocks without a column `t_end` are instantaneous. The list `settled` is emptied, so that converted
    blocks release their memory.
    """
    log = np.zeros(sum(map(len, settled)), CONTACT)
    stop = 0
    while settled:
        block = settled.pop(0)
        for k in range(0, len(block), COPY_ROWS):
            rows = block[k : k + COPY_ROWS]
            target, stop = log[stop : stop + len(rows)], stop + len(rows)
            if rows.dtype in (CONTACT, CONTACT_ROW):  # the same bytes
                as_bytes(target)[:] = as_bytes(rows)
                continue
            names = rows.dtype.names or ()
            if "t_end" not in names:
                target["t_end"], target["force_max"] = rows["t_begin"], np.nan
            for name in names:
                column, side = SIDE_COLUMNS.get(name, (name, slice(None)))
                target[column].T[side] = rows[name].T
    return log


class LazyContacts:
    """Base of classes that create attributes `contacts` and `state` on first access.

    `contacts` is created from the attribute `settled`, which contains the rows in the columns of the engine. `state` is
    created by the function in the attribute `kept`, if there is one.
    """

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            values = vars(self)
            if name == "state" and "kept" in values:
                return values.setdefault(name, values["kept"]())
            if name != "contacts" or "settled" not in values:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            log = contacts(list(values["settled"]))
            log.flags.writeable = False
            log = values.setdefault("contacts", log)  # another thread can have created it
            values["settled"] = ()
            return log

        def __getstate__(self) -> dict[str, Any]:
            # stored results of comparisons begin with "_"; some are functions, which cannot be pickled
            stored = {name: value for name, value in vars(self).items() if not name.startswith("_")}
            return stored | {"state": self.state, "kept": None, "again": None}


def in_order(log: Rows) -> Rows:
    """Return contacts in the order of their onsets, simultaneous contacts by pair."""
    if len(log) < 2:
        return log
    onset, pair = np.ascontiguousarray(log["t_begin"]), np.ascontiguousarray(log["pair"])
    if len(log) <= SMALL_RECORD_COUNT:
        return log.take(np.lexsort((pair, onset)))
    if not ((onset[1:] > onset[:-1]) | ((onset[1:] == onset[:-1]) & (pair[1:] > pair[:-1]))).all():
        order = np.argsort(onset, kind="stable")  # a stable sort is fast for nearly sorted onsets
        has_ties = (np.diff(onset[order]) == 0.0).any()
        log = as_bytes(log)[np.lexsort((pair, onset)) if has_ties else order].view(CONTACT)
    return log


def wall_momentum(run: Any) -> Array:
    """Return the momentum in N s transferred by both walls to the balls, shape (T, 2).

    `run` is a `Trajectory`, see its method `account`. The floor and the impulses through a pair change the momentum of
    the bodies below the pair, in addition to gravity and external forces. This gives the momentum from the floor. For
    pendula only the contact log is used.
    """
    scene, momentum = run.scene, np.zeros((len(run.time), 2))
    floor, ceiling = scene.is_wall[[0, -1]].tolist()
    if scene.pendulum > 0.0:
        for side in [0] * floor + [1] * ceiling:
            momentum[:, side] = (1.0 - 2.0 * side) * _impulse_through(run, -side % scene.n_pairs)
        return momentum
    momentum_change = np.where(scene.is_wall, 0.0, scene.mass) * (
        run.velocity - run.velocity[0] - scene.fall * (run.time - run.time[0])[:, None])
    cumulative = np.cumsum(momentum_change, axis=1)
    if not (floor and ceiling):
        momentum[:, int(ceiling)] = cumulative[:, -1] * (floor or ceiling)
        return momentum
    hard = run.law is None  # impulses through stuck balls are not logged; none stick to a ceiling under gravity
    pair_at = np.full(len(cumulative), scene.n_pairs - 1) if hard else run.gap.argmax(axis=1)
    for c in np.unique(pair_at).tolist():
        momentum[pair_at == c, 0] = (cumulative[:, c] + _impulse_through(run, c))[pair_at == c]
    if hard and (scene.gravity == 0.0 or scene.external_force is not None or scene.motions[1] is not None):
        scale = np.abs(momentum_change).sum(axis=1).max() + np.abs(momentum).max()
        first_contact = run.contacts["t_begin"][run.contacts["pair"] == scene.n_pairs - 1].min(initial=np.inf)
        has_touched = (run.time >= first_contact) | (run.gap[0, -1] <= 0.0)
        momentum[has_touched & (np.abs(momentum[:, 0] - _impulse_through(run, 0)) > MOMENTUM_ROUNDING * scale)] = np.nan
    momentum[:, 1] = cumulative[:, -1] - momentum[:, 0]
    return momentum


def is_logged(run: Any) -> bool:
    """Return whether the contact log of a run is in memory.

    Otherwise its entry "log" in `stats` is the path of the log file, or False.
    """
    return "log" not in run.stats


def _impulse_through(run: Any, pair: int) -> Array:
    """Return the summed impulses in N s of a pair since the first sample.

    The shape is (T,). The value is nan at samples during a contact of the pair, and without a log.
    """
    rows, time = run.contacts[run.contacts["pair"] == pair], run.time
    end = np.nan_to_num(rows["t_end"], nan=time[-1])  # unfinished contacts count with their impulse so far
    sums = np.concatenate([[0.0], np.cumsum(rows["impulse"][np.argsort(end, kind="stable")])])
    ended, started = np.searchsorted(np.sort(end), time, "right"), np.searchsorted(np.sort(rows["t_begin"]), time)
    passed: Array = np.where((ended >= started) & is_logged(run), sums[ended], np.nan)
    change = np.abs((run.velocity[0] - run.scene.velocity)[~run.scene.is_wall]).max()
    if change > MOMENTUM_ROUNDING * np.abs(run.velocity).max():  # else the first sample precedes all contacts
        passed -= passed[0]
    return passed


class Event(NamedTuple):
    """Finished contact with the state of the run right after it.

    The fields are a row of the log, the time in s, and the scene at that time.
    """

    contact: Any
    time: float
    scene: Scene


def yield_contacts(run: Any) -> Iterator[Event]:
    """Yield the contacts of a run as they end, each with the scene at that time.

    If this function is passed as `on_event`, `granular.run.drive.drive` returns its generator.
    """
    continues, initial = True, run.scene
    while continues:
        continues = run.to(run.request.end, True).name == "full"
        for contact in contacts(run.rows()):
            time = run.progress()[0]
            row = run.row(time)
            elapsed = np.array([row.elapsed])
            x = positions(initial, row.gap[None], elapsed, run.start)[0]
            v = row.velocity if row.rate is None else velocities(initial, row.rate[None], elapsed, run.start)[0]
            v = np.where(initial.is_wall, initial.velocity, v)
            yield Event(contact, time, initial.replace(gap=row.gap, velocity=v, origin=float(x[0])))


class LogFile:
    """Log file to which rows of contacts are appended block by block.

    Parameters
    ----------
    path : path
        Name of a new file that ends in .npy.
    dtype : dtype
        Type of the rows of an empty file. Otherwise the type of the first block is used.

    Raises
    ------
    ValueError
        If the name is invalid.
    FileExistsError
        If the file exists. Files are never overwritten.
    """

    def __init__(self, path: str | os.PathLike[str], dtype: np.dtype[Any]) -> None:
        from granular._engine.files import checked_path, is_stream

        self.path, self.dtype, self.count = os.path.abspath(checked_path("log", path)), dtype, 0
        if not self.path.lower().endswith(".npy"):
            raise ValueError(must("log", "True, False or the name of a file that ends in .npy", repr(os.fspath(path))))
        if is_stream(self.path) or os.path.lexists(self.path):
            raise FileExistsError(f"`log` must be a new file, got {os.fspath(path)!r}. Give another name, or remove "
                                  "the file.")

    def __enter__(self) -> LogFile:
        try:
            self.file = open(self.path, "xb", buffering=0)
            self._write_header()
        except OSError as error:
            raise type(error)(f"`log` must be writable, got {self.path!r} ({error.strerror}).") from None
        return self

    def __exit__(self, error_type: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self.file.close()

    def extend(self, blocks: Iterable[Rows]) -> None:
        """Append blocks of rows to the file.

        Raises
        ------
        OSError
            If the device is full. Rows written before remain in the file.
        """
        for rows in blocks:
            if self.count == 0:
                self.dtype = rows.dtype
                # the type of the rows can change the length of the header of the empty file
                self.file.truncate(self._write_header())
                self.file.seek(0, os.SEEK_END)
            data = memoryview(rows.astype(self.dtype, copy=False).tobytes())
            try:
                while data.nbytes:
                    # an unbuffered write can be partial
                    data = data[self.file.write(data):]
                self.count += len(rows)
                self._write_header()
            except OSError as error:
                raise type(error)(f"The log {self.path!r} cannot grow ({error.strerror}), so the run ends here. The "
                                  f"first {self.count} contacts are in the file.") from None

    def _write_header(self) -> int:
        """Write the header with the current number of rows, and return its length."""
        self.file.seek(0)
        header = {"descr": npy.dtype_to_descr(self.dtype), "fortran_order": False, "shape": (self.count,)}
        npy.write_array_header_1_0(self.file, header)
        length = self.file.tell()
        self.file.seek(0, os.SEEK_END)
        return length


def open_log_file(path: str) -> Rows:
    """Return the rows of a log file as a memory-mapped array.

    Raises `ValueError` if the file is not a contact log.
    """
    from granular._engine.files import checked_source

    try:
        rows: Rows = npy.open_memmap(checked_source("log", path), mode="r")
    except ValueError as error:
        raise ValueError(f"`log` must be a contact log, got {path!r} ({error}).") from None
    if not {"pair", "t_begin"} <= set(rows.dtype.names or ()):
        raise ValueError(f"`log` must be a contact log, got {path!r}. Its columns pair and t_begin are missing.")
    return rows


def group_by_key(key: Any, n: int) -> tuple[Any, Any]:
    """Return the indices that sort an array of keys, and the start of each key.

    `key` contains integers 0 … n-1. The second array has n + 1 entries.
    """
    order = np.argsort(key, kind="stable")
    return order, np.searchsorted(key[order], np.arange(n + 1))


def batches(rows: Rows, size: int) -> Iterator[Rows]:
    """Yield rows, converted to the columns of the public log, in batches of `size`."""
    for k in range(0, len(rows), size):
        yield contacts([np.array(rows[k : k + size])])
