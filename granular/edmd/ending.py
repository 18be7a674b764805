"""Message and counters of a finished hard-sphere run."""

from __future__ import annotations

import math
from typing import Any

from granular._engine.records import column
from granular.edmd.motion import LATEST_TIME
from granular.run.trajectory import Status
from granular.run.until import raised

VERDICT_REASONS = {
    "exact": "body {ball} comes to rest on the wall after infinitely many bounces",
    "proved": "the {count} pairs collide in turn forever; rates left: {bound:.2g} m/s",
    "bounded": "unless hit from outside, none of their bodies will be faster than {bound:.2g} m/s",
}
"""Explanations of a verdict by its kind."""


def sentence(run: Any, status: Status, s: dict[str, Any], now: float) -> str:
    """Return the message of a run that ends at the time `now` in s.

    `s` are the numbers of the run.
    """
    verdict = run.verdict
    when = f"t = {now:.12g} s after {s['events']} collision{'s' * (s['events'] != 1)}"
    if verdict is not None:
        count = (verdict.last - verdict.first) % run.scene.n_pairs + 1
        ball = verdict.first + bool(run.scene.is_wall[verdict.first])
        numbers = {"ball": ball, "bound": verdict.bound, "count": "two" if count == 2 else count}
        why = VERDICT_REASONS[verdict.kind].format(**numbers)
        if verdict.bound == math.inf:
            why = "forces may pull them apart: how fast they will be is not known"
        what, fix = ("what may be an inelastic", "; give collapse='merge' to continue") if (
            status is Status.bounded) else ("inelastic", "")
        return f"{what} collapse of {verdict} at {when} ({verdict.kind}: {why}){fix}"
    walls = "" if run.closing is None else f"the walls close at t = {s['start'] + run.closing.after:.12g} s"
    if status is Status.collapse:
        said = f"{walls} and leave no way out: stopped at {when}, when no space was left"
    elif status is not Status.max_events:
        known = status is Status.time and not run.scene.driven and run.state.near is None
        said = f"{status.value}: {when}" + "; no collision can follow" * (known and run.queue.soonest() == math.inf)
    elif LATEST_TIME < run.state.time(run.queue.soonest()) < math.inf:
        said = f"{status.value}: {when}; the next one is later than {LATEST_TIME:.2g} s, where runs end"
    else:
        said = f"{status.value} ({raised('max_events', run.request.end)}): max_events reached at {when}"
        if math.isfinite(run.horizon):
            said += f"; {walls}, and collisions become ever more frequent until then"
        elif s["slow"] >= 0.0 or (run.scene.driven and s["merge_below"] == 0.0):
            said += run._closer.slowing(run, s["events"])
    if s["lost"] > 0:
        rates = f"{s['lost']} relative velocit{'y' if s['lost'] == 1 else 'ies'}"
        said += f"; {rates} fell below rounding: collisions that depend on them are uncertain"
    return said


def counters(run: Any, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the counters of a run and its verdict.

    The counters are collisions, clamped gaps, re-basings, uses of relative coordinates and lost rates.
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
