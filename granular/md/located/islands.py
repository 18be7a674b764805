"""Blocks of pairs, each with its own clock: islands of touching pairs, and pairs in free flight.

An island is every maximal run of pushing pairs together with the flying pair on each side: what its forces can reach.
Two runs with a single flying pair between them are one island. So the boundaries between blocks are exactly the places
where two neighbouring pairs fly, a ball between two islands is free, and every block can be computed alone.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.clock import elapsed, since, tau_at, tick
from granular.md.located.contacts import follow
from granular.md.located.flight import arrive, glide_to, predict
from granular.md.located.modes import AWAITED, NONE, engage, pushes
from granular.md.located.piece import move
from granular.md.located.plan import plan
from granular.md.located.queue import play
from granular.md.located.records import FREE, GENERAL, OPEN

ULP = 2.0**-52


FORMED, STOP, FULL = range(3)
"""What `regroup` comes to: blocks formed, the stop condition, a pool without room for the pairs that join."""


@kernel
def join(s: Any, c: int) -> None:
    """Give pair `c`, which has been in free flight, its place in the pool."""
    pair, law, pool = s.pairs[c], s.kinds[s.pairs[c].kind_of], s.pool
    pair.slot = pool[s.run[0].members].spare
    s.run[0].members += 1
    member = pool[pair.slot]
    member.lower, member.upper = s.bodies[c].inverse_mass, s.bodies[c + 1].inverse_mass
    member.inverse, member.pull = member.lower + member.upper, pair.pull
    member.kind, member.q, member.memory = law.kind, law.q, law.memory
    member.k, member.gamma, member.p, member.d, member.s = law.k, law.gamma, law.p, law.d, law.s
    member.xi, member.eta, member.mode, member.noise = pair.xi, pair.eta, pair.mode, pair.noise
    member.exact, member.wake, member.top, member.loading = pair.exact, pair.wake, 0.0, 1
    member.clock, member.t, member.tail, member.stride = FREE, pair.t, pair.tail, pair.stride
    member.fired, member.what, member.speed, member.begun = c, pair.what, 0.0, 0


@kernel
def leave(s: Any, c: int) -> None:
    """Take back the place of pair `c`, which flies on from the time of the event under way."""
    run, pair = s.run[0], s.pairs[c]
    member = s.pool[pair.slot]
    pair.xi, pair.eta, pair.mode, pair.noise = member.xi, member.eta, member.mode, member.noise
    pair.exact, pair.wake = member.exact, member.wake
    pair.t, pair.tail, pair.stride = run.t, run.tail, run.stride
    run.members -= 1
    s.pool[run.members].spare = pair.slot
    pair.slot = -1


@kernel
def settle(s: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the island that starts with pair `lo` to τ, a time `dt` into its piece."""
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    block, hi = pool[pairs[lo].slot], pairs[lo].hi
    if tau <= 0.0:
        return
    if run.log > 0:
        follow(s, lo, hi, tau)
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        move(member, tau)
        member.exact = 0
    for c in range(lo, hi):
        pool[pairs[c].slot].noise += rounding(s, c, lo, hi)
    if bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0:
        hold_walls(pairs, pool, lo, hi, bodies[lo].v - bodies[hi].v)
    tick(block, dt)
    block.tau = 0.0  # the piece is used up


@kernel
def rounding(s: Any, c: int, lo: int, hi: int) -> float:
    """Return what a step may leave in the rate of pair `c`: rounding of rates, or what a nonlinear step leaves out."""
    pairs, pool = s.pairs, s.pool
    member = pool[pairs[c].slot]
    if pool[pairs[lo].slot].linear == 0:
        part: float = max(s.run[0].tol, ULP if member.kind != GENERAL else 8.0 * ULP) * member.own_speed
        return part
    largest: float = abs(member.eta)
    if c > lo:
        largest = max(largest, abs(pool[pairs[c - 1].slot].eta))
    if c + 1 < hi:
        largest = max(largest, abs(pool[pairs[c + 1].slot].eta))
    return ULP * largest


