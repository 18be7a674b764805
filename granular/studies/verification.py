"""Reference numbers for other codes: set-ups with units and conventions.

Answers have all their digits and a condition number. ``bench/make_verification.py`` made the file beside this one with
the solver of 34 digits.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from decimal import Decimal, InvalidOperation
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

from granular._engine import check as _check, files

TABLE_COLUMNS = ("run", "quantity", "value", "unit", "digits", "condition")
FILE_SUFFIXES = (".csv", ".json")
MAX_LINE_LENGTH = 10_000
"""Maximum length of a line of a table in characters."""
MAX_RIGHT_DIFFERENCE = 1e-3
"""Largest relative difference that can be right, for any number of digits."""
MAX_EXPONENT = 400
"""Largest power of ten of a number. Decimal arithmetic ends far beyond."""
INPUT_ROUNDING = 16 * 2.0**-52
"""Relative size of a dozen rounding errors of the inputs.

It is multiplied by a condition number.
"""


@dataclass(frozen=True)
class Answer:
    """One number that a code should give.

    Attributes
    ----------
    run, quantity : str
        Run of the case, and quantity.
    value : str
        Decimal digits, all of them right.
    unit : str
        SI unit; "1" for a pure number.
    digits : int
        Number of digits that were proved.
    condition : float
        κ = Σ |∂ln value / ∂ln input|: rounding the inputs to 1e-16 changes the value by about κ · 1e-16 of it.
    """

    run: str
    quantity: str
    value: str
    unit: str
    digits: int
    condition: float


@dataclass(frozen=True)
class Verdict:
    """Judgement of a number: "right", "ill-conditioned", "wrong" or "missing".

    Attributes
    ----------
    answer : Answer
        The reference.
    theirs : str
        The given number, as written.
    word : str
        "right": to every digit written, or within the tolerance; "ill-conditioned": within the effect of rounded
        inputs.
    off : float
        |theirs - ours| / |ours|, nan if missing.
    """

    answer: Answer
    theirs: str
    word: str
    off: float


@cache
def kit() -> dict[str, Any]:
    """Return all cases and conventions as they are stored."""
    stored: dict[str, Any] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
    return stored


def names() -> list[str]:
    """Return the names of the cases."""
    return list(kit()["cases"])


def case(name: str) -> dict[str, Any]:
    """Return a case: description, source, and runs with set-up and answers."""
    found: dict[str, Any] = kit()["cases"][_check.choice("case", name, names())]
    return found


def answers(name: str) -> list[Answer]:
    """Return all answers of a case, in time order."""
    return [Answer(run, **row) for run, told in case(name)["runs"].items() for row in told["answers"]]


def write(name: str, path: str | PathLike[str]) -> None:
    """Write a case: a .json file with everything, or a .csv table of its answers.

    Comments in the table contain the set-up.
    """
    told, ending = case(name), Path(path).suffix.lower()
    if ending not in FILE_SUFFIXES:
        raise ValueError(f"`path` must be a name that ends in {' or '.join(FILE_SUFFIXES)}, got {str(path)!r}.")
    if ending == ".json":
        return files.write_json(path, {"case": name, "conventions": kit()["conventions"], **told})
    text = io.StringIO()
    for line in (f"case: {name}. {told['about']}", f"source: {told['source']}", *kit()["conventions"],
                 *(f"{run}: {json.dumps(one['set-up'])}" for run, one in told["runs"].items())):
        print("#", line, file=text)
    table = csv.DictWriter(text, TABLE_COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(map(asdict, answers(name)))
    files.write_text(path, text.getvalue())


def check(name: str, path: str | PathLike[str], tolerance: float | None = None) -> list[Verdict]:
    """Compare numbers of another code with the answers of a case.

    Parameters
    ----------
    name : str
        Name of the case.
    path : path
        A .csv file with columns ``run``, ``quantity`` and ``value``: the file of `write` with other values. Further
        columns are ignored, and lines that begin with # are skipped.
    tolerance : float, optional
        Relative difference that is right, for codes with a time step. By default every digit that is written, up to
        one unit of the last, must be right, and at least three digits.

    Returns
    -------
    list of Verdict
        One for each answer, in their order.

    Raises
    ------
    ValueError
        If the file has other columns, rows without an answer, a row twice, or an entry that is not a number.
    """
    most = None if tolerance is None else _check.number("tolerance", tolerance, at_least=0.0)
    wanted = {(one.run, one.quantity): one for one in answers(name)}
    given = {}
    for line, run, quantity, value in _read(path):
        row = f"Line {line} of {str(path)!r} is {run!r}, {quantity!r}"
        _check.refuse({f"{row}, which is not an answer of case {name}.": (run, quantity) not in wanted,
                       f"{row}, which occurred before.": (run, quantity) in given})
        given[run, quantity] = value
    return [_judged(one, given.get(key), most) for key, one in wanted.items()]


def _read(path: str | PathLike[str]) -> Iterator[tuple[int, str, str, str]]:
    """Return line number, run, quantity and value of every row of a table."""
    try:
        text = Path(files.checked_source("path", path)).read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"The file {str(path)!r} must be a .csv file in UTF-8.") from None
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if any(len(line) > MAX_LINE_LENGTH for _, line in lines):
        raise ValueError(
            f"The file {str(path)!r} must be a table of answers, got a line of more than {MAX_LINE_LENGTH} characters."
        )
    table = csv.DictReader(line for _, line in lines)
    if missing := [column for column in TABLE_COLUMNS[:3] if column not in (table.fieldnames or ())]:
        raise ValueError(
            f"The file {str(path)!r} must have the columns {', '.join(TABLE_COLUMNS[:3])}, but {missing[0]!r} "
            "is missing. Write such a table with granular verify CASE -o FILE.csv."
        )
    for (number, _), row in zip(lines[1:], table, strict=False):
        value = (row["value"] or "").strip()
        if value:
            try:
                if not (Decimal(value).is_finite() and abs(Decimal(value).adjusted()) <= MAX_EXPONENT):
                    raise InvalidOperation
            except InvalidOperation:
                raise ValueError(f"The value in line {number} of {str(path)!r} must be empty or a finite number, got "
                                 f"{value!r}.") from None
            yield number, row["run"] or "", row["quantity"] or "", value


def _judged(answer: Answer, theirs: str | None, tolerance: float | None) -> Verdict:
    if theirs is None:
        return Verdict(answer, "", "missing", math.nan)
    ours, number = Decimal(answer.value), Decimal(theirs)
    miss = abs(number - ours)
    off = float(miss / abs(ours))
    exponent = number.as_tuple().exponent
    unit = Decimal(1).scaleb(exponent if isinstance(exponent, int) else 0)  # of the last digit written
    least = Decimal(1).scaleb(ours.adjusted() - answer.digits + 1)
    right = off <= MAX_RIGHT_DIFFERENCE and miss <= max(unit, least) if tolerance is None else off <= tolerance
    word = "right" if right else "ill-conditioned" if off <= INPUT_ROUNDING * answer.condition else "wrong"
    return Verdict(answer, theirs, word, off)
