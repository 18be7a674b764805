"""Newton's equation by Taylor series in many digits: slow, and written without a look at the engines it judges.

State: overlaps ξ of the pairs and velocities v of the bodies, as mpmath numbers in SI units. A step is a power series
in x under a clock ρ(x) = dt/dx that makes it regular where forces begin or end like a fractional power of ξ:

* ρ = 1;
* t - t_0 = (x_0 + x)^q after a contact has begun at t_0 with ξ = 0: ρ = q (x_0 + x)^(q-1);
* ρ = ξ^(1-1/q) of a pair about to part: then u = ξ^(1/q) goes through zero linearly.

A pair that touches at rest sleeps until its overlap is `sleep` times that of an impact; what it leaves out is below
the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from granular.reference.log import ACTIVE, OPEN, RESIDUAL
from granular.reference.series import Number, Power, product_term, value

TERMS = 3
"""Order of the series at least, in units of the window of last terms that sets the step: were the window most of the
series, its low terms would have to be as small as the tolerance, and steps with them."""


@dataclass
class Touch:
    """One pair: its law F = k ξ^p + γ ξ^d ξ̇ = ξ^d φ, and its state."""

    k: Number
    p: Fraction
    gamma: Number
    d: Fraction
    xi: Number
    mode: str = OPEN
    exact: bool = False
    """φ is exactly zero now: the event just dealt with."""
    since: tuple[Number, tuple[Number, Number]] | None = None
    """When a force reached the dormant pair, and the velocities then: where its contact begins."""

    @property
    def q(self) -> int:
        """The root of ξ in which the force is analytic."""
        return math.lcm(self.p.denominator, self.d.denominator) if self.gamma else self.p.denominator

    @property
    def bent_residual(self) -> bool:
        """Whether the force is clipped and its bracket φ = k ξ^(p-d) + γ ξ̇ holds a power of ξ."""
        return self.mode == RESIDUAL and self.p - self.d != 1


@dataclass
class Clock:
    """ρ(x) = dt/dx: known from the start, or as the power `ending` of a pair's overlap."""

    rho: list[Number]
    pair: int = -1
    ending: Power | None = None

    @property
    def delay(self) -> int:
        """How many orders velocities and overlaps are ahead of forces."""
        return 1 + next((j for j, a in enumerate(self.rho) if a != 0), 0)


@dataclass
class Piece:
    """The series of a step: overlaps, velocities, time, brackets φ, and up to which x they hold (None: forever)."""

    x: list[list[Number]]
    v: list[list[Number]]
    t: list[Number]
    phi: dict[int, list[Number]] = field(default_factory=dict)
    reach: Number | None = None


