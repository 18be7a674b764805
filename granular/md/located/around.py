"""On a line, or around a ring: numbers of pairs and of their bodies.
May be skipped: rarer, balls on a ring.

On a ring of n balls pair n-1 joins ball n-1 and ball 0. An island lo … hi-1 may go on beyond pair n-1, to hi = lo + n:
so there are n more records of pairs, of which nothing but the place in the pool is kept, that of pair c - n. An island
of all pairs is closed: its first and its last pair share a ball. On a line nothing of this is asked, nor compiled.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.records import RING


@kernel
def count_of(pairs: Any) -> int:
    """Return the number of pairs."""
    return len(pairs) // 2 if RING else len(pairs)


@kernel
def nth(pairs: Any, c: int) -> int:
    """Return the number of a pair, or of a body, that may have been counted beyond the last one, or before 0."""
    return c % (len(pairs) // 2) if RING else c


@kernel
def is_closed(pairs: Any, lo: int, hi: int) -> bool:
    """Return whether the island lo … hi-1 goes all around a ring."""
    return RING and 2 * (hi - lo) == len(pairs)


@kernel
def beside(pairs: Any, c: int) -> tuple[int, int]:
    """Return the numbers of the pairs below and above; -1, and the number of pairs, where there is none.

    On a ring of two balls the other pair is that above.
    """
    if RING:
        n = len(pairs) // 2
        return (c - 1) % n if n > 2 else -1, (c + 1) % n
    return c - 1, c + 1


@kernel
def neighbours(run: Any, pairs: Any) -> tuple[int, int]:
    """Return the pairs below and above the island under way on a ring; if it goes all around, none, as on a line."""
    if is_closed(pairs, run.lo, run.hi):
        return -1, len(pairs)
    return nth(pairs, run.lo - 1), nth(pairs, run.hi)


@kernel
def lengthen(run: Any, pairs: Any, lo: int) -> None:
    """Lengthen the island under way on a ring by the block that starts with pair `lo`, above it or below."""
    size = pairs[lo].hi - lo
    if lo == nth(pairs, run.hi):
        run.hi += size
        return
    run.lo -= size
    if run.lo < 0:
        run.lo, run.hi = run.lo + count_of(pairs), run.hi + count_of(pairs)
