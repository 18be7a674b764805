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

import granular as gr
from granular.stress.cell import FIXED
from granular.stress.report import BAD

PAGE = Path(__file__).parents[1] / "docs" / "stability.md"
SECONDS = {("located", "edmd"): 20.0, FIXED: 1.0}
"""Wall-clock limit of a cell, by methods."""


def tell(axis: str, cells: int) -> None:
    """Say how far it is."""
    print(f"\r{axis}: {cells} ", end="", file=sys.stderr)


def main(paths: list[str]) -> None:
    own, fixed = (
        gr.stability(methods=methods, seconds=seconds, on_progress=tell) for methods, seconds in SECONDS.items()
    )
    report = replace(
        own, cells=own.cells + fixed.cells, limits=own.limits + fixed.limits, drifts=own.drifts + fixed.drifts
    )  # fmt: skip
    for path in paths:
        report.to_json(path)
    lines = [report.markdown()]
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
