"""Pendula: the kernels that take the place of those of `motion` and `collision` where balls hang and swing.
May be skipped: rarer, balls on strings.

Gap and rate of a pair at its time are the state, as in a closer look at free balls: between collisions they turn as
``gap'' = Ω² (rest - gap)``, so rates have all their digits however fast all swing together, and no collapse has to be
judged. One that would be infinite is followed until its squares are no numbers (1e-154 m/s), and what touches then goes
on without a rate, together where the pendula touch at rest. Bodies know only how they swing, for the rows of the log:
their velocity is ``u cos Ωt - sway sin Ωt``, and u and sway change at impacts only.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from granular._check import Array
from granular._flight import hung, hung_after, hung_rate_at_contact
from granular._kernels import kernel, rare
from granular._records import Record, Records, column
from granular.edmd.collision import remedied, total
from granular.edmd.motion import Walls, add, impulse, reimpose
from granular.edmd.physics import Restitution

OF_PAIR = [("rate", float), ("rest", float), ("omega", float)]
"""Fields of a pair: its rate (m/s) at the time `at`, its gap where both rest (m), and Ω (rad/s)."""
OF_BODY = [("sway", float), ("omega", float)]
"""Fields of a body: Ω times its displacement when it was time 0, had there been no collision since (m/s), and Ω."""


@kernel
def velocities(lower: Record, upper: Record, g: float, now: float) -> tuple[float, float]:
    """Return the velocities of the bodies of a pair (m/s) at time `now`."""
    c, s = math.cos(lower.omega * now), math.sin(lower.omega * now)
    return lower.u * c - lower.sway * s, upper.u * c - upper.sway * s


@kernel
def predicted(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair collides if nothing happens before, inf if it never does."""
    if pair.gap == 0.0 and pair.rate < 0.0:
        return pair.at  # type: ignore[no-any-return]
    return pair.at + hung(pair.gap, pair.rate, pair.omega, pair.rest)  # type: ignore[no-any-return]


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch at time `now`: they do, or are to collide now."""
    if predicted(pair, lower, upper, walls) <= now:
        return True
    return hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)[0] <= 0.0


@kernel
def carry(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> int:
    """Move the gap and the rate of a pair to time `now`; return 1 if the gap was clamped at 0."""
    d, pair.rate = hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)
    pair.at = now
    pair.gap = d if d > 0.0 else 0.0
    return 1 if d < 0.0 else 0


@kernel
def rate_at(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> float:
    """Return the rate of a pair (m/s) at time `now`."""
    return hung_after(pair.gap, pair.rate, pair.omega, pair.rest, now - pair.at)[1]


@kernel
def kick(body: Record, change: float, now: float) -> None:
    """Change the velocity of a body (m/s) at time `now`."""
    body.u += change * math.cos(body.omega * now)
    body.sway -= change * math.sin(body.omega * now)


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after."""
    pair, lower, upper = pairs[c], bodies[c], bodies[c + 1]
    w = hung_rate_at_contact(pair.gap, pair.rate, pair.omega, pair.rest)
    e = pair.eps if rule is None else rule(c, -w)
    if run.tc > 0.0 or run.elastic_below > 0.0:
        e = remedied(run, pairs, c, -w, e, now)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, 0.0, now)
    if e < 1.0 and -w < run.merge_below:
        start, end, exchanged = absorb(run, pairs, bodies, c, now, w)
    else:
        start, end = max(c - 1, 0), min(c + 1, len(pairs) - 1)
        up = pair.low * ((1.0 + e) * w)  # the larger change is what the smaller leaves, or energy would drift
        down = pair.high * ((1.0 + e) * w)
        if pair.low <= 0.5:
            down = (1.0 + e) * w - up
        else:
            up = (1.0 + e) * w - down
        if c > 0:
            run.clamps += carry(pairs[start], bodies[start], lower, now, walls)
            pairs[start].rate += up
        if c + 1 < len(pairs):
            run.clamps += carry(pairs[end], upper, bodies[end + 1], now, walls)
            pairs[end].rate += down
        pair.gap, pair.at, pair.rate = 0.0, now, -e * w
        kick(lower, up, now)
        kick(upper, -down, now)
        exchanged = impulse(lower, upper, (1.0 + e) * w)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, 0.0, now)
        row.impulse = exchanged
    pair.hits += 1
    pair.last = now
    return start, end, pair.rate


