"""Isolated contacts: one event each, as in event-driven simulation, but with a delay and a displacement.

A contact that begins now is solved at once by its map (`maps`), if it is certain that no neighbour touches before it is
over. That is certified by one subtraction for each neighbouring gap, its flank: the contact force pushes the body they
share towards the flank, and a contact at the flank's far end pushes that body towards it too, so the flank is concave
until both are over, at T; it was positive, and if it is at T, it is in between. A flank below a ceiling is convex by
P = g: from a to b in a time L it stays positive if (√a + √b)² > P L²/2.

What the pair and its flanks keep from then on are their asymptotes: the motion after the contact, with a clock that may
lie ahead. `lasts` tells: positive, it is the length of the contact that ends (ξ = 0) at the pair's clock; negative, the
clock may lie ahead because a neighbour is in contact. With ξ and η inside the contact, and ξ_v and η_v of the pair's
asymptote, a flank is smaller by share·(ξ_v - ξ) than its own asymptote says.
"""

from __future__ import annotations

import math
from typing import Any

from granular._flight import gap_after, rate_at_contact
from granular._kernels import kernel
from granular._tournament import leaf, replay
from granular.md.located.alone import enter, live
from granular.md.located.contacts import is_awaited, velocity_now
from granular.md.located.maps import encounter, peaks
from granular.md.located.pieces import DRIFT, fly, predict, since, tau_at, tick, value
from granular.md.located.plan import leave
from granular.md.located.system import ACTIVE, BEGIN, IGNORE, OPEN, RESIDUAL
from granular.md.located.tables import FULL, solved_alone, table_of, tabled, tabled_peaks

ULP = 2.0**-52
MET, OTHERWISE, CRAMPED = range(3)
"""What `meet` comes to."""


@kernel
def in_contact(pair: Any, t: float, tail: float) -> bool:
    """Return whether a pair outside the islands is in a contact, or its run-off, at the time t + tail."""
    return bool(pair.slot < 0 and pair.lasts > 0.0 and since(pair, t, tail) < 0.0)


@kernel
def meet(s: Any, c: int, laws: Any) -> int:
    """Let the contact of pair `c`, which is due, happen at once if it is known and certain to be isolated.

    Returns whether it did: MET, OTHERWISE, or CRAMPED if there is no room for a table.
    """
    run, pairs, pair, m = s.run[0], s.pairs, s.pairs[c], s.meeting[0]
    if pair.mode != OPEN or pair.what != BEGIN or is_awaited(run, pairs, c):
        return OTHERWISE
    m.v = -rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull)
    if not m.v > DRIFT * pair.noise:
        return OTHERWISE
    if foresee(s, c, laws) == FULL:
        return CRAMPED
    if not m.t1 > 0.0:
        return OTHERWISE
    lower, upper = s.bodies[c].inverse_mass, s.bodies[c + 1].inverse_mass
    kick = (m.v + pair.pull * m.t2 + m.v2) / (lower + upper)
    m.velocity[0] = coasting(s.bodies[c], pair, pair.wait + m.t2) - lower * kick
    m.velocity[1] = coasting(s.bodies[c + 1], pair, pair.wait + m.t2) + upper * kick
    m.isolated = 1
    for side in range(2):
        if not certify(s, c, side):
            return OTHERWISE
    commit(s, c)
    return MET


@kernel
def foresee(s: Any, c: int, laws: Any) -> int:
    """Note all of a contact of pair `c` in the `meeting`; t1 is nan if it is not known. FULL: no room for a table."""
    run, pair, m = s.run[0], s.pairs[c], s.meeting[0]
    law, inverse, place = s.kinds[pair.kind_of], s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, -1
    m.t1, m.t2, m.v1, m.v2 = encounter(law, inverse, pair.pull, m.v)
    if m.t1 > 0.0:
        if run.log == 2:
            m.xi_max, m.force_max = peaks(law, inverse, pair.pull, m.v, m.t1)
        return place
    if pair.map >= 0:
        place = table_of(s, c, m.v, laws)
    if place >= 0:
        run.error += s.tables[place].error
        m.t1, m.t2, m.v1, m.v2 = tabled(s.tables[place], law.elastic, m.v)
        if run.log == 2:
            m.xi_max, m.force_max = tabled_peaks(s.tables[place], m.v)
    elif place != FULL and run.disturbing == IGNORE:
        m.t1, m.t2, m.v1, m.v2, m.xi_max, m.force_max = solved_alone(s, c, m.v, laws)
    return place


