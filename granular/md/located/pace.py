"""How far a run goes between two looks at it, and whether it comes on: the net under contacts that creep or chatter.
May be skipped: limits, no physics.

Steps of laws that are functions are found by trial, and none is longer than the sharpest rate of the law allows. A
contact takes some tens of trials. One that is damped a thousand times too strongly creeps, and takes millions; so does
one that would rest where its force jumps. What has been found is right, but the end is out of reach.
"""

from __future__ import annotations

import math
from time import process_time
from typing import Any

from granular.drive import portion
from granular.md.located import blocks
from granular.md.located.at_rest import looked_at
from granular.md.located.records import MORE, OPEN, WANTS_LOOK

OWN, PLAIN, COMPILED = 8, 100, 20_000
"""Pieces between two looks at progress and log, at most: under laws that are functions, interpreted, compiled."""
AT_FIRST = 4000
"""Pieces of one pair before the first look."""
TRIALS = 4000
"""Trial steps of every island after which it is asked whether a run comes on."""
LEAST = 0.01
"""Part of the time left by which it then has come on, unless it has by the time of a contact."""


class Pace:
    """The portions in which a run of `located.run` goes on, and how hard they were.

    Attributes
    ----------
    stalled : bool
        Whether it does not come on.
    step : float
        Time in s by which it came on in a trial step, on the average.
    """

    def __init__(self, run: Any) -> None:
        self.run, self.chunk = run, max(1, min(PLAIN, AT_FIRST // run.scene.n_pairs))
        self.trials, self.time, self.step, self.stalled = 0, float(run.counters["t"]), 0.0, False
        self.seen = -math.inf  # s, how far the run had come at the last look

    def advanced(self, limit: float) -> int:
        """Advance by a chunk of pieces, with looks at blocks that may rest or creep; return as `blocks.advance`."""
        run, begun = self.run, process_time()
        most = COMPILED if run.engine == "compiled" else PLAIN if run.collocation is None else OWN
        self.chunk = min(most, self.chunk)
        for _ in range(PLAIN):
            why = int(run.kernels(blocks.advance)(run.s, limit, self.chunk, run.collocation))
            if why == WANTS_LOOK:
                why = looked_at(run.s, limit, run.kernels, run.seldom)
            if why != WANTS_LOOK:
                break
        self.chunk = portion(self.chunk, process_time() - begun)
        return MORE if why == WANTS_LOOK else why

    def stalls(self) -> bool:
        """Return whether a run under laws that are functions does not come on.

        One that stands at an instant is looked at: if its numbers ran out of range, it would stand there forever.
        """
        run = self.run
        if run.now == self.seen:
            run.row_after(run.now, run.now)  # raises then
        self.seen = run.now
        if run.collocation is None or run.collocation.trials < self.trials + TRIALS:
            return False
        swings, islands = swings_of(run.s)
        advance, tried = run.now - self.time, run.collocation.trials - self.trials
        self.trials, self.time, self.step = run.collocation.trials, run.now, advance / tried
        left = run.request.end - run.start - run.now
        self.stalled = advance * TRIALS * islands < tried * min(swings, LEAST * left)
        return self.stalled


def swings_of(s: Any) -> tuple[float, int]:
    """Return the shortest time in s in which a pair that overlaps swings alone, 0 if none does, and how many islands
    have such pairs."""
    touching = [(pair.first, s.pool[pair.slot]) for pair in s.pairs if pair.slot >= 0]
    touching = [(first, p) for first, p in touching if p.mode != OPEN and p.own_speed > 0.0]
    return min((p.own_length / p.own_speed for _, p in touching), default=0.0), len({first for first, _ in touching})
