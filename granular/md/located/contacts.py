"""Events of one contact, from its onset to its end, and the mode of its pair.

This module treats contacts that are integrated by pieces. Most isolated contacts are a single event instead
(`one_contact`).

*Onset.* Two balls fly until the gap closes: the pair is OPEN, and its next event is BEGIN. If the closing rate at the
touch is only noise, the balls graze each other and no contact begins. Otherwise the pair becomes ACTIVE, or RESIDUAL if
its law gives no force yet. A pair that touches at rest and is pressed together becomes DORMANT: its contact has begun,
but its force is below rounding error. It becomes ACTIVE when the force can be resolved (BEGIN).

*End.* A contact ends in one of five ways:

1. END of an active pair: the force falls to zero while the balls overlap. The pair becomes RESIDUAL. Either the overlap
   vanishes as well (PART, the pair is then OPEN), or the force becomes positive again (BEGIN, a new contact).
2. PART of an active pair: overlap and force vanish together. The pair becomes OPEN.
3. PART of a dormant pair: the balls separate before the force can be resolved. The pair becomes OPEN.
4. Jump of the velocity of a wall, or of a ball thrown back by a thermal wall (`jumps.apply_velocity_jump`): the force
   of an active pair is clipped, so that it becomes RESIDUAL, or a dormant pair is pulled apart and becomes OPEN.
5. Reflection at a thermal wall (`jumps.throw_ball_back`): the contact takes no time. The pair is STRUCK until the ball
   leaves.

If the balls separate with no more energy than rounding error and stay together (`stays_in_contact`), the contact does
not end. The pair becomes DORMANT instead.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HEATED, HUNG, RING, kernel
from granular.md.located.log import begin_contact, end_contact
from granular.md.located.modes import change_mode
from granular.md.located.numbering import is_closed, neighbour_pairs, pair_count, wrapped_number
from granular.md.located.pieces import DRIFT_NOISE_FACTOR, ROUNDING_OVERLAP_SHARE, direction, power, time_since
from granular.md.located.records import (
    ACTIVE,
    BEGIN,
    DORMANT,
    END,
    GENERAL,
    LINEAR,
    OPEN,
    PART,
    RELOAD,
    RESIDUAL,
    STOP,
    STRUCK,
    TURN,
)

ZERO_FORCE_SHARE = 1e-9
"""Fraction of its elastic force up to which the force of a pair counts as 0."""
NO_CHANGE, MODE_CHANGED, STOP_AWAITED = range(3)
"""Results of `make_dormant`: no new dormant pair, at least one, or a stop."""
TOUCH_ONLY, CONTACT = 0, 1
"""Numbers of contacts that `count_isolated` adds: 0 for an overlap without force."""
NOT_ISOLATED = -1
"""`isolated` of a pair after a disturbed contact, until the balls separate."""


@kernel
def apply_contact_event(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, block: Any, laws: Any) -> bool:
    """Apply the event that ends the piece of `block`.

    Returns false if the run has to stop before this event: at its stop condition, or before the first disturbed
    contact.
    """
    c, event = block.fired, block.event
    pair = pool[pairs[c].slot]
    if event == BEGIN:
        return begin_force(run, pairs, pool, bodies, c, block.speed, laws)
    run.events += 1
    if event in (TURN, RELOAD):
        change_mode(pair, event)
    elif (event == PART or pair.xi <= ROUNDING_OVERLAP_SHARE * pair.own_length) and stays_in_contact(pair, block.speed):
        # the balls separate only by rounding error: the contact continues, and the pair is dormant
        pair.mode, pair.xi = DORMANT, 0.0
        cancel_rate(pairs, pool, bodies, c)
    else:
        if pair.going_on == 1:  # a contact has begun but not ended
            end_contact(run, pairs, pool, bodies, log, c)
        change_mode(pair, event)
        if event != END:  # the overlap ended, too: count isolated contacts of the next overlap from 0
            pairs[c].isolated = 0
    return True


@kernel
def begin_force(run: Any, pairs: Any, pool: Any, bodies: Any, c: int, speed: float, laws: Any) -> bool:
    """Start the force of pair `c` after a touch or after its residual phase.

    `speed` is the typical speed of its island in m/s. If the balls only graze each other, no force starts. Returns
    false if the run has to stop before this contact.
    """
    pair = pool[pairs[c].slot]
    if HEATED and pair.wall < 0:
        return mark_struck(run, pairs, pool, c)
    if pair.mode == OPEN:
        pair.xi = 0.0
        if is_rate_noise(pair) or pair.eta < 0.0:  # grazing, or touching at rest
            pair.eta = min(0.0, pair.eta)
            return True
        if touches_by_rounding(pairs, pool, c, speed):
            cancel_rate(pairs, pool, bodies, c)
            return True
        if laws is not None:
            pair.mode = OPEN if laws.pushes_at_touch(pair) else RESIDUAL
            if pair.mode == RESIDUAL:  # an overlap without a force
                return count_isolated(run, pairs, pool, c, TOUCH_ONLY)
    return activate(run, pairs, pool, bodies, c)


@kernel
def activate(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> bool:
    """Begin the contact of pair `c`: it becomes ACTIVE and is counted and logged.

    A pair that was dormant within the same contact only becomes ACTIVE again. Returns false if the run has to stop
    before this contact.
    """
    pair = pool[pairs[c].slot]
    if pair.going_on == 1:  # dormant for a while within the same contact
        pair.mode = ACTIVE
        return True
    if is_awaited(run, pairs, c):
        return False
    if not count_isolated(run, pairs, pool, c, CONTACT):
        return False
    if pair.mode != DORMANT:  # the contact of a dormant pair has begun at its touch
        begin_contact(run, pairs, pool, bodies, c)
    # RESIDUAL: the event has located φ = 0, unless the velocity of its wall jumped
    pair.exact = 1 if pair.mode == RESIDUAL and not ((DRIVEN or HEATED) and has_jumped(pair)) else 0
    pair.mode, pair.going_on = ACTIVE, 1
    pairs[c].contacts += 1
    run.events += 1
    run.contacts += 1
    return True


@kernel
def has_jumped(pair: Any) -> bool:
    """Return whether the force of a residual pair is positive beyond rounding error.

    This happens only if the velocity of a wall or ball of the pair has jumped.
    """
    elastic: float = pair.k * power(pair.xi, pair.s)
    return bool(elastic + pair.gamma * pair.eta > ZERO_FORCE_SHARE * elastic)


@kernel
def mark_struck(run: Any, pairs: Any, pool: Any, c: int) -> bool:
    """Mark pair `c` at a thermal wall as STRUCK: its ball is about to be thrown back.

    A ball that already moves away is ignored. Returns false if the run has to stop before this contact.
    """
    pair = pool[pairs[c].slot]
    pair.xi = 0.0
    if pair.eta < 0.0:
        return True
    if is_awaited(run, pairs, c) or not count_isolated(run, pairs, pool, c, CONTACT):
        return False
    pair.mode = STRUCK
    pairs[c].contacts += 1
    run.events += 1
    run.contacts += 1
    return True


@kernel
def count_isolated(run: Any, pairs: Any, pool: Any, c: int, count: int) -> bool:
    """Count contacts of pair `c` as isolated if no neighbouring pair overlaps.

    The overlap or force of pair `c` begins now, and `count` is the number of contacts to count (0 or 1). If a neighbour
    overlaps, none of the contacts during the overlaps of these two pairs counts as isolated. Contacts that were counted
    before are subtracted. Returns false if the run has to stop because two neighbouring pairs overlap.
    """
    is_alone = True
    below, above = neighbour_pairs(pairs, c)
    for f in (below, above):
        if 0 <= f < pair_count(pairs) and is_overlapping(pairs[f], pool, run):
            is_alone = False
            # earlier contacts of the neighbour are disturbed now; `NOT_ISOLATED` is negative and subtracts nothing

            run.isolated -= max(0, pairs[f].isolated)
            pairs[f].isolated = NOT_ISOLATED
            if run.first < 0:
                run.first = f if f == below else c  # the lower of the two pairs
                run.disturbed = run.t
    if not is_alone and run.disturbing == STOP:
        return False
    if not is_alone:
        run.isolated -= max(0, pairs[c].isolated)
        pairs[c].isolated = NOT_ISOLATED
    elif pairs[c].isolated != NOT_ISOLATED:
        pairs[c].isolated += count
        run.isolated += count
    return True


@kernel
def is_overlapping(pair: Any, pool: Any, run: Any) -> bool:
    """Return whether a pair overlaps, or touches at rest, at the current event.

    The time of the event is `run.t` + `run.tail`. The pair can be in an island or outside.
    """
    if pair.slot >= 0:
        return bool(pool[pair.slot].mode != OPEN)
    return bool(pair.mode == RESIDUAL or (pair.lasts > 0.0 and time_since(pair, run.t, run.tail) < 0.0))


@kernel
def activate_pressed(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, hi: int) -> bool:
    """Activate the dormant linear pairs of an island that the series presses together.

    The island consists of the pairs lo … hi-1. Returns false if the run has to stop before one of these contacts.
    """
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if (
            pair.mode == DORMANT
            and pair.kind == LINEAR
            and direction(pair.x) > 0.0
            and not activate(run, pairs, pool, bodies, wrapped_number(pairs, c))
        ):
            return False
    return True


@kernel
def needs_series(pair: Any) -> bool:
    """Return whether the motion of a pair has to be integrated by a power series.

    The alternative is free flight in closed form, until a closed-form event. It applies to open pairs, to clipped pairs
    with φ = kξ + γη, and to clipped pairs that are certain to separate. For s ≥ 1 and a non-negative pull, φ = k ξ^s +
    γη is convex in free flight. If it is negative now and at ξ = 0, it is negative in between. At walls that are driven
    or thermal, and for pendula, every pair that is not open needs a series.
    """
    if HUNG or (DRIVEN and pair.wall > 0) or (HEATED and pair.wall < 0):
        return bool(pair.mode != OPEN)
    if pair.mode != RESIDUAL or pair.s == 1.0:
        return bool(pair.mode == ACTIVE or pair.mode == DORMANT)
    may_separate = pair.s > 1.0 and pair.pull >= 0.0 and pair.eta < 0.0
    # η² > 2·pull·ξ: fast enough to reach ξ = 0 against the pull
    return bool(not (may_separate and pair.eta * pair.eta > 2.0 * pair.pull * pair.xi))


@kernel
def make_dormant(run: Any, pairs: Any, pool: Any, bodies: Any) -> int:
    """Make all pairs of the current event dormant that touch at rest and are pressed.

    A pair is pressed together by gravity or by the force of a neighbouring pair. A pair at a driven wall is included if
    it has no pull, because the wall can press it later. All forces are repulsive, so the contact of such a pair begins
    immediately, unless gravity separates the balls. Returns NONE, SOME, or AWAITED if the run has to stop before one of
    these contacts.
    """
    result, lo, hi = NO_CHANGE, run.lo, run.hi
    closed = RING and is_closed(pairs, lo, hi)
    # upwards and downwards, because a pair that becomes dormant can press the next one in either direction
    for sweep in range(2):
        for i in range(hi - lo):
            c = lo + i if sweep == 0 else hi - 1 - i
            pair = pool[pairs[c].slot]
            if HEATED and pair.wall < 0:
                continue
            if (pair.mode == OPEN and pair.xi == 0.0 and pair.eta == 0.0) and (
                pair.pull > 0.0
                # a driven wall can press later, so the series decides (`correct_modes`)
                or (DRIVEN and pair.pull == 0.0 and pair.wall > 0)
                or ((c > lo or closed) and needs_series(pool[pairs[wrapped_number(pairs, c - 1)].slot]))
                or ((c + 1 < hi or closed) and needs_series(pool[pairs[wrapped_number(pairs, c + 1)].slot]))
            ):
                c = wrapped_number(pairs, c)
                # a pair that gravity separates can open again without a contact (`correct_modes`)
                if is_awaited(run, pairs, c) and pair.pull >= 0.0:
                    return STOP_AWAITED
                begin_contact(run, pairs, pool, bodies, c)
                pair.mode, result = DORMANT, MODE_CHANGED
    return result


@kernel
def correct_modes(pairs: Any, pool: Any, lo: int, hi: int) -> bool:
    """Make the modes of pairs that touch at rest consistent with the computed series.

    Pairs lo … hi-1 are examined. Pairs that the series separates become OPEN, and pairs that it presses together become
    DORMANT. Returns whether any mode has changed.
    """
    changed = False
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if HEATED and pair.wall < 0:
            continue
        if pair.kind != GENERAL and pair.xi == 0.0 and pair.eta == 0.0 and (pair.mode == DORMANT or pair.mode == OPEN):
            sign = direction(pair.x)
            if sign != 0.0 and (sign > 0.0) == (pair.mode == OPEN):
                pair.mode = DORMANT if pair.mode == OPEN else OPEN
                changed = True
    return changed


@kernel
def stays_in_contact(pair: Any, speed: float) -> bool:
    """Return whether an active pair separates only because of rounding error.

    This is the case under a nonlinear law if gravity presses the balls together and their energy at ξ = 0 is rounding
    error. It is also the case under a general law if the pair was dormant before and its rate is only noise. `speed` is
    the typical speed of its island in m/s.
    """
    if pair.mode != ACTIVE:
        return False
    if pair.kind == GENERAL and pair.wake > 0.0 and is_rate_noise(pair):
        return True
    pressed = pair.kind != LINEAR and pair.pull > 0.0
    # the square of the rate has an error of about noise times speed
    return bool(pressed and pair.eta * pair.eta <= DRIFT_NOISE_FACTOR * pair.noise * max(speed, speed_of_weight(pair)))


@kernel
def touches_by_rounding(pairs: Any, pool: Any, c: int, speed: float) -> bool:
    """Return whether a pair touches only by rounding error.

    This can only hold for a negative closing acceleration. The two bodies then accelerate away from each other, and the
    energy of their approach is rounding error. `speed` is the typical speed in m/s of the island of pair `c`. The
    result is False for a pair that is alone in its island, because it cannot affect other pairs.
    """
    pair, lo = pool[pairs[c].slot], pairs[c].first
    hi = pairs[lo].hi
    for i in range(lo, hi):
        speed = max(speed, speed_of_weight(pool[pairs[i].slot]))
    return bool(pair.pull < 0.0 and hi - lo > 1 and pair.eta * pair.eta <= DRIFT_NOISE_FACTOR * pair.noise * speed)


@kernel
def is_rate_noise(pair: Any) -> bool:
    """Return whether the absolute rate of a pair does not exceed its noise."""
    return bool(abs(pair.eta) <= DRIFT_NOISE_FACTOR * pair.noise)


@kernel
def speed_of_weight(pair: Any) -> float:
    """Return the speed in m/s that a pair gains over its static overlap by its pull."""
    pull = abs(pair.pull)
    return math.sqrt(2.0 * pull * power(pull / (pair.k * pair.inverse), 1.0 / pair.p))


@kernel
def cancel_rate(pairs: Any, pool: Any, bodies: Any, c: int) -> None:
    """Set the rate of pair `c` to zero by an impulse between its two balls.

    The rates of the neighbouring pairs in the same island change accordingly.
    """
    pair, lo, hi = pool[pairs[c].slot], pairs[c].first, pairs[pairs[c].first].hi
    impulse, closed = pair.eta / pair.inverse, is_closed(pairs, lo, hi)
    pair.eta = 0.0
    bodies[c].v -= pair.lower * impulse
    bodies[wrapped_number(pairs, c + 1)].v += pair.upper * impulse
    if RING and c < lo:
        c += pair_count(pairs)
    if c > lo or closed:
        pool[pairs[wrapped_number(pairs, c - 1)].slot].eta += pair.lower * impulse
    if c + 1 < hi or closed:
        pool[pairs[wrapped_number(pairs, c + 1)].slot].eta += pair.upper * impulse


@kernel
def is_awaited(run: Any, pairs: Any, c: int) -> bool:
    """Return whether the run has to stop before the next contact of pair `c`.

    This is the stop condition `granular.until.Contact`: the contact number `until_nth` of pair `until_pair`.
    """
    return bool(c == run.until_pair and pairs[c].contacts + 1 == run.until_nth)

