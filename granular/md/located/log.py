"""The contact log: data of each contact from its onset to its end."""

from __future__ import annotations

from typing import Any

from granular._engine.flight import swing_after
from granular._engine.kernels import HUNG, METERED, RING, kernel
from granular.md.located.ledger import work_of_force
from granular.md.located.numbering import is_closed, wrapped_number
from granular.md.located.peaks import update_peaks
from granular.md.located.pieces import elapsed_time, integral, time_since, two_sum
from granular.md.located.records import ACTIVE, DORMANT, ENERGIES, NO_LOG, PEAKS


@kernel
def begin_contact(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> None:
    """Record time and velocities at the onset of the contact of pair `c`.

    The largest overlap starts with the current overlap. The contact of a dormant pair also begins here, although it may
    never develop a force.
    """
    pair = pool[pairs[c].slot]
    pair.t_begin, pair.duration, pair.impulse, pair.force_max, pair.xi_max = run.t, 0.0, 0.0, 0.0, pair.xi
    pair.lower_in, pair.upper_in = velocity_now(bodies[c], run), velocity_now(bodies[wrapped_number(pairs, c + 1)], run)


@kernel
def add_to_contacts(run: Any, pairs: Any, pool: Any, scratch: Any, lo: int, tau: float) -> None:
    """Add the part [0, τ] of the current piece to the contacts of an island.

    Duration, impulse and peaks of each contact are updated, and the impulse exchanged while a neighbouring pair is
    active. `lo` is the first pair of the island. `push` of each pair becomes its impulse in N s during this part.
    """
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    h, q = block.h, block.clock
    dt, scale, closed = elapsed_time(h, q, tau), elapsed_time(h, q, 1.0), RING and is_closed(pairs, lo, hi)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        pair.push = scale * integral(pair.f, q, tau) if pair.mode == ACTIVE else 0.0
        if run.log_level == NO_LOG:
            continue
        if pair.mode == ACTIVE:
            pair.impulse += pair.push
            if ((c > lo or closed) and pool[pairs[wrapped_number(pairs, c - 1)].slot].mode == ACTIVE) or (
                (c + 1 < hi or closed) and pool[pairs[wrapped_number(pairs, c + 1)].slot].mode == ACTIVE
            ):
                # two floats, because small impulses are added to a large sum
                run.shared, rest = two_sum(run.shared, pair.push)
                run.shared_low += rest
            if run.log_level == PEAKS:
                update_peaks(pair, tau, scratch)
            elif METERED and run.log_level == ENERGIES:
                pair.force_max += work_of_force(pair, block, tau)
        # the duration includes the time at rest without a resolved force
        if pair.mode == ACTIVE or pair.mode == DORMANT:
            pair.duration += dt


@kernel
def end_contact(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, c: int) -> None:
    """Write the log row of the contact of pair `c`, which ends at the current event."""
    pair = pool[pairs[c].slot]
    pair.going_on = 0
    if run.log_level == NO_LOG:
        return
    row = log[run.rows]
    run.rows += 1
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.t_begin, run.t, pair.duration
    row.lower_in, row.upper_in = pair.lower_in, pair.upper_in
    row.lower_out, row.upper_out = velocity_now(bodies[c], run), velocity_now(bodies[wrapped_number(pairs, c + 1)], run)
    # the integral of a vanishing force can be negative by rounding
    row.xi_max, row.force_max, row.impulse = pair.xi_max, pair.force_max, max(0.0, pair.impulse)


@kernel
def velocity_now(body: Any, run: Any) -> float:
    """Return the velocity of a body in m/s at the time of the current event."""
    if HUNG:
        return swing_after(body, run.omega, time_since(body, run.t, run.tail))[0]
    return float(body.v - body.fall * time_since(body, run.t, run.tail))


@kernel
def drop_settled_rows(s: Any, t: float) -> None:
    """Remove all rows from the log buffer except contacts that end after time `t`.

    `t` is in s. The caller has already collected the other rows. Rows that were withdrawn are removed as well.
    """
    run, row_count = s.run[0], 0
    for i in range(run.rows):
        row = s.log[i]
        if row.pair >= 0 and row.t_end > t:
            if i > row_count:
                copy_row(row, s.log[row_count])
            s.pairs[row.pair].row = row_count
            row_count += 1
        elif row.pair >= 0 and s.pairs[row.pair].row == i:
            s.pairs[row.pair].row = -1
    run.rows = row_count


@kernel
def copy_row(row: Any, to: Any) -> None:
    """Copy the row `row` of the log to the row `to`."""
    to.pair, to.t_begin, to.t_end, to.duration = row.pair, row.t_begin, row.t_end, row.duration
    to.lower_in, to.upper_in, to.lower_out, to.upper_out = row.lower_in, row.upper_in, row.lower_out, row.upper_out
    to.xi_max, to.force_max, to.impulse = row.xi_max, row.force_max, row.impulse

