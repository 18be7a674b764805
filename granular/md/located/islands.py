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
from granular.md.located.clock import elapsed, since, tau_at, tick
from granular.md.located.contacts import follow
from granular.md.located.flight import arrive, glide, predict
from granular.md.located.modes import AWAITED, NONE, engage, pushes
from granular.md.located.piece import move
from granular.md.located.plan import plan
from granular.md.located.records import FREE, GENERAL, OPEN

ULP = 2.0**-52


@kernel
def settle(run: Any, pairs: Any, bodies: Any, work: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the island that starts with pair `lo` to τ, a time `dt` into its piece."""
    block = pairs[lo]
    if tau <= 0.0:
        return
    if run.log > 0:
        follow(pairs, bodies, lo, block.hi, tau, work, run.log == 2)
    for c in range(lo, block.hi):
        pair = pairs[c]
        move(pair, tau)
        pair.exact = 0
    for c in range(lo, block.hi):
        pairs[c].noise += rounding(run, pairs, c, lo, block.hi)
    if bodies[lo].inverse_mass == 0.0 and bodies[block.hi].inverse_mass == 0.0:
        hold_walls(pairs, lo, block.hi, bodies[lo].v - bodies[block.hi].v)
    tick(block, dt)
    block.tau = 0.0  # the piece is used up


@kernel
def rounding(run: Any, pairs: Any, c: int, lo: int, hi: int) -> float:
    """Return what a step may leave in the rate of pair `c`: rounding of rates, or what a nonlinear step leaves out."""
    if pairs[lo].linear == 0:
        part: float = max(run.tol, ULP if pairs[c].kind != GENERAL else 8.0 * ULP) * pairs[c].own_speed
        return part
    largest: float = abs(pairs[c].eta)
    if c > lo:
        largest = max(largest, abs(pairs[c - 1].eta))
    if c + 1 < hi:
        largest = max(largest, abs(pairs[c + 1].eta))
    return ULP * largest


@kernel
def hold_walls(pairs: Any, lo: int, hi: int, closing: float) -> None:
    """Let the rates between two walls sum up to that of the walls: roundings would wander, and squeeze or free them."""
    excess, largest = -closing, lo
    for c in range(lo, hi):
        excess += pairs[c].eta
        if abs(pairs[c].eta) > abs(pairs[largest].eta):
            largest = c
    pairs[largest].eta -= excess


@kernel
def finish_piece(run: Any, pairs: Any, bodies: Any, work: Any, lo: int) -> None:
    """Advance the block that starts with pair `lo` to the end of its piece."""
    block = pairs[lo]
    if block.clock == FREE:
        arrive(block)
    else:
        settle(run, pairs, bodies, work, lo, block.tau, elapsed(block.h, block.clock, block.tau))


@kernel
def bring(run: Any, pairs: Any, bodies: Any, work: Any, lo: int, t: float, tail: float) -> None:
    """Advance the block that starts with pair `lo` to the time t + tail, at most the end of its piece."""
    block = pairs[lo]
    dt = since(block, t, tail)
    if dt <= 0.0:  # it is there, but for what a single float cannot say
        return
    if block.clock == FREE:
        glide(block, dt)
    else:
        settle(run, pairs, bodies, work, lo, min(block.tau, tau_at(block.h, block.clock, dt)), dt)


@kernel
def regroup(run: Any, pairs: Any, bodies: Any, queue: Any, work: Any, lo: int, laws: Any) -> bool:
    """Form blocks anew after an event in the block that starts with `lo`; plan them; false at the stop condition."""
    hi, t, tail, stride = pairs[lo].hi, pairs[lo].t, pairs[lo].tail, pairs[lo].stride
    while True:
        while lo > 0 and pushes(pairs[lo]):
            lo = pairs[lo - 1].first
            absorb(run, pairs, bodies, queue, work, lo, t, tail)
        while hi < run.pairs and pushes(pairs[hi - 1]):
            absorb(run, pairs, bodies, queue, work, hi, t, tail)
            hi = pairs[hi].hi
        pairs[lo].t, pairs[lo].tail = t, tail
        found = engage(run, pairs, bodies, lo, hi)
        if found == AWAITED:
            return False
        if found == NONE:
            break
    a = lo
    for c in range(lo + 1, hi + 1):
        if c == hi or not (pushes(pairs[c - 1]) or pushes(pairs[c])):
            if not form(run, pairs, bodies, queue, work, a, c, t, tail, stride, laws):
                return False
            a = c
    return True


@kernel
def absorb(run: Any, pairs: Any, bodies: Any, queue: Any, work: Any, lo: int, t: float, tail: float) -> None:
    """Take the block that starts with pair `lo` out of the queue, advanced to the time t + tail."""
    bring(run, pairs, bodies, work, lo, t, tail)
    pairs[lo].due = math.inf
    play(queue, lo, pairs[lo].due)


@kernel
def form(
    run: Any, pairs: Any, bodies: Any, queue: Any, work: Any,
    lo: int, hi: int, t: float, tail: float, stride: float, laws: Any,
) -> bool:  # fmt: skip
    """Make pairs lo … hi-1 a block at time t + tail and plan its next piece; false at the stop condition."""
    block, going = pairs[lo], True
    block.t, block.tail, block.hi, block.stride = t, tail, hi, stride
    for c in range(lo, hi):
        pairs[c].first = lo
        if c > lo and pairs[c].due < math.inf:
            pairs[c].due = math.inf
            play(queue, c, pairs[c].due)
    if hi == lo + 1 and not pushes(block):
        if block.mode == OPEN and block.xi > 0.0:
            block.xi = 0.0
        predict(pairs, lo)
    else:
        going = plan(run, pairs, bodies, work, lo, hi, laws)
    play(queue, lo, pairs[lo].due)
    return going


@kernel
def go_on(run: Any, pairs: Any, bodies: Any, queue: Any, work: Any, lo: int, laws: Any) -> bool:
    """Plan the next piece of an island in which nothing has happened; false at the stop condition."""
    going = plan(run, pairs, bodies, work, lo, pairs[lo].hi, laws)
    play(queue, lo, pairs[lo].due)
    return going
