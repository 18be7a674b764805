"""`granular frontier`: measure the error of every method against its run time, on one scene.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse

from granular.cases.options import Option
from granular.cli import files
from granular.cli.parser import case_of, offered
from granular.cli.progress import Progress
from granular.workprecision import frontier

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `frontier`."""
    files.offer(parser, plot="draw error over run time", json="write every number, with the machine and all versions")
    return offered(frontier, "methods", "repeats")


def run(given: argparse.Namespace) -> None:
    """Measure, print, and write what was asked for."""
    case = case_of(given)
    options = case.options(frontier) | given.run
    with Progress(1.0, things="settings") as progress:
        report = frontier(case.scene, case.physics("md"), **options, on_progress=progress)
    files.deliver(report, given)
