"""Pendula: velocities of swinging balls, and their change by contact forces.

A ball at the displacement y (m, upwards) from its rest position obeys ÿ = -Ω² y + F/m, where F is the sum of the
contact forces. The field `fall` of its record is Ω² y, the downward acceleration at its clock. The force F during the
interval ds at time s changes the state at the later time T:

    ẏ by F/m cos(Ω(T - s)) ds ,   Ω² y by F/m Ω sin(Ω(T - s)) ds .

Both changes are integrals over a polynomial piece, by Gauss's rule. The integrals are the same for both balls of a
pair, so that the mass centre swings as one pendulum to rounding error. The series of `series` already include the term
-Ω² ξ.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import swing_after
from granular._engine.kernels import kernel
from granular.md.located.ledger import ENERGY_NODE_COUNT, ENERGY_NODES, ENERGY_WEIGHTS, clock_rate
from granular.md.located.pieces import advance_clock, elapsed_time, time_since, value
from granular.md.located.records import ACTIVE


@kernel
def displace_pendulum(run: Any, body: Any, pair: Any, displacement: float) -> None:
    """Set the acceleration `fall` of a body to its value at the clock of `pair`.

    The body is also displaced upwards by `displacement` in m. The caller sets its velocity and its clock.
    """
    fall = swing_after(body, run.omega, time_since(body, pair.t, pair.tail))[1]
    body.fall = fall + run.omega * run.omega * displacement


@kernel
def impulse_of_pendula(s: Any, c: int, v: float, t1: float, v1: float) -> float:
    """Return the impulse ∫ F dt in N s up to t1 of a dashpot contact between pendula.

    The contact of pair `c` starts at the closing speed `v` in m/s and is solved as one event. Its force ends after t1
    in s, at the separation speed `v1`. The result follows from the integral from 0 to t1 of
    η̇ = -Ω² (ξ + d) - (kξ + γη)/m_eff. Here η = ξ̇ goes from v to -v1, d is the distance between the surfaces at rest,
    and kξ = -γη at t1.
    """
    pair, law = s.pairs[c], s.kinds[s.pairs[c].kind_of]
    inverse, damping = s.bodies[c].inverse_mass + s.bodies[c + 1].inverse_mass, law.gamma * (law.gamma * v1 / law.k)
    area = (v + v1 + pair.pull * t1 - damping * inverse) / (law.k * inverse + s.field.square)
    return float(law.k * area + damping)


@kernel
def advance_pendula(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, tau: float, dt: float) -> None:
    """Advance the pendula of an island to τ, a time `dt` (s) into its piece.

    Velocity, `fall` and clock are updated. Bodies on which no force acts keep their clock.
    """
    block, hi, below, fall_below = pool[pairs[lo].slot], pairs[lo].hi, 0.0, 0.0
    for c in range(lo, hi + 1):
        body, above, fall_above = bodies[c], 0.0, 0.0
        if c < hi and pool[pairs[c].slot].mode == ACTIVE:
            above, fall_above = force_integrals(pool[pairs[c].slot], block, run.omega, tau, dt)
        if below != 0.0 or above != 0.0:
            v, fall = swing_after(body, run.omega, time_since(body, block.t, block.tail) + dt)
            body.v = v + body.inverse_mass * (below - above)
            body.fall = fall + body.inverse_mass * (fall_below - fall_above)
            body.t, body.tail = block.t, block.tail
            advance_clock(body, dt)
        below, fall_below = above, fall_above


@kernel
def force_integrals(member: Any, block: Any, omega: float, tau: float, dt: float) -> tuple[float, float]:
    """Return the integrals of a contact force that change the state of a pendulum.

    They are ∫ F cos(Ω(dt - s)) ds in N s and ∫ F Ω sin(Ω(dt - s)) ds in N. `member` is the pair, and τ is the time `dt`
    into its piece.
    """
    impulse, sine_integral, scale = 0.0, 0.0, clock_rate(block, tau)
    for i in range(ENERGY_NODE_COUNT):
        # elapsed(x, q, 1)/x is x^(q-1): the factor from dt/dx at the node
        push = (
            ENERGY_WEIGHTS[i]
            * value(member.f, tau * ENERGY_NODES[i])
            * elapsed_time(ENERGY_NODES[i], block.clock, 1.0)
            / ENERGY_NODES[i]
        )
        turn = omega * (dt - elapsed_time(block.h * tau * ENERGY_NODES[i], block.clock, 1.0))
        impulse += push * math.cos(turn)
        sine_integral += push * math.sin(turn)
    return scale * impulse, scale * omega * sine_integral

