"""When a scene rests for good: no contact can ever open, and none can begin.
May be skipped: rarer, piles that come to rest.

Every ball is in a group whose contacts never open (`equilibrium`), or flies, and no gap ever closes. A group reaches
at most to where its balls would lie if its overlaps were 0, as seen from its wall or its mass centre. That moves at
constant acceleration, as a flying ball does, so that the gap between two such hulls is a parabola.

A group that has come to its equilibrium, except for rounding, is put there and lies still, until a ball arrives. Of a
law that is a function it can only be seen that every force balances to rounding, at rest, and grows with the overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._flight import time_to_contact
from granular._kernels import kernel
from granular.md.located.equilibrium import NOT_YET, RESTS, bound, end_of_group, find_loads, overlap_under
from granular.md.located.near_rest import STILL, is_still
from granular.md.located.pieces import in_contact, since, write_flight
from granular.md.located.records import ACTIVE, LIES, LONG, OPEN

AtRest = Callable[[Any, float], float]
"""Force in N of a pair at an overlap in m."""
TANGENT = 1e-6
"""Part of an overlap over which its stiffness is taken."""
ROUNDING = 1e-11
"""Part of the accelerations of a pair, and of its block's speed, up to which their sum, and its rate, is rounding."""


@kernel
def verdict(pairs: Any, pool: Any, bodies: Any, lo: int) -> int:
    """Return what is proved of the groups of the block that starts with pair `lo`, as long as no ball arrives.

    Where a wall is driven or thermal nothing is.
    """
    c, proved = lo, NOT_YET
    if pairs[0].wall != 0 or pairs[len(pairs) - 1].wall != 0:
        return NOT_YET
    while c < pairs[lo].hi:
        mode, b = pool[pairs[c].slot].mode, c + 1
        if mode == ACTIVE:
            b = end_of_group(pairs, pool, c)
            found = bound(pairs, pool, bodies, c, b)
            if found == NOT_YET:
                return NOT_YET
            proved = max(proved, found)
        elif mode != OPEN:
            return NOT_YET
        c = b
    return proved


@kernel
def whole_verdict(run: Any, pairs: Any, pool: Any, bodies: Any) -> int:
    """Return what is proved of the scene; notes energy and barrier of the group that is nearest to open.

    Begins with the block that was in doubt when last asked.
    """
    n, proved, run.energy, run.barrier = len(pairs), RESTS, 0.0, math.inf
    c = start = pairs[run.doubted].first
    while True:
        found = RESTS
        if pairs[c].slot >= 0:
            found = verdict(pairs, pool, bodies, c)
        if found == NOT_YET or closes(run, pairs, pool, bodies, c):
            run.doubted = c
            return NOT_YET
        nearest(run, pairs, pool, c)
        proved = max(proved, found)
        c = pairs[c].hi % n
        if c == start:
            break
    run.rests = 1 if proved == RESTS else 0
    return proved


@kernel
def nearest(run: Any, pairs: Any, pool: Any, lo: int) -> None:
    """Note energy and barrier of a group of a block if it is nearer to open than those looked at before."""
    for c in range(lo, pairs[lo].hi if pairs[lo].slot >= 0 else lo):
        pair = pool[pairs[c].slot]
        heads = pair.mode == ACTIVE and (c == lo or pool[pairs[c - 1].slot].mode != ACTIVE)
        if heads and pair.energy * run.barrier >= run.energy * pair.barrier:
            run.energy, run.barrier = pair.energy, pair.barrier


