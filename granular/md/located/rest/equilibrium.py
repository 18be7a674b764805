"""Static equilibrium of balls in contact, and proof that no contact can end.

A group is a maximal sequence of pairs a … b-1 with contact forces. It is a pile on a floor, balls below a ceiling,
balls between two walls, or balls in flight that external forces press together. Consider the frame of its wall, or of
its mass centre, which accelerates uniformly. Let ξ° and F° > 0 be overlaps and forces at the static equilibrium. The
energy relative to the equilibrium,

    E = Σ ½ m v² + Σ [U(ξ) - U(ξ°) - F° (ξ - ξ°)] ,

never grows. The force of a pair can only vanish where kξ^s + γη = 0. The relative motion of the pair alone then has the
energy ½ m_eff η². To end a contact, E must therefore be at least the minimum on 0 ≤ ξ ≤ ξ° of

    U(ξ) - U(ξ°) - F° (ξ - ξ°) + ½ m_eff (k ξ^s / γ)² ,

which is called the *barrier* of the pair. For a dashpot it is F°²/(2 (k + γ²/m_eff)). For γ = 0 the pair has to
separate, ξ = 0.

A second condition raises the barrier of strongly damped pairs: kξ^s + γη must decrease where it vanishes. Its rate is
at least γ G - s k² ξ^(2s-1)/γ, because the forces of other pairs only press. With a pull G > 0 this requires an overlap
of

    ξ^(2s-1) ≥ γ² G / (s k²) ,

which exceeds ξ° for a strongly damped ball. If E is below the barrier of every pair, no force ever vanishes, and no
contact ends. The equilibrium can be computed once, because it does not change: loads are weights and external forces.
Between two walls at rest the sum of the overlaps is constant.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, LINEAR

NOT_YET, RESTS, BOUND = range(3)
"""Results of a proof that balls stay in contact.

NOT_YET: nothing is proved. RESTS: the balls come to rest, because every contact is damped. BOUND: the balls stay in
contact permanently, but not every contact is damped.
"""

TOUCH_ENERGY_ROUNDING = 1e-14
"""Relative rounding error of the energy of an elastic pair from a touch at rest."""


@kernel
def end_of_group(pairs: Any, pool: Any, c: int) -> int:
    """Return the end b of the group of pairs c … b-1, or `c` if pair `c` has no force."""
    b = c
    while b < len(pairs) and pairs[b].slot >= 0 and pool[pairs[b].slot].mode == ACTIVE:
        b += 1
    return b


@kernel
def prove_group(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> int:
    """Try to prove that no contact of the group of pairs a … b-1 can end.

    Returns RESTS, BOUND or NOT_YET. The energy of the group and the smallest barrier of its pairs, both in J, are
    stored in the record of the first pair.
    """
    head = pool[pairs[a].slot]
    find_equilibrium(pairs, pool, bodies, a, b)
    if head.opening <= 0.0:
        return NOT_YET
    energy, damped = kinetic_energy(pairs, pool, bodies, a, b), RESTS
    if energy >= head.opening:
        return NOT_YET
    for c in range(b - 1, a - 1, -1):
        pair = pool[pairs[c].slot]
        energy += energy_above_rest(pair, pair.xi)
        damped = damped if pair.gamma > 0.0 else BOUND
    if head.barrier == math.inf:
        head.barrier = head.opening
        for c in range(a, b):
            head.barrier = min(head.barrier, energy_barrier(pool[pairs[c].slot]))
    head.energy = energy
    # 1e-9: margin for rounding errors of energy and barrier
    if energy < (1.0 - 1e-9) * head.barrier:
        return damped
    # an elastic pair that began at a touch at rest returns to it, and separates at most by rounding errors
    is_alone = b == a + 1 and damped == BOUND
    return BOUND if is_alone and energy <= (1.0 + TOUCH_ENERGY_ROUNDING) * head.barrier else NOT_YET


@kernel
def has_stored_equilibrium(pairs: Any, pool: Any, a: int, b: int) -> bool:
    """Return whether the equilibrium of the group a … b-1 is already stored.

    The group must consist of the same pairs as at the time of the computation.
    """
    if pool[pairs[a].slot].piled != b - a:
        return False
    for c in range(a, b):
        if pool[pairs[c].slot].head != a:
            return False
    return True


@kernel
def find_equilibrium(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> None:
    """Compute the static forces of the group a … b-1, and a bound of its barrier.

    The forces in N are stored as `load` of each pair. `opening` of the first pair is an energy in J that is never below
    the barrier of the group (`energy_barrier`). A group with more energy cannot be proved to stay closed.

    `opening` is the smallest energy at which ξ of a pair falls to 0, or to `smallest_vanishing_overlap` if the force
    can only vanish beyond the static overlap. It is 0 if a pair bears no load or has a general law, or if there is no
    equilibrium. For an unchanged group nothing is computed.
    """
    head, least = pool[pairs[a].slot], math.inf
    if has_stored_equilibrium(pairs, pool, a, b):
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
        least = min(least, energy_of_vanishing_force(pair, smallest_vanishing_overlap(pair)))
    head.opening = least


@kernel
def find_loads(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Compute the static force in N of each pair of the group a … b-1, as its `load`.

    Returns False if the group has no equilibrium, or if it touches a driven wall.
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
        # between two walls the equilibrium has a free common force, which `add_common_force` determines
        pair.load = 0.5 * (pair.load + load) if floor else load
    return not (floor and ceiling) or add_common_force(pairs, pool, a, b)


@kernel
def weight(body: Any) -> float:
    """Return the downward force on a ball in N by gravity and external forces.

    It is 0 for a wall.
    """
    return float(body.fall / body.inverse_mass) if body.inverse_mass > 0.0 else 0.0


@kernel
def find_loads_in_flight(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Compute the loads in N of balls a … b that are pressed together in free flight.

    The load of a pair is F = m_eff (fall_above - fall_below). Here the falls are the mean downward accelerations of the
    balls above and below the pair, by gravity and external forces, and m_eff is the effective mass of these two sets of
    balls. The falls are relative to the fall of the lowest ball, so that loads are exactly 0 if only gravity acts.
    Returns False if no external force presses a pair together.
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
def add_common_force(pairs: Any, pool: Any, a: int, b: int) -> bool:
    """Add a common force to the loads of the pairs a … b-1 between two walls.

    The force is chosen so that the static overlaps have the same sum as the current overlaps. Always returns True.
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
            taken += static_overlap(pair, max(0.0, middle + pair.load))
        low, high = (middle, high) if taken < total else (low, middle)
    for c in range(a, b):
        pool[pairs[c].slot].load += low
    return True


