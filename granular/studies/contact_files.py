"""Contact lists from snapshots, from files of LAMMPS, and from CSV files."""

from __future__ import annotations

import gzip
import math
import warnings
import zlib
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular._engine.check import Array, must
from granular._engine.files import checked_source, plain_text
from granular.studies.contact_lists import Ints

TRACKER_COLUMNS, PAIR_COLUMNS = "id1 id2 created broken r_min", "id1 id2 distance force"
"""Default columns of both kinds of LAMMPS files."""
LIST_COLUMNS, SNAPSHOT_COLUMNS = "i j begin end impulse overlap distance", "time i j force overlap distance"
"""Columns of both kinds of CSV files."""
WALLS_NOTE = "Contacts with walls are not in the file."
TWICE_NOTE = "Contacts across a boundary are listed twice and counted once."
ENDED_NOTE = ("Contacts that had not ended are missing in the file. In a heap at rest these are almost all contacts. "
              "Compare Z with its value from a dump of pair/local.")
SPACING_NOTE = ("Snapshots too far apart: on average, a contact is seen in {:.3g} of them. Only Z, B and the shared "
                "impulse are right.")
FORMAT_FIX = "Use `dump_modify ID format float %.15g`, and name the columns in their order."
LARGEST_PARTICLE = 2.0**30
"""Limit of the particle numbers. The product of two must fit into 64 bits."""
LEAST_SIGHTINGS = 2.0
"""Minimum mean number of snapshots per contact that resolves durations."""
LEAST_ROWS_TO_JUDGE = 20
"""Minimum number of contacts of a snapshot for a test of lost contacts."""


@signature.face
def snapshots(time: ArrayLike, i: ArrayLike, j: ArrayLike, *, force: ArrayLike | None = None,
              overlap: ArrayLike | None = None, distance: ArrayLike | None = None, frames: ArrayLike | None = None
              ) -> dict[str, Any]:
    """Combine the contacts of several snapshots into contacts with begin and end.

    A pair that touches in consecutive snapshots has one contact. Its begin and end are midpoints between snapshots. The
    impulse is the sum of force times the time that a snapshot represents. Z, overlap and shared impulse are right on
    average for any time between snapshots. Durations and disturbed contacts require snapshots closer than half a
    contact duration.

    Parameters
    ----------
    time : (n,) array
        Time in s of the snapshot of each row, not decreasing.
    i, j : (n,) array of int
        Numbers of the two particles.
    force, overlap : (n,) array, optional
        Force in N and overlap in m at the time of the snapshot.
    distance : float or (n,) array, optional
        R₁ + R₂ in m.
    frames : array, optional
        Times in s of all snapshots, including snapshots without a contact. Defaults to the times in `time`.

    Returns
    -------
    dict
        Arguments of `granular.contacts.analyse`. The largest overlap of a contact is π/2 times its mean overlap, as for
        a half sine.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or if a pair occurs twice in a snapshot.

    Examples
    --------
    >>> import granular as gr
    >>> seen = gr.contacts.snapshots([0.0, 0.0, 1.0, 3.0], [1, 2, 1, 1], [2, 3, 2, 2], frames=[0.0, 1.0, 2.0, 3.0])
    >>> seen["begin"].tolist(), seen["end"].tolist()
    ([-0.5, 2.5, -0.5], [1.5, 3.5, 0.5])
    """
    clock = check.array("time", time, finite="a finite time")
    check.every("time", clock, np.diff(clock, prepend=clock[:1]) >= 0.0, "not before the time of the row above")
    every = check.increasing_array("frames", np.unique(clock) if frames is None else frames, "a finite time")
    frame, edge = np.searchsorted(every, clock), 0.5 * (every[1:] + every[:-1])
    check.every("time", clock, every[np.minimum(frame, len(every) - 1)] == clock, "one of `frames`")
    edge = np.concatenate([[2.0 * every[0] - edge[0]], edge, [2.0 * every[-1] - edge[-1]]])
    low, high = np.sort(particles(i, j, clock.shape), axis=0)
    order = np.lexsort((frame, high, low))
    later = np.where((np.diff(low[order]) == 0) & (np.diff(high[order]) == 0), np.diff(frame[order]), -1)
    if (later == 0).any():
        raise ValueError("A pair must occur at most once in a snapshot, got a pair twice. List each contact once.")
    start = np.flatnonzero(np.concatenate([[1] * min(len(clock), 1), later != 1]))
    row, n_seen = order[start], np.diff(start, append=len(clock))
    found = {"i": low[row], "j": high[row], "begin": edge[frame[row]], "end": edge[frame[row] + n_seen],
             "span": (edge[0], edge[-1]), "notes": ()}
    if force is not None:
        impulses = check.array("force", force, clock.shape) * np.diff(edge)[frame]
        check.every("force", impulses, impulses >= 0.0, "a finite number of at least 0")
        found["impulse"] = np.add.reduceat(impulses[order], start)
    if overlap is not None:
        depth = check.array("overlap", overlap, clock.shape)
        check.every("overlap", depth, depth >= 0.0, "a number in m of at least 0")
        found["overlap"] = 0.5 * math.pi * np.add.reduceat(depth[order], start) / n_seen
    if distance is not None:
        lengths = np.full(clock.shape, distance) if check.is_single(distance) else distance
        found["distance"] = check.array("distance", lengths, clock.shape)[row]
    if len(row) and len(clock) < LEAST_SIGHTINGS * len(row):
        found["notes"] = (SPACING_NOTE.format(len(clock) / len(row)),)
    return found


