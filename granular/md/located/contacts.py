"""The log: what is kept of a contact from its begin to its end."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular._roots import first_up_crossing
from granular.md.located.clock import elapsed, since, tick
from granular.md.located.piece import integral, shift, slope, value
from granular.md.located.powers import power
from granular.md.located.records import ACTIVE, DAMPED, DORMANT, ELASTIC, ORDER


@kernel
def begin_contact(run: Any, pairs: Any, pool: Any, bodies: Any, c: int) -> None:
    """Note the time and the velocities at which the contact of pair `c` begins (or might: it is dormant)."""
    pair = pool[pairs[c].slot]
    pair.begin, pair.lasted, pair.impulse, pair.force_max, pair.xi_max = run.t, 0.0, 0.0, 0.0, pair.xi
    pair.lower_in = velocity_now(bodies[c], run)
    pair.upper_in = velocity_now(bodies[c + 1], run)


@kernel
def end_contact(run: Any, pairs: Any, pool: Any, bodies: Any, log: Any, c: int) -> None:
    """Write the log row of the contact of pair `c` that ends now."""
    pair = pool[pairs[c].slot]
    pair.begun = 0
    if run.log == 0:
        return
    row = log[run.rows]
    run.rows += 1
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.begin, run.t, pair.lasted
    row.lower_in, row.upper_in = pair.lower_in, pair.upper_in
    row.lower_out, row.upper_out = velocity_now(bodies[c], run), velocity_now(bodies[c + 1], run)
    row.xi_max, row.force_max, row.impulse = pair.xi_max, pair.force_max, max(0.0, pair.impulse)


@kernel
def velocity_now(body: Any, run: Any) -> float:
    """Return the velocity of a body at the time of the event under way."""
    v: float = body.v - body.fall * since(body, run.t, run.tail)
    return v


@kernel
def follow(run: Any, pairs: Any, pool: Any, bodies: Any, work: Any, lo: int, tau: float) -> None:
    """Add the stretch [0, τ] of the piece of the island that starts with `lo` to its contacts and its bodies."""
    block, hi = pool[pairs[lo].slot], pairs[lo].hi
    h, q = block.h, block.clock
    dt, scale, below = elapsed(h, q, tau), elapsed(h, q, 1.0), 0.0
    for c in range(lo, hi):
        pair, impulse = pool[pairs[c].slot], 0.0
        if pair.mode == ACTIVE:
            impulse = scale * integral(pair.f, q, tau)
            pair.impulse += impulse
            if (c > lo and acts(pairs, pool, c - 1)) or (c + 1 < hi and acts(pairs, pool, c + 1)):
                pairs[c].shared += impulse
            if run.log == 2:
                peaks(pair, tau, work)
        if pair.mode == ACTIVE or pair.mode == DORMANT:
            pair.lasted += dt
        push(bodies[c], block, dt, below - impulse)
        below = impulse
    push(bodies[hi], block, dt, below)


@kernel
def acts(pairs: Any, pool: Any, c: int) -> bool:
    """Return whether a pair of an island exerts a force."""
    return bool(pool[pairs[c].slot].mode == ACTIVE)


@kernel
def push(body: Any, block: Any, dt: float, impulse: float) -> None:
    """Advance the velocity of a body to `dt` after the block's time: free fall, and an impulse on the way."""
    body.v += body.inverse_mass * impulse - body.fall * (since(body, block.t, block.tail) + dt)
    body.t, body.tail = block.t, block.tail
    tick(body, dt)


@kernel
def peaks(pair: Any, tau: float, work: Any) -> None:
    """Raise the largest overlap and force to those of the piece; its g is scratch, for φ has done its duty.

    A force that does not depend on the rate is largest where the overlap is, and the law says it better than a series
    far below the scale of its island. In a piece so short that a force of ξ^(1/4) hardly counts no series need hold:
    no more than the law allows.
    """
    for j in range(ORDER + 1):
        pair.g[j] = pair.e[j]
    deepest = highest(pair.x, pair.g, tau, work)
    pair.xi_max = max(pair.xi_max, deepest)
    xi = max(0.0, deepest)
    if pair.kind == ELASTIC:
        pair.force_max = max(pair.force_max, pair.k * power(xi, pair.p))
        return
    slope(pair.f, pair.g)
    force = highest(pair.f, pair.g, tau, work)
    if pair.kind == DAMPED:
        rate = max(abs(pair.e[0]), abs(value(pair.e, tau)))
        force = min(force, 2.0 * (pair.k * power(xi, pair.p) + pair.gamma * power(xi, pair.d) * rate))
    pair.force_max = max(pair.force_max, force)


@kernel
def highest(row: Any, rate: Any, tau: float, work: Any) -> float:
    """Return the largest value of a row on [0, τ]; `rate`, of the sign of its slope, is used up."""
    at, best = 0.0, max(float(row[0]), value(row, tau))
    way = -1.0 if rate[0] > 0.0 else 1.0
    for _ in range(ORDER):
        step = first_up_crossing(rate, tau - at, work, way)
        if not at + step < tau:
            break
        at += step
        if way < 0.0:
            best = max(best, value(row, at))
        shift(rate, step)
        rate[0], way = 0.0, -way
    return best
