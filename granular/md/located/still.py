"""A pile of laws that are functions, once it has come to rest: its piece has no end, or ends when a ball arrives.

Power laws have a proof of rest (`resting`); of a function it can only be seen that every force balances to rounding, at
rest, and grows with the overlap. Then the balls stay where they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._flight import time_to_contact
from granular.md.located.records import ACTIVE, OPEN, ORDER
from granular.md.located.resting import LONG, STILL

AtRest = Callable[[int, float], float]
"""Force in N of a pair (numbered in the block) at an overlap in m."""
TANGENT = 1e-6
"""Part of an overlap over which its stiffness is taken."""
ROUNDING = 1e-11
"""Part of the accelerations of a pair, and of its block's speed, up to which their sum, and its rate, is rounding."""


def lie_still(pairs: list[Any], at_rest: AtRest) -> bool:
    """Write the piece of a block that lies still, and return whether it does."""
    block = pairs[0]
    if any(p.mode not in (OPEN, ACTIVE) or (p.mode == ACTIVE and not abs(p.eta) <= STILL * block.speed) for p in pairs):
        return False
    force = [at_rest(i, p.xi) if p.mode == ACTIVE else 0.0 for i, p in enumerate(pairs)]
    push = accelerations(pairs, force)
    closed = [i for i, p in enumerate(pairs) if p.mode == ACTIVE]
    deeper = {i: at_rest(i, pairs[i].xi * (1.0 + TANGENT)) for i in closed}
    if not closed or not all(balances(pairs[i], push[i], force[i], deeper[i]) for i in closed):
        return False
    arrivals = [time_to_contact(max(0.0, -p.xi), -p.eta, a) for p, a in zip(pairs, push, strict=True) if p.mode == OPEN]
    if 0.0 in arrivals:  # the run has stopped where a ball arrives
        return False
    block.clock, block.h, block.stride = 1, min([LONG, *(2.0 * t for t in arrivals)]), 0.0
    zeros = [0.0] * ORDER
    for p, f, a in zip(pairs, force, push, strict=True):
        if p.mode == ACTIVE:
            p.eta, p.x, p.e = 0.0, [p.xi, *zeros], [0.0, *zeros]
        else:
            p.eta = p.eta if abs(p.eta) > ROUNDING * block.speed else 0.0
            p.x = [p.xi, block.h * p.eta, 0.5 * block.h * block.h * a, *zeros[2:]]
            p.e = [p.eta, block.h * a, *zeros[1:]]
        p.f, p.g = [f, *zeros], [f, *zeros]
    return True


def accelerations(pairs: list[Any], force: list[float]) -> list[float]:
    """Closing accelerations in m/s² of all pairs, 0 where those of open ones are rounding."""
    out = []
    for i, p in enumerate(pairs):
        below, above = force[i - 1] if i > 0 else 0.0, force[i + 1] if i + 1 < len(force) else 0.0
        parts = (p.pull, p.lower * below, -p.inverse * force[i], p.upper * above)
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
