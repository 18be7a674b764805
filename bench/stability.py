"""Measure the tables of docs/stability.md anew and put them into the page: ``python bench/stability.py [FILE.json]``.

Takes some twenty minutes; prints the cells of the default methods that are not right and not flagged.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import docs_data
from frontier import SUPERSCRIPT

import granular as gr
from granular.stress.cell import FIXED
from granular.stress.report import BAD
from granular.tables import markdown

PAGE = Path(__file__).parents[1] / "docs" / "stability.md"
SECONDS = {("located", "edmd"): 20.0, FIXED: 1.0}
"""Wall-clock limit of a cell, by methods."""


def tell(axis: str, cells: int) -> None:
    """Say how far it is."""
    print(f"\r{axis}: {cells} ", end="", file=sys.stderr)


def tables(report: gr.Stability) -> str:
    """The tables of the page: the first as it is, longer ones folded."""
    parts = []
    for title, rows in report.tables().items():
        text = markdown([[readable(cell) for cell in row] for row in rows])
        long = f"<details><summary>{title}: {len(rows) - 1} rows</summary>\n\n{text}\n\n</details>"
        parts.append(long if len(rows) > 8 else f"**{title}**\n\n{text}")
    return "\n\n".join(parts) + "\n"


def readable(cell: str) -> str:
    """A number as people write it: 1.5·10⁻⁷."""
    found = re.fullmatch(r"(\d\.\d)e([+-]\d+)", cell)
    if not found:
        return cell
    return "0" if found[1] == "0.0" else f"{found[1]}·10{str(int(found[2])).translate(SUPERSCRIPT)}"


def main(paths: list[str]) -> None:
    own, fixed = (
        gr.stability(methods=methods, seconds=seconds, on_progress=tell) for methods, seconds in SECONDS.items()
    )
    report = replace(
        own, cells=own.cells + fixed.cells, limits=own.limits + fixed.limits, drifts=own.drifts + fixed.drifts
    )  # fmt: skip
    for path in paths:
        report.to_json(path)
    lines = [tables(report)]
    left = [cell for method in ("located", "edmd") for cell in report.of(*BAD, method=method)]
    if left:
        lines.append("Of the default methods, not right and not flagged:\n")
    for cell in left:
        error = "" if math.isnan(cell.error) else f", error {cell.error:.2g}, tolerance {cell.tolerance:.2g}"
        name = f"{cell.verdict.name}, {cell.method}, {cell.axis}: {cell.case} [{cell.truth}]"
        lines.append(f"* {name}{error}; {cell.said}")
    text = "\n".join(lines)
    print(text)
    page = PAGE.read_text(encoding="utf-8")
    filled = re.sub(r"(<!-- tables -->\n).*?(<!-- end -->)", lambda m: f"{m[1]}{text}\n{m[2]}", page, flags=re.DOTALL)
    PAGE.write_text(filled, encoding="utf-8")
    for name in ("stability", "stability-others"):
        docs_data.store(name)


if __name__ == "__main__":
    main(sys.argv[1:])
