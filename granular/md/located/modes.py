"""What an event does to a pair, and what becomes of pairs that touch at rest."""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.contacts import begin_contact, end_contact
from granular.md.located.events import BEGIN, END, GRAZE, PART, RELOAD, TURN
from granular.md.located.flight import DRIFT
from granular.md.located.powers import power
from granular.md.located.records import ACTIVE, DORMANT, GENERAL, LINEAR, OPEN, ORDER, RESIDUAL


@kernel
def act(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, block: Any, laws: Any) -> bool:
    """Let the event happen that ends the piece of `block`; false if it meets the stop condition instead."""
    c, what = block.fired, block.what
    pair = pool[pairs[c].slot]
    if what == BEGIN:
        if pair.mode == OPEN:
            pair.xi = 0.0
            if drifts(pair) or pair.eta < 0.0:  # grazed, or touching at rest
                pair.eta = min(0.0, pair.eta)
                return True
            if turns(pairs, pool, block, c):
                halt(pairs, pool, bodies, c)
                return True
            if laws is not None:
                pair.mode = OPEN if laws.pushes_at_touch(c, pair) else RESIDUAL
                if pair.mode == RESIDUAL:
                    return True
        return activate(run, pairs, pool, bodies, c)
    run.events += 1
    if what == TURN:
        pair.loading, pair.top, pair.eta = 0, pair.xi, min(0.0, pair.eta)
        return True
    if what == RELOAD:
        pair.loading, pair.xi = 1, pair.top
        return True
    if (what == PART or pair.xi <= GRAZE * pair.own_length) and (stays(pair, block) or is_rounding(pair)):
        pair.mode, pair.xi = DORMANT, 0.0
        halt(pairs, pool, bodies, c)
        return True
    if pair.begun == 1:
        end_contact(run, pairs, pool, bodies, log, c)
    if what == END:
        pair.mode, pair.exact = RESIDUAL, 1
    else:
        if pair.mode != DORMANT:
            pair.xi = 0.0
        pair.mode, pair.exact, pair.top, pair.loading = OPEN, 0, 0.0, 1
    return True


@kernel
def stays(pair: Any, block: Any) -> bool:
    """Return whether a ball that gravity holds comes up to where it touches with no more energy than rounding."""
    if pair.mode != ACTIVE or pair.kind == LINEAR or pair.pull <= 0.0:
        return False
    return bool(pair.eta * pair.eta <= DRIFT * pair.noise * max(block.speed, speed_of_weight(pair)))


@kernel
def turns(pairs: Any, pool: Any, block: Any, c: int) -> bool:
    """Return whether balls that gravity parts come up to where they touch with no more energy than rounding.

    Alone in their flight they have no island that could feel it.
    """
    pair, lo, typical = pool[pairs[c].slot], pairs[c].first, block.speed
    hi = pairs[lo].hi
    for i in range(lo, hi):
        typical = max(typical, speed_of_weight(pool[pairs[i].slot]))
    return bool(pair.pull < 0.0 and hi - lo > 1 and pair.eta * pair.eta <= DRIFT * pair.noise * typical)


@kernel
def speed_of_weight(pair: Any) -> float:
    """Return the speed in m/s that gravity gives the balls of a pair over the overlap at which their force balances."""
    pull = abs(pair.pull)
    return math.sqrt(2.0 * pull * power(pull / (pair.k * pair.inverse), 1.0 / pair.p))


@kernel
def halt(pairs: Any, pool: Any, bodies: Any, c: int) -> None:
    """Take its rate from pair `c` of a block, by an impulse between its balls that their other neighbours feel too."""
    pair = pool[pairs[c].slot]
    impulse, lo = pair.eta / pair.inverse, pairs[c].first
    pair.eta = 0.0
    bodies[c].v -= pair.lower * impulse
    bodies[c + 1].v += pair.upper * impulse
    if c > lo:
        pool[pairs[c - 1].slot].eta += pair.lower * impulse
    if c + 1 < pairs[lo].hi:
        pool[pairs[c + 1].slot].eta += pair.upper * impulse


@kernel
def is_rounding(pair: Any) -> bool:
    """Return whether a pair that has touched at rest, and woke, shows no more than what rounding makes of its law."""
    return bool(pair.mode == ACTIVE and pair.kind == GENERAL and pair.wake > 0.0 and drifts(pair))


