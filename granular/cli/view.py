"""`granular view`: write an HTML page that plays recorded runs.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.cli import files
from granular.cli.page import announce, offer
from granular.page import player_page
from granular.trajectory import Trajectory

USAGE = "RUN.npz [RUN2.npz] [--title WORDS] [-o FILE.html] [--open]"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the runs and the file."""
    parser.add_argument("runs", nargs="+", metavar="RUN.npz", help="one or two files of Trajectory.save or run --save")
    parser.add_argument("--title", default="", metavar="WORDS", help="heading of the page [the files' names]")
    offer(parser, None, "the first file's name with .html")


def run(given: argparse.Namespace) -> None:
    """Read the runs, write the page and say where it is."""
    paths = list(map(Path, given.runs))
    runs = [Trajectory.load(path) for path in paths]
    output = given.output or str(paths[0].with_suffix(".html"))
    files.check_apart([output], given.runs)
    player_page(output, runs, [path.stem for path in paths], given.title)
    announce(output, given.open)
