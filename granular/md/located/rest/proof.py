"""Proof that a scene rests permanently: no contact can end, and none can begin.

The event loop first calls the cheap tests `may_rest` and `may_creep`. They never exclude an island that could be proved
to rest or to creep. The proofs are needed rarely, and are compiled only then.

Every ball must be in a group whose contacts never end (`equilibrium`), or in free flight, and no gap can ever close.
The balls of a group never move beyond its *hull*: its outermost surface for overlaps of 0, as seen from its wall or its
mass centre. Wall and mass centre have a constant acceleration, like a ball in flight, so the gap between two hulls is a
parabola.

A group that has reached its equilibrium, except for rounding errors, is moved to the equilibrium. It then lies still
until a ball hits it.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.flight import time_to_contact
from granular._engine.kernels import kernel
from granular.md.located.pieces import in_contact, power, time_since, write_flight
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, LIES, LINEAR, MOVES, OPEN, RESIDUAL, REST_PIECE_SCALE
from granular.md.located.rest.equilibrium import (
    NOT_YET,
    RESTS,
    end_of_group,
    has_stored_equilibrium,
    kinetic_energy,
    prove_group,
    static_overlap,
    weight,
)

STILL_DEVIATION = 1e-14
"""Relative deviation from the equilibrium up to which a resting pile is still.

Overlaps are compared with the static overlap, rates with the static overlap times its natural frequency.
"""
MIN_CREEP_RATIO = 12.0
"""Smallest ratio of the times of creep and fast decay for the creep series.

