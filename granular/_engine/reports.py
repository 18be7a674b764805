"""Tables, numbers with units, JSON and figure styles for all reports.

Figures have the font size (8 pt) and the column widths of Physical Review, see ``granular/journal.mplstyle``.
"""

from __future__ import annotations

import math
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from typing import Any

from granular._engine.package import VERSION, import_optional

Rows = Sequence[Sequence[str]]
"""Rows of a table as strings. The first row is the header."""
DECIMAL_NUMBER = re.compile(r"\d+\.\d*(?:e[-+]?\d+)?")
INVERSE_UNIT = re.compile(r" (\w+)-1$")
UNIT_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
"""Multiples of a unit such as the second or the metre."""
LEAST_SHARE = 1e-12
"""Fraction below which a value is only a rounding error."""
HARD_COLOUR, SOFT_COLOUR = "#c1440e", "#1f4e79"
"""Colours of hard and soft spheres, which also differ in black and white."""
GREY_COLOUR = "#8a8a8a"
COLUMN_WIDTH, PAGE_WIDTH = 3.4, 7.0
"""Widths of a column and of a page in inches."""


class Report:
    """Base class of results, whose subclasses define the dictionary `_numbers`."""

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers with provenance, for JSON (nan and inf are None)."""
        from granular._engine import files

        return dict(files.plain({"provenance": files.provenance(), **self._numbers()}))

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the result of `to_dict` to a file, completely or not at all."""
        from granular._engine import files

        files.write_json(path, self.to_dict())

    def _numbers(self) -> dict[str, Any]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}: {self._headline}"

    def _repr_html_(self) -> str:
        return html(self._headline, more=self._whole(), picture=_picture(self))

    def _whole(self) -> str:
        """Return the full report as text."""
        return str(self)

    @property
    def _headline(self) -> str:
        """First line of the report."""
        return str(self).partition("\n")[0]


def problem(report: Any) -> dict[str, Any]:
    """Return scene, laws, stop condition and end time of a comparison, for JSON."""
    from granular._engine.describe import scene_to_json

    return {"scene": scene_to_json(report.scene), "law": [repr(law) for law in report.law],
            "until": repr(report.until), "t_end": report.t_end}


def cores() -> int:
    """Return the number of processor cores that this process can use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> dict[str, Any]:
    """Return processor, available cores, system and versions, for use with run times."""
    from granular._engine import files

    packages = ("numpy", "scipy", "numba", "mpmath")
    text = Path("/proc/cpuinfo").read_text("utf-8") if os.access("/proc/cpuinfo", os.R_OK) else ""
    model = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return {
        "processor": model[1] if model else platform.processor() or platform.machine(), "cores": cores(),
        "system": f"{platform.system()} {platform.machine()}", "python": platform.python_version(),
        "granular": VERSION, **{name: files.version_of(name) or "not installed" for name in packages},
    }


def aligned(rows: Rows, sides: str = ">", indent: str = "") -> str:
    """Return a table as text with aligned columns.

    `sides` contains < (left) or > (right) for each column. Its last character is also used for all further columns.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = sides.ljust(len(widths), sides[-1])
    lines = ("  ".join(f"{word:{side}{width}}" for word, side, width in zip(row, sides, widths, strict=True))
             for row in rows)
    return "\n".join((indent + line).rstrip() for line in lines)


def split_table(rows: Rows, sides: str = ">", left: int = 1, width: int = 80) -> str:
    """Return a table as text, split into several tables if it is wider than `width`.

    The width is in characters. Each table begins with the first `left` columns. `sides` is explained in `aligned`.
    """
    widths = [2 + max(map(len, column)) for column in zip(*rows, strict=True)]
    sides, groups = sides.ljust(len(widths), sides[-1]), [[*range(left)]]
    for k in range(left, len(widths)):
        if len(groups[-1]) > left and sum(widths[i] for i in groups[-1]) + widths[k] - 2 > width:
            groups.append([*range(left)])
        groups[-1].append(k)
    return "\n\n".join(aligned([[row[k] for k in group] for row in rows], "".join(sides[k] for k in group))
                       for group in groups)


def with_unit(text: str, units: str, between: str = ", ") -> str:
    """Return a text with its unit, such as the header "v, m/s" of a column.

    "m s-1" is converted to "m/s". `units` is empty or "1" for pure numbers.
    """
    return text if units in ("", "1") else text + between + INVERSE_UNIT.sub(r"/\1", units)


def axis_label(text: str, units: str) -> str:
    """Return the label of an axis with its unit, such as "v (m/s)"."""
    return with_unit(text, units, " (") + ")" * (units not in ("", "1"))


def abridged_rows(rows: Rows, most: int = 12) -> Rows:
    """Return the rows of a table, abridged to its first and last rows above `most`."""
    half = most // 2
    return rows if len(rows) <= most else [*rows[:half], ["…"] * len(rows[0]), *rows[-half:]]


