"""Pendula: collisions of balls that swing.

The state of a pair is its gap and its rate, as for the free balls in `zoom`. Between collisions both turn as
``gap'' = Ω² (rest - gap)``. Rates therefore keep all their digits however fast all balls swing together, and no
inelastic collapse has to be detected. An infinite sequence of collisions is followed until the squares of its rates
underflow (1e-154 m/s). Pairs that touch then continue with rate 0, and stay together if the pendula touch at rest.

Bodies store only their swing, which the contact log needs: the velocity is ``u cos Ωt - sway sin Ωt``, and u and sway
change at impacts only. Without a log they are not updated at impacts, and are set from the rates at the end of the run.
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
    """Let pair `c` collide at time `now` and separate with the rate -ε·w.

    `w` is the rate before the collision, `e` is ε. The bodies are updated only if the collision is logged.
    """
    pair = pairs[c]
    up = pair.low * ((1.0 + e) * w)  # the larger change is the remainder, or the energy would drift
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
        change_velocity(bodies[c], up, cosine, sine)
        change_velocity(bodies[c + 1], -down, cosine, sine)


@kernel
def change_velocity(body: Record, change: float, cosine: float, sine: float) -> None:
    """Change the velocity of a body by `change` (m/s).

    `cosine` and `sine` are cos Ωt and sin Ωt at the time t of the change.
    """
    body.fall_velocity += change * cosine
    body.sway -= change * sine


@rare
@kernel
def swing_together(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Give pair `c`, which closes at rate `w`, and its neighbours one velocity.

    All balls that are connected to pair `c` by pairs with gap 0 and rate 0 take part, but a wall only if it belongs to
    pair `c`. Pairs of pendula that touch in their rest positions stay together. All other pairs separate immediately.
    `w` ≤ 0 is the rate before the collision. Returns the first and the last pair to predict again, and the momentum
    exchanged by pair `c` in kg m/s.
    """
    n, b, e = len(pairs), c, c + 1
    while b > 0 and bodies[b - 1].mass < math.inf and stands(run, pairs[b - 1], now, walls):
        b -= 1
    while e < n and bodies[e + 1].mass < math.inf and stands(run, pairs[e], now, walls):
        e += 1
    lower, upper = total(bodies, b, c), total(bodies, c + 1, e)
    # A wall takes the whole change, and inf/inf is not a number.
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
        change_velocity(bodies[i], (up if i <= c else -down) if bodies[i].mass < math.inf else 0.0, cosine, sine)
    pair.gap, pair.at, pair.rate = 0.0, now, 0.0
    return max(b - 1, 0), min(e, n - 1), -upper * down if lower == math.inf else -lower * up


@rare
@kernel
def stands(run: Record, pair: Record, now: float, walls: Walls) -> bool:
    """Advance a pair to time `now` and return whether it touches with rate 0."""
    run.clamps += carry(pair, pair, pair, now, walls)
    return pair.gap == 0.0 and pair.rate == 0.0  # type: ignore[no-any-return]


def begin(pairs: Any, bodies: Any, scene: Any) -> None:
    """Initialise the fields of a new state that only pendula have."""
    pairs["rate"], pairs["rest"] = scene.across(scene.velocity), scene.rest_gap
    pairs["omega"] = bodies["omega"] = scene.pendulum
    bodies["sway"] = scene.pendulum * scene.displacement


def row(pairs: Any, tau: float) -> tuple[Array, Array]:
    """Return the rates in m/s and the gaps in m (never negative) at `tau`.

    The state is not changed.
    """
    names = "gap", "rate", "rest", "omega", "at"
    gap, rate, rest, omega, at = (column(pairs, name) for name in names)
    t = np.tan(0.5 * omega * (tau - at))
    share = 1.0 / (1.0 + t * t)
    now: Array = (gap + t * (2.0 * rate / omega + (2.0 * rest - gap) * t)) * share
    return (rate * (1.0 - t * t) + 2.0 * omega * (rest - gap) * t) * share, now.clip(0.0)


def settle(s: Any, scene: Any, row: Any) -> None:
    """Set the swing of all bodies from `row`, the sample at the current time."""
    at = positions(scene, row.gap[None], np.array([row.elapsed]))[0]
    turn, off = scene.pendulum * s.run.now, np.where(scene.is_wall, 0.0, scene.pendulum * (at - scene.at_rest))
    cosine, sine = math.cos(turn), math.sin(turn)
    for body, v, y in zip(s.bodies, row.velocity.tolist(), off.tolist(), strict=True):
        body["fall_velocity"], body["sway"] = v * cosine + y * sine, y * cosine - v * sine


def strike(s: Any, first: int, rates: list[float], changes: list[float]) -> None:
    """Let a group of touching pairs collide simultaneously.

    `rates` are the rates before the collision, of the pairs from `first` on. `changes` are the velocity changes of the
    bodies, both in m/s. Rates that consist of rounding errors become exactly 0.
    """
    # A rounding error kept as a rate would cause another collision at the same instant.
    tiny, last = max(map(abs, rates)) * 2.0**-40, first + len(rates) - 1
    for pair, rate, (below, above) in zip(s.pairs[first : last + 1], rates, pairwise(changes), strict=True):
        after = rate + (above - below)
        pair.gap, pair.rate = 0.0, after if abs(after) > tiny else 0.0
    turn = s.pairs[first].omega * s.run.now
    for body, change in zip(s.bodies[first : last + 2], changes, strict=True):
        change_velocity(body, change, math.cos(turn), math.sin(turn))
    if first > 0:
        s.pairs[first - 1].rate += changes[0]
    if last + 1 < len(s.pairs):
        s.pairs[last + 1].rate -= changes[-1]
