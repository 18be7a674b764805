"""Solve an isolated contact as one event, by its contact map.

A pair that touches now is solved immediately by its contact map (`maps`, `tables`), if no neighbouring pair can touch
before the contact ends. The gaps on either side of the pair are its *flanks*. `flanks` tests them.

*State during the contact.* From the onset onwards, the records of the pair and its flanks contain their asymptotes: the
free motion after the contact. The clock of an asymptote can be later than the current time (`ahead` is 1). The clock of
the pair is at the end of its contact, where ξ = 0, a time `lasts` after the onset. The clock of a flank is at the end
of all contacts next to it.

Let ξ be the overlap of the pair during the contact, and ξ_v the overlap of its asymptote. A flank is then smaller than
its own asymptote by f·(ξ_v - ξ). Here f is the inverse mass of the ball between the pair and the flank, divided by the
sum of the inverse masses of the pair. The rates η and η_v have the same relation.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import hung_after, swing_after
from granular._engine.kernels import DRIVEN, HEATED, HUNG, METERED, RING, WORKED, kernel
from granular._engine.records import leaf, update_tournament
from granular.md.located.contacts import NOT_ISOLATED, is_awaited
from granular.md.located.jumps import count_hit, speed_away
from granular.md.located.ledger import account_for_isolated_contact, store_contact_energy
from granular.md.located.log import velocity_now
from granular.md.located.numbering import neighbour_pairs, pair_count, wrapped_number
from granular.md.located.one_contact.flanks import (
    flank_above,
    flank_below,
    set_flank_asymptote,
    velocity_without_contacts,
)
from granular.md.located.one_contact.maps import closed_form_map, closed_form_peaks, map_of_pendula, peaks_of_pendula
from granular.md.located.one_contact.tables import TABLE_WANTED, table_of, tabled_map, tabled_peaks
from granular.md.located.pendula import displace_pendulum, impulse_of_pendula
from granular.md.located.pieces import DRIFT_NOISE_FACTOR, FLOAT_SPACING, advance_clock, predict_flight, time_since
from granular.md.located.records import (
    BEGIN,
    BY_PIECES,
    DONE,
    ENERGIES,
    IGNORE,
    NO_LOG,
    OPEN,
    PEAKS,
    UNTIL_ANY_EVENT,
    WANTS_CONTACT,
    WANTS_TABLE,
)
from granular.md.located.walls import flight_at_wall, rest_gap, touching_rate, update_walls

MAX_TIME_LEFT_OF_PENDULA = 0.5
"""Longest remaining contact at the far end of a flank of pendula, in units 1/Ω.

If it lasts longer, the contact of the pair is integrated by pieces.
"""
CLOSED_FORM, INTEGRATED, NOT_INTEGRATED, THERMAL_WALL = -3, -4, -5, -6
"""Sources of a contact map that is not in a table.