def html(head: str, rows: Rows = (), more: str = "", picture: str = "") -> str:
    """Return HTML for a notebook, in the colours of the notebook.

    It consists of the line `head`, a table of `rows`, the collapsible text `more`, and the HTML of a figure.
    """
    from html import escape

    cell = "<td style='text-align:right;padding:0 .6em'>"
    lines = "".join("<tr>" + "".join(f"{cell}{escape(word)}</td>" for word in row) + "</tr>" for row in rows)
    text = f"<details><summary>the report</summary><pre>{escape(more)}</pre></details>" * bool(more)
    return f"<div><b>{escape(head)}</b>" + f"<table>{lines}</table>" * bool(rows) + text + picture + "</div>"


def _picture(report: Any) -> str:
    """Return the figure of a report as HTML, or "" without a figure or matplotlib."""
    from base64 import b64encode
    from importlib.util import find_spec

    if find_spec("matplotlib") is None or not hasattr(report, "plot"):
        return ""
    data = b64encode(_png(report.plot())).decode()
    return f'<img alt="Hard and soft spheres compared, one panel below the other" style="max-width:100%" ' \
           f'src="data:image/png;base64,{data}">'


def _png(figure: Any) -> bytes:
    """Return a figure in the format PNG."""
    import io

    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def pairs_by_law(laws: Iterable[Any]) -> dict[str, list[int]]:
    """Return the numbers of the pairs of each different law or rule, by its `repr`."""
    pairs: dict[str, list[int]] = {}
    for pair, law in enumerate(laws):
        pairs.setdefault(repr(law), []).append(pair)
    return pairs


def named_pairs(pairs: Sequence[int], n: int, name: Callable[[int], str]) -> str:
    """Return "pair 1–2", "all pairs" or "3 pairs" for some of `n` pairs.

    `name` returns the name of a pair.
    """
    return f"pair {name(pairs[0])}" if len(pairs) == 1 else "all pairs" if len(pairs) == n else f"{len(pairs)} pairs"


def short_text(text: str) -> str:
    """Return the text of a law or a wall with numbers rounded to four digits."""
    return DECIMAL_NUMBER.sub(lambda match: f"{float(match[0]):.4g}", text)


def scene_text(scene: Any) -> str:
    """Return the text of a scene without the name of its class."""
    return str(scene).removeprefix("Scene(").removesuffix(")")


def number(value: float, form: str = ".6g", none: str = "–") -> str:
    """Return a number as text in the format `form`, or `none` for nan and infinity."""
    return format(value, form) if math.isfinite(value) else none


def rough_text(value: float) -> str:
    """Return a number as text with two significant digits."""
    return f"{float(f'{value:.2g}'):g}"


def percent(share: float) -> str:
    """Return a fraction as text in per cent with two digits.

    Fractions below `LEAST_SHARE` are rounding errors, and are only given as smaller than this value. The text of nan is
    a dash.
    """
    if math.isnan(share):
        return "–"
    if share == 0.0 or not share < LEAST_SHARE:
        return f"{rough_text(100.0 * share)} %"
    return f"< {100.0 * LEAST_SHARE:g} %"


def rounded_bound(value: float, digits: int, *, up: bool) -> str:
    """Return a number as text, rounded up or down so that it remains a bound."""
    from decimal import ROUND_CEILING, ROUND_FLOOR, Context

    context = Context(prec=digits, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    return f"{float(context.create_decimal(repr(value))):.{digits}g}"


def unit_of(
    value: float, si: str, least: float = 2.0, prefixes: Sequence[tuple[float, str]] = UNIT_PREFIXES
) -> tuple[float, str]:
    """Return factor and name of the largest multiple of a unit for a value.

    `value`, in the unit `si`, is at least `least` times this factor. Small values get the smallest multiple.
    """
    scale, prefix = next((entry for entry in prefixes if value >= least * entry[0]), prefixes[-1])
    return scale, prefix + si


def duration(seconds: float) -> str:
    """Return a time in s as text with three digits and a unit, such as "1.5 ms"."""
    scale, name = unit_of(seconds, "s", 1.0)
    return f"{seconds / scale:.3g} {name}"


@contextmanager
def style() -> Iterator[None]:
    """Context manager and decorator that sets the style of printed figures."""
    with import_optional("matplotlib.style", "plot").context("granular.journal"):
        yield


def canvas(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """Return a figure with a size in inches, and its axes as an array (rows, columns).

    The figure keeps the style of printed figures when it is saved later.
    """
    figure = import_optional("matplotlib.figure", "plot").Figure(figsize=(width, height), layout="constrained")
    figure._repr_png_ = partial(_png, figure)
    figure.draw = style()(figure.draw)  # ticks are created when they are drawn
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def add_letters(axes: Iterable[Any]) -> None:
    """Write (a), (b), … above the left corners of the panels."""
    for axis, letter in zip(axes, ascii_lowercase, strict=False):
        axis.set_title(f"({letter})", loc="left")
