"""Pendula: what a collision does to balls that hang and swing.

Gap and rate of a pair at its time are the state, as in a closer look at free balls: between collisions they turn as
``gap'' = Ω² (rest - gap)``, so rates have all their digits however fast all swing together, and no collapse has to be
judged. One that would be infinite is followed until its squares are no numbers (1e-154 m/s), and what touches then goes
on without a rate, together where the pendula touch at rest. Bodies know only how they swing, for the rows of the log:
their velocity is ``u cos Ωt - sway sin Ωt``, and u and sway change at impacts only. Without a log they do not, for
nobody asks: at the end they are set from the rates.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records, column
from granular.edmd.motion import carry, total
from granular.edmd.records import Walls
from granular.scene import positions


@kernel
def swing_off(
    pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, row: Record | None
) -> None:
    """Let pair `c` collide at time `now` with rate `w`, and part with -ε·w; its bodies if that is logged."""
    pair = pairs[c]
    up = pair.low * ((1.0 + e) * w)  # the larger change is what the smaller leaves, or energy would drift
    down = pair.high * ((1.0 + e) * w)
    if pair.low <= 0.5:
        down = (1.0 + e) * w - up
    else:
        up = (1.0 + e) * w - down
    if c > 0:
        pairs[c - 1].rate += up
    if c + 1 < len(pairs):
        pairs[c + 1].rate += down
    pair.gap, pair.at, pair.rate = 0.0, now, -e * w
    if row is not None:
        cosine, sine = math.cos(pair.omega * now), math.sin(pair.omega * now)
        kick(bodies[c], up, cosine, sine)
        kick(bodies[c + 1], -down, cosine, sine)


@kernel
def kick(body: Record, change: float, cosine: float, sine: float) -> None:
    """Change the velocity of a body (m/s) at a time with such cos Ωt and sin Ωt."""
    body.fall_velocity += change * cosine
    body.sway -= change * sine


@rare
@kernel
def swing_together(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that touch them at rest, go on with one velocity.

    They stay together where pendula touch at rest, and come apart at once where they do not. Returns the first and the
    last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    n, b, e = len(pairs), c, c + 1
    while b > 0 and bodies[b - 1].mass < math.inf and stands(run, pairs[b - 1], now, walls):
        b -= 1
    while e < n and bodies[e + 1].mass < math.inf and stands(run, pairs[e], now, walls):
        e += 1
    lower, upper = total(bodies, b, c), total(bodies, c + 1, e)
    part = 1.0 if upper == math.inf else upper / (lower + upper)
    up, down = part * w, w - part * w
    if b > 0:
        run.clamps += carry(pairs[b - 1], pairs[b - 1], pairs[b - 1], now, walls)
        pairs[b - 1].rate += up
    if e < n:
        run.clamps += carry(pairs[e], pairs[e], pairs[e], now, walls)
        pairs[e].rate += down
    pair = pairs[c]
    cosine, sine = math.cos(pair.omega * now), math.sin(pair.omega * now)
    for i in range(b, e + 1):
        kick(bodies[i], (up if i <= c else -down) if bodies[i].mass < math.inf else 0.0, cosine, sine)
    pair.gap, pair.at, pair.rate = 0.0, now, 0.0
    return max(b - 1, 0), min(e, n - 1), -upper * down if lower == math.inf else -lower * up


@rare
@kernel
def stands(run: Record, pair: Record, now: float, walls: Walls) -> bool:
    """Return whether the bodies of a pair touch without a rate at time `now`, to which it is carried."""
    run.clamps += carry(pair, pair, pair, now, walls)
    return pair.gap == 0.0 and pair.rate == 0.0  # type: ignore[no-any-return]


def begin(pairs: Any, bodies: Any, scene: Any) -> None:
    """Set what pendula add to a new state."""
    pairs["rate"], pairs["rest"] = scene.across(scene.velocity), scene.rest_gap
    pairs["omega"] = bodies["omega"] = scene.pendulum
    bodies["sway"] = scene.pendulum * scene.displacement


def row(pairs: Any, tau: float) -> tuple[Array, Array]:
    """Return rates in m/s, and gaps in m, never negative, at `tau`; nothing moves."""
    names = "gap", "rate", "rest", "omega", "at"
    gap, rate, rest, omega, at = (column(pairs, name) for name in names)
    t = np.tan(0.5 * omega * (tau - at))
    share = 1.0 / (1.0 + t * t)
    now: Array = (gap + t * (2.0 * rate / omega + (2.0 * rest - gap) * t)) * share
    return (rate * (1.0 - t * t) + 2.0 * omega * (rest - gap) * t) * share, now.clip(0.0)


def settle(s: Any, scene: Any, row: Any) -> None:
    """Let bodies swing as their row says, the row of now."""
    at = positions(scene, row.gap[None], np.array([row.elapsed]))[0]
    turn, off = scene.pendulum * s.run.now, np.where(scene.is_wall, 0.0, scene.pendulum * (at - scene.at_rest))
    cosine, sine = math.cos(turn), math.sin(turn)
    for body, v, y in zip(s.bodies, row.velocity.tolist(), off.tolist(), strict=True):
        body["fall_velocity"], body["sway"] = v * cosine + y * sine, y * cosine - v * sine


def strike(s: Any, first: int, rates: list[float], changes: list[float]) -> None:
    """Let the group of pairs from `first` on collide at once: their rates before, its bodies' changes of velocity, m/s.

    Rates that are only rounding become exactly 0.
    """
    tiny, last = max(map(abs, rates)) * 2.0**-40, first + len(rates) - 1
    for pair, rate, (below, above) in zip(s.pairs[first : last + 1], rates, pairwise(changes), strict=True):
        after = rate + (above - below)
        pair.gap, pair.rate = 0.0, after if abs(after) > tiny else 0.0
    turn = s.pairs[first].omega * s.run.now
    for body, change in zip(s.bodies[first : last + 2], changes, strict=True):
        kick(body, change, math.cos(turn), math.sin(turn))
    if first > 0:
        s.pairs[first - 1].rate += changes[0]
    if last + 1 < len(s.pairs):
        s.pairs[last + 1].rate -= changes[-1]