def particles(i: ArrayLike, j: ArrayLike, shape: tuple[int, ...]) -> Ints:
    """Return the particles of each contact, shape (2, n)."""
    given = check.array("i", i, shape), check.array("j", j, shape)
    for name, ids in zip("ij", given, strict=True):
        check.every(name, ids, (np.abs(ids) < LARGEST_PARTICLE) & (ids % 1.0 == 0.0), "the number of a particle")
    check.every("j", given[1], given[0] != given[1], "another particle than in `i`")
    return np.array(given).astype(np.int64)


@signature.face
def read_lammps(path: Any, time_step: float, *, diameter: ArrayLike | None = None, columns: str | None = None
                ) -> dict[str, Any]:
    """Read contacts from a ``dump local`` of LAMMPS, which can be compressed (.gz).

    Parameters
    ----------
    path : path
        Output of ``pair_style tracker``, or of ``compute property/local`` and ``compute pair/local``.
    time_step : float
        Time step in s. LAMMPS writes times as numbers of steps.
    diameter : float or array, optional
        Diameter in m of all particles, or one per particle from number 1 on. Overlaps are only computed if it is given.
    columns : str, optional
        Names of all columns. Defaults to "id1 id2 created broken r_min" (tracker) and "id1 id2 distance force" (pairs).
        Columns with other names are ignored.

    Returns
    -------
    dict
        Arguments of `granular.contacts.analyse`. Its "notes" state which contacts are missing in the file.

    Raises
    ------
    OSError, TypeError, ValueError
        If the file cannot be read, is of another kind, contains no contacts, or has numbers that cannot be particles or
        steps.
    """
    step, name = check.number("time_step", time_step, above=0.0), checked_source("path", path)
    check.of_kind("columns", columns, (str, type(None)), "the names of all columns in one text")
    with (gzip.open if name.endswith(".gz") else open)(name, "rt", encoding="utf-8", errors="replace") as file:
        try:
            blocks = list(_frames(file, plain_text(name), columns))
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(must("path", "a complete file", f"{name!r}, which " + (
                "ends too early" if isinstance(error, EOFError) else f"is damaged ({error})"))) from None
    if not sum(len(block) for _, block in blocks):
        raise ValueError(must("path", "a dump local of LAMMPS with contacts", f"{name!r} without any"))
    steps, rows = np.array([at for at, _ in blocks]), np.concatenate([block for _, block in blocks])
    check.every("TIMESTEP", steps, np.diff(steps, prepend=-1) > 0, "larger than the entry before it")
    frame = np.repeat(np.arange(len(blocks)), [len(block) for _, block in blocks])
    ids, length = np.array([rows["id1"], rows["id2"]]), None
    if ids.min() < 1:
        raise ValueError(must(f"every particle in {name!r}", "a number from 1 on", f"{ids.min()}", FORMAT_FIX))
    if diameter is not None:
        sizes = check.positive("diameter", np.atleast_1d(diameter), "diameter")
        if 1 < len(sizes) < ids.max():
            raise ValueError(must("diameter", f"one number or {ids.max()} numbers", f"{len(sizes)}"))
        length = 0.5 * sizes[(ids - 1) % len(sizes)].sum(axis=0)
    return (_tracked if "created" in (rows.dtype.names or ()) else _pairs)(rows, frame, steps, step, length)


