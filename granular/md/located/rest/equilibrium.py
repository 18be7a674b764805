"""Equilibrium of balls in contact, and an energy proof that no contact can open.

A group is a maximal run of pairs a … b-1 with contact forces: a pile on a floor or below a ceiling, balls between both,
or balls that forces press together in flight. Consider the frame of its wall, or of its mass centre, which accelerates
uniformly. The energy relative to the static equilibrium (overlaps ξ°, forces F° > 0),

    E = Σ ½ m v² + Σ U(ξ) - U(ξ°) - F° (ξ - ξ°) ,

never grows. The force of pair c can only vanish where kξ^s + γη = 0. The relative motion alone then has the energy ½
m_eff η², so that the pair needs at least the minimum on 0 ≤ ξ ≤ ξ° of

    U(ξ) - U(ξ°) - F° (ξ - ξ°) + ½ m_eff (k ξ^s / γ)² .

For a dashpot this is F°²/(2 (k + γ²/m_eff)). For γ = 0 the pair has to separate, ξ = 0. In addition, kξ^s + γη must
decrease there. Its rate is at least γ G - s k² ξ^(2s-1)/γ, because other forces only press. Under a pull G > 0 this
requires an overlap of

    ξ^(2s-1) ≥ γ² G / (s k²) ,

which is beyond ξ° and out of reach for a strongly damped ball. If the energy is below this bound for every contact, no
force ever vanishes, and no contact opens. The equilibrium does not depend on the time of its computation: loads are
weights and forces, and between two walls at rest the overlaps have a constant sum.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, LINEAR

NOT_YET, RESTS, BOUND = range(3)
"""Verdicts about a group.

Nothing is proved. The group rests, with damping in every contact. It is bound forever, but not damped in every
contact."""


@kernel
def end_of_group(pairs: Any, pool: Any, c: int) -> int:
    """Return the end of the group that starts with pair `c`, or `c` without a force."""
    b = c
    while b < len(pairs) and pairs[b].slot >= 0 and pool[pairs[b].slot].mode == ACTIVE:
        b += 1
    return b


@kernel
def bound(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> int:
    """Return the verdict about the group of pairs a … b-1.

    Energy and barrier are stored in the record of its first pair.
    """
    head = pool[pairs[a].slot]
    find_equilibrium(pairs, pool, bodies, a, b)
    if head.opening <= 0.0:
        return NOT_YET
    energy, damped = kinetic(pairs, pool, bodies, a, b), RESTS
    if energy >= head.opening:
        return NOT_YET
    for c in range(b - 1, a - 1, -1):
        pair = pool[pairs[c].slot]
        energy += excess(pair, pair.xi)
        damped = damped if pair.gamma > 0.0 else BOUND
    if head.barrier == math.inf:
        head.barrier = head.opening
        for c in range(a, b):
            head.barrier = min(head.barrier, hurdle(pool[pairs[c].slot]))
    head.energy = energy
    # 1e-9: margin for rounding errors of energy and barrier
    return damped if energy < (1.0 - 1e-9) * head.barrier else NOT_YET


@kernel
def is_known(pairs: Any, pool: Any, a: int, b: int) -> bool:
    """Return whether a group is unchanged since its equilibrium was stored."""
    if pool[pairs[a].slot].piled != b - a:
        return False
    for c in range(a, b):
        if pool[pairs[c].slot].head != a:
            return False
    return True


@kernel
def find_equilibrium(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> None:
    """Store the loads of a group, and an upper bound of its energy barrier in J.

    With more energy than the bound, a pair can open. The bound is 0 if a pair bears no load. It is computed without
    damping, where a pair has to separate, or at the overlap from which its force can decrease. A `hurdle` is lower. An
    unchanged group keeps the stored values.
    """
    head, least = pool[pairs[a].slot], math.inf
    if is_known(pairs, pool, a, b):
        return
    for c in range(a, b):
        pool[pairs[c].slot].head = a
    head.piled, head.opening, head.barrier = b - a, 0.0, math.inf
    if not find_loads(pairs, pool, bodies, a, b):
        head.load = 0.0
        return
    for c in range(a, b):
        pair = pool[pairs[c].slot]
        if pair.kind == GENERAL or not pair.load > 0.0:
            return
        least = min(least, opens_at(pair, turning(pair)))
    head.opening = least


@kernel
def find_loads(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Store the force in N of each pair of a group at rest.

    Return False if the group has no equilibrium, or a driven wall.
    """
    if pairs[a].wall > 0 or pairs[b - 1].wall > 0:
        return False
    floor, ceiling, load = bodies[a].inverse_mass == 0.0, bodies[b].inverse_mass == 0.0, 0.0
    if not (floor or ceiling):
        return find_loads_in_flight(pairs, pool, bodies, a, b)
    if floor and ceiling and bodies[a].v != bodies[b].v:
        return False
    for c in range(b - 1, a - 1, -1):
        load += weight(bodies[c + 1])
        pool[pairs[c].slot].load = load if floor else 0.0
    load = 0.0
    for c in range(a, b if ceiling else a):
        load -= weight(bodies[c])
        pair = pool[pairs[c].slot]
        # between two walls the equilibrium has a free common force, which `squeeze` determines
        pair.load = 0.5 * (pair.load + load) if floor else load
    return not (floor and ceiling) or squeeze(pairs, pool, a, b)


@kernel
def weight(body: Any) -> float:
    """Return the force in N that pulls a ball down, or 0 for a wall."""
    return float(body.fall / body.inverse_mass) if body.inverse_mass > 0.0 else 0.0


