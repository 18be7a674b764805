"""The log of contacts: its columns, in public and as engines keep them; what it says of the momentum that walls gave;
its file, written as the run goes on.

The file is a plain ``.npy``, whole after every block: its head says how many rows there are, in digits with room to
grow (format 1.0 of numpy), and is written again after each block. So whatever ends the process, what the head counts is
there, and `numpy.load` reads it, mapped into memory if one likes. (HDF5 would do that too in its mode for one writer,
but cannot be opened to go on after a kill without a repair.)
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy

from granular._engine.check import Array
from granular._engine.records import FEW, raw
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
"""One row per contact, sorted by `t_begin`. SI units: pair number; onset and end in s (equal in EDMD); duration in s,
accumulated from the onset so that late times cost no digits; velocities of the lower and the upper body in m/s before
and after; largest overlap in m; largest force in N (nan in EDMD, where it is infinite); impulse in N s. A contact still
open when the run ends has `t_end` and `v_out` nan, and its duration, peaks and impulse so far."""

Rows = np.ndarray[tuple[int], np.dtype[np.void]]
"""Records with names: contacts as an engine keeps them, or as the public log shows them."""
SIDES = {"lower_in": ("v_in", 0), "upper_in": ("v_in", 1), "lower_out": ("v_out", 0), "upper_out": ("v_out", 1)}
"""Columns of an engine that are one of two in the public log."""
COLUMNS = [(name, float) for name in (*SIDES, "xi_max", "force_max", "impulse")]
"""Of soft spheres: velocities of the lower and the upper body at onset and end in m/s, peaks in m and N, impulse in
N s."""
CONTACT_ROW = np.dtype([("pair", int), ("t_begin", float), ("t_end", float), ("duration", float), *COLUMNS], align=True)
"""A contact as soft spheres keep it; times in s, nan for what is still to come."""
ROUNDING = 1e-9
"""Part of the largest momentum or velocity by which rounding may be off."""
PART = 2048
"""Contacts written at a time, column by column: so many stay near the processor."""


def contacts(settled: list[Rows]) -> Rows:
    """Return contacts, with the columns that an engine keeps, as the public log.

    What has no end of its own is an instant, of infinite force. `settled` is used up: what is written needs no memory.
    """
    log = np.zeros(sum(map(len, settled)), CONTACT)
    stop = 0
    while settled:
        some = settled.pop(0)
        for k in range(0, len(some), PART):
            rows = some[k : k + PART]
            part, stop = log[stop : stop + len(rows)], stop + len(rows)
            if rows.dtype in (CONTACT, CONTACT_ROW):  # the same bytes
                raw(part)[:] = raw(rows)
                continue
            names = rows.dtype.names or ()
            if "t_end" not in names:
                part["t_end"], part["force_max"] = rows["t_begin"], np.nan
            for name in names:
                column, side = SIDES.get(name, (name, slice(None)))
                part[column].T[side] = rows[name].T
    return log


class PublicWhenRead:
    """What has an attribute `contacts`, the public log; made of rows that an engine has `settled` once it is read. So
    is its `state`, if it has what makes it, as `kept`."""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            held = vars(self)
            if name == "state" and "kept" in held:
                return held.setdefault(name, held["kept"]())
            if name != "contacts" or "settled" not in held:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            log = contacts(list(held["settled"]))
            log.flags.writeable = False
            log = held.setdefault("contacts", log)  # another thread may have been first
            held["settled"] = ()
            return log

        def __getstate__(self) -> dict[str, Any]:
            return vars(self) | {"state": self.state, "kept": None}


def in_order(log: Rows) -> Rows:
    """Return contacts in the order of their onset, of several in one instant in that of their pairs."""
    if len(log) < 2:
        return log
    onset, pair = np.ascontiguousarray(log["t_begin"]), np.ascontiguousarray(log["pair"])
    if len(log) <= FEW:
        return log.take(np.lexsort((pair, onset)))
    if not ((onset[1:] > onset[:-1]) | ((onset[1:] == onset[:-1]) & (pair[1:] > pair[:-1]))).all():
        order = np.argsort(onset, kind="stable")  # they nearly are, which this sort makes use of
        tied = (np.diff(onset[order]) == 0.0).any()
        log = raw(log)[np.lexsort((pair, onset)) if tied else order].view(CONTACT)
    return log


def given_by_walls(run: Any) -> Array:
    """Return the momentum (T, 2) in N s that both walls have given the balls of a `Trajectory`; see its `account`.

    What bodies up to a pair have gained, less the momentum of gravity and forces, is what the floor gave and what has
    passed that pair. Pendula have it by the log alone.
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
    hard = run.law is None  # the log lacks what passes hard balls that stick: with gravity none does to a ceiling
    at = np.full(len(below), scene.n_pairs - 1) if hard else run.gap.argmax(axis=1)
    for c in np.unique(at).tolist():
        given[at == c, 0] = (below[:, c] + _passed(run, c))[at == c]
    if hard and (scene.gravity == 0.0 or scene.external_force is not None or scene.motions[1] is not None):
        size = np.abs(gained).sum(axis=1).max() + np.abs(given).max()
        met = run.contacts["t_begin"][run.contacts["pair"] == scene.n_pairs - 1].min(initial=np.inf)
        touched = (run.time >= met) | (run.gap[0, -1] <= 0.0)
        given[touched & (np.abs(given[:, 0] - _passed(run, 0)) > ROUNDING * size)] = np.nan
    given[:, 1] = below[:, -1] - given[:, 0]
    return given


