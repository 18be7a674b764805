"""Slow motion of strongly damped piles, as a power series on the scale of creep.

The rates of balls that are pressed against a wall decay within m/(γ ξ^d), and are soon below rounding error. The
remaining motion is creep at the rate k ξ^p/(γ ξ^d). During the whole creep, an ordinary series would need steps as
short as the decay time. The force of a pair is F = F° + Σ m a: its load plus the inertia of the balls beyond the pair.
With given forces,

    γ η = F ξ^(-d) - k ξ^s

is an equation of first order, whose series has steps as long as the time scale of creep. Its rates give the
accelerations a and thus the next forces. Each iteration reduces the error by the ratio of both time scales.

`examine_island` tests an island that is possibly at rest. It returns whether rest is proved, and computes the piece of
an island that lies still or creeps. The event loop stops for this test (`WANTS_REST_TEST`), so that this module is
compiled only when it is needed.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import kernel
from granular._engine.records import set_event_time
from granular.md.located.pieces import locate_event, piece_time, power, write_flight
from granular.md.located.records import (
    ACTIVE,
    CREEP_TESTED,
    CREEPS,
    DUE_TO_PLAN,
    LIES,
    MOVES,
    NEEDS_CREEP_TEST,
    RESIDUAL,
    REST_PIECE_SCALE,
    SERIES_ORDER,
)
from granular.md.located.rest.equilibrium import NOT_YET, RESTS, end_of_group, find_equilibrium
from granular.md.located.rest.proof import (
    MIN_CREEP_RATIO,
    gap_between_hulls,
    is_in_free_flight,
    is_overdamped,
    move_to_equilibrium,
    postpones_creep_test,
    prove_island,
    prove_scene,
    write_still_piece,
)
from granular.md.located.series import power_term
from granular.md.located.step_size import coefficient_growth, truncation_error, trusted_tau

CREEP_FORCE_SHARE = 0.1
"""Largest difference between force and load of a pair that creeps.

It is relative to the sum of load and elastic force. A larger difference means that the pair is still decelerating.
"""
MAX_CREEP_ITERATIONS = 60
"""Largest number of iterations of forces and rates in one piece."""
CONVERGED_FORCE_CHANGE = 2.0**-52
"""Change of a force, relative to its load, below which the iteration converged."""
FAST_MOTION_SHARE = 1e-13
"""Largest remaining rate of the fast motion of a pair that creeps.

