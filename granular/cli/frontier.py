"""The command `frontier`: error against run time of one scene."""

from __future__ import annotations

import argparse
from typing import Any

from granular.cli.output import json_file, show
from granular.cli.progress import Progress


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's own options."""
    from granular.workprecision.run import METHODS

    parser.add_argument("--plot", metavar="FILE.png", help="draw error over run time")
    parser.add_argument("--json", metavar="FILE.json", type=json_file,
                        help="write every number, with the machine and all versions; - for standard output")
    parser.add_argument("--methods", nargs="+", metavar="WORD", help=f"some of {', '.join(METHODS)} [all]")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="runs of which the fastest counts [3]")


def run(case: Any, given: argparse.Namespace) -> None:
    """Measure, print, and write what was asked for."""
    from granular.workprecision import frontier

    end = {"until": case.until, "t_end": given.run.get("t_end", case.t_end)}
    with Progress(1.0, things="settings") as progress:
        report = frontier(case.scene, case.physics("md"), **end, methods=given.methods, repeats=given.repeats,
                          on_progress=progress)  # fmt: skip
    show(report, given.json)
    if given.plot is not None:
        report.plot(given.plot)
    if given.json is not None:
        report.to_json(given.json)
