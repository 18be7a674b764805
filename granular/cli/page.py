"""`granular page`: write the teaching page, one HTML file, and open it if asked."""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.cli.codes import OK
from granular.page import live_page
from granular.page.write import SCENES

USAGE = "[SCENE] [-o FILE.html] [--open]"
NAME = "granular-page.html"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options to its parser."""
    parser.add_argument("scene", nargs="?", default=SCENES[0], metavar="SCENE", help=f"one of {', '.join(SCENES)}")
    parser.add_argument("-o", "--output", default=NAME, metavar="FILE.html", help=f"[{NAME}]")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def run(given: argparse.Namespace) -> int:
    """Write the page and say where it is."""
    live_page(given.output, given.scene)
    return announce(given.output, given.open)


def announce(name: str, show: bool) -> int:
    """Print how large the file is; open it if `show`."""
    path = Path(name).resolve()
    print(f"{name}: {path.stat().st_size / 1000:.0f} kB, opens in any browser, needs no network")
    if show:
        import webbrowser

        webbrowser.open(path.as_uri())
    return OK
