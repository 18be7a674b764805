"""Numbers of pairs and bodies on a line and on a ring, and neighbours of islands.

On a ring of n balls, pair n-1 joins ball n-1 and ball 0. An island lo … hi-1 can extend beyond pair n-1, up to hi = lo
+ n. For this purpose there are n more records of pairs. Record c of them holds only the place in the pool of pair c -
n. An island of all pairs is closed: its first and its last pair have a ball in common. For scenes on a line, none of
this is compiled.
"""

from __future__ import annotations

from typing import Any

from granular._engine.kernels import RING, kernel


@kernel
def pair_count(pairs: Any) -> int:
    """Return the number of pairs. On a ring it is half the length of `pairs`."""
    return len(pairs) // 2 if RING else len(pairs)


@kernel
def wrapped_number(pairs: Any, c: int) -> int:
    """Return the number of pair or body `c`, on a ring modulo the number of pairs."""
    return c % (len(pairs) // 2) if RING else c


@kernel
def is_closed(pairs: Any, lo: int, hi: int) -> bool:
    """Return whether the island lo … hi-1 consists of all pairs of a ring."""
    return RING and 2 * (hi - lo) == len(pairs)


@kernel
def neighbour_pairs(pairs: Any, c: int) -> tuple[int, int]:
    """Return the numbers of the pairs below and above pair `c`.

    At the ends of a line they are -1 and the number of pairs. A ring of two balls has only one other pair: it is
    returned as the pair above, and -1 as the pair below.
    """
    if RING:
        n = len(pairs) // 2
        return (c - 1) % n if n > 2 else -1, (c + 1) % n
    return c - 1, c + 1


@kernel
def island_neighbours(run: Any, pairs: Any) -> tuple[int, int]:
    """Return the pairs below and above the island of the current event on a ring.

    If the island consists of all pairs, the result is -1 and the length of `pairs`, as for an island that fills a line.
    """
    if is_closed(pairs, run.lo, run.hi):
        return -1, len(pairs)
    return wrapped_number(pairs, run.lo - 1), wrapped_number(pairs, run.hi)


@kernel
def lengthen_island(run: Any, pairs: Any, lo: int) -> None:
    """Extend the island of the current event on a ring by a block next to it.

    The block starts with pair `lo`, directly above or below the island.
    """
    size = pairs[lo].hi - lo
    if lo == wrapped_number(pairs, run.hi):
        run.hi += size
        return
    run.lo -= size
    if run.lo < 0:
        run.lo, run.hi = run.lo + pair_count(pairs), run.hi + pair_count(pairs)
