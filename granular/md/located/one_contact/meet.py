"""Isolated contacts: one event each, as in event-driven simulation, but with a delay and a displacement.

A contact that begins now is solved at once by its map (`maps`), if it is certain that no neighbour touches before it is
over. That is certified by one subtraction for each neighbouring gap, its flank: the contact force pushes the body they
share towards the flank, and a contact at the flank's far end pushes that body towards it too, so the flank is concave
until both are over, at T; it was positive, and if it is at T, it is in between. A flank that is pulled open, below a
ceiling, by forces or by a driven wall, is convex by at most P: from a to b in a time L it stays positive if
(√a + √b)² > P L²/2; this is not asked if the pair at its far end is in contact too, for then a is not known.

What the pair and its flanks keep from then on are their asymptotes: the motion after the contact, with a clock that may
lie `ahead`: for the pair by how long its contact `lasts`, at the end of which ξ = 0, for a flank by the contact of its
neighbour. With ξ and η inside the contact, and ξ_v and η_v of the pair's asymptote, a flank is smaller by
share·(ξ_v - ξ) than its own asymptote says.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import hung_after, swung
from granular._engine.kernels import DRIVEN, HEATED, HUNG, RING, WORKED, kernel
from granular._engine.records import leaf, replay
from granular.md.located.contacts import DISTURBED, is_awaited
from granular.md.located.jumps import count_hit, speed_away
from granular.md.located.ledger import book_at_once, keep_solo
from granular.md.located.log import velocity_now
from granular.md.located.one_contact.maps import encounter, of_pendula, peaks, peaks_of_pendula
from granular.md.located.one_contact.tables import WANTED, table_of, tabled, tabled_peaks
from granular.md.located.pendula import impulse_of_pendula, shift
from granular.md.located.pieces import DRIFT, ULP, predict, since, tick
from granular.md.located.records import (
    BEGIN,
    BY_PIECES,
    DONE,
    IGNORE,
    NO_LOG,
    OPEN,
    PEAKS,
    WANTS_CONTACT,
    WANTS_TABLE,
    WATCHED,
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

BRIEF = 0.5
"""Part of 1/Ω that a contact beyond a flank of pendula may still last."""
CLOSED, FOLLOWED, TO_FOLLOW, THERMAL = -3, -4, -5, -6
"""Where a contact is known from, if not from a table: a closed form, or pieces that were followed to its end, or first
are to be; THERMAL is a wall that throws back, which takes no time."""


@kernel
def happen_at_once(s: Any, c: int) -> int:
    """Let the contact of pair `c`, which is due, happen at once if it is known and certain to be isolated: DONE; else
    return BY_PIECES, or what is wanted first: WANTS_TABLE, WANTS_CONTACT."""
    run, pairs, pair = s.run[0], s.pairs, s.pairs[c]
    v = touching_rate(s.field, pair, pair.wait) if may_happen_at_once(run, pairs, c) else 0.0
    if not v > DRIFT * pair.noise:
        return BY_PIECES
    t1, t2, v1, v2, source = contact_map(s, c, v)
    if not t1 > 0.0 and source != THERMAL:
        run.wanted = c
        return WANTS_TABLE if source == WANTED else WANTS_CONTACT if source == TO_FOLLOW else BY_PIECES
    over = pair.wait + t2
    way, kick = course(s.field, pair, v, t2)
    way /= s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass
    lower_v, upper_v = parted(s, c, pair, over, kick + v2, v2)
    lower, upper = beside(pairs, c)
    below, sure_below, rate_below, busy_below = flank_below(s, c, t2, way, lower_v)
    above, sure_above, rate_above, busy_above = flank_above(s, c, t2, way, lower_v, upper_v)
    isolated = below > 0.0 and above > 0.0 and sure_below and sure_above
    if not isolated and (run.disturbing != IGNORE or min(below, above) == -math.inf):
        return BY_PIECES
    if HUNG and max(busy_below, busy_above) * run.omega > BRIEF:
        return BY_PIECES
    if source >= 0:
        run.error += s.tables[source].error
    begin_at_once(s, c, v, t1, v1, source)
    count(run, pair, isolated, c if below > 0.0 and sure_below else lower, t2)
    part_at_once(s, c, v, t2, v2, way, source)
    free(s.bodies[c], pair, lower_v)
    free(s.bodies[nth(pairs, c + 1)], pair, upper_v)
    if lower >= 0:
        deflect(s, lower, pair, below, rate_below, busy_below)
    if upper < count_of(pairs):
        deflect(s, upper, pair, above, rate_above, busy_above)
    queue_anew(s, lower, c, upper)
    return DONE


@kernel
def may_happen_at_once(run: Any, pairs: Any, c: int) -> bool:
    """Return whether what is due of pair `c` is the onset of a contact, and one that the run need not look at."""
    pair = pairs[c]
    if pair.mode != OPEN or pair.event != BEGIN or is_awaited(run, pairs, c):
        return False
    return not ((run.until_pair == WATCHED or (DRIVEN and pair.wall > 0)) and run.disturbing != IGNORE)


@kernel
def flank_below(s: Any, c: int, t2: float, way: float, lower_v: float) -> tuple[float, bool, float, float]:
    """Return of the flank below pair `c`, as `clearance` does, its gap when all is over and whether it is certain; the
    rate at which it grows then, and how long the contact beyond it goes on. Without a flank it is always wide enough.
    Each unit of impulse takes the lower ball a `way` down, and it leaves at `lower_v`."""
    pairs, pair, lower = s.pairs, s.pairs[c], beside(s.pairs, c)[0]
    if lower < 0:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = lower_v - coasting(s, nth(pairs, c - 1), pair, over)
    busy = still_busy(pairs[nth(pairs, c - 2)], pair, over) if RING or c > 1 else 0.0
    less = s.bodies[c].inverse_mass * way
    gap, sure = clearance(s.field, pairs[lower], pair, t2, less, rate, busy)
    return gap, sure, rate, busy


@kernel
def flank_above(
    s: Any, c: int, t2: float, way: float, lower_v: float, upper_v: float
) -> tuple[float, bool, float, float]:
    """Return the same of the flank above; on a ring of two balls that is between both of them."""
    pairs, bodies, pair, n, upper = s.pairs, s.bodies, s.pairs[c], count_of(s.pairs), beside(s.pairs, c)[1]
    if upper >= n:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = coasting(s, nth(pairs, c + 2), pair, over) - upper_v
    busy = still_busy(pairs[nth(pairs, c + 2)], pair, over) if RING or c + 2 < n else 0.0
    less = bodies[c + 1].inverse_mass * way
    if RING and n == 2:
        rate, busy, less = lower_v - upper_v, 0.0, (bodies[c].inverse_mass + bodies[c + 1].inverse_mass) * way
    gap, sure = clearance(s.field, pairs[upper], pair, t2, less, rate, busy)
    return gap, sure, rate, busy


@kernel
def begin_at_once(s: Any, c: int, v: float, t1: float, v1: float, source: int) -> None:
    """Let it be the time at which pair `c` touches, and write its contact into the log."""
    run, pair = s.run[0], s.pairs[c]
    tick(pair, pair.wait)
    run.t, run.tail = pair.t, pair.tail
    if run.log_level != NO_LOG:
        if DRIVEN:
            carry_walls(s.field, s)
        write_row(s, c, v, t1, v1, source)


@kernel
def part_at_once(s: Any, c: int, v: float, t2: float, v2: float, way: float, source: int) -> None:
    """Give pair `c` its asymptote, from the end of its contact on, and its bodies the displacement if they hang."""
    pair, bodies = s.pairs[c], s.bodies
    tick(pair, t2)
    pair.xi, pair.eta, pair.lasts, pair.ahead, pair.speed, pair.exact = 0.0, -v2, t2, 1 if t2 > 0.0 else 0, v, 0
    pair.noise += ULP * v
    if HEATED and source == THERMAL:
        count_hit(s, c, v, v2)
    elif WORKED:
        keep_solo(s.ledger, s, c)
        book_at_once(s.ledger, s, c, 1.0)
    predict(pair, s.kinds[pair.kind_of], s.field)
    leaf(s.queue, c).due = pair.due
    if HUNG:
        shift(s.run[0], bodies[c], pair, -bodies[c].inverse_mass * way)
        shift(s.run[0], bodies[c + 1], pair, bodies[c + 1].inverse_mass * way)


@kernel
def queue_anew(s: Any, lower: int, c: int, upper: int) -> None:
    """Let the queue know when pair `c` and its flanks are due now."""
    if RING and upper - lower != 2:
        replay(s.queue, c, c)
        replay(s.queue, upper, upper)
        replay(s.queue, max(0, lower), max(0, lower))
    else:
        replay(s.queue, max(0, c - 1), min(c + 1, count_of(s.pairs) - 1))


@kernel
def course(field: Any, pair: Any, v: float, t2: float) -> tuple[float, float]:
    """Return by how much the overlap of `pair`, which touches after its `wait` at speed `v`, would grow in a time `t2`
    without a force, and at which rate it would grow then."""
    if DRIVEN and pair.wall > 0:
        return flight_at_wall(field, pair, pair.wait, 0.0, -v, t2)
    if HUNG:
        gap, rate = hung_after(0.0, -v, field.omega, rest_gap(field, pair), t2)
        return -gap, -rate
    return t2 * (v + 0.5 * pair.pull * t2), v + pair.pull * t2


@kernel
def parted(s: Any, c: int, pair: Any, over: float, kick: float, v2: float) -> tuple[float, float]:
    """Return the velocities of the bodies of pair `c` a time `over` after its clock, when they part at speed `v2`.

    The heavier one takes its share of the `kick`, the change of their rate, and the lighter one follows: so no rounding
    of the shares adds up."""
    lower, upper = s.bodies[c], s.bodies[c + 1]
    share = min(lower.inverse_mass, upper.inverse_mass) / (lower.inverse_mass + upper.inverse_mass)
    if lower.inverse_mass <= upper.inverse_mass:
        v = coasting(s, c, pair, over) - share * kick
        return v, v + v2
    v = coasting(s, c + 1, pair, over) + share * kick
    return v - v2, v


@kernel
def contact_map(s: Any, c: int, v: float) -> tuple[float, float, float, float, int]:
    """Return (t1, t2, v1, v2) of the contact of pair `c` at speed `v`, t1 nan if it is not known, and where from:
    the place of a table, CLOSED, FOLLOWED, THERMAL; WANTED for a table to be made, TO_FOLLOW to be asked."""
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
    field: Any, flank: Any, pair: Any, t2: float, less: float, rate: float, busy: float
) -> tuple[float, bool]:
    """Return the gap of a flank when all contacts beside it are over, and whether it is certain to stay open if > 0.

    The contact of `pair` lasts `t2` and takes `less` from the gap, which grows at `rate` then; the contact beyond the
    flank goes on for the time `busy`. A flank that is not in free flight has none: minus infinity.
    """
    start = since(flank, pair.t, pair.tail) + pair.wait
    if flank.slot >= 0 or flank.mode != OPEN or (flank.lasts > 0.0 and start < 0.0):
        return -math.inf, False
    gap = -flown(field, flank, start + t2)[0] - less
    if busy > 0.0:
        gap = gap_later(field, flank, start + t2, gap, rate, busy)
    bulge = convexity(field, flank, start, t2 + busy)
    if bulge > 0.0 and gap > 0.0:
        root = math.sqrt(max(0.0, -flown(field, flank, start)[0])) + math.sqrt(gap)
        return gap, bool(busy == 0.0 and root * root > 0.5 * bulge * t2 * t2)
    return gap, True


@kernel
def write_row(s: Any, c: int, v: float, t1: float, v1: float, source: int) -> None:
    """Write the log row of the contact of pair `c` at its onset; it is void if the contact is taken up by an island."""
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
        kick = (course(s.field, pair, v, t1)[1] + v1) / inverse
        row.lower_out = swung(one, run.omega, since(one, run.t, run.tail) + t1)[0] - one.inverse_mass * kick
        row.upper_out = swung(two, run.omega, since(two, run.t, run.tail) + t1)[0] + two.inverse_mass * kick
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
    """Count a contact that is solved at once, now; if it is not isolated, a neighbour is due when it is over."""
    pair.contacts += 1
    run.steps += 1
    run.events += 1
    run.contacts += 1
    pair.isolated = 1 if isolated else DISTURBED
    if isolated:
        run.isolated += 1
    elif run.first < 0:
        run.first, run.disturbed = first, run.t + t2


@kernel
def coasting(s: Any, b: int, pair: Any, dt: float) -> float:
    """Return the velocity that body `b` would have a time `dt` after the clock of `pair` without contacts."""
    body = s.bodies[nth(s.pairs, b)]
    if DRIVEN and body.wall > 0.0:
        return velocity_of_wall(s.field, int(body.wall) - 1, pair.t, pair.tail + dt)[0]
    if HUNG:
        return swung(body, s.run[0].omega, since(body, pair.t, pair.tail) + dt)[0]
    v: float = body.v - body.fall * (since(body, pair.t, pair.tail) + dt)
    return v


@kernel
def still_busy(beyond: Any, pair: Any, dt: float) -> float:
    """Return how long the pair beyond a flank is still in contact a time `dt` after the clock of `pair`."""
    left: float = -(since(beyond, pair.t, pair.tail) + dt)
    return left if beyond.lasts > 0.0 and left > 0.0 and beyond.slot < 0 else 0.0


@kernel
def free(body: Any, pair: Any, v: float) -> None:
    """Let a body have the velocity `v` at the clock of `pair`."""
    body.v, body.t, body.tail = v, pair.t, pair.tail


@kernel
def deflect(s: Any, f: int, pair: Any, gap: float, rate: float, busy: float) -> None:
    """Give flank `f` its asymptote, from the end of all contacts beside it; `pair` has its own already."""
    flank = s.pairs[f]
    flank.t, flank.tail = pair.t, pair.tail
    flank.eta = rate_later(s.field, flank, gap, -rate, busy)
    flank.xi = -max(0.0, gap)
    flank.lasts, flank.ahead, flank.exact = 0.0, 1, 0
    flank.noise += ULP * pair.speed
    if busy > 0.0:
        tick(flank, busy)
    predict(flank, s.kinds[flank.kind_of], s.field)
    leaf(s.queue, f).due = flank.due

