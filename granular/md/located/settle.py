"""Continue a run that is proved to rest until its overlaps are static.

The times of its looks are numbers of 7 binary digits, whatever the time of the proof: so a resumed run ends as the
uninterrupted one, bit for bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular.md.located.pace import members
from granular.md.located.records import ACTIVE, GENERAL
from granular.md.located.rest.equilibrium import overlap_under
from granular.run.drive import Pause

SETTLED = 1e-9
"""Deviation of an overlap from its static value, relative to that value, up to which balls count as settled."""
MAX_LOOKS = 4096
"""Looks at most, 64 for each doubling of the time: a decay that takes longer is not resolved by floats."""


def settle(run: Any) -> None:
    """Advance `run`, a run of `located.run` proved to rest, to the first look at which all overlaps are static."""
    # rest under a law that is a function is proved when all forces balance: its overlaps are static already
    loaded = [p for p in members(run) if p.mode == ACTIVE and p.load > 0.0 and p.kind != GENERAL]
    pair, rest = [p.number for p in loaded], np.array([overlap_under(p, p.load) for p in loaded])
    # the period of a contact is the least time that means anything in a run that rests from its start
    shortest = max((math.sqrt(xi / (p.load * p.inverse)) for p, xi in zip(loaded, rest.tolist(), strict=True)),
                   default=0.0)
    time = max(run.now, float(run.counters["t"]), run.request.start - run.start)
    for _ in range(MAX_LOOKS if loaded else 0):
        time = _look(time, shortest)
        while (pause := run.to(run.start + time, False)) is Pause.full:
            pass
        if pause is not Pause.reached:
            return
        if (abs(run.row_after(time, run.start + time).gap[pair] + rest) <= SETTLED * rest).all():
            return
        time = math.nextafter(time, math.inf)


def _look(time: float, shortest: float) -> float:
    """Return the first time of a look from `time` on: 0, or a number of 7 binary digits from about `shortest` on."""
    if time == 0.0:
        return 0.0
    exponent = math.frexp(max(time, shortest))[1] - 7
    return math.ldexp(math.ceil(math.ldexp(max(time, shortest), -exponent)), exponent)
