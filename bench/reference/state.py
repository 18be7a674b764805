"""State of the bodies in many digits, their free flight, and thermal walls.

The state consists of the overlaps ξ of the pairs and the velocities v of the bodies, as mpmath numbers in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bench.reference.series import touch
from granular.studies.reference_events import DORMANT, OPEN, first_rise_of_parabola
from granular.studies.reference_walls import Number, Path, heats, paths

GUARD_DIGITS = 8
"""Digits carried in addition to the requested digits."""
FLIGHT_FRACTION = 0.999
"""Share of a flight that is covered in one step beside driven walls."""


class State:
    """Overlaps and velocities of a scene, and their motion without contact forces.

    `forms` contains (k, p, γ, d) of each pair.
    """

    def __init__(self, scene: Any, forms: Sequence[Any], digits: int, t_start: float = 0.0) -> None:
        from mpmath import MPContext

        self.mp = mp = MPContext()
        mp.dps = digits + GUARD_DIGITS
        self.t, self.digits = mp.mpf(t_start), digits
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
        self.speed = max([mp.zero, *(path.fastest for path in self.paths.values()),
                          *(mp.mpf(scene.pendulum) * abs(y) for y in self.y)])
        self.set_wall_velocities()
        self.update_speed_scale()
        self.stored = self.elastic()

    @property
    def curved(self) -> bool:
        """Whether a wall is driven, or all balls are pendula."""
        return bool(self.paths or self.y)

    def across(self, of_bodies: Sequence[Number]) -> list[Number]:
        """Lower minus upper body of every pair: rates of overlap from velocities."""
        return [of_bodies[lower] - of_bodies[upper] for lower, upper in self.joined]

    def set_wall_velocities(self) -> None:
        """Set the velocities of driven walls from their paths."""
        for b, path in self.paths.items():
            self.v[b] = self.own[b] + path.rates(self.t)[0]

    @property
    def pull(self) -> list[Number]:
        """Closing acceleration of every pair in m/s² without contact forces."""
        fall = [a - self.square * y for a, y in zip(self.fall, self.y, strict=True)] if self.y else list(self.fall)
        for b, path in self.paths.items():
            fall[b] = path.rates(self.t)[1]
        return self.across(fall)

    def now(self, c: int, quantity: str) -> Number:
        """Overlap in m, rate in m/s or bracket φ of pair c.

        The bracket has the sign of the force.
        """
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

    def resting_overlap(self, c: int) -> Number:
        """Overlap in m up to which a pair that touched at rest stays dormant.

        It is a fraction, below the tolerance, of the overlap at which pair c alone would stop from the largest speed.
        """
        mp, a, w = self.mp, self.touches[c], self.mobility(c)
        # all kinetic energy of the pair is elastic at this overlap
        depth = mp.power((a.p + 1) * self.speed**2 / (2 * a.k * w), 1 / (a.p + 1))
        return mp.mpf(10) ** (-self.digits / (min(a.p, a.d + 1) if a.gamma else a.p)) * depth

    def elastic(self) -> Number:
        """Elastic energy Σ U(ξ) in J."""
        closed = [a for a in self.touches if a.xi > 0]
        return sum((a.k * self.mp.power(a.xi, a.p + 1) / (a.p + 1) for a in closed), self.mp.zero)

    def account(self) -> tuple[Number, ...] | None:
        """Work of floor and ceiling, heat of both, and dissipated energy, in J.

        Return None if no wall moves or heats.
        """
        return (*self.work, self.pushed - (self.elastic() - self.stored)) if self.work else None

    def advance_free_flight(self, end: Number) -> bool:
        """Advance the flying balls in one step while they are far from all walls.

        Return whether the step was taken. It must cover at least a quarter of a period of a wall, or of the time until
        the path of a wall changes.
        """
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
        """Pairs beside driven walls, the side to which each wall pushes, and its path.

        Side 1 is upwards, side -1 downwards.
        """
        return [(0, 1, path) if b == 0 else (b - 1, -1, path) for b, path in self.paths.items()]

    def free_flights(self) -> list[list[Number]]:
        """Parabolas of overlaps without forces, for walls at constant velocities."""
        halves = [a / 2 for a in self.across(self.fall)]
        out = [[a.xi, self.now(c, "rate"), half] for c, (a, half) in enumerate(zip(self.touches, halves, strict=True))]
        for c, side, path in self.driven_pairs():
            out[c][1] -= side * path.rates(self.t)[0]
        return out

    def fly(self, dt: Number) -> None:
        """Advance by `dt` in s without forces."""
        for c, a in enumerate(self.touches):
            a.xi += dt * (self.now(c, "rate") + dt * self.pull[c] / 2)
        self.v = [v + g * dt for v, g in zip(self.v, self.fall, strict=True)]
        self.t += dt

    def kick(self, c: int) -> None:
        """Give the ball of pair c a random speed away from its thermal wall.

        The work and the heat of the wall are added to the energy account.
        """
        one, wall = self.heat[c], self.v[self.heat[c].wall]
        speed, was = self.mp.mpf(one.next_speed()), abs(self.v[one.ball] - wall)
        away = 1 - 2 * one.side
        self.v[one.ball] = wall + away * speed
        self.work[one.side] += one.mass * (speed + was) * away * wall
        self.work[2 + one.side] += one.mass * (speed - was) * (speed + was) / 2
        self.update_speed_scale()

    def record_event(self, c: int, what: str) -> None:
        """Update the state of pair c after an event."""
        if what in ("touch", "part") and self.mode[c] != DORMANT:
            self.touches[c].xi = self.mp.zero
        self.touches[c].woken = self.mode[c] == DORMANT
        self.update_speed_scale()

    def update_speed_scale(self) -> None:
        """Update the largest speed so far, which scales all tolerances.

        The speed that corresponds to stored energy is included.
        """
        mp = self.mp
        for c, a in enumerate(self.touches):
            w, g = self.mobility(c), self.pull[c]
            pressed = a.xi == 0 and g > 0
            stored = 2 * g * mp.power(g / (a.k * w), 1 / a.p) if pressed else (
                2 * w * a.k * mp.power(max(a.xi, 0), a.p + 1) / (a.p + 1))
            self.speed = max(self.speed, abs(self.now(c, "rate")), mp.sqrt(stored))


def displacements(mp: Any, scene: Any) -> list[Number]:
    """Displacements of pendula from their rest positions, or an empty list."""
    if scene.rest_gap is None:
        return []
    walls, out = scene.is_wall.tolist(), [mp.mpf(scene.origin)]
    for gap, rest in zip(scene.gap.tolist(), scene.rest_gap.tolist(), strict=True):
        out.append(out[-1] + mp.mpf(gap) - mp.mpf(rest))
    fixed = out[walls.index(True)] if any(walls) else mp.zero
    return [mp.zero if wall else y - fixed for wall, y in zip(walls, out, strict=True)]
