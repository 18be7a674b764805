"""`granular stability`: stiff and extreme cases by every method."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TextIO

from granular.cli.output import json_file, show
from granular.cli.progress import INTERVAL, PATIENCE, clock
from granular.stress import AXES, stability
from granular.stress.cell import METHODS


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    group = parser.add_argument_group("stability")
    group.add_argument("--methods", nargs="+", default=list(METHODS), metavar="NAME",
                       help=f"from {', '.join(METHODS)} [all]")
    group.add_argument("--axes", nargs="+", default=list(AXES), metavar="NAME",
                       help=f"from {', '.join(AXES)} (names with a space in quotes) [all]")
    group.add_argument("--quick", action="store_true", help="a few cells of every axis, in less than 20 s")
    group.add_argument("--seconds", type=float, default=20.0, metavar="X", help="wall-clock limit of a cell in s [20]")
    group.add_argument("--json", metavar="FILE.json", type=json_file, help="write every cell; - for standard output")


def run(found: argparse.Namespace) -> None:
    """Do the study and print its tables."""
    with Line() as line:
        report = stability(found.methods, found.axes, quick=found.quick, seconds=found.seconds, on_progress=line)
    show(report, found.json)
    if found.json is not None:
        report.to_json(found.json)


class Line:
    """A line of progress on a terminal."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self.stream = sys.stderr if stream is None else stream
        self.start = time.monotonic()
        self.next, self.shown = self.start + PATIENCE, False

    def __call__(self, axis: str, cells: int) -> None:
        """Take note that `cells` cells are done, the last of them on `axis`."""
        now = time.monotonic()
        if self.stream.isatty() and now >= self.next:
            self.next, self.shown = now + INTERVAL, True
            self.stream.write(f"\r\x1b[K{axis}: {cells} cells, {clock(now - self.start)} so far")
            self.stream.flush()

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *error: object) -> None:
        """Clear the line, however the study has ended."""
        if self.shown:
            self.stream.write("\r\x1b[K")
            self.stream.flush()
