"""Recordings of experiments: tables with units, velocities from positions."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from granular._engine import check, files, signature
from granular.scene import Scene

SI_FACTORS = {
    "": 1.0, "s": 1.0, "ms": 1e-3, "µs": 1e-6, "μs": 1e-6, "us": 1e-6, "min": 60.0, "m": 1.0, "km": 1e3, "dm": 0.1,
    "cm": 1e-2, "mm": 1e-3, "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "m/s²": 1.0, "m/s^2": 1.0,
}
"""Factor to the SI unit for each unit that a header can contain."""
CLOCKS = {"t", "time", "zeit", "temps", "tempo", "tiempo", "tijd", "czas"}
"""Names of a first column that contains the times of the rows."""
NUMBERS = re.compile(r"(?=.*(?:\d|nan))(?:[\s\"';,+\-.\d]|[eE](?=[+\-\d])|nan)+", re.IGNORECASE)
"""A line of numbers, which can have empty cells."""
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
"""A number that can have thousands separators, such as 1,000."""
NAME_AND_UNIT = re.compile(
    r"^\s*(.*?)[\s/]*(?:[(\[]\s*([^(\[]*?)\s*[)\]]|/\s*([^/()\[\]]*?(?:/[^/()\[\]\s]+)?))?\s*$")
"""Header of a column, such as "v (cm/s)", "v [cm/s]", "v / cm/s" or "v"."""
BOUNCE, NEAR_BOUNCE = 5.0, 3.0
"""Minimum change of velocity, in standard errors, that counts as a bounce.

The second number is for bodies that can touch a neighbour within one step.
"""
MIN_FREE = 8
"""Minimum number of samples in free flight for an estimate of the noise."""
MAX_OVERLAP = 0.5
"""Largest overlap of a recorded pair, in units of the sum of its radii.

