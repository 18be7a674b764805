"""Newton's equation solved by Taylor series in many digits.

The solver is slow, and independent of the engines that it checks. A step is a power series in x. The clock of one pair
maps x to time: dt/dx = u^(q-1) with u = ξ^(1/q). Then du/dx = ξ̇/q, so that u passes through zero linearly. A force
with a fractional power of ξ is then a power series in x throughout a contact: where it begins (there t ∼ x^q), where it
ends, and between. The pair whose overlap is nearest to zero sets the clock. Near zeros of other overlaps, the steps
shrink and grow with the distance from the zero. Without fractional powers x is the time.

A pair that touches at rest stays dormant up to a small fraction of the overlap of an impact. The neglected effect is
below the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bench.reference.series import Force, Piece, Power, WallSeries, first_rise, product_term, work_done
from bench.reference.state import State
from granular import until as stop
from granular.studies.reference_events import ACTIVE, CLOSED_MODES, Reference, Run, Watch
from granular.studies.reference_walls import Number, value

SERIES_WINDOWS = 3
"""Minimum order of the series, in units of the window of last terms.

The terms in the window set the step size. If the window were most of the series, its low terms would have to be as
small as the tolerance, and the steps would be short.
"""
MAX_STEPS = 20_000


def solve(
    scene: Any, forms: Sequence[Any], until: stop.Until | None, t_end: float | None, digits: int, t_start: float = 0.0
) -> Reference:
    """Solve a scene of laws F = k ξ^p + γ ξ^d ξ̇ to about `digits` digits.

    `forms` contains (k, p, γ, d) of each pair.
    """
    motion = Taylor(scene, forms, digits, t_start)
    return Run(motion, until, t_end).solve(f"Taylor series of order {motion.order}, {digits} digits")


class Taylor(State):
    """Motion of the bodies, expanded from the current state into a `Piece`."""

    def __init__(self, scene: Any, forms: Sequence[Any], digits: int, t_start: float = 0.0) -> None:
        super().__init__(scene, forms, digits, t_start)
        self.steps, self.tol = 0, self.mp.mpf(10) ** (-digits - 2)
        # in a new contact only every (q + pq)-th term is not zero
        self.window = max(6, *(round(a.q * (1 + a.p)) for a in self.touches))
        self.order = max(round(1.25 * digits), SERIES_WINDOWS * self.window)

    def ends(self, c: int) -> list[Watch]:
        """Events that can end the force of pair c.

        A damped force reaches zero while the pair still overlaps. An elastic force ends with the overlap.
        """
        return [Watch(c, "release", "bracket", -1) if self.touches[c].gamma else Watch(c, "part", "overlap", -1)]

    def clock_pair(self) -> tuple[int, int]:
        """Pair c and root order q of the clock dt = u^(q-1) dx of the next step.

        The overlap of pair c is nearest to zero. The order q also makes overlaps regular that are almost as near. The
        values −1 and 1 denote the plain clock.
        """
        away = {  # a pair that just began at rest and still closes is already regular
            c: self.time_to_zero_overlap(c) for c, a in enumerate(self.touches)
            if a.q > 1 and self.mode[c] in CLOSED_MODES and not (a.woken and self.now(c, "rate") > 0)
        }
        if not away:
            return -1, 1
        pair = min(away, key=lambda c: away[c])
        return pair, math.lcm(*(self.touches[c].q for c in away if away[c] <= 2 * away[pair]))

    def time_to_zero_overlap(self, c: int) -> Number:
        """Time in s from or to zero overlap of pair c at its current rate."""
        xi, rate = self.touches[c].xi, self.now(c, "rate")
        return abs(xi / rate) if rate else self.mp.inf

    def expand(self) -> Piece:
        """Series of the current state."""
        mp, (pair, q) = self.mp, self.clock_pair()
        u = [mp.root(self.touches[pair].xi, q) if pair >= 0 else mp.one]
        ahead = 1 if u[0] else q  # orders by which velocities and overlaps lead the forces
        here = [a.xi for a in self.touches], self.v, self.y, self.across(self.v)
        x, v, y, rate = ([[b, *[mp.zero] * (ahead - 1)] for b in start] for start in here)
        walls = {b: WallSeries(mp, path.rates(self.t), path.last, ahead) for b, path in self.paths.items()}
        piece = Piece(x, v, y, rate, [mp.zero] * ahead, {}, walls, pair, q, u)
        closed = (c for c, mode in enumerate(self.mode) if mode in CLOSED_MODES)
        piece.force = {c: Force(mp, self.touches[c], self.mode[c] == ACTIVE, x[c], rate[c]) for c in closed}
        power, rho = Power(mp, u, mp.mpf(q - 1), int(ahead > 1)), [] if pair >= 0 else u
        for m in range(ahead, self.order + 1):
            if pair >= 0:
                u += [rate[pair][j - 1] / (q * j) for j in range(len(u), m + 1)]
                rho += [power.term(j) for j in range(len(rho), m)]
            self.extend(piece, rho, m, ahead)
        return piece

    def extend(self, piece: Piece, rho: list[Number], m: int, ahead: int) -> None:
        """Append coefficient `m` to all series, with the clock ρ = dt/dx."""
        mp, impulse = self.mp, [self.mp.zero] * (len(piece.v) + 1)  # from the pair below each body
        piece.t.append(rho[m - 1] / m if m <= len(rho) else mp.zero)
        for series, rate in zip(piece.x, piece.rate, strict=True):
            series.append(product_term(mp, rho, rate, m - 1) / m)
        for c, force in piece.force.items():
            force.extend(m - ahead)
            impulse[c + 1] = product_term(mp, rho, force.terms, m - 1) / m
        if self.ring:  # the last pair joins the last body and the first
            impulse[0] = impulse[-1]
        for b, series in enumerate(piece.v):
            series.append(self.w[b] * (impulse[b] - impulse[b + 1]) + self.fall[b] * piece.t[m])
        for b, wall in piece.walls.items():
            piece.v[b][m] = wall.extend(rho, m)
        for b, series in enumerate(piece.y):
            if self.w[b]:
                piece.v[b][m] -= self.square * product_term(mp, rho, series, m - 1) / m
            series.append(product_term(mp, rho, piece.v[b], m - 1) / m)
        for series, (lower, upper) in zip(piece.rate, self.joined, strict=True):
            series.append(piece.v[lower][m] - piece.v[upper][m])

    def step_limit(self, piece: Piece) -> Number:
        """Largest x at which the last terms of all series are below the tolerance.

        The window of last terms is wide enough to contain a non-zero term. In a contact that has just begun, only every
        (q + pq)-th term is not zero. Without an active force, a step lasts at most twice the time until all overlapping
        pairs have separated.
        """
        mp, limits = self.mp, []
        watched = [*((b, self.speed) for b in piece.v),
                   *((f.phi, f.a.gamma * self.speed) for f in piece.force.values() if not f.active)]
        if piece.pair >= 0:
            u = piece.u[int(piece.u[0] == 0) :]
            watched.append((u, u[0]))
        for series, scale in watched:
            for j in range(max(2, len(series) - self.window), len(series)):
                if series[j] != 0:
                    limits.append(mp.root(self.tol * scale / abs(series[j]), j))
        if piece.force and ACTIVE not in self.mode:
            # no force acts, so the pairs that still overlap only separate
            limits.append(2 * piece.q * max(self.time_to_zero_overlap(c) for c in piece.force) / piece.t[1])
        return min(limits, default=mp.inf)

    def step_end(self, piece: Piece, reach: Number, end: Number) -> Number:
        """x at which the time is `end`, or `reach` if that is smaller."""
        if reach == end == self.mp.inf:  # all balls rest under forces that balance exactly
            raise ValueError("`t_end` must be given, got None. All balls are at rest, and no event follows.")
        if piece.pair < 0:
            return min(reach, end - self.t)
        if reach == self.mp.inf:
            return (end - self.t) / piece.t[1]
        x = first_rise(self.mp, [self.t - end, *piece.t[1:]], reach) if end < self.mp.inf else None
        return reach if x is None else x

    def go(self, watches: list[Watch], end: Number) -> Watch | None:
        """Advance to the first event, to the time `end` in s, or to the step limit."""
        if self.steps == MAX_STEPS:
            raise ValueError("`t_end` must be given, or be smaller. "
                             f"The scene is at t = {float(self.t):.6g} s after {MAX_STEPS} steps.")
        self.steps += 1
        if self.advance_free_flight(end):
            return None
        piece, end = self.expand(), min([end, *(path.until(self.t) for path in self.paths.values())])
        holds, event = self.step_limit(piece), None
        reach = limit = self.step_end(piece, holds, end)
        for watch in watches:
            x = first_rise(self.mp, self.series(piece, watch), reach)
            if x is not None and x < reach:
                reach, event = x, watch
        self.move(piece, reach)
        if event is None and limit < holds:  # `end` limited the step: set the time without rounding
            self.t = self.mp.mpf(end)
        self.set_wall_velocities()
        # at x = 0 the velocity of a wall has jumped, and the bracket need not be zero
        if event is not None and event.quantity == "bracket" and reach > 0:
            self.touches[event.pair].exact = True
        return event

    def series(self, piece: Piece, watch: Watch) -> list[Number]:
        """Series that rises through zero at the watched event.

        For the clock pair it is the series of u, which has a simple zero where ξ has a multiple zero.
        """
        c, sign, level = watch.pair, watch.sign, watch.level
        if watch.quantity == "bracket":
            return [sign * a for a in piece.force[c].phi]
        p = piece.u if c == piece.pair else piece.x[c]
        return [sign * (p[0] - level), *(sign * a for a in p[1:])]

    def move(self, piece: Piece, x: Number) -> None:
        """Advance to x of the piece."""
        if x == 0:
            return
        if self.work:  # only scenes with moving or thermal walls have an account
            self.add_work(piece, x)
        for a, series in zip(self.touches, piece.x, strict=True):
            a.xi, a.exact = value(series, x), False
        self.v, self.y = ([value(series, x) for series in each] for each in (piece.v, piece.y))
        self.t += value(piece.t, x)

    def add_work(self, piece: Piece, x: Number) -> None:
        """Add the work of the forces up to x of the piece, on overlaps and by walls."""
        rho, last = [j * a for j, a in enumerate(piece.t)][1:], len(self.touches) - 1
        for c, force in piece.force.items():
            if force.active:
                self.pushed += work_done(self.mp, force.terms, piece.rate[c], rho, x)
                for side, b in ((0, 0), (1, last + 1)):
                    if c == side * last and not self.w[b]:
                        self.work[side] += (1 - 2 * side) * work_done(self.mp, force.terms, piece.v[b], rho, x)