class Motion:
    """The bodies under their forces: expands the current state into a `Piece` and moves along it."""

    def __init__(self, mp: Any, scene: Any, forms: Sequence[Any], order: int, tol: Number) -> None:
        self.mp, self.tol = mp, tol
        self.w = [mp.zero if math.isinf(m) else 1 / mp.mpf(m) for m in scene.mass.tolist()]
        self.fall = [-mp.mpf(scene.gravity) if w else mp.zero for w in self.w]
        self.pull = [self.fall[c] - self.fall[c + 1] for c in range(len(self.fall) - 1)]
        self.v = [mp.mpf(v) for v in scene.velocity.tolist()]
        self.touches = [
            Touch(mp.mpf(k), fraction(p), mp.mpf(gamma), fraction(d), -mp.mpf(gap))
            for (k, p, gamma, d), gap in zip(forms, scene.gap.tolist(), strict=True)
        ]
        self.window = max(6, *(int(a.q * (1 + a.p)) for a in self.touches))
        self.order = max(order, TERMS * self.window)
        self.speed = mp.zero
        self.past, self.root, self.last = mp.inf, 1, mp.zero
        """Time since the last singular onset, its q, and the duration of the last step."""

    @property
    def free(self) -> bool:
        """Whether no force acts and every event function that can rise is a parabola in time."""
        if any(a.mode == ACTIVE for a in self.touches):
            return False
        return all(self.rate(c) <= 0 and self.pull[c] <= 0 for c, a in enumerate(self.touches) if a.bent_residual)

    def rate(self, c: int) -> Number:
        """ξ̇ of pair c."""
        return self.v[c] - self.v[c + 1]

    def bracket(self, c: int) -> Number:
        """φ = k ξ^(p-d) + γ ξ̇ of a pair with overlap, whose sign is that of its force."""
        a = self.touches[c]
        if a.exact:
            return self.mp.zero
        return a.k * self.mp.power(a.xi, self.number(a.p - a.d)) + a.gamma * self.rate(c)

    def amplitude(self, c: int) -> Number:
        """Overlap at which pair c alone would stop from the largest speed so far."""
        a, w = self.touches[c], self.w[c] + self.w[c + 1]
        p = self.number(a.p)
        return self.mp.power((p + 1) * self.speed**2 / (2 * a.k * w), 1 / (p + 1))

    def number(self, ratio: Fraction) -> Number:
        """A fraction as an mpmath number."""
        return self.mp.mpf(ratio.numerator) / ratio.denominator

    def clock(self) -> Clock:
        """The clock that suits the current state."""
        mp = self.mp
        if self.free:
            return Clock([mp.one])
        if touched := [a.q for a in self.touches if a.mode == ACTIVE and a.q > 1 and a.xi == 0]:
            self.past, self.root = mp.zero, math.lcm(*touched)
        if self.past < 4 * self.last or self.past == 0:
            q, x0 = self.root, mp.root(self.past, self.root)
            return Clock([q * math.comb(q - 1, j) * x0 ** (q - 1 - j) for j in range(q)])
        soon = {
            -a.xi / self.rate(c): c
            for c, a in enumerate(self.touches)
            if a.q > 1 and a.xi > 0 > self.rate(c) and (a.mode == ACTIVE or a.bent_residual)
        }
        if soon and min(soon) < 4 * self.last:
            return Clock([], pair=soon[min(soon)])
        return Clock([mp.one])

    def expand(self, clock: Clock) -> Piece:
        """The series of the current state under a clock."""
        mp, touches = self.mp, self.touches
        x, v = [[a.xi] for a in touches], [[b] for b in self.v]
        if clock.pair >= 0:
            clock.ending = Power(mp, x[clock.pair], 1 - mp.one / touches[clock.pair].q, 0)
        ahead = clock.delay
        for series in (*x, *v):
            series += [mp.zero] * (ahead - 1)
        piece = Piece(x, v, [mp.zero] * ahead)
        forces = [self.force(c, piece, ahead) for c in range(len(touches))]
        a = [[] for _ in self.v]  # type: list[list[Number]]
        for n in range(3 if self.free else self.order - ahead + 1):
            if clock.ending is not None:
                clock.rho.append(clock.ending.term(n))
            m = n + ahead
            piece.t.append(clock.rho[m - 1] / m if m <= len(clock.rho) else mp.zero)
            change = [product_term(mp, clock.rho, b, m - 1) / m for b in v]
            for c, series in enumerate(x):
                series.append(change[c] - change[c + 1])
            push = [mp.zero, *(f.term(n) if f else mp.zero for f in forces), mp.zero]
            for b, series in enumerate(v):
                a[b].append(self.w[b] * (push[b] - push[b + 1]) + (self.fall[b] if n == 0 else 0))
                series.append(product_term(mp, clock.rho, a[b], m - 1) / m)
        piece.reach = None if self.free else self.reach(piece, clock)
        return piece

    def force(self, c: int, piece: Piece, ahead: int) -> Force | None:
        """The series of the force of pair c, with its bracket kept in the piece; None where nothing is to be known."""
        a = self.touches[c]
        if a.mode not in (ACTIVE, RESIDUAL):
            return None
        force = Force(self, c, piece, ahead if a.xi == 0 else 0)
        if a.gamma:
            piece.phi[c] = force.phi
        return force

    def reach(self, piece: Piece, clock: Clock) -> Number:
        """Up to which x the series hold to the tolerance, from their last terms.

        From as many as make sure that one is not zero: in a contact that has just begun only every (q + pq)-th is not.
        """
        mp, limits = self.mp, []
        watched = [(b, self.speed) for b in piece.v]
        watched += [(piece.phi[c], a.gamma * self.speed) for c, a in enumerate(self.touches) if a.bent_residual]
        if clock.ending is not None:
            watched.append((clock.rho, clock.rho[0]))
        for series, scale in watched:
            for j in range(max(2, len(series) - self.window), len(series)):
                if series[j] != 0:
                    limits.append(mp.root(self.tol * scale / abs(series[j]), j))
        return min(limits)

    def move(self, piece: Piece, x: Number) -> Number:
        """Advance to x of the piece; return the time that took."""
        mp = self.mp
        if x == 0:
            return mp.zero
        for a, series in zip(self.touches, piece.x, strict=True):
            a.xi, a.exact = value(mp, series, x), False
        self.v = [value(mp, series, x) for series in piece.v]
        self.last = value(mp, piece.t, x)
        self.past += self.last
        return self.last

    def remember_speed(self) -> None:
        """Keep the largest speed so far, that of stored energy included: the scale of all tolerances."""
        mp = self.mp
        for c, a in enumerate(self.touches):
            w, stored, p = self.w[c] + self.w[c + 1], mp.zero, self.number(a.p)
            if a.xi > 0:
                stored = 2 * w * a.k * mp.power(a.xi, p + 1) / (p + 1)
            elif a.xi == 0 and self.pull[c] > 0:
                stored = 2 * self.pull[c] * mp.power(self.pull[c] / (a.k * w), 1 / p)
            self.speed = max(self.speed, abs(self.rate(c)), mp.sqrt(stored))


class Force:
    """The series F = ξ^d φ, φ = k ξ^(p-d) + γ ξ̇, of one pair (F = k ξ^p without damping)."""

    def __init__(self, motion: Motion, c: int, piece: Piece, m: int) -> None:
        self.mp, self.x, self.lower, self.upper = motion.mp, piece.x[c], piece.v[c], piece.v[c + 1]
        self.a, a = motion.touches[c], motion.touches[c]
        power = a.p - a.d if a.gamma else a.p
        self.elastic = None if power == 1 else Power(self.mp, self.x, motion.number(power), m)
        self.front = Power(self.mp, self.x, motion.number(a.d), m) if a.gamma and a.d else None
        self.phi: list[Number] = []
        self.front_terms: list[Number] = []

    def term(self, n: int) -> Number:
        """Coefficient `n` of the force; 0 of a clipped one, whose bracket alone goes on."""
        a = self.a
        phi = a.k * (self.x[n] if self.elastic is None else self.elastic.term(n))
        if a.gamma:
            phi += a.gamma * (self.lower[n] - self.upper[n])
        self.phi.append(self.mp.zero if n == 0 and a.exact else phi)
        if self.front is not None and a.mode == ACTIVE:
            self.front_terms.append(self.front.term(n))
            return product_term(self.mp, self.front_terms, self.phi, n)
        return self.phi[-1] if a.mode == ACTIVE else self.mp.zero


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