It is relative to 2 F°/(γ ξ^d) + |η|. Ordinary steps leave a rate of this size.
"""


@kernel
def expand_creep(pairs: Any, pool: Any, bodies: Any, lo: int) -> bool:
    """Compute the series of an island whose pairs creep or fly, and its scale `h`.

    `lo` is the first pair of the island. `h` in s is the scale of its piece. Returns False if a pair moves in another
    way, or if no group limits `h`.
    """
    block, hi, h, c = pool[pairs[lo].slot], pairs[lo].hi, math.inf, lo
    while c < hi:
        if pool[pairs[c].slot].mode == ACTIVE and not is_overdamped(pool[pairs[c].slot]):
            return False
        b = end_of_group(pairs, pool, c)
        if pairs[c].wall != 0 or (b == c and not is_in_free_flight(pool[pairs[c].slot])):
            return False
        if b > c:
            h = min(h, creep_time(pairs, pool, bodies, c, b))
        if not h > 0.0:
            return False
        c = max(b, c + 1)
    block.clock, block.h, c = 1, h, lo
    while c < hi:
        b = end_of_group(pairs, pool, c)
        if b > c and not solve_creep(pairs, pool, bodies, c, b, h):
            return False
        c = max(b, c + 1)
    block.speed, block.length = 0.0, 0.0
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.mode != ACTIVE:
            write_flight_between_groups(pairs, pool, bodies, lo, c, h)
        block.speed, block.length = max(block.speed, pair.own_speed), max(block.length, pair.own_length)
    return h < math.inf


@kernel
def creep_time(pairs: Any, pool: Any, bodies: Any, a: int, b: int) -> float:
    """Return the shortest time scale in s of creep in the group a … b-1.

    It is 0 if the group does not creep yet. `own_speed` and `own_length` of its pairs are set.
    """
    shortest = math.inf
    closed = bodies[a].inverse_mass == 0.0 and bodies[b].inverse_mass == 0.0
    find_equilibrium(pairs, pool, bodies, a, b)
    for c in range(a, b):
        pair = pool[pairs[c].slot]
        if not (pair.gamma > 0.0 and pair.load > 0.0 and pair.xi > 0.0):
            return 0.0
        drag = pair.gamma * power(pair.xi, pair.d)
        push = pair.k * power(pair.xi, pair.p)
        time = drag * pair.xi / (pair.load + push)
        if not drag * pair.inverse * time > MIN_CREEP_RATIO or not (
            closed or is_near_load(pair.load, push, drag * pair.eta)
        ):
            return 0.0
        pair.own_speed, pair.own_length = pair.load / drag, pair.xi
        shortest = min(shortest, time)
    return shortest


@kernel
def is_near_load(load: float, push: float, damping: float) -> bool:
    """Return whether the force of a pair, elastic plus damping, is nearly its load.

    `load`, the elastic force `push` and the damping force `damping` are in N.
    """
    return abs(push + damping - load) <= CREEP_FORCE_SHARE * (load + push)


@kernel
def solve_creep(pairs: Any, pool: Any, bodies: Any, a: int, b: int, h: float) -> bool:
    """Compute the series of a creeping group a … b-1 by iteration.

    `h` is the scale of the piece in s. Returns False if the iteration does not converge, or if the fast motion has not
    decayed.
    """
    first, last = pool[pairs[a].slot], math.inf
    for n in range(SERIES_ORDER + 1):
        first.zm[n] = 0.0
        for c in range(a, b):
            pool[pairs[c].slot].f[n] = pool[pairs[c].slot].load if n == 0 else 0.0
    for _ in range(MAX_CREEP_ITERATIONS):
        update_creep_motion(pairs, pool, bodies, a, b, h)
        change = update_creep_forces(pairs, pool, bodies, a, b, h)
        for c in range(a, b):  # the remaining fast motion must be within reach of the next iteration
            pair = pool[pairs[c].slot]
            allowed = max(10.0 * change * pair.own_speed, FAST_MOTION_SHARE * (2.0 * pair.own_speed + abs(pair.eta)))
            if abs(pair.e[0] - pair.eta) > allowed:
                return False
        if change <= CONVERGED_FORCE_CHANGE:
            for c in range(a, b):
                pool[pairs[c].slot].eta = pool[pairs[c].slot].e[0]
            return True
        if not change < last:
            return False
        last = change
    return False


@kernel
def update_creep_motion(pairs: Any, pool: Any, bodies: Any, a: int, b: int, h: float) -> None:
    """Compute overlaps, rates and brackets of the group a … b-1 from its forces.

    The bracket is φ = kξ^s + γη. Between two walls the sum of the rates is 0. A common force is therefore added to all
    forces. Its series is stored in `zm` of the first pair.
    """
    closed, first = bodies[a].inverse_mass == 0.0 and bodies[b].inverse_mass == 0.0, pool[pairs[a].slot]
    for n in range(SERIES_ORDER + 1):
        total, ease = 0.0, 0.0
        for c in range(a, b):
            pair = pool[pairs[c].slot]
            set_creep_term(pair, n, h)
            total += pair.e[n]
            ease += power(pair.xi, -pair.d) / pair.gamma
        if closed:
            first.zm[n] -= total / ease
            for c in range(a, b):
                pair = pool[pairs[c].slot]
                phi = total / ease * power(pair.xi, -pair.d)
                pair.f[n] -= total / ease
                pair.g[n] -= phi
                pair.e[n] -= phi / pair.gamma


@kernel
def set_creep_term(pair: Any, n: int, h: float) -> None:
    """Compute coefficient n of overlap, rate and bracket φ of a pair from its force."""
    pair.x[n] = h / n * pair.e[n - 1] if n > 0 else pair.xi
    phi, bent = pair.f[n], pair.x[n]
    if pair.d != 0.0:
        power_term(pair.x, pair.r, -pair.d, n, 0)
        phi = 0.0
        for j in range(n + 1):
            phi += pair.f[j] * pair.r[n - j]
    if pair.s != 1.0:
        power_term(pair.x, pair.z, pair.s, n, 0)
        bent = pair.z[n]
    pair.g[n], pair.e[n] = phi, (phi - pair.k * bent) / pair.gamma


@kernel
def update_creep_forces(pairs: Any, pool: Any, bodies: Any, a: int, b: int, h: float) -> float:
    """Compute the forces of the group a … b-1 from its rates: loads plus inertia.

    Returns the largest change of a coefficient relative to the load of its pair.
    """
    first, worst = pool[pairs[a].slot], 0.0
    floor, ceiling = bodies[a].inverse_mass == 0.0, bodies[b].inverse_mass == 0.0
    mass = 0.0 if floor else 1.0 / first.lower
    for c in range(a, b if not (floor or ceiling) else a):
        mass += 1.0 / pool[pairs[c].slot].upper
    for n in range(SERIES_ORDER):
        push, moved = 0.0, 0.0  # acceleration of the upper ball, as the lowest body of the group sees it
        for c in range(a, b):
            pair = pool[pairs[c].slot]
            push -= (n + 1) / h * pair.e[n + 1]
            pair.gm[n] = push
            moved += push / pair.upper if pair.upper > 0.0 else 0.0
        frame = 0.0 if floor else push if ceiling else moved / mass
        force = first.zm[n]
        for i in range(b - a):
            pair = pool[pairs[a + i if ceiling and not floor else b - 1 - i].slot]
            if ceiling and not floor:
                force -= ((0.0 if i == 0 else pool[pairs[a + i - 1].slot].gm[n]) - frame) / pair.lower
            elif pair.upper > 0.0:
                force += (pair.gm[n] - frame) / pair.upper
            now = pair.load + force if n == 0 else force
            worst = max(worst, abs(now - pair.f[n]) / pair.load)
            pair.f[n] = now
    return worst


@kernel
def write_flight_between_groups(pairs: Any, pool: Any, bodies: Any, lo: int, c: int, h: float) -> None:
    """Compute the series of pair `c`, which has no force, between two groups.

    A single ball or a wall can take the place of a group. The hulls on both sides of the pair fly freely, and the
    overlaps of the groups change the gap between them. Integrating the forces in these groups would accumulate their
    rounding errors.
    """
    pair, (_, rate, pull) = pool[pairs[c].slot], gap_between_hulls(pairs, pool, bodies, lo, c)
    write_flight(pair, h, pull, 0.0)
    pair.x[1], pair.e[0] = -h * rate, -rate
    for direction in (-1, 1):
        subtract_group(pairs, pool, bodies, pair, c, direction)
    pair.eta = pair.e[0]
    for n in range(SERIES_ORDER + 1 if pair.mode == RESIDUAL else 0):
        pair.g[n] = 0.0 if n == 0 and pair.exact else pair.k * pair.x[n] + pair.gamma * pair.e[n]
    pair.own_speed = max(abs(pair.eta), abs(pair.e[1]))
    pair.own_length = h * pair.own_speed


@kernel
def subtract_group(pairs: Any, pool: Any, bodies: Any, pair: Any, c: int, direction: int) -> None:
    """Subtract overlaps and rates of a neighbouring group from the series of a pair.

    The group is below (`direction` -1) or above (1) the pair with number `c`. For a group without a wall, each overlap
    is weighted with the mass fraction of the balls beyond it.
    """
    f = c + direction
    while 0 <= f < len(pairs) and pairs[f].slot >= 0 and pool[pairs[f].slot].mode == ACTIVE:
        f += direction
    # index of a body: pair f joins bodies f and f + 1
    last = f + 1 if direction < 0 else f  # the outermost body
    at_wall, mass, total = bodies[last].inverse_mass == 0.0, 0.0, 1.0
    if not at_wall:
        total = 0.0
        for i in range(abs(f - c)):
            total += 1.0 / bodies[last - direction * i].inverse_mass
    for i in range(abs(f - c) - 1):
        beyond = pool[pairs[f - direction * (i + 1)].slot]
        mass += 0.0 if at_wall else 1.0 / bodies[last - direction * i].inverse_mass
        share = 1.0 if at_wall else mass / total
        for n in range(SERIES_ORDER + 1):
            pair.e[n] -= share * beyond.e[n]
            if n > 0:
                pair.x[n] -= share * beyond.x[n]


@kernel
def examine_island(s: Any, limit: float) -> int:
    """Test the current island for rest and creep, and return whether the run can end.

    `limit` is the end time of the run. Returns RESTS or BOUND of `equilibrium` if the run has no end time and the whole
    scene is proved to stay as it is, else NOT_YET. With NOT_YET, the manner of the island is known: if it lies still
    (LIES) or creeps (CREEPS), its next piece is computed here. If not (CREEP_TESTED), its first pair is due for `plan`,
    which computes an ordinary piece.
    """
    run, pairs, pool, bodies, lo = s.run[0], s.pairs, s.pool, s.bodies, s.run[0].lo
    block = pool[pairs[lo].slot]
    if block.manner != NEEDS_CREEP_TEST:  # else it is tested for creep only
        # `run.rests` is 1 if rest was proved before for the whole scene
        proved = RESTS if run.rests == 1 else prove_island(pairs, pool, bodies, lo)
        if proved != NOT_YET and run.rests == 0:
            scene_proof = prove_scene(run, pairs, pool, bodies)
            if scene_proof != NOT_YET and limit == math.inf:
                return scene_proof
        if proved == RESTS and block.manner != LIES:
            move_to_equilibrium(pairs, pool, bodies, lo)
        run.steps += 1
    if block.manner == MOVES and postpones_creep_test(pairs, pool, lo):
        block.manner = CREEP_TESTED  # a step of the ordinary motion comes first
    elif block.manner != LIES:
        block.manner = CREEPS if expand_creep(pairs, pool, bodies, lo) else CREEP_TESTED
    pairs[lo].due = DUE_TO_PLAN
    if block.manner != CREEP_TESTED:
        write_piece(s, lo)
    set_event_time(s.queue, lo, pairs[lo].due)
    return NOT_YET


@kernel
def write_piece(s: Any, lo: int) -> None:
    """Compute the piece of an island that lies still or creeps, and its final event.

    `lo` is the first pair of the island. The series of a creeping island is already known.
    """
    run, pairs, pool, worst, span = s.run[0], s.pairs, s.pool, -math.inf, 1.0
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    block.linear, block.clock = 1 if block.manner == LIES else 0, 1
    if block.manner == LIES:
        write_still_piece(pairs, pool, s.bodies, lo)
    else:
        worst = coefficient_growth(pairs, pool, lo, hi, run.tol)
        span = trusted_tau(worst, run.tol)
    locate_event(pairs, pool, lo, hi, span, s.scratch, None)
    run.error += truncation_error(worst, block.tau)
    pairs[lo].due = block.t + (piece_time(block) + block.tail)
    if block.h >= REST_PIECE_SCALE:
        pairs[lo].due = math.inf
