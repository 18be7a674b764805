"""Integrate one contact alone, piece by piece, from its onset.

This gives the state within a contact that was solved as one event. Such a contact can also become a member of an event
that may disturb it. `restore_record` requests the integration, `plan.follow_contact` performs it piece by piece, and
then `expose` or `seen` use the result.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swung, time_to_contact
from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.located.contacts import pushes
from granular.md.located.ledger import (
    LOST,
    begin,
    book,
    book_at_once,
    keep_part_until_now,
    read,
    run_off,
    tally,
    tally_island,
)
from granular.md.located.log import follow
from granular.md.located.modes import FORCE_BEGINS, FORCE_ENDS, change_mode, clip
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
    RESIDUAL,
)
from granular.md.located.system import count_of, join, leave, nth
from granular.md.located.walls import beside_edge, flown, jump_at

MAX_CONTACT_PIECES = 2000
"""Number of pieces after which a contact is assumed not to end."""


@kernel
def occupy_record(s: Any, c: int, v: float) -> Any:
    """Take a record of the pool for pair `c`, which just touched at speed `v`.

    The pair becomes an island of its own.
    """
    pair = s.pairs[c]
    alone = pair.isolated
    join(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, c)
    member, pair.isolated = s.pool[pair.slot], alone
    member.xi, member.eta, member.mode, member.exact, member.going_on = 0.0, v, ACTIVE, 0, 1
    member.t, member.tail = pair.t, pair.tail
    member.duration, member.impulse, member.force_max, member.xi_max = 0.0, 0.0, 0.0, 0.0
    return member


@kernel
def request_integration(s: Any, c: int, left: float) -> None:
    """Request that a contact that just began is integrated for a time `left`.

    The integration ends earlier if the balls separate. `plan.follow_contact` performs it, and stores in the record of
    the run: the time at which the force vanished (nan: it did not), the separation rate then, the elapsed time, and τ
    on the last piece. After the separation the pair is OPEN. It is not OPEN if the contact does not end, or if its
    force returns, which is another contact.
    """
    run = s.run[0]
    run.solo, run.pieces, run.left, run.passed, run.at = c, 0, left, 0.0, 0.0
    run.over, run.parting = math.nan, math.nan
    if WORKED:
        begin(s.ledger[0].solo)


@kernel
def has_piece(s: Any, laws: Any) -> bool:
    """Start the next piece of the contact integrated alone, or return false.

    A residual contact without a returning force is advanced by free flight instead.
    """
    run, member = s.run[0], s.pool[s.pairs[s.run[0].solo].slot]
    if (
        not (run.left > run.passed or run.pieces == AT_LEAST_ONE)
        or run.pieces == MAX_CONTACT_PIECES
        or member.mode == OPEN
    ):
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
    """Advance the contact that is integrated alone over its piece.

    Return False if this was the last piece.
    """
    run, c = s.run[0], s.run[0].solo
    member = s.pool[s.pairs[c].slot]
    tau = member.tau
    dt = piece_time(member)
    if run.passed + dt > run.left:
        dt = max(0.0, run.left - run.passed)
        # rounding must not move τ beyond the end of the piece
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
            update_after_jump(run, member, laws)
    if member.fired == c:
        if member.event == BEGIN:
            return False
        if member.mode == ACTIVE and (member.event == END or member.event == PART):
            run.over, run.parting = run.passed, -member.eta
        change_mode(member, member.event)
    return True


@kernel
def update_after_jump(run: Any, member: Any, laws: Any) -> None:
    """Update the mode of a contact alone after a jump of its wall's velocity."""
    force = clip(member, laws)
    if force == FORCE_ENDS:
        run.over, run.parting = run.passed, -member.eta
    elif force == FORCE_BEGINS:
        member.mode = ACTIVE


@kernel
def restore_record(s: Any, c: int, t: float, tail: float) -> None:
    """Move pair `c` into the pool, and restart its contact from its onset.

    The contact is then integrated up to the time t + tail. The pair becomes an island of its own. If its force has
    vanished, the contact is residual.
    """
    pair = s.pairs[c]
    left = pair.lasts + since(pair, t, tail)
    member = occupy_record(s, c, pair.speed)
    tick(member, -pair.lasts)
    member.t_begin = member.t
    request_integration(s, c, left)


