"""The series of a step: of overlaps, velocities and forces.
May be skipped: it measures ourselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from granular.reference.driven import Course
from granular.reference.series import Number, Power, product_term


@dataclass
class Touch:
    """One pair: its law F = k ξ^p + γ ξ^d ξ̇ = ξ^d φ, the root `q` of ξ in which that is analytic, and its overlap."""

    k: Number
    p: Number
    gamma: Number
    d: Number
    q: int
    xi: Number
    exact: bool = False
    """φ is exactly zero now: the event just dealt with."""
    woken: bool = False
    """It was pushed open from a touch at rest, with a high power of time: no root of ξ is regular there."""


class Force:
    """The series of F = ξ^d φ, φ = k ξ^(p-d) + γ ξ̇, of one pair."""

    def __init__(self, mp: Any, touch: Touch, active: bool, x: list[Number], rate: list[Number]) -> None:
        self.mp, self.a, self.active, m = mp, touch, active, 0 if touch.xi else len(x)
        self.elastic, self.front = (Power(self.mp, x, power, m) for power in (self.a.p - self.a.d, self.a.d))
        self.rate, self.phi, self.fronts, self.terms = rate, list[Number](), list[Number](), list[Number]()

    def extend(self, n: int) -> None:
        """Append coefficient `n`; of a clipped force, whose bracket alone goes on, to that."""
        a = self.a
        bracket = a.k * self.elastic.term(n) + a.gamma * self.rate[n]
        self.phi.append(self.mp.zero if n == 0 and a.exact else bracket)
        if n == 0 or a.d:
            self.fronts.append(self.front.term(n))
        if self.active:
            self.terms.append(product_term(self.mp, self.fronts, self.phi, n))


@dataclass
class Piece:
    """The series of a step: ξ, v, displacements of pendula, ξ̇, time, forces, walls; u = ξ^(1/q) of the pair whose clock
    it is."""

    x: list[list[Number]]
    v: list[list[Number]]
    y: list[list[Number]]
    rate: list[list[Number]]
    t: list[Number]
    force: dict[int, Force]
    walls: dict[int, Course]
    pair: int
    q: int
    u: list[Number]


def fraction(x: float) -> Fraction:
    """A law's exponent as a simple fraction.

    Raises
    ------
    ValueError
        If it is none with a denominator up to 12: such a force has no power series.
    """
    simple = Fraction(x).limit_denominator(12)
    if float(simple) != x and abs(float(simple) - x) > 1e-15:
        raise ValueError(f"exponent is {x!r}: a fraction with a denominator of at most 12 is needed.")
    return simple
