"""Commands that write an HTML page: the teaching page, and the player of runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.app.page import live_page, opening, player_page
from granular.cases.case import Option
from granular.run.trajectory import Trajectory

NAME = "granular-page.html"


class Page(Command):
    """Write the teaching page: both engines live in one HTML file."""

    USAGE = "[SCENE] [--NAME VALUE …] [-o FILE.html] [--open]"
    TITLE = "what it opens with"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        scenes = opening.PAGE_SCENES
        parser.add_argument("scene", nargs="?", default=scenes[0], metavar="SCENE", help=f"one of {', '.join(scenes)}")
        offer_page(parser, NAME, NAME)
        return opening.options()

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        live_page(given.output, given.scene, given.run)
        announce(given.output, given.open)


class View(Command):
    """Write an HTML page that plays recorded runs."""

    USAGE = "RUN.npz [RUN2.npz] [--title WORDS] [-o FILE.html] [--open]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        about = "one or two files of Trajectory.save or run --save"
        parser.add_argument("runs", nargs="+", metavar="RUN.npz", help=about)
        parser.add_argument("--title", default="", metavar="WORDS", help="heading of the page [the files' names]")
        offer_page(parser, None, "the first file's name with .html")
        return []

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        paths = list(map(Path, given.runs))
        runs = [Trajectory.load(path) for path in paths]
        written = given.output or str(paths[0].with_suffix(".html"))
        output.check_apart([written], given.runs)
        player_page(written, runs, [path.stem for path in paths], given.title)
        announce(written, given.open)


def offer_page(parser: argparse.ArgumentParser, default: str | None, shown: str) -> None:
    """Add the options of a page."""
    parser.add_argument("-o", "--output", default=default, metavar="FILE.html", help=f"[{shown}]")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def announce(name: str, show: bool) -> None:
    """Print the size of the file, and open it in the browser if `show`."""
    path = Path(name).resolve()
    print(output.fitted(f"{name}: {path.stat().st_size / 1000:.0f} kB, opens in any browser, needs no network"))
    if show:
        import webbrowser

        webbrowser.open(path.as_uri())