Above it the series converges and saves steps.
"""


@kernel
def may_rest(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int, limit: float) -> bool:
    """Return whether to test an island for rest, after a piece without an event.

    `lo` is the first pair of the island, and `limit` the end time of the run. True is returned if the island already
    lies still or creeps. False means that a proof would certainly fail, or would not be useful now.
    """
    if pool[pairs[lo].slot].manner != MOVES:
        return True  # already lying or creeping
    if run.rests == 1:
        return is_still(pairs, pool, lo)  # proved before
    c, active, known, damped = lo, False, True, True
    while c < pairs[lo].hi:
        pair, b = pool[pairs[c].slot], end_of_group(pairs, pool, c)
        if b == c and pair.mode != OPEN:
            return False  # touches without a force
        if b > c:
            if exceeds_barrier(pairs, pool, bodies, c, b):
                return False  # too much energy
            active, known = True, known and has_stored_equilibrium(pairs, pool, c, b)
            for i in range(c, b):
                damped = damped and pool[pairs[i].slot].gamma > 0.0
        c = max(b, c + 1)
    if not active or pairs[0].wall != 0 or pairs[len(pairs) - 1].wall != 0:
        return False  # nothing presses, or a wall moves
    doubted_block = pairs[pairs[run.doubted].first]
    has_event_due = doubted_block.slot < 0 and doubted_block.due < math.inf
    if not known or ((damped or limit == math.inf) and not has_event_due):
        return True
    # undamped in a run with an end, or an event of the island in doubt is still due
    return bool(damped and is_still(pairs, pool, lo))


@kernel
def exceeds_barrier(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> bool:
    """Return whether the group a … b-1 certainly has too much energy for a proof.

    Relative to its equilibrium the energy of a group is its kinetic energy plus Σ D(ξ_c, r_c). Here D(ξ, r) = U(ξ) -
    U(r) - U'(r) (ξ - r), and r_c are its overlaps at rest. Smaller r_c give more energy, and r_c is at most the overlap
    under the whole weight of the group. The sum with the largest possible r_c is a lower bound of the energy. It is
    compared with an upper bound of the barrier.
    """
    energy = kinetic_energy(pairs, pool, bodies, a, b)
    if has_stored_equilibrium(pairs, pool, a, b):
        return not energy < pool[pairs[a].slot].opening
    # between two walls the weights do not bound the loads
    if bodies[a].inverse_mass == 0.0 and bodies[b].inverse_mass == 0.0:
        return not energy < math.inf
    # 1.001 here and 0.999 in `energy_bound` are margins, so that the bounds hold despite rounding errors
    load, barrier, is_pressed = abs(weight(bodies[a])), math.inf, False
    for c in range(a, b):
        load += abs(weight(bodies[c + 1]))
        is_pressed = is_pressed or pairs[c].pull > 0.0
    for c in range(a, b if is_pressed else a):
        pair = pool[pairs[c].slot]
        barrier = min(barrier, barrier_bound(pair, 1.001 * load))
        if not energy < barrier:
            return True  # most frequent: later terms only increase the energy and lower the bound
        energy += energy_bound(pair, 1.001 * load)
    return not energy < (barrier if is_pressed else 0.0)


@kernel
def energy_bound(pair: Any, load: float) -> float:
    """Return a lower bound in J of D(ξ, r) of a pair, see `exceeds_barrier`.

    The load of the pair is at most `load` in N.
    """
    if pair.kind == GENERAL or not pair.k > 0.0:
        return 0.0
    rest = static_overlap(pair, load)
    if not pair.xi > 1.001 * rest:
        return 0.0
    p = pair.p + 1.0
    deeper = pair.k / p * (power(pair.xi, p) - power(rest, p)) - load * (pair.xi - rest)
    return float(max(0.0, 0.999 * deeper))


@kernel
def barrier_bound(pair: Any, load: float) -> float:
    """Return an upper bound in J of the energy barrier of a pair (see `equilibrium`).

    The load of the pair is at most `load` in N. At ξ = 0 the energy is at most F° ξ°, which is at most `load` times the
    static overlap under `load`. If the second condition applies, ξ is at least `turn`, where ξ^(2s-1) = γ² G / (s k²).
    The energy there is at most k turn^(p+1) + m_eff G turn / s. The result is the larger of the two bounds. It is 0 for
    a law without a power form.
    """
    if pair.kind == GENERAL or not pair.k > 0.0:
        return 0.0
    rest, exponent, most = static_overlap(pair, load), 2.0 * pair.s - 1.0, 0.0
    if pair.kind != ELASTIC and pair.gamma > 0.0 and pair.pull > 0.0 and exponent > 0.0:
        ratio = pair.gamma / pair.k
        turn = power(ratio * ratio * pair.pull / pair.s, 1.0 / exponent)
        most = pair.k * power(turn, pair.p) * turn + pair.pull * turn / (pair.s * pair.inverse)
    return float(max(load * rest, most))


@kernel
def is_still(pairs: Any, pool: Any, lo: int) -> bool:
    """Return whether the groups of an island are at their stored equilibrium.

    Deviations up to `STILL_DEVIATION` are rounding errors. `lo` is the first pair of the island.
    """
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            rest = static_overlap(pair, pair.load)
            rate = math.sqrt(pair.k * pair.p * power(rest, pair.p) / rest * pair.inverse)
            if abs(pair.xi - rest) > STILL_DEVIATION * rest or abs(pair.eta) > STILL_DEVIATION * rest * rate:
                return False
        elif not pair.xi < 0.0:
            return False
    return True


@kernel
def may_creep(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Return whether the pairs of an island can creep, that is, move without inertia.

    Every pair must be in free flight or strongly damped, and none can be at a driven or thermal wall. At least one pair
    must be in contact. Gravity must press at least one pair, or both end bodies must be walls.
    """
    hi, active = pairs[lo].hi, False
    pressed = bodies[lo].inverse_mass == 0.0 and bodies[hi].inverse_mass == 0.0
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        active, pressed = active or pair.mode == ACTIVE, pressed or pair.pull > 0.0
        if pairs[c].wall != 0 or not (is_overdamped(pair) if pair.mode == ACTIVE else is_in_free_flight(pair)):
            return False
    return bool(active and pressed)


@kernel
def postpones_creep_test(pairs: Any, pool: Any, lo: int) -> bool:
    """Return whether an ordinary step precedes the test of an island for creep.

    This is only the case if all pairs are linear. The fast motion of n balls takes about n² times as many steps to
    decay as the motion of one ball. A test costs as much as ten steps. After k steps only one step in 1 + √k/4 is
    followed by a test, so creep is detected at most about √k/4 steps late. The function counts the steps.
    """
    for c in range(lo, pairs[lo].hi):
        if pool[pairs[c].slot].kind != LINEAR:
            return False
    block = pool[pairs[lo].slot]
    block.doubts += 1
    return bool(block.doubts % (1 + int(0.25 * math.sqrt(block.doubts))) != 0)


