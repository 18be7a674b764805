"""Sums that keep what rounding takes from them, and the sum of the gaps where walls or a ring hold it.
May be skipped: rounding.
"""

from __future__ import annotations

from granular._kernels import kernel
from granular._records import Record, Records


@kernel
def add(total: float, low: float, more: float) -> tuple[float, float]:
    """Return a sum and what its rounding has left, with one more summand (Neumaier, 1974)."""
    new = total + more
    return new, low + ((total - new) + more if abs(total) >= abs(more) else (more - new) + total)


@kernel
def reimpose(run: Record, pairs: Records) -> int:
    """Give the largest gap what rounding has taken from the sum of all, which never changes; return its pair."""
    widest, total, low = 0, 0.0, 0.0
    for c in range(len(pairs)):
        total, low = add(total, low, pairs[c].gap)
        if pairs[c].gap > pairs[widest].gap:
            widest = c
    pairs[widest].gap += (run.closed - total) - low
    return widest
