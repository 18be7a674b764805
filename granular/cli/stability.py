"""`granular stability`: make a scene stiff, close, damped, unequal: which method is right, flagged, or wrong unseen?
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse

from granular.cases.case import Option
from granular.cli import files
from granular.cli.parser import offered
from granular.cli.progress import Progress
from granular.extremes import stability

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `stability`."""
    files.offer(parser, plot="draw the table", json="write every run")
    return offered(stability, "axes", "methods", "error")


def run(given: argparse.Namespace) -> None:
    """Try everything, print the table, and write what was asked for."""
    with Progress(1.0, things="runs") as progress:
        report = stability(given.target, **given.given, **given.run, on_progress=progress)
    files.deliver(report, given)
