"""Pairs that touch at rest, or part with no more energy than rounding: which stay, and which of them forces press."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.around import count_of, is_closed, nth
from granular.md.located.log import begin_contact
from granular.md.located.pieces import DRIFT, direction, power
from granular.md.located.records import (
    ACTIVE,
    DORMANT,
    DRIVEN,
    GENERAL,
    HEATED,
    HUNG,
    LINEAR,
    OPEN,
    RESIDUAL,
    RING,
)

NONE, SOME, AWAITED = range(3)
"""What `engage` has found: no pair that touches at rest, some, or the contact at which the run is to stop."""


@kernel
def pushes(pair: Any) -> bool:
    """Return whether the pair needs a power series: for its force, or to see its force return.

    Else it is ballistic in closed form: open, clipped with φ = kξ + γη, or sure to part. In free flight φ = k ξ^s + γη
    is convex for s ≥ 1 and a pull that is not negative; clipped now, and again when ξ = 0 is reached, it is clipped in
    between. At a driven wall, and with pendula, nothing is so simple.
    """
    if HUNG or (DRIVEN and pair.wall > 0) or (HEATED and pair.wall < 0):
        return bool(pair.mode != OPEN)
    if pair.mode != RESIDUAL or pair.s == 1.0:
        return bool(pair.mode == ACTIVE or pair.mode == DORMANT)
    parts = pair.s > 1.0 and pair.pull >= 0.0 and pair.eta < 0.0
    return bool(not (parts and pair.eta * pair.eta > 2.0 * pair.pull * pair.xi))


@kernel
def engage(run: Any, pairs: Any, pool: Any, bodies: Any) -> int:
    """Make pairs dormant that touch at rest beside a force or under their own weight; return whether there were any.

    Forces only push, so that such a contact is sure to begin at once, if no gravity pulls the pair apart.
    """
    found, lo, hi = NONE, run.lo, run.hi
    closed = is_closed(pairs, lo, hi)
    for sweep in range(2):
        for i in range(hi - lo):
            c = lo + i if sweep == 0 else hi - 1 - i
            pair = pool[pairs[c].slot]
            if HEATED and pair.wall < 0:
                continue
            if (pair.mode == OPEN and pair.xi == 0.0 and pair.eta == 0.0) and (
                pair.pull > 0.0
                or (DRIVEN and pair.pull == 0.0 and pair.wall > 0)
                or ((c > lo or closed) and pushes(pool[pairs[nth(pairs, c - 1)].slot]))
                or ((c + 1 < hi or closed) and pushes(pool[pairs[nth(pairs, c + 1)].slot]))
            ):
                c = nth(pairs, c)
                if is_awaited(run, pairs, c) and pair.pull >= 0.0:
                    return AWAITED
                begin_contact(run, pairs, pool, bodies, c)
                pair.mode, found = DORMANT, SOME
    return found


@kernel
def judge(pairs: Any, pool: Any, lo: int, hi: int) -> bool:
    """Open pairs that the computed series pulls apart from rest, close those it presses; return whether any changed."""
    changed = False
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if HEATED and pair.wall < 0:
            continue
        if pair.kind != GENERAL and pair.xi == 0.0 and pair.eta == 0.0 and (pair.mode == DORMANT or pair.mode == OPEN):
            way = direction(pair.x)
            if way != 0.0 and (way > 0.0) == (pair.mode == OPEN):
                pair.mode = DORMANT if pair.mode == OPEN else OPEN
                changed = True
    return changed


@kernel
def stays(pair: Any, speed: float) -> bool:
    """Return whether a pair that parts comes up to where it touches with no more energy than rounding.

    So does a ball that gravity holds, and a law that is a function, has touched at rest and woken, by its rounding.
    """
    if pair.mode != ACTIVE:
        return False
    if pair.kind == GENERAL and pair.wake > 0.0 and drifts(pair):
        return True
    held = pair.kind != LINEAR and pair.pull > 0.0
    return bool(held and pair.eta * pair.eta <= DRIFT * pair.noise * max(speed, speed_of_weight(pair)))


@kernel
def turns(pairs: Any, pool: Any, c: int, speed: float) -> bool:
    """Return whether balls that gravity parts come up to where they touch with no more energy than rounding.

    Alone in their flight they have no island that could feel it.
    """
    pair, lo = pool[pairs[c].slot], pairs[c].first
    hi = pairs[lo].hi
    for i in range(lo, hi):
        speed = max(speed, speed_of_weight(pool[pairs[i].slot]))
    return bool(pair.pull < 0.0 and hi - lo > 1 and pair.eta * pair.eta <= DRIFT * pair.noise * speed)


@kernel
def drifts(pair: Any) -> bool:
    """Return whether the rate of a pair is no more than the noise it may hold."""
    return bool(abs(pair.eta) <= DRIFT * pair.noise)


@kernel
def speed_of_weight(pair: Any) -> float:
    """Return the speed in m/s that gravity gives the balls of a pair over the overlap at which their force balances."""
    pull = abs(pair.pull)
    return math.sqrt(2.0 * pull * power(pull / (pair.k * pair.inverse), 1.0 / pair.p))


@kernel
def halt(pairs: Any, pool: Any, bodies: Any, c: int) -> None:
    """Take its rate from pair `c` of a block, by an impulse between its balls that their other neighbours feel too."""
    pair, lo, hi = pool[pairs[c].slot], pairs[c].first, pairs[pairs[c].first].hi
    impulse, closed = pair.eta / pair.inverse, is_closed(pairs, lo, hi)
    pair.eta = 0.0
    bodies[c].v -= pair.lower * impulse
    bodies[nth(pairs, c + 1)].v += pair.upper * impulse
    if RING and c < lo:
        c += count_of(pairs)
    if c > lo or closed:
        pool[pairs[nth(pairs, c - 1)].slot].eta += pair.lower * impulse
    if c + 1 < hi or closed:
        pool[pairs[nth(pairs, c + 1)].slot].eta += pair.upper * impulse


@kernel
def is_awaited(run: Any, pairs: Any, c: int) -> bool:
    """Return whether the run is to stop just before the next contact of pair `c`."""
    return bool(c == run.until_pair and pairs[c].count + 1 == run.until_nth)
