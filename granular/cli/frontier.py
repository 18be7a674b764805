"""`granular frontier`: error against run time of one scene."""

from __future__ import annotations

import argparse

from granular.cases.options import Option
from granular.cli.codes import OK
from granular.cli.output import check_outputs, deliver, json_file
from granular.cli.parser import case_of
from granular.cli.progress import Progress
from granular.workprecision import frontier
from granular.workprecision.run import METHODS

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the command's own options."""
    parser.add_argument("--plot", metavar="FILE.png", help="draw error over run time")
    parser.add_argument("--json", metavar="FILE.json", type=json_file,
                        help="write every number, with the machine and all versions; - for standard output")
    parser.add_argument("--methods", nargs="+", metavar="WORD", help=f"some of {', '.join(METHODS)} [all]")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="runs of which the fastest counts [3]")
    return []


def run(given: argparse.Namespace) -> int:
    """Measure, print, and write what was asked for."""
    check_outputs(given)
    case = case_of(given)
    end = {"until": case.until, "t_end": given.run.get("t_end", case.t_end)}
    with Progress(1.0, things="settings") as progress:
        report = frontier(case.scene, case.physics("md"), **end, methods=given.methods, repeats=given.repeats,
                          on_progress=progress)  # fmt: skip
    deliver(report, given)
    return OK
