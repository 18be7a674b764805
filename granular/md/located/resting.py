"""When a pile rests for good: a proof by energy that no contact can ever open again.

If every ball is in contact from the floor up, the energy about the static equilibrium (overlaps ξ°, forces F° > 0),

    E = Σ ½ m v² + Σ U(ξ) - U(ξ°) - F° (ξ - ξ°) ,

never grows. The force of pair c can only vanish where kξ^s + γη = 0, and the relative motion alone then has ½ m_eff η²,
so that it needs at least the least value on 0 ≤ ξ ≤ ξ° of

    U(ξ) - U(ξ°) - F° (ξ - ξ°) + ½ m_eff (k ξ^s / γ)² ,

F°²/(2 (k + γ²/m_eff)) for a dashpot; for γ = 0 it has to part, ξ = 0. Less energy than that in every contact: no force
vanishes forever after, hence nothing opens, hence nothing else can happen. The equilibrium is the same at every look:
loads are weights, and between two walls at rest the overlaps have a constant sum.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.powers import power
from granular.md.located.records import ACTIVE, ELASTIC, GENERAL, LINEAR, OPEN, ORDER

NOT_YET, RESTS, BOUND = range(3)
"""Verdicts: nothing proved; rests, with damping in every contact; bound forever, but not damped in every contact."""
STILL = 1e-14
"""Part of the static overlaps, and of their natural rates, up to which a pile that rests is taken to be still."""
LONG = 2.0**300
"""Scale in s of the piece of a pile that is still: longer than any run."""


@kernel
def verdict(run: Any, pairs: Any, pool: Any, bodies: Any, hi: int) -> int:
    """Return what is proved of the block of pairs 0 … hi-1; notes energy and barrier in the run's record."""
    if run.rests == 1:
        return RESTS
    piled = pile(pairs, pool, bodies, run.pairs, hi)
    if piled == 0:
        return NOT_YET
    if piled != run.piled:
        find_equilibrium(run, pairs, pool, bodies, piled)
    energy = kinetic(pairs, pool, bodies, piled)
    if energy >= run.opening:
        return NOT_YET
    load, damped = run.load, True
    for c in range(piled - 1, -1, -1):
        pair = pool[pairs[c].slot]
        load += weight(bodies[c + 1])
        energy += excess(pair, pair.xi, overlap_under(pair, load), load)
        damped = damped and pair.gamma > 0.0
    if energy >= run.opening:
        return NOT_YET
    if run.barrier == math.inf:
        run.barrier, load = run.opening, run.load
        for c in range(piled - 1, -1, -1):
            load += weight(bodies[c + 1])
            run.barrier = min(run.barrier, hurdle(pool[pairs[c].slot], load))
    run.energy = energy
    if energy >= (1.0 - 1e-9) * run.barrier:
        return NOT_YET
    run.rests = 1 if damped else 0
    return RESTS if damped else BOUND


@kernel
def find_equilibrium(run: Any, pairs: Any, pool: Any, bodies: Any, piled: int) -> None:
    """Note a pile, the force in N on its ceiling, and the least energy in J with which one of its pairs opens.

    That is without damping, where it has to part; a `hurdle` is lower.
    """
    load = squeeze(pairs, pool, bodies, piled) if bodies[piled].inverse_mass == 0.0 else 0.0
    run.piled, run.load, run.opening, run.barrier = piled, load, math.inf, math.inf
    for c in range(piled - 1, -1, -1):
        load += weight(bodies[c + 1])
        pair = pool[pairs[c].slot]
        run.opening = min(run.opening, excess(pair, 0.0, overlap_under(pair, load), load))


@kernel
def is_still(run: Any, pairs: Any, pool: Any, bodies: Any) -> bool:
    """Return whether a pile has come so near to its equilibrium that the difference is rounding."""
    load = run.load
    for c in range(run.piled - 1, -1, -1):
        pair = pool[pairs[c].slot]
        load += weight(bodies[c + 1])
        rest = overlap_under(pair, load)
        rate = math.sqrt(pair.k * pair.p * power(rest, pair.p) / rest * pair.inverse)
        if abs(pair.xi - rest) > STILL * rest or abs(pair.eta) > STILL * rest * rate:
            return False
    return True


