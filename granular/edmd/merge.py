"""Balls that stay together: clusters without cluster objects.

A *closed* pair has gap 0, rate 0 and no pull, all in bits; it never collides by itself and needs no flag. A ball that
rests on a wall, directly or on a pile, has ``falls = 0`` and the velocity of the wall; the next ball then sees a floor.
A hit on a cluster is an ordinary collision of the body hit; what it starts runs through the cluster by collisions at
the same time.
"""

from __future__ import annotations

import math

from granular._kernels import kernel, rare
from granular.edmd.motion import Floats, carry, collide


@kernel
def is_closed(c: int, u: Floats, gap: Floats, at: Floats, pull: Floats) -> bool:
    """Return whether the bodies of pair `c` move as one."""
    return gap[c] == 0.0 and pull[c] == 0.0 and u[c + 1] == u[c]  # type: ignore[no-any-return]


ORDINARY, WEAK, RESTING = range(3)


@kernel
def kind(c: int, w: float, e: float, below: float, mass: Floats, falls: Floats, pull: Floats) -> int:
    """Return what a collision of pair `c` at rate `w` is: weak, so that it merges; one with a ball at rest; or neither.

    A ceiling cannot carry.
    """
    if e < 1.0 and -w < below and pull[c] >= 0.0:
        return WEAK
    if (falls[c] == 0.0 and mass[c] < math.inf) or (falls[c + 1] == 0.0 and mass[c + 1] < math.inf):
        return RESTING
    return ORDINARY


@rare
@kernel
def absorb(
    c: int, now: float, w: float, g: float, mass: Floats, u: Floats, falls: Floats, gap: Floats, at: Floats,
    pull: Floats,
) -> tuple[int, int, float]:
    """Let the bodies of pair `c`, which close at rate `w`, and all that is closed with them, move as one from now on.

    With the wall or the pile if one side belongs to it, else with their common momentum. Returns the first and the
    last pair to predict anew, and the momentum exchanged by pair `c` in kg m/s.
    """
    b, e = c, c + 1  # the lowest and the highest body
    while b > 0 and falls[b] > 0.0 and is_closed(b - 1, u, gap, at, pull):  # what rests stays as it is
        b -= 1
    while e < len(gap) and falls[e] > 0.0 and is_closed(e, u, gap, at, pull):
        e += 1
    first, last = max(b - 1, 0), min(e, len(gap) - 1)
    carry(first, now, u, gap, at, pull)  # all pairs between but for c are closed
    carry(c, now, u, gap, at, pull)
    carry(last, now, u, gap, at, pull)
    gap[c] = 0.0
    lower = math.inf if falls[c] == 0.0 else total(b, c, mass)
    upper = math.inf if falls[c + 1] == 0.0 else total(c + 1, e, mass)
    if lower == math.inf:
        common, exchanged = u[c], -upper * w
    elif upper == math.inf:
        common, exchanged = u[c + 1], -lower * w
    else:
        share = upper / (lower + upper)
        common, exchanged = u[c] + share * w, -(lower * share) * w
    rests = lower == math.inf or upper == math.inf
    for i in range(b, e + 1):
        u[i] = common
        if rests:
            falls[i] = 0.0
    repull(first, last, g, falls, pull)
    return first, last, exchanged


@rare
@kernel
def share(c: int, first: int, last: int, falls: Floats, u: Floats, noise: Floats) -> None:
    """Give all bodies that now move as one with pair `c`, among those of pairs `first` … `last`, the noise of the pair.

    A wall has none.
    """
    common = max(noise[c], noise[c + 1])
    for i in range(first, last + 2):
        if u[i] == u[c] and falls[i] > 0.0:
            noise[i] = max(noise[i], common)


@rare
@kernel
def strike(
    c: int, now: float, w: float, e: float, g: float, mass: Floats, u: Floats, falls: Floats, gap: Floats, at: Floats,
    pull: Floats, low: Floats, high: Floats,
) -> tuple[int, int]:
    """Let pair `c` collide at rate `w` with restitution `e`; its bodies, and those that rested upon them, fall again.

    Returns the first and the last pair to predict anew.
    """
    top = c + 1
    while top < len(gap) and falls[top] == 0.0 and mass[top] < math.inf and is_closed(top, u, gap, at, pull):
        top += 1
    first, last = max(c - 1, 0), min(top, len(gap) - 1)
    for k in range(first, last + 1):
        carry(k, now, u, gap, at, pull)
    for i in range(c, top + 1):
        if falls[i] == 0.0 and mass[i] < math.inf:
            falls[i] = 1.0
            u[i] += g * now
    repull(first, last, g, falls, pull)
    collide(c, now, w, e, u, gap, at, pull, low, high)
    return first, last


@kernel
def total(b: int, e: int, mass: Floats) -> float:
    """Return the mass of bodies `b` … `e`."""
    mass_sum = 0.0
    for i in range(b, e + 1):
        mass_sum += mass[i]
    return mass_sum


@rare
@kernel
def rest(c: int, g: float, u: Floats, falls: Floats, gap: Floats, at: Floats, pull: Floats) -> None:
    """Let the upper body of pair `c` rest on the wall, or on the pile on it.

    For a pulled pair that never collides again: it has gap and rate 0.
    """
    top = min(c + 1, len(gap) - 1)
    if top > c:
        carry(top, at[c], u, gap, at, pull)
    falls[c + 1] = 0.0
    u[c + 1] = u[c]
    repull(c, top, g, falls, pull)


@kernel
def repull(first: int, last: int, g: float, falls: Floats, pull: Floats) -> None:
    """Set gravity's closing acceleration of pairs `first` … `last` from which of their bodies fall."""
    for c in range(first, last + 1):
        pull[c] = g * (falls[c + 1] - falls[c])
