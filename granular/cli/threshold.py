"""`granular threshold`: find from which gap, stiffness, … on a scene may be event-driven.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse

from granular.cases.case import Option
from granular.cli import files
from granular.cli.parser import offered
from granular.cli.progress import Progress
from granular.thresholds import threshold

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `threshold`."""
    files.offer(parser, plot="draw what decides over the values", json="write every value with its verdict")
    return offered(threshold, "over", "between", "criterion", "error", "within", "points", "spacing")


def run(given: argparse.Namespace) -> None:
    """Scan, bisect, print, and write what was asked for."""
    with Progress(None, things="values") as progress:
        report = threshold(given.target, **given.given, **given.run, on_progress=progress)
    files.deliver(report, given)
