"""Collisions of pendula.

The state of a pair consists of its gap and its rate, as for free balls in `zoom`. Between collisions both oscillate
according to ``gap'' = Ω² (rest - gap)``, where `rest` is the gap at rest. Rates therefore keep all their digits even
if all balls swing together much faster, and an inelastic collapse does not have to be detected. An infinite sequence
of collisions is followed until the squares of its rates underflow (1e-154 m/s). Pairs that touch then continue with
rate 0. They stay together if the pendula touch at rest.

The records of bodies are needed for the contact log only. They contain u (`fall_velocity`) and `sway`, both in m/s,
which change only in collisions. The velocity of a ball is ``u cos Ωt - sway sin Ωt`` at the time t since the epoch
(see `granular.edmd.motion`). Without a log these fields are not updated in collisions. They are then computed from the
rates at the end of the run.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records, column
from granular.edmd.motion import advance_pair, total_mass
from granular.edmd.records import Walls
from granular.scene import positions


@kernel
def swing_off(
    pairs: Records, bodies: Records, c: int, now: float, w: float, e: float, row: Record | None
) -> None:
    """Apply a collision to pair `c` of pendula at time `now`: its rate becomes -ε·`w`.

    `w` ≤ 0 is the rate (m/s) before the collision, and `e` is ε. The records of the bodies are updated only if `row`
    is not None, which means that the collision is logged.
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
    """Add `change` (m/s) to the velocity of a pendulum.

    `cosine` and `sine` are cos Ωt and sin Ωt at the time t of the change.
    """
    body.fall_velocity += change * cosine
    body.sway -= change * sine


@rare
@kernel
def swing_together(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, walls: Walls
) -> tuple[int, int, float]:
    """Apply a collision without rebound to pair `c` of pendula: its rate becomes 0.

    `w` ≤ 0 is the rate (m/s) before the collision, at time `now`. Balls that are connected to the pair by pairs with
    gap 0 and rate 0 get the same velocity. A wall takes part only if it belongs to pair `c`. If the pendula touch in
    their rest positions, they stay together. Otherwise they separate immediately. Returns the first and the last pair
    to predict again, and the momentum in kg m/s that pair `c` exchanged.
    """
    n, b, e = len(pairs), c, c + 1
    while b > 0 and bodies[b - 1].mass < math.inf and touches_at_rest(run, pairs[b - 1], now, walls):
        b -= 1
    while e < n and bodies[e + 1].mass < math.inf and touches_at_rest(run, pairs[e], now, walls):
        e += 1
    lower, upper = total_mass(bodies, b, c), total_mass(bodies, c + 1, e)
    # A wall takes the whole change, and inf/inf is not a number.
    part = 1.0 if upper == math.inf else upper / (lower + upper)
    # velocity changes: `up` ≤ 0 of the lower balls b … c, -`down` ≥ 0 of the upper balls c+1 … e, up + down = w
    up, down = part * w, w - part * w
    # the gap of pendula depends on the record of the pair only, which stands in for the two bodies
    if b > 0:
        run.clamps += advance_pair(pairs[b - 1], pairs[b - 1], pairs[b - 1], now, walls)
        pairs[b - 1].rate += up
    if e < n:
        run.clamps += advance_pair(pairs[e], pairs[e], pairs[e], now, walls)
        pairs[e].rate += down
    pair = pairs[c]
    cosine, sine = math.cos(pair.omega * now), math.sin(pair.omega * now)
    for i in range(b, e + 1):
        change_velocity(bodies[i], (up if i <= c else -down) if bodies[i].mass < math.inf else 0.0, cosine, sine)
    pair.gap, pair.at, pair.rate = 0.0, now, 0.0
    return max(b - 1, 0), min(e, n - 1), -upper * down if lower == math.inf else -lower * up


@rare
@kernel
def touches_at_rest(run: Record, pair: Record, now: float, walls: Walls) -> bool:
    """Advance a pair to time `now` and return whether it touches with rate 0."""
    run.clamps += advance_pair(pair, pair, pair, now, walls)
    return pair.gap == 0.0 and pair.rate == 0.0  # type: ignore[no-any-return]


def begin_pendula(pairs: Any, bodies: Any, scene: Any) -> None:
    """Set the fields of a new state that only pendula have."""
    pairs["rate"], pairs["rest"] = scene.across(scene.velocity), scene.rest_gap
    pairs["omega"] = bodies["omega"] = scene.pendulum
    bodies["sway"] = scene.pendulum * scene.displacement


def rates_and_gaps(pairs: Any, tau: float) -> tuple[Array, Array]:
    """Return rates (m/s) and gaps (m, never negative) of all pairs at time `tau`.

    `tau` is in s since the epoch. The state is not changed.
    """
    names = "gap", "rate", "rest", "omega", "at"
    gap, rate, rest, omega, at = (column(pairs, name) for name in names)
    # gap = rest + (gap - rest) cos φ + rate/ω sin φ, φ = ω (tau - at); with half = tan(φ/2), cos φ = (1 - half²)/(1 +
    # half²) and sin φ = 2 half/(1 + half²)
    half = np.tan(0.5 * omega * (tau - at))
    factor = 1.0 / (1.0 + half * half)
    gap_now: Array = (gap + half * (2.0 * rate / omega + (2.0 * rest - gap) * half)) * factor
    return (rate * (1.0 - half * half) + 2.0 * omega * (rest - gap) * half) * factor, gap_now.clip(0.0)


def set_swing(s: Any, scene: Any, row: Any) -> None:
    """Set `fall_velocity` and `sway` of all bodies from the sample `row`.

    The sample `row` shows the current time. `s` is the state of the run.
    """
    at = positions(scene, row.gap[None], np.array([row.elapsed]))[0]
    angle, sway = scene.pendulum * s.run.now, np.where(scene.is_wall, 0.0, scene.pendulum * (at - scene.at_rest))
    cosine, sine = math.cos(angle), math.sin(angle)
    for body, v, y in zip(s.bodies, row.velocity.tolist(), sway.tolist(), strict=True):
        body["fall_velocity"], body["sway"] = v * cosine + y * sine, y * cosine - v * sine


def collide_pendula(s: Any, first: int, rates: list[float], changes: list[float]) -> None:
    """Apply the simultaneous collisions of a touching group of pendula.

    `rates` are the rates of the pairs before the collision, and `first` is the number of the first pair. `changes` are
    the velocity changes of the bodies. All are in m/s. Rates that consist of rounding errors become exactly 0.
    """
    # A rounding error kept as a rate would cause another collision at the same instant.
    rounding, last = max(map(abs, rates)) * 2.0**-40, first + len(rates) - 1
    for pair, rate, (below, above) in zip(s.pairs[first : last + 1], rates, pairwise(changes), strict=True):
        after = rate + (above - below)
        pair.gap, pair.rate = 0.0, after if abs(after) > rounding else 0.0
    angle = s.pairs[first].omega * s.run.now
    for body, change in zip(s.bodies[first : last + 2], changes, strict=True):
        change_velocity(body, change, math.cos(angle), math.sin(angle))
    if first > 0:
        s.pairs[first - 1].rate += changes[0]
    if last + 1 < len(s.pairs):
        s.pairs[last + 1].rate -= changes[-1]
