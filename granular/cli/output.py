"""What a command shows and writes: files, offered, looked at before a long run, and written after it; and a line of
progress on stderr, for long runs that a person watches.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Event, Thread
from typing import Any, TextIO

from granular import _files
from granular._check import optional
from granular.cases.ready import is_file
from granular.export import files

PATIENCE, INTERVAL = 2.0, 0.5
"""Seconds before the first line, and between two."""
CLEAR = "\r\x1b[K"


ENDINGS = {"plot": "png", "film": "gif", "json": "json"}


def offer(parser: argparse.ArgumentParser, save_as: str = "npz", **about: str) -> None:
    """Add the options --plot, --film, --json and --save, as far as they are described."""
    for name, text in about.items():
        to_stdout = "; - for standard output" if name == "json" else ""
        ending = save_as if name == "save" else ENDINGS[name]
        parser.set_defaults(**{f"{name}_as": f".{ending}"})
        parser.add_argument(f"--{name}", metavar=f"FILE.{ending}", type=_stdout if to_stdout else str,
                            help=text + to_stdout)


def _stdout(name: str) -> str:
    """The file to write to; ``-`` is standard output."""
    return _files.STDOUT if name == "-" else name


def check(given: argparse.Namespace) -> None:
    """Raise if a file that is asked for cannot be written, or no figure be drawn in the format it has."""
    asked = [getattr(given, option, None) for option in ("plot", "film", "json", "save")]
    written = [name for name in asked if name is not None]
    for name in written:
        _check_writable(name)
    check_apart(written, [given.target] if given.target and is_file(given.target) else [])
    if getattr(given, "save", None) is not None:
        if given.save_as == ".npz":
            files.ending_of(given.save)
        else:
            _files.check_ending(given.save, given.save_as)
    if getattr(given, "plot", None) is not None:
        optional("matplotlib.backend_bases", "--plot")
        _files.check_picture(given.plot)
    if getattr(given, "film", None) is not None:
        optional("matplotlib.animation", "--film")
        from granular._films import check_film

        check_film(given.film)


def check_apart(written: Sequence[str], read: Sequence[str]) -> None:
    """Raise if a file that is to be written is one that is read, or one that is to be written already."""
    taken = set(map(os.path.realpath, read))
    for name in written:
        if os.path.realpath(name) in taken and not _files.is_stream(name):
            raise ValueError(f"{name}: is read or written by this command already; a file of its own is needed.")
        taken.add(os.path.realpath(name))


def deliver(report: Any, given: argparse.Namespace) -> None:
    """Print a report, on stderr if stdout is to have nothing but JSON; draw and write it where that is asked."""
    print(report, file=sys.stderr if given.json == _files.STDOUT else sys.stdout)
    if getattr(given, "plot", None) is not None:
        report.plot(given.plot)
    if getattr(given, "film", None) is not None:
        report.animate(given.film)
    if given.json is not None:
        report.to_json(given.json)


def _check_writable(name: str) -> None:
    if _files.is_stream(name) and os.access(name, os.W_OK) and not os.path.isdir(name):
        return
    path, folder = Path(os.path.realpath(name)), str(Path(name).parent)
    if path.is_dir():
        raise ValueError(f"{name}: is a directory; the name of a file is needed.")
    if not path.parent.is_dir():
        raise ValueError(f"{name}: there is no directory {folder!r}; make it first.")
    if path.exists() and not os.access(path, os.W_OK):
        raise ValueError(f"{name}: the file is there and may not be changed.")
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise ValueError(f"{name}: no file can be made in {folder!r}: {error.strerror}.") from None


class Progress:
    """Callback for ``on_progress``: shows how far a run has come, and when it will have arrived.

    The line is also there while nothing is told, as before the first step of a large scene.

    Parameters
    ----------
    end : float or None
        End time of the run in s; without it only the state is shown. 1 for work of which shares are told.
    stream : text stream
        Where to write; nothing is written unless it is a terminal.
    things : str
        What is counted: "contacts" of a run, or parts of some work, such as "cells".
    """

    def __init__(self, end: float | None, stream: TextIO | None = None, things: str = "contacts") -> None:
        self.end, self.things, self.stream = end, things, stream or sys.stderr
        self.last = (0.0, 0)
        self.over, self.writer = Event(), Thread(target=self._show, daemon=True)

    def __call__(self, reached: float, count: int) -> None:
        """Take note that a run has reached a time in s, or work a share of itself, with `count` things done."""
        self.last = reached, count

    def line(self, reached: float, count: int, elapsed: float) -> str:
        """The text for a run, or for other work, that has taken `elapsed` seconds so far."""
        run = self.things == "contacts"
        line = f"t = {reached:.6g} s, " * run + f"{count} {self.things}, {clock(elapsed)} so far"
        if self.end and reached > 0.0:
            share = min(1.0, reached / self.end)
            line += f", {share:.0%}" + f" of {self.end:.6g} s" * run
            line += f", at most {clock(elapsed * (1.0 / share - 1.0))} to go"
        return line

    def _show(self) -> None:
        """Write the line now and then; clear it at the end."""
        start, text = time.monotonic(), ""
        while not self.over.wait(INTERVAL if text else PATIENCE):
            text = self.line(*self.last, time.monotonic() - start)
            print(CLEAR + text, end="", file=self.stream, flush=True)
        if text:
            print(CLEAR, end="", file=self.stream, flush=True)

    def __enter__(self) -> Progress:
        if self.stream is not None and self.stream.isatty():  # None: closed by the shell's 2>&-
            self.writer.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Clear the line, however the run has ended."""
        self.over.set()
        if self.writer.ident is not None:
            self.writer.join()


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss or m:ss."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02d}:{s:02d}" if hours else f"{m}:{s:02d}"
