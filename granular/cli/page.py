"""`granular page`: write the teaching page: both engines live in one HTML file.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.cases.case import Option
from granular.page import live_page, opening

USAGE = "[SCENE] [--NAME VALUE …] [-o FILE.html] [--open]"
TITLE = "what it opens with"
NAME = "granular-page.html"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the scene and the file; return what can be set."""
    scenes = opening.SCENES
    parser.add_argument("scene", nargs="?", default=scenes[0], metavar="SCENE", help=f"one of {', '.join(scenes)}")
    offer(parser, NAME, NAME)
    return opening.options()


def offer(parser: argparse.ArgumentParser, default: str | None, shown: str) -> None:
    """Add the options of a page."""
    parser.add_argument("-o", "--output", default=default, metavar="FILE.html", help=f"[{shown}]")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def run(given: argparse.Namespace) -> None:
    """Write the page and say where it is."""
    live_page(given.output, given.scene, given.run)
    announce(given.output, given.open)


def announce(name: str, show: bool) -> None:
    """Print how large the file is; open it if `show`."""
    path = Path(name).resolve()
    print(f"{name}: {path.stat().st_size / 1000:.0f} kB, opens in any browser, needs no network")
    if show:
        import webbrowser

        webbrowser.open(path.as_uri())