@kernel
def lie(run: Any, pairs: Any, pool: Any, bodies: Any, hi: int, closing: float) -> None:
    """Put a pile that is still into its equilibrium, with a piece that has no end; walls close at `closing` m/s."""
    block, load = pool[pairs[0].slot], run.load
    block.clock, block.h, block.tau, block.fired = 1, LONG, math.inf, -1
    block.wait, pairs[0].due = math.inf, math.inf
    for c in range(hi - 1, -1, -1):
        pair = pool[pairs[c].slot]
        for j in range(ORDER + 1):
            pair.x[j], pair.e[j], pair.f[j], pair.g[j] = 0.0, 0.0, 0.0, 0.0
        pair.eta = closing
        if c < run.piled:
            load += weight(bodies[c + 1])
            pair.xi, pair.eta, pair.f[0], pair.g[0] = overlap_under(pair, load), 0.0, load, load
        pair.x[0], pair.x[1], pair.e[0] = pair.xi, LONG * pair.eta, pair.eta


@kernel
def pile(pairs: Any, pool: Any, bodies: Any, n: int, hi: int) -> int:
    """Return how many pairs from a floor up form a pile that holds every ball; 0 if they do not.

    Above it there may be a ceiling, out of reach and not coming down.
    """
    if bodies[0].inverse_mass > 0.0:
        return 0
    piled, reach = 0, 0.0
    while piled < hi and bears(pairs[piled], pool):
        reach += pool[pairs[piled].slot].xi
        piled += 1
    if piled == n:
        still = bodies[n].inverse_mass > 0.0 or bodies[n].v == bodies[0].v
        return n if still else 0
    if piled == 0 or piled < n - 1 or bodies[n].inverse_mass > 0.0:
        return 0
    above = pool[pairs[n - 1].slot]
    if above.mode != OPEN:
        return 0
    return piled if -above.xi > reach and bodies[n].v >= bodies[0].v else 0


@kernel
def bears(pair: Any, pool: Any) -> bool:
    """Return whether the force of a pair, a power law, can bear a ball now."""
    return bool(pair.slot >= 0 and pool[pair.slot].mode == ACTIVE and pool[pair.slot].kind != GENERAL)


@kernel
def weight(body: Any) -> float:
    """Return the weight of a ball in N, 0 for a wall."""
    return body.fall / body.inverse_mass if body.inverse_mass > 0.0 else 0.0


@kernel
def kinetic(pairs: Any, pool: Any, bodies: Any, piled: int) -> float:
    """Return the kinetic energy in J relative to the floor."""
    v, energy = 0.0, 0.0
    for c in range(piled):
        v -= pool[pairs[c].slot].eta
        if bodies[c + 1].inverse_mass > 0.0:
            energy += 0.5 * v * v / bodies[c + 1].inverse_mass
    return energy


@kernel
def squeeze(pairs: Any, pool: Any, bodies: Any, piled: int) -> float:
    """Return the force in N on the ceiling that closes a pile: the static overlaps must add up to those there are."""
    total = 0.0
    for c in range(piled):
        total += pool[pairs[c].slot].xi
    low, high = 0.0, 0.0
    for c in range(piled):
        pair = pool[pairs[c].slot]
        high = max(high, pair.k * power(total, pair.p))
    for _ in range(100):
        middle = 0.5 * (low + high)
        load, room = middle, total
        for c in range(piled - 1, -1, -1):
            load += weight(bodies[c + 1])
            room -= overlap_under(pool[pairs[c].slot], load)
        if room > 0.0:
            low = middle
        else:
            high = middle
    return low


@kernel
def overlap_under(pair: Any, load: float) -> float:
    """Return the static overlap in m under a load in N."""
    return power(load / pair.k, 1.0 / pair.p)


@kernel
def excess(pair: Any, xi: float, rest: float, load: float) -> float:
    """Return U(ξ) - U(ξ°) - F° (ξ - ξ°) in J."""
    if pair.kind == LINEAR:
        linear: float = 0.5 * pair.k * (xi - rest) * (xi - rest)
        return linear
    stored = xi * power(xi, pair.p) - rest * power(rest, pair.p) if xi > 0.0 else -rest * power(rest, pair.p)
    out: float = pair.k * stored / (pair.p + 1.0) - load * (xi - rest)
    return out


@kernel
def hurdle(pair: Any, load: float) -> float:
    """Return the least energy in J with which the force of a pair can vanish."""
    rest = overlap_under(pair, load)
    if pair.kind == ELASTIC or pair.gamma == 0.0:
        return excess(pair, 0.0, rest, load)
    stiff = pair.k / pair.gamma / math.sqrt(pair.inverse)
    low, high = 0.0, rest
    for _ in range(60):  # the sum is convex: halve by the sign of its slope
        xi = 0.5 * (low + high)
        slope = pair.k * power(xi, pair.p) - load + stiff * stiff * pair.s * power(xi, 2.0 * pair.s - 1.0)
        if slope < 0.0:
            low = xi
        else:
            high = xi
    least: float = excess(pair, high, rest, load) + 0.5 * stiff * stiff * power(low, 2.0 * pair.s)
    return least
