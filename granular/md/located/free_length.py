"""The free length of a ring: its gaps add up to it forever, but for rounding.
May be skipped: rounding.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular._tournament import play
from granular.md.located.around import count_of
from granular.md.located.driven import flown
from granular.md.located.pieces import predict, since, tau_at, value
from granular.md.located.records import OPEN

EVERY = 1 << 16
"""Pieces and contacts after which the sum of the gaps is looked at,"""
PER_PAIR = 16
"""or so many times the pairs, so that it costs nothing."""


@kernel
def reimpose(s: Any) -> None:
    """Give the widest gap in free flight what rounding has taken from the sum of all.

    The asymptotes of contacts solved at once have the same sum as the gaps themselves.
    """
    run, pairs, pool, n = s.run[0], s.pairs, s.pool, count_of(s.pairs)
    at_start = run.look == 0
    run.look = run.steps + max(EVERY, PER_PAIR * n)
    if at_start:
        return
    widest, most, total, low = -1, 0.0, 0.0, 0.0
    for c in range(n):
        pair = pairs[c]
        if pair.slot >= 0:
            gap = -value(pool[pair.slot].x, tau_at(pool[pairs[pair.first].slot], run.t, run.tail))
        else:
            gap = -flown(s.walls, pair, since(pair, run.t, run.tail))[0]
            if pair.mode == OPEN and pair.lasts <= 0.0 and gap > most:
                most, widest = gap, c
        new = total + gap  # in two floats (Neumaier 1974)
        low += (total - new) + gap if abs(total) >= abs(gap) else (gap - new) + total
        total = new
    if widest >= 0:
        pair = pairs[widest]
        pair.xi += (total - run.length) + low
        predict(pair, s.kinds[pair.kind_of], s.walls)
        play(s.queue, widest, pair.due)