@rare
@kernel
def absorb(run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that touch them at rest, go on with one velocity.

    They stay together where pendula touch at rest, and come apart at once where they do not. Returns the first and the
    last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    n, b, e = len(pairs), c, c + 1
    while b > 0 and bodies[b - 1].mass < math.inf and stands(run, pairs[b - 1], now):
        b -= 1
    while e < n and bodies[e + 1].mass < math.inf and stands(run, pairs[e], now):
        e += 1
    lower, upper = total(bodies, b, c), total(bodies, c + 1, e)
    part = 1.0 if upper == math.inf else upper / (lower + upper)
    up, down = part * w, w - part * w
    if b > 0:
        pairs[b - 1].rate += up
    if e < n:
        pairs[e].rate += down
    for i in range(b, e + 1):
        kick(bodies[i], (up if i <= c else -down) if bodies[i].mass < math.inf else 0.0, now)
    pair = pairs[c]
    pair.gap, pair.at, pair.rate = 0.0, now, 0.0
    run.merged += 1
    return max(b - 1, 0), min(e, n - 1), -upper * down if lower == math.inf else -lower * up


@rare
@kernel
def stands(run: Record, pair: Record, now: float) -> bool:
    """Return whether the bodies of a pair touch without a rate at time `now`, to which it is carried."""
    run.clamps += carry(pair, pair, pair, now, None)
    return pair.gap == 0.0 and pair.rate == 0.0  # type: ignore[no-any-return]


@kernel
def rebase(run: Record, pairs: Records, bodies: Records, shift: float, walls: Walls) -> None:
    """Move all gaps to time `shift`, the new zero of time.

    Between two walls the sum of the gaps is fixed: the largest gets what rounding has taken from it, and of the rates.
    """
    total, low = 0.0, 0.0
    for c in range(len(pairs)):
        pair = pairs[c]
        run.clamps += carry(pair, bodies[c], bodies[c + 1], shift, walls)
        pair.at = 0.0
        pair.last -= shift
        total, low = add(total, low, pair.rate)
    if run.closed > 0.0:
        pairs[reimpose(run, pairs)].rate -= total + low
    for i in range(len(bodies)):
        body = bodies[i]
        cosine, sine = math.cos(body.omega * shift), math.sin(body.omega * shift)
        body.u, body.sway = body.u * cosine - body.sway * sine, body.sway * cosine + body.u * sine


def begin(pairs: Any, bodies: Any, scene: Any) -> None:
    """Set what pendula add to a new state."""
    pairs["rate"], pairs["rest"] = scene.across(scene.velocity), scene.rest_gap
    pairs["omega"] = bodies["omega"] = scene.pendulum
    bodies["sway"] = scene.pendulum * scene.displacement


def row(pairs: Any, tau: float) -> tuple[Array, Array]:
    """Return rates in m/s, and gaps in m, never negative, at `tau`; nothing moves."""
    names = "gap", "rate", "rest", "omega", "at"
    gap, rate, rest, omega, at = (column(pairs, name) for name in names)
    turn = omega * (tau - at)
    cosine, sine, half = np.cos(turn), np.sin(turn), np.sin(0.5 * turn)
    now: Array = gap * cosine + rate / omega * sine + 2.0 * rest * half * half
    return rate * cosine - omega * (gap - rest) * sine, now.clip(0.0)


def strike(s: Any, first: int, rates: list[float], changes: list[float]) -> None:
    """Let the group of pairs from `first` on collide at once: their rates before, its bodies' changes of velocity, m/s.

    Rates that are only rounding become exactly 0.
    """
    tiny, last = max(map(abs, rates)) * 2.0**-40, first + len(rates) - 1
    for pair, rate, (below, above) in zip(s.pairs[first : last + 1], rates, pairwise(changes), strict=True):
        after = rate + (above - below)
        pair.gap, pair.rate = 0.0, after if abs(after) > tiny else 0.0
    for body, change in zip(s.bodies[first : last + 2], changes, strict=True):
        kick(body, change, s.run.now)
    if first > 0:
        s.pairs[first - 1].rate += changes[0]
    if last + 1 < len(s.pairs):
        s.pairs[last + 1].rate -= changes[-1]