def is_logged(run: Any) -> bool:
    """Return whether a run has kept its contacts in memory: of others `stats` has the path of the file, or False."""
    return "log" not in run.stats


def _passed(run: Any, pair: int) -> Array:
    """Return the impulses (T,) in N s of the contacts of a pair since the first row; nan within one of them."""
    rows, time = run.contacts[run.contacts["pair"] == pair], run.time
    end = np.nan_to_num(rows["t_end"], nan=time[-1])  # of those still going on the impulse so far
    sums = np.concatenate([[0.0], np.cumsum(rows["impulse"][np.argsort(end, kind="stable")])])
    over, begun = np.searchsorted(np.sort(end), time, "right"), np.searchsorted(np.sort(rows["t_begin"]), time)
    passed: Array = np.where((over >= begun) & is_logged(run), sums[over], np.nan)
    sped = np.abs((run.velocity[0] - run.scene.velocity)[~run.scene.is_wall]).max()
    if sped > ROUNDING * np.abs(run.velocity).max():  # else the first row shows what was before any contact
        passed -= passed[0]
    return passed


class Event(NamedTuple):
    """A contact that is over, its row of the log, and right after it the time in s and the scene."""

    contact: Any
    time: float
    scene: Scene


def one_by_one(run: Any) -> Iterator[Event]:
    """Yield every contact of a run once it is over, with the scene then; in place of `on_event`, `drive` returns it."""
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
    """Rows of one kind, appended block by block.

    Parameters
    ----------
    path : path
        A name that ends in .npy, of a file that is not there yet.
    kind : dtype
        Of a row where none comes; else the first block says it.

    Raises
    ------
    ValueError, FileExistsError
        If the name is none, or the file is there: nothing is written over.
    """

    def __init__(self, path: str | os.PathLike[str], kind: np.dtype[Any]) -> None:
        from granular._engine.files import checked_path, is_stream

        self.path, self.kind, self.count = os.path.abspath(checked_path("log", path)), kind, 0
        if not self.path.lower().endswith(".npy"):
            raise ValueError(f"log is {os.fspath(path)!r}: True, False or the name of a file that ends in .npy is "
                             "needed.")
        if is_stream(self.path) or os.path.lexists(self.path):
            raise FileExistsError(f"log is {os.fspath(path)!r}: it is there already; give another name, or remove it.")

    def __enter__(self) -> LogFile:
        try:
            self.file = open(self.path, "xb", buffering=0)
            self._head()
        except OSError as error:
            raise type(error)(f"log is {self.path!r}: a writable place is needed ({error.strerror}).") from None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        self.file.close()

    def extend(self, blocks: Iterable[Rows]) -> None:
        """Append blocks of rows, as to a list.

        Raises
        ------
        OSError
            If there is no more room: what the file had before stays in it.
        """
        for rows in blocks:
            if self.count == 0:
                self.kind = rows.dtype
                self.file.truncate(self._head())
                self.file.seek(0, os.SEEK_END)
            data = memoryview(rows.astype(self.kind, copy=False).tobytes())
            try:
                while data.nbytes:
                    data = data[self.file.write(data):]
                self.count += len(rows)
                self._head()
            except OSError as error:
                raise type(error)(f"log is {self.path!r}: it cannot grow ({error.strerror}); the run ends here, the "
                                  f"first {self.count} contacts are in the file.") from None

    def _head(self) -> int:
        """Write the head anew; return its length."""
        self.file.seek(0)
        head = {"descr": npy.dtype_to_descr(self.kind), "fortran_order": False, "shape": (self.count,)}
        npy.write_array_header_1_0(self.file, head)
        length = self.file.tell()
        self.file.seek(0, os.SEEK_END)
        return length


def mapped(path: str) -> Rows:
    """Return the rows of a file, which are read where they are looked at."""
    try:
        rows: Rows = np.load(path, mmap_mode="r")
    except ValueError as error:
        raise ValueError(f"log is {path!r}: that is no log of contacts ({error}).") from None
    if not {"pair", "t_begin"} <= set(rows.dtype.names or ()):
        raise ValueError(f"log is {path!r}: that is no log of contacts; its numbers have no names pair and t_begin.")
    return rows


def grouped(key: Any, n: int) -> tuple[Any, Any]:
    """Positions in the array `key` of whole numbers, ordered by key, and where in that each key 0 … n-1 begins."""
    order = np.argsort(key, kind="stable")
    return order, np.searchsorted(key[order], np.arange(n + 1))


def batches(rows: Rows, size: int) -> Iterator[Rows]:
    """Return rows as in the public log, so many at a time."""
    for k in range(0, len(rows), size):
        yield contacts([np.array(rows[k : k + size])])
