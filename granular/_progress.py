"""How far some work has come, shown to who waits: a bar of tqdm where that is installed, else a line on stderr.
May be skipped: what is shown, no physics.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from importlib.util import find_spec
from threading import Event, Thread
from typing import TextIO

from granular import _check

PATIENCE, INTERVAL, SELDOM = 2.0, 0.5, 30.0
"""Seconds before the first line, between two that a person watches, and between two elsewhere, such as in a file."""
CLEAR = "\r\x1b[K"
Told = Callable[[float, int], object]
"""What is told how far work has come: time in s or share, and number of things done."""


def shown(
    progress: bool, on_progress: Told | None, things: str = "contacts", end: float = 1.0, start: float = 0.0
) -> AbstractContextManager[Told | None]:
    """Check both options of a verb that takes long; return what to tell, for as long as the work lasts."""
    tell = _check.callback("on_progress", on_progress, "reached", "count")
    return Progress(end, things, start, tell) if _check.truth("progress", progress) else nullcontext(tell)


class Progress:
    """Shows how far a run has come, and when it will have arrived; hands on what it is told.

    The line is also there while nothing is told, as before the first step of a large scene. On a terminal, and in a
    notebook, there is one line, which goes away at the end; elsewhere one line is written below the other.

    Parameters
    ----------
    end, start : float
        Times in s of a run; 1 and 0 for work of which shares are told. An infinite end is not known.
    things : str
        What is counted: "contacts" of a run, or parts of some work, such as "cells".
    tell : callable, optional
        Is told the same.
    stream : text stream, optional
        Where to write; default standard error.
    """

    def __init__(self, end: float, things: str = "contacts", start: float = 0.0, tell: Told | None = None,
                 stream: TextIO | None = None) -> None:
        self.end, self.things, self.start, self.tell = end, things, start, tell
        self.stream, self.last = stream or sys.stderr, (start, 0)
        self.over, self.writer = Event(), Thread(target=self._show, daemon=True)

    def __call__(self, reached: float, count: int) -> None:
        """Take note that a run has reached a time in s, or work a share of itself, with `count` things done."""
        self.last = reached, count
        if self.tell is not None:
            self.tell(reached, count)

    def share(self, reached: float) -> float:
        """How much is done, 0 if that is not known."""
        return min(1.0, (reached - self.start) / (self.end - self.start)) if self.end > self.start else 0.0

    def line(self, reached: float, count: int, elapsed: float) -> str:
        """The text for a run, or for other work, that has taken `elapsed` seconds so far."""
        run = self.things == "contacts"
        line = f"t = {reached:.6g} s, " * run + f"{count} {self.things}, {clock(elapsed)} so far"
        if share := self.share(reached):
            line += f", {share:.0%}" + f" of {self.end:.6g} s" * run
            line += f", at most {clock(elapsed * (1.0 / share - 1.0))} to go"
        return line

    def _show(self) -> None:
        """Show the line now and then; take it away at the end."""
        begin = time.monotonic()
        if self.over.wait(PATIENCE):
            return
        with _screen(self.stream) as (show, interval):
            while True:
                reached, count = self.last
                show(self.line(reached, count, time.monotonic() - begin), self.share(reached))
                if self.over.wait(interval):
                    return

    def __enter__(self) -> Progress:
        if self.stream is not None:  # None: closed by the shell's 2>&-
            self.writer.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Take the line away, however the run has ended."""
        self.over.set()
        if self.writer.ident is not None:
            self.writer.join()


@contextmanager
def _screen(stream: TextIO) -> Iterator[tuple[Callable[[str, float], object], float]]:
    """What shows a text and the share that is done, and how often, in s."""
    terminal = stream.isatty()
    if find_spec("tqdm") and (terminal or "ipykernel" in sys.modules):
        tqdm = import_module("tqdm.auto").tqdm
        with tqdm(total=1.0, bar_format="{bar} {desc}", leave=False, file=stream) as bar:

            def show(text: str, share: float) -> None:
                bar.n = share
                bar.set_description_str(text)

            yield show, INTERVAL
    else:
        before, after = (CLEAR, "") if terminal else ("granular: ", "\n")
        yield lambda text, _: print(before + text, end=after, file=stream, flush=True), INTERVAL if terminal else SELDOM
        print(CLEAR * terminal, end="", file=stream, flush=True)


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss or m:ss."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02d}:{s:02d}" if hours else f"{m}:{s:02d}"
