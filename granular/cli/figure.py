"""`granular figure`: the paper's figures."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from granular.cli.codes import OK
from granular.paper import FIGURES, make

USAGE = "NAME|all [-o DIR]"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    rows = [f"  {figure.number:>2}  {name:22} {figure.about}" for name, figure in FIGURES.items()]
    parser.epilog = "figures, by number in the paper or by name:\n" + "\n".join(rows)
    parser.add_argument("name", metavar="NAME", help="which figure; or all")
    parser.add_argument("-o", "--output", metavar="DIR", default=".",
                        help="folder for drawing and data, made if need be [.]")
    parser.add_argument("--points", type=int, metavar="N",
                        help="points along the longest axis; what is finer than these is not resolved [as in print]")


def run(given: argparse.Namespace) -> int:
    """Write the figures that are asked for, and say where."""
    folder = Path(given.output)
    folder.mkdir(parents=True, exist_ok=True)
    names = list(FIGURES) if given.name == "all" else [given.name]
    for name in names:
        if len(names) > 1 and sys.stderr.isatty():
            print(f"\r\x1b[K{name} …", end="", file=sys.stderr, flush=True)
        files = make(name, folder, points=given.points)
        if len(names) > 1 and sys.stderr.isatty():
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        print("  ".join(str(file) for file in files))
    return OK
