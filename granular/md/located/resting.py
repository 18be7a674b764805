"""When a pile rests for good: a proof by energy that no contact can ever open again.
May be skipped: rarer, piles that come to rest.

If every ball is in contact from the floor up, the energy about the static equilibrium (overlaps ξ°, forces F° > 0),

    E = Σ ½ m v² + Σ U(ξ) - U(ξ°) - F° (ξ - ξ°) ,

never grows. The force of pair c can only vanish where kξ^s + γη = 0, and the relative motion alone then has ½ m_eff η²,
so that it needs at least the least value on 0 ≤ ξ ≤ ξ° of

    U(ξ) - U(ξ°) - F° (ξ - ξ°) + ½ m_eff (k ξ^s / γ)² ,

F°²/(2 (k + γ²/m_eff)) for a dashpot; for γ = 0 it has to part, ξ = 0. Less energy than that in every contact: no force
vanishes forever after, hence nothing opens, hence nothing else can happen. The equilibrium is the same at every look:
loads are weights, and between two walls at rest the overlaps have a constant sum.

Of a law that is a function it can only be seen that every force balances to rounding, at rest, and grows with the
overlap. Then the balls stay where they are, until one arrives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._flight import time_to_contact
from granular._kernels import kernel
from granular.md.located.pieces import power, write_flight
from granular.md.located.system import ACTIVE, ELASTIC, GENERAL, LINEAR, OPEN

NOT_YET, RESTS, BOUND = range(3)
"""Verdicts: nothing proved; rests, with damping in every contact; bound forever, but not damped in every contact."""
STILL = 1e-14
"""Part of the static overlaps, and of their natural rates, up to which a pile that rests is taken to be still."""
LONG = 2.0**300
"""Scale in s of the piece of a pile that is still: longer than any run."""
AtRest = Callable[[Any, float], float]
"""Force in N of a pair at an overlap in m."""
TANGENT = 1e-6
"""Part of an overlap over which its stiffness is taken."""
ROUNDING = 1e-11
"""Part of the accelerations of a pair, and of its block's speed, up to which their sum, and its rate, is rounding."""


@kernel
def verdict(run: Any, pairs: Any, pool: Any, bodies: Any, hi: int) -> int:
    """Return what is proved of the block of pairs 0 … hi-1; notes energy and barrier in the run's record."""
    if run.rests == 1:
        return RESTS
    piled = pile(pairs, pool, bodies, hi)
    if piled == 0:
        return NOT_YET
    if piled != run.piled:
        find_equilibrium(run, pairs, pool, bodies, piled)
    energy, damped = kinetic(pairs, pool, bodies, piled), 1
    if energy >= run.opening:
        return NOT_YET
    for c in range(piled - 1, -1, -1):
        pair, load = pool[pairs[c].slot], static_load(run, bodies, c)
        energy += excess(pair, pair.xi, overlap_under(pair, load), load)
        damped = damped if pair.gamma > 0.0 else 0
    if run.barrier == math.inf:
        run.barrier = run.opening
        for c in range(piled):
            run.barrier = min(run.barrier, hurdle(pool[pairs[c].slot], static_load(run, bodies, c)))
    run.energy = energy
    if energy >= (1.0 - 1e-9) * run.barrier:
        return NOT_YET
    run.rests = damped
    return RESTS if damped == 1 else BOUND


@kernel
def static_load(run: Any, bodies: Any, c: int) -> float:
    """Return the force in N that pair `c` of a pile bears at rest: the weight above it, and what a ceiling adds."""
    return float(run.load + bodies[c + 1].load)


@kernel
def find_equilibrium(run: Any, pairs: Any, pool: Any, bodies: Any, piled: int) -> None:
    """Note a pile, the force in N on its ceiling, and the least energy in J with which one of its pairs opens.

    That is without damping, where it has to part; a `hurdle` is lower.
    """
    run.piled, run.opening, run.barrier = piled, math.inf, math.inf
    run.load = squeeze(pairs, pool, bodies, piled) if bodies[piled].inverse_mass == 0.0 else 0.0
    for c in range(piled):
        pair, load = pool[pairs[c].slot], static_load(run, bodies, c)
        run.opening = min(run.opening, excess(pair, 0.0, overlap_under(pair, load), load))


