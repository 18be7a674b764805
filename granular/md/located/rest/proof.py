"""When a scene rests for good: no contact can ever open, and none can begin.

What the event loop asks first, `may_rest` and `may_creep`, is cheap, and never in vain: a block of which they say no is
none that could be proved to rest, or to creep. The proofs are needed seldom, and are compiled only then.

Every ball is in a group whose contacts never open (`equilibrium`), or flies, and no gap ever closes. A group reaches
at most to where its balls would lie if its overlaps were 0, as seen from its wall or its mass centre. That moves at
constant acceleration, as a flying ball does, so that the gap between two such hulls is a parabola.

A group that has come to its equilibrium, except for rounding, is put there and lies still, until a ball arrives.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import time_to_contact
from granular._engine.kernels import kernel
from granular.md.located.pieces import in_contact, power, since, write_flight
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, LIES, LINEAR, LONG, MOVES, OPEN, RESIDUAL
from granular.md.located.rest.equilibrium import (
    NOT_YET,
    RESTS,
    bound,
    end_of_group,
    is_known,
    kinetic,
    overlap_under,
    weight,
)

STILL = 1e-14
"""Part of the static overlaps, and of their natural rates, up to which a pile that rests is taken to be still."""
STIFF = 12.0
"""Ratio of the times of creep and of fast decay from which on the former is worth it, and sure to converge."""


@kernel
def may_rest(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, limit: float) -> bool:
    """Return whether a block whose piece is over without an event is to be looked at, for a run up to time `limit`."""
    if pool[pairs[lo].slot].manner != MOVES:
        return True  # already lying or creeping
    if run.rests == 1:
        return is_still(pairs, pool, lo)  # proved before
    c, active, known, damped = lo, False, True, True
    while c < pairs[lo].hi:
        pair, b = pool[pairs[c].slot], end_of_group(pairs, pool, c)
        if b == c and pair.mode != OPEN:
            return False  # touches without a force
        if b > c:
            if has_too_much(pairs, pool, bodies, c, b):
                return False  # too much energy
            active, known = True, known and is_known(pairs, pool, c, b)
            for i in range(c, b):
                damped = damped and pool[pairs[i].slot].gamma > 0.0
        c = max(b, c + 1)
    if not active or pairs[0].wall != 0 or pairs[len(pairs) - 1].wall != 0:
        return False  # nothing presses, or a wall moves
    doubted_block = pairs[pairs[run.doubted].first]
    has_event_due = doubted_block.slot < 0 and doubted_block.due < math.inf
    if not known or ((damped or limit == math.inf) and not has_event_due):
        return True
    # undamped, in a run that ends, or another block in doubt still has an event due
    return bool(damped and is_still(pairs, pool, lo))


@kernel
def has_too_much(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Return whether a group has more energy than one that can be proved to rest, as far as a bound of it tells.

    About its equilibrium a group has Σ D(ξ_c, r_c), with D(ξ, r) = U(ξ) - U(r) - U'(r) (ξ - r) and r_c its overlaps at
    rest: the more, the smaller these are, and they are not larger than under all of its weight.
    """
    energy = kinetic(pairs, pool, bodies, a, b)
    if is_known(pairs, pool, a, b):
        return not energy < pool[pairs[a].slot].opening
    if bodies[a].inverse_mass == 0.0 and bodies[b].inverse_mass == 0.0:
        return not energy < math.inf
    load, least, falls = abs(weight(bodies[a])), math.inf, False
    for c in range(a, b):
        load += abs(weight(bodies[c + 1]))
        falls = falls or pairs[c].pull > 0.0
    for c in range(a, b if falls else a):
        pair = pool[pairs[c].slot]
        least = min(least, highest_hurdle(pair, 1.001 * load))
        if not energy < least:
            return True  # most often: what follows adds to the one, and takes from the other
        energy += stored(pair, 1.001 * load)
    return not energy < (least if falls else 0.0)


@kernel
def stored(pair: Any, load: float) -> float:
    """Return an energy in J that is not above D(ξ, r), see `has_too_much`, of a pair that bears at most a load."""
    if pair.kind == GENERAL or not pair.k > 0.0:
        return 0.0
    rest = overlap_under(pair, load)
    if not pair.xi > 1.001 * rest:
        return 0.0
    p = pair.p + 1.0
    deeper = pair.k / p * (power(pair.xi, p) - power(rest, p)) - load * (pair.xi - rest)
    return float(max(0.0, 0.999 * deeper))


@kernel
def highest_hurdle(pair: Any, load: float) -> float:
    """Return an energy in J that is not below that with which a pair opens that bears at most a load."""
    if pair.kind == GENERAL or not pair.k > 0.0:
        return 0.0
    rest, exponent, most = overlap_under(pair, load), 2.0 * pair.s - 1.0, 0.0
    if pair.kind != ELASTIC and pair.gamma > 0.0 and pair.pull > 0.0 and exponent > 0.0:
        ratio = pair.gamma / pair.k
        turn = power(ratio * ratio * pair.pull / pair.s, 1.0 / exponent)
        most = pair.k * power(turn, pair.p) * turn + pair.pull * turn / (pair.s * pair.inverse)
    return float(max(load * rest, most))


@kernel
def is_still(pairs: Any, pool: Any, lo: int) -> bool:
    """Return whether the groups of a block are at the equilibrium that is noted of them, except for rounding."""
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            rest = overlap_under(pair, pair.load)
            rate = math.sqrt(pair.k * pair.p * power(rest, pair.p) / rest * pair.inverse)
            if abs(pair.xi - rest) > STILL * rest or abs(pair.eta) > STILL * rest * rate:
                return False
        elif not pair.xi < 0.0:
            return False
    return True


@kernel
def may_creep(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Return whether every pair of a block flies or is strongly damped, and something may press them together."""
    hi, active = pairs[lo].hi, False
    pressed = bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        active, pressed = active or pair.mode == ACTIVE, pressed or pair.pull > 0.0
        if pairs[c].wall != 0 or not (drags(pair) if pair.mode == ACTIVE else flies(pair)):
            return False
    return bool(active and pressed)


@kernel
def postpones(pairs: Any, pool: Any, lo: int) -> bool:
    """Return whether a block of linear pairs that may creep takes an ordinary step without a look at it.

    The fast motion of n balls takes about n² times as many steps to decay as that of one, and a look costs as much as
    ten steps. After k steps only one in 1 + √k/4 is looked at, so the creep is found at most about √k/4 steps late.
    """
    for c in range(lo, pairs[lo].hi):
        if pool[pairs[c].slot].kind != LINEAR:
            return False
    block = pool[pairs[lo].slot]
    block.doubts += 1
    return bool(block.doubts % (1 + int(0.25 * math.sqrt(block.doubts))) != 0)


@kernel
def drags(pair: Any) -> bool:
    """Return whether a pair that bears no load is damped strongly enough; under one it takes more."""
    if pair.kind == GENERAL or not (pair.gamma > 0.0 and pair.xi > 0.0):
        return False
    depth, exponent = 1.0, pair.d + 1.0 - pair.s
    if exponent != 0.0:
        depth = power(pair.xi, exponent)
    return bool(pair.gamma * pair.gamma * pair.inverse * depth > STIFF * pair.k)


@kernel
def flies(pair: Any) -> bool:
    """Return whether a pair has no force, and needs no power of its overlap to see it return."""
    return bool(pair.mode == OPEN or (pair.mode == RESIDUAL and pair.s == 1.0))


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
def come_to_rest(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
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

