"""A line of progress on stderr, for long runs that a person watches.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import sys
import time
from threading import Event, Thread
from typing import TextIO

PATIENCE, INTERVAL = 2.0, 0.5
"""Seconds before the first line, and between two."""
CLEAR = "\r\x1b[K"


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