@kernel
def certify(s: Any, c: int, side: int) -> bool:
    """Return whether the flank below (0) or above (1) pair `c` is certain to stay open; note its asymptote."""
    pair, m, f, beyond = s.pairs[c], s.meeting[0], c - 1 + 2 * side, c - 2 + 4 * side
    if not 0 <= f < len(s.pairs):
        return True
    flank, over = s.pairs[f], pair.wait + m.t2
    start = since(flank, pair.t, pair.tail) + pair.wait
    if flank.slot >= 0 or flank.mode != OPEN or (flank.lasts > 0.0 and start < 0.0):
        return False
    share = s.bodies[c + side].inverse_mass / (s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass)
    far = coasting(s.bodies[c - 1 + 3 * side], pair, over)
    rate, busy = (far - m.velocity[1] if side else m.velocity[0] - far), 0.0
    if 0 <= beyond < len(s.pairs):
        busy = ahead(s.pairs[beyond], pair, over)
    gap = gap_after(-flank.xi, -flank.eta, flank.pull, start + m.t2) - share * m.t2 * (m.v + 0.5 * pair.pull * m.t2)
    if busy > 0.0:
        gap = gap_after(gap, rate, flank.pull, busy)
    stays = gap > 0.0
    if flank.pull < 0.0 and stays:
        root = math.sqrt(max(0.0, gap_after(-flank.xi, -flank.eta, flank.pull, start))) + math.sqrt(gap)
        stays = root * root > -0.5 * flank.pull * m.t2 * m.t2
    m.gap[side], m.rate[side], m.busy[side] = max(0.0, gap), rate, busy
    if not stays:
        m.isolated = 0
    return bool(stays or s.run[0].disturbing == IGNORE)


@kernel
def commit(s: Any, c: int) -> None:
    """Let the contact of pair `c` that is noted in the `meeting` happen."""
    run, pairs, pair, m = s.run[0], s.pairs, s.pairs[c], s.meeting[0]
    tick(pair, pair.wait)
    run.t, run.tail = pair.t, pair.tail
    if run.log > 0:
        write_row(s, c)
    tick(pair, m.t2)
    pair.xi, pair.eta, pair.lasts, pair.speed, pair.exact, pair.alone = 0.0, -m.v2, m.t2, m.v, 0, 1
    pair.noise += ULP * m.v
    for side in range(2):
        body = s.bodies[c + side]
        body.v, body.t, body.tail = m.velocity[side], pair.t, pair.tail
    pair.count += 1
    run.steps += 1
    run.events += 1
    run.begun += 1
    run.isolated += m.isolated
    if m.isolated == 0 and run.first < 0:
        below = c > 0 and m.gap[0] == 0.0
        run.first, run.disturbed = (c - 1 if below else c), run.t + m.t2
    predict(pair, s.kinds[pair.kind_of])
    leaf(s.queue, c).due = pair.due
    for side in range(2):
        f = c - 1 + 2 * side
        if 0 <= f < len(pairs):
            deflect(pairs[f], pair, m, side)
            predict(pairs[f], s.kinds[pairs[f].kind_of])
            leaf(s.queue, f).due = pairs[f].due
    replay(s.queue, max(0, c - 1), min(c + 1, len(pairs) - 1))


@kernel
def write_row(s: Any, c: int) -> None:
    """Write the log row of the contact of pair `c` at its onset; it is void if the contact is taken up by an island."""
    run, pair, m, one, two = s.run[0], s.pairs[c], s.meeting[0], s.bodies[c], s.bodies[c + 1]
    row, pair.row = s.log[run.rows], run.rows
    run.rows += 1
    impulse = (m.v + pair.pull * m.t1 + m.v1) / (one.inverse_mass + two.inverse_mass)
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.t, pair.t + (m.t1 + pair.tail), m.t1
    row.lower_in, row.upper_in = velocity_now(one, run), velocity_now(two, run)
    row.lower_out = row.lower_in - one.fall * m.t1 - one.inverse_mass * impulse
    row.upper_out = row.upper_in - two.fall * m.t1 + two.inverse_mass * impulse
    row.xi_max, row.force_max, row.impulse = m.xi_max, m.force_max, impulse


@kernel
def coasting(body: Any, pair: Any, dt: float) -> float:
    """Return the velocity that a body would have a time `dt` after the clock of `pair` without forces."""
    v: float = body.v - body.fall * (since(body, pair.t, pair.tail) + dt)
    return v


@kernel
def ahead(beyond: Any, pair: Any, dt: float) -> float:
    """Return how long the pair beyond a flank is still in contact a time `dt` after the clock of `pair`."""
    left: float = -(since(beyond, pair.t, pair.tail) + dt)
    return left if beyond.lasts > 0.0 and left > 0.0 and beyond.slot < 0 else 0.0


@kernel
def deflect(flank: Any, pair: Any, m: Any, side: int) -> None:
    """Give a flank its asymptote, from the end of all contacts beside it; `pair` has its own already."""
    busy = m.busy[side]
    flank.t, flank.tail, flank.xi, flank.eta = pair.t, pair.tail, -m.gap[side], flank.pull * busy - m.rate[side]
    flank.lasts, flank.exact = -1.0, 0
    flank.noise += ULP * m.v
    if busy > 0.0:
        tick(flank, busy)


