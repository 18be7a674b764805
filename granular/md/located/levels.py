"""Soft spheres between two events, for whom watches a pair or a ball. A run that is watched follows all contacts by
pieces, but where those that disturb each other are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from granular._engine.records import column
from granular.run.levels import shown
from granular.run.until import Level


def calm(run: Any) -> tuple[float, float]:
    """Return the time in s up to which a run has got, and that of the next event."""
    now, soonest = max(run.now, run.request.start - run.start), math.inf
    if run.creep is None:
        clock = column(run.s.pairs, "t")  # ahead where a contact was solved at once
        soonest = min(float(column(run.s.queue[1:2], "due")[0]), clock[clock > now].min(initial=math.inf))
    return run.start + now, run.start + soonest


def watched(run: Any, level: Level) -> Callable[[float], float]:
    """Return what is watched as a function of the time in s up to the next event."""
    return partial(shown, run, level)
