"""How far a run goes between two looks at it, and whether it comes on; `run` is one of `located.run`.

Steps of laws that are functions are found by trial, and none is longer than the sharpest rate of the law allows. A
contact takes some tens of trials. One that is damped a thousand times too strongly creeps, and takes millions; so does
one that would rest where its force jumps. What has been found is right, but the end is out of reach.
"""

from __future__ import annotations

import math
from time import process_time
from typing import Any

from granular._engine.kernels import Toll, compiled
from granular._engine.records import column
from granular.md.located import blocks
from granular.md.located.plan import plan_all_due
from granular.md.located.records import (
    ASKS,
    BINDING,
    MORE,
    OPEN,
    QUIET,
    REACHED,
    REST,
    STOPPED,
    WANTS_LOOK,
    WORK_LIMIT,
)
from granular.md.located.rest.equilibrium import NOT_YET, RESTS
from granular.md.located.rest.overdamped import look_at, turn_to_asking
from granular.md.located.system import readable
from granular.run.drive import Pause, portion

OWN, PLAIN, COMPILED = 8, 100, 20_000
"""Pieces between two looks at progress and log, at most: under laws that are functions, interpreted, compiled."""
AT_FIRST = 4000
"""Pieces of one pair before the first look."""
TRIALS = 4000
"""Trial steps of every island after which it is asked whether a run comes on."""
LEAST = 0.01
"""Part of the time left by which it then has come on, unless it has by the time of a contact."""
WHY = {STOPPED: Pause.until, QUIET: Pause.quiet, WORK_LIMIT: Pause.work, REST: Pause.resting, BINDING: Pause.quiet}
"""Why a run pauses, by what `blocks.advance` returns."""
LOADING_LOOK, MAKING_LOOK = 0.1, 5.0
"""Seconds that it takes to load machine code that looks at blocks that may rest or creep, and to make it."""


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
        self.begun = 0.0  # s of processor time at the end of the last portion, if there was one that did not do
        self.seen = -math.inf  # s, how far the run had come at the last look

    def advanced(self, limit: float, last: bool) -> int:
        """Advance by a chunk of pieces, with looks at blocks that may rest or creep; return as `blocks.advance`.

        A run that its limits end before what is due next ends before a row (not the `last`) is shown later.
        """
        run = self.run
        most = COMPILED if run.engine == "compiled" else PLAIN if run.collocation is None else OWN
        self.chunk = min(1 if run.request.singly else most, self.chunk)
        for _ in range(PLAIN):
            why = int(run.kernels(blocks.advance)(run.s, limit, self.chunk, run.collocation))
            if why == WANTS_LOOK:
                why = looked_at(run.s, limit, run.kernels, self.seldom)
            if why != WANTS_LOOK:
                break
        if why in (MORE, WANTS_LOOK):
            begun, self.begun = self.begun, process_time()
            if begun > 0.0:
                self.chunk = portion(self.chunk, self.begun - begun)
            return MORE
        if why == REACHED and not last:
            c, due, left = run.counters, run.s.queue[1]["due"], run.request.end - run.start
            spent = due <= left and (c["contacts"] >= c["max_events"] or c["steps"] >= c["max_steps"])
            if spent and not (c["separated"] and c["contacts"] > 0 and self.seldom(blocks.all_recede)(run.s)):
                return WORK_LIMIT
        return why

    def look_at_all(self) -> None:
        """Plan the blocks that wait for a look whether they creep."""
        run = self.run
        while (column(run.s.pool, "manner") == ASKS).any() and run.kernels(turn_to_asking)(run.s):
            looked_at(run.s, 0.0, run.kernels, self.seldom)

    def seldom(self, kernel: Any) -> Any:
        """Return a kernel that is called seldom: also of a compiled run interpreted, until that does not pay."""
        run = self.run
        return run.kernels(kernel) if run.is_plain else seldom(run.fit(kernel), compiled)

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


def looked_at(s: Any, limit: float, kernels: Any, seldom: Any) -> int:
    """Look at the block under way, by `kernels` and by those that are called `seldom`; return why a run up to time
    `limit` ends, or WANTS_LOOK if it goes on."""
    found = seldom(look_at)(s, limit)
    if found != NOT_YET:
        return REST if found == RESTS else BINDING
    return WANTS_LOOK if kernels(plan_all_due)(s, None) else STOPPED


def seldom(kernel: Any, kernels: Any) -> Any:
    """Return a kernel of a compiled run that is called seldom: interpreted, until this process has spent as long on it
    as machine code takes, which `kernels` makes."""
    toll = Toll(kernel, LOADING_LOOK, MAKING_LOOK)
    if toll.due():
        return kernels(kernel)

    def look(s: Any, *more: Any) -> Any:
        found = kernel(readable(s), *more)
        toll.lap()
        return found

    return look