@kernel
def drifts(pair: Any) -> bool:
    """Return whether the rate of a pair is no more than the noise it may hold."""
    return bool(abs(pair.eta) <= DRIFT * pair.noise)


@kernel
def activate(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> bool:
    """Begin the contact of pair `c`; false if the run is to stop just before."""
    pair = pool[pairs[c].slot]
    if pair.begun == 1:  # only slept for a moment
        pair.mode = ACTIVE
        return True
    if is_awaited(run, pairs, c):
        return False
    if pair.mode != DORMANT:  # else it has been under way since it was touched
        begin_contact(run, pairs, pool, bodies, c)
    pair.exact = 1 if pair.mode == RESIDUAL else 0
    pair.mode, pair.begun = ACTIVE, 1
    pairs[c].count += 1
    run.events += 1
    run.begun += 1
    return True


@kernel
def is_awaited(run: Any, pairs: Any, c: int) -> bool:
    """Return whether the run is to stop just before the next contact of pair `c`."""
    return bool(c == run.until_pair and pairs[c].count + 1 == run.until_nth)


@kernel
def pushes(pair: Any) -> bool:
    """Return whether the pair needs a power series: for its force, or to see its force return."""
    return bool(pair.mode == ACTIVE or pair.mode == DORMANT or (pair.mode == RESIDUAL and not flies(pair)))


@kernel
def flies(pair: Any) -> bool:
    """Return whether the pair itself is ballistic in closed form: open, clipped with φ = kξ + γη, or sure to part.

    In free flight φ = k ξ^s + γη is convex for s ≥ 1 and a pull that is not negative; clipped now, and again when ξ = 0
    is reached, it is clipped in between.
    """
    if pair.mode == OPEN or (pair.mode == RESIDUAL and pair.s == 1.0):
        return True
    if pair.mode != RESIDUAL or pair.s < 1.0 or pair.pull < 0.0 or pair.kind == GENERAL:
        return False
    return bool(pair.eta < 0.0 and pair.eta * pair.eta > 2.0 * pair.pull * pair.xi)


@kernel
def touches(pair: Any) -> bool:
    """Return whether the balls of an open pair touch at rest."""
    return bool(pair.mode == OPEN and pair.xi == 0.0 and pair.eta == 0.0)


NONE, SOME, AWAITED = range(3)
"""What `engage` has found: no pair that touches at rest, some, or the contact at which the run is to stop."""


@kernel
def engage(run: Any, pairs: Any, pool: Any, bodies: Any) -> int:
    """Make pairs dormant that touch at rest beside a force or under their own weight; return whether there were any.

    Forces only push, so that such a contact is sure to begin at once, if no gravity pulls the pair apart.
    """
    found, lo, hi = NONE, run.lo, run.hi
    for sweep in range(2):
        for i in range(hi - lo):
            c = lo + i if sweep == 0 else hi - 1 - i
            pair = pool[pairs[c].slot]
            if touches(pair) and (
                pair.pull > 0.0
                or (c > lo and pushes(pool[pairs[c - 1].slot]))
                or (c + 1 < hi and pushes(pool[pairs[c + 1].slot]))
            ):
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
        if pair.kind != GENERAL and pair.xi == 0.0 and pair.eta == 0.0 and (pair.mode == DORMANT or pair.mode == OPEN):
            way = direction(pair.x)
            if way < 0.0 and pair.mode == DORMANT:
                pair.mode = OPEN
                changed = True
            elif way > 0.0 and pair.mode == OPEN:
                pair.mode = DORMANT
                changed = True
    return changed


@kernel
def direction(x: Any) -> float:
    """Return the first coefficient that is not zero: where a pair at rest goes. (The last may vanish by parity.)"""
    for j in range(1, ORDER + 1):
        if x[j] != 0.0:
            first: float = x[j]
            return first
    return 0.0


@kernel
def confirm(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, hi: int) -> bool:
    """Begin the linear contacts the series presses together from rest; false if the run is to stop just before."""
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        presses = pair.mode == DORMANT and pair.kind == LINEAR and direction(pair.x) > 0.0
        if presses and not activate(run, pairs, pool, bodies, c):
            return False
    return True
