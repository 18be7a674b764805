"""When a pile of a run begins to ride on a driven wall, how that goes on, and its end; `run` is one of `located.run`.
May be skipped: rarer, piles that ride on a driven wall.
"""

from __future__ import annotations

import math
from copy import copy
from typing import Any

from granular._kernels import compiled
from granular._tournament import play
from granular.md.located.on_wall import pile_on_wall
from granular.md.located.plan import planned
from granular.md.located.ride import Ride
from granular.md.located.system import to_compiled, to_plain

STRETCHES = 100
"""Stretches of a ride between two looks at progress."""


def resume(run: Any) -> None:
    """Let the pile that was riding when the run was saved ride on."""
    found = pile_on_wall(run.s)
    if found is not None:
        run.s, run.kernels = to_plain(run.s), run.fit
        ride = Ride(run.s, found, run.collocation)
        go_on(run, ride, ride.begins())


def let_ride(run: Any) -> None:
    """Let the pile on a driven wall ride a stretch at once if there is one that is proved; else nothing changes."""
    found = pile_on_wall(run.s)
    if found is None or not may_ride(run):
        return
    s = to_plain(run.s)
    slots = [pair.slot for pair in s.pairs[found.lo : s.pairs[found.lo].hi]]
    before = [copy(s.pool[slot]) for slot in slots]
    run.rode = Ride(s, found, run.collocation, run.rode)
    if run.rode.begins():
        run.s, run.kernels = s, run.fit
        go_on(run, run.rode, True)
        return
    for slot, member in zip(slots, before, strict=True):
        s.pool[slot] = member


def may_ride(run: Any) -> bool:
    """Return whether there is work left for a stretch, and for the piece after it."""
    return bool(run.counters["steps"] + 2 <= run.counters["max_steps"])


def go_on(run: Any, ride: Ride, goes: bool) -> None:
    """Ride the stretch that begins if it `goes`, or else go on by pieces."""
    lo, run.rode, run.ride = ride.pile.lo, ride, ride if goes else None
    run.s.pairs[lo].due = ride.until if goes else -math.inf
    play(run.s.queue, lo, run.s.pairs[lo].due)
    if not goes:
        run.kernels(planned)(run.s, run.collocation)
        if run.engine == "compiled":
            run.s, run.kernels = to_compiled(run.s), lambda kernel: compiled(run.fit(kernel))


def rides_to(run: Any, limit: float) -> bool:
    """Go on with the ride to a time into the run, or some stretches towards it; false if it ends before."""
    for _ in range(STRETCHES):
        if run.ride is None or limit < run.ride.until:
            break
        run.ride.goes_to(run.ride.until)
        ride = Ride(run.s, run.ride.pile, run.collocation, run.ride)
        go_on(run, ride, may_ride(run) and ride.begins())
    run.now = limit if run.ride is not None and limit < run.ride.until else float(run.counters["t"])
    return run.ride is not None
