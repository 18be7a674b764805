"""The event loop over blocks of pairs, each with its own clock.

A block is an island or a single pair in free flight. An island consists of consecutive pairs with forces and the flying
pair on either side: all pairs that these forces can accelerate. Two groups of pairs with forces, separated by a single
flying pair, form one island. The boundaries between blocks are therefore balls between two flying pairs. No force acts
on such a ball, so every block can be integrated alone.

The event loop takes the block whose next event is first, advances it, applies the event and forms the blocks around it
again. `s` is the `System` of all records. `laws` is None if every law is a power form. Otherwise it is the
`Collocation` of the laws, and the run is interpreted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, HUNG, RING, WORKED, kernel
from granular._engine.records import set_event_time
from granular.md.located.contacts import TOUCH_ONLY, activate, apply_contact_event, count_isolated, mark_struck
from granular.md.located.islands import (
    add_pair_to_pool,
    advance_block,
    correct_sum_of_gaps,
    extend_event,
    form_event_blocks,
    include_block,
)
from granular.md.located.jumps import BLOCKS_CHANGED, RUN_ENDS, SAME_BLOCKS, pass_edge
from granular.md.located.ledger import DISSIPATED, add_to_account, residual_loss
from granular.md.located.modes import is_clipped
from granular.md.located.numbering import pair_count
from granular.md.located.one_contact.inside import join_current_event, restart_contact
from granular.md.located.one_contact.meet import solve_as_one_event
from granular.md.located.pieces import FLOAT_SPACING, advance_flight_to_event, in_contact, piece_time
from granular.md.located.plan import advance_island, follow_contact, plan_all_due, series_of_piece
from granular.md.located.records import (
    ACTIVE,
    BY_PIECES,
    CRAMPED,
    CREEPS,
    DONE,
    DUE_TO_PLAN,
    EDGE,
    EXTEND,
    GOES_ON,
    LIES,
    MORE,
    MOVES,
    OPEN,
    QUIET,
    REACHED,
    RESIDUAL,
    REST,
    SPARE_PLACES,
    STOPPED,
    WANTS_REST_TEST,
    WORK_LIMIT,
)
from granular.md.located.rest.overdamped import expand_creep
from granular.md.located.rest.proof import may_rest, write_still_piece
from granular.md.located.system import join_pool
from granular.md.located.walls import expand_paths, rate_at, update_walls


@kernel
def form_first_blocks(s: Any, laws: Any) -> bool:
    """Form the first blocks of a run at its start.

    Pairs that overlap, or touch while they close, are moved to the pool. The pieces of islands remain to be planned
    (`plan_all_due`). Returns false if the run has to stop at its start: at its stop condition, or at a disturbed
    contact.
    """
    run, pairs, pool, n = s.run[0], s.pairs, s.pool, pair_count(s.pairs)
    for c in range(n):
        pair = pairs[c]
        # a ball at rest on a thermal wall is pressed to it by gravity and is thrown back
        is_pressed_to_wall = HEATED and pair.wall < 0 and pair.eta == 0.0 and pair.pull > 0.0
        if pair.xi > 0.0 or (pair.xi == 0.0 and (pair.eta > 0.0 or is_pressed_to_wall)):
            add_pair_to_pool(s, c)
            if HEATED and pair.wall < 0:
                if not mark_struck(run, pairs, pool, c):  # the ball is about to be thrown back
                    return False
            elif is_clipped(pool[pair.slot], laws):  # an overlap without a force
                pool[pair.slot].mode = RESIDUAL
                if not count_isolated(run, pairs, pool, c, TOUCH_ONLY):
                    return False
            elif not activate(run, pairs, pool, s.bodies, c):  # the force acts from the start
                return False
    # form every block as if an event had just happened in it
    for c in range(n):
        if pairs[c].first == c:
            if pairs[c].slot < 0:
                add_pair_to_pool(s, c)
            run.lo, run.hi, run.last_step = c, pairs[c].hi, pool[pairs[c].slot].last_step
            code = form_event_blocks(s, laws)
            while code == EXTEND:  # the forces of the block reach the next block
                include_block(s, run.wanted)
                code = form_event_blocks(s, laws)
            if code == STOPPED:
                return False
    return True


@kernel
def start_blocks(s: Any, laws: Any) -> bool:
    """Form the first blocks of a run, and plan their pieces.

    Returns false if the run has to stop at its start.
    """
    return form_first_blocks(s, laws) and plan_all_due(s, laws)


@kernel
def advance(s: Any, limit: float, chunk: int, laws: Any) -> int:
    """Advance the run up to the time `limit` by at most `chunk` events and pieces.

    `limit` is in s since the start of the run. Returns why the function returned: one of the codes REACHED …
    WANTS_REST_TEST.
    """
    run = s.run[0]
    for _ in range(chunk):
        code = EXTEND
        # an event that waited for room in the pool, or for the stop condition, is completed first
        if run.waits == 0:
            code = reason_to_return(s, limit)
            if code == DONE:
                code = apply_next_event(s, limit, laws)
            if code == DONE:
                continue
            if code != EXTEND and code != GOES_ON:
                return code
        run.waits = 0
        if code == EXTEND:
            code = form_event_blocks(s, laws)
        while code == EXTEND:
            if not extend_event(s, run.wanted, laws):
                run.waits = 1
                return CRAMPED
            code = form_event_blocks(s, laws)
        if not plan_all_due(s, laws):
            return STOPPED
        if code != MORE and code != GOES_ON:
            return code
    return MORE


@kernel
def reason_to_return(s: Any, limit: float) -> int:
    """Return why `advance` has to return before the next event, or DONE to continue.

    Possible reasons are REACHED, STOPPED, QUIET, REST and WORK_LIMIT. MORE means that the log buffer is full, CRAMPED
    that the pool is full.
    """
    run, queue = s.run[0], s.queue
    if RING and run.steps >= run.look:
        correct_sum_of_gaps(s)
    if run.separated == 1 and run.contacts > 0 and all_recede(s) and last_contact_end(s) <= limit:
        run.t, run.tail = last_contact_end(s), 0.0
        return STOPPED
    if queue[1].due == math.inf and run.members > 0:  # no island moves any more
        run.rests = 1
    if queue[1].due > limit:
        return REACHED
    if queue[1].due == math.inf:
        run.t = last_contact_end(s)
        return REST if run.rests == 1 else QUIET
    if run.contacts >= run.max_events or run.steps >= run.max_steps:
        return WORK_LIMIT
    # an event writes at most two rows: walls at both ends of an island can act simultaneously
    if run.rows + 2 > len(s.log):
        return MORE
    # a pair in free flight can have to join an island at its event
    if s.pairs[queue[1].key].slot < 0 and run.members + SPARE_PLACES >= len(s.pool):
        return CRAMPED
    return DONE


@kernel
def apply_next_event(s: Any, limit: float, laws: Any) -> int:
    """Apply the next event of the run.

    A contact of a pair in free flight is solved as one event if possible. Otherwise the next event is the end of a
    piece. Returns DONE, EXTEND or GOES_ON to continue, or the reason for which `advance` has to return.
    """
    lo = s.queue[1].key
    pair = s.pairs[lo]
    if pair.slot < 0:
        code = solve_as_one_event(s, lo)
        if code != BY_PIECES:
            return code
        xi = pair.xi
        advance_flight_to_event(pair, s.field)
        if WORKED:
            # a clipped pair dissipates its elastic energy as its overlap decreases
            add_to_account(s.ledger[0], DISSIPATED, residual_loss(s.kinds[pair.kind_of], laws, pair, xi, pair.xi))
        join_pool(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, lo)
    return end_piece(s, lo, limit, laws)


@kernel
def end_piece(s: Any, lo: int, limit: float, laws: Any) -> int:
    """Advance the island that starts with pair `lo` to the end of its piece.

    The event at the end is applied. Returns EXTEND if the blocks have to be formed again, GOES_ON if the island only
    needs its next piece, or the reason for which `advance` has to return. `limit` is the time in s up to which the run
    is advanced.
    """
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    block, edge_result = pool[pairs[lo].slot], SAME_BLOCKS
    advance_island(s, lo, block.tau, piece_time(block), laws)
    run.t, run.tail, run.last_step, run.lo, run.hi = block.t, block.tail, block.last_step, lo, pairs[lo].hi
    if DRIVEN:
        update_walls(s.field, s)
        if block.event == EDGE:
            edge_result = pass_edge(s.field, s, laws)
            if edge_result == RUN_ENDS:
                return STOPPED
    if block.fired >= 0:
        return EXTEND if apply_contact_event(run, pairs, pool, bodies, s.log, block, laws) else STOPPED
    if edge_result == BLOCKS_CHANGED:
        return EXTEND
    if not (HUNG or RING) and laws is None and may_rest(run, pairs, pool, bodies, lo, limit):
        return WANTS_REST_TEST
    pairs[lo].due = DUE_TO_PLAN
    set_event_time(s.queue, lo, pairs[lo].due)
    return GOES_ON


@kernel
def all_recede(s: Any) -> bool:
    """Return whether no pair overlaps or approaches, so that the balls are separated.

    The rates are those at `last_contact_end`. Pairs in islands count as not separated.
    """
    t = last_contact_end(s)
    for c in range(pair_count(s.pairs)):
        pair = s.pairs[c]
        if pair.slot >= 0 or pair.xi > 0.0 or rate_at(s.field, pair, t) > 0.0:
            return False
    return True


@kernel
def last_contact_end(s: Any) -> float:
    """Return the time in s at which the last contact solved as one event ends.

    It is at least the time of the current event, and is rounded up so that no contact lasts beyond it.
    """
    t: float = s.run[0].t
    for c in range(pair_count(s.pairs)):
        pair = s.pairs[c]
        if pair.slot < 0 and pair.lasts > 0.0:
            # rounded up to the next float, so that no contact lasts beyond it
            t = max(t, pair.t + FLOAT_SPACING * abs(pair.t) if pair.tail > 0.0 else pair.t)
    return t


@kernel
def is_all_apart(s: Any, t: float) -> bool:
    """Return whether no pair touches at the end of a run and the log buffer is empty.

    `t` is the end in s.
    """
    for c in range(pair_count(s.pairs)):
        pair = s.pairs[c]
        if in_contact(pair, t, 0.0) or (pair.slot >= 0 and s.pool[pair.slot].mode != OPEN):
            return False
    return bool(s.run[0].rows == 0)


@kernel
def continue_contacts_by_pieces(s: Any, t: float, laws: Any) -> bool:
    """Integrate by pieces every contact solved as one event that lasts beyond `t`.

    `t` in s is the end of the run. The pairs become islands, so that contacts unfinished at the end have their state
    there. Returns false if the pool is full. The caller then enlarges the pool and calls again.
    """
    run, pairs, pool = s.run[0], s.pairs, s.pool
    run.t, run.tail = t, 0.0
    for c in range(pair_count(pairs)):
        if in_contact(pairs[c], t, 0.0):
            if run.members + SPARE_PLACES >= len(pool):
                return False
            restart_contact(s, c, t, 0.0)
            follow_contact(s, laws)
            join_current_event(s, c)
            if pool[pairs[c].slot].mode == ACTIVE:
                set_event_time(s.queue, c, DUE_TO_PLAN)
                plan_all_due(s, laws)
    return True


@kernel
def advance_islands_to_end(s: Any, t: float, laws: Any) -> None:
    """Advance every island to the end of the run, and compute its series there.

    `t` is the end in s. The states of all pairs in islands at `t` follow from these series. Resting and creeping
    islands are left to `expand_resting_blocks`.
    """
    run, pairs, pool = s.run[0], s.pairs, s.pool
    run.t, run.tail = t, 0.0
    for c in range(pair_count(pairs)):
        pair = pairs[c]
        if pair.first == c and pair.slot >= 0:
            advance_block(s, c, t, 0.0, laws)
            if pair.due < math.inf and pool[pair.slot].h > 0.0 and pool[pair.slot].manner == MOVES:
                reach = expand_paths(s.field, pairs, pool, c) if DRIVEN else math.inf
                series_of_piece(s, c, laws, reach)


@kernel
def expand_resting_blocks(s: Any) -> None:
    """Compute the series of all resting and creeping islands at the end of the run."""
    pairs, pool = s.pairs, s.pool
    for c in range(len(pairs)):
        pair = pairs[c]
        if pair.first == c and pair.slot >= 0 and pair.due < math.inf and pool[pair.slot].h > 0.0:
            block = pool[pair.slot]
            if block.manner == LIES:
                write_still_piece(pairs, pool, s.bodies, c)
            elif block.manner == CREEPS and not expand_creep(pairs, pool, s.bodies, c):
                block.manner = MOVES
                series_of_piece(s, c, None, math.inf)

