"""Run the study of stiff and extreme cases.

``python -m bench.stability [--quick] [--json FILE] [AXIS ...]`` prints the tables, and the cells of the default methods
that are neither right nor flagged. The whole study takes about twenty minutes. It also writes the tables into
docs/guide/stability.md and draws the figure of that page.
"""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import replace
from pathlib import Path

import granular as gr
from bench import docs_data
from bench.stability import AXES, StabilityReport, stability
from bench.stability.cell import DEFAULT_METHODS, FIXED_METHODS, Result
from bench.stability.report import BAD_VERDICTS, markdown
from granular._engine import check
from granular._engine.progress import progress_callback

PAGE_PATH = Path(__file__).parents[2] / "docs" / "guide" / "stability.md"
FIGURE_PATH = PAGE_PATH.parents[1] / "figures" / "stability-three-balls.png"
CELL_SECONDS = {DEFAULT_METHODS: 20.0, FIXED_METHODS: 1.0}
"""Limit of processor time per cell in s, by methods."""
SUPERSCRIPT_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def measured(axes: tuple[str, ...] = tuple(AXES), quick: bool = False) -> StabilityReport:
    """Run the cells of all methods on the given axes."""
    parts = []
    for methods, seconds in CELL_SECONDS.items():
        with progress_callback(True, None, things="cells") as progress:
            parts.append(stability(methods, axes, quick=quick, seconds=seconds, on_progress=progress))
    own, fixed = parts
    return replace(
        own, cells=own.cells + fixed.cells, limits=own.limits + fixed.limits, drifts=own.drifts + fixed.drifts
    )


def page_text(report: StabilityReport) -> str:
    """Tables of the page, and the cells that are neither right nor flagged.

    Long tables are folded.
    """
    parts = []
    for title, rows in report.tables().items():
        text = markdown([[readable_number(cell) for cell in row] for row in rows])
        long = f"<details><summary>{title}: {len(rows) - 1} rows</summary>\n\n{text}\n\n</details>"
        parts.append(long if len(rows) > 8 else f"**{title}**\n\n{text}")
    left = [f"* {failure_line(cell)}" for method in DEFAULT_METHODS for cell in report.of(*BAD_VERDICTS, method=method)]
    if left:
        parts += ["Cells of the default methods that are neither right nor flagged:", "\n".join(left)]
    return "\n\n".join(parts)


def failure_line(cell: Result) -> str:
    """Description of a cell that is not right."""
    error = "" if math.isnan(cell.error) else f", error {cell.error:.2g}, tolerance {cell.tolerance:.2g}"
    return f"{cell.verdict.name}, {cell.method}, {cell.axis}: {cell.case} [{cell.truth}]{error}, {cell.said}"


def readable_number(cell: str) -> str:
    """Number with a power of ten, such as 1.5·10⁻⁷."""
    found = re.fullmatch(r"(\d\.\d)e([+-]\d+)", cell)
    if not found:
        return cell
    return "0" if found[1] == "0.0" else f"{found[1]}·10{str(int(found[2])).translate(SUPERSCRIPT_DIGITS)}"


def main(arguments: list[str] | None = None) -> None:
    """Run the study, print the tables, and write the requested files."""
    parser = argparse.ArgumentParser(prog="python -m bench.stability", description=__doc__.partition("\n\n")[2])
    parser.add_argument("axes", nargs="*", metavar="AXIS", help=f"one of: {', '.join(AXES)}")
    parser.add_argument("--quick", action="store_true", help="run only some short cells per axis and method")
    parser.add_argument("--json", metavar="FILE", help="write every cell to FILE")
    given = parser.parse_args(arguments)
    try:
        check.known_names(given.axes, AXES, "axis")
    except ValueError as error:
        parser.error(str(error))
    whole = not (given.axes or given.quick)
    report = measured(tuple(given.axes) or tuple(AXES), given.quick)
    print(page_text(report) if whole else report)
    if given.json:
        report.to_json(given.json)
    if whole:
        page = PAGE_PATH.read_text(encoding="utf-8")
        filled = re.sub(r"(<!-- tables -->\n).*?(<!-- end -->)", lambda m: f"{m[1]}{page_text(report)}\n{m[2]}", page,
                        flags=re.DOTALL)
        PAGE_PATH.write_text(filled, encoding="utf-8")
        docs_data.store("stability")
        extreme = gr.stability("three-balls")
        extreme.plot(FIGURE_PATH)
        docs_data.store("stability-three-balls", extreme.table())


if __name__ == "__main__":
    main()
