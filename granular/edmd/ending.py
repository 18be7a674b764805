"""Message and counters of a finished hard-sphere run."""

from __future__ import annotations

import math
from typing import Any

from granular._engine.records import column
from granular.edmd.motion import LATEST_TIME
from granular.run.trajectory import Status
from granular.run.until import raised

VERDICT_REASONS = {
    "exact": "ball {ball} comes to rest after infinitely many bounces",
    "proved": "the {count} pairs collide in turn forever, with relative velocities of at most {bound:.2g} m/s",
    "bounded": "unless hit from outside, none of their balls will be faster than {bound:.2g} m/s",
}
"""Explanations of a verdict by its kind."""


def sentence(run: Any, status: Status, s: dict[str, Any], now: float) -> str:
    """Return the message of a run that ends at the time `now` in s.

    `s` are the numbers of the run.
    """
    verdict = run.verdict
    when = f"t = {now:.6g} s after {s['events']} collision{'s' * (s['events'] != 1)}"
    if verdict is not None:
        count = (verdict.last - verdict.first) % run.scene.n_pairs + 1
        ball = verdict.first + bool(run.scene.is_wall[verdict.first])
        numbers = {"ball": ball, "bound": verdict.bound, "count": "two" if count == 2 else count}
        why = VERDICT_REASONS[verdict.kind].format(**numbers)
        if verdict.bound == math.inf:
            why = "forces may pull them apart, so no bound on their speed is known"
        what, fix = ("possible inelastic", "; give collapse='merge' to continue") if (
            status is Status.bounded) else ("inelastic", "")
        return f"{what} collapse of {verdict.where(run.scene)} at {when}: {why} ({verdict.kind}){fix}"
    walls = "" if run.closing is None else f"the walls close at t = {s['start'] + run.closing.after:.12g} s"
    if status is Status.collapse:
        said = f"{walls} and leave no room for the balls, so the run stopped at {when}"
    elif status is not Status.max_events:
        known = status is Status.time and not run.scene.driven and run.state.near is None
        said = f"{status.value} at {when}"
        said += "; no further collision is possible" * (known and run.queue.soonest() == math.inf)
    elif LATEST_TIME < run.state.time(run.queue.soonest()) < math.inf:
        said = (
            f"{status.value} at {when}; the next collision is later than {LATEST_TIME:.2g} s, the latest time of a run"
        )
    else:
        said = f"{status.value} at {when}; {raised('max_events', run.request.end)}"
        if math.isfinite(run.horizon):
            said += f"; {walls}, and the rate of collisions grows without limit until then"
        elif s["slow"] >= 0.0 or (run.scene.driven and s["merge_below"] == 0.0):
            said += run._closer.slowing(run, s["events"])
    if s["lost"] > 0:
        rates = f"{s['lost']} relative velocit{'y' if s['lost'] == 1 else 'ies'}"
        said += f"; {rates} fell below the rounding error, so collisions that depend on them are uncertain"
    return said


def counters(run: Any, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the counters of a run and its verdict.

    The entries are the engine, collisions, clamped gaps, re-basings, uses of relative coordinates, collisions in them,
    and lost rates. Further entries exist only where they apply: balls brought to rest, merged balls, the impulses (N
    s) of thermal walls, and the verdict on a collapse with its pairs, bound (m/s) and time (s).
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
