"""How a run ended, in one sentence with its numbers, and the account of the work done; `run` is one of `edmd.run`."""

from __future__ import annotations

import math
from typing import Any

from granular.edmd import collapse
from granular.edmd.collapse import Verdict
from granular.trajectory import Status


def message(run: Any, status: Status) -> str:
    """Return the sentence to print."""
    when = f"t = {run.time():.12g} s after {_count(run.state.run.events, 'collision')}"
    if status is Status.collapse:
        return _collapse(run, when)
    if status is Status.max_events:
        return _work(run, when)
    end = "; no collision can follow" if status is Status.time and run.queue.soonest() == float("inf") else ""
    return f"{status.value}: {when}{end}{_lost(run)}"


def stats(run: Any) -> dict[str, Any]:
    """Return the counters of a run: collisions, gaps clamped at 0, re-basings of the clock, closer looks and the
    collisions in them, rates that velocities could not hold after them, and how a collapse was decided."""
    numbers, verdict = run.state.numbers(), run.verdict
    names = ["events", "clamps", "rebases", "zooms", "zoomed", "lost"]
    names += ["merge_below", "merged"] if numbers["merge_below"] > 0.0 else []
    counters: dict[str, Any] = {"engine": run.queue.name} | {name: numbers[name] for name in names}
    if verdict is not None:
        counters |= {"verdict": verdict.kind, "pairs": (verdict.first, verdict.last), "bound": verdict.bound}
    return counters


def _collapse(run: Any, when: str) -> str:
    verdict = run.verdict
    if verdict is None:
        return f"{_walls(run)} and leave no way out: stopped at {when}, when no space was left{_lost(run)}"
    pairs = _pairs(verdict)
    if verdict.kind == "exact":
        body = f"exact: body {verdict.first + 1} comes to rest on the wall after infinitely many bounces"
    elif verdict.kind == "proved":
        body = f"proved: the two pairs collide in turn for ever; rates left: {verdict.bound:.2g} m/s"
    else:
        body = f"bounded: unless hit from outside, none of their bodies will be faster than {verdict.bound:.2g} m/s"
    return f"inelastic collapse of {pairs} at {when} ({body})"


def _pairs(verdict: Verdict) -> str:
    return f"pair {verdict.first}" if verdict.first == verdict.last else f"pairs {verdict.first} to {verdict.last}"


def _work(run: Any, when: str) -> str:
    sentence = f"{Status.max_events.value}: max_events reached at {when}"
    if math.isfinite(run.horizon):
        sentence += f"; {_walls(run)}, and collisions become ever more frequent until then"
    elif run.state.run.slow >= 0.0 and len(run.pace) == 2:
        (begin, start), (tail, t) = run.pace
        last, took = run.state.run.events - tail, run.time() - t
        if took * (tail - begin) < 0.1 * last * (t - start):
            sentence += (
                f"; the last {last} of them took only {took:.3g} s: the balls cluster and slow down, perhaps without "
                "end. Remedies by name: collapse='merge', tc=, elastic_below="
            )
        bound = collapse.bound(run.state, run.physics)
        if bound is not None:
            sentence += f"; unless hit from outside, no body of {_pairs(bound)} will exceed {bound.bound:.2g} m/s"
    return sentence + _lost(run)


def _walls(run: Any) -> str:
    return f"the walls close at t = {run.state.run.start + run.close_after:.12g} s"


def _lost(run: Any) -> str:
    lost = int(run.state.run.lost)
    if lost == 0:
        return ""
    return f"; {_count(lost, 'relative velocity')} fell below rounding: collisions that depend on them are uncertain"


def _count(n: int, noun: str) -> str:
    plural = noun[:-1] + "ies" if noun.endswith("y") else noun + "s"
    return f"{n} {noun if n == 1 else plural}"
