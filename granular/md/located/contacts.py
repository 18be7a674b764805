"""The log: what is kept of a contact from its begin to its end."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular._roots import first_up_crossing
from granular.md.located.clock import elapsed, since, tick
from granular.md.located.piece import integral, shift, slope, value
from granular.md.located.records import ACTIVE, DORMANT, ORDER


@kernel
def begin_contact(pairs: Any, bodies: Any, c: int, block: Any) -> None:
    """Note the time and the velocities at which the contact of pair `c` begins (or might: it is dormant)."""
    pair = pairs[c]
    pair.begin, pair.lasted, pair.impulse, pair.force_max, pair.xi_max = block.t, 0.0, 0.0, 0.0, pair.xi
    pair.lower_in = velocity_now(bodies[c], block)
    pair.upper_in = velocity_now(bodies[c + 1], block)


@kernel
def end_contact(run: Any, pairs: Any, bodies: Any, log: Any, c: int, block: Any) -> None:
    """Write the log row of the contact of pair `c` that ends now."""
    pair = pairs[c]
    pair.begun = 0
    if run.log == 0:
        return
    row = log[run.rows]
    run.rows += 1
    row.pair, row.t_begin, row.t_end, row.duration = c, pair.begin, block.t, pair.lasted
    row.lower_in, row.upper_in = pair.lower_in, pair.upper_in
    row.lower_out, row.upper_out = velocity_now(bodies[c], block), velocity_now(bodies[c + 1], block)
    row.xi_max, row.force_max, row.impulse = pair.xi_max, pair.force_max, pair.impulse


@kernel
def velocity_now(body: Any, block: Any) -> float:
    """Return the velocity of a body at the time of a block."""
    v: float = body.v - body.fall * since(body, block.t, block.tail)
    return v


@kernel
def follow(pairs: Any, bodies: Any, lo: int, hi: int, tau: float, work: Any, with_peaks: bool) -> None:
    """Add the stretch [0, τ] of the piece of block lo … hi-1 to its contacts, and its impulses to its bodies."""
    block = pairs[lo]
    h, q = block.h, block.clock
    dt, scale, below = elapsed(h, q, tau), elapsed(h, q, 1.0), 0.0
    for c in range(lo, hi):
        pair, impulse = pairs[c], 0.0
        if pair.mode == ACTIVE:
            impulse = scale * integral(pair.f, q, tau)
            pair.impulse += impulse
            if (c > lo and pairs[c - 1].mode == ACTIVE) or (c + 1 < hi and pairs[c + 1].mode == ACTIVE):
                pair.shared += impulse
            if with_peaks:
                peaks(pair, tau, work)
        if pair.mode == ACTIVE or pair.mode == DORMANT:
            pair.lasted += dt
        push(bodies[c], block, dt, below - impulse)
        below = impulse
    push(bodies[hi], block, dt, below)


@kernel
def push(body: Any, block: Any, dt: float, impulse: float) -> None:
    """Advance the velocity of a body to `dt` after the block's time: free fall, and an impulse on the way."""
    body.v += body.inverse_mass * impulse - body.fall * (since(body, block.t, block.tail) + dt)
    body.t, body.tail = block.t, block.tail
    tick(body, dt)


@kernel
def peaks(pair: Any, tau: float, work: Any) -> None:
    """Raise the largest overlap and force to those of the piece; its g is scratch, for φ has done its duty."""
    for j in range(ORDER + 1):
        pair.g[j] = pair.e[j]
    pair.xi_max = max(pair.xi_max, highest(pair.x, pair.g, tau, work))
    slope(pair.f, pair.g)
    pair.force_max = max(pair.force_max, highest(pair.f, pair.g, tau, work))


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
