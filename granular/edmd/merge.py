"""Balls that stay together: clusters without cluster objects.

A *closed* pair has gap 0, rate 0 and no pull, all in bits; it never collides by itself and needs no flag. A ball that
rests on a wall, directly or on a pile, has ``falls = 0`` and the velocity of the wall; the next ball then sees a floor.
A hit on a cluster is an ordinary collision of the body hit; what it starts runs through the cluster by collisions at
the same time.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.edmd.motion import carry, collide

ORDINARY, WEAK, RESTING = range(3)


@kernel
def is_closed(pair: Record, lower: Record, upper: Record) -> bool:
    """Return whether the bodies of a pair move as one."""
    return pair.gap == 0.0 and pair.pull == 0.0 and upper.u == lower.u  # type: ignore[no-any-return]


@kernel
def at_rest(body: Record) -> bool:
    """Return whether a ball rests on a wall, directly or on a pile."""
    return body.falls == 0.0 and body.mass < math.inf  # type: ignore[no-any-return]


@kernel
def kind(run: Record, pair: Record, lower: Record, upper: Record, w: float, e: float) -> int:
    """Return what a collision at rate `w` is: weak, so that it merges; one with a ball at rest; or neither.

    A ceiling cannot carry.
    """
    if e < 1.0 and -w < run.merge_below and pair.pull >= 0.0:
        return WEAK
    return RESTING if at_rest(lower) or at_rest(upper) else ORDINARY


@rare
@kernel
def absorb(run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that is closed with them, move as one from now on.

    With the wall or the pile if one side belongs to it, else with their common momentum. Returns the first and the
    last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    b, e = c, c + 1  # the lowest and the highest body; what rests stays as it is
    while b > 0 and bodies[b].falls > 0.0 and is_closed(pairs[b - 1], bodies[b - 1], bodies[b]):
        b -= 1
    while e < len(pairs) and bodies[e].falls > 0.0 and is_closed(pairs[e], bodies[e], bodies[e + 1]):
        e += 1
    first, last = max(b - 1, 0), min(e, len(pairs) - 1)
    for k in (first, c, last):  # all others between are closed
        carry(pairs[k], bodies[k], bodies[k + 1], now)
    pairs[c].gap = 0.0
    lower = math.inf if bodies[c].falls == 0.0 else total(bodies, b, c)
    upper = math.inf if bodies[c + 1].falls == 0.0 else total(bodies, c + 1, e)
    if lower == math.inf:
        common, exchanged = bodies[c].u, -upper * w
    elif upper == math.inf:
        common, exchanged = bodies[c + 1].u, -lower * w
    else:
        share = upper / (lower + upper)
        common, exchanged = bodies[c].u + share * w, -(lower * share) * w
    for i in range(b, e + 1):
        bodies[i].u = common
        if lower == math.inf or upper == math.inf:
            bodies[i].falls = 0.0
    repull(run, pairs, bodies, first, last)
    run.merged += 1
    return first, last, exchanged


@rare
@kernel
def share(bodies: Records, c: int, first: int, last: int) -> None:
    """Give all bodies that now move as one with pair `c`, among those of pairs `first` … `last`, the noise of the pair.

    A wall has none.
    """
    common = max(bodies[c].noise, bodies[c + 1].noise)
    for i in range(first, last + 2):
        body = bodies[i]
        if body.u == bodies[c].u and body.falls > 0.0:
            body.noise = max(body.noise, common)


@rare
@kernel
def strike(run: Record, pairs: Records, bodies: Records, c: int, now: float, w: float, e: float) -> tuple[int, int]:
    """Let pair `c` collide at rate `w` with restitution `e`; its bodies, and those that rested upon them, fall again.

    Returns the first and the last pair to predict anew.
    """
    top = c + 1
    while top < len(pairs) and at_rest(bodies[top]) and is_closed(pairs[top], bodies[top], bodies[top + 1]):
        top += 1
    first, last = max(c - 1, 0), min(top, len(pairs) - 1)
    for k in range(first, last + 1):
        carry(pairs[k], bodies[k], bodies[k + 1], now)
    release(run, pairs, bodies, c, top, now)
    collide(pairs[c], bodies[c], bodies[c + 1], now, w, e)
    return first, last


@rare
@kernel
def release(run: Record, pairs: Records, bodies: Records, low: int, high: int, now: float) -> None:
    """Let those of bodies `low` … `high` that are at rest fall again."""
    for i in range(low, high + 1):
        if at_rest(bodies[i]):
            bodies[i].falls = 1.0
            bodies[i].u += run.gravity * now
    repull(run, pairs, bodies, max(low - 1, 0), min(high, len(pairs) - 1))


@kernel
def total(bodies: Records, b: int, e: int) -> float:
    """Return the mass of bodies `b` … `e`."""
    mass_sum = 0.0
    for i in range(b, e + 1):
        mass_sum += bodies[i].mass
    return mass_sum


@rare
@kernel
def rest(run: Record, pairs: Records, bodies: Records, c: int) -> None:
    """Let the upper body of pair `c` rest on the wall, or on the pile on it.

    For a pulled pair that never collides again: it has gap and rate 0.
    """
    top = min(c + 1, len(pairs) - 1)
    if top > c:
        carry(pairs[top], bodies[top], bodies[top + 1], pairs[c].at)
    bodies[c + 1].falls = 0.0
    bodies[c + 1].u = bodies[c].u
    repull(run, pairs, bodies, c, top)


@kernel
def repull(run: Record, pairs: Records, bodies: Records, first: int, last: int) -> None:
    """Set gravity's closing acceleration of pairs `first` … `last` from which of their bodies fall."""
    for c in range(first, last + 1):
        pairs[c].pull = run.gravity * (bodies[c + 1].falls - bodies[c].falls)
