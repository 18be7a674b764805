"""Progress reporting on standard error.

A bar of tqdm if it is installed and standard error is a terminal, otherwise a line every 30 s.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from importlib.util import find_spec

from granular._engine import check

LINE_INTERVAL = 30.0
"""Time in s between two lines."""
BAR_DELAY = 2.0
"""Time in s before a bar is shown."""
BAR = "{l_bar}{bar}| {elapsed}<{remaining}{postfix}"
Told = Callable[[float, int], object]
"""Progress callback: time reached in s or share, and number of things done."""


def shown(
    progress: bool, on_progress: Told | None, things: str = "contacts", end: float = 1.0, start: float = 0.0
) -> AbstractContextManager[Told | None]:
    """Check both progress options of a function and provide the progress callback.

    Parameters
    ----------
    progress : bool
        Whether to show a bar or lines.
    on_progress : callable or None
        Callback of the user, which is called as well.
    things : str
        Things that are counted: "contacts" of a run, or parts of other work, such as "cells".
    end, start : float
        Times in s of a run, or 1 and 0 for work that reports its share. An infinite end is unknown.
    """
    tell = check.callback("on_progress", on_progress, "reached", "count")
    return _reported(tell, things, end, start) if check.truth("progress", progress) else nullcontext(tell)


@contextmanager
def _reported(tell: Told | None, things: str, end: float, start: float) -> Iterator[Told]:
    watched = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    tqdm = import_module("tqdm.auto").tqdm if watched and find_spec("tqdm") else None
    bar = tqdm and tqdm(total=1.0, bar_format=BAR, leave=False, delay=BAR_DELAY)
    begin = last = time.monotonic()

    def report(reached: float, count: int) -> None:
        nonlocal last
        share, now = (reached - start) / (end - start) if end > start else 0.0, time.monotonic()
        text = f"t = {reached:.6g} s, " * (things == "contacts") + f"{count} {things}"
        if bar is not None:
            bar.set_postfix_str(text, refresh=False)
            bar.update(min(share, 1.0) - bar.n)
        elif now - last >= LINE_INTERVAL:
            last = now
            left = f", {min(share, 1.0):.0%}, about {(now - begin) * (1.0 / share - 1.0):.0f} s left" if share else ""
            print(f"granular: {text}, {now - begin:.0f} s so far{left}", file=sys.stderr, flush=True)
        if tell is not None:
            tell(reached, count)

    try:
        yield report
    finally:
        if bar is not None:
            bar.close()
