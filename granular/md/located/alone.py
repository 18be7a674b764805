"""The contact of one pair alone, by pieces: to look into one solved at once, to go on from within, to table it.
May be skipped: one contact again, by pieces.

`follow_alone` says what is asked; `plan.planned` computes piece after piece, for every piece is planned in one place.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import time_to_contact
from granular._kernels import kernel
from granular.md.located.driven import beside_edge, jump_at
from granular.md.located.ledger import begin_alone, enter_alone, enter_run_off
from granular.md.located.log import follow
from granular.md.located.pieces import fly, force_returns, piece_time, power, tick, value
from granular.md.located.pool import join
from granular.md.located.records import ACTIVE, BEGIN, DRIVEN, EDGE, END, OPEN, PART, RELOAD, RESIDUAL, TURN, WORKED
from granular.md.located.touching import pushes

PIECES = 2000
"""Pieces after which a contact is taken to go on forever."""


@kernel
def enter(s: Any, c: int, v: float) -> Any:
    """Take a place in the pool for pair `c`, a block of its own whose balls have just touched at speed `v`."""
    pair = s.pairs[c]
    alone = pair.alone
    join(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, c)
    member, pair.alone = s.pool[pair.slot], alone
    member.xi, member.eta, member.mode, member.exact, member.begun = 0.0, v, ACTIVE, 0, 1
    member.t, member.tail = pair.t, pair.tail
    member.duration, member.impulse, member.force_max, member.xi_max = 0.0, 0.0, 0.0, 0.0
    return member


@kernel
def follow_alone(s: Any, c: int, left: float) -> None:
    """Ask that a contact that has just begun be taken on for a time `left`, or until its balls part.

    `planned` does it, and leaves in the record of the run when its force was over (nan: it was not), the rate at which
    the balls were parting then, the time that has passed, and the place τ on the last piece. Balls that part are OPEN;
    what has no end is not, nor what the force comes back to, which is another contact.
    """
    run = s.run[0]
    run.alone, run.pieces, run.left, run.passed, run.at = c, 0, left, 0.0, 0.0
    run.over, run.parting = math.nan, math.nan
    if WORKED:
        begin_alone(s.ledger)


@kernel
def has_piece(s: Any, laws: Any) -> bool:
    """Return whether the contact that is followed alone has a next piece; what runs off flies on as far as it may."""
    run, member = s.run[0], s.pool[s.pairs[s.run[0].alone].slot]
    if not (run.left > run.passed or run.pieces < 0) or run.pieces == PIECES or member.mode == OPEN:
        return False
    run.pieces += 1
    if member.mode != RESIDUAL or pushes(member):
        return True
    wait, xi = time_to_contact(member.xi, member.eta, -member.pull), member.xi
    if run.passed + wait > run.left:
        fly(member, run.left - run.passed, s.walls)
        run.passed = run.left
        if WORKED:
            enter_run_off(s.ledger, member, laws, xi, member.xi)
    elif member.s != 1.0 or not force_returns(member, member) < wait:
        fly(member, wait, s.walls)
        member.xi, member.mode = 0.0, OPEN
        if WORKED:
            enter_run_off(s.ledger, member, laws, xi, 0.0)
        run.passed += wait
    return False


@kernel
def goes_on(s: Any, laws: Any) -> bool:
    """Take the contact that is followed alone over its piece; false if that was the last one."""
    run, c = s.run[0], s.run[0].alone
    member = s.pool[s.pairs[c].slot]
    tau = member.tau
    dt = piece_time(member)
    if run.passed + dt > run.left:
        dt = max(0.0, run.left - run.passed)
        tau = min(tau, power(dt, 1.0 / member.clock) / member.h)
    if WORKED:
        enter_alone(s.ledger, s.walls, laws, s, c, tau)
    if run.log > 0:
        follow(run, s.pairs, s.pool, s.work, c, tau)
    member.xi, member.eta, member.exact, member.tau = value(member.x, tau), value(member.e, tau), 0, 0.0
    tick(member, dt)
    run.passed += dt
    if not run.passed < run.left:
        run.at = tau
        return False
    if DRIVEN and member.what == EDGE and member.wall > 0:
        tick(member, beside_edge(s.walls, member, member))
        jump, slip = jump_at(s.walls, member, member.t, member.tail)
        member.eta += slip
        if jump != 0.0:
            jolted(run, member, laws)
    if member.fired == c:
        if member.what == BEGIN:
            return False
        if member.mode == ACTIVE and (member.what == END or member.what == PART):
            run.over, run.parting = run.passed, -member.eta
        happen(member)
    return True


@kernel
def jolted(run: Any, member: Any, laws: Any) -> None:
    """Let the force of a contact alone end or return where the velocity of its wall has jumped."""
    member.exact = 0
    if laws is not None:
        clipped = laws.is_clipped(member)
    else:
        clipped = member.k * power(member.xi, member.s) + member.gamma * member.eta < 0.0
    if member.mode == ACTIVE and clipped:
        run.over, run.parting, member.mode = run.passed, -member.eta, RESIDUAL
    elif member.mode == RESIDUAL and not clipped:
        member.mode = ACTIVE


@kernel
def happen(member: Any) -> None:
    """Let the event happen that ends the piece of a contact alone."""
    if member.what == END:
        member.mode, member.exact = RESIDUAL, 1
    elif member.what == TURN:
        member.loading, member.top, member.eta = 0, member.xi, min(0.0, member.eta)
    elif member.what == RELOAD:
        member.loading, member.xi = 1, member.top
    else:
        member.mode, member.xi, member.exact = OPEN, 0.0, 0
