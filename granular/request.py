"""What is asked of a run: the options that all engines share, checked once.
May be skipped: arguments, no physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular import _check
from granular import until as stop
from granular._check import Array
from granular.scene import Scene

EVENTS = 1_000_000
"""Contacts after which a run ends if nothing else is said."""


@dataclass(frozen=True)
class Request:
    """What is asked of a run by the options that all engines share; see `granular.md.simulate`."""

    start: float
    end: float
    until: stop.Until | None
    samples: Array | None
    log: bool
    max_events: int
    on_event: Callable[[Any], object] | None
    on_progress: Callable[[float, int], object] | None
    max_steps: int

    @property
    def rows(self) -> bool:
        """Whether anybody wants the rows of contacts."""
        return self.log or self.on_event is not None


def requested(
    scene: Scene, start: float, t_end: float | None, *, max_steps: int = _check.LARGEST, **given: Any
) -> Request:
    """Check the options that all engines share."""
    end = math.inf if t_end is None else _check.number("t_end", t_end, at_least=start, fix="t_start is the earliest")
    if end < end - start == math.inf:
        raise ValueError(f"t_end is {t_end!r}: a time is needed to which numbers reach from t_start = {start!r}.")
    return Request(
        start=start,
        end=end,
        until=stop.checked(given["until"], scene.n_pairs),
        samples=_sample_times(given["samples"], start, end),
        log=_check.truth("log", given["log"]),
        max_events=_check.whole("max_events", given["max_events"]),
        on_event=_check.callback("on_event", given["on_event"], "row"),
        on_progress=_check.callback("on_progress", given["on_progress"], "reached", "count"),
        max_steps=_check.whole("max_steps", max_steps, at_least=1),
    )


def check_end(
    scene: Scene, t_end: float | None, until: stop.Until | None, max_events: int, dented: bool = False
) -> None:
    """Raise if nothing says when a run is over whose balls may meet forever; `dented` if each bounces in its dent."""
    if (scene.endless or dented) and t_end is None and until is None and max_events == EVENTS:
        why = "beside a driven wall" if scene.driven else "beside a thermal wall" if scene.heated else (
            "on a ring" if scene.ring else "of pendula" if scene.pendulum > 0.0 else
            "under gravity, and laws that lose nothing within a dent once made,")  # fmt: skip
        raise ValueError(f"t_end is None: {why} a run never comes to an end by itself; give t_end, until, or a "
                         "max_events of your own.")  # fmt: skip


def _sample_times(samples: int | ArrayLike | None, start: float, end: float) -> Array | None:
    """Return the times of the rows in s, or None for the first and the last.

    Raises
    ------
    TypeError, ValueError
        If there is no time, or one outside [start, end], or one before its predecessor; if a number of rows is asked
        for without an end.
    """
    if samples is None:
        return None
    if np.ndim(samples) == 0:
        fix = "give None for the first and the last row"
        count = _check.whole("samples", samples, at_least=2, at_most=_check.MOST, fix=fix)
        if end == math.inf:
            raise ValueError(f"samples is {count}: a number of rows needs t_end; give t_end, or the times themselves.")
        return np.linspace(start, end, count)
    times = _check.array("samples", samples)
    if len(times) == 0:
        raise ValueError("samples is empty: at least one time is needed; give None for the first and the last row.")
    inside = (times >= start) & (times <= end) & np.isfinite(times)
    _check.every("samples", times, inside, f"a time from {start:g} to {end:g} s is needed")
    _check.every("samples", times[1:], np.diff(times) >= 0.0, "times must not decrease", "sort them")
    return times
