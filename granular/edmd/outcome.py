"""How a run ended, in one sentence with its numbers, and the account of the work done; `run` is one of `edmd.run`.
May be skipped: words and numbers of what is computed elsewhere.
"""

from __future__ import annotations

import math
from typing import Any

from granular._records import column
from granular.edmd import collapse
from granular.edmd.epoch import LATEST
from granular.trajectory import Status

WHY = {
    "exact": "body {above} comes to rest on the wall after infinitely many bounces",
    "proved": "the {count} pairs collide in turn forever; rates left: {bound:.2g} m/s",
    "bounded": "unless hit from outside, none of their bodies will be faster than {bound:.2g} m/s",
}
"""What a verdict says, by its kind."""


def message(run: Any, status: Status, s: dict[str, Any]) -> str:
    """Return the sentence to print; `s` are the numbers of the run."""
    verdict = run.verdict
    when = f"t = {run.time():.12g} s after {s['events']} collision{'s' * (s['events'] != 1)}"
    if verdict is not None:
        count = (verdict.last - verdict.first) % run.scene.n_pairs + 1
        numbers = {"above": verdict.first + 1, "bound": verdict.bound, "count": "two" if count == 2 else count}
        why = WHY[verdict.kind].format(**numbers)
        if verdict.bound == math.inf:
            why = "forces may pull them apart: how fast they will be is not known"
        what = "what may be an inelastic" if status is Status.bounded else "inelastic"
        return f"{what} collapse of {verdict} at {when} ({verdict.kind}: {why})"
    walls = f"the walls close at t = {s['start'] + run.closing.after:.12g} s"
    if status is Status.collapse:
        sentence = f"{walls} and leave no way out: stopped at {when}, when no space was left"
    elif status is not Status.max_events:
        over = status is Status.time and not run.scene.driven and run.queue.soonest() == math.inf
        end = "; no collision can follow" if over else ""
        sentence = f"{status.value}: {when}{end}"
    elif LATEST < run.state.time(run.queue.soonest()) < math.inf:
        sentence = f"{status.value}: {when}; the next one is later than {LATEST:.2g} s, where runs end"
    else:
        sentence = f"{status.value}: max_events reached at {when}"
        if math.isfinite(run.horizon):
            sentence += f"; {walls}, and collisions become ever more frequent until then"
        elif s["slow"] >= 0.0 or (run.scene.driven and s["merge_below"] == 0.0):
            sentence += _slowing(run, s["events"])
    if s["lost"] > 0:
        rates = f"{s['lost']} relative velocit{'y' if s['lost'] == 1 else 'ies'}"
        sentence += f"; {rates} fell below rounding: collisions that depend on them are uncertain"
    return sentence


def _slowing(run: Any, events: int) -> str:
    """Return what shows that a run that was cut off was slowing down, if anything does."""
    said = ""
    if len(run.pace) == 2:
        (begin, start), (tail, t) = run.pace
        last, took = events - tail, run.time() - t
        if took * (tail - begin) < 0.1 * last * (t - start):
            said = (f"; the last {last} of them took only {took:.3g} s: the balls cluster and slow down, perhaps "
                    "without end. Remedies by name: collapse='merge', tc=, elastic_below=")  # fmt: skip
        bound = collapse.bound(run.state, run.physics)
        if bound is not None:
            said += f"; unless hit from outside, no body of {bound} will exceed {bound.bound:.2g} m/s"
    return said


def stats(run: Any, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return the counters of a run: collisions, gaps clamped at 0, re-basings of the clock, closer looks and the
    collisions in them, rates that velocities could not hold after them, and how a collapse was decided."""
    verdict = run.verdict
    names = ["events", "clamps", "rebases", "zooms", "zoomed", "lost"]
    names += ["merge_below", "merged"] if numbers["merge_below"] > 0.0 else []
    counters: dict[str, Any] = {"engine": run.queue.name} | {name: numbers[name] for name in names}
    if run.scene.heated:
        given, low = (column(run.state.walls[0], name) for name in ("given", "given_low"))
        counters["given"] = tuple((given + low).tolist())
    if verdict is not None:
        counters |= {"verdict": verdict.kind, "pairs": (verdict.first, verdict.last), "bound": verdict.bound}
    return counters
