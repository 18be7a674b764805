"""Observables of soft spheres between two events, for stop conditions on levels.

Stop conditions on levels are `granular.until.speed`, `position` and `force`. A run with such a condition integrates all
contacts by pieces, unless disturbed contacts are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from granular._engine.records import column
from granular.run.levels import observable_value
from granular.run.until import Level


def calm(run: Any) -> tuple[float, float]:
    """Return the time in s that a run has reached, and the time of its next event.

    In between, all motion is smooth.
    """
    now = max(run.now, run.request.start - run.start)
    clock = column(run.s.pairs, "t")  # ahead if a contact was solved as one event
    next_event = min(float(column(run.s.queue[1:2], "due")[0]), clock[clock > now].min(initial=math.inf))
    return run.start + now, run.start + next_event


def watched(run: Any, level: Level) -> Callable[[float], float]:
    """Return the observable of a level as a function of the time in s.

    The function is valid up to the next event, and does not advance the run.
    """
    return partial(observable_value, run, level)