def _frames(file: IO[str], name: str, columns: str | None) -> Iterator[tuple[int, Any]]:
    """Yield step and rows of each snapshot of a dump."""
    step, count, label = -1, 0, "ENTRIES"
    for line in file:
        if line.startswith(("ITEM: TIMESTEP", "ITEM: NUMBER OF ")):
            word = plain_text(next(file, "").strip())
            if not word.isdecimal():
                raise ValueError(must(f"the line after {line.strip()} in {name!r}", "an integer", repr(word)))
            step, count = (int(word), 0) if "TIMESTEP" in line else (step, int(word))
            label = label if "TIMESTEP" in line else line.split()[-1]  # ENTRIES, or the label of dump_modify
        elif line.startswith(("ITEM: UNITS", "ITEM: TIME")):  # written by dump_modify units, time; not needed
            next(file, "")
        elif line.startswith(f"ITEM: {label} ") and step >= 0 and label != "ATOMS":
            dtype = _row_type(line.removeprefix(f"ITEM: {label}").split(), columns)
            try:
                with warnings.catch_warnings():  # numpy 1 only warns of an integer with an exponent
                    warnings.simplefilter("error", DeprecationWarning)
                    warnings.simplefilter("ignore", UserWarning)  # numpy warns of a file that ends before the rows
                    whole = (row for row in islice(file, count) if row.endswith("\n"))  # the last row can be cut off
                    rows = np.loadtxt(whole, dtype, ndmin=1) if count else np.empty(0, dtype)
            except (ValueError, DeprecationWarning) as error:
                raise ValueError(f"Particles and steps in {name!r} must be integers with all digits ({error}). "
                                 f"{FORMAT_FIX}") from None
            if len(rows) < count:
                raise ValueError(must("path", "a complete file", f"{name!r}, which ends within a snapshot"))
            yield step, rows
        elif step < 0 or line.startswith("ITEM: ATOMS"):
            raise ValueError(must("path", "a dump local of LAMMPS", f"{name!r}, which is of another kind"))


def _row_type(header: list[str], columns: str | None) -> np.dtype[Any]:
    """Return the type of a row from the names of the columns."""
    usual = PAIR_COLUMNS if header[:1] and header[0].startswith("c_") else TRACKER_COLUMNS
    names = columns.split() if columns is not None else header if {"id1", "id2"} <= {*header} else usual.split()
    needed = TRACKER_COLUMNS.split()[: 4 if {"created", "broken"} & {*names} else 2]
    if len(names) != len(header) or len({*names}) < len(names) or not {*needed} <= {*names}:
        raise ValueError(must("columns", f"{len(header)} different names with {', '.join(needed)}", f"{names}",
                              f"The file has the columns {plain_text(' '.join(header))}."))
    return np.dtype([(name, np.int64 if name in TRACKER_COLUMNS.split()[:4] else np.float64) for name in names])


def _tracked(rows: Any, frame: Any, steps: Any, step: float, length: Array | None) -> dict[str, Any]:
    """Return the arguments of `analyse` for the rows of a tracker."""
    created, broken = rows["created"], rows["broken"]
    if not ((created <= broken) & (broken <= steps[frame])).all() or (created == broken).all():
        raise ValueError(must("columns created and broken", "steps at which contacts began and ended, at most TIMESTEP",
                              "others", FORMAT_FIX))
    there, start, count = np.unique(frame, return_index=True, return_counts=True)
    before = steps[np.maximum(there - 1, 0)]
    # without a loss, some contacts end soon after the previous snapshot
    silent = np.minimum.reduceat(broken, start) - before > 0.25 * (steps[there] - before)
    if (silent & (there > 0) & (count >= LEAST_ROWS_TO_JUDGE)).any():
        raise ValueError("Tracker and dump must have the same interval N, got no contact that ended in the first part "
                         "of an interval of the dump.")
    low, high = np.sort([rows["id1"], rows["id2"]], axis=0)
    order = np.lexsort((broken, created, high, low))
    again = np.all([np.diff(values[order]) == 0 for values in (low, high, created, broken)], axis=0)
    kept = np.sort(order[np.append(True, ~again)])
    found: dict[str, Any] = {
        "i": low[kept], "j": high[kept], "begin": created[kept] * step, "end": broken[kept] * step,
        "span": ((created.min() if there[0] == 0 else steps[0]) * step, steps[-1] * step),
        "notes": (ENDED_NOTE, WALLS_NOTE, *[TWICE_NOTE] * bool(again.any()))}
    if length is not None and "r_min" in rows.dtype.names:
        check.every("r_min", rows["r_min"], rows["r_min"] <= length, "at most R₁ + R₂", "Check `diameter`.")
        found |= {"overlap": (length - rows["r_min"])[kept], "distance": length[kept]}
    return found


