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
    """Write the teaching page: one HTML file with both models."""

    USAGE = "[SCENE] [--NAME VALUE …] [-o FILE.html] [--open]"
    TITLE = "initial state of the page"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        scenes = opening.PAGE_SCENES
        parser.add_argument("scene", nargs="?", default=scenes[0], metavar="SCENE", help=f"one of {', '.join(scenes)}")
        add_page_options(parser, NAME, NAME)
        return opening.options()

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        live_page(parsed.output, parsed.scene, parsed.run_options)
        announce(parsed.output, parsed.open)


class View(Command):
    """Write an HTML page that plays recorded runs."""

    USAGE = "RUN.npz [RUN2.npz] [--title WORDS] [-o FILE.html] [--open]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        about = "one or two files written by Trajectory.save or granular run --save"
        parser.add_argument("runs", nargs="+", metavar="RUN.npz", help=about)
        parser.add_argument("--title", default="", metavar="WORDS", help="heading of the page [the files' names]")
        add_page_options(parser, None, "the first file's name with .html")
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        paths = list(map(Path, parsed.runs))
        runs = [Trajectory.load(path) for path in paths]
        written = parsed.output or str(paths[0].with_suffix(".html"))
        output.check_apart([written], parsed.runs)
        player_page(written, runs, [path.stem for path in paths], parsed.title)
        announce(written, parsed.open)


def add_page_options(parser: argparse.ArgumentParser, default: str | None, shown_default: str) -> None:
    """Add the options --output and --open of a page.

    Parameters
    ----------
    default : str or None
        Default name of the file.
    shown_default : str
        Default that the help text shows.
    """
    parser.add_argument("-o", "--output", default=default, metavar="FILE.html", help=f"file to write [{shown_default}]")
    parser.add_argument("--open", action="store_true", help="open the page in the browser")


def announce(name: str, show: bool) -> None:
    """Print the name and size of the file, and open it in the browser if `show`."""
    path = Path(name).resolve()
    print(output.wrap_text(f"{name}: {path.stat().st_size / 1000:.0f} kB, opens in any browser, needs no network"))
    if show:
        import webbrowser

        webbrowser.open(path.as_uri())