Larger overlaps that noise cannot explain are refused as wrong positions.
"""


@signature.face
def read_recording(path: str | PathLike[str], columns: Sequence[str] | None = None) -> dict[str, check.Array]:
    """Read a text table with units in its header, as phyphox or Tracker exports it.

    Columns are separated by tabs, semicolons or commas, and numbers have a decimal point or a decimal comma. Numbers
    that can have thousands separators, such as ``"1,000"``, are refused. The header is the last line above the numbers,
    such as ``"Time (s)","Height (cm)"`` or ``t;y / mm``. Lines above it are ignored. Times, lengths, speeds and
    accelerations are converted to SI units. A column without a unit is not converted, and an empty cell is nan. Rows of
    empty cells are ignored.

    Parameters
    ----------
    path : str or path
        The file.
    columns : str or sequence of str, optional
        Names of the columns to read, without their units. Defaults to all.

    Returns
    -------
    dict of str to array
        Arrays in SI units by the name of the column, in the order of `columns`. If the file
        has several columns and the first one contains times (``t``, ``time``, ``zeit`` …), these times must increase.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If the file has no header, a name occurs twice, a column is missing, a unit or a number cannot be read, a
        comma can be a thousands separator, or times do not increase.
    """
    name, data = repr(files.checked_source("path", path)), Path(path).read_bytes()
    lines = [line for line in _decoded(data).splitlines() if line.strip(' \t;,"')]
    is_numeric = [bool(NUMBERS.fullmatch(line)) for line in lines]
    start = is_numeric.index(True) if any(is_numeric) else 0
    if start == 0 or not all(is_numeric[start:]):
        got = repr(lines[start + is_numeric[start:].index(False)]) if start else "no line of names above numbers"
        raise ValueError(f"File {name} must have a line with the names of the columns and, below it, lines of numbers "
                         f"only, got {got}.")
    for line in lines[start - 1:]:
        if line.count('"') % 2:
            raise ValueError(f"File {name} must have pairs of quotation marks in each line, got {line!r}.")
    separator = next((s for s in "\t;," if s in lines[start - 1]), "\t")
    header, *rows = csv.reader([lines[start - 1].lstrip("# ").rstrip(separator), *lines[start:]], delimiter=separator)
    _check_header(name, header, lines[start - 1], lines[start - 2].split(separator) if start > 1 else [])
    _check_decimal_marks(name, [cell.strip() for row in rows for cell in row], separator)
    titles, *units = zip(*[NAME_AND_UNIT.findall(cell)[0] for cell in header], strict=True)
    check.raise_if_true({
        f"File {name} has the same name {titles} for several columns. Rename them.": len(set(titles)) < len(titles),
        f"File {name} has rows with more cells than its header {titles}.": any(
            cell.strip() for row in rows for cell in row[len(titles):]),
        f"File {name} must separate columns as its header {lines[start - 1]!r} does, got {lines[start]!r}.": len(
            titles) > max(map(len, rows)) == 1})
    wanted = check.several("columns", columns, "the name of a column, or several") if columns is not None else titles
    check.known_names(wanted, titles, f"column of {name}")
    found = {}
    for title in wanted:
        k = titles.index(title)
        unit, others = units[0][k] or units[1][k], [other for other in titles if other != title]
        check.raise_if_true({check.misuse(
            f"the unit of column {title!r}", unit, f"one of {', '.join(SI_FACTORS)[2:]}",
            f"To read other columns, give columns={others}."): unit not in SI_FACTORS})
        cells = [(row[k] if k < len(row) else "").strip().replace(",", ".") or "nan" for row in rows]
        try:
            found[title] = check.array(title, SI_FACTORS[unit] * np.array(cells, dtype=float))
        except ValueError as error:
            raise ValueError(f"File {name} must have numbers in column {title!r}, got "
                             f"{str(error).partition(': ')[2]}.") from None
        if k == 0 and others and title.lower() in CLOCKS:
            check.every(title, found[title], np.diff(found[title], prepend=-np.inf) > 0.0,
                        "a time in s after the one in the row before it", "Sort the rows by time.")
    return found


def _decoded(data: bytes) -> str:
    """Return the text of a file in one of three encodings.

    They are UTF-8, UTF-16 with a mark, and the encoding of Western Europe. Spreadsheets write all of them. A
    typographic minus becomes a hyphen.
    """
    if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        text = data.decode("utf-16", "replace")
    else:
        text = data.decode("utf-8-sig", "replace")
        if "\N{REPLACEMENT CHARACTER}" in text:
            text = data.decode("cp1252", "replace")
    return text.replace("\N{MINUS SIGN}", "-")


def _check_header(name: str, header: list[str], line: str, above: list[str]) -> None:
    """Raise `ValueError` if the header is a row of numbers, or of units.

    Such a row of numbers has an unreadable cell. `name` is the file, `line` the line of the header, and `above` are the
    cells of the line above it.
    """
    if any(NUMBERS.fullmatch(cell) for cell in header):
        raise ValueError(f"File {name} must have numbers only below the names of its columns, got {line!r}.")
    if len(above) == len(header) > 1 and all(cell.strip(" ()[]") in SI_FACTORS for cell in header):
        raise ValueError(f"File {name} must have each unit in the line of names, such as 't (s)', got a separate line "
                         f"of units {line!r}.")


def _check_decimal_marks(name: str, cells: list[str], separator: str) -> None:
    """Raise `ValueError` if commas in numbers can be thousands separators.

    Commas are decimal commas if no number has a decimal point, and if at least one of them cannot be a thousands
    separator, such as the comma of 0,5. In files with semicolons between columns the first condition is sufficient.
    """
    commas = [cell for cell in cells if "," in cell]
    is_mixed = any(cell.count(".") == 1 for cell in cells)
    if commas and (is_mixed or (separator != ";" and all(map(THOUSANDS.fullmatch, commas)))):
        raise ValueError(f"File {name} must have one decimal mark and no thousands separators, got {commas[0]!r}. "
                         "Write a decimal point.")


def velocities(
    scene: Scene, time: check.Array, position: check.Array, gap: check.Array
) -> tuple[check.Array, dict[str, float]]:
    """Return velocities by central differences of positions, and their error.

    The difference over three samples is exact for constant acceleration, also at unequal steps. The velocity is nan for
    the first and the last sample, and next to a bounce, where the slopes on both sides differ by more than noise. A
    bounce that changes the velocity by less than three standard errors of this change is not detected.

    Parameters
    ----------
    scene : Scene
        Scene with the forces of free flight.
    time : (T,) array
        Times in s, T ≥ 3, strictly increasing.
    position, gap : (T, n) and (T, n-1) arrays
        Positions of all bodies and gaps in m.

    Returns
    -------
    velocity : (T, n) array
        Velocities in m/s.
    errors : dict of str to float
        "position_error" is the standard error σ of a position in m, from the scatter of the second differences about
        free flight in `scene`. "velocity_error" is the standard error σ/(√2 h) of a velocity in m/s, for the median
        step h in s.

    Raises
    ------
    ValueError
        If times do not increase, or a pair overlaps by more than half the sum of its radii and noise.
    """
    check.every("time", time, np.diff(time, prepend=-np.inf) > 0.0,
                "larger than the entry before it, without `velocity`")
    step, ball = np.diff(time)[:, None], ~scene.is_wall
    slope, before, after = np.diff(position, axis=0) / step, step[:-1], step[1:]
    swing = scene.pendulum**2 * (position[1:-1] - scene.at_rest) * ball
    # change of velocity minus its value in free flight, scaled to have the standard error of a position
    change = np.abs(np.diff(slope, axis=0) - 0.5 * (scene.fall - swing) * (before + after)) / np.sqrt(
        before**-2.0 + after**-2.0 + (1.0 / before + 1.0 / after) ** 2) * ball
    # bodies of pairs that can touch within one step; the noise is estimated from them only without enough others
    near = gap[1:-1] <= 0.5 * np.abs(scene.closing_acceleration) * step.max() ** 2 + np.maximum(
        *(np.abs(np.diff(rows, axis=0)) for rows in (gap[:-1], gap[1:])))
    touched = sum(near @ np.eye(scene.n)[side] for side in scene.bodies(np.arange(scene.n_pairs))) > 0.0
    free = change[ball & ~touched] if (ball & ~touched).sum() >= MIN_FREE else change[:, ball]
    # smallest σ: rounding errors, and the part of a swing that is not parabolic
    least = 4.0 * np.spacing(np.abs(position).max()) + np.abs(swing).max() * scene.pendulum**2 * step.max() ** 4
    # the median of |x| is 0.6745 σ, but bounces increase it, so it is only used to exclude them
    sigma = float(max(np.sqrt(np.mean(free[free <= BOUNCE * max(np.median(free) / 0.6745, least)] ** 2)), least))
    limit = MAX_OVERLAP * np.add(*scene.sides(scene.radius))
    check.raise_if_true({check.must(
        f"the overlap of pair {scene.pairs[pair].name} in sample {row}",
        f"at most half the sum of its radii, {limit[pair]:.3g} m", f"{-gap[row, pair]:.3g} m",
        "Positions are those of centres in m, from the bottom up."): True
        for row, pair in np.argwhere((gap < -limit - BOUNCE * sigma) & (limit > 0.0))[:1].tolist()})
    bounce = np.pad(change > sigma * np.where(touched, NEAR_BOUNCE, BOUNCE), ((1, 1), (0, 0)))
    # of two marked neighbours the bounce lies between them; it can lie on either side of a single marked sample
    alone = bounce & ~np.roll(bounce, 1, axis=0) & ~np.roll(bounce, -1, axis=0)
    velocity = np.pad((after * slope[:-1] + before * slope[1:]) / (before + after), ((1, 1), (0, 0)),
                      constant_values=np.nan)
    velocity[bounce | np.roll(alone, 1, axis=0) | np.roll(alone, -1, axis=0)] = np.nan
    return velocity, {"position_error": sigma, "velocity_error": sigma / (2.0**0.5 * float(np.median(step)))}
