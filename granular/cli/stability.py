"""`granular stability`: stiff and extreme cases by every method."""

from __future__ import annotations

import argparse

from granular.cli.codes import OK
from granular.cli.output import check_outputs, deliver, json_file
from granular.cli.progress import Progress
from granular.stress import AXES, stability
from granular.stress.cell import METHODS

USAGE = "[options]"


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


def run(given: argparse.Namespace) -> int:
    """Do the study and print its tables."""
    check_outputs(given)
    with Progress(1.0, things="cells") as progress:
        report = stability(given.methods, given.axes, quick=given.quick, seconds=given.seconds, on_progress=progress)
    deliver(report, given)
    return OK
