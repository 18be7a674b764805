"""`granular figure`: compute and draw a figure of the paper, or all of them.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.cli.progress import Progress
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


def run(given: argparse.Namespace) -> None:
    """Write the figures that are asked for, and say where."""
    folder = Path(given.output)
    folder.mkdir(parents=True, exist_ok=True)
    names = list(FIGURES) if given.name == "all" else [given.name]
    with Progress(1.0, things="figures") as progress:
        for count, name in enumerate(names):
            progress(count / len(names), count)
            print("  ".join(map(str, make(name, folder, points=given.points))))