@kernel
def lies(run: Any, pairs: Any, pool: Any, bodies: Any, hi: int) -> bool:
    """Return whether a pile is so near to its equilibrium that the difference is rounding; if so, put it there.

    Its piece has no end; a wall above it may move on.
    """
    block = pool[pairs[0].slot]
    for c in range(run.piled):
        pair = pool[pairs[c].slot]
        rest = overlap_under(pair, static_load(run, bodies, c))
        rate = math.sqrt(pair.k * pair.p * power(rest, pair.p) / rest * pair.inverse)
        if abs(pair.xi - rest) > STILL * rest or abs(pair.eta) > STILL * rest * rate:
            return False
    block.clock, block.h, block.tau, block.fired, pairs[0].due = 1, LONG, math.inf, -1, math.inf
    for c in range(hi):
        pair, load = pool[pairs[c].slot], 0.0
        pair.eta = bodies[0].v - bodies[hi].v
        if c < run.piled:
            load = static_load(run, bodies, c)
            pair.xi, pair.eta = overlap_under(pair, load), 0.0
        write_flight(pair, LONG, 0.0, load)
    return True


@kernel
def pile(pairs: Any, pool: Any, bodies: Any, hi: int) -> int:
    """Return how many pairs from a floor up form a pile that holds every ball, in a block 0 … hi-1; 0 if they do not.

    Above it there may be a ceiling, out of reach and not coming down. Without walls the pile may hold together by
    forces on its balls. Every load must press, and no wall be driven or thermal.
    """
    piled, reach, n = 0, 0.0, len(pairs)
    if pairs[0].slot < 0 or pairs[0].wall != 0 or pairs[n - 1].wall != 0:
        return 0
    free = bodies[0].inverse_mass > 0.0
    if free and (hi < n or bodies[n].inverse_mass == 0.0):
        return 0
    for c in range(hi):
        if bodies[c + 1].load < 0.0 or (free and bodies[c + 1].load == 0.0):
            return 0
    while piled < hi and pool[pairs[piled].slot].mode == ACTIVE and pool[pairs[piled].slot].kind != GENERAL:
        reach += pool[pairs[piled].slot].xi
        piled += 1
    if piled < n and free:
        return 0
    if piled == n:
        return n if bodies[n].inverse_mass > 0.0 or bodies[n].v == bodies[0].v else 0
    if piled == 0 or piled < n - 1 or bodies[n].inverse_mass > 0.0:
        return 0
    above = pool[pairs[piled].slot]
    return piled if above.mode == OPEN and -above.xi > reach and bodies[n].v >= bodies[0].v else 0


@kernel
def kinetic(pairs: Any, pool: Any, bodies: Any, piled: int) -> float:
    """Return the kinetic energy in J relative to the floor, or, without, to the mass centre."""
    v, energy = 0.0, 0.0
    if bodies[0].inverse_mass > 0.0:
        mass, momentum = 1.0 / bodies[0].inverse_mass, 0.0
        for c in range(piled):
            v -= pool[pairs[c].slot].eta
            mass += 1.0 / bodies[c + 1].inverse_mass
            momentum += v / bodies[c + 1].inverse_mass
        v = -momentum / mass
        energy = 0.5 * v * v / bodies[0].inverse_mass
    for c in range(piled):
        v -= pool[pairs[c].slot].eta
        if bodies[c + 1].inverse_mass > 0.0:
            energy += 0.5 * v * v / bodies[c + 1].inverse_mass
    return energy


