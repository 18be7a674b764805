"""`granular view`: write a page that plays recorded runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.cli.page import announce
from granular.page import player_page
from granular.trajectory import Trajectory

USAGE = "RUN.npz [RUN2.npz] [-o FILE.html] [--open]"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options to its parser."""
    parser.add_argument("runs", nargs="+", metavar="RUN.npz", help="one or two files of Trajectory.save or run --save")
    parser.add_argument("-o", "--output", metavar="FILE.html", help="[the first file's name with .html]")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def run(given: argparse.Namespace) -> int:
    """Read the runs, write the page and say where it is."""
    files = [Path(name) for name in given.runs]
    output = given.output or str(files[0].with_suffix(".html"))
    player_page(output, [Trajectory.load(file) for file in files], [file.stem for file in files])
    return announce(output, given.open)