@kernel
def is_overdamped(pair: Any) -> bool:
    """Return whether a pair without load is damped strongly enough for creep.

    The damping is taken at its current overlap. A pair under a load requires a stronger damping.
    """
    if pair.kind == GENERAL or not (pair.gamma > 0.0 and pair.xi > 0.0):
        return False
    depth, exponent = 1.0, pair.d + 1.0 - pair.s
    if exponent != 0.0:
        depth = power(pair.xi, exponent)
    return bool(pair.gamma * pair.gamma * pair.inverse * depth > MIN_CREEP_RATIO * pair.k)


@kernel
def is_in_free_flight(pair: Any) -> bool:
    """Return whether a pair has no force, and a closed form for the return time.

    The return time is the time at which the force returns. Both hold for open pairs, and for residual pairs whose law
    has the exponent s = 1 (force zero at kξ + γη = 0).
    """
    return bool(pair.mode == OPEN or (pair.mode == RESIDUAL and pair.s == 1.0))


@kernel
def prove_island(pairs: Any, pool: Any, bodies: Any, lo: int) -> int:
    """Try to prove that no contact of the island that starts with pair `lo` can end.

    Returns RESTS, BOUND or NOT_YET of `equilibrium`. The proof holds as long as no other ball hits the island. In a
    scene with a driven or thermal wall the result is NOT_YET.
    """
    c, proved = lo, NOT_YET
    if pairs[0].wall != 0 or pairs[len(pairs) - 1].wall != 0:
        return NOT_YET
    while c < pairs[lo].hi:
        mode, b = pool[pairs[c].slot].mode, c + 1
        if mode == ACTIVE:
            b = end_of_group(pairs, pool, c)
            group_proof = prove_group(pairs, pool, bodies, c, b)
            if group_proof == NOT_YET:
                return NOT_YET
            proved = max(proved, group_proof)
        elif mode != OPEN:
            return NOT_YET
        c = b
    return proved


@kernel
def prove_scene(run: Any, pairs: Any, pool: Any, bodies: Any) -> int:
    """Try to prove that no contact of the scene can end, and that no gap can close.

    Returns NOT_YET without a proof, RESTS if all balls come to rest, or BOUND if all contacts are permanent but not all
    are damped. Energy and barrier of the group with the largest ratio energy/barrier are stored in the record of the
    run. The search starts at the island at which the previous proof failed.
    """
    n, scene_proof, run.energy, run.barrier = len(pairs), RESTS, 0.0, math.inf
    c = start = pairs[run.doubted].first
    while True:
        island_proof = RESTS
        if pairs[c].slot >= 0:
            island_proof = prove_island(pairs, pool, bodies, c)
        if island_proof == NOT_YET or can_close(run, pairs, pool, bodies, c):
            run.doubted = c
            return NOT_YET
        store_nearest_group(run, pairs, pool, c)
        scene_proof = max(scene_proof, island_proof)  # RESTS < BOUND: one undamped island is enough for BOUND
        c = pairs[c].hi % n
        if c == start:
            break
    run.rests = 1 if scene_proof == RESTS else 0
    return scene_proof


@kernel
def store_nearest_group(run: Any, pairs: Any, pool: Any, lo: int) -> None:
    """Store energy and barrier of the group with the largest ratio energy/barrier.

    The groups of the island that starts with pair `lo` are compared with the values stored in the record of the run.
    """
    for c in range(lo, pairs[lo].hi if pairs[lo].slot >= 0 else lo):
        pair = pool[pairs[c].slot]
        heads = pair.mode == ACTIVE and (c == lo or pool[pairs[c - 1].slot].mode != ACTIVE)
        # the first group is always stored: an energy of 0 times the initial barrier inf would be nan
        if heads and (run.barrier == math.inf or pair.energy * run.barrier >= run.energy * pair.barrier):
            run.energy, run.barrier = pair.energy, pair.barrier


