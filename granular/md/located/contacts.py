"""The life of a contact: how its pair changes mode at an event: touch, end of the force, new push, parting.

Of pairs that touch at rest, or part with no more energy than rounding, it is judged which stay, and which of them
forces press.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, HUNG, RING, kernel
from granular.md.located.log import begin_contact, end_contact
from granular.md.located.pieces import DRIFT, GRAZE, direction, power, since
from granular.md.located.records import (
    ACTIVE,
    BEGIN,
    DORMANT,
    END,
    GENERAL,
    LINEAR,
    OPEN,
    PART,
    RELOAD,
    RESIDUAL,
    STOP,
    STRUCK,
    TURN,
)
from granular.md.located.system import beside, count_of, is_closed, nth

ALL_BUT_ZERO = 1e-9
"""Part of its elastic force up to which the force of a contact that goes on is as located, 0."""
NONE, SOME, AWAITED = range(3)
"""What `engage` has found: no pair that touches at rest, some, or the contact at which the run is to stop."""
TOUCH_ONLY, CONTACT = 0, 1
"""How many contacts `count_isolated` is told of: an overlap without a push, or one that pushes."""
DISTURBED = -1
"""For the number of isolated contacts of a pair, from when one was not until the pair is open."""


@kernel
def act(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, block: Any, laws: Any) -> bool:
    """Let the event happen that ends the piece of `block`; false if it meets the stop condition instead."""
    c, what = block.fired, block.event
    pair = pool[pairs[c].slot]
    if what == BEGIN:
        return begin(run, pairs, pool, bodies, c, block.speed, laws)
    run.events += 1
    if what in (TURN, RELOAD):
        change_branch(pair, what)
    elif (what == PART or pair.xi <= GRAZE * pair.own_length) and stays(pair, block.speed):
        pair.mode, pair.xi = DORMANT, 0.0
        halt(pairs, pool, bodies, c)
    else:
        if pair.going_on == 1:
            end_contact(run, pairs, pool, bodies, log, c)
        if what == END:
            pair.mode, pair.exact = RESIDUAL, 1
        else:
            pair.xi = pair.xi if pair.mode == DORMANT else 0.0
            pair.mode, pair.exact, pair.xi_peak, pair.loading, pairs[c].isolated = OPEN, 0, 0.0, 1, 0
    return True


@kernel
def change_branch(pair: Any, event: int) -> None:
    """Let a law with memory unload from here on (TURN), or load again."""
    if event == TURN:
        pair.loading, pair.xi_peak, pair.eta = 0, pair.xi, min(0.0, pair.eta)
    else:
        pair.loading, pair.xi = 1, pair.xi_peak


@kernel
def begin(run: Any, pairs: Any, pool: Any, bodies: Any, c: int, speed: float, laws: Any) -> bool:
    """Let the force of pair `c` begin; it has touched, or its force has returned."""
    pair = pool[pairs[c].slot]
    if HEATED and pair.wall < 0:
        return strike(run, pairs, pool, c)
    if pair.mode == OPEN:
        pair.xi = 0.0
        if drifts(pair) or pair.eta < 0.0:  # grazed, or touching at rest
            pair.eta = min(0.0, pair.eta)
            return True
        if turns(pairs, pool, c, speed):
            halt(pairs, pool, bodies, c)
            return True
        if laws is not None:
            pair.mode = OPEN if laws.pushes_at_touch(pair) else RESIDUAL
            if pair.mode == RESIDUAL:  # an overlap without a push
                return count_isolated(run, pairs, pool, c, TOUCH_ONLY)
    return activate(run, pairs, pool, bodies, c)


@kernel
def activate(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> bool:
    """Begin the contact of pair `c`; false if the run is to stop just before."""
    pair = pool[pairs[c].slot]
    if pair.going_on == 1:  # only slept for a moment
        pair.mode = ACTIVE
        return True
    if is_awaited(run, pairs, c):
        return False
    if not count_isolated(run, pairs, pool, c, CONTACT):
        return False
    if pair.mode != DORMANT:  # else it has been under way since it was touched
        begin_contact(run, pairs, pool, bodies, c)
    # RESIDUAL: its force was just found to be 0, unless its wall jumped
    pair.exact = 1 if pair.mode == RESIDUAL and not ((DRIVEN or HEATED) and has_jumped(pair)) else 0
    pair.mode, pair.going_on = ACTIVE, 1
    pairs[c].contacts += 1
    run.events += 1
    run.contacts += 1
    return True


@kernel
def has_jumped(pair: Any) -> bool:
    """Return whether the force of a clipped pair is back beyond rounding, for a velocity beside it has jumped."""
    stiff: float = pair.k * power(pair.xi, pair.s)
    return bool(stiff + pair.gamma * pair.eta > ALL_BUT_ZERO * stiff)


@kernel
def strike(run: Any, pairs: Any, pool: Any, c: int) -> bool:
    """Let the ball of pair `c` be about to be thrown back by its thermal wall; false if the run is to stop before."""
    pair = pool[pairs[c].slot]
    pair.xi = 0.0
    if pair.eta < 0.0:
        return True
    if is_awaited(run, pairs, c) or not count_isolated(run, pairs, pool, c, CONTACT):
        return False
    pair.mode = STRUCK
    pairs[c].contacts += 1
    run.events += 1
    run.contacts += 1
    return True


@kernel
def count_isolated(run: Any, pairs: Any, pool: Any, c: int, more: int) -> bool:
    """Count `more` contacts of pair `c`, whose overlap or push begins, as isolated, unless a neighbour overlaps: then
    none is, neither of its overlap nor of the neighbour's.

    Returns false if the run is to stop before two neighbours first overlap.
    """
    alone = True
    below, above = beside(pairs, c)
    for f in (below, above):
        if 0 <= f < count_of(pairs) and overlaps(pairs[f], pool, run):
            alone = False
            run.isolated -= max(0, pairs[f].isolated)
            pairs[f].isolated = DISTURBED
            if run.first < 0:
                run.first = f if f == below else c  # the lower of the two pairs
                run.disturbed = run.t
    if not alone and run.disturbing == STOP:
        return False
    if not alone:
        run.isolated -= max(0, pairs[c].isolated)
        pairs[c].isolated = DISTURBED
    elif pairs[c].isolated != DISTURBED:
        pairs[c].isolated += more
        run.isolated += more
    return True


@kernel
def overlaps(pair: Any, pool: Any, run: Any) -> bool:
    """Return whether the balls of a pair overlap, or rest on each other, at the time of the event under way."""
    if pair.slot >= 0:
        return bool(pool[pair.slot].mode != OPEN)
    return bool(pair.mode == RESIDUAL or (pair.lasts > 0.0 and since(pair, run.t, run.tail) < 0.0))


@kernel
def confirm(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, hi: int) -> bool:
    """Begin the linear contacts the series presses together from rest; false if the run is to stop just before."""
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if (
            pair.mode == DORMANT
            and pair.kind == LINEAR
            and direction(pair.x) > 0.0
            and not activate(run, pairs, pool, bodies, nth(pairs, c))
        ):
            return False
    return True


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
    closed = RING and is_closed(pairs, lo, hi)
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
    return bool(c == run.until_pair and pairs[c].contacts + 1 == run.until_nth)

