"""Pendula: the velocities of balls that swing, and how forces change them on the way.

A ball at the displacement y from where it rests has ÿ = -Ω² y + F/m, F the sum of the contact forces on it; its `fall`
is Ω² y, the downward acceleration that it has at its clock. A force from s to s + ds in a time T changes, at its end,

    ẏ by F/m cos(Ω(T - s)) ds ,   Ω² y by F/m Ω sin(Ω(T - s)) ds .

Both are integrals of a polynomial piece, by Gauss's rule, the same for both balls of a pair; so the mass centre swings
as one pendulum to rounding. Of pairs the recurrences know by themselves (`series`).
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swung
from granular._engine.kernels import kernel
from granular.md.located.ledger import NODES, POINTS, WEIGHTS, pace
from granular.md.located.pieces import elapsed, since, tick, value
from granular.md.located.records import ACTIVE


@kernel
def shift(run: Any, body: Any, pair: Any, way: float) -> None:
    """Let a body have the `fall` that it would have at the clock of `pair`, farther up by a `way`."""
    fall = swung(body, run.omega, since(body, pair.t, pair.tail))[1]
    body.fall = fall + run.omega * run.omega * way


@kernel
def impulse_of_pendula(s: Any, c: int, v: float, t1: float, v1: float) -> float:
    """Return ∫ F dt up to t1 of a dashpot's contact of pair `c` at speed `v` that is solved at once: by
    η̇ = -Ω² (ξ + d) - (kξ + γη)/m, integrated, with kξ = -γη at its end."""
    pair, law = s.pairs[c], s.kinds[s.pairs[c].kind_of]
    inverse, left = s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, law.gamma * (law.gamma * v1 / law.k)
    area = (v + v1 + pair.pull * t1 - left * inverse) / (law.k * inverse + s.field.square)
    return float(law.k * area + left)


@kernel
def swing(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the bodies of an island to τ, a time `dt` into its piece: what no force acts on swings on as before."""
    block, hi, below, fall_below = pool[pairs[lo].slot], pairs[lo].hi, 0.0, 0.0
    for c in range(lo, hi + 1):
        body, above, fall_above = bodies[c], 0.0, 0.0
        if c < hi and pool[pairs[c].slot].mode == ACTIVE:
            above, fall_above = kicks(pool[pairs[c].slot], block, run.omega, tau, dt)
        if below != 0.0 or above != 0.0:
            v, fall = swung(body, run.omega, since(body, block.t, block.tail) + dt)
            body.v = v + body.inverse_mass * (below - above)
            body.fall = fall + body.inverse_mass * (fall_below - fall_above)
            body.t, body.tail = block.t, block.tail
            tick(body, dt)
        below, fall_below = above, fall_above


@kernel
def kicks(member: Any, block: Any, omega: float, tau: float, dt: float) -> tuple[float, float]:
    """Return ∫ F cos(Ω(dt - s)) ds and ∫ F Ω sin(Ω(dt - s)) ds up to τ, a time `dt` into the piece of a pair."""
    kick, fall, scale = 0.0, 0.0, pace(block, tau)
    for i in range(POINTS):
        push = WEIGHTS[i] * value(member.f, tau * NODES[i]) * elapsed(NODES[i], block.clock, 1.0) / NODES[i]
        turn = omega * (dt - elapsed(block.h * tau * NODES[i], block.clock, 1.0))
        kick += push * math.cos(turn)
        fall += push * math.sin(turn)
    return scale * kick, scale * omega * fall

