"""Newton's equation by Taylor series in many digits: slow, and written without a look at the engines it judges.

State: overlaps ξ of the pairs and velocities v of the bodies, as mpmath numbers in SI units. A step is a power series
in x, the time by the clock of one pair: dt/dx = u^(q-1) with u = ξ^(1/q). Then du/dx = ξ̇/q: u goes through zero
linearly, and a force like a fractional power of ξ is a power series in x, where it begins (there t ∼ x^q), where it
ends, and between. The clock is that of the pair whose overlap is nearest to zero; to the zeros of others, steps shrink
and grow like their distance. Without fractional powers x is the time.

A pair that touches at rest sleeps until its overlap is a small part of that of an impact; what it leaves out is below
the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bench.reference.series import Force, Piece, Power, WallSeries, first_rise, product_term, touch, work_done
from granular import until as stop
from granular.studies.reference_events import (
    ACTIVE,
    CLOSED,
    DORMANT,
    OPEN,
    Reference,
    Run,
    Watch,
    first_rise_of_parabola,
)
from granular.studies.reference_walls import Number, Path, heats, paths, value

GUARD_DIGITS = 8
"""Digits carried beyond those asked for."""
SERIES_WINDOWS = 3
"""Order of the series at least, in units of the window of last terms that sets the step: were the window most of the
series, its low terms would have to be as small as the tolerance, and steps with them."""
MAX_STEPS = 20_000
FLIGHT_FRACTION = 0.999
"""Part of a flight that is made at once where walls are driven."""


def solve(
    scene: Any, forms: Sequence[Any], until: stop.Until | None, t_end: float | None, digits: int, t_start: float = 0.0
) -> Reference:
    """Solve a scene of laws F = k ξ^p + γ ξ^d ξ̇, given as (k, p, γ, d) per pair, to about that many digits."""
    motion = Taylor(scene, forms, digits, t_start)
    return Run(motion, until, t_end).solve(f"Taylor series of order {motion.order}, {digits} digits")


class Taylor:
    """The bodies under their forces: expands the current state into a `Piece` and moves along it."""

    def __init__(self, scene: Any, forms: Sequence[Any], digits: int, t_start: float = 0.0) -> None:
        from mpmath import MPContext

        self.mp = mp = MPContext()
        mp.dps = digits + GUARD_DIGITS
        self.t, self.steps, self.digits, self.tol = mp.mpf(t_start), 0, digits, mp.mpf(10) ** (-digits - 2)
        self.w = [mp.zero if math.isinf(m) else 1 / mp.mpf(m) for m in scene.mass.tolist()]
        self.fall = [-mp.mpf(scene.gravity) if w else mp.zero for w in self.w]
        if scene.external_force is not None:
            forces = map(mp.mpf, scene.external_force.tolist())
            self.fall = [a + w * f for a, w, f in zip(self.fall, self.w, forces, strict=True)]
        self.v = [mp.mpf(v) for v in scene.velocity.tolist()]
        self.ring, self.heat, self.paths, self.own = scene.ring, heats(scene), paths(mp, scene), list(self.v)
        self.joined = [scene.bodies(c) for c in range(scene.n_pairs)]
        self.square, self.y = mp.mpf(scene.pendulum) ** 2, displacements(mp, scene)
        self.work, self.pushed = [mp.zero] * 4 * scene.fed, mp.zero
        self.touches = [touch(mp, form, gap) for form, gap in zip(forms, scene.gap.tolist(), strict=True)]
        self.mode = [OPEN] * len(self.touches)
        self.window = max(6, *(round(a.q * (1 + a.p)) for a in self.touches))
        self.order = max(round(1.25 * digits), SERIES_WINDOWS * self.window)
        self.speed = max([mp.zero, *(path.fastest for path in self.paths.values()),
                          *(mp.mpf(scene.pendulum) * abs(y) for y in self.y)])
        self.set_wall_velocities()
        self.update_speed_scale()
        self.stored = self.elastic()

    @property
    def curved(self) -> bool:
        """Whether a wall moves otherwise than at constant speed, or all are pendula."""
        return bool(self.paths or self.y)

    def across(self, of_bodies: Sequence[Number]) -> list[Number]:
        """Lower minus upper body of every pair: rates of overlaps from velocities."""
        return [of_bodies[lower] - of_bodies[upper] for lower, upper in self.joined]

    def set_wall_velocities(self) -> None:
        """Give driven walls the velocities of their paths."""
        for b, path in self.paths.items():
            self.v[b] = self.own[b] + path.rates(self.t)[0]

    @property
    def pull(self) -> list[Number]:
        """Closing acceleration of every pair in m/s² without contacts."""
        fall = [a - self.square * y for a, y in zip(self.fall, self.y, strict=True)] if self.y else list(self.fall)
        for b, path in self.paths.items():
            fall[b] = path.rates(self.t)[1]
        return self.across(fall)

    def now(self, c: int, quantity: str) -> Number:
        """The overlap of pair c in m, its rate in m/s, or its bracket φ, which has the sign of its force."""
        a, (lower, upper) = self.touches[c], self.bodies(c)
        rate = lower - upper
        if quantity == "bracket":
            return a.k * self.mp.power(a.xi, a.p - a.d) + a.gamma * rate
        return a.xi if quantity == "overlap" else rate

    def bodies(self, c: int) -> tuple[Number, Number]:
        """Velocities of the bodies of pair c in m/s."""
        lower, upper = self.joined[c]
        return self.v[lower], self.v[upper]

    def mobility(self, c: int) -> Number:
        """1/m_eff of pair c in 1/kg."""
        lower, upper = self.joined[c]
        return self.w[lower] + self.w[upper]

    def asleep(self, c: int) -> Number:
        """The part of the overlap at which pair c alone would stop from the largest speed that is below tolerance."""
        mp, a, w = self.mp, self.touches[c], self.mobility(c)
        depth = mp.power((a.p + 1) * self.speed**2 / (2 * a.k * w), 1 / (a.p + 1))
        return mp.mpf(10) ** (-self.digits / (min(a.p, a.d + 1) if a.gamma else a.p)) * depth

    def ends(self, c: int) -> list[Watch]:
        """A damped force falls to zero while there is still overlap; an elastic one ends with it."""
        return [Watch(c, "release", "bracket", -1) if self.touches[c].gamma else Watch(c, "part", "overlap", -1)]

    def clock_pair(self) -> tuple[int, int]:
        """The pair c on whose clock dt = u^(q-1) dx the next step runs, since its overlap is nearest to zero, and the q
        that makes all about as near regular; −1 and 1: the plain clock."""
        away = {  # one just woken that still closes is regular already
            c: self.time_to_zero_overlap(c) for c, a in enumerate(self.touches)
            if a.q > 1 and self.mode[c] in CLOSED and not (a.woken and self.now(c, "rate") > 0)
        }
        if not away:
            return -1, 1
        pair = min(away, key=lambda c: away[c])
        return pair, math.lcm(*(self.touches[c].q for c in away if away[c] <= 2 * away[pair]))

    def time_to_zero_overlap(self, c: int) -> Number:
        """Time in s in which the overlap of pair c would go from or to zero at its current rate."""
        xi, rate = self.touches[c].xi, self.now(c, "rate")
        return abs(xi / rate) if rate else self.mp.inf

    def expand(self) -> Piece:
        """The series of the current state."""
        mp, (pair, q) = self.mp, self.clock_pair()
        u = [mp.root(self.touches[pair].xi, q) if pair >= 0 else mp.one]
        ahead = 1 if u[0] else q  # orders by which velocities and overlaps are ahead of forces
        here = [a.xi for a in self.touches], self.v, self.y, self.across(self.v)
        x, v, y, rate = ([[b, *[mp.zero] * (ahead - 1)] for b in start] for start in here)
        walls = {b: WallSeries(mp, path.rates(self.t), path.last, ahead) for b, path in self.paths.items()}
        piece = Piece(x, v, y, rate, [mp.zero] * ahead, {}, walls, pair, q, u)
        closed = (c for c, mode in enumerate(self.mode) if mode in CLOSED)
        piece.force = {c: Force(mp, self.touches[c], self.mode[c] == ACTIVE, x[c], rate[c]) for c in closed}
        power, rho = Power(mp, u, mp.mpf(q - 1), int(ahead > 1)), [] if pair >= 0 else u
        for m in range(ahead, self.order + 1):
            if pair >= 0:
                u += [rate[pair][j - 1] / (q * j) for j in range(len(u), m + 1)]
                rho += [power.term(j) for j in range(len(rho), m)]
            self.extend(piece, rho, m, ahead)
        return piece

    def extend(self, piece: Piece, rho: list[Number], m: int, ahead: int) -> None:
        """Append coefficient `m` to the series, by the clock ρ = dt/dx."""
        mp, impulse = self.mp, [self.mp.zero] * (len(piece.v) + 1)  # of the pair below each body
        piece.t.append(rho[m - 1] / m if m <= len(rho) else mp.zero)
        for series, rate in zip(piece.x, piece.rate, strict=True):
            series.append(product_term(mp, rho, rate, m - 1) / m)
        for c, force in piece.force.items():
            force.extend(m - ahead)
            impulse[c + 1] = product_term(mp, rho, force.terms, m - 1) / m
        if self.ring:
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
        """Up to which x the series hold to the tolerance, from their last terms, and nothing is overlooked.

        From as many as make sure that one is not zero: in a contact that has just begun only every (q + pq)-th is not.
        Where no force acts, up to twice the way of the pairs that still overlap: they fly apart.
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
            limits.append(2 * piece.q * max(self.time_to_zero_overlap(c) for c in piece.force) / piece.t[1])
        return min(limits, default=mp.inf)

    def step_end(self, piece: Piece, reach: Number, end: Number) -> Number:
        """The x below `reach` at which the time is `end`; `reach` if it is not reached."""
        if reach == end == self.mp.inf:  # all is at rest under forces that balance to the last digit
            raise ValueError("t_end is missing: all balls are at rest, and nothing follows.")
        if piece.pair < 0:
            return min(reach, end - self.t)
        if reach == self.mp.inf:
            return (end - self.t) / piece.t[1]
        x = first_rise(self.mp, [self.t - end, *piece.t[1:]], reach) if end < self.mp.inf else None
        return reach if x is None else x

    def go(self, watches: list[Watch], end: Number) -> Watch | None:
        """Move on to the first event, to the time `end` in s, or as far as the series hold."""
        if self.steps == MAX_STEPS:
            raise ValueError(f"t_end is missing: after {MAX_STEPS} steps the scene is at t = {float(self.t):.6g} s.")
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
        if event is None and limit < holds:
            self.t = self.mp.mpf(end)
        self.set_wall_velocities()
        if event is not None and event.quantity == "bracket" and reach > 0:  # at 0 a wall's velocity has jumped
            self.touches[event.pair].exact = True
        return event

    def series(self, piece: Piece, watch: Watch) -> list[Number]:
        """What rises through zero when that happens: where ξ has a multiple zero, its root has a simple one."""
        c, sign, level = watch.pair, watch.sign, watch.level
        if watch.quantity == "bracket":
            return [sign * a for a in piece.force[c].phi]
        p = piece.u if c == piece.pair else piece.x[c]
        return [sign * (p[0] - level), *(sign * a for a in p[1:])]

    def move(self, piece: Piece, x: Number) -> None:
        """Advance to x of the piece."""
        if x == 0:
            return
        if self.work:
            self.add_work(piece, x)
        for a, series in zip(self.touches, piece.x, strict=True):
            a.xi, a.exact = value(series, x), False
        self.v, self.y = ([value(series, x) for series in each] for each in (piece.v, piece.y))
        self.t += value(piece.t, x)

    def add_work(self, piece: Piece, x: Number) -> None:
        """Add what forces do up to x of the piece: on overlaps, and for the walls."""
        rho, last = [j * a for j, a in enumerate(piece.t)][1:], len(self.touches) - 1
        for c, force in piece.force.items():
            if force.active:
                self.pushed += work_done(self.mp, force.terms, piece.rate[c], rho, x)
                for side, b in ((0, 0), (1, last + 1)):
                    if c == side * last and not self.w[b]:
                        self.work[side] += (1 - 2 * side) * work_done(self.mp, force.terms, piece.v[b], rho, x)

    def elastic(self) -> Number:
        """Σ U(ξ) in J."""
        closed = [a for a in self.touches if a.xi > 0]
        return sum((a.k * self.mp.power(a.xi, a.p + 1) / (a.p + 1) for a in closed), self.mp.zero)

    def account(self) -> tuple[Number, ...] | None:
        """Work of the floor and of the ceiling, heat of both, and what was dissipated, in J; None where no wall
        moves or heats."""
        return (*self.work, self.pushed - (self.elastic() - self.stored)) if self.work else None

    def advance_free_flight(self, end: Number) -> bool:
        """Move on at once, and return true, while no wall comes near flying balls; a good part of a turn at least."""
        room = [path.above(self.t, side) for _, side, path in self.driven_pairs()]
        if not room or self.mp.inf in room or any(mode != OPEN for mode in self.mode):
            return False
        flights = self.free_flights()
        for (c, _, _), above in zip(self.driven_pairs(), room, strict=True):
            flights[c][0] += above
        times = [first_rise_of_parabola(self.mp, p) for p in flights]
        dt = min([end - self.t, *(self.mp.mpf(FLIGHT_FRACTION) * t for t in times if t is not None)])
        if not min(path.until(self.t) - self.t for _, _, path in self.driven_pairs()) / 4 < dt < self.mp.inf:
            return False
        flights = self.free_flights()
        for c, side, path in self.driven_pairs():
            flights[c][0] += side * (path.moved(self.t + dt) - path.moved(self.t))
        for a, (xi, rate, half) in zip(self.touches, flights, strict=True):
            a.xi = xi + dt * (rate + dt * half)
        self.v = [v + g * dt for v, g in zip(self.v, self.fall, strict=True)]
        self.t = self.mp.mpf(end) if dt == end - self.t else self.t + dt
        self.set_wall_velocities()
        return True

    def driven_pairs(self) -> list[tuple[int, int, Path]]:
        """The pairs beside driven walls, to which side these push, 1 upwards, and their paths."""
        return [(0, 1, path) if b == 0 else (b - 1, -1, path) for b, path in self.paths.items()]

    def free_flights(self) -> list[list[Number]]:
        """The parabolas of overlaps without forces, were driven walls at their constant velocities."""
        halves = [a / 2 for a in self.across(self.fall)]
        out = [[a.xi, self.now(c, "rate"), half] for c, (a, half) in enumerate(zip(self.touches, halves, strict=True))]
        for c, side, path in self.driven_pairs():
            out[c][1] -= side * path.rates(self.t)[0]
        return out

    def fly(self, dt: Number) -> None:
        """Move on without forces for `dt` in s."""
        for c, a in enumerate(self.touches):
            a.xi += dt * (self.now(c, "rate") + dt * self.pull[c] / 2)
        self.v = [v + g * dt for v, g in zip(self.v, self.fall, strict=True)]
        self.t += dt

    def kick(self, c: int) -> None:
        """Let the ball of pair c leave a thermal wall with a speed drawn anew; book its work and heat."""
        one, wall = self.heat[c], self.v[self.heat[c].wall]
        speed, was = self.mp.mpf(one.next_speed()), abs(self.v[one.ball] - wall)
        away = 1 - 2 * one.side
        self.v[one.ball] = wall + away * speed
        self.work[one.side] += one.mass * (speed + was) * away * wall
        self.work[2 + one.side] += one.mass * (speed - was) * (speed + was) / 2
        self.update_speed_scale()

    def take_note(self, c: int, what: str) -> None:
        """Take note of an event of pair c."""
        if what in ("touch", "part") and self.mode[c] != DORMANT:
            self.touches[c].xi = self.mp.zero
        self.touches[c].woken = self.mode[c] == DORMANT
        self.update_speed_scale()

    def update_speed_scale(self) -> None:
        """Keep the largest speed so far, that of stored energy included: the scale of all tolerances."""
        mp = self.mp
        for c, a in enumerate(self.touches):
            w, g = self.mobility(c), self.pull[c]
            pressed = a.xi == 0 and g > 0
            stored = 2 * g * mp.power(g / (a.k * w), 1 / a.p) if pressed else (
                2 * w * a.k * mp.power(max(a.xi, 0), a.p + 1) / (a.p + 1))
            self.speed = max(self.speed, abs(self.now(c, "rate")), mp.sqrt(stored))


def displacements(mp: Any, scene: Any) -> list[Number]:
    """Of pendula, from where they rest; none without pendula."""
    if scene.rest_gap is None:
        return []
    walls, out = scene.is_wall.tolist(), [mp.mpf(scene.origin)]
    for gap, rest in zip(scene.gap.tolist(), scene.rest_gap.tolist(), strict=True):
        out.append(out[-1] + mp.mpf(gap) - mp.mpf(rest))
    fixed = out[walls.index(True)] if any(walls) else mp.zero
    return [mp.zero if wall else y - fixed for wall, y in zip(walls, out, strict=True)]
