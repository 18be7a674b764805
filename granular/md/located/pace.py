"""Whether a run under laws that are functions comes on: the net under contacts that creep, or whose force jumps at rest.
May be skipped: limits, no physics.

Steps of such laws are found by trial, and none is longer than the sharpest rate of the law allows. A contact takes some
tens of trials. One that is damped a thousand times too strongly creeps, and takes millions; so does one that would rest
where its force jumps. Nothing is wrong with what has been found so far, but the end is out of reach.
"""

from __future__ import annotations

import math
from typing import Any

from granular.md.located.records import OPEN

TRIALS = 4000
"""Trial steps of every island between two looks."""
LEAST = 0.01
"""Part of the time left that a run has to come on between two looks, unless it comes on by the time of a contact."""


class Pace:
    """How far a run has come since the last look, beside how hard it was."""

    def __init__(self, start: float) -> None:
        self.trials, self.time, self.step = 0, start, math.nan

    def stalls(self, trials: int, time: float, left: float, s: Any) -> bool:
        """Return whether a run does not come on, after so many trials, at a time in s, with so much time left."""
        if trials < self.trials + TRIALS:
            return False
        swings, islands = swings_of(s)
        advance, tried = time - self.time, trials - self.trials
        self.trials, self.time, self.step = trials, time, advance / tried
        return advance * TRIALS * islands < tried * min(swings, LEAST * left)


def swings_of(s: Any) -> tuple[float, int]:
    """Return the shortest time in s in which a pair that overlaps swings alone, 0 if none does, and how many islands
    have such pairs."""
    touching = [(pair.first, s.pool[pair.slot]) for pair in s.pairs if pair.slot >= 0]
    touching = [(first, p) for first, p in touching if p.mode != OPEN and p.own_speed > 0.0]
    return min((p.own_length / p.own_speed for _, p in touching), default=0.0), len({first for first, _ in touching})
