"""Formation of islands at an event, and correction of the sum of gaps on a ring.

The sum of the gaps on a ring is constant. Its rounding errors are corrected from time to time (`correct_sum_of_gaps`).
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, RING, WORKED, kernel
from granular._engine.records import set_event_time
from granular.md.located.contacts import MODE_CHANGED, NO_CHANGE, STOP_AWAITED, make_dormant, needs_series
from granular.md.located.jumps import throw_struck_balls_back
from granular.md.located.ledger import DISSIPATED, add_to_account, residual_loss
from granular.md.located.numbering import is_closed, island_neighbours, lengthen_island, pair_count, wrapped_number
from granular.md.located.one_contact.inside import join_current_event, restart_contact
from granular.md.located.pieces import (
    advance_flight,
    advance_flight_forward,
    in_contact,
    predict_flight,
    tau_at,
    time_since,
    value,
)
from granular.md.located.plan import advance_island, follow_contact
from granular.md.located.records import DUE_TO_PLAN, EXTEND, MORE, MOVES, OPEN, SPARE_PLACES, STOPPED
from granular.md.located.system import join_pool, leave_pool
from granular.md.located.walls import free_flight, update_walls

MIN_CORRECTION_STEPS = 1 << 16
"""Minimum number of steps between two corrections of the sum of gaps.

A step is a piece, or a contact solved as one event."""
CORRECTION_STEPS_PER_PAIR = 16
"""Number of steps per pair of the ring between two corrections of the sum of gaps.

