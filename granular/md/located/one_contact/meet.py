"""Isolated contacts as one event each, with a delay and a displacement.

A contact that begins now is solved immediately by its map (`maps`) if it is certain that no neighbour touches before it
is over. The gaps next to the pair are its *flanks*. One subtraction per flank certifies that the flank stays open. The
contact force pushes the shared body towards the flank, and a contact at the flank's far end pushes that body towards it
too. The flank is therefore concave until both contacts are over, at T. It was positive, so if it is positive at T, it
is positive in between. A flank that is pulled open below a ceiling, by forces or by a driven wall, is convex by at most
P. From a to b in a time L it stays positive if (√a + √b)² > P L²/2. This bound is not used if the pair at the far end
is in contact too, because a is then unknown.

From then on the pair and its flanks are described by their asymptotes: the motion after the contact, with a clock that
can be `ahead`. The pair is ahead by the duration of its contact (`lasts`), at the end of which ξ = 0. A flank is ahead
by the contact of its neighbour. With ξ and η inside the contact, and ξ_v and η_v of the pair's asymptote, a flank is
smaller by share·(ξ_v - ξ) than its own asymptote.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import hung_after, swung
from granular._engine.kernels import DRIVEN, HEATED, HUNG, RING, WORKED, kernel
from granular._engine.records import leaf, replay
from granular.md.located.contacts import NOT_ISOLATED, is_awaited
from granular.md.located.jumps import count_hit, speed_away
from granular.md.located.ledger import book_at_once, keep_solo
from granular.md.located.log import velocity_now
from granular.md.located.one_contact.maps import encounter, of_pendula, peaks, peaks_of_pendula
from granular.md.located.one_contact.tables import WANTED, table_of, tabled, tabled_peaks
from granular.md.located.pendula import impulse_of_pendula, shift
from granular.md.located.pieces import DRIFT_NOISE_FACTOR, FLOAT_SPACING, predict, since, tick
from granular.md.located.records import (
    BEGIN,
    BY_PIECES,
    DONE,
    IGNORE,
    NO_LOG,
    OPEN,
    PEAKS,
    UNTIL_ANY_EVENT,
    WANTS_CONTACT,
    WANTS_TABLE,
)
from granular.md.located.system import beside, count_of, nth
from granular.md.located.walls import (
    carry_walls,
    convexity,
    flight_at_wall,
    flown,
    gap_later,
    rate_later,
    rest_gap,
    touching_rate,
    velocity_of_wall,
)

MAX_TIME_LEFT_OF_PENDULA = 0.5
"""Longest remaining contact beyond a flank of pendula, in units of 1/Ω."""
CLOSED, FOLLOWED, TO_FOLLOW, THERMAL = -3, -4, -5, -6
"""Source of a contact map, if it is not a table.

