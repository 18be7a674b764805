"""Whether the records of islands contradict each other."""

from __future__ import annotations

import math
from typing import Any

from granular._engine.records import leaf
from granular.md.located.contacts import needs_series
from granular.md.located.records import ACTIVE, DORMANT
from granular.md.located.system import to_plain


def check_blocks(s: Any) -> None:
    """Raise `AssertionError` if blocks, pool, queue and clocks contradict each other between two calls of `advance`."""
    s = to_plain(s)
    members, pool, n = s.run[0].members, s.pool, len(s.bodies) - 1
    pairs, shadows = s.pairs[:n], s.pairs[n:]
    starts = [c for c in range(n) if pairs[c].first == c]
    taken, spare = [p.slot for p in pairs if p.slot >= 0], [place.spare for place in pool[members:]]
    ends = [pairs[c].hi % n for c in starts]
    assert ends == [*starts[1:], min(starts, default=n)], "each pair is in one block"
    assert starts, "each pair is in one block"
    assert all(p.slot == pair.slot for p, pair in zip(shadows, pairs, strict=False)), "a shadow has its pair's place"
    assert len(taken) == members, "as many places are taken as is said"
    assert sorted(taken + spare) == list(range(len(pool))), "every place is taken once or spare once"
    for c, pair in enumerate(pairs):
        member = pool[pair.slot] if pair.slot >= 0 else None
        start, size = pairs[pair.first], pairs[pair.first].hi - pair.first
        place = (c - pair.first) % n
        assert place < size, "a pair is within its block"
        assert leaf(s.queue, c).due == pair.due, "the queue knows when a block is due"
        assert pair.due == math.inf or pair is start, "a block is due once"
        if member is None:
            assert size == 1, "a pair in free flight is a block of its own"
            assert pair.due >= pair.t, "nothing is due in the past"
        else:
            assert member.number == c, "a place knows its pair"
            assert not member.going_on or member.mode in (ACTIVE, DORMANT), "a contact has a force"
            assert pair.due >= pool[start.slot].t, "nothing is due in the past"
            below, above = (c > 0, c + 1 < n) if not shadows else (size < n, size < n)
            needed = needs_series(member)
            borders = below and pair is start and needed, above and place + 1 == size and needed
            assert s.run[0].waits or not any(borders), "islands end where pairs fly"
