"""Power series as lists of mpmath numbers, and certified roots of polynomials.

The classes hold the series of one step: overlaps, velocities, forces and walls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from granular.studies.reference_walls import Number, value


def product_term(mp: Any, a: Sequence[Number], b: Sequence[Number], n: int) -> Number:
    """Coefficient `n` of the product of two series.

    Each series can end before order `n`.
    """
    low, high = max(0, n + 1 - len(b)), min(n + 1, len(a))
    return mp.fdot(a[low:high], b[n - high + 1 : n - low + 1][::-1]) if high > low else mp.zero


def work_done(mp: Any, force: list[Number], v: list[Number], rho: list[Number], x: Number) -> Number:
    """Work ∫ F v dt up to x, with dt/dx = ρ."""
    n = len(force)
    power = [product_term(mp, force, v, j) for j in range(n)]
    return value([mp.zero, *(product_term(mp, rho, power, j) / (j + 1) for j in range(n))], x)


class Power:
    """Series of ξ^α, extended order by order with the series of ξ.

    Write ξ = τ^m y with y(0) ≠ 0, so that ξ^α = τ^(αm) y^α. The product αm must be whole. From f = y^α follows y f' = α
    y' f, hence n y_0 f_n = Σ_(j=1..n) ((α+1) j - n) y_j f_(n-j).
    """

    def __init__(self, mp: Any, x: list[Number], alpha: Number, m: int) -> None:
        self.mp, self.x, self.alpha, self.m = mp, x, alpha, m
        self.offset = int(mp.nint(alpha * m))
        self.y, self.jy, self.f = list[Number](), list[Number](), list[Number]()

    def term(self, n: int) -> Number:
        """Coefficient `n` of ξ^α, after all lower coefficients."""
        mp, j = self.mp, n - self.offset
        if self.alpha == 1:
            return self.x[n]
        if j < 0 or (j > 0 and self.alpha == 0):
            return mp.zero
        self.y.append(self.x[self.m + j])
        self.jy.append(j * self.y[-1])
        if j == 0:
            self.f.append(mp.power(self.y[0], self.alpha))
        else:
            back = self.f[::-1]
            total = (self.alpha + 1) * mp.fdot(self.jy[1:], back) - j * mp.fdot(self.y[1:], back)
            self.f.append(total / (j * self.y[0]))
        return self.f[-1]


def first_rise(mp: Any, p: Sequence[Number], end: Number) -> Number | None:
    """First x in [0, `end`] at which a polynomial rises to zero from below, or None.

    Exact zeros at the front belong to a root that has been handled, and are divided out. The result is certified. Let
    [a, b] be an interval with centre c and half width r, and let M ≥ |p''| on [0, b]. The interval is dismissed only if
    p(c) + |p'(c)| r + M r²/2 < 0. It is searched only where p provably rises. A maximum that stays below zero to
    working precision is not a root.
    """
    # a zero at x = 0 has already been an event
    lead = next((j for j, a in enumerate(p) if a != 0), None)
    if lead is None:
        return None
    p = p[lead:]
    if p[0] > 0:  # already above zero
        return mp.zero
    if p[0] + value([mp.zero, *(max(a, mp.zero) for a in p[1:])], end) < 0:
        return None
    slope = [j * a for j, a in enumerate(p)][1:]
    bends = [abs(j * a) for j, a in enumerate(slope)][1:]  # with absolute values it bounds |p''| on [0, x]
    tiny = mp.eps * value([abs(a) for a in p], end)
    stack = [(mp.zero, end)]
    while stack:
        a, b = stack.pop()
        c, r = (a + b) / 2, (b - a) / 2
        at, rate, bend = value(p, c), value(slope, c), value(bends, b)
        rest = bend * r * r / 2
        if at + abs(rate) * r + rest < 0:
            continue
        if rate > bend * r:  # p rises on the whole interval
            if value(p, a) >= 0:
                return a
            if value(p, b) >= 0:
                return _newton(mp, lambda x: value(p, x), lambda x: value(slope, x), a, b)
        elif -rate > bend * r or at - abs(rate) * r - rest > 0:
            if value(p, a) >= 0:
                return a
        elif rest > tiny:  # undecided: bisect, and search the lower half first
            stack += [(c, b), (a, c)]
    return None


def _newton(
    mp: Any, f: Callable[[Number], Number], slope: Callable[[Number], Number], a: Number, b: Number
) -> Number:
    """Root of a rising function between `a` and `b`, by bracketed Newton iteration."""
    x = (a + b) / 2
    for _ in range(10 * mp.prec):  # bisection alone needs `mp.prec` iterations
        y = f(x)
        a, b = (x, b) if y < 0 else (a, x)
        new = x - y / slope(x)
        new = new if a < new < b else (a + b) / 2  # bisect if Newton's method leaves the bracket
        if abs(new - x) <= 4 * mp.eps * abs(new):
            return new
        x = new
    return x


@dataclass
class Touch:
    """One pair: its law, its overlap, and flags of its state.

    The law is F = k ξ^p + γ ξ^d ξ̇ = ξ^d φ. Its bracket φ is analytic in the `q`-th root of ξ.
    """

    k: Number
    p: Number
    gamma: Number
    d: Number
    q: int
    xi: Number
    exact: bool = False
    """Whether φ is exactly zero now, because its zero was the last event."""
    woken: bool = False
    """Whether the overlap began at rest and grows with a high power of time.

    No root of ξ is then regular.
    """


def touch(mp: Any, form: Sequence[float], gap: float) -> Touch:
    """Pair with a law (k, p, γ, d) and its initial gap in m."""
    k, p, gamma, d = form
    powers = [fraction(p), fraction(d) if gamma else Fraction(0)]
    exact = [mp.mpf(power.numerator) / power.denominator for power in powers]
    q = math.lcm(*(power.denominator for power in powers))
    return Touch(mp.mpf(k), exact[0], mp.mpf(gamma), exact[1], q, -mp.mpf(gap))


class Force:
    """Series of the force F = ξ^d φ of one pair, with φ = k ξ^(p-d) + γ ξ̇."""

    def __init__(self, mp: Any, touch: Touch, active: bool, x: list[Number], rate: list[Number]) -> None:
        self.mp, self.a, self.active, m = mp, touch, active, 0 if touch.xi else len(x)
        self.elastic, self.front = (Power(self.mp, x, power, m) for power in (self.a.p - self.a.d, self.a.d))
        self.rate, self.phi, self.fronts, self.terms = rate, list[Number](), list[Number](), list[Number]()

    def extend(self, n: int) -> None:
        """Append coefficient `n`, for a clipped force only to the bracket φ."""
        a = self.a
        bracket = a.k * self.elastic.term(n) + a.gamma * self.rate[n]
        self.phi.append(self.mp.zero if n == 0 and a.exact else bracket)
        if n == 0 or a.d:
            self.fronts.append(self.front.term(n))
        if self.active:
            self.terms.append(product_term(self.mp, self.fronts, self.phi, n))


class WallSeries:
    """Series of the velocity m' of a wall and of its derivatives, with dt/dx = ρ."""

    def __init__(self, mp: Any, rates: Sequence[Number], last: Number, ahead: int) -> None:
        self.mp, self.last = mp, last
        self.y = [[rate, *[mp.zero] * (ahead - 1)] for rate in rates]

    def extend(self, rho: list[Number], m: int) -> Number:
        """Append coefficient `m` to each series, and return the velocity coefficient."""
        for one, rate in zip(self.y, self.y[1:], strict=False):
            one.append(product_term(self.mp, rho, rate, m - 1) / m)
        self.y[-1].append(self.last * product_term(self.mp, rho, self.y[0], m - 1) / m if self.last else self.mp.zero)
        return self.y[0][m]


@dataclass
class Piece:
    """Series of one step: ξ, v, displacements of pendula, ξ̇, time, forces, walls.

    `u` is ξ^(1/q) of the pair that sets the clock.
    """

    x: list[list[Number]]
    v: list[list[Number]]
    y: list[list[Number]]
    rate: list[list[Number]]
    t: list[Number]
    force: dict[int, Force]
    walls: dict[int, WallSeries]
    pair: int
    q: int
    u: list[Number]


def fraction(x: float) -> Fraction:
    """Exponent of a law as a simple fraction.

    Raises
    ------
    ValueError
        If no fraction with a denominator up to 12 equals the exponent. Such a force has no power series.
    """
    simple = Fraction(x).limit_denominator(12)
    if float(simple) != x and abs(float(simple) - x) > 1e-15:
        raise ValueError(f"`exponent` must be a fraction with a denominator of at most 12, got {x!r}.")
    return simple