@kernel
def squeeze(pairs: Any, pool: Any, bodies: Any, piled: int) -> float:
    """Return the force in N on the ceiling that closes a pile: the static overlaps must add up to those there are."""
    total, low, high = 0.0, 0.0, 0.0
    for c in range(piled):
        total += pool[pairs[c].slot].xi
    for c in range(piled):
        pair = pool[pairs[c].slot]
        high = max(high, pair.k * power(total, pair.p))
    for _ in range(100):
        middle, room = 0.5 * (low + high), total
        for c in range(piled - 1, -1, -1):
            room -= overlap_under(pool[pairs[c].slot], middle + bodies[c + 1].load)
        low, high = (middle, high) if room > 0.0 else (low, middle)
    return low


@kernel
def overlap_under(pair: Any, load: float) -> float:
    """Return the static overlap in m under a load in N."""
    return power(load / pair.k, 1.0 / pair.p)


@kernel
def excess(pair: Any, xi: float, rest: float, load: float) -> float:
    """Return U(ξ) - U(ξ°) - F° (ξ - ξ°) in J."""
    if pair.kind == LINEAR:
        return float(0.5 * pair.k * (xi - rest) * (xi - rest))
    stored = xi * power(xi, pair.p) - rest * power(rest, pair.p) if xi > 0.0 else -rest * power(rest, pair.p)
    return float(pair.k * stored / (pair.p + 1.0) - load * (xi - rest))


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
        low, high = (xi, high) if slope < 0.0 else (low, xi)
    return float(excess(pair, high, rest, load) + 0.5 * stiff * stiff * power(low, 2.0 * pair.s))


def lie_still(pairs: list[Any], at_rest: AtRest, closed: bool) -> bool:
    """Write the piece of a block that lies still, and return whether it does; `closed` if it is a ring."""
    block = pairs[0]
    if any(p.mode not in (OPEN, ACTIVE) or (p.mode == ACTIVE and not abs(p.eta) <= STILL * block.speed) for p in pairs):
        return False
    force = [at_rest(p, p.xi) if p.mode == ACTIVE else 0.0 for p in pairs]
    push = accelerations(pairs, force, closed)
    deeper = {i: at_rest(p, p.xi * (1.0 + TANGENT)) for i, p in enumerate(pairs) if p.mode == ACTIVE}
    if not deeper or not all(balances(pairs[i], push[i], force[i], more) for i, more in deeper.items()):
        return False
    arrivals = [time_to_contact(max(0.0, -p.xi), -p.eta, a) for p, a in zip(pairs, push, strict=True) if p.mode == OPEN]
    if 0.0 in arrivals:  # the run has stopped where a ball arrives
        return False
    block.clock, block.h, block.stride = 1, min([LONG, *(2.0 * t for t in arrivals)]), 0.0
    for p, f, a in zip(pairs, force, push, strict=True):
        if p.mode == ACTIVE or abs(p.eta) <= ROUNDING * block.speed:
            p.eta = 0.0
        write_flight(p, block.h, a if p.mode == OPEN else 0.0, f)
    return True


def accelerations(pairs: list[Any], force: list[float], closed: bool) -> list[float]:
    """Closing accelerations in m/s² of all pairs, 0 where those of open ones are rounding."""
    first, last = (force[-1], force[0]) if closed else (0.0, 0.0)
    out = []
    for p, below, own, above in zip(pairs, [first, *force[:-1]], force, [*force[1:], last], strict=True):
        parts = (p.pull, p.lower * below, -p.inverse * own, p.upper * above)
        total = math.fsum(parts)
        rounding = p.mode == OPEN and abs(total) <= ROUNDING * max(map(abs, parts))
        out.append(0.0 if rounding else total)
    return out


def balances(pair: Any, push: float, force: float, more: float) -> bool:
    """Return whether a pair is at rest where its force balances, given the force a little deeper."""
    stiffness = (more - force) / (TANGENT * pair.xi)
    square = stiffness * pair.inverse
    if not (force > 0.0 and stiffness > 0.0):
        return False
    return bool(abs(push) <= STILL * pair.xi * square and abs(pair.eta) <= STILL * pair.xi * math.sqrt(square))
