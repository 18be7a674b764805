"""Progress reports on standard error.

A report is a bar if tqdm is installed and standard error is a terminal or a notebook. Otherwise it is a line every
30 s.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from importlib.util import find_spec

from granular._engine import check
from granular._engine.callables import callback

LINE_INTERVAL = 30.0
"""Time in s between two lines."""
BAR_DELAY = 2.0
"""Time in s before a bar is shown."""
BAR_FORMAT = "{l_bar}{bar}| {elapsed}<{remaining}{postfix}"
ProgressCallback = Callable[[float, int], object]
"""Progress callback: time (s) or completed fraction, and number of things done."""


def progress_callback(
    progress: bool, on_progress: ProgressCallback | None, things: str = "contacts", end: float = 1.0, start: float = 0.0
) -> AbstractContextManager[ProgressCallback | None]:
    """Return a context manager that yields the progress callback of a computation.

    The callback shows the progress, if this is enabled, and calls the callback of the user. It is None if neither is
    required. Both options are checked.

    Parameters
    ----------
    progress : bool
        Whether to show a bar or lines.
    on_progress : callable or None
        Callback of the user.
    things : str
        Things that are counted: "contacts" of a run, or parts of other work, such as "cells".
    end, start : float
        End and start of a run in s, or 1 and 0 for work that reports its completed fraction. inf means that the end is
        unknown.
    """
    report = callback("on_progress", on_progress, "reached", "count")
    return _reported(report, things, end, start) if check.boolean("progress", progress) else nullcontext(report)


@contextmanager
def _reported(callback: ProgressCallback | None, things: str, end: float, start: float) -> Iterator[ProgressCallback]:
    """Yield a function that shows the progress and calls `callback`.

    See `progress_callback`.
    """
    is_interactive = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    tqdm = import_module("tqdm.auto").tqdm if is_interactive and find_spec("tqdm") else None
    bar = tqdm and tqdm(total=1.0, bar_format=BAR_FORMAT, leave=False, delay=BAR_DELAY)
    begin = last = time.monotonic()

    def report(reached: float, count: int) -> None:
        """Show the progress, and call the callback of the user.

        `reached` is the time of a run in s, or the finished fraction of other work. `count` is the number of `things`
        done. The progress is shown on the bar, or without a bar as a line on stderr every `LINE_INTERVAL`.
        """
        nonlocal last
        fraction, now = (reached - start) / (end - start) if end > start else 0.0, time.monotonic()
        text = f"t = {reached:.6g} s, " * (things == "contacts") + f"{count} {things}"
        if bar is not None:
            bar.set_postfix_str(text, refresh=False)
            bar.update(min(fraction, 1.0) - bar.n)
        elif now - last >= LINE_INTERVAL:
            last = now
            remaining = (f", {min(fraction, 1.0):.0%}, about {(now - begin) * (1.0 / fraction - 1.0):.0f} s left"
                         if fraction else "")
            print(f"granular: {text}, {now - begin:.0f} s so far{remaining}", file=sys.stderr, flush=True)
        if callback is not None:
            callback(reached, count)

    try:
        yield report
    finally:
        if bar is not None:
            bar.close()
