"""Blocks of pairs, each with its own clock: islands of touching pairs, and pairs in free flight.

An island is every maximal run of pushing pairs together with the flying pair on each side: what its forces can reach.
Two runs with a single flying pair between them are one island. So the boundaries between blocks are exactly the places
where two neighbouring pairs fly, a ball between two islands is free, and every block can be computed alone.

The event loop takes the block that is due first, advances it, lets its event happen, and forms blocks anew. `laws` is
None when every law is a power form; else it is the `Collocation` that knows them, and the run is interpreted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import entry, inlined, kernel
from granular._tournament import leaf, play
from granular.md.located.around import count_of, is_closed, lengthen, neighbours, nth
from granular.md.located.contacts import (
    AWAITED,
    NONE,
    SOME,
    act,
    activate,
    engage,
    follow,
    push,
    pushes,
    strike,
)
from granular.md.located.driven import beside_edge, carry_walls, foresee_walls, rate_at, speed_at
from granular.md.located.free_length import reimpose
from granular.md.located.inside import exposed, relive
from granular.md.located.isolated import MET, OTHERWISE, TABLE, ULP, meet
from granular.md.located.jolts import ENDS, SAME, is_clipped, pass_edge, throw_back
from granular.md.located.ledger import enter_flight, enter_piece
from granular.md.located.near_rest import may_rest
from granular.md.located.pendula import swing
from granular.md.located.pieces import arrive, fly, glide, in_contact, piece_time, predict, since, tau_at, tick, value
from granular.md.located.plan import planned, settle_series
from granular.md.located.pool import join, leave
from granular.md.located.records import (
    ACTIVE,
    DORMANT,
    DRIVEN,
    EDGE,
    GENERAL,
    HEATED,
    HUNG,
    MOVES,
    OPEN,
    RESIDUAL,
    RING,
    SPARE,
    WORKED,
)
from granular.md.located.system import to_plain

REACHED, MORE, STOPPED, QUIET, WORK, REST, BINDING, CRAMPED, WANTS_TABLE, WANTS_CONTACT, WANTS_LOOK, ABSORB = range(12)
"""Why `advance` returned: time limit, pause or log full, stop condition, nothing can follow, work limit,
every ball rests for good, every ball is bound in contact forever, no room in the pool, a table of
contacts, a contact alone, or a look at a block that may rest or creep is wanted first. ABSORB is for `regroup`."""


@entry
@kernel
def launch(s: Any, laws: Any) -> bool:
    """Form the first blocks of a run from pairs that are open or overlap, to be planned; false if it stops at once."""
    run, pairs, pool, n = s.run[0], s.pairs, s.pool, count_of(s.pairs)
    for c in range(n):
        pair = pairs[c]
        rests = HEATED and pair.wall < 0 and pair.eta == 0.0 and pair.pull > 0.0
        if pair.xi > 0.0 or (pair.xi == 0.0 and (pair.eta > 0.0 or rests)):
            join(run, pairs, pool, s.kinds, s.bodies, c)
            if DRIVEN:
                carry_walls(s.walls, s)
            if HEATED and pair.wall < 0:
                if not strike(run, pairs, pool, c):
                    return False
            elif is_clipped(pool[pair.slot], laws):
                pool[pair.slot].mode = RESIDUAL
            elif not activate(run, pairs, pool, s.bodies, c):
                return False
    for c in range(n):
        if pairs[c].first == c:
            if pairs[c].slot < 0:
                join(run, pairs, pool, s.kinds, s.bodies, c)
                if DRIVEN:
                    carry_walls(s.walls, s)
            run.lo, run.hi, run.stride = c, pairs[c].hi, pool[pairs[c].slot].stride
            why = regroup(s, laws)
            while why == ABSORB:
                take_in(s, run.wanted)
                why = regroup(s, laws)
            if why == STOPPED:
                return False
    return True


@entry
@kernel
def advance(s: Any, limit: float, chunk: int, laws: Any) -> int:
    """Work off what is due up to time `limit`, at most `chunk` pieces."""
    run, pairs, pool, bodies, queue, work = s.run[0], s.pairs, s.pool, s.bodies, s.queue, s.work
    for _ in range(chunk):
        if run.waits == 0:
            if RING and run.steps >= run.look:
                reimpose(s)
            lo = queue[1].key
            if run.separated == 1 and run.begun > 0 and all_recede(s) and last_end(s) <= limit:
                run.t, run.tail = last_end(s), 0.0
                return STOPPED
            if queue[1].due == math.inf and run.members > 0:  # islands lie still
                run.rests = 1
            if queue[1].due > limit:
                return REACHED
            if queue[1].due == math.inf:
                run.t = last_end(s)
                return REST if run.rests == 1 else QUIET
            if run.begun >= run.max_events or run.steps >= run.max_steps:
                return WORK
            if run.rows + 2 > len(s.log) or run.steps >= run.pause:
                return MORE
            if pairs[lo].slot < 0:
                if run.members + SPARE >= len(pool):
                    return CRAMPED
                met = meet(s, lo)
                if met == MET:
                    continue
                if met != OTHERWISE:
                    return WANTS_TABLE if met == TABLE else WANTS_CONTACT
                xi = pairs[lo].xi
                arrive(pairs[lo], s.walls)
                if WORKED:
                    enter_flight(s.ledger, s.kinds[pairs[lo].kind_of], laws, pairs[lo], xi)
                join(run, pairs, pool, s.kinds, bodies, lo)
            block = pool[pairs[lo].slot]
            settle(run, pairs, pool, bodies, work, lo, block.tau, piece_time(block), s, laws)
            run.t, run.tail, run.stride, run.lo, run.hi = block.t, block.tail, block.stride, lo, pairs[lo].hi
            passed = SAME
            if DRIVEN:
                carry_walls(s.walls, s)
                if block.what == EDGE:
                    passed = pass_edge(s.walls, s, laws)
                    if passed == ENDS:
                        return STOPPED
            if block.fired < 0 and passed == SAME:
                if not (HUNG or RING) and laws is None and may_rest(run, pairs, pool, bodies, lo, limit):
                    return WANTS_LOOK
                pairs[lo].due = -math.inf
                play(queue, lo, pairs[lo].due)
                if not planned(s, laws):
                    return STOPPED
                continue
            if block.fired >= 0 and not act(run, pairs, pool, bodies, s.log, block, laws):
                return STOPPED
        run.waits = 0
        why = ABSORB
        while why == ABSORB:
            why = regroup(s, laws)
            if why == ABSORB and not absorb(s, run.wanted, laws):
                run.waits = 1
                return CRAMPED
        if not planned(s, laws):
            return STOPPED
        if why != MORE:
            return why
    return MORE


@kernel
def all_recede(s: Any) -> bool:
    """Return whether every pair is open and none approaches, once the contacts solved at once are over."""
    t = last_end(s)
    for c in range(count_of(s.pairs)):
        pair = s.pairs[c]
        if pair.slot >= 0 or pair.xi > 0.0 or rate_at(s.walls, pair, t) > 0.0:
            return False
    return True


@kernel
def last_end(s: Any) -> float:
    """Return when every contact solved at once is over, not before the event under way."""
    t: float = s.run[0].t
    for c in range(count_of(s.pairs)):
        pair = s.pairs[c]
        if pair.slot < 0 and pair.lasts > 0.0:
            t = max(t, pair.t + ULP * abs(pair.t) if pair.tail > 0.0 else pair.t)
    return t


@entry
@kernel
def expose_all(s: Any, t: float, laws: Any) -> bool:
    """Let every contact solved at once, that goes on at time t, the end of the run, be one by pieces; false if the pool
    is full: then it is called again, with more room."""
    run, pairs, pool = s.run[0], s.pairs, s.pool
    run.t, run.tail = t, 0.0
    for c in range(count_of(pairs)):
        if in_contact(pairs[c], t, 0.0):
            if run.members + SPARE >= len(pool):
                return False
            relive(s, c, t, 0.0)
            planned(s, laws)
            exposed(s, c)
            if pool[pairs[c].slot].mode == ACTIVE:
                play(s.queue, c, -math.inf)
                planned(s, laws)
    return True


@entry
@kernel
def gather(s: Any, t: float, laws: Any) -> None:
    """Advance every island to time t, the end of the run, with its series from there on."""
    run, pairs, pool = s.run[0], s.pairs, s.pool
    run.t, run.tail = t, 0.0
    for c in range(count_of(pairs)):
        pair = pairs[c]
        if pair.first == c and pair.slot >= 0:
            bring(s, c, t, 0.0, laws)
            if pair.due < math.inf and pool[pair.slot].h > 0.0 and pool[pair.slot].manner == MOVES:
                reach = foresee_walls(s.walls, pairs, pool, c) if DRIVEN else math.inf
                settle_series(run, pairs, pool, c, laws, s.walls, reach)


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


@kernel
def settle(
    run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, tau: float, dt: float, s: Any, laws: Any
) -> None:
    """Advance the island that starts with pair `lo` to τ, a time `dt` into its piece."""
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    if tau <= 0.0:
        return
    follow(run, pairs, pool, work, lo, tau)
    if WORKED:
        enter_piece(s.ledger, s.walls, laws, s, lo, tau)
    if HUNG:
        swing(run, pairs, pool, bodies, lo, tau, dt)
    else:
        push(pairs, pool, bodies, lo, dt)
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        member.xi, member.eta, member.exact = value(member.x, tau), value(member.e, tau), 0
        member.x[0], member.e[0] = member.xi, member.eta
    for c in range(lo, hi):
        pool[pairs[c].slot].noise += rounding(run.tol, pairs, pool, c, lo)
    tick(block, dt)
    if DRIVEN and block.what == EDGE and tau == block.tau:
        tick(block, beside_edge(s.walls, pairs[lo], block))
        tick(block, beside_edge(s.walls, pairs[hi - 1], block))
    if RING:
        if is_closed(pairs, lo, hi):
            hold_walls(pairs, pool, lo, hi, 0.0)
    elif bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0 and block.what != EDGE:
        lower, upper = bodies[lo].v, bodies[hi].v
        if DRIVEN:
            lower = speed_at(s.walls, pairs[lo], bodies[lo], block)
            upper = speed_at(s.walls, pairs[hi - 1], bodies[hi], block)
        hold_walls(pairs, pool, lo, hi, lower - upper)
    block.tau = 0.0  # the piece is used up


@kernel
def rounding(tol: float, pairs: Any, pool: Any, c: int, lo: int) -> float:
    """Return what a step may leave in the rate of pair `c`: rounding of rates, or what a nonlinear step leaves out."""
    member = pool[pairs[c].slot]
    if pool[pairs[lo].slot].linear == 0:
        return float(max(tol, ULP if member.kind != GENERAL else 8.0 * ULP) * member.own_speed)
    largest = abs(member.eta)
    hi = pairs[lo].hi
    if is_closed(pairs, lo, hi) and (c == lo or c + 1 == hi):
        largest = max(largest, abs(pool[pairs[hi - 1 if c == lo else lo].slot].eta))
    for i in range(max(lo, c - 1), min(c + 2, hi)):
        largest = max(largest, abs(pool[pairs[i].slot].eta))
    return float(ULP * largest)


@kernel
def hold_walls(pairs: Any, pool: Any, lo: int, hi: int, closing: float) -> None:
    """Let the rates between two walls, or around a ring, sum up to that of the walls, or 0: roundings would wander, and
    squeeze or free them."""
    excess, fastest = -closing, pool[pairs[lo].slot]
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        excess += member.eta
        if abs(member.eta) > abs(fastest.eta):
            fastest = member
    fastest.eta, fastest.e[0] = fastest.eta - excess, fastest.eta - excess


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
