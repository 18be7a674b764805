"""The contact of one pair alone, by pieces: to look into one solved at once, to go on from within, to table it.
May be skipped: one contact again, by pieces.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import time_to_contact
from granular._kernels import kernel
from granular.md.located.contacts import follow, pushes
from granular.md.located.pieces import elapsed, fly, force_returns, power, tick, value
from granular.md.located.plan import join, plan
from granular.md.located.system import ACTIVE, BEGIN, END, OPEN, PART, RELOAD, RESIDUAL, TURN

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
def live(s: Any, c: int, left: float, laws: Any) -> tuple[float, float, float, float]:
    """Take a contact that has just begun on for a time `left`, or until its balls part.

    Returns when its force was over (nan: it was not), the place τ on the last piece, the time that passed, and the rate
    at which they were parting when the force was over. Balls that part are OPEN; what has no end is not, nor what the
    force comes back to, which is another contact.
    """
    run, member, passed, over, v1 = s.run[0], s.pool[s.pairs[c].slot], 0.0, math.nan, math.nan
    for _ in range(PIECES):
        if not left > passed:
            break
        if member.mode == RESIDUAL and not pushes(member):
            wait = time_to_contact(member.xi, member.eta, -member.pull)
            if passed + wait > left:
                fly(member, left - passed)
                return over, 0.0, left, v1
            if member.s != 1.0 or not force_returns(member, member) < wait:
                fly(member, wait)
                member.xi, member.mode, passed = 0.0, OPEN, passed + wait
            break
        plan(run, s.pairs, s.pool, s.bodies, s.work, c, laws)
        tau = member.tau
        dt = elapsed(member.h, member.clock, tau)
        if passed + dt > left:
            dt = left - passed
            tau = min(tau, power(dt, 1.0 / member.clock) / member.h)
        if run.log > 0:
            follow(run, s.pairs, s.pool, s.work, c, tau)
        member.xi, member.eta, member.exact, member.tau = value(member.x, tau), value(member.e, tau), 0, 0.0
        tick(member, dt)
        passed += dt
        if not passed < left:
            return over, tau, passed, v1
        if member.fired == c:
            if member.what == BEGIN:
                break
            if member.mode == ACTIVE and (member.what == END or member.what == PART):
                over, v1 = passed, -member.eta
            happen(member)
            if member.mode == OPEN:
                break
    return over, 0.0, passed, v1


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
