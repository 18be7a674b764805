"""Pendula: velocities of swinging balls, and their change by contact forces.

A ball at the displacement y from its rest position obeys ÿ = -Ω² y + F/m, where F is the sum of the contact forces. Its
`fall` is Ω² y, the downward acceleration at its clock. A force from s to s + ds changes, at the end of a time T,

    ẏ by F/m cos(Ω(T - s)) ds ,   Ω² y by F/m Ω sin(Ω(T - s)) ds .

Both are integrals over a polynomial piece, by Gauss's rule. They are the same for both balls of a pair, so that the
mass centre swings as one pendulum to rounding error. The recurrences of `series` already include the swing of pairs.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swung
from granular._engine.kernels import kernel
from granular.md.located.ledger import ENERGY_NODE_COUNT, ENERGY_NODES, ENERGY_WEIGHTS, pace
from granular.md.located.pieces import elapsed, since, tick, value
from granular.md.located.records import ACTIVE


@kernel
def shift(run: Any, body: Any, pair: Any, way: float) -> None:
    """Set the `fall` of a body at the clock of `pair`, displaced upwards by `way`.

    `way` is in m. Velocity and clock of the body are not changed. The caller sets them with `free`.
    """
    fall = swung(body, run.omega, since(body, pair.t, pair.tail))[1]
    body.fall = fall + run.omega * run.omega * way


@kernel
def impulse_of_pendula(s: Any, c: int, v: float, t1: float, v1: float) -> float:
    """Return the impulse ∫ F dt up to t1 of a dashpot contact between pendula.

    The contact of pair `c` starts at speed `v` and is solved as one event. The result is the integral of η̇ = -Ω² (ξ +
    d) - (kξ + γη)/m, with kξ = -γη at its end.
    """
    pair, law = s.pairs[c], s.kinds[s.pairs[c].kind_of]
    inverse, left = s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, law.gamma * (law.gamma * v1 / law.k)
    area = (v + v1 + pair.pull * t1 - left * inverse) / (law.k * inverse + s.field.square)
    return float(law.k * area + left)


@kernel
def swing(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the bodies of an island to τ, a time `dt` into its piece.

    Bodies without a force keep their clock.
    """
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
    """Return ∫ F cos(Ω(dt - s)) ds and ∫ F Ω sin(Ω(dt - s)) ds up to τ.

    `member` is the pair, and τ is the time `dt` into its piece.
    """
    kick, fall, scale = 0.0, 0.0, pace(block, tau)
    for i in range(ENERGY_NODE_COUNT):
        # elapsed(x, q, 1)/x is x^(q-1): the factor from dt/dx at the node
        push = (
            ENERGY_WEIGHTS[i]
            * value(member.f, tau * ENERGY_NODES[i])
            * elapsed(ENERGY_NODES[i], block.clock, 1.0)
            / ENERGY_NODES[i]
        )
        turn = omega * (dt - elapsed(block.h * tau * ENERGY_NODES[i], block.clock, 1.0))
        kick += push * math.cos(turn)
        fall += push * math.sin(turn)
    return scale * kick, scale * omega * fall