@kernel
def hold_walls(pairs: Any, pool: Any, lo: int, hi: int, closing: float) -> None:
    """Let the rates between two walls sum up to that of the walls: roundings would wander, and squeeze or free them."""
    excess, fastest = -closing, pool[pairs[lo].slot]
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        excess += member.eta
        if abs(member.eta) > abs(fastest.eta):
            fastest = member
    fastest.eta -= excess


@kernel
def finish_piece(s: Any, lo: int) -> None:
    """Advance the block that starts with pair `lo` to the end of its piece, where a free pair joins the pool."""
    pair = s.pairs[lo]
    if pair.slot < 0:
        arrive(pair)
        join(s, lo)
    else:
        block = s.pool[pair.slot]
        settle(s, lo, block.tau, elapsed(block.h, block.clock, block.tau))


@kernel
def bring(s: Any, lo: int, t: float, tail: float) -> None:
    """Advance the block that starts with pair `lo` to the time t + tail, at most the end of its piece."""
    pair = s.pairs[lo]
    if pair.slot < 0:
        glide_to(pair, t, tail)
        return
    block = s.pool[pair.slot]
    if block.clock == FREE:  # where the run has stopped, some have joined and found no island
        glide_to(block, t, tail)
        return
    dt = since(block, t, tail)
    if dt > 0.0:  # else it is there, but for what a single float cannot say
        settle(s, lo, min(block.tau, tau_at(block.h, block.clock, dt)), dt)


@kernel
def regroup(s: Any, laws: Any) -> int:
    """Form the blocks anew that the event under way concerns, and plan them; where the pool is full, called again."""
    run, pairs, pool = s.run[0], s.pairs, s.pool
    while True:
        while run.lo > 0 and pushes(pool[pairs[run.lo].slot]):
            if not absorb(s, pairs[run.lo - 1].first):
                return FULL
        while run.hi < run.pairs and pushes(pool[pairs[run.hi - 1].slot]):
            if not absorb(s, run.hi):
                return FULL
        found = engage(s, run.lo, run.hi)
        if found == AWAITED:
            return STOP
        if found == NONE:
            break
    a, outcome = run.lo, FORMED
    for c in range(run.lo + 1, run.hi + 1):
        if c == run.hi or not (pushes(pool[pairs[c - 1].slot]) or pushes(pool[pairs[c].slot])):
            if not form(s, a, c, laws):
                outcome = STOP
            a = c
    return outcome


@kernel
def absorb(s: Any, lo: int) -> bool:
    """Let the event under way concern the block that starts with pair `lo` too; false if there is no room for it."""
    run, pair = s.run[0], s.pairs[lo]
    bring(s, lo, run.t, run.tail)
    if pair.slot < 0:
        if run.members == len(s.pool):
            return False
        join(s, lo)
    run.lo, run.hi = min(run.lo, lo), max(run.hi, pair.hi)
    return True


@kernel
def form(s: Any, lo: int, hi: int, laws: Any) -> bool:
    """Make pairs lo … hi-1 a block and plan its next piece; false at the stop condition."""
    run, pairs, going = s.run[0], s.pairs, True
    block = s.pool[pairs[lo].slot]
    block.t, block.tail, block.stride, pairs[lo].hi = run.t, run.tail, run.stride, hi
    for c in range(lo, hi):
        pairs[c].first = lo
        if c > lo and pairs[c].due < math.inf:
            pairs[c].due = math.inf
            play(s.queue, pairs, c)
    if hi == lo + 1 and not pushes(block):
        if block.mode == OPEN and block.xi > 0.0:
            block.xi = 0.0
        leave(s, lo)
        predict(pairs[lo], s.kinds[pairs[lo].kind_of])
    else:
        going = plan(s, lo, hi, laws)
    play(s.queue, pairs, lo)
    return going


@kernel
def go_on(s: Any, lo: int, laws: Any) -> bool:
    """Plan the next piece of an island in which nothing has happened; false at the stop condition."""
    going = plan(s, lo, s.pairs[lo].hi, laws)
    play(s.queue, s.pairs, lo)
    return going