A closed form, pieces integrated to the end of the contact, or pieces to be integrated first. THERMAL is a wall that
throws the ball back in no time."""


@kernel
def solve_as_one_event(s: Any, c: int) -> int:
    """Solve the contact of pair `c`, which is due, as one event.

    Return DONE if the contact map is known and the contact is certainly isolated, or if disturbances are ignored.
    Otherwise return BY_PIECES, or the missing information: WANTS_TABLE or WANTS_CONTACT.
    """
    run, pairs, pair = s.run[0], s.pairs, s.pairs[c]
    v = touching_rate(s.field, pair, pair.wait) if may_happen_at_once(run, pairs, c) else 0.0
    # below this speed rounding errors decide whether the balls approach at all
    if not v > DRIFT_NOISE_FACTOR * pair.noise:
        return BY_PIECES
    t1, t2, v1, v2, source = contact_map(s, c, v)
    if not t1 > 0.0 and source != THERMAL:
        run.wanted = c
        return WANTS_TABLE if source == WANTED else WANTS_CONTACT if source == TO_FOLLOW else BY_PIECES
    over = pair.wait + t2
    moment, rate_change = course(s.field, pair, v, t2)
    # from here on mass times displacement, equal and opposite for both bodies
    moment /= s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass
    lower_v, upper_v = parted(s, c, pair, over, rate_change + v2, v2)
    lower, upper = beside(pairs, c)
    below, certain_below, rate_below, time_left_below = flank_below(s, c, t2, moment, lower_v)
    above, certain_above, rate_above, time_left_above = flank_above(s, c, t2, moment, lower_v, upper_v)
    isolated = below > 0.0 and above > 0.0 and certain_below and certain_above
    if not isolated and (run.disturbing != IGNORE or min(below, above) == -math.inf):
        return BY_PIECES
    if HUNG and max(time_left_below, time_left_above) * run.omega > MAX_TIME_LEFT_OF_PENDULA:
        return BY_PIECES
    if source >= 0:
        run.error += s.tables[source].error
    begin_at_once(s, c, v, t1, v1, source)
    count(run, pair, isolated, c if below > 0.0 and certain_below else lower, t2)
    part_at_once(s, c, v, t2, v2, moment, source)
    free(s.bodies[c], pair, lower_v)
    free(s.bodies[nth(pairs, c + 1)], pair, upper_v)
    if lower >= 0:
        deflect(s, lower, pair, below, rate_below, time_left_below)
    if upper < count_of(pairs):
        deflect(s, upper, pair, above, rate_above, time_left_above)
    update_queue(s, lower, c, upper)
    return DONE


@kernel
def may_happen_at_once(run: Any, pairs: Any, c: int) -> bool:
    """Return whether the next event of pair `c` is an onset that can be one event.

    It cannot if the run stops at this contact. Unless disturbances are ignored, it also cannot if the run stops at any
    event, or if the pair is at a driven wall.
    """
    pair = pairs[c]
    if pair.mode != OPEN or pair.event != BEGIN or is_awaited(run, pairs, c):
        return False
    return not ((run.until_pair == UNTIL_ANY_EVENT or (DRIVEN and pair.wall > 0)) and run.disturbing != IGNORE)


@kernel
def flank_below(s: Any, c: int, t2: float, moment: float, lower_v: float) -> tuple[float, bool, float, float]:
    """Return the final gap of the flank below pair `c`, and whether it stays open.

    Also return its final rate, and the remaining time of the contact beyond it. See `clearance`. Without a flank the
    gap is infinite. The inverse mass of the lower ball times `moment` is its displacement by the contact, and `lower_v`
    is its final velocity.
    """
    pairs, pair, lower = s.pairs, s.pairs[c], beside(s.pairs, c)[0]
    if lower < 0:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = lower_v - coasting(s, nth(pairs, c - 1), pair, over)
    time_left = remaining_contact_time(pairs[nth(pairs, c - 2)], pair, over) if RING or c > 1 else 0.0
    narrowing = s.bodies[c].inverse_mass * moment
    gap, certain = clearance(s.field, pairs[lower], pair, t2, narrowing, rate, time_left)
    return gap, certain, rate, time_left


@kernel
def flank_above(
    s: Any, c: int, t2: float, moment: float, lower_v: float, upper_v: float
) -> tuple[float, bool, float, float]:
    """Like `flank_below`, for the gap above.

    On a ring of two balls both flanks are the same gap. It is evaluated here with both displacements, and `flank_below`
    reports no flank.
    """
    pairs, bodies, pair, n, upper = s.pairs, s.bodies, s.pairs[c], count_of(s.pairs), beside(s.pairs, c)[1]
    if upper >= n:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = coasting(s, nth(pairs, c + 2), pair, over) - upper_v
    time_left = remaining_contact_time(pairs[nth(pairs, c + 2)], pair, over) if RING or c + 2 < n else 0.0
    narrowing = bodies[c + 1].inverse_mass * moment
    if RING and n == 2:
        rate, time_left = lower_v - upper_v, 0.0
        narrowing = (bodies[c].inverse_mass + bodies[c + 1].inverse_mass) * moment
    gap, certain = clearance(s.field, pairs[upper], pair, t2, narrowing, rate, time_left)
    return gap, certain, rate, time_left


@kernel
def begin_at_once(s: Any, c: int, v: float, t1: float, v1: float, source: int) -> None:
    """Advance the run to the touch of pair `c`, and log its contact."""
    run, pair = s.run[0], s.pairs[c]
    tick(pair, pair.wait)
    run.t, run.tail = pair.t, pair.tail
    if run.log_level != NO_LOG:
        if DRIVEN:
            carry_walls(s.field, s)
        write_row(s, c, v, t1, v1, source)


@kernel
def part_at_once(s: Any, c: int, v: float, t2: float, v2: float, moment: float, source: int) -> None:
    """Give pair `c` its asymptote, from the end of its contact on.

    Pendula are also moved by their displacement during the contact.
    """
    pair, bodies = s.pairs[c], s.bodies
    tick(pair, t2)
    pair.xi, pair.eta, pair.lasts, pair.ahead, pair.speed, pair.exact = 0.0, -v2, t2, 1 if t2 > 0.0 else 0, v, 0
    pair.noise += FLOAT_SPACING * v
    if HEATED and source == THERMAL:
        count_hit(s, c, v, v2)
    elif WORKED:
        keep_solo(s.ledger, s, c)
        book_at_once(s.ledger, s, c, 1.0)
    predict(pair, s.kinds[pair.kind_of], s.field)
    leaf(s.queue, c).due = pair.due
    if HUNG:
        shift(s.run[0], bodies[c], pair, -bodies[c].inverse_mass * moment)
        shift(s.run[0], bodies[c + 1], pair, bodies[c + 1].inverse_mass * moment)


@kernel
def update_queue(s: Any, lower: int, c: int, upper: int) -> None:
    """Update the queue for pair `c` and its flanks."""
    if RING and upper - lower != 2:
        # on a ring the three pairs need not be neighbours in the queue
        replay(s.queue, c, c)
        replay(s.queue, upper, upper)
        replay(s.queue, max(0, lower), max(0, lower))
    else:
        replay(s.queue, max(0, c - 1), min(c + 1, count_of(s.pairs) - 1))


@kernel
def course(field: Any, pair: Any, v: float, t2: float) -> tuple[float, float]:
    """Return the overlap and the rate of `pair` without a force, `t2` after its touch.

    The pair touches after its `wait` at speed `v`.
    """
    if DRIVEN and pair.wall > 0:
        return flight_at_wall(field, pair, pair.wait, 0.0, -v, t2)
    if HUNG:
        gap, rate = hung_after(0.0, -v, field.omega, rest_gap(field, pair), t2)
        return -gap, -rate
    return t2 * (v + 0.5 * pair.pull * t2), v + pair.pull * t2


@kernel
def parted(s: Any, c: int, pair: Any, over: float, rate_change: float, v2: float) -> tuple[float, float]:
    """Return the velocities of the bodies of pair `c` when they separate.

    They separate at speed `v2`, a time `over` after the clock of the pair. The heavier body receives its share of
    `rate_change`. The velocity of the lighter body follows from `v2`, so rounding errors of the shares do not
    accumulate.
    """
    lower, upper = s.bodies[c], s.bodies[c + 1]
    share = min(lower.inverse_mass, upper.inverse_mass) / (lower.inverse_mass + upper.inverse_mass)
    if lower.inverse_mass <= upper.inverse_mass:
        v = coasting(s, c, pair, over) - share * rate_change
        return v, v + v2
    v = coasting(s, c + 1, pair, over) + share * rate_change
    return v - v2, v


@kernel
def contact_map(s: Any, c: int, v: float) -> tuple[float, float, float, float, int]:
    """Return (t1, t2, v1, v2) of the contact of pair `c` at speed `v`, and its source.

    t1 is nan if the contact is unknown. The source is the index of a table, CLOSED, FOLLOWED or THERMAL. It is WANTED
    if a table has to be made, TO_FOLLOW if the contact has to be integrated.
    """
    pair, law = s.pairs[c], s.kinds[s.pairs[c].kind_of]
    if HEATED and pair.wall < 0:
        v2 = speed_away(s.ledger, pair.wall)
        return 0.0, 0.0, v2, v2, THERMAL
    t1 = t2 = v1 = v2 = math.nan
    if HUNG:
        inverse = s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass
        t1, t2, v1, v2 = of_pendula(law, inverse, s.field.square, pair.pull, v)
    elif not DRIVEN or pair.wall == 0:
        t1, t2, v1, v2 = encounter(law, s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, pair.pull, v)
    if t1 > 0.0:
        return t1, t2, v1, v2, CLOSED
    source = table_of(s, c, v) if pair.map >= 0 else CLOSED
    if source >= 0:
        t1, t2, v1, v2 = tabled(s.tables[source], law.elastic, v)
    elif source != WANTED and s.run[0].disturbing == IGNORE:
        source = FOLLOWED if s.run[0].answered else TO_FOLLOW
        s.run[0].answered = 0
        if source == FOLLOWED:
            t1, t2, v1, v2 = s.answer[0], s.answer[1], s.answer[2], s.answer[3]
    return t1, t2, v1, v2, source


@kernel
def clearance(
    field: Any, flank: Any, pair: Any, t2: float, narrowing: float, rate: float, time_left: float
) -> tuple[float, bool]:
    """Return the gap of a flank after all contacts beside it, and if it is certain.

    It is certain if a positive gap stays open in between. The contact of `pair` lasts `t2` and reduces the gap by
    `narrowing`. The gap then grows at `rate`. The contact beyond the flank lasts for another time `time_left`. A flank
    that is not in free flight has the gap -inf.
    """
    start = since(flank, pair.t, pair.tail) + pair.wait
    if flank.slot >= 0 or flank.mode != OPEN or (flank.lasts > 0.0 and start < 0.0):
        return -math.inf, False
    gap = -flown(field, flank, start + t2)[0] - narrowing
    if time_left > 0.0:
        gap = gap_later(field, flank, start + t2, gap, rate, time_left)
    bulge = convexity(field, flank, start, t2 + time_left)
    if bulge > 0.0 and gap > 0.0:
        root = math.sqrt(max(0.0, -flown(field, flank, start)[0])) + math.sqrt(gap)
        return gap, bool(time_left == 0.0 and root * root > 0.5 * bulge * t2 * t2)
    return gap, True


@kernel
def write_row(s: Any, c: int, v: float, t1: float, v1: float, source: int) -> None:
    """Write the log row of the contact of pair `c` at its onset.

    The row is deleted if an island takes over the contact.
    """
    run, pair, one, two = s.run[0], s.pairs[c], s.bodies[c], s.bodies[nth(s.pairs, c + 1)]
    row, pair.row = s.log[run.rows], run.rows
    run.rows += 1
    inverse = one.inverse_mass + two.inverse_mass
    impulse = (v + pair.pull * t1 + v1) / inverse
    if HUNG:
        impulse = impulse_of_pendula(s, c, v, t1, v1)
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.t, pair.t + (t1 + pair.tail), t1
    row.lower_in, row.upper_in = velocity_now(one, run), velocity_now(two, run)
    row.lower_out = row.lower_in - one.fall * t1 - one.inverse_mass * impulse
    row.upper_out = row.upper_in - two.fall * t1 + two.inverse_mass * impulse
    row.impulse, row.xi_max, row.force_max = impulse, 0.0, 0.0
    if HUNG:
        transferred = (course(s.field, pair, v, t1)[1] + v1) / inverse
        row.lower_out = swung(one, run.omega, since(one, run.t, run.tail) + t1)[0] - one.inverse_mass * transferred
        row.upper_out = swung(two, run.omega, since(two, run.t, run.tail) + t1)[0] + two.inverse_mass * transferred
    if HEATED and source == THERMAL:
        row.force_max = math.nan
        if pair.wall == -1:
            row.upper_out = row.lower_in + v1
        else:
            row.lower_out = row.upper_in - v1
    elif run.log_level == PEAKS:
        law = s.kinds[pair.kind_of]
        if HUNG:
            row.xi_max, row.force_max = peaks_of_pendula(law, inverse, s.field.square, pair.pull, v, t1)
        elif source == CLOSED:
            row.xi_max, row.force_max = peaks(law, inverse, pair.pull, v, t1, v1)
        elif source == FOLLOWED:
            row.xi_max, row.force_max = s.answer[4], s.answer[5]
        else:
            row.xi_max, row.force_max = tabled_peaks(s.tables[source], v)


@kernel
def count(run: Any, pair: Any, isolated: bool, first: int, t2: float) -> None:
    """Count a contact that is solved as one event.

    If it is not isolated, a neighbour touches when it is over.
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
def coasting(s: Any, b: int, pair: Any, dt: float) -> float:
    """Return the velocity that body `b` would have without contacts.

    The time is `dt` after the clock of `pair`.
    """
    body = s.bodies[nth(s.pairs, b)]
    if DRIVEN and body.wall > 0.0:
        return velocity_of_wall(s.field, int(body.wall) - 1, pair.t, pair.tail + dt)[0]
    if HUNG:
        return swung(body, s.run[0].omega, since(body, pair.t, pair.tail) + dt)[0]
    v: float = body.v - body.fall * (since(body, pair.t, pair.tail) + dt)
    return v