@kernel
def expose(s: Any, c: int) -> None:
    """Make pair `c` a member of the current event, because it may be disturbed.

    Its contact has been integrated by `restore_record`.
    """
    run, pair, member = s.run[0], s.pairs[c], s.pool[s.pairs[c].slot]
    back = since(pair, run.t, run.tail)
    if WORKED:  # replace the account of the whole contact by the account up to now
        book_at_once(s.ledger, s, c, -1.0)
        book(s.ledger[0], s.ledger[0].solo)
    xi, eta = flown(s.field, pair, back)
    if member.mode != ACTIVE:  # a residual contact already follows its asymptote
        member.xi = xi if member.mode == RESIDUAL else min(0.0, xi)
        member.eta, member.going_on = eta, 0
        member.h, member.tau, member.x[0], member.e[0], member.f[0] = 0.0, 0.0, member.xi, eta, 0.0
        return
    xi -= member.xi  # lead of the asymptote over the contact
    eta -= member.eta
    withdraw_row(s, c, member)
    move_beside(s, c, xi, eta)


@kernel
def withdraw_row(s: Any, c: int, member: Any) -> None:
    """Restore the onset of pair `c` from its row of the log, and delete that row."""
    run, pair = s.run[0], s.pairs[c]
    if run.log_level != NO_LOG and 0 <= pair.row < run.rows and s.log[pair.row].pair == c:
        row = s.log[pair.row]
        member.lower_in, member.upper_in, member.t_begin, row.pair = row.lower_in, row.upper_in, row.t_begin, -1
    elif run.log_level != NO_LOG:  # its row is already written: the run ends exactly where the contact does
        member.going_on = 0


@kernel
def move_beside(s: Any, c: int, xi: float, eta: float) -> None:
    """Correct the balls of pair `c` and its neighbouring pairs to the current event.

    Their records contain the free motion after the contact, which leads by `xi` and `eta`.
    """
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
    """Correct a flank from its asymptote to its state at the current event."""
    run, flank = s.run[0], s.pairs[f]
    if flank.slot >= 0:
        s.pool[flank.slot].xi += xi
        s.pool[flank.slot].eta += eta
        return
    fly(flank, since(flank, run.t, run.tail), s.field)
    flank.xi += xi
    flank.eta += eta


@kernel
def write_states(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> None:
    """Write overlap, rate and force of every pair at time `t`.

    The time is within the current pieces. Contacts solved as one event are represented by their asymptotes. With a
    ledger, `sums` receives its content at this time.
    """
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
def request_state(s: Any, c: int, t: float) -> int:
    """Request the state of the next pair whose contact is solved as one event.

    The search begins at pair `c`. The contact is integrated to the time `t`. Return the number of the pair for `seen`,
    or the number of pairs if there is no such pair.
    """
    run, n = s.run[0], count_of(s.pairs)
    while c < n and not in_contact(s.pairs[c], t, 0.0):
        c += 1
    if c < n:
        run.before_due, run.before_steps, run.before_error = s.pairs[c].due, run.steps, run.error
        restore_record(s, c, t, 0.0)
        run.pieces = AT_LEAST_ONE
    return c


@kernel
def write_and_request_states(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> int:
    """Call `write_states`, and then `request_state` from pair 0 on.

    A single call is used because entering machine code costs more than the evaluation.
    """
    write_states(s, t, xi, eta, force, sums, laws)
    return request_state(s, 0, t)


@kernel
def seen(s: Any, c: int, xi: Any, eta: Any, force: Any, sums: Any) -> None:
    """Write the state of pair `c`, which was integrated alone, and of its flanks.

    All traces of the integration are removed.
    """
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
        keep_part_until_now(s.ledger, s, c, sums)
    leave(run, s.pairs, s.pool, c)
    pair.due, run.steps, run.error = run.before_due, run.before_steps, run.before_error

