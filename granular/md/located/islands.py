"""Islands formed anew at an event: which blocks it concerns, where they end now, and who flies on alone."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import inlined, kernel
from granular._tournament import leaf, play
from granular.md.located.around import count_of, is_closed, lengthen, neighbours, nth
from granular.md.located.driven import carry_walls
from granular.md.located.inside import exposed, relive
from granular.md.located.jolts import throw_back
from granular.md.located.ledger import enter_flight
from granular.md.located.pieces import fly, glide, in_contact, predict, since, tau_at
from granular.md.located.plan import planned
from granular.md.located.pool import join, leave
from granular.md.located.records import (
    ABSORB,
    ACTIVE,
    DORMANT,
    DRIVEN,
    HEATED,
    MORE,
    MOVES,
    OPEN,
    RING,
    SPARE,
    STOPPED,
    WORKED,
)
from granular.md.located.settle import settle
from granular.md.located.system import to_plain
from granular.md.located.touching import AWAITED, NONE, SOME, engage, pushes


@kernel
def regroup(s: Any, laws: Any) -> int:
    """Form the blocks anew that the event under way concerns, to be planned.

    Return MORE, STOPPED, or ABSORB: a block, `wanted`, is to be absorbed first, and then it is to be called again.
    """
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    found = SOME
    while found == SOME:
        below, above = run.lo - 1, run.hi
        if RING:
            below, above = neighbours(run, pairs)
        if below >= 0 and (pushes(pool[pairs[run.lo].slot]) or in_contact(pairs[below], run.t, run.tail)):
            run.wanted = pairs[below].first
            return ABSORB
        if above < len(pairs) and (
            pushes(pool[pairs[run.hi - 1].slot]) or in_contact(pairs[above], run.t, run.tail)
        ):
            run.wanted = above
            return ABSORB
        found = engage(run, pairs, pool, bodies)
        if HEATED and found == NONE:
            found = throw_back(s, laws)
    if found == AWAITED:
        run.waits = 1
        return STOPPED
    if is_closed(pairs, run.lo, run.hi):
        cut(run, pairs, pool)
    a = run.lo
    for c in range(run.lo + 1, run.hi + 1):
        if c == run.hi or not (pushes(pool[pairs[c - 1].slot]) or pushes(pool[pairs[c].slot])):
            form(run, pairs, pool, s.queue, a, c)
            lone, a = c == a + 1, nth(pairs, a)
            if lone and not pushes(pool[pairs[a].slot]):
                take_off(run, pairs, pool, s.kinds, a, s.walls)
            else:
                pairs[a].due = -math.inf
            play(s.queue, a, pairs[a].due)
            a = c
    return MORE


@kernel
def take_off(run: Any, pairs: Any, pool: Any, kinds: Any, c: int, walls: Any) -> None:
    """Let pair `c`, a block of its own, fly on from the time of the event under way, and take back its place."""
    pair, member = pairs[c], pool[pairs[c].slot]
    pair.xi = 0.0 if member.mode == OPEN and member.xi > 0.0 else member.xi
    pair.eta, pair.mode, pair.noise = member.eta, member.mode, member.noise
    pair.exact, pair.wake, pair.t, pair.tail, pair.stride = member.exact, member.wake, run.t, run.tail, run.stride
    leave(run, pairs, pool, c)
    predict(pair, kinds[pair.kind_of], walls)


@kernel
def cut(run: Any, pairs: Any, pool: Any) -> None:
    """Let an island that goes all around a ring begin where two neighbouring pairs fly, if there is such a place."""
    for c in range(run.lo, run.hi):
        if not (pushes(pool[pairs[nth(pairs, c - 1)].slot]) or pushes(pool[pairs[c].slot])):
            run.lo = nth(pairs, c)
            run.hi = run.lo + count_of(pairs)
            return


@inlined
@kernel
def absorb(s: Any, lo: int, laws: Any) -> bool:
    """Let the event under way concern the block that starts with pair `lo` too; false if there is no room for it."""
    run, pairs = s.run[0], s.pairs
    if pairs[lo].slot < 0 and run.members + SPARE >= len(s.pool):
        return False
    if in_contact(pairs[lo], run.t, run.tail):
        relive(s, lo, run.t, run.tail)
        planned(s, laws)
        exposed(s, lo)
    else:
        bring(s, lo, run.t, run.tail, laws)
    take_in(s, lo)
    return True


@kernel
def take_in(s: Any, lo: int) -> None:
    """Let the event under way concern the block that starts with pair `lo` too, which has come to its time."""
    run, pairs = s.run[0], s.pairs
    if pairs[lo].slot < 0:
        join(run, pairs, s.pool, s.kinds, s.bodies, lo)
        if DRIVEN:
            carry_walls(s.walls, s)
    if RING:
        lengthen(run, pairs, lo)
    else:
        run.lo, run.hi = min(run.lo, lo), max(run.hi, pairs[lo].hi)


@inlined
@kernel
def bring(s: Any, lo: int, t: float, tail: float, laws: Any) -> None:
    """Advance the block that starts with pair `lo` to the time t + tail, at most the end of its piece."""
    pair = s.pairs[lo]
    xi = pair.xi
    if pair.slot < 0 and pair.lasts != 0.0:  # its clock may lie ahead
        fly(pair, since(pair, t, tail), s.walls)
    elif pair.slot < 0:
        glide(pair, since(pair, t, tail), s.walls)
        if WORKED:
            enter_flight(s.ledger, s.kinds[pair.kind_of], laws, pair, xi)
    else:  # at once there, except for what a single float cannot say
        block = s.pool[pair.slot]
        dt = since(block, t, tail)
        settle(s.run[0], s.pairs, s.pool, s.bodies, s.work, lo, tau_at(block, t, tail), dt, s, laws)


@kernel
def form(run: Any, pairs: Any, pool: Any, queue: Any, lo: int, hi: int) -> None:
    """Make pairs lo … hi-1 a block at the time of the event under way."""
    if RING and lo >= count_of(pairs):
        lo, hi = lo - count_of(pairs), hi - count_of(pairs)
    block, pairs[lo].hi = pool[pairs[lo].slot], hi
    block.t, block.tail, block.stride, block.manner = run.t, run.tail, run.stride, MOVES
    for i in range(lo, hi):
        c = nth(pairs, i)
        pairs[c].first, pairs[c].lasts = lo, 0.0
        if c != lo and pairs[c].due < math.inf:
            pairs[c].due = math.inf
            play(queue, c, math.inf)


def _check(s: Any) -> None:
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
            assert not member.begun or member.mode in (ACTIVE, DORMANT), "a contact has a force"
            assert pair.due >= pool[start.slot].t, "nothing is due in the past"
            below, above = (c > 0, c + 1 < n) if not shadows else (size < n, size < n)
            borders = below and pair is start and pushes(member), above and place + 1 == size and pushes(member)
            assert s.run[0].waits or not any(borders), "islands end where pairs fly"
