"""Portions in which a run is advanced, and detection of runs without progress.

`run` is a `located.run.Run`. Under general laws the steps are found by trial, and no step is longer than the sharpest
change of the law allows. A normal contact needs a few tens of trials. A contact that is damped a thousand times too
strongly creeps and needs millions, as does a contact that rests where its force jumps. The results so far are correct,
but the end of the run is out of reach.
"""

from __future__ import annotations

import math
from time import process_time
from typing import Any

from granular._engine.kernels import CompilationCost, compiled, kernel
from granular._engine.records import column
from granular.md.located import blocks
from granular.md.located.plan import plan_all_due
from granular.md.located.records import (
    BINDING,
    MORE,
    NEEDS_CREEP_TEST,
    OPEN,
    QUIET,
    REACHED,
    REST,
    STOPPED,
    WANTS_REST_TEST,
    WORK_LIMIT,
)
from granular.md.located.rest.equilibrium import NOT_YET, RESTS
from granular.md.located.rest.overdamped import examine_island
from granular.md.located.system import record_views
from granular.run.drive import Pause, next_portion

MAX_PIECES_GENERAL, MAX_PIECES_INTERPRETED, MAX_PIECES_COMPILED = 8, 100, 20_000
"""Maximum number of pieces per portion: general laws, interpreted, compiled."""
FIRST_PORTION_PIECES = 4000
"""Number of pieces in the first portion, for a scene of one pair.

It is divided by the number of pairs."""
TRIALS_PER_TEST = 4000
"""Number of trial steps per island between two tests of the progress of a run."""
MIN_PROGRESS_SHARE = 0.01
"""Minimum progress between two tests, as a fraction of the time left.

A progress by the period of a contact is sufficient, too."""
PAUSE_REASONS = {
    STOPPED: Pause.until,
    QUIET: Pause.quiet,
    WORK_LIMIT: Pause.work,
    REST: Pause.resting,
    BINDING: Pause.quiet,
}
"""Reason of a pause for the return codes of `blocks.advance` that end a run."""
TEST_LOAD_SECONDS, TEST_COMPILE_SECONDS = 0.1, 5.0
"""Times in s to load and to compile the kernels that test for rest or creep."""


