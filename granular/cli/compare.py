"""`granular compare`: run a scene on both engines and say where and why they differ.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
import warnings

from granular.cases.case import Option
from granular.cli import files
from granular.cli.parser import case_of, offered
from granular.cli.progress import Progress
from granular.comparison import compare
from granular.trajectory import Trajectory

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `compare`."""
    files.offer(parser, plot="draw contacts, forces and paths of both engines, and a lens on the hops",
                film="film both engines: fall, contacts slowed down, flight; or .mp4",
                json="write every number of the report")
    return [option for option in offered(compare) if option.name != "rule"]


def run(given: argparse.Namespace) -> list[Trajectory]:
    """Compare the engines, print the report, and write what was asked for."""
    case = case_of(given)
    options = case.options(compare)
    if unused := [name for name in case.run if name not in options]:
        warnings.warn(f"compare makes no use of {', '.join(unused)} in [run].", stacklevel=1)
    options |= given.run
    with Progress(options["t_end"]) as progress:
        report = compare(case.scene, case.physics("md"), case.rule, **options, on_progress=progress)
    files.deliver(report, given)
    return [report.soft, report.hard]
