"""`granular stability`: run stiff and extreme cases by every method: right, flagged, or silently wrong?
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse

from granular.cases.options import Option, options_of
from granular.cli import files
from granular.cli.progress import Progress
from granular.stress import AXES, stability

USAGE = "[options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the file to write; return the options of `stability`."""
    files.offer(parser, json="write every cell")
    parser.epilog = f"axes (names with a space in quotes): {', '.join(AXES)}"
    return [option for option in options_of(stability) if option.name != "on_progress"]


def run(given: argparse.Namespace) -> None:
    """Do the study and print its tables."""
    with Progress(1.0, things="cells") as progress:
        report = stability(**given.run, on_progress=progress)
    files.deliver(report, given)