In this order: a formula, an integration by pieces, an integration that is still to be done, and a thermal wall, which
throws the ball back without delay.
"""


@kernel
def solve_as_one_event(s: Any, c: int) -> int:
    """Solve the contact of pair `c`, which touches next, as one event if possible.

    Returns
    -------
    int
        DONE if the contact has been solved. WANTS_TABLE or WANTS_CONTACT if its map is still to be computed. BY_PIECES
        if the contact has to be integrated by pieces: without a map, or if a neighbour can disturb it. If the run
        ignores disturbances, a disturbed contact is solved too, unless a flank is not in free flight.
    """
    run, pairs, pair = s.run[0], s.pairs, s.pairs[c]
    v = touching_rate(s.field, pair, pair.wait) if can_be_one_event(run, pairs, c) else 0.0
    # below this speed rounding errors decide whether the balls approach at all
    if not v > DRIFT_NOISE_FACTOR * pair.noise:
        return BY_PIECES
    t1, t2, v1, v2, source = contact_map(s, c, v)
    if not t1 > 0.0 and source != THERMAL_WALL:
        run.wanted = c
        return WANTS_TABLE if source == TABLE_WANTED else WANTS_CONTACT if source == NOT_INTEGRATED else BY_PIECES
    over = pair.wait + t2
    moment, rate_change = flight_after_touch(s.field, pair, v, t2)
    # from here on mass times displacement, equal and opposite for both bodies
    moment /= s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass
    lower_v, upper_v = separation_velocities(s, c, pair, over, rate_change + v2, v2)
    lower, upper = neighbour_pairs(pairs, c)
    below, certain_below, rate_below, time_left_below = flank_below(s, c, t2, moment, lower_v)
    above, certain_above, rate_above, time_left_above = flank_above(s, c, t2, moment, lower_v, upper_v)
    isolated = below > 0.0 and above > 0.0 and certain_below and certain_above
    if not isolated and (run.disturbing != IGNORE or min(below, above) == -math.inf):
        return BY_PIECES
    if HUNG and max(time_left_below, time_left_above) * run.omega > MAX_TIME_LEFT_OF_PENDULA:
        return BY_PIECES
    if source >= 0:
        run.error += s.tables[source].error
    advance_to_onset(s, c, v, t1, v1, v2, source)
    count_contact(run, pair, isolated, c if below > 0.0 and certain_below else lower, t2)
    set_pair_asymptote(s, c, v, t2, v2, moment, source)
    set_velocity(s.bodies[c], pair, lower_v)
    set_velocity(s.bodies[wrapped_number(pairs, c + 1)], pair, upper_v)
    if lower >= 0:
        set_flank_asymptote(s, lower, pair, below, rate_below, time_left_below)
    if upper < pair_count(pairs):
        set_flank_asymptote(s, upper, pair, above, rate_above, time_left_above)
    update_queue(s, lower, c, upper)
    return DONE


@kernel
def can_be_one_event(run: Any, pairs: Any, c: int) -> bool:
    """Return whether the next event of pair `c` can be a contact solved as one event.

    The event must be the onset of a contact, and the run must not stop just before it. If disturbances matter, two more
    onsets are excluded: any onset in a run that pauses after every event, and an onset at a driven wall.
    """
    pair = pairs[c]
    if pair.mode != OPEN or pair.event != BEGIN or is_awaited(run, pairs, c):
        return False
    return not ((run.until_pair == UNTIL_ANY_EVENT or (DRIVEN and pair.wall > 0)) and run.disturbing != IGNORE)


@kernel
def advance_to_onset(s: Any, c: int, v: float, t1: float, v1: float, v2: float, source: int) -> None:
    """Advance the clocks of the run and of pair `c` to the onset, and log the contact.

    The parameters are explained in `contact_map`.
    """
    run, pair = s.run[0], s.pairs[c]
    advance_clock(pair, pair.wait)
    run.t, run.tail = pair.t, pair.tail
    if run.log_level != NO_LOG:
        if DRIVEN:
            update_walls(s.field, s)
        write_log_row(s, c, v, t1, v1, v2, source)


@kernel
def set_pair_asymptote(s: Any, c: int, v: float, t2: float, v2: float, moment: float, source: int) -> None:
    """Replace the state of pair `c` at its onset by the asymptote after its contact.

    `v` is the approach speed in m/s. ξ returns to 0 a time `t2` in s after the onset, with the separation speed `v2` in
    m/s. `moment` is mass times displacement by the contact, in kg m. Pendula are displaced by `moment`/m, because their
    acceleration depends on position. `source` is explained in `contact_map`. The contact is also entered in the energy
    balance.
    """
    pair, bodies = s.pairs[c], s.bodies
    advance_clock(pair, t2)
    pair.xi, pair.eta, pair.lasts, pair.ahead, pair.speed, pair.exact = 0.0, -v2, t2, 1 if t2 > 0.0 else 0, v, 0
    pair.noise += FLOAT_SPACING * v
    if HEATED and source == THERMAL_WALL:
        count_hit(s, c, v, v2)
    elif WORKED:
        store_contact_energy(s.ledger, s, c)
        account_for_isolated_contact(s.ledger, s, c, 1.0)
    predict_flight(pair, s.kinds[pair.kind_of], s.field)
    leaf(s.queue, c).due = pair.due
    if HUNG:
        displace_pendulum(s.run[0], bodies[c], pair, -bodies[c].inverse_mass * moment)
        displace_pendulum(s.run[0], bodies[c + 1], pair, bodies[c + 1].inverse_mass * moment)


@kernel
def update_queue(s: Any, lower: int, c: int, upper: int) -> None:
    """Update the event queue for pair `c` and its flanks `lower` and `upper`."""
    if RING and upper - lower != 2:
        # on a ring the three pairs need not be neighbours in the queue
        update_tournament(s.queue, c, c)
        update_tournament(s.queue, upper, upper)
        update_tournament(s.queue, max(0, lower), max(0, lower))
    else:
        update_tournament(s.queue, max(0, c - 1), min(c + 1, pair_count(s.pairs) - 1))


@kernel
def flight_after_touch(field: Any, pair: Any, v: float, t2: float) -> tuple[float, float]:
    """Return overlap and rate of a pair after its touch, as if without contact force.

    `pair` touches a time `pair.wait` after its clock, at the approach speed `v`. The result is for a time `t2` later.
    """
    if DRIVEN and pair.wall > 0:
        return flight_at_wall(field, pair, pair.wait, 0.0, -v, t2)
    if HUNG:
        gap, rate = hung_after(0.0, -v, field.omega, rest_gap(field, pair), t2)
        return -gap, -rate
    return t2 * (v + 0.5 * pair.pull * t2), v + pair.pull * t2


@kernel
def separation_velocities(s: Any, c: int, pair: Any, over: float, rate_change: float, v2: float) -> tuple[float, float]:
    """Return the velocities in m/s of lower and upper body when pair `c` separates.

    The contact changes the relative velocity by `rate_change`. At its end, a time `over` after the clock of `pair`, the
    separation speed is `v2`. The heavier body receives its fraction of `rate_change`. The velocity of the lighter body
    follows from `v2`, so that rounding errors do not accumulate.
    """
    lower, upper = s.bodies[c], s.bodies[c + 1]
    share = min(lower.inverse_mass, upper.inverse_mass) / (lower.inverse_mass + upper.inverse_mass)
    if lower.inverse_mass <= upper.inverse_mass:
        v = velocity_without_contacts(s, c, pair, over) - share * rate_change
        return v, v + v2
    v = velocity_without_contacts(s, c + 1, pair, over) + share * rate_change
    return v - v2, v


@kernel
def contact_map(s: Any, c: int, v: float) -> tuple[float, float, float, float, int]:
    """Return (t1, t2, v1, v2) of a contact of pair `c`, and the source of this map.

    `v` is the approach speed in m/s. The force ends at t1 with separation speed v1, and the overlap ends at t2 with
    separation speed v2 (in s after the onset and m/s, see `maps`). t1 is nan if the map is unknown. The source is the
    index of a table, or one of these codes:

    CLOSED_FORM: a formula. If t1 is nan, the contact has neither a formula nor a table.
    THERMAL_WALL: a random speed. INTEGRATED: this contact was integrated alone.
    NOT_INTEGRATED: this contact has to be integrated alone first.
    `TABLE_WANTED`: the table has to be computed first.
    `TABLE_REFUSED`: the contact has no table, and has to be integrated by pieces.
    """
    pair, law = s.pairs[c], s.kinds[s.pairs[c].kind_of]
    if HEATED and pair.wall < 0:
        v2 = speed_away(s.ledger, pair.wall)
        return 0.0, 0.0, v2, v2, THERMAL_WALL
    t1 = t2 = v1 = v2 = math.nan
    if HUNG:
        inverse = s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass
        t1, t2, v1, v2 = map_of_pendula(law, inverse, s.field.square, pair.pull, v)
    elif not DRIVEN or pair.wall == 0:
        t1, t2, v1, v2 = closed_form_map(law, s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, pair.pull, v)
    if t1 > 0.0:
        return t1, t2, v1, v2, CLOSED_FORM
    source = table_of(s, c, v) if pair.map >= 0 else CLOSED_FORM
    if source >= 0:
        t1, t2, v1, v2 = tabled_map(s.tables[source], law.elastic, v)
    elif source != TABLE_WANTED and s.run[0].disturbing == IGNORE:
        source = INTEGRATED if s.run[0].answered else NOT_INTEGRATED
        s.run[0].answered = 0
        if source == INTEGRATED:
            t1, t2, v1, v2 = s.answer[0], s.answer[1], s.answer[2], s.answer[3]
    return t1, t2, v1, v2, source


@kernel
def write_log_row(s: Any, c: int, v: float, t1: float, v1: float, v2: float, source: int) -> None:
    """Write the log row of the contact of pair `c` at its onset.

    The parameters are explained in `contact_map`. The row is deleted if an island takes over the contact.
    """
    run, pair, lower, upper = s.run[0], s.pairs[c], s.bodies[c], s.bodies[wrapped_number(s.pairs, c + 1)]
    row, pair.row = s.log[run.rows], run.rows
    run.rows += 1
    inverse = lower.inverse_mass + upper.inverse_mass
    impulse = (v + pair.pull * t1 + v1) / inverse
    if HUNG:
        impulse = impulse_of_pendula(s, c, v, t1, v1)
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.t, pair.t + (t1 + pair.tail), t1
    row.lower_in, row.upper_in = velocity_now(lower, run), velocity_now(upper, run)
    row.lower_out = row.lower_in - lower.fall * t1 - lower.inverse_mass * impulse
    row.upper_out = row.upper_in - upper.fall * t1 + upper.inverse_mass * impulse
    row.impulse, row.xi_max, row.force_max = impulse, 0.0, 0.0
    if HUNG:
        momentum = (flight_after_touch(s.field, pair, v, t1)[1] + v1) / inverse
        lower_time, upper_time = time_since(lower, run.t, run.tail) + t1, time_since(upper, run.t, run.tail) + t1
        row.lower_out = swing_after(lower, run.omega, lower_time)[0] - lower.inverse_mass * momentum
        row.upper_out = swing_after(upper, run.omega, upper_time)[0] + upper.inverse_mass * momentum
    if HEATED and source == THERMAL_WALL:
        row.force_max = math.nan
        if pair.wall == -1:
            row.upper_out = row.lower_in + v1
        else:
            row.lower_out = row.upper_in - v1
    elif METERED and run.log_level == ENERGIES:
        # v2 instead of v1, because the force is 0 from t1 to t2
        row.force_max = 0.5 * (v - v2) * (v + v2) / inverse if source != INTEGRATED else s.answer[5]
    elif run.log_level == PEAKS:
        law = s.kinds[pair.kind_of]
        if HUNG:
            row.xi_max, row.force_max = peaks_of_pendula(law, inverse, s.field.square, pair.pull, v, t1)
        elif source == CLOSED_FORM:
            row.xi_max, row.force_max = closed_form_peaks(law, inverse, pair.pull, v, t1, v1)
        elif source == INTEGRATED:
            row.xi_max, row.force_max = s.answer[4], s.answer[5]
        else:
            row.xi_max, row.force_max = tabled_peaks(s.tables[source], v)


@kernel
def count_contact(run: Any, pair: Any, isolated: bool, first: int, t2: float) -> None:
    """Count a contact that is solved as one event, as isolated or as disturbed.

    For the first disturbed contact of the run, its end and the lower pair `first` of the two neighbours are stored. The
    contact lasts `t2`.
    """
    pair.contacts += 1
    run.steps += 1
    run.events += 1
    run.contacts += 1
    pair.isolated = 1 if isolated else NOT_ISOLATED
    if isolated:
        run.isolated += 1
    elif run.first < 0:
        run.first, run.disturbed = first, run.t + t2


@kernel
def set_velocity(body: Any, pair: Any, v: float) -> None:
    """Set the velocity of a body to `v` in m/s, and its clock to the clock of `pair`."""
    body.v, body.t, body.tail = v, pair.t, pair.tail