class Pace:
    """Portions in which a `located.run.Run` is advanced, and tests of its progress.

    Attributes
    ----------
    stalled : bool
        Whether the last test found that the run makes no progress.
    step : float
        Mean advance in s per trial step between the last two tests.
    """

    def __init__(self, run: Any) -> None:
        self.run, self.chunk = run, max(1, min(MAX_PIECES_INTERPRETED, FIRST_PORTION_PIECES // run.scene.n_pairs))
        self.trials, self.time, self.step, self.stalled = 0, float(run.counters["t"]), 0.0, False
        self.begun = 0.0  # processor time in s at the end of the last incomplete portion, else 0
        self.seen = -math.inf  # time in s at the last test

    def advance_portion(self, limit: float, last: bool) -> int:
        """Advance the run by a portion of pieces, up to the time `limit` at most.

        `limit` is in s since the start of the run. Blocks that are possibly at rest or creeping are tested. Returns the
        return code of `blocks.advance`. If the work limit is reached and another event is due within the run, the run
        ends before the sample at `limit`. The `last` sample is an exception. A run that is to stop once all balls
        separate does not reach its work limit if they already recede: it meets its stop condition.
        """
        run = self.run
        largest_chunk = (
            MAX_PIECES_COMPILED
            if run.engine == "compiled"
            else MAX_PIECES_INTERPRETED
            if run.collocation is None
            else MAX_PIECES_GENERAL
        )
        self.chunk = min(1 if run.request.singly else largest_chunk, self.chunk)
        # every test for rest or creep returns here: the limit keeps a portion short
        for _ in range(MAX_PIECES_INTERPRETED):
            code = int(run.kernels(blocks.advance)(run.s, limit, self.chunk, run.collocation))
            if code == WANTS_REST_TEST:
                code = test_current_block(run.s, limit, run.kernels, self.rare_kernel)
            if code != WANTS_REST_TEST:
                break
        if code in (MORE, WANTS_REST_TEST):
            previous, self.begun = self.begun, process_time()
            if previous > 0.0:
                self.chunk = next_portion(self.chunk, self.begun - previous)
            return MORE
        if code == REACHED and not last:
            c, due, time_left = run.counters, run.s.queue[1]["due"], run.request.end - run.start
            is_spent = due <= time_left and (c["contacts"] >= c["max_events"] or c["steps"] >= c["max_steps"])
            if is_spent and not (c["separated"] and c["contacts"] > 0 and self.rare_kernel(blocks.all_recede)(run.s)):
                return WORK_LIMIT
        return code

    def test_all_for_creep(self) -> None:
        """Test all blocks that have to be tested for creep, and plan their next pieces."""
        run = self.run
        while (column(run.s.pool, "manner") == NEEDS_CREEP_TEST).any() and run.kernels(select_island_to_test)(run.s):
            test_current_block(run.s, 0.0, run.kernels, self.rare_kernel)

    def rare_kernel(self, kernel: Any) -> Any:
        """Return the compiled or the interpreted version of a rarely called kernel.

        In a compiled run it is interpreted until compilation pays off.
        """
        run = self.run
        return run.kernels(kernel) if run.is_plain else rarely_called_kernel(run.fit(kernel), compiled)

    def stalls(self) -> bool:
        """Return whether a run under general laws makes no progress.

        If the time has not advanced since the last call, the current state is evaluated. This raises an exception if
        numbers are out of range, in which case the run would never advance.
        """
        run = self.run
        if run.now == self.seen:
            run.row_after(run.now, run.now)  # raises then
        self.seen = run.now
        if run.collocation is None or run.collocation.trials < self.trials + TRIALS_PER_TEST:
            return False
        period, islands = period_and_island_count(run.s)
        advance, trials = run.now - self.time, run.collocation.trials - self.trials
        self.trials, self.time, self.step = run.collocation.trials, run.now, advance / trials
        time_left = run.request.end - run.start - run.now
        # progress per `TRIALS_PER_TEST` steps of every island
        self.stalled = advance * TRIALS_PER_TEST * islands < trials * min(period, MIN_PROGRESS_SHARE * time_left)
        return self.stalled


def period_and_island_count(s: Any) -> tuple[float, int]:
    """Return the shortest period in s of an overlapping pair, and a number of islands.

    The period is the typical overlap of the pair divided by its typical speed, or 0 if no pair overlaps. Only islands
    with overlapping pairs are counted.
    """
    touching = [(pair.first, s.pool[pair.slot]) for pair in s.pairs if pair.slot >= 0]
    touching = [(first, p) for first, p in touching if p.mode != OPEN and p.own_speed > 0.0]
    return min((p.own_length / p.own_speed for _, p in touching), default=0.0), len({first for first, _ in touching})


@kernel
def select_island_to_test(s: Any) -> bool:
    """Make the first island that has to be tested for creep the current island.

    Returns False if there is none.
    """
    for c in range(len(s.pairs)):
        pair = s.pairs[c]
        if pair.first == c and pair.slot >= 0 and s.pool[pair.slot].manner == NEEDS_CREEP_TEST:
            s.run[0].lo = c
            return True
    return False


def test_current_block(s: Any, limit: float, kernels: Any, rare_kernel: Any) -> int:
    """Test the current block, which starts with pair `run.lo`, for rest and creep.

    `kernels` and `rare_kernel` return the version of a kernel that is called often or rarely. `limit` is the time in s
    up to which the run is advanced. Returns REST or BINDING if the run ends, STOPPED if it stops before a contact, or
    WANTS_REST_TEST to continue.
    """
    result = rare_kernel(examine_island)(s, limit)
    if result != NOT_YET:
        return REST if result == RESTS else BINDING
    return WANTS_REST_TEST if kernels(plan_all_due)(s, None) else STOPPED


def rarely_called_kernel(kernel: Any, kernels: Any) -> Any:
    """Return the version of a kernel that is called rarely in a compiled run.

    It is interpreted until this process has spent as much time on it as compilation takes. Then `kernels` compiles it.
    """
    toll = CompilationCost(kernel, TEST_LOAD_SECONDS, TEST_COMPILE_SECONDS)
    if toll.due():
        return kernels(kernel)

    def interpreted_kernel(s: Any, *more: Any) -> Any:
        result = kernel(record_views(s), *more)
        toll.lap()
        return result

    return interpreted_kernel
