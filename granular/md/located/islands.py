"""Blocks of pairs, each with its own clock: islands of touching pairs, and pairs in free flight.

An island is every maximal run of pushing pairs together with the flying pair on each side: what its forces can reach.
Two runs with a single flying pair between them are one island. So the boundaries between blocks are exactly the places
where two neighbouring pairs fly, a ball between two islands is free, and every block can be computed alone.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular._tournament import play
from granular.md.located.clock import since, tau_at, tick
from granular.md.located.contacts import follow
from granular.md.located.flight import glide_to, predict
from granular.md.located.modes import AWAITED, NONE, engage, pushes
from granular.md.located.piece import move
from granular.md.located.plan import plan
from granular.md.located.records import FREE, GENERAL, OPEN

ULP = 2.0**-52


FORMED, STOP, FULL = range(3)
"""What `regroup` comes to: blocks formed, the stop condition, a pool without room for the pairs that join."""


@kernel
def join(run: Any, pairs: Any, pool: Any, kinds: Any, bodies: Any, c: int) -> None:
    """Give pair `c`, which has been in free flight, its place in the pool."""
    pair, law = pairs[c], kinds[pairs[c].kind_of]
    pair.slot = pool[run.members].spare
    run.members += 1
    member = pool[pair.slot]
    member.lower, member.upper = bodies[c].inverse_mass, bodies[c + 1].inverse_mass
    member.inverse, member.pull = member.lower + member.upper, pair.pull
    member.kind, member.q, member.memory = law.kind, law.q, law.memory
    member.k, member.gamma, member.p, member.d, member.s = law.k, law.gamma, law.p, law.d, law.s
    member.xi, member.eta, member.mode, member.noise = pair.xi, pair.eta, pair.mode, pair.noise
    member.exact, member.wake, member.top, member.loading = pair.exact, pair.wake, 0.0, 1
    member.clock, member.t, member.tail, member.stride = FREE, pair.t, pair.tail, pair.stride
    member.fired, member.what, member.speed, member.begun = c, pair.what, 0.0, 0


@kernel
def settle(run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the island that starts with pair `lo` to τ, a time `dt` into its piece."""
    block, hi = pool[pairs[lo].slot], pairs[lo].hi
    if tau <= 0.0:
        return
    if run.log > 0:
        follow(run, pairs, pool, bodies, work, lo, tau)
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        move(member, tau)
        member.exact = 0
    for c in range(lo, hi):
        pool[pairs[c].slot].noise += rounding(run.tol, pairs, pool, c, lo)
    if bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0:
        hold_walls(pairs, pool, lo, hi, bodies[lo].v - bodies[hi].v)
    tick(block, dt)
    block.tau = 0.0  # the piece is used up


@kernel
def rounding(tol: float, pairs: Any, pool: Any, c: int, lo: int) -> float:
    """Return what a step may leave in the rate of pair `c`: rounding of rates, or what a nonlinear step leaves out."""
    member = pool[pairs[c].slot]
    if pool[pairs[lo].slot].linear == 0:
        part: float = max(tol, ULP if member.kind != GENERAL else 8.0 * ULP) * member.own_speed
        return part
    largest: float = abs(member.eta)
    if c > lo:
        largest = max(largest, abs(pool[pairs[c - 1].slot].eta))
    if c + 1 < pairs[lo].hi:
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
def bring(run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, t: float, tail: float) -> None:
    """Advance the block that starts with pair `lo` to the time t + tail, at most the end of its piece."""
    pair = pairs[lo]
    if pair.slot < 0:
        glide_to(pair, t, tail)
        return
    block = pool[pair.slot]
    if block.clock == FREE:  # where the run has stopped, some have joined and found no island
        glide_to(block, t, tail)
        return
    dt = since(block, t, tail)
    if dt > 0.0:  # else it is there, but for what a single float cannot say
        settle(run, pairs, pool, bodies, work, lo, min(block.tau, tau_at(block.h, block.clock, dt)), dt)


@kernel
def regroup(s: Any, laws: Any) -> int:
    """Form the blocks anew that the event under way concerns, and plan them; where the pool is full, called again."""
    run, pairs, pool, kinds, bodies, queue, work = s.run[0], s.pairs, s.pool, s.kinds, s.bodies, s.queue, s.work
    while True:
        while run.lo > 0 and pushes(pool[pairs[run.lo].slot]):
            if not absorb(run, pairs, pool, kinds, bodies, work, pairs[run.lo - 1].first):
                return FULL
        while run.hi < run.pairs and pushes(pool[pairs[run.hi - 1].slot]):
            if not absorb(run, pairs, pool, kinds, bodies, work, run.hi):
                return FULL
        found = engage(run, pairs, pool, bodies)
        if found == AWAITED:
            return STOP
        if found == NONE:
            break
    a, outcome = run.lo, FORMED
    for c in range(run.lo + 1, run.hi + 1):
        if c == run.hi or not (pushes(pool[pairs[c - 1].slot]) or pushes(pool[pairs[c].slot])):
            form(run, pairs, pool, queue, a, c)
            if c == a + 1 and not pushes(pool[pairs[a].slot]):
                take_off(run, pairs, pool, kinds, a)
            elif not plan(run, pairs, pool, bodies, work, a, laws):
                outcome = STOP
            play(queue, a, pairs[a].due)
            a = c
    return outcome


@kernel
def absorb(run: Any, pairs: Any, pool: Any, kinds: Any, bodies: Any, work: Any, lo: int) -> bool:
    """Let the event under way concern the block that starts with pair `lo` too; false if there is no room for it."""
    bring(run, pairs, pool, bodies, work, lo, run.t, run.tail)
    if pairs[lo].slot < 0:
        if run.members == len(pool):
            return False
        join(run, pairs, pool, kinds, bodies, lo)
    run.lo, run.hi = min(run.lo, lo), max(run.hi, pairs[lo].hi)
    return True


@kernel
def form(run: Any, pairs: Any, pool: Any, queue: Any, lo: int, hi: int) -> None:
    """Make pairs lo … hi-1 a block at the time of the event under way."""
    block, pairs[lo].hi = pool[pairs[lo].slot], hi
    block.t, block.tail, block.stride = run.t, run.tail, run.stride
    for c in range(lo, hi):
        pairs[c].first = lo
        if c > lo and pairs[c].due < math.inf:
            pairs[c].due = math.inf
            play(queue, c, math.inf)


@kernel
def take_off(run: Any, pairs: Any, pool: Any, kinds: Any, c: int) -> None:
    """Let pair `c`, a block of its own, fly on from the time of the event under way, and take back its place."""
    pair, member = pairs[c], pool[pairs[c].slot]
    pair.xi = 0.0 if member.mode == OPEN and member.xi > 0.0 else member.xi
    pair.eta, pair.mode, pair.noise, pair.exact, pair.wake = (
        member.eta, member.mode, member.noise, member.exact, member.wake
    )  # fmt: skip
    pair.t, pair.tail, pair.stride = run.t, run.tail, run.stride
    run.members -= 1
    pool[run.members].spare, pair.slot = pair.slot, -1
    predict(pair, kinds[pair.kind_of])
