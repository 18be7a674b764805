"""Whether a block may be at rest or creep: what the event loop asks before it leaves the proof to `at_rest`.
May be skipped: rarer, piles that come to rest.

The proofs are needed seldom, and are compiled only then. What is asked here is cheap, and is never in vain: a block of
which it says no is none that could be proved to rest, or to creep.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.equilibrium import end_of_group, is_known, kinetic, overlap_under, weight
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, MOVES, OPEN, RESIDUAL

STILL = 1e-14
"""Part of the static overlaps, and of their natural rates, up to which a pile that rests is taken to be still."""
STIFF = 12.0
"""Ratio of the times of creep and of fast decay from which on the former is worth it, and sure to converge."""


@kernel
def may_rest(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, limit: float) -> bool:
    """Return whether a block whose piece is over without an event is to be looked at, for a run up to time `limit`."""
    if pool[pairs[lo].slot].manner != MOVES:
        return True
    if run.rests == 1:
        return is_still(pairs, pool, lo)
    c, active, known, damped = lo, False, True, True
    while c < pairs[lo].hi:
        pair, b = pool[pairs[c].slot], end_of_group(pairs, pool, c)
        if b == c and pair.mode != OPEN:
            return False
        if b > c:
            if not kinetic(pairs, pool, bodies, c, b) < ceiling(pairs, pool, bodies, c, b):
                return False
            active, known = True, known and is_known(pairs, pool, c, b)
            for i in range(c, b):
                damped = damped and pool[pairs[i].slot].gamma > 0.0
        c = max(b, c + 1)
    if not active or pairs[0].wall != 0 or pairs[len(pairs) - 1].wall != 0:
        return False
    first = pairs[pairs[run.doubted].first]
    if not known or ((damped or limit == math.inf) and not (first.slot < 0 and first.due < math.inf)):
        return True
    return bool(damped and is_still(pairs, pool, lo))


@kernel
def ceiling(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> float:
    """Return an energy in J that a group that can be proved to rest does not have: what is noted of it, or more."""
    if is_known(pairs, pool, a, b):
        return float(pool[pairs[a].slot].opening)
    if bodies[a].inverse_mass == 0.0 and bodies[b].inverse_mass == 0.0:
        return math.inf
    load, least, falls = abs(weight(bodies[a])), math.inf, False
    for c in range(a, b):
        load += abs(weight(bodies[c + 1]))
        falls = falls or pairs[c].pull > 0.0
    for c in range(a, b if falls else a):
        least = min(least, highest_hurdle(pool[pairs[c].slot], 1.001 * load))
    return least if falls else 0.0


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
