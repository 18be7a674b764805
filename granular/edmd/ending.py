"""End of a hard-sphere run: last sample, message, counters and saved state."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from granular._engine.records import SMALL_RECORD_COUNT, column
from granular.edmd import hanging
from granular.edmd.checkpoint import checkpoint
from granular.edmd.epoch import LATEST_TIME
from granular.run.drive import End, Pause
from granular.run.trajectory import Status
from granular.run.until import raised

VERDICT_REASONS = {
    "exact": "ball {ball} comes to rest after infinitely many bounces",
    "proved": ("the {count} pairs collide in turn forever, at speeds of at most {bound:.2g} m/s relative to their "
               "common motion"),
    "bounded": "unless hit from outside, none of their balls will be faster than {bound:.2g} m/s",
}
"""Parts of the message that explain a collapse, by the kind of its `Verdict`."""


def end_of_run(run: Any, pause: Pause, seen: float) -> End:
    """Finish the run and return its `End`, with all data needed to continue it.

    `pause` is the reason why the run ends. `seen` is the time in s of the last sample, or -inf if the state at the
    end has to be returned in any case.
    """
    now, status = run.time(), Status.collapse if run.at_rest else pause.value
    stop = run.request.end if pause is Pause.reached else now
    wanted = seen == -math.inf or (pause is not Pause.reached and (
        stop > seen or (seen == run.request.start and run.events > 0)))  # at the start: the initial state
    row, numbers = run.row(stop) if wanted else None, run.state.numbers()
    if run.scene.pendulum > 0.0 and not run.keeps_rows:
        hanging.set_swing(run.state, run.scene, run.row(now))
    when = now if math.isnan(run.ended) else run.ended
    message, stats, more = end_message(run, status, numbers, when), counters(run, numbers), run.physics.options
    if run.at_rest and run.verdict is not None:
        more = more | {"collapse_time": run.ended, "collapse_pair": run.verdict.first}
    if run.watch is not None:
        message, stats = message + run.watch.message(), stats | run.watch.stats()
        more = more | run.watch.checkpoint(run.state, run.queue)
    state = partial(checkpoint, run.state, numbers, more)
    # arrays save memory
    return End(row, status, message, stats, state if run.scene.n <= SMALL_RECORD_COUNT else state())


def end_message(run: Any, status: Status, run_numbers: dict[str, Any], now: float) -> str:
    """Return the message of a run that ends at the time `now` in s.

    `run_numbers` contains the numbers of the run by name, see `State.numbers`.
    """
    verdict = run.verdict
    when = f"t = {now:.6g} s after {run_numbers['events']} collision{'s' * (run_numbers['events'] != 1)}"
    if verdict is not None:
        count = (verdict.last - verdict.first) % run.scene.n_pairs + 1
        ball = verdict.first + bool(run.scene.is_wall[verdict.first])
        numbers = {"ball": ball, "bound": verdict.bound, "count": "two" if count == 2 else count}
        reason = VERDICT_REASONS[verdict.kind].format(**numbers)
        if verdict.bound == math.inf:
            reason = "forces can pull them apart, so no bound on their speed is known"
        kind, advice = ("possible inelastic", "; give collapse='merge' to continue") if (
            status is Status.bounded) else ("inelastic", "")
        return f"{kind} collapse of {verdict.where(run.scene)} at {when}: {reason} ({verdict.kind}){advice}"
    walls = "" if run.closing is None else f"the walls close at t = {run_numbers['start'] + run.closing.after:.12g} s"
    if status is Status.collapse:
        message = f"{walls} and leave no room for the balls, so the run stopped at {when}"
    elif status is not Status.max_events:
        is_known = status is Status.time and not run.scene.driven and run.state.near is None
        message = f"{status.value} at {when}"
        message += "; no further collision is possible" * (is_known and run.queue.soonest() == math.inf)
    elif LATEST_TIME < run.state.time(run.queue.soonest()) < math.inf:
        message = (
            f"{status.value} at {when}; the next collision is later than {LATEST_TIME:.2g} s, the latest time of a run"
        )
    else:
        message = f"{status.value} at {when}; {raised('max_events', run.request.end)}"
        if math.isfinite(run.horizon):
            message += f"; {walls}, and the rate of collisions grows without limit until then"
        elif run_numbers["slow"] >= 0.0 or (run.scene.driven and run_numbers["merge_below"] == 0.0):
            message += run._collapse_module.slowing_message(run, run_numbers["events"])
    if run_numbers["lost"] > 0:
        rates = f"{run_numbers['lost']} relative velocit{'y' if run_numbers['lost'] == 1 else 'ies'}"
        message += f"; {rates} fell below the rounding error, so collisions that depend on them are uncertain"
    return message


def counters(run: Any, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of ``stats`` of a finished run.

    The entries are the engine, collisions, gaps set to 0 after rounding, moves of the epoch, uses of relative
    coordinates, collisions in them, and rates lost to rounding. Further entries exist only if they apply: balls
    brought to rest, merged balls, the limit `merge_below`, the impulses (N s) of thermal walls, and the classification
    of a collapse with its pairs, bound (m/s) and time (s).
    """
    verdict = run.verdict
    names = ["events", "clamps", "rebases", "zooms", "zoomed", "lost", *["settled"] * (numbers["settled"] > 0),
             *["merge_below"] * (numbers["merge_below"] > 0.0),
             *["merged"] * (max(numbers["merge_below"], numbers["merged"]) > 0)]
    counts: dict[str, Any] = {"engine": run.queue.name} | dict(zip(names, map(numbers.__getitem__, names), strict=True))
    if run.scene.heated:
        given, low = (column(run.state.walls.sides, name) for name in ("given", "given_low"))
        counts["given"] = tuple((given + low).tolist())
    if verdict is not None:
        counts |= {"verdict": verdict.kind, "pairs": (verdict.first, verdict.last), "bound": verdict.bound,
                   "collapse_time": run.ended}
    return counts