The larger of both numbers applies, so that corrections take negligible time."""


@kernel
def form_event_blocks(s: Any, laws: Any) -> int:
    """Divide the pairs of the current event into blocks again.

    Their next pieces have to be planned, or their next flights are predicted. Returns MORE if the blocks are formed.
    EXTEND means that the block of pair `run.wanted` has to be included in the event before another call. STOPPED means
    that the run has to stop before a contact.
    """
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    result = MODE_CHANGED
    # a pair that becomes dormant pushes, so the extent of the event has to be determined again
    while result == MODE_CHANGED:
        below, above = run.lo - 1, run.hi
        if RING:
            below, above = island_neighbours(run, pairs)
        # a force at the edge of the event accelerates the next pair, and a neighbouring contact is disturbed
        if below >= 0 and (needs_series(pool[pairs[run.lo].slot]) or in_contact(pairs[below], run.t, run.tail)):
            run.wanted = pairs[below].first
            return EXTEND
        if above < len(pairs) and (
            needs_series(pool[pairs[run.hi - 1].slot]) or in_contact(pairs[above], run.t, run.tail)
        ):
            run.wanted = above
            return EXTEND
        result = make_dormant(run, pairs, pool, bodies)
        if HEATED and result == NO_CHANGE:
            result = throw_struck_balls_back(s, laws)
    if result == STOP_AWAITED:
        run.waits = 1
        return STOPPED
    if RING and is_closed(pairs, run.lo, run.hi):
        cut_ring(run, pairs, pool)
    a = run.lo
    for c in range(run.lo + 1, run.hi + 1):
        if c == run.hi or not (needs_series(pool[pairs[c - 1].slot]) or needs_series(pool[pairs[c].slot])):
            form_block(run, pairs, pool, s.queue, a, c)
            is_single, a = c == a + 1, wrapped_number(pairs, a)
            if is_single and not needs_series(pool[pairs[a].slot]):
                release_pair(run, pairs, pool, s.kinds, a, s.field)
            else:
                pairs[a].due = DUE_TO_PLAN
            set_event_time(s.queue, a, pairs[a].due)
            a = c
    return MORE


@kernel
def release_pair(run: Any, pairs: Any, pool: Any, kinds: Any, c: int, field: Any) -> None:
    """Release pair `c`, a separate block, into free flight.

    Its place in the pool becomes free, and its next event is predicted.
    """
    pair, member = pairs[c], pool[pairs[c].slot]
    # an open pair has no overlap: a positive one is rounding error
    pair.xi = 0.0 if member.mode == OPEN and member.xi > 0.0 else member.xi
    pair.eta, pair.mode, pair.noise = member.eta, member.mode, member.noise
    pair.exact, pair.wake, pair.t, pair.tail, pair.last_step = member.exact, member.wake, run.t, run.tail, run.last_step
    leave_pool(run, pairs, pool, c)
    predict_flight(pair, kinds[pair.kind_of], field)


@kernel
def cut_ring(run: Any, pairs: Any, pool: Any) -> None:
    """Choose the first pair of an island that consists of all pairs of a ring.

    The island then starts between two neighbouring flying pairs, if there are any. No force acts on the ball between
    them.
    """
    for c in range(run.lo, run.hi):
        if not (needs_series(pool[pairs[wrapped_number(pairs, c - 1)].slot]) or needs_series(pool[pairs[c].slot])):
            run.lo = wrapped_number(pairs, c)
            run.hi = run.lo + pair_count(pairs)
            return


@kernel
def extend_event(s: Any, lo: int, laws: Any) -> bool:
    """Advance a block to the time of the current event, and include it in the event.

    The block starts with pair `lo`. A contact of it that was solved as one event is integrated by pieces. Returns false
    if the pool is full.
    """
    run, pairs = s.run[0], s.pairs
    if pairs[lo].slot < 0 and run.members + SPARE_PLACES >= len(s.pool):
        return False
    if in_contact(pairs[lo], run.t, run.tail):
        restart_contact(s, lo, run.t, run.tail)
        follow_contact(s, laws)
        join_current_event(s, lo)
    else:
        advance_block(s, lo, run.t, run.tail, laws)
    include_block(s, lo)
    return True


@kernel
def add_pair_to_pool(s: Any, c: int) -> None:
    """Move pair `c` into the pool, and update the driven walls to the current time."""
    join_pool(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, c)
    if DRIVEN:
        update_walls(s.field, s)


@kernel
def include_block(s: Any, lo: int) -> None:
    """Include the block that starts with pair `lo` in the current event.

    The block is already at the time of the event.
    """
    run, pairs = s.run[0], s.pairs
    if pairs[lo].slot < 0:
        add_pair_to_pool(s, lo)
    if RING:
        lengthen_island(run, pairs, lo)
    else:
        run.lo, run.hi = min(run.lo, lo), max(run.hi, pairs[lo].hi)


@kernel
def advance_block(s: Any, lo: int, t: float, tail: float, laws: Any) -> None:
    """Advance the block that starts with pair `lo` to the time t + tail in s.

    The record of a pair whose contact was solved as one event describes the free motion after the contact, and its
    clock can be later than this time. The free motion is then traced back to this time.
    """
    pair = s.pairs[lo]
    xi = pair.xi
    if pair.slot < 0 and pair.ahead == 1:
        # the clock can be ahead, after a contact solved as one event: trace the free motion back
        advance_flight(pair, time_since(pair, t, tail), s.field)
    elif pair.slot < 0:
        advance_flight_forward(pair, time_since(pair, t, tail), s.field)
        if WORKED:
            add_to_account(s.ledger[0], DISSIPATED, residual_loss(s.kinds[pair.kind_of], laws, pair, xi, pair.xi))
    else:  # the clock of the block is then t + tail, up to the rounding of dt
        block = s.pool[pair.slot]
        dt = time_since(block, t, tail)
        advance_island(s, lo, tau_at(block, t, tail), dt, laws)


@kernel
def form_block(run: Any, pairs: Any, pool: Any, queue: Any, lo: int, hi: int) -> None:
    """Make the pairs lo … hi-1 one block at the time of the current event."""
    if RING and lo >= pair_count(pairs):
        lo, hi = lo - pair_count(pairs), hi - pair_count(pairs)
    block, pairs[lo].hi = pool[pairs[lo].slot], hi
    block.t, block.tail, block.last_step, block.manner = run.t, run.tail, run.last_step, MOVES
    block.doubts = 0
    for i in range(lo, hi):
        c = wrapped_number(pairs, i)
        pairs[c].first, pairs[c].lasts, pairs[c].ahead = lo, 0.0, 0
        if c != lo and pairs[c].due < math.inf:
            pairs[c].due = math.inf
            set_event_time(queue, c, math.inf)


@kernel
def correct_sum_of_gaps(s: Any) -> None:
    """Correct the sum of gaps on a ring for its rounding error.

    The widest gap in free flight is changed. The function does nothing at the start, where the sum is exact. It also
    sets the number of steps until the next correction. The asymptotes of contacts solved as one event have the same sum
    as the gaps themselves.
    """
    run, pairs, pool, n = s.run[0], s.pairs, s.pool, pair_count(s.pairs)
    at_start = run.look == 0
    run.look = run.steps + max(MIN_CORRECTION_STEPS, CORRECTION_STEPS_PER_PAIR * n)
    # the gaps are exact at the start
    if at_start:
        return
    widest, widest_gap, total, low = -1, 0.0, 0.0, 0.0
    for c in range(n):
        pair = pairs[c]
        if pair.slot >= 0:
            gap = -value(pool[pair.slot].x, tau_at(pool[pairs[pair.first].slot], run.t, run.tail))
        else:
            gap = -free_flight(s.field, pair, time_since(pair, run.t, run.tail))[0]
            if pair.mode == OPEN and pair.lasts == 0.0 and gap > widest_gap:
                widest_gap, widest = gap, c
        next_total = total + gap  # in two floats (Neumaier 1974)
        low += (total - next_total) + gap if abs(total) >= abs(gap) else (gap - next_total) + total
        total = next_total
    if widest >= 0:
        pair = pairs[widest]
        pair.xi += (total - run.length) + low
        predict_flight(pair, s.kinds[pair.kind_of], s.field)
        set_event_time(s.queue, widest, pair.due)

