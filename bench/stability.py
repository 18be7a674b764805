"""Regenerate the table of docs/stability.md: ``python bench/stability.py [FILE.json]`` (some minutes).

Prints the tables as Markdown, then the cells of the default methods that are not right and not flagged.
"""

from __future__ import annotations

import sys

import granular as gr
from granular.stress.report import BAD

if __name__ == "__main__":
    report = gr.stability(on_progress=lambda axis, cells: print(f"\r{axis}: {cells} ", end="", file=sys.stderr))
    print(report.markdown())
    for method in ("located", "edmd"):
        for cell in report.of(*BAD, method=method):
            print(f"- {cell.verdict.name}, {method}, {cell.axis}: {cell.case} [{cell.truth}], error {cell.error:.2g}, "
                  f"tolerance {cell.tolerance:.2g}; {cell.said}")  # fmt: skip
    for path in sys.argv[1:]:
        report.to_json(path)
