"""The motion of an island from piece to piece.

`plan_piece` computes the next piece of an island and its end. `advance_island` advances the island to that end. `laws`
is None if every law is a power form. Otherwise it is the `Collocation` of the laws, and the run is interpreted.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HUNG, RING, WORKED, kernel
from granular._engine.records import set_event_time
from granular.md.located.contacts import activate_pressed, correct_modes
from granular.md.located.ledger import account_for_piece
from granular.md.located.log import add_to_contacts
from granular.md.located.numbering import is_closed, wrapped_number
from granular.md.located.one_contact.inside import end_contact_piece, start_next_piece
from granular.md.located.one_contact.tables import OWN_SPEED, fit_table, request_contact, store_contact
from granular.md.located.pendula import advance_pendula
from granular.md.located.pieces import FLOAT_SPACING, advance_clock, locate_event, piece_time, power, time_since, value
from granular.md.located.records import (
    CHECKS_PER_OCTAVE,
    CREEP_TESTED,
    DUE_TO_PLAN,
    EDGE,
    GENERAL,
    MOVES,
    NEEDS_CREEP_TEST,
    NOTHING,
    POINTS_PER_OCTAVE,
    REST_PIECE_SCALE,
)
from granular.md.located.rest.proof import may_creep, postpones_creep_test
from granular.md.located.series import expand_series, expand_two_linear
from granular.md.located.step_size import (
    LINEAR_STEP_REACH,
    choose_clock,
    coefficient_growth,
    fastest_rate,
    residual_step_time,
    series_scale,
    set_scales,
    truncation_error,
    trusted_tau,
)
from granular.md.located.walls import expand_paths, speed_at, time_to_wall_edge


@kernel
def plan_all_due(s: Any, laws: Any) -> bool:
    """Plan the next piece of every block that was formed again.

    Returns false if the run has to stop before a contact that begins at the current event.
    """
    continues = True
    while s.queue[1].due == DUE_TO_PLAN:
        lo = s.queue[1].key
        continues = plan_piece(s, lo, laws) and continues
        set_event_time(s.queue, lo, s.pairs[lo].due)
    return continues


@kernel
def follow_contact(s: Any, laws: Any) -> None:
    """Integrate the contact of pair `run.solo` alone, piece by piece.

    `one_contact.inside.request_integration` has requested this integration.
    """
    run = s.run[0]
    while start_next_piece(s, laws):
        plan_piece(s, run.solo, laws)
        if not end_contact_piece(s, laws):
            break
    run.solo = -1


@kernel
def plan_piece(s: Any, lo: int, laws: Any) -> bool:
    """Compute the next piece of the island that starts with pair `lo`, and its end.

    `due` of the pair becomes the absolute time in s of that end. A block that has to be tested for creep first gets no
    piece and is due immediately. Returns false if the run has to stop before a contact that begins now.
    """
    run, pairs, pool, bodies, field = s.run[0], s.pairs, s.pool, s.bodies, s.field
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    log_growth, span = -math.inf, 1.0
    if block.manner == CREEP_TESTED:  # it was tested and does not creep
        block.manner = MOVES
    else:
        run.steps += 1
        if not (HUNG or RING) and laws is None and run.solo < 0 and (
                may_creep(pairs, pool, bodies, lo) and not postpones_creep_test(pairs, pool, lo)):
            request_creep_test(pairs, pool, lo)
            return True
    reach = expand_paths(field, pairs, pool, lo) if DRIVEN else math.inf
    reach = choose_scale(s, lo, reach)
    series_of_piece(s, lo, laws, reach)
    if block.linear == 0 and laws is None:
        log_growth = coefficient_growth(pairs, pool, lo, hi, run.tol)
        span = trusted_tau(log_growth, run.tol)
        if block.clock == 1:
            # `last_step` is a step with q = 1
            block.last_step = block.h * span
    edge_tau = math.inf
    if DRIVEN and reach < math.inf:
        edge_tau = power(reach, 1.0 / block.clock) / block.h
        span = min(span, edge_tau)
    if not activate_pressed(run, pairs, pool, bodies, lo, hi):
        block.fired, block.event, block.tau = -1, NOTHING, 0.0  # planned again if the run is continued
        pairs[lo].due = block.t + block.tail
        return False
    locate_event(pairs, pool, lo, hi, span, s.scratch, laws)
    if log_growth > -math.inf:
        run.error += truncation_error(log_growth, block.tau)
    if DRIVEN and block.tau == edge_tau and block.fired < 0 and block.event == NOTHING and reach == block.holds:
        block.event = EDGE
    pairs[lo].due = block.t + (piece_time(block) + block.tail)
    if block.h >= REST_PIECE_SCALE:  # the block is at rest
        pairs[lo].due = math.inf
    return True


@kernel
def choose_scale(s: Any, lo: int, reach: float) -> float:
    """Choose the exponent q and the scale h of the next piece of an island.

    In this piece t = (hτ)^q. q is stored in the field `clock` of the first pair. `reach` is the time in s for which the
    series of the driven walls are valid, or inf. Returns the longest permitted duration of the piece in s. It is
    `reach`, or at a driven wall a time that covers the residual phases if nothing else limits the piece.
    """
    run, pairs, pool, field = s.run[0], s.pairs, s.pool, s.field
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    fastest = fastest_rate(pairs, pool, lo, hi, field.square if HUNG else 0.0)
    block.linear, block.clock = 1 if fastest >= 0.0 else 0, 1
    if block.linear == 1:
        if DRIVEN and fastest == 0.0 and reach == math.inf:
            reach = residual_step_time(pairs, pool, lo, hi)
        # REACH bounds the truncation error of a linear step by rounding error
        block.h = LINEAR_STEP_REACH / fastest if fastest * reach > LINEAR_STEP_REACH else reach
    else:
        set_scales(pairs, pool, lo, hi)
        block.clock = choose_clock(pairs, pool, lo, hi, run.tol)
        block.h = series_scale(pairs, pool, lo, hi)
        if DRIVEN:
            block.h = min(block.h, power(reach, 1.0 / block.clock))
    return reach


@kernel
def request_creep_test(pairs: Any, pool: Any, lo: int) -> None:
    """Make a block due immediately without a piece, so that it is tested for creep."""
    block = pool[pairs[lo].slot]
    block.manner, block.fired, block.event, block.tau = NEEDS_CREEP_TEST, -1, NOTHING, 0.0
    pairs[lo].due = block.t + block.tail
    for c in range(lo, pairs[lo].hi):
        member = pool[pairs[c].slot]
        member.x[0], member.e[0] = member.xi, member.eta


@kernel
def series_of_piece(s: Any, lo: int, laws: Any, reach: float) -> None:
    """Compute the power series of the next piece of the island that starts with `lo`.

    If pairs touch at rest, the series is computed again until it agrees with the modes of these pairs. `reach` (s) and
    the series of driven walls were computed by `expand_paths`.
    """
    pairs, pool, field = s.pairs, s.pool, s.field
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    # each repeated round has changed a mode; the limit stops a cycle of modes
    for _ in range(2 * (hi - lo) + 2):
        if laws is not None:
            s.run[0].error += laws.fill(pairs, pool, lo, s.run[0].tol, field, reach)
        elif block.linear == 1 and hi == lo + 2 and reach == math.inf and not (HUNG or RING):
            expand_two_linear(block, pool[pairs[lo + 1].slot], block.h)
        else:
            expand_series(pairs, pool, lo, hi, block.h, block.clock, field)
        if not correct_modes(pairs, pool, lo, hi):
            break


@kernel
def advance_island(s: Any, lo: int, tau: float, dt: float, laws: Any) -> None:
    """Advance the island that starts with pair `lo` to τ, `dt` (s) into its piece.

    Overlaps, rates, velocities, clock, contact log and energy balance are updated. The piece is used up, so a new one
    has to be planned. τ = 0 changes nothing.
    """
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    if tau <= 0.0:
        return
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        member.xi, member.eta, member.exact = value(member.x, tau), value(member.e, tau), 0
    # log and energy balance need the piece; x_0 and e_0 become the new state only below
    add_to_contacts(run, pairs, pool, s.scratch, lo, tau)
    if WORKED:
        account_for_piece(s, laws, lo, tau)
    if HUNG:
        advance_pendula(run, pairs, pool, bodies, lo, tau, dt)
    else:
        advance_velocities(pairs, pool, bodies, lo, dt)
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        member.x[0], member.e[0] = member.xi, member.eta
        member.noise += step_error(run.tol, pairs, pool, c, lo)
    advance_clock(block, dt)
    if DRIVEN and block.event == EDGE and tau == block.tau:
        # dt is a single float: the clock is moved exactly to the edge, so that the next panel starts there
        advance_clock(block, time_to_wall_edge(s.field, pairs[lo], block))
        advance_clock(block, time_to_wall_edge(s.field, pairs[hi - 1], block))
    if RING:
        if is_closed(pairs, lo, hi):
            correct_sum_of_rates(pairs, pool, lo, hi, 0.0)
    elif bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0 and block.event != EDGE:
        lower, upper = bodies[lo].v, bodies[hi].v
        if DRIVEN:
            lower = speed_at(s.field, pairs[lo], bodies[lo], block)
            upper = speed_at(s.field, pairs[hi - 1], bodies[hi], block)
        correct_sum_of_rates(pairs, pool, lo, hi, lower - upper)
    block.tau = 0.0  # the piece is used up


@kernel
def step_error(tol: float, pairs: Any, pool: Any, c: int, lo: int) -> float:
    """Return a bound of the error in m/s that one piece adds to the rate of pair `c`.

    In a linear island it is the rounding error of the rates, otherwise the truncation error of the piece. `tol` is the
    relative tolerance of the run, `lo` the first pair of the island.
    """
    member = pool[pairs[c].slot]
    if pool[pairs[lo].slot].linear == 0:
        # interpolated forces of general laws carry rounding errors of several ulps
        return float(max(tol, FLOAT_SPACING if member.kind != GENERAL else 8.0 * FLOAT_SPACING) * member.own_speed)
    largest = abs(member.eta)
    hi = pairs[lo].hi
    if RING and is_closed(pairs, lo, hi) and (c == lo or c + 1 == hi):
        largest = max(largest, abs(pool[pairs[hi - 1 if c == lo else lo].slot].eta))
    for i in range(max(lo, c - 1), min(c + 2, hi)):
        largest = max(largest, abs(pool[pairs[i].slot].eta))
    return float(FLOAT_SPACING * largest)


@kernel
def correct_sum_of_rates(pairs: Any, pool: Any, lo: int, hi: int, closing: float) -> None:
    """Correct the rates between two walls, or on a ring, so that they add up.

    Their sum becomes `closing`: the rate in m/s at which the walls approach, or 0 on a ring. Without the correction,
    rounding errors would accumulate and compress or release the balls. The whole correction is applied to the pair with
    the largest absolute rate.
    """
    excess, fastest = -closing, pool[pairs[lo].slot]
    for c in range(lo, hi):
        member = pool[pairs[c].slot]
        excess += member.eta
        # the relative change is smallest in the largest rate
        if abs(member.eta) > abs(fastest.eta):
            fastest = member
    fastest.eta, fastest.e[0] = fastest.eta - excess, fastest.eta - excess


@kernel
def advance_velocities(pairs: Any, pool: Any, bodies: Any, lo: int, dt: float) -> None:
    """Advance the velocities of the bodies of an island by `dt` in s.

    The change consists of free fall and the impulses of the piece, `push` of each pair. Bodies on which no force acts
    keep their clock. Advancing it would accumulate rounding errors over thousands of pieces.
    """
    block, hi, below, last = pool[pairs[lo].slot], pairs[lo].hi, 0.0, pairs[lo].hi + 1
    if RING and is_closed(pairs, lo, hi):
        below, last = pool[pairs[hi - 1].slot].push, hi
    for c in range(lo, last):
        body, above = bodies[wrapped_number(pairs, c)], pool[pairs[c].slot].push if c < hi else 0.0
        if below != 0.0 or above != 0.0:
            body.v += body.inverse_mass * (below - above) - body.fall * (time_since(body, block.t, block.tail) + dt)
            body.t, body.tail = block.t, block.tail
            advance_clock(body, dt)
        below = above


def make_table(s: Any, laws: Any, kernels: Any) -> None:
    """Compute the table of contacts that the run has requested.

    The table is for pair `run.wanted` and one octave of approach speeds. Each speed of the table needs one contact of
    this pair alone. The state of the run does not change. There must be room for the table (`with_room_for_a_table`).
    `kernels` returns the compiled or interpreted version of a kernel.
    """
    for j in range(POINTS_PER_OCTAVE + CHECKS_PER_OCTAVE):
        kernels(request_contact)(s, j, laws)
        kernels(follow_contact)(s, laws)
        if not kernels(store_contact)(s, j):
            break  # `fit_table` refuses an incomplete table
    kernels(fit_table)(s)


def integrate_wanted_contact(s: Any, laws: Any, kernels: Any) -> None:
    """Integrate alone the contact that the run has requested (`run.wanted`).

    It is integrated at its own speed, and the result is stored for `one_contact.meet`. `kernels` returns the compiled
    or interpreted version of a kernel.
    """
    kernels(request_contact)(s, OWN_SPEED, laws)
    kernels(follow_contact)(s, laws)
    kernels(store_contact)(s, OWN_SPEED)