def _pairs(rows: Any, frame: Any, steps: Any, step: float, length: Array | None) -> dict[str, Any]:
    """Return the arguments of `analyse` for rows of pairs.

    Pairs that do not touch are ignored.
    """
    names = rows.dtype.names
    force = rows["force"] if "force" in names else np.ones(len(rows))
    if "distance" in names:
        check.every("distance", rows["distance"], rows["distance"] >= 0.0, "a number in m of at least 0")
    gap = rows["distance"] - length if length is not None and "distance" in names else np.full(len(rows), -1.0)
    kept = (force != 0.0) & (gap < 0.0)
    found = snapshots(
        (steps * step)[frame][kept], rows["id1"][kept], rows["id2"][kept], force=np.maximum(force[kept], 0.0),
        overlap=-gap[kept], distance=None if length is None else length[kept], frames=steps * step)
    return found | {"notes": (*found["notes"], WALLS_NOTE)}


@signature.face
def read_csv(path: Any, columns: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Read contacts or snapshots from a CSV file with named columns.

    Parameters
    ----------
    path : path
        File with the names of the columns in its first line: i, j, begin, end, and optionally impulse, overlap and
        distance, as in `granular.contacts.analyse`. An empty end means that the contact lasts until the end of the run.
        A file with a column time contains snapshots, with the columns of `granular.contacts.snapshots`: time, i, j, and
        optionally force, overlap and distance. Other columns are ignored. Snapshots without a contact do not appear in
        such a file. If there are any, use `granular.contacts.snapshots` with `frames`, otherwise Z is too large.
    columns : mapping of str to str, optional
        Name of the column in the file for each parameter, such as {"i": "particle 1"}. Defaults to the names above.

    Returns
    -------
    dict
        Arguments of `granular.contacts.analyse`.

    Raises
    ------
    OSError, TypeError, ValueError
        If the file cannot be read, a column is missing, an entry is not a number, or snapshots are invalid.
    """
    name = checked_source("path", path)
    named = dict(check.of_kind("columns", {} if columns is None else columns, Mapping, "a mapping"))
    with open(name, encoding="utf-8-sig", errors="replace") as file:
        header = [word.strip().strip('"') for word in file.readline().split(",")]
        wanted = (SNAPSHOT_COLUMNS if named.get("time", "time") in header else LIST_COLUMNS).split()
        check.known_names(named, wanted, "parameter")
        needed = {*named, *wanted[: wanted.index("force" if "time" in wanted else "impulse")]}
        at = {key: header.index(named.get(key, key)) for key in wanted if named.get(key, key) in header}
        if repeated := sorted(header[k] for k in at.values() if header.count(header[k]) > 1):
            raise ValueError(must(f"the first line of {name!r}", "different names of columns",
                                  f"{plain_text(repeated[0])} {header.count(repeated[0])} times"))
        if missing := sorted(needed - at.keys()):
            raise ValueError(must(f"the first line of {name!r}", f"names of columns with {', '.join(missing)}",
                                  plain_text(", ".join(header), 200), "Name the columns of the file by `columns`."))
        try:
            converters: dict[int | str, Any] = {at["end"]: _end} if "end" in at else {}
            with warnings.catch_warnings():  # numpy warns of a file without rows, whose columns are empty
                warnings.simplefilter("ignore", UserWarning)
                rows = np.loadtxt(file, delimiter=",", usecols=list(at.values()), ndmin=2, encoding="utf-8",
                                  converters=converters)
        except ValueError as error:
            raise ValueError(f"The entries of {name!r} must be numbers ({error}).") from None
    found = dict(zip(at, rows.T, strict=True))
    return snapshots(**found) if "time" in found else found


def _end(word: str) -> float:
    """Return the end of a contact, nan for an empty entry."""
    return float(word) if word.strip() else math.nan