@kernel
def closes(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Return whether a gap of the block that starts with pair `lo` may ever close, or is not open yet."""
    if pairs[lo].slot < 0:
        return bool(pairs[lo].due < math.inf or in_contact(pairs[lo], run.t, run.tail))
    for c in range(lo, pairs[lo].hi):
        if pool[pairs[c].slot].mode == OPEN:
            gap, rate, pull = between(pairs, pool, bodies, lo, c)
            if not (gap > 0.0 and time_to_contact(gap, rate, pull) == math.inf):
                return True
    return False


@kernel
def between(pairs: Any, pool: Any, bodies: Any, lo: int, c: int) -> tuple[float, float, float]:
    """Return the gap between the hulls beside the open pair `c` of a block, its rate, and the acceleration at which it
    closes."""
    block = pool[pairs[lo].slot]
    inner, v_lower, fall_lower, size_lower = hull(pairs, pool, bodies, block, c, -1)
    outer, v_upper, fall_upper, size_upper = hull(pairs, pool, bodies, block, c, 1)
    pull = fall_upper - fall_lower
    if abs(pull) <= STILL * max(size_lower, size_upper):
        pull = 0.0
    return -pool[pairs[c].slot].xi - inner - outer, v_upper - v_lower, pull


@kernel
def hull(pairs: Any, pool: Any, bodies: Any, block: Any, c: int, way: int) -> tuple[float, float, float, float]:
    """Return of the group, ball or wall below the open pair `c` of a block (way -1) or above it (way 1): by how much
    its hull goes beyond it, velocity and fall of its wall or mass centre, and the size of what its fall sums up."""
    first = c if way < 0 else c + 1
    b, f = first, c + way
    while 0 <= f < len(pairs) and pairs[f].slot >= 0 and pool[pairs[f].slot].mode == ACTIVE:
        b, f = b + way, f + way
    if bodies[b].inverse_mass == 0.0:
        reach = 0.0
        for i in range(abs(b - first)):
            reach += pool[pairs[c + way * (i + 1)].slot].xi
        return reach, float(bodies[b].v), 0.0, 0.0
    if b == first:
        body = bodies[b]
        return 0.0, float(body.v - body.fall * since(body, block.t, block.tail)), float(body.fall), 0.0
    mass = momentum = falls = size = reach = 0.0
    for i in range(abs(b - first) + 1):
        body = bodies[b - way * i]
        own = 1.0 / body.inverse_mass
        mass += own
        momentum += own * (body.v - body.fall * since(body, block.t, block.tail))
        falls += own * body.fall
        size += own * abs(body.fall)
        if b - way * i != first:  # the pair towards the open one
            reach += mass * pool[pairs[f - way * (i + 1)].slot].xi
    return reach / mass, momentum / mass, falls / mass, size / mass


@kernel
def settles(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Return whether the groups of a block are so near to their equilibrium that the difference is rounding; if so, put
    them there: they lie still."""
    if not is_still(pairs, pool, lo):
        return False
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            pair.xi, pair.eta = overlap_under(pair, pair.load), 0.0
        else:
            pair.eta = -between(pairs, pool, bodies, lo, c)[1]
    pool[pairs[lo].slot].manner = LIES
    return True


@kernel
def lie(pairs: Any, pool: Any, bodies: Any, lo: int) -> None:
    """Write the piece of a block whose groups lie still: it has no end, unless a ball arrives."""
    block = pool[pairs[lo].slot]
    block.clock, block.linear, block.h = 1, 1, LONG
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == OPEN:
            pull = between(pairs, pool, bodies, lo, c)[2]
            block.h = min(block.h, 2.0 * time_to_contact(max(0.0, -pair.xi), -pair.eta, pull))
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            write_flight(pair, block.h, 0.0, pair.load)
        else:
            write_flight(pair, block.h, between(pairs, pool, bodies, lo, c)[2], 0.0)


def lone_pile(s: Any) -> tuple[int, int]:
    """Return first pair and end of the one group of a scene, a pile at a wall, and note its loads; (0, 0) if there is
    none, a pair bears nothing at rest, or a gap may close."""
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    pressed = [c for c, p in enumerate(pairs) if p.slot >= 0 and pool[p.slot].mode != OPEN]
    if not pressed:
        return 0, 0
    a, b = pressed[0], end_of_group(pairs, pool, pressed[0])
    at_one_wall = (bodies[a].inverse_mass == 0.0) != (bodies[b].inverse_mass == 0.0)
    if b - a < len(pressed) or not at_one_wall or pairs[0].wall != 0 or pairs[-1].wall != 0:
        return 0, 0
    if not find_loads(pairs, pool, bodies, a, b) or min(pool[pairs[c].slot].load for c in pressed) <= 0.0:
        return 0, 0
    starts = (c for c, p in enumerate(pairs) if p.first == c)
    return (0, 0) if any(closes(run, pairs, pool, bodies, c) for c in starts) else (a, b)


def lie_still(pairs: list[Any], at_rest: AtRest, closed: bool) -> bool:
    """Write the piece of a block that lies still, and return whether it does; `closed` if it is a ring."""
    block = pairs[0]
    if any(p.mode not in (OPEN, ACTIVE) or (p.mode == ACTIVE and not abs(p.eta) <= STILL * block.speed) for p in pairs):
        return False
    force = [at_rest(p, p.xi) if p.mode == ACTIVE else 0.0 for p in pairs]
    push = accelerations(pairs, force, closed)
    deeper = {i: at_rest(p, p.xi * (1.0 + TANGENT)) for i, p in enumerate(pairs) if p.mode == ACTIVE}
    if not deeper or not all(balances(pairs[i], push[i], force[i], more) for i, more in deeper.items()):
        return False
    arrivals = [time_to_contact(max(0.0, -p.xi), -p.eta, a) for p, a in zip(pairs, push, strict=True) if p.mode == OPEN]
    if 0.0 in arrivals:  # the run has stopped where a ball arrives
        return False
    block.clock, block.h, block.stride = 1, min([LONG, *(2.0 * t for t in arrivals)]), 0.0
    for p, f, a in zip(pairs, force, push, strict=True):
        if p.mode == ACTIVE or abs(p.eta) <= ROUNDING * block.speed:
            p.eta = 0.0
        write_flight(p, block.h, a if p.mode == OPEN else 0.0, f)
    return True


def accelerations(pairs: list[Any], force: list[float], closed: bool) -> list[float]:
    """Closing accelerations in m/s² of all pairs, 0 where those of open ones are rounding."""
    first, last = (force[-1], force[0]) if closed else (0.0, 0.0)
    out = []
    for p, below, own, above in zip(pairs, [first, *force[:-1]], force, [*force[1:], last], strict=True):
        parts = (p.pull, p.lower * below, -p.inverse * own, p.upper * above)
        total = math.fsum(parts)
        rounding = p.mode == OPEN and abs(total) <= ROUNDING * max(map(abs, parts))
        out.append(0.0 if rounding else total)
    return out


def balances(pair: Any, push: float, force: float, more: float) -> bool:
    """Return whether a pair is at rest where its force balances, given the force a little deeper."""
    stiffness = (more - force) / (TANGENT * pair.xi)
    square = stiffness * pair.inverse
    if not (force > 0.0 and stiffness > 0.0):
        return False
    return bool(abs(push) <= STILL * pair.xi * square and abs(pair.eta) <= STILL * pair.xi * math.sqrt(square))
