"""Which of several simultaneous collisions acts first: the sequential tie rules.
May be skipped: rarer, collisions at one instant.

The queue is ordered by ``(time, rank)``. The lower 24 bits of a rank are the number of its pair, so a rank says whose
it is; the upper bits order pairs at equal times, and only then: from the left, from the right, or at random by a hash
of the seed, the pair and how often it has collided (Han & Gilmore's sequential treatment, reproducible).
"""

from __future__ import annotations

from granular._kernels import kernel

LEFT, RIGHT, RANDOM, GROUP = range(4)
ORDER = {"left": LEFT, "right": RIGHT, "random": RANDOM, "newton": GROUP, "poisson": GROUP, "reflect": GROUP}
"""The last three solve a touching group as a whole, see `granular.edmd.groups`; groups apart act from the left."""
MASK = (1 << 24) - 1
"""Mask of the pair in a rank; scenes have at most that many pairs."""


@kernel
def rank(c: int, order: int, seed: int, hits: int) -> int:
    """Return the rank of pair `c`, which has collided `hits` times."""
    if order in (LEFT, GROUP):
        return c
    if order == RIGHT:
        return ((MASK - c) << 24) | c
    return (mixed(mixed(mixed(seed & 0x7FFFFFFF) ^ c) ^ (hits & 0x7FFFFFFF)) << 24) | c


@kernel
def mixed(x: int) -> int:
    """Return 31 well-mixed bits of `x`; no product exceeds 63 bits, so that compiled and plain agree."""
    x = ((x ^ (x >> 16)) * 0x45D9F3B) & 0x7FFFFFFF
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & 0x7FFFFFFF
    return x ^ (x >> 16)
