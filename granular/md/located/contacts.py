"""The life of a contact: how its pair changes mode at an event."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.around import beside, count_of, nth
from granular.md.located.events import GRAZE
from granular.md.located.log import begin_contact, end_contact
from granular.md.located.pieces import direction, power, since
from granular.md.located.records import (
    ACTIVE,
    BEGIN,
    DORMANT,
    DRIVEN,
    END,
    HEATED,
    LINEAR,
    OPEN,
    PART,
    RELOAD,
    RESIDUAL,
    STOP,
    STRUCK,
    TURN,
)
from granular.md.located.touching import drifts, halt, is_awaited, stays, turns

ALL_BUT_ZERO = 1e-9
"""Part of its elastic force up to which the force of a contact that goes on is as located, 0."""


@kernel
def act(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, block: Any, laws: Any) -> bool:
    """Let the event happen that ends the piece of `block`; false if it meets the stop condition instead."""
    c, what = block.fired, block.what
    pair = pool[pairs[c].slot]
    if what == BEGIN:
        return begin(run, pairs, pool, bodies, c, block.speed, laws)
    run.events += 1
    if what == TURN:
        pair.loading, pair.top, pair.eta = 0, pair.xi, min(0.0, pair.eta)
    elif what == RELOAD:
        pair.loading, pair.xi = 1, pair.top
    elif (what == PART or pair.xi <= GRAZE * pair.own_length) and stays(pair, block.speed):
        pair.mode, pair.xi = DORMANT, 0.0
        halt(pairs, pool, bodies, c)
    else:
        if pair.begun == 1:
            end_contact(run, pairs, pool, bodies, log, c)
        if what == END:
            pair.mode, pair.exact = RESIDUAL, 1
        else:
            pair.xi = pair.xi if pair.mode == DORMANT else 0.0
            pair.mode, pair.exact, pair.top, pair.loading, pairs[c].alone = OPEN, 0, 0.0, 1, 0
    return True


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
                return meddle(run, pairs, pool, c, 0)
    return activate(run, pairs, pool, bodies, c)


@kernel
def activate(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> bool:
    """Begin the contact of pair `c`; false if the run is to stop just before."""
    pair = pool[pairs[c].slot]
    if pair.begun == 1:  # only slept for a moment
        pair.mode = ACTIVE
        return True
    if is_awaited(run, pairs, c):
        return False
    if not meddle(run, pairs, pool, c, 1):
        return False
    if pair.mode != DORMANT:  # else it has been under way since it was touched
        begin_contact(run, pairs, pool, bodies, c)
    pair.exact = 1 if pair.mode == RESIDUAL and not ((DRIVEN or HEATED) and has_jumped(pair)) else 0
    pair.mode, pair.begun = ACTIVE, 1
    pairs[c].count += 1
    run.events += 1
    run.begun += 1
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
    if is_awaited(run, pairs, c) or not meddle(run, pairs, pool, c, 1):
        return False
    pair.mode = STRUCK
    pairs[c].count += 1
    run.events += 1
    run.begun += 1
    return True


@kernel
def meddle(run: Any, pairs: Any, pool: Any, c: int, more: int) -> bool:
    """Count `more` contacts of pair `c`, whose overlap or push begins, as isolated, unless a neighbour overlaps: then
    none is, neither of its overlap nor of the neighbour's.

    Returns false if the run is to stop before two neighbours first overlap.
    """
    alone = True
    below, above = beside(pairs, c)
    for f in (below, above):
        if 0 <= f < count_of(pairs) and overlaps(pairs[f], pool, run):
            alone = False
            run.isolated -= max(0, pairs[f].alone)
            pairs[f].alone = -1
            if run.first < 0:
                run.first, run.disturbed = f if f == below else c, run.t
    if not alone and run.disturbing == STOP:
        return False
    if not alone:
        run.isolated -= max(0, pairs[c].alone)
        pairs[c].alone = -1
    elif pairs[c].alone >= 0:
        pairs[c].alone += more
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