@kernel
def kinetic_energy(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> float:
    """Return the kinetic energy in J of the group of pairs a … b-1 (bodies a … b).

    Velocities are relative to the wall of the group, or without a wall to the mass centre of the group.
    """
    v, energy, free = 0.0, 0.0, bodies[a].inverse_mass > 0.0
    if free:
        mass, momentum = 1.0 / bodies[a].inverse_mass, 0.0
        # velocities relative to body a
        for c in range(a, b):
            v -= pool[pairs[c].slot].eta
            if bodies[c + 1].inverse_mass > 0.0:
                mass += 1.0 / bodies[c + 1].inverse_mass
                momentum += v / bodies[c + 1].inverse_mass
        # velocity of body a in the frame of the mass centre, or of the wall b, which moves with v relative to body a
        v = -momentum / mass if bodies[b].inverse_mass > 0.0 else -v
        energy = 0.5 * v * v / bodies[a].inverse_mass
    for c in range(a, b):
        v -= pool[pairs[c].slot].eta
        if bodies[c + 1].inverse_mass > 0.0:
            energy += 0.5 * v * v / bodies[c + 1].inverse_mass
    return energy


@kernel
def static_overlap(pair: Any, load: float) -> float:
    """Return the static overlap in m of a pair under a load in N."""
    return power(load / pair.k, 1.0 / pair.p)


@kernel
def energy_above_rest(pair: Any, xi: float) -> float:
    """Return U(ξ) - U(ξ°) - F° (ξ - ξ°) in J for a pair at overlap `xi` in m.

    The load of the pair is F°, and ξ° is its static overlap.
    """
    rest = static_overlap(pair, pair.load)
    if pair.kind == LINEAR:
        return float(0.5 * pair.k * (xi - rest) * (xi - rest))
    stored = xi * power(xi, pair.p) - rest * power(rest, pair.p) if xi > 0.0 else -rest * power(rest, pair.p)
    return float(pair.k * stored / (pair.p + 1.0) - pair.load * (xi - rest))


@kernel
def smallest_vanishing_overlap(pair: Any) -> float:
    """Return the smallest overlap in m at which the force of a pair can fall to zero.

    It follows from the second condition in the module docstring. The result is 0 if that overlap does not exceed the
    static overlap, so that the condition has no effect.
    """
    exponent = 2.0 * pair.s - 1.0
    if pair.kind == ELASTIC or not (pair.gamma > 0.0 and pair.pull > 0.0 and exponent > 0.0):
        return 0.0
    ratio = pair.gamma / pair.k
    least = power(ratio * ratio * pair.pull / pair.s, 1.0 / exponent)
    return least if least > static_overlap(pair, pair.load) else 0.0


@kernel
def energy_of_vanishing_force(pair: Any, xi: float) -> float:
    """Return the energy in J of a pair whose force vanishes at overlap `xi` in m.

    It is relative to the equilibrium, and contains the energy ½ m_eff η² of the relative motion except at ξ = 0.
    """
    if xi == 0.0:
        return energy_above_rest(pair, 0.0)
    stiff = pair.k / pair.gamma / math.sqrt(pair.inverse)
    return float(energy_above_rest(pair, xi) + 0.5 * stiff * stiff * power(xi, 2.0 * pair.s))


@kernel
def energy_barrier(pair: Any) -> float:
    """Return the smallest energy in J at which the force of a pair can vanish.

    This is the barrier of the module docstring.
    """
    rest, least = static_overlap(pair, pair.load), smallest_vanishing_overlap(pair)
    if pair.kind == ELASTIC or pair.gamma == 0.0 or least > 0.0:
        return energy_of_vanishing_force(pair, least)
    stiff = pair.k / pair.gamma / math.sqrt(pair.inverse)
    low, high = 0.0, rest
    for _ in range(60):  # the sum is convex: bisect the sign of its slope, 2^-60 is below rounding
        xi = 0.5 * (low + high)
        slope = pair.k * power(xi, pair.p) - pair.load + stiff * stiff * pair.s * power(xi, 2.0 * pair.s - 1.0)
        low, high = (xi, high) if slope < 0.0 else (low, xi)
    return float(energy_above_rest(pair, high) + 0.5 * stiff * stiff * power(low, 2.0 * pair.s))

