"""Piles of linear contacts by modes: a proof that one rests, which energy cannot see while it creeps, and its motion.

A pile of linear contacts moves about its equilibrium as y = (ξ - ξ°, η) = Σ c_m V_m e^(λ_m t); the force of pair c is

    F_c(t) = F°_c + Σ_m a_cm e^(λ_m t) ,   a_cm = c_m (k V_cm + γ V_(n+c)m) ,

and with Re λ_m ≤ 0 it never falls below F°_c + Σ min(0, a_cm) over real λ_m - Σ |a_cm| over complex ones. If that is
positive for every pair, no force ever vanishes, hence nothing else can happen. A creeping mode has a large amplitude,
hence energy, but moves no force: k ξ and γ η cancel. From then on y(t) = e^(At) y(0), at any time in one step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array
from granular.md.located.records import LINEAR, OPEN
from granular.md.located.rest.equilibrium import end_of_group, find_loads
from granular.md.located.rest.proof import between, closes

LARGEST = 100
"""Pairs beyond which the proof is not tried: it costs their number cubed."""
SMOOTH = 1e-13
"""Part of the static force up to which what swings is rounding: the rest creeps, and a series would take long."""
SURE = 1e-6
"""Part of the static force by which the bound must be positive, against rounding in the modes."""


def matrices(pairs: list[Any]) -> Array:
    """The matrix A of ẏ = A y for small motions y = (ξ, η) about the current overlaps of touching pairs."""
    k = np.array([p.k if p.p == 1.0 else p.k * p.p * p.xi ** (p.p - 1.0) for p in pairs])
    gamma = np.array([p.gamma if p.d == 0.0 else p.gamma * p.xi**p.d for p in pairs])
    lower, own, upper = np.array([(p.lower, -p.inverse, p.upper) for p in pairs]).T
    w = np.diag(lower[1:], 1) + np.diag(own) + np.diag(upper[:-1], -1)
    return np.block([[np.zeros_like(w), np.eye(len(pairs))], [w * k, w * gamma]])


def swinging(pairs: list[Any], load: Array) -> float:
    """Return what part of a static contact force still swings; inf if the forces are not proved positive forever.

    `pairs` are the records of a pile of balls at a wall, `load` what each bears at rest, in N.
    """
    n = len(pairs)
    if n == 0 or not all(p.kind == LINEAR and p.gamma > 0.0 for p in pairs):
        return math.inf
    k, gamma, xi, eta = columns(pairs)
    rates, modes = np.linalg.eig(matrices(pairs))
    if np.linalg.cond(modes) > 1e12 or rates.real.max() > 0.0:
        return math.inf
    part = np.linalg.solve(modes, np.concatenate([xi - load / k, eta]).astype(complex))
    force = (k[:, None] * modes[:n] + gamma[:, None] * modes[n:]) * part
    lowest = np.where(rates.imag == 0.0, np.minimum(0.0, force.real), -abs(force)).sum(axis=1)
    if not np.all(load + lowest > SURE * load):
        return math.inf
    return float((np.where(rates.imag == 0.0, 0.0, abs(force)).sum(axis=1) / load).max())


def columns(pairs: list[Any]) -> Array:
    """Stiffness in N/m, damping in kg/s, overlaps in m and rates in m/s."""
    return np.array([(p.k, p.gamma, p.xi, p.eta) for p in pairs]).T


def slowest_decay(pairs: list[Any], closed: bool) -> float:
    """Return the time in s in which the slowest motion about the current state of a pile falls by e (inf: never).

    Between two walls (`closed`) the sum of overlaps is fixed: no motion changes it.
    """
    a, n = matrices(pairs), len(pairs)
    if closed:
        free = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, 1:]]))[0][:, 1:]
        moving = np.kron(np.eye(2), free)
        a = moving.T @ a @ moving
    slowest = -float(np.linalg.eigvals(a).real.max())
    return 1.0 / slowest if slowest > 0.0 else float("inf")


class Flight(NamedTuple):
    """An open pair beside a pile: its record, rate of its gap in m/s and closing acceleration in m/s², that at rest."""

    pair: Any
    rate: float
    pull: float


class Creep:
    """The motion of a pile of linear contacts that stay closed forever, from an instant on."""

    def __init__(self, block: Any, pairs: list[Any], load: Array, flights: list[Flight]) -> None:
        """Start from the records of a block, of the pairs of its pile at a wall, and of the open pairs beside it."""
        self.start, self.matrix, self.load = float(block.t), matrices(pairs), load
        self.block, self.pairs, self.flights = block, pairs, flights
        self.k, self.gamma, self.xi, eta = columns(pairs)
        self.gaps = [flight.pair.xi for flight in flights]
        self.y = np.concatenate([self.xi - load / self.k, eta])

    def after(self, elapsed: float) -> tuple[Array, Array, Array, Array]:
        """Overlaps (m), rates (m/s), forces (N), and impulses (N s) since the start, a time into the run."""
        n, dt = len(self.k), elapsed - self.start
        change = exponential_minus_one(self.matrix, dt) @ self.y
        y = self.y + change
        push = np.linalg.solve(self.matrix[n:, :n] / self.k, change[n:])  # A_21 = -WK, and -W∫(F - F°) dt = Δη
        return y[:n] + self.load / self.k, y[n:], self.load + self.k * y[:n] + self.gamma * y[n:], self.load * dt + push

    def show(self, elapsed: float) -> None:
        """Put the state of a time into the run into the records; the gap beside the pile grows as it sinks."""
        xi, eta, force = self.after(elapsed)[:3]
        for p, *now in zip(self.pairs, xi.tolist(), eta.tolist(), force.tolist(), strict=True):
            p.x[0], p.e[0], p.f[0] = now
        self.block.tau = 0.0
        dt = elapsed - self.start
        for (pair, rate, pull), gap in zip(self.flights, self.gaps, strict=True):
            pair.x[0] = gap + (0.5 * pull * dt - rate) * dt - float((xi - self.xi).sum())
            pair.e[0] = pull * dt - rate - float(eta.sum())

    def books(self, elapsed: float, speed: float) -> tuple[float, float]:
        """Work (J) of the floor, whose constant velocity (m/s) is `speed`, and energy dissipated, since the start."""
        n, (xi, eta, _, impulse) = len(self.k), self.after(elapsed)
        lost = self._energy(self.y[:n], self.y[n:]) - self._energy(xi - self.load / self.k, eta)
        return speed * float(impulse[0]), lost

    def _energy(self, y: Array, eta: Array) -> float:
        """Energy in J about the equilibrium, as the floor sees it."""
        v, mass = np.cumsum(eta), np.array([1.0 / p.upper for p in self.pairs])
        return float(0.5 * (self.k * y * y + mass * v * v).sum())

    def finish(self, elapsed: float) -> list[float]:
        """Add the time up to the end of the run to the records of the contacts; return the impulse of each.

        A creeping pile has its largest overlaps and forces at the ends of that time, or nearly so.
        """
        looks = [self.after(self.start + (elapsed - self.start) * 0.5**i) for i in range(60)]
        impulse: list[float] = self.after(elapsed)[3].tolist()
        for i, p in enumerate(self.pairs):
            p.duration += elapsed - self.start
            p.impulse += impulse[i]
            p.xi_max = max(p.xi_max, *(xi[i] for xi, _, _, _ in looks))
            p.force_max = max(p.force_max, *(force[i] for _, _, force, _ in looks))
        return impulse


def exponential_minus_one(a: Array, dt: float) -> Array:
    """Return e^(a dt) - 1 by its Taylor series and repeated squaring, E ← 2E + E², which keeps what is slow."""
    n = len(a) // 2
    size = np.repeat([math.sqrt(abs(a[n:, :n]).max()), 1.0], n)  # overlaps as rates
    scaled = a * dt * size[:, None] / size
    halvings = max(0, math.ceil(math.log2(max(abs(scaled).sum(axis=1).max(), 1e-300))) + 1)
    step = scaled * 0.5**halvings
    out = term = step
    for j in range(2, 19):
        term = term @ step / j
        out = out + term
    for _ in range(halvings):
        out = 2.0 * out + out @ out
    change: Array = out * size / size[:, None]
    return change


def creeping_from(s: Any, most: float) -> Creep | None:
    """Return the motion from now on of a scene that creeps to rest, its forces swinging by less than the part `most`;
    None of any other."""
    a, b = lone_pile(s)
    members = [s.pool[s.pairs[c].slot] for c in range(a, b)]
    load = np.array([p.load for p in members])
    if not swinging(members, load) < most:
        return None
    lo = s.pairs[a].first
    flights = [Flight(s.pool[s.pairs[c].slot], *between(s.pairs, s.pool, s.bodies, lo, c)[1:])
               for c in (a - 1, b) if lo <= c < s.pairs[lo].hi]
    return Creep(s.pool[s.pairs[lo].slot], members, load, flights)


def lone_pile(s: Any) -> tuple[int, int]:
    """Return first pair and end of the one group of a scene, a pile at a wall, and note its loads; (0, 0) if there is
    none, a pair bears nothing at rest, or a gap may close."""
    run, pairs, pool, bodies = s.run[0], s.pairs, s.pool, s.bodies
    pressed = [c for c, p in enumerate(pairs) if p.slot >= 0 and pool[p.slot].mode != OPEN]
    if not pressed:
        return 0, 0
    a, b = pressed[0], end_of_group(pairs, pool, pressed[0])
    at_one_wall = (bodies[a].inverse_mass == 0.0) != (bodies[b].inverse_mass == 0.0)
    if b - a < len(pressed) or not at_one_wall or pairs[0].wall != 0 or pairs[-1].wall != 0:
        return 0, 0
    if not find_loads(pairs, pool, bodies, a, b) or min(pool[pairs[c].slot].load for c in pressed) <= 0.0:
        return 0, 0
    starts = (c for c, p in enumerate(pairs) if p.first == c)
    return (0, 0) if any(closes(run, pairs, pool, bodies, c) for c in starts) else (a, b)

