"""One contact again, from within: the pair is followed alone, by pieces, from the onset of its contact.

So one solved at once is looked into, or goes on as a member of an event that may disturb it: `relive` asks for that,
`plan.follow_contact` takes it there piece after piece, and then `expose` or `seen` take what they need.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swung, time_to_contact
from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.located.contacts import change_branch, pushes
from granular.md.located.ledger import LOST, begin, book, book_at_once, look_at_once, read, run_off, tally, tally_island
from granular.md.located.log import follow
from granular.md.located.pieces import fly, force_returns, in_contact, piece_time, power, since, tau_at, tick, value
from granular.md.located.records import (
    ACTIVE,
    AT_LEAST_ONE,
    BEGIN,
    EDGE,
    END,
    NO_LOG,
    OPEN,
    PART,
    RELOAD,
    RESIDUAL,
    TURN,
)
from granular.md.located.system import count_of, join, leave, nth
from granular.md.located.walls import beside_edge, flown, jump_at

MOST_PIECES = 2000
"""Pieces after which a contact is taken to go on forever."""


@kernel
def take_up(s: Any, c: int, v: float) -> Any:
    """Take a place in the pool for pair `c`, a block of its own whose balls have just touched at speed `v`."""
    pair = s.pairs[c]
    alone = pair.isolated
    join(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, c)
    member, pair.isolated = s.pool[pair.slot], alone
    member.xi, member.eta, member.mode, member.exact, member.going_on = 0.0, v, ACTIVE, 0, 1
    member.t, member.tail = pair.t, pair.tail
    member.duration, member.impulse, member.force_max, member.xi_max = 0.0, 0.0, 0.0, 0.0
    return member


@kernel
def ask_to_follow(s: Any, c: int, left: float) -> None:
    """Ask that a contact that has just begun be taken on for a time `left`, or until its balls part.

    `plan.follow_contact` does it, and leaves in the record of the run when its force was over (nan: it was not), the
    rate at which the balls were parting then, the time that has passed, and the place τ on the last piece. Balls that
    part are OPEN; what has no end is not, nor what the force comes back to, which is another contact.
    """
    run = s.run[0]
    run.solo, run.pieces, run.left, run.passed, run.at = c, 0, left, 0.0, 0.0
    run.over, run.parting = math.nan, math.nan
    if WORKED:
        begin(s.ledger[0].solo)


@kernel
def has_piece(s: Any, laws: Any) -> bool:
    """Return whether the contact that is followed alone has a next piece; what runs off flies on as far as it may."""
    run, member = s.run[0], s.pool[s.pairs[s.run[0].solo].slot]
    if not (run.left > run.passed or run.pieces == AT_LEAST_ONE) or run.pieces == MOST_PIECES or member.mode == OPEN:
        return False
    run.pieces += 1
    if member.mode != RESIDUAL or pushes(member):
        return True
    wait, xi = time_to_contact(member.xi, member.eta, -member.pull), member.xi
    if run.passed + wait > run.left:
        fly(member, run.left - run.passed, s.field)
        run.passed = run.left
        if WORKED:
            s.ledger[0].solo[LOST] += run_off(member, laws, member, xi, member.xi)
    elif member.s != 1.0 or not force_returns(member, member) < wait:
        fly(member, wait, s.field)
        if WORKED:
            s.ledger[0].solo[LOST] += run_off(member, laws, member, xi, 0.0)
        member.xi, member.mode = 0.0, OPEN
        run.passed += wait
    return False


@kernel
def goes_on(s: Any, laws: Any) -> bool:
    """Take the contact that is followed alone over its piece; false if that was the last one."""
    run, c = s.run[0], s.run[0].solo
    member = s.pool[s.pairs[c].slot]
    tau = member.tau
    dt = piece_time(member)
    if run.passed + dt > run.left:
        dt = max(0.0, run.left - run.passed)
        tau = min(tau, power(dt, 1.0 / member.clock) / member.h)
    if WORKED:
        tally(s, laws, c, member, tau, s.ledger[0].solo)
    member.xi, member.eta, member.exact, member.tau = value(member.x, tau), value(member.e, tau), 0, 0.0
    if run.log_level != NO_LOG:
        follow(run, s.pairs, s.pool, s.scratch, c, tau)
    tick(member, dt)
    run.passed += dt
    if not run.passed < run.left:
        run.at = tau
        return False
    if DRIVEN and member.event == EDGE and member.wall > 0:
        tick(member, beside_edge(s.field, member, member))
        jump, slip = jump_at(s.field, member, member.t, member.tail)
        member.eta += slip
        if jump != 0.0:
            jolted(run, member, laws)
    if member.fired == c:
        if member.event == BEGIN:
            return False
        if member.mode == ACTIVE and (member.event == END or member.event == PART):
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
    if member.event == END:
        member.mode, member.exact = RESIDUAL, 1
    elif member.event in (TURN, RELOAD):
        change_branch(member, member.event)
    else:
        member.mode, member.xi, member.exact = OPEN, 0.0, 0


@kernel
def relive(s: Any, c: int, t: float, tail: float) -> None:
    """Take a place in the pool for pair `c`, in contact at the time t + tail, and ask that it be brought there.

    The pair is a block of its own; if its force is over, it is in its run-off.
    """
    pair = s.pairs[c]
    left = pair.lasts + since(pair, t, tail)
    member = take_up(s, c, pair.speed)
    tick(member, -pair.lasts)
    member.t_begin = member.t
    ask_to_follow(s, c, left)


@kernel
def expose(s: Any, c: int) -> None:
    """Let pair `c`, which has been relived, be a member of the event under way, for something may disturb it."""
    run, pair, member = s.run[0], s.pairs[c], s.pool[s.pairs[c].slot]
    back = since(pair, run.t, run.tail)
    if WORKED:  # what it would have come to is taken back, what it has come to so far is entered
        book_at_once(s.ledger, s, c, -1.0)
        book(s.ledger[0], s.ledger[0].solo)
    xi, eta = flown(s.field, pair, back)
    if member.mode != ACTIVE:  # in its run-off, it is what its asymptote says
        member.xi = xi if member.mode == RESIDUAL else min(0.0, xi)
        member.eta, member.going_on = eta, 0
        member.h, member.tau, member.x[0], member.e[0], member.f[0] = 0.0, 0.0, member.xi, eta, 0.0
        return
    xi -= member.xi  # what the asymptote is ahead of the contact
    eta -= member.eta
    take_back_row(s, c, member)
    move_beside(s, c, xi, eta)


@kernel
def take_back_row(s: Any, c: int, member: Any) -> None:
    """Let pair `c` go on with what its row of the log says, and void that row."""
    run, pair = s.run[0], s.pairs[c]
    if run.log_level != NO_LOG and 0 <= pair.row < run.rows and s.log[pair.row].pair == c:
        row = s.log[pair.row]
        member.lower_in, member.upper_in, member.t_begin, row.pair = row.lower_in, row.upper_in, row.t_begin, -1
    elif run.log_level != NO_LOG:  # its row has been handed on: a run that ends where the contact does, to the bit
        member.going_on = 0


@kernel
def move_beside(s: Any, c: int, xi: float, eta: float) -> None:
    """Bring the balls and flanks of pair `c` to the time of the event under way: they follow the asymptote, which is
    ahead of the contact by `xi` and `eta`."""
    run, bodies, member = s.run[0], s.bodies, s.pool[s.pairs[c].slot]
    low, high = member.lower / member.inverse, member.upper / member.inverse
    for side in range(2):
        body, f, share = bodies[nth(s.pairs, c + side)], nth(s.pairs, c - 1 + 2 * side), high if side else low
        if HUNG:
            body.v, body.fall = swung(body, run.omega, since(body, run.t, run.tail))
            body.v += (share if side else -share) * eta
            body.fall += s.field.square * (share if side else -share) * xi
        else:
            body.v += -body.fall * since(body, run.t, run.tail) + (share if side else -share) * eta
        body.t, body.tail = run.t, run.tail
        if 0 <= f < count_of(s.pairs):
            straighten(s, f, share * xi, share * eta)


@kernel
def straighten(s: Any, f: int, xi: float, eta: float) -> None:
    """Let a flank be as it is at the time of the event under way, and not as its asymptote says."""
    run, flank = s.run[0], s.pairs[f]
    if flank.slot >= 0:
        s.pool[flank.slot].xi += xi
        s.pool[flank.slot].eta += eta
        return
    fly(flank, since(flank, run.t, run.tail), s.field)
    flank.xi += xi
    flank.eta += eta


@kernel
def look(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> None:
    """Write overlap, rate and force of every pair at time `t`, which lies within the current pieces, as if contacts
    solved at once were over; and into `sums`, unless there is no ledger, what it comes to."""
    if WORKED:
        read(s.ledger, sums)
    for c in range(count_of(s.pairs)):
        pair = s.pairs[c]
        if pair.slot < 0:
            dt = since(pair, t, 0.0)
            dt = dt if pair.ahead == 1 else max(0.0, dt)
            deep, fast = flown(s.field, pair, dt)
            xi[c], eta[c], force[c] = deep, fast, 0.0
            if WORKED:
                sums[LOST] += run_off(s.kinds[pair.kind_of], laws, pair, pair.xi, deep)
        else:
            member = s.pool[pair.slot]
            tau = tau_at(s.pool[s.pairs[pair.first].slot], t, 0.0)
            if WORKED and pair.first == c:
                tally_island(s, laws, c, tau, sums)
            xi[c], eta[c] = value(member.x, tau), value(member.e, tau)
            force[c] = max(0.0, value(member.f, tau)) if member.mode == ACTIVE else 0.0


@kernel
def look_inside(s: Any, c: int, t: float) -> int:
    """Return the first pair, `c` or later, that is in a contact solved at once at time `t`, and ask to relive it, so as
    to be `seen`; the number of pairs if there is none."""
    run, n = s.run[0], count_of(s.pairs)
    while c < n and not in_contact(s.pairs[c], t, 0.0):
        c += 1
    if c < n:
        run.before_due, run.before_steps, run.before_error = s.pairs[c].due, run.steps, run.error
        relive(s, c, t, 0.0)
        run.pieces = AT_LEAST_ONE
    return c


@kernel
def look_over(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> int:
    """`look`, and `look_inside` from pair 0 on, in one call: to enter machine code costs more than to look."""
    look(s, t, xi, eta, force, sums, laws)
    return look_inside(s, 0, t)


@kernel
def seen(s: Any, c: int, xi: Any, eta: Any, force: Any, sums: Any) -> None:
    """Write what pair `c`, which has been relived, and its flanks are, and leave no trace of it."""
    run, pair, member = s.run[0], s.pairs[c], s.pool[s.pairs[c].slot]
    deeper, faster = xi[c] - member.xi, eta[c] - member.eta
    xi[c], eta[c] = member.xi, member.eta
    force[c] = max(0.0, value(member.f, run.at)) if member.mode == ACTIVE else 0.0
    below, above = nth(s.pairs, c - 1), nth(s.pairs, c + 1)
    if below >= 0:
        xi[below] += member.lower / member.inverse * deeper
        eta[below] += member.lower / member.inverse * faster
    if above < count_of(s.pairs):
        xi[above] += member.upper / member.inverse * deeper
        eta[above] += member.upper / member.inverse * faster
    if WORKED:
        look_at_once(s.ledger, s, c, sums)
    leave(run, s.pairs, s.pool, c)
    pair.due, run.steps, run.error = run.before_due, run.before_steps, run.before_error

