"""`granular compare`: one scene on both engines."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

from granular.cases.case import keyword_options
from granular.cases.options import Option, options_of
from granular.cli.codes import exit_code
from granular.cli.output import check_outputs, deliver, json_file
from granular.cli.parser import HIDDEN, case_of
from granular.cli.progress import Progress
from granular.comparison import compare

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `compare`."""
    parser.add_argument("--plot", metavar="FILE.png", help="draw contacts, forces and world lines of both engines")
    parser.add_argument("--json", metavar="FILE.json", type=json_file,
                        help="write every number of the report; - for standard output")
    return [o for o in options_of(compare) if o.name not in HIDDEN | {"rule"}]


def run(given: argparse.Namespace) -> int:
    """Compare the engines, print the report, and write what was asked for."""
    check_outputs(given)
    case = case_of(given)
    known = keyword_options(compare)
    options: dict[str, Any] = {"until": case.until, "t_end": case.t_end}
    options |= {name: value for name, value in case.run.items() if name in known} | given.run
    if unused := [name for name in case.run if name not in known]:
        warnings.warn(f"compare makes no use of {', '.join(unused)} in [run].", stacklevel=1)
    with Progress(options["t_end"]) as progress:
        report = compare(case.scene, case.physics("md"), case.rule, **options, on_progress=progress)
    deliver(report, given)
    return exit_code(report.soft, report.hard)
