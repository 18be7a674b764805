"""Integrate a single contact by pieces, from its onset up to a given time.

A contact that was solved as one event has no state between its onset and its end. If such a state is needed, the
contact is integrated again from its onset, while its neighbours stay in free flight. There are three uses:

* a sample during the contact (`request_state`, `write_integrated_state`)
* an event of a neighbouring pair that can disturb the contact (`restart_contact`, `join_current_event`)
* the contact map of a law without a closed form (`tables`)

`request_integration` starts the integration, and `plan.follow_contact` performs it.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swing_after, time_to_contact
from granular._engine.kernels import DRIVEN, HUNG, WORKED, kernel
from granular.md.located.contacts import needs_series
from granular.md.located.ledger import (
    DISSIPATED,
    account_for_isolated_contact,
    add_island_energy,
    add_pair_energy,
    add_sums_to_account,
    clear_sums,
    read_energy_account,
    replace_whole_contact,
    residual_loss,
)
from granular.md.located.log import add_to_contacts
from granular.md.located.modes import FORCE_BEGINS, FORCE_ENDS, change_mode, clip
from granular.md.located.numbering import pair_count, wrapped_number
from granular.md.located.pieces import (
    advance_clock,
    advance_flight,
    force_return_time,
    in_contact,
    piece_time,
    power,
    tau_at,
    time_since,
    value,
)
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
from granular.md.located.system import join_pool, leave_pool
from granular.md.located.walls import free_flight, rate_jump, time_to_wall_edge

MAX_CONTACT_PIECES = 2000
"""Number of pieces after which a contact is assumed never to end."""


@kernel
def occupy_record(s: Any, c: int, v: float) -> Any:
    """Take a record of the pool for pair `c`, which touches now at approach speed `v`.

    The pair becomes an island of its own. Returns the record.
    """
    pair = s.pairs[c]
    isolated = pair.isolated
    join_pool(s.run[0], s.pairs, s.pool, s.kinds, s.bodies, c)
    member, pair.isolated = s.pool[pair.slot], isolated
    member.xi, member.eta, member.mode, member.exact, member.going_on = 0.0, v, ACTIVE, 0, 1
    member.t, member.tail = pair.t, pair.tail
    member.duration, member.impulse, member.force_max, member.xi_max = 0.0, 0.0, 0.0, 0.0
    return member


@kernel
def request_integration(s: Any, c: int, left: float) -> None:
    """Start the integration of the contact of pair `c` alone, from its onset.

    It ends after the time `left`, or earlier if the balls separate. `plan.follow_contact` computes the pieces. The
    results are fields of the record of the run:

    * `over` and `parting`: duration of the force, and separation speed at its end. They are nan if it has not ended.
    * `passed` and `at`: integrated time, and τ on the last piece

    After the separation the pair is OPEN. It is not OPEN if the contact does not end, or if its force vanishes and
    returns, which begins another contact.
    """
    run = s.run[0]
    run.solo, run.pieces, run.left, run.passed, run.at = c, 0, left, 0.0, 0.0
    run.over, run.parting = math.nan, math.nan
    if WORKED:
        clear_sums(s.ledger[0].solo)


@kernel
def start_next_piece(s: Any, laws: Any) -> bool:
    """Start the next piece of the contact that is integrated alone, if one is needed.

    Returns whether a piece is needed. No piece is needed after the requested time, after the separation, or after
    `MAX_CONTACT_PIECES` pieces. A residual pair in free flight needs none either: it is advanced in closed form to the
    requested time or to its separation (OPEN). If its force returns before the separation, it is left RESIDUAL, because
    another contact begins then.
    """
    run, member = s.run[0], s.pool[s.pairs[s.run[0].solo].slot]
    if (
        not (run.left > run.passed or run.pieces == AT_LEAST_ONE)
        or run.pieces == MAX_CONTACT_PIECES
        or member.mode == OPEN
    ):
        return False
    run.pieces += 1
    if member.mode != RESIDUAL or needs_series(member):
        return True
    wait, xi = time_to_contact(member.xi, member.eta, -member.pull), member.xi
    if run.passed + wait > run.left:  # the requested time comes before the separation
        advance_flight(member, run.left - run.passed, s.field)
        run.passed = run.left
        if WORKED:
            s.ledger[0].solo[DISSIPATED] += residual_loss(member, laws, member, xi, member.xi)
    elif member.s != 1.0 or not force_return_time(member, member) < wait:  # separates before its force returns
        advance_flight(member, wait, s.field)
        if WORKED:
            s.ledger[0].solo[DISSIPATED] += residual_loss(member, laws, member, xi, 0.0)
        member.xi, member.mode = 0.0, OPEN
        run.passed += wait
    return False


@kernel
def end_contact_piece(s: Any, laws: Any) -> bool:
    """Advance the contact that is integrated alone to the end of its piece.

    The event at this end is applied. Returns False if this was the last piece.
    """
    run, c = s.run[0], s.run[0].solo
    member = s.pool[s.pairs[c].slot]
    tau = member.tau
    dt = piece_time(member)
    if run.passed + dt > run.left:
        dt = max(0.0, run.left - run.passed)
        # inverse of dt = (hτ)^q; rounding must not move τ beyond the end of the piece
        tau = min(tau, power(dt, 1.0 / member.clock) / member.h)
    if WORKED:
        add_pair_energy(s, laws, c, member, tau, s.ledger[0].solo)
    member.xi, member.eta, member.exact, member.tau = value(member.x, tau), value(member.e, tau), 0, 0.0
    if run.log_level != NO_LOG:
        add_to_contacts(run, s.pairs, s.pool, s.scratch, c, tau)
    advance_clock(member, dt)
    run.passed += dt
    if not run.passed < run.left:
        run.at = tau
        return False
    if DRIVEN and member.event == EDGE and member.wall > 0:
        advance_clock(member, time_to_wall_edge(s.field, member, member))
        # slip: the same jump between the stored panels, with their rounding errors
        jump, slip = rate_jump(s.field, member, member.t, member.tail)
        member.eta += slip
        if jump != 0.0:
            update_mode_after_jump(run, member, laws)
    if member.fired == c:  # the piece ends with an event of this pair
        if member.event == BEGIN:
            return False
        if member.mode == ACTIVE and (member.event == END or member.event == PART):
            run.over, run.parting = run.passed, -member.eta
        change_mode(member, member.event)
    return True


@kernel
def update_mode_after_jump(run: Any, member: Any, laws: Any) -> None:
    """Update the mode of a pair that is integrated alone after a jump of its wall.

    The velocity of the wall has jumped. The force can end, or begin again.
    """
    force = clip(member, laws)
    if force == FORCE_ENDS:
        run.over, run.parting = run.passed, -member.eta
    elif force == FORCE_BEGINS:
        member.mode = ACTIVE


@kernel
def restart_contact(s: Any, c: int, t: float, tail: float) -> None:
    """Start to integrate the contact of pair `c`, which was solved as one event.

    It is integrated from its onset up to the time t + tail. The pair moves into the pool and becomes an island of its
    own.
    """
    pair = s.pairs[c]
    left = pair.lasts + time_since(pair, t, tail)
    member = occupy_record(s, c, pair.speed)
    advance_clock(member, -pair.lasts)
    member.t_begin = member.t
    request_integration(s, c, left)


@kernel
def join_current_event(s: Any, c: int) -> None:
    """Let a contact that was solved as one event take part in the current event.

    The event can disturb the contact of pair `c`, which has been integrated up to now after `restart_contact`. Balls,
    flanks, contact log and energy balance contained the result of the whole contact. They are set to the current state.
    """
    run, pair, member = s.run[0], s.pairs[c], s.pool[s.pairs[c].slot]
    back = time_since(pair, run.t, run.tail)
    if WORKED:  # replace the account of the whole contact by the account up to now
        account_for_isolated_contact(s.ledger, s, c, -1.0)
        add_sums_to_account(s.ledger[0], s.ledger[0].solo)
    xi, eta = free_flight(s.field, pair, back)
    if member.mode != ACTIVE:  # a residual contact already follows its asymptote
        member.xi = xi if member.mode == RESIDUAL else min(0.0, xi)
        member.eta, member.going_on = eta, 0
        member.h, member.tau, member.x[0], member.e[0], member.f[0] = 0.0, 0.0, member.xi, eta, 0.0
        return
    xi -= member.xi  # lead of the asymptote over the contact
    eta -= member.eta
    withdraw_log_row(s, c, member)
    correct_balls_and_flanks(s, c, xi, eta)


@kernel
def withdraw_log_row(s: Any, c: int, member: Any) -> None:
    """Restore the onset of a contact from its log row, and void this row.

    The onset is copied from the log buffer to the pool record `member` of pair `c`. If the row has already left the
    buffer, it stays valid: the run ends exactly where this contact ends. The contact then counts as ended, and is not
    logged again.
    """
    run, pair = s.run[0], s.pairs[c]
    if run.log_level != NO_LOG and 0 <= pair.row < run.rows and s.log[pair.row].pair == c:
        row = s.log[pair.row]
        member.lower_in, member.upper_in, member.t_begin, row.pair = row.lower_in, row.upper_in, row.t_begin, -1
    elif run.log_level != NO_LOG:  # the row has already left the buffer
        member.going_on = 0


@kernel
def correct_balls_and_flanks(s: Any, c: int, xi: float, eta: float) -> None:
    """Set the balls and the flanks of pair `c` to their state at the current event.

    Their records contained the free motion after the contact. `xi` and `eta` are the overlap and the rate of this
    motion minus the current overlap and rate of the pair.
    """
    run, bodies, member = s.run[0], s.bodies, s.pool[s.pairs[c].slot]
    low, high = member.lower / member.inverse, member.upper / member.inverse
    for side in range(2):
        body, f = bodies[wrapped_number(s.pairs, c + side)], wrapped_number(s.pairs, c - 1 + 2 * side)
        share = high if side else low
        if HUNG:
            body.v, body.fall = swing_after(body, run.omega, time_since(body, run.t, run.tail))
            body.v += (share if side else -share) * eta
            body.fall += s.field.square * (share if side else -share) * xi
        else:
            body.v += -body.fall * time_since(body, run.t, run.tail) + (share if side else -share) * eta
        body.t, body.tail = run.t, run.tail
        if 0 <= f < pair_count(s.pairs):
            correct_flank(s, f, share * xi, share * eta)


@kernel
def correct_flank(s: Any, f: int, xi: float, eta: float) -> None:
    """Set flank `f` to its state at the current event.

    `xi` and `eta` are added to overlap and rate of its asymptote.
    """
    run, flank = s.run[0], s.pairs[f]
    if flank.slot >= 0:
        s.pool[flank.slot].xi += xi
        s.pool[flank.slot].eta += eta
        return
    advance_flight(flank, time_since(flank, run.t, run.tail), s.field)
    flank.xi += xi
    flank.eta += eta


@kernel
def write_states(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> None:
    """Write overlap, rate and force of every pair at a time `t` in the current pieces.

    `xi`, `eta` and `force` are arrays with one entry per pair. For a contact solved as one event, they receive the free
    motion after the contact, see `write_integrated_state`. `sums` receives the sums of the energy balance, if there is
    one.
    """
    if WORKED:
        read_energy_account(s.ledger, sums)
    for c in range(pair_count(s.pairs)):
        pair = s.pairs[c]
        if pair.slot < 0:
            dt = time_since(pair, t, 0.0)
            dt = dt if pair.ahead == 1 else max(0.0, dt)
            deep, fast = free_flight(s.field, pair, dt)
            xi[c], eta[c], force[c] = deep, fast, 0.0
            if WORKED:
                sums[DISSIPATED] += residual_loss(s.kinds[pair.kind_of], laws, pair, pair.xi, deep)
        else:
            member = s.pool[pair.slot]
            tau = tau_at(s.pool[s.pairs[pair.first].slot], t, 0.0)
            if WORKED and pair.first == c:
                add_island_energy(s, laws, c, tau, sums)
            xi[c], eta[c] = value(member.x, tau), value(member.e, tau)
            force[c] = max(0.0, value(member.f, tau)) if member.mode == ACTIVE else 0.0


@kernel
def request_state(s: Any, c: int, t: float) -> int:
    """Start to integrate the next contact that was solved as one event, up to `t`.

    The search begins at pair `c`. Returns the number of the pair, to be passed to `write_integrated_state`, or
    the number of pairs if no such contact is left.
    """
    run, n = s.run[0], pair_count(s.pairs)
    while c < n and not in_contact(s.pairs[c], t, 0.0):
        c += 1
    if c < n:
        run.before_due, run.before_steps, run.before_error = s.pairs[c].due, run.steps, run.error
        restart_contact(s, c, t, 0.0)
        run.pieces = AT_LEAST_ONE
    return c


@kernel
def write_and_request_states(s: Any, t: float, xi: Any, eta: Any, force: Any, sums: Any, laws: Any) -> int:
    """Call `write_states`, and then `request_state` from pair 0 upwards.

    This is one function because entering machine code costs more than the evaluation.
    """
    write_states(s, t, xi, eta, force, sums, laws)
    return request_state(s, 0, t)


@kernel
def write_integrated_state(s: Any, c: int, xi: Any, eta: Any, force: Any, sums: Any) -> None:
    """Write overlap, rate and force of pair `c`, whose contact was integrated alone.

    They replace the free motion after the contact, see `write_states`. The entries of the flanks and the energy sums
    are corrected too. The run is then restored to its state before the integration.
    """
    run, pair, member = s.run[0], s.pairs[c], s.pool[s.pairs[c].slot]
    deeper, faster = xi[c] - member.xi, eta[c] - member.eta
    xi[c], eta[c] = member.xi, member.eta
    force[c] = max(0.0, value(member.f, run.at)) if member.mode == ACTIVE else 0.0
    below, above = wrapped_number(s.pairs, c - 1), wrapped_number(s.pairs, c + 1)
    if below >= 0:
        xi[below] += member.lower / member.inverse * deeper
        eta[below] += member.lower / member.inverse * faster
    if above < pair_count(s.pairs):
        xi[above] += member.upper / member.inverse * deeper
        eta[above] += member.upper / member.inverse * faster
    if WORKED:
        replace_whole_contact(s.ledger, s, c, sums)
    leave_pool(run, s.pairs, s.pool, c)
    pair.due, run.steps, run.error = run.before_due, run.before_steps, run.before_error