@kernel
def relive(s: Any, c: int, t: float, tail: float, laws: Any) -> float:
    """Take a place in the pool for pair `c`, in contact at the time t + tail, and bring it there from its onset.

    The pair is a block of its own; if its force is over, it is in its run-off. Returns the place τ on its last piece.
    """
    pair = s.pairs[c]
    left = pair.lasts + since(pair, t, tail)
    member = enter(s, c, pair.speed)
    tick(member, -pair.lasts)
    member.t_begin = member.t
    tau: float = live(s, c, left, laws)[1]
    return tau


@kernel
def expose(s: Any, c: int, laws: Any) -> None:
    """Let pair `c`, in contact, be a member of the event under way, for something may disturb it from now on."""
    run, pair, bodies = s.run[0], s.pairs[c], s.bodies
    back = since(pair, run.t, run.tail)
    xi, eta = -gap_after(-pair.xi, -pair.eta, pair.pull, back), pair.eta + pair.pull * back
    relive(s, c, run.t, run.tail, laws)
    member = s.pool[pair.slot]
    if member.mode != ACTIVE:  # in its run-off, it is what its asymptote says
        member.xi, member.eta, member.begun = xi if member.mode == RESIDUAL else min(0.0, xi), eta, 0
        member.h, member.tau = 0.0, 0.0
        return
    low, high = member.lower / member.inverse, member.upper / member.inverse
    xi -= member.xi
    eta -= member.eta
    if run.log > 0 and pair.row >= 0:
        row = s.log[pair.row]
        member.lower_in, member.upper_in, row.pair = row.lower_in, row.upper_in, -1
    for side in range(2):
        body, f, share = bodies[c + side], c - 1 + 2 * side, high if side else low
        body.v += -body.fall * since(body, run.t, run.tail) + (share if side else -share) * eta
        body.t, body.tail = run.t, run.tail
        if 0 <= f < len(s.pairs):
            straighten(s, f, share * xi, share * eta)


@kernel
def straighten(s: Any, f: int, xi: float, eta: float) -> None:
    """Let a flank be as it is at the time of the event under way, and not as its asymptote says."""
    run, flank = s.run[0], s.pairs[f]
    if flank.slot >= 0:
        s.pool[flank.slot].xi += xi
        s.pool[flank.slot].eta += eta
        return
    fly(flank, since(flank, run.t, run.tail))
    flank.xi += xi
    flank.eta += eta


@kernel
def look(s: Any, t: float, xi: Any, eta: Any, force: Any, laws: Any) -> None:
    """Write overlap, rate and force of every pair at time `t`, which lies within the current pieces."""
    for c in range(len(s.pairs)):
        pair = s.pairs[c]
        if pair.slot < 0:
            dt = since(pair, t, 0.0)
            dt = max(0.0, dt) if pair.lasts == 0.0 else dt
            xi[c], eta[c], force[c] = -gap_after(-pair.xi, -pair.eta, pair.pull, dt), pair.eta + pair.pull * dt, 0.0
        else:
            member = s.pool[pair.slot]
            tau = tau_at(s.pool[s.pairs[pair.first].slot], t, 0.0)
            xi[c], eta[c] = value(member.x, tau), value(member.e, tau)
            force[c] = max(0.0, value(member.f, tau)) if member.mode == ACTIVE else 0.0
    for c in range(len(s.pairs)):
        if in_contact(s.pairs[c], t, 0.0):
            look_inside(s, c, t, xi, eta, force, laws)


@kernel
def look_inside(s: Any, c: int, t: float, xi: Any, eta: Any, force: Any, laws: Any) -> None:
    """Write what pair `c`, in a contact solved at once, and its flanks are at time `t`, and leave no trace of it."""
    run, pair = s.run[0], s.pairs[c]
    due, steps, error = pair.due, run.steps, run.error
    tau, member = relive(s, c, t, 0.0, laws), s.pool[pair.slot]
    deeper, faster = xi[c] - member.xi, eta[c] - member.eta
    xi[c], eta[c] = member.xi, member.eta
    force[c] = max(0.0, value(member.f, tau)) if member.mode == ACTIVE else 0.0
    if c > 0:
        xi[c - 1] += member.lower / member.inverse * deeper
        eta[c - 1] += member.lower / member.inverse * faster
    if c + 1 < len(s.pairs):
        xi[c + 1] += member.upper / member.inverse * deeper
        eta[c + 1] += member.upper / member.inverse * faster
    leave(run, s.pairs, s.pool, c)
    pair.due, run.steps, run.error = due, steps, error
