"""Reference numbers for other codes: set-ups with units and conventions.

Answers have all their digits and a condition number. They are stored in ``verification.json``, which
``bench/make_verification.py`` made with the solver of 34 digits.
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
"""Largest relative difference of a right number, for any number of written digits."""
MAX_EXPONENT = 400
"""Largest power of ten of a number that is accepted.

Decimal arithmetic itself allows far larger powers.
"""
INPUT_ROUNDING = 16 * 2.0**-52
"""Relative size of a dozen rounding errors of the inputs.

It is multiplied by a condition number.
"""


@dataclass(frozen=True)
class Answer:
    """Reference value of one quantity.

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
        Condition number κ = Σ |∂ln value / ∂ln input|. Relative rounding errors of 1e-16 of the inputs change the
        value by a relative amount of about κ · 1e-16.
    """

    run: str
    quantity: str
    value: str
    unit: str
    digits: int
    condition: float


@dataclass(frozen=True)
class Verdict:
    """Result of the comparison of one number with its reference value.

    Attributes
    ----------
    answer : Answer
        The reference.
    theirs : str
        The number of the other code, as written.
    word : str
        "right": equal to every digit written, or within the tolerance. "ill-conditioned": the difference can be the
        effect of rounded inputs. "wrong": the difference is larger. "missing": no number.
    off : float
        Relative difference |theirs - ours| / |ours|, nan if missing.
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
    """Return all answers of a case, in the order of time."""
    return [Answer(run, **row) for run, contents in case(name)["runs"].items() for row in contents["answers"]]


def write(name: str, path: str | PathLike[str]) -> None:
    """Write a case: a .json file with all its data, or a .csv table of its answers.

    Comments in the table contain the set-up.
    """
    contents, suffix = case(name), Path(path).suffix.lower()
    if suffix not in FILE_SUFFIXES:
        raise ValueError(f"`path` must be a name that ends in {' or '.join(FILE_SUFFIXES)}, got {str(path)!r}.")
    if suffix == ".json":
        return files.write_json(path, {"case": name, "conventions": kit()["conventions"], **contents})
    text = io.StringIO()
    for line in (f"case: {name}. {contents['about']}", f"source: {contents['source']}", *kit()["conventions"],
                 *(f"{run}: {json.dumps(run_contents['set-up'])}" for run, run_contents in contents["runs"].items())):
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
        Maximum relative difference of a right number, for codes with a time step. By default, every written digit must
        be right up to one unit of the last digit, and at least three digits must be right.

    Returns
    -------
    list of Verdict
        One for each answer, in their order.

    Raises
    ------
    ValueError
        If a column is missing, if a line belongs to no answer or is repeated, or if a value is not a number.
    """
    max_difference = None if tolerance is None else _check.number("tolerance", tolerance, at_least=0.0)
    answers_by_key = {(answer.run, answer.quantity): answer for answer in answers(name)}
    values_by_key = {}
    for line, run, quantity, value in _read(path):
        row = f"Line {line} of {str(path)!r} is {run!r}, {quantity!r}"
        _check.raise_if_true({f"{row}, which is not an answer of case {name}.": (run, quantity) not in answers_by_key,
                       f"{row}, which occurred before.": (run, quantity) in values_by_key})
        values_by_key[run, quantity] = value
    return [_verdict(answer, values_by_key.get(key), max_difference) for key, answer in answers_by_key.items()]


def _read(path: str | PathLike[str]) -> Iterator[tuple[int, str, str, str]]:
    """Yield line number, run, quantity and value of every row of a table with a value."""
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


def _verdict(answer: Answer, theirs: str | None, tolerance: float | None) -> Verdict:
    """Return the verdict on the answer `theirs` of another code."""
    if theirs is None:
        return Verdict(answer, "", "missing", math.nan)
    ours, number = Decimal(answer.value), Decimal(theirs)
    difference = abs(number - ours)
    error = float(difference / abs(ours))
    exponent = number.as_tuple().exponent
    unit = Decimal(1).scaleb(exponent if isinstance(exponent, int) else 0)  # of the last digit written
    last_digit = Decimal(1).scaleb(ours.adjusted() - answer.digits + 1)
    right = (error <= MAX_RIGHT_DIFFERENCE and difference <= max(unit, last_digit)
             if tolerance is None else error <= tolerance)
    word = "right" if right else "ill-conditioned" if error <= INPUT_ROUNDING * answer.condition else "wrong"
    return Verdict(answer, theirs, word, error)