@kernel
def remaining_contact_time(beyond: Any, pair: Any, dt: float) -> float:
    """Return the remaining time in contact of the pair beyond a flank.

    The reference time is `dt` after the clock of `pair`.
    """
    left: float = -(since(beyond, pair.t, pair.tail) + dt)
    return left if beyond.lasts > 0.0 and left > 0.0 and beyond.slot < 0 else 0.0


@kernel
def free(body: Any, pair: Any, v: float) -> None:
    """Set the velocity of a body at the clock of `pair` to `v`."""
    body.v, body.t, body.tail = v, pair.t, pair.tail


@kernel
def deflect(s: Any, f: int, pair: Any, gap: float, rate: float, time_left: float) -> None:
    """Give flank `f` its asymptote, from the end of all contacts beside it.

    `pair` already has its asymptote.
    """
    flank = s.pairs[f]
    flank.t, flank.tail = pair.t, pair.tail
    flank.eta = rate_later(s.field, flank, gap, -rate, time_left)
    flank.xi = -max(0.0, gap)
    flank.lasts, flank.ahead, flank.exact = 0.0, 1, 0
    flank.noise += FLOAT_SPACING * pair.speed
    if time_left > 0.0:
        tick(flank, time_left)
    predict(flank, s.kinds[flank.kind_of], s.field)
    leaf(s.queue, f).due = flank.due

