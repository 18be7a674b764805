"""Does a force compute like a spring and a dashpot? Run it once on symbols and see.
May be skipped: faster, same results.

A law of one's own needs no trait for the exact path of linear laws: if its `force`, run on the symbols ξ and ξ̇, only
adds them and multiplies them by numbers, then it *is* k ξ + γ ξ̇ for every overlap and rate. Any comparison, root or
power of a symbol ends the attempt: nothing is guessed from samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from granular.scene import Pair


@dataclass(frozen=True, eq=False)
class Linear:
    """The expression xi·ξ + rate·ξ̇; it knows sums, and products with numbers."""

    xi: float
    rate: float

    def __add__(self, other: Any) -> Linear:
        if isinstance(other, Linear):
            return Linear(self.xi + other.xi, self.rate + other.rate)
        return self if isinstance(other, (int, float)) and other == 0 else NotImplemented

    def __mul__(self, number: Any) -> Linear:
        return Linear(self.xi * number, self.rate * number) if isinstance(number, (int, float)) else NotImplemented

    def __truediv__(self, number: Any) -> Linear:
        return Linear(self.xi / number, self.rate / number) if isinstance(number, (int, float)) else NotImplemented

    def __neg__(self) -> Linear:
        return Linear(-self.xi, -self.rate)

    def __sub__(self, other: Linear | float) -> Linear:
        return self + -other

    def __rsub__(self, other: Linear | float) -> Linear:
        return -self + other

    __radd__, __rmul__ = __add__, __mul__
    __bool__ = __eq__ = __hash__ = None  # type: ignore[assignment] # a symbol is neither true nor false, nor compared


def traced(law: Any, pair: Pair) -> tuple[float, float] | None:
    """Return (k, γ) if the law's `force` is proved to be k ξ + γ ξ̇ with k > 0 and γ ≥ 0, else None."""
    try:
        force = law.force(Linear(1.0, 0.0), Linear(0.0, 1.0), pair)
    except Exception:  # not linear; if it is the user's mistake, the run itself will show it
        return None
    if not isinstance(force, Linear) or not (force.xi > 0.0 and force.rate >= 0.0):
        return None
    return force.xi, force.rate