@kernel
def find_loads_in_flight(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Store the contact forces in a group of balls that falls together.

    The load of a pair is F = m_eff Δ(fall), for the balls above and below it. Falls are relative to the fall of the
    lowest ball, so loads are exactly 0 if only gravity acts.
    """
    fall, mass, total, falls = 0.0, 1.0 / bodies[a].inverse_mass, 0.0, False
    for c in range(a, b):
        fall += pairs[c].pull
        falls = falls or pairs[c].pull > 0.0
        mass += 1.0 / bodies[c + 1].inverse_mass
        total += fall / bodies[c + 1].inverse_mass
    if not falls:
        return False
    below, pulled, fall = 1.0 / bodies[a].inverse_mass, 0.0, 0.0
    for c in range(a, b):
        above = mass - below if c + 1 < b else 1.0 / bodies[b].inverse_mass
        difference = (total - pulled) / above - pulled / below if b > a + 1 else pairs[c].pull
        pool[pairs[c].slot].load = below * above / mass * difference
        fall += pairs[c].pull
        below += 1.0 / bodies[c + 1].inverse_mass
        pulled += fall / bodies[c + 1].inverse_mass
    return True


@kernel
def squeeze(pairs: Any, pool: Any, a: int, b: int) -> bool:
    """Add to the loads of balls between two walls a common force.

    With it the static overlaps have the same sum as the present overlaps. Return True.
    """
    total, low, high = 0.0, -math.inf, 0.0
    for c in range(a, b):
        total += pool[pairs[c].slot].xi
    for c in range(a, b):
        pair = pool[pairs[c].slot]
        low = max(low, -pair.load)
        high = max(high, pair.k * power(total, pair.p) - pair.load)
    # 100 halvings exhaust the digits of the common force
    for _ in range(100):
        middle, taken = 0.5 * (low + high), 0.0
        for c in range(a, b):
            pair = pool[pairs[c].slot]
            taken += overlap_under(pair, max(0.0, middle + pair.load))
        low, high = (middle, high) if taken < total else (low, middle)
    for c in range(a, b):
        pool[pairs[c].slot].load += low
    return True


@kernel
def kinetic(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> float:
    """Return the kinetic energy in J of a group relative to its wall.

    Without a wall, it is relative to the mass centre.
    """
    v, energy, free = 0.0, 0.0, bodies[a].inverse_mass > 0.0
    if free:
        mass, momentum = 1.0 / bodies[a].inverse_mass, 0.0
        for c in range(a, b):
            v -= pool[pairs[c].slot].eta
            if bodies[c + 1].inverse_mass > 0.0:
                mass += 1.0 / bodies[c + 1].inverse_mass
                momentum += v / bodies[c + 1].inverse_mass
        v = -momentum / mass if bodies[b].inverse_mass > 0.0 else -v
        energy = 0.5 * v * v / bodies[a].inverse_mass
    for c in range(a, b):
        v -= pool[pairs[c].slot].eta
        if bodies[c + 1].inverse_mass > 0.0:
            energy += 0.5 * v * v / bodies[c + 1].inverse_mass
    return energy


@kernel
def overlap_under(pair: Any, load: float) -> float:
    """Return the static overlap in m under a load in N."""
    return power(load / pair.k, 1.0 / pair.p)


@kernel
def excess(pair: Any, xi: float) -> float:
    """Return U(ξ) - U(ξ°) - F° (ξ - ξ°) in J."""
    rest = overlap_under(pair, pair.load)
    if pair.kind == LINEAR:
        return float(0.5 * pair.k * (xi - rest) * (xi - rest))
    stored = xi * power(xi, pair.p) - rest * power(rest, pair.p) if xi > 0.0 else -rest * power(rest, pair.p)
    return float(pair.k * stored / (pair.p + 1.0) - pair.load * (xi - rest))


@kernel
def turning(pair: Any) -> float:
    """Return the smallest overlap in m at which a force can decrease through zero.

    The result is 0 if this is not beyond the static overlap.
    """
    exponent = 2.0 * pair.s - 1.0
    if pair.kind == ELASTIC or not (pair.gamma > 0.0 and pair.pull > 0.0 and exponent > 0.0):
        return 0.0
    ratio = pair.gamma / pair.k
    least = power(ratio * ratio * pair.pull / pair.s, 1.0 / exponent)
    return least if least > overlap_under(pair, pair.load) else 0.0


@kernel
def opens_at(pair: Any, xi: float) -> float:
    """Return the energy in J at which the force of a pair vanishes at an overlap in m."""
    if xi == 0.0:
        return excess(pair, 0.0)
    stiff = pair.k / pair.gamma / math.sqrt(pair.inverse)
    return float(excess(pair, xi) + 0.5 * stiff * stiff * power(xi, 2.0 * pair.s))


@kernel
def hurdle(pair: Any) -> float:
    """Return the smallest energy in J at which the force of a pair can vanish."""
    rest, least = overlap_under(pair, pair.load), turning(pair)
    if pair.kind == ELASTIC or pair.gamma == 0.0 or least > 0.0:
        return opens_at(pair, least)
    stiff = pair.k / pair.gamma / math.sqrt(pair.inverse)
    low, high = 0.0, rest
    for _ in range(60):  # the sum is convex: bisect the sign of its slope, 2^-60 is below rounding
        xi = 0.5 * (low + high)
        slope = pair.k * power(xi, pair.p) - pair.load + stiff * stiff * pair.s * power(xi, 2.0 * pair.s - 1.0)
        low, high = (xi, high) if slope < 0.0 else (low, xi)
    return float(excess(pair, high) + 0.5 * stiff * stiff * power(low, 2.0 * pair.s))

