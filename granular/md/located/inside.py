"""Inside a contact solved at once: to look into it, or to let it be a member of an event that may disturb it.
May be skipped: one contact again, from within.

The pair is followed alone from the onset, which its asymptote remembers: `relive` asks for that, `plan.planned` does
it, and then `exposed` or `seen` take what they need.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import entry, kernel
from granular.md.located.alone import enter, follow_alone
from granular.md.located.around import count_of, nth
from granular.md.located.driven import flown
from granular.md.located.ledger import (
    enter_at_once,
    enter_exposed,
    look_at_flight,
    look_at_once,
    look_at_piece,
    read,
)
from granular.md.located.pendula import swung
from granular.md.located.pieces import fly, in_contact, since, tau_at, tick, value
from granular.md.located.pool import leave
from granular.md.located.records import ACTIVE, HUNG, RESIDUAL, WORKED


@kernel
def relive(s: Any, c: int, t: float, tail: float) -> None:
    """Take a place in the pool for pair `c`, in contact at the time t + tail, and ask that it be brought there.

    The pair is a block of its own; if its force is over, it is in its run-off.
    """
    pair = s.pairs[c]
    left = pair.lasts + since(pair, t, tail)
    member = enter(s, c, pair.speed)
    tick(member, -pair.lasts)
    member.t_begin = member.t
    follow_alone(s, c, left)


@kernel
def exposed(s: Any, c: int) -> None:
    """Let pair `c`, which has been relived, be a member of the event under way, for something may disturb it."""
    run, pair, bodies, member = s.run[0], s.pairs[c], s.bodies, s.pool[s.pairs[c].slot]
    back = since(pair, run.t, run.tail)
    if WORKED:
        enter_at_once(s.ledger, s, c, -1.0)
        enter_exposed(s.ledger)
    xi, eta = flown(s.walls, pair, back)
    if member.mode != ACTIVE:  # in its run-off, it is what its asymptote says
        member.xi, member.eta, member.begun = xi if member.mode == RESIDUAL else min(0.0, xi), eta, 0
        member.h, member.tau, member.x[0], member.e[0], member.f[0] = 0.0, 0.0, member.xi, eta, 0.0
        return
    low, high = member.lower / member.inverse, member.upper / member.inverse
    xi -= member.xi
    eta -= member.eta
    if run.log > 0 and 0 <= pair.row < run.rows and s.log[pair.row].pair == c:
        row = s.log[pair.row]
        member.lower_in, member.upper_in, member.t_begin, row.pair = row.lower_in, row.upper_in, row.t_begin, -1
    elif run.log > 0:  # its row has been handed on: a run that ends where the contact does, to the bit
        member.begun = 0
    for side in range(2):
        body, f, share = bodies[nth(s.pairs, c + side)], nth(s.pairs, c - 1 + 2 * side), high if side else low
        if HUNG:
            body.v, body.fall = swung(body, run.omega, since(body, run.t, run.tail))
            body.v += (share if side else -share) * eta
            body.fall += s.walls.square * (share if side else -share) * xi
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
    fly(flank, since(flank, run.t, run.tail), s.walls)
    flank.xi += xi
    flank.eta += eta


@entry
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
            dt = max(0.0, dt) if pair.lasts == 0.0 else dt
            deep, fast = flown(s.walls, pair, dt)
            xi[c], eta[c], force[c] = deep, fast, 0.0
            if WORKED:
                look_at_flight(s.ledger, s.kinds[pair.kind_of], laws, pair, deep, sums)
        else:
            member = s.pool[pair.slot]
            tau = tau_at(s.pool[s.pairs[pair.first].slot], t, 0.0)
            if WORKED and pair.first == c:
                look_at_piece(s.ledger, s.walls, laws, s, c, tau, sums)
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
        run.pieces = -1  # one at least: at its very onset too
    return c


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
