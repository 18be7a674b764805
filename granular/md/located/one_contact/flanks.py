"""Flanks, the gaps beside a pair in contact: test, and state after the contact.

*Test of a flank.* A flank must stay positive until all contacts next to it have ended, at the time T. The force of the
pair pushes the ball between the pair and the flank towards the flank. A contact at the far end of the flank also
narrows the flank. The flank is therefore a concave function of time up to T. It is positive at the onset. If it is
positive at T, it is positive in between, so one subtraction is sufficient.

Gravity below a ceiling, external forces or a driven wall can make a flank convex, with a second derivative of at most
P. If it is a at the onset and b after a time L, it stays positive for (√a + √b)² > P L²/2. This bound is not used if
the pair at the far end is also in contact, because a is then unknown.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swing_after
from granular._engine.kernels import DRIVEN, HUNG, RING, kernel
from granular._engine.records import leaf
from granular.md.located.numbering import neighbour_pairs, pair_count, wrapped_number
from granular.md.located.pieces import FLOAT_SPACING, advance_clock, predict_flight, time_since
from granular.md.located.records import OPEN
from granular.md.located.walls import convexity, free_flight, gap_later, rate_later, velocity_of_wall


@kernel
def flank_below(s: Any, c: int, t2: float, moment: float, lower_v: float) -> tuple[float, bool, float, float]:
    """Return the state of the flank below pair `c` after all contacts next to it.

    The contact of pair `c` lasts `t2` from the onset to ξ = 0. `moment` is mass times displacement by the contact in kg
    m, equal and opposite for both balls. `lower_v` is the velocity of the lower ball after the contact.

    Returns
    -------
    gap, certain, rate, time_left : float, bool, float, float
        Gap in m, and `certain` of `final_flank_gap`. Rate of the gap in m/s after the contact of pair `c`, and
        remaining time in s of the contact at the far end. Without a flank the gap is inf.
    """
    pairs, pair, lower = s.pairs, s.pairs[c], neighbour_pairs(s.pairs, c)[0]
    if lower < 0:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = lower_v - velocity_without_contacts(s, wrapped_number(pairs, c - 1), pair, over)
    time_left = remaining_contact_time(pairs[wrapped_number(pairs, c - 2)], pair, over) if RING or c > 1 else 0.0
    narrowing = s.bodies[c].inverse_mass * moment
    gap, certain = final_flank_gap(s.field, pairs[lower], pair, t2, narrowing, rate, time_left)
    return gap, certain, rate, time_left


@kernel
def flank_above(
    s: Any, c: int, t2: float, moment: float, lower_v: float, upper_v: float
) -> tuple[float, bool, float, float]:
    """Return the state of the flank above pair `c` after all contacts next to it.

    Parameters and return values are as in `flank_below`. `upper_v` is the velocity of the upper ball after the contact.
    On a ring of two balls both flanks are one gap. It is evaluated here, and `flank_below` reports no flank.
    """
    pairs, bodies, pair, n, upper = s.pairs, s.bodies, s.pairs[c], pair_count(s.pairs), neighbour_pairs(s.pairs, c)[1]
    if upper >= n:
        return math.inf, True, 0.0, 0.0
    over = pair.wait + t2
    rate = velocity_without_contacts(s, wrapped_number(pairs, c + 2), pair, over) - upper_v
    time_left = remaining_contact_time(pairs[wrapped_number(pairs, c + 2)], pair, over) if RING or c + 2 < n else 0.0
    narrowing = bodies[c + 1].inverse_mass * moment
    if RING and n == 2:
        rate, time_left = lower_v - upper_v, 0.0
        narrowing = (bodies[c].inverse_mass + bodies[c + 1].inverse_mass) * moment
    gap, certain = final_flank_gap(s.field, pairs[upper], pair, t2, narrowing, rate, time_left)
    return gap, certain, rate, time_left


@kernel
def final_flank_gap(
    field: Any, flank: Any, pair: Any, t2: float, narrowing: float, rate: float, time_left: float
) -> tuple[float, bool]:
    """Return the final gap of a flank, and whether the flank is positive until then.

    The contact of `pair` lasts `t2` and reduces the flank by `narrowing`. The flank then has the rate `rate`. The
    contact at its far end lasts longer by `time_left`.

    Returns
    -------
    gap, certain : float, bool
        Gap in m after both contacts. `certain` is true if a positive gap proves that the flank was positive throughout.
        The gap is -inf for a flank that is not in free flight.
    """
    start = time_since(flank, pair.t, pair.tail) + pair.wait
    if flank.slot >= 0 or flank.mode != OPEN or (flank.lasts > 0.0 and start < 0.0):
        return -math.inf, False
    gap = -free_flight(field, flank, start + t2)[0] - narrowing
    if time_left > 0.0:
        gap = gap_later(field, flank, start + t2, gap, rate, time_left)
    bulge = convexity(field, flank, start, t2 + time_left)
    if bulge > 0.0 and gap > 0.0:
        root = math.sqrt(max(0.0, -free_flight(field, flank, start)[0])) + math.sqrt(gap)
        return gap, bool(time_left == 0.0 and root * root > 0.5 * bulge * t2 * t2)
    return gap, True


@kernel
def velocity_without_contacts(s: Any, b: int, pair: Any, dt: float) -> float:
    """Return the velocity in m/s of body `b` without contact forces.

    The time is `dt` after the clock of `pair`. For a driven wall it is the velocity of the wall.
    """
    body = s.bodies[wrapped_number(s.pairs, b)]
    if DRIVEN and body.wall > 0.0:
        return velocity_of_wall(s.field, int(body.wall) - 1, pair.t, pair.tail + dt)[0]
    if HUNG:
        return swing_after(body, s.run[0].omega, time_since(body, pair.t, pair.tail) + dt)[0]
    v: float = body.v - body.fall * (time_since(body, pair.t, pair.tail) + dt)
    return v


@kernel
def remaining_contact_time(beyond: Any, pair: Any, dt: float) -> float:
    """Return the remaining time in contact of the pair at the far end of a flank.

    The time in s of pair `beyond` is counted from `dt` after the clock of `pair`. It is 0 if no contact solved as one
    event is in progress.
    """
    left: float = -(time_since(beyond, pair.t, pair.tail) + dt)
    return left if beyond.lasts > 0.0 and left > 0.0 and beyond.slot < 0 else 0.0


@kernel
def set_flank_asymptote(s: Any, f: int, pair: Any, gap: float, rate: float, time_left: float) -> None:
    """Replace the state of flank `f` by its asymptote after all contacts next to it.

    `pair` already has its asymptote. The other parameters are as in `final_flank_gap`.
    """
    flank = s.pairs[f]
    flank.t, flank.tail = pair.t, pair.tail
    flank.eta = rate_later(s.field, flank, gap, -rate, time_left)
    flank.xi = -max(0.0, gap)
    flank.lasts, flank.ahead, flank.exact = 0.0, 1, 0
    flank.noise += FLOAT_SPACING * pair.speed
    if time_left > 0.0:
        advance_clock(flank, time_left)
    predict_flight(flank, s.kinds[flank.kind_of], s.field)
    leaf(s.queue, f).due = flank.due
