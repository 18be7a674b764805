"""A line of progress on stderr, for long runs that a person watches."""

from __future__ import annotations

import sys
import time
from typing import TextIO

PATIENCE, INTERVAL = 2.0, 0.5
"""Seconds before the first line, and between two."""


class Progress:
    """Callback for ``on_progress``: shows how far a run has come, and when it will have arrived.

    Parameters
    ----------
    t_end : float or None
        End time of the run in s; without it only the state is shown.
    stream : text stream
        Where to write; nothing is written unless it is a terminal.
    """

    def __init__(self, t_end: float | None, stream: TextIO | None = None) -> None:
        self.t_end = t_end
        self.stream = sys.stderr if stream is None else stream
        self.watched = self.stream.isatty()
        self.start = time.monotonic()
        self.next = self.start + PATIENCE
        self.shown = False

    def __call__(self, t: float, count: int) -> None:
        """Take note that the run has reached time `t` in s with `count` contacts."""
        now = time.monotonic()
        if not self.watched or now < self.next:
            return
        self.next, self.shown = now + INTERVAL, True
        self.stream.write(f"\r\x1b[K{self.line(t, count, now - self.start)}")
        self.stream.flush()

    def line(self, t: float, count: int, elapsed: float) -> str:
        """The text for a run that has taken `elapsed` seconds so far."""
        line = f"t = {t:.6g} s, {count} contacts, {clock(elapsed)} so far"
        if self.t_end and t > 0.0:
            share = min(1.0, t / self.t_end)
            line += f", {share:.0%} of {self.t_end:.6g} s, at most {clock(elapsed * (1.0 / share - 1.0))} to go"
        return line

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        """Clear the line, however the run has ended."""
        if self.shown:
            self.stream.write("\r\x1b[K")
            self.stream.flush()


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss or m:ss."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02d}:{s:02d}" if hours else f"{m}:{s:02d}"
