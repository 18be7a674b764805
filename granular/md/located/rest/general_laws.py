"""Piece of an island at rest under general laws (`own_law`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from granular._engine.flight import time_to_contact
from granular.md.located.pieces import write_flight
from granular.md.located.records import ACTIVE, OPEN, REST_PIECE_SCALE
from granular.md.located.rest.proof import STILL_DEVIATION

RestForce = Callable[[Any, float], float]
"""Type of functions that return the force in N of a pair at rest.

The arguments are the pair and its overlap in m."""
TANGENT_STEP = 1e-6
"""Relative change of an overlap over which the stiffness is computed."""
ROUNDING_ACCELERATION = 1e-11
"""Relative size up to which accelerations and rates of a pair are rounding errors.

A sum of accelerations is compared with its largest term, a rate with the speed of the island."""


def write_resting_piece(pairs: list[Any], at_rest: RestForce, closed: bool) -> bool:
    """Write the piece of an island if all of its contacts are at rest.

    Returns whether they are. Open pairs can move freely. The result is false, and nothing is written, if no pair is
    active, if a pair is residual or dormant, or if a ball arrives now. `at_rest` returns the force of a pair at an
    overlap, and `closed` is true for a whole ring.
    """
    block = pairs[0]
    if any(
        p.mode not in (OPEN, ACTIVE) or (p.mode == ACTIVE and not abs(p.eta) <= STILL_DEVIATION * block.speed)
        for p in pairs
    ):
        return False
    force = [at_rest(p, p.xi) if p.mode == ACTIVE else 0.0 for p in pairs]
    push = closing_accelerations(pairs, force, closed)
    larger_forces = {i: at_rest(p, p.xi * (1.0 + TANGENT_STEP)) for i, p in enumerate(pairs) if p.mode == ACTIVE}
    if not larger_forces or not all(
        is_balanced(pairs[i], push[i], force[i], larger_force) for i, larger_force in larger_forces.items()
    ):
        return False
    arrivals = [time_to_contact(max(0.0, -p.xi), -p.eta, a) for p, a in zip(pairs, push, strict=True) if p.mode == OPEN]
    if 0.0 in arrivals:  # the run has stopped at the arrival of a ball
        return False
    block.clock, block.h, block.last_step = 1, min([REST_PIECE_SCALE, *(2.0 * t for t in arrivals)]), 0.0
    for p, f, a in zip(pairs, force, push, strict=True):
        if p.mode == ACTIVE or abs(p.eta) <= ROUNDING_ACCELERATION * block.speed:
            p.eta = 0.0
        write_flight(p, block.h, a if p.mode == OPEN else 0.0, f)
    return True


def closing_accelerations(pairs: list[Any], force: list[float], closed: bool) -> list[float]:
    """Return the closing accelerations in m/s² of all pairs of an island.

    `force` are the contact forces in N. For open pairs, a sum that is only rounding error is returned as 0. `closed` is
    true for a whole ring.
    """
    first, last = (force[-1], force[0]) if closed else (0.0, 0.0)
    out = []
    for p, below, own, above in zip(pairs, [first, *force[:-1]], force, [*force[1:], last], strict=True):
        terms = (p.pull, p.lower * below, -p.inverse * own, p.upper * above)
        total = math.fsum(terms)
        rounding = p.mode == OPEN and abs(total) <= ROUNDING_ACCELERATION * max(map(abs, terms))
        out.append(0.0 if rounding else total)
    return out


def is_balanced(pair: Any, push: float, force: float, larger_force: float) -> bool:
    """Return whether a pair is at rest at the equilibrium of its force.

    `push` is the acceleration of its overlap in m/s², `force` its force in N, and `larger_force` its force at an
    overlap that is larger by the fraction `TANGENT_STEP`.
    """
    stiffness = (larger_force - force) / (TANGENT_STEP * pair.xi)
    square = stiffness * pair.inverse
    if not (force > 0.0 and stiffness > 0.0):
        return False
    return bool(
        abs(push) <= STILL_DEVIATION * pair.xi * square
        and abs(pair.eta) <= STILL_DEVIATION * pair.xi * math.sqrt(square)
    )