@kernel
def can_close(run: Any, pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Return whether a gap of the block that starts with pair `lo` can ever close.

    Gaps between the hulls of groups are tested. A gap that is 0 now counts as closing.
    """
    if pairs[lo].slot < 0:
        return bool(pairs[lo].due < math.inf or in_contact(pairs[lo], run.t, run.tail))
    for c in range(lo, pairs[lo].hi):
        if pool[pairs[c].slot].mode == OPEN:
            gap, rate, pull = gap_between_hulls(pairs, pool, bodies, lo, c)
            if not (gap > 0.0 and time_to_contact(gap, rate, pull) == math.inf):
                return True
    return False


@kernel
def gap_between_hulls(pairs: Any, pool: Any, bodies: Any, lo: int, c: int) -> tuple[float, float, float]:
    """Return gap, rate and closing acceleration of the hulls next to open pair `c`.

    They are in m, m/s and m/s². `lo` is the first pair of the island.
    """
    block = pool[pairs[lo].slot]
    inner, v_lower, fall_lower, size_lower = hull(pairs, pool, bodies, block, c, -1)
    outer, v_upper, fall_upper, size_upper = hull(pairs, pool, bodies, block, c, 1)
    pull = fall_upper - fall_lower
    # a difference of equal falls is only rounding error, and must not close the gap
    if abs(pull) <= STILL_DEVIATION * max(size_lower, size_upper):
        pull = 0.0
    return -pool[pairs[c].slot].xi - inner - outer, v_upper - v_lower, pull


@kernel
def hull(pairs: Any, pool: Any, bodies: Any, block: Any, c: int, direction: int) -> tuple[float, float, float, float]:
    """Return the hull of the group, ball or wall on one side of the open pair `c`.

    `direction` is -1 for the lower side and 1 for the upper side.

    Returns
    -------
    reach, v, fall, size : float
        Distance in m from the current surface to the hull, velocity in m/s and downward acceleration in m/s² of the
        wall or mass centre. `size` is the mean magnitude of the accelerations in m/s², for a bound of rounding errors.
    """
    first = c if direction < 0 else c + 1
    b, f = first, c + direction
    while 0 <= f < len(pairs) and pairs[f].slot >= 0 and pool[pairs[f].slot].mode == ACTIVE:
        b, f = b + direction, f + direction
    if bodies[b].inverse_mass == 0.0:
        reach = 0.0
        for i in range(abs(b - first)):
            reach += pool[pairs[c + direction * (i + 1)].slot].xi
        return reach, float(bodies[b].v), 0.0, 0.0
    if b == first:
        body = bodies[b]
        return 0.0, float(body.v - body.fall * time_since(body, block.t, block.tail)), float(body.fall), 0.0
    mass = momentum = falls = size = reach = 0.0
    for i in range(abs(b - first) + 1):
        body = bodies[b - direction * i]
        own = 1.0 / body.inverse_mass
        mass += own
        momentum += own * (body.v - body.fall * time_since(body, block.t, block.tail))
        falls += own * body.fall
        size += own * abs(body.fall)
        if b - direction * i != first:  # the pair towards the open one
            reach += mass * pool[pairs[f - direction * (i + 1)].slot].xi
    return reach / mass, momentum / mass, falls / mass, size / mass


@kernel
def move_to_equilibrium(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Move the groups of an island to their equilibrium if the difference is rounding.

    Returns whether they were moved. The groups of the island that starts with pair `lo` then lie still.
    """
    if not is_still(pairs, pool, lo):
        return False
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            pair.xi, pair.eta = static_overlap(pair, pair.load), 0.0
        else:
            pair.eta = -gap_between_hulls(pairs, pool, bodies, lo, c)[1]
    pool[pairs[lo].slot].manner = LIES
    return True


@kernel
def write_still_piece(pairs: Any, pool: Any, bodies: Any, lo: int) -> None:
    """Compute the series of an island whose groups lie still, and its scale `h`.

    `lo` is the first pair of the island. The scale in s is longer than any run, or twice the time to the next touch of
    an open pair in the island.
    """
    block = pool[pairs[lo].slot]
    block.clock, block.linear, block.h = 1, 1, REST_PIECE_SCALE
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == OPEN:
            pull = gap_between_hulls(pairs, pool, bodies, lo, c)[2]
            block.h = min(block.h, 2.0 * time_to_contact(max(0.0, -pair.xi), -pair.eta, pull))
    for c in range(lo, pairs[lo].hi):
        pair = pool[pairs[c].slot]
        if pair.mode == ACTIVE:
            write_flight(pair, block.h, 0.0, pair.load)
        else:
            write_flight(pair, block.h, gap_between_hulls(pairs, pool, bodies, lo, c)[2], 0.0)

