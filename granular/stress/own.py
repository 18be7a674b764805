"""Force laws as users write them, without traits; one contact of each on a wall is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

from granular import until
from granular.laws import PowerLaw
from granular.scene import Pair, Scene
from granular.stress import truth
from granular.stress.cell import Cell, Truth


@dataclass(frozen=True)
class PlainPower:
    """F = k ξ^p."""

    k: float
    p: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * math.pow(xi, self.p)


@dataclass(frozen=True)
class PlainHertz:
    """F = k ξ^(3/2)."""

    k: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi * math.sqrt(xi)


@dataclass(frozen=True)
class PlainDashpot:
    """F = k ξ + γ ξ̇."""

    k: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + self.gamma * xi_dot


@dataclass(frozen=True)
class PlainViscoelastic:
    """F = √ξ (k ξ + γ ξ̇)."""

    k: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return math.sqrt(xi) * (self.k * xi + self.gamma * xi_dot)


@dataclass(frozen=True)
class TwoStiffnesses:
    """A spring that is k2 in place of k beyond the overlap xi1: a kink."""

    k: float
    k2: float
    xi1: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        if xi <= self.xi1:
            return self.k * xi
        return self.k * self.xi1 + self.k2 * (xi - self.xi1)


@dataclass(frozen=True)
class TwoDampings:
    """A dashpot that damps differently while loading and while unloading: a kink in the rate."""

    k: float
    loading: float
    unloading: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + (self.loading if xi_dot > 0.0 else self.unloading) * xi_dot


@dataclass(frozen=True)
class Hysteresis:
    """Loading k ξ; unloading straight to zero at rest · ξ_max."""

    k: float
    rest: float

    memory = True
    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        if xi >= xi_max:
            return self.k * xi
        return self.k * (xi - self.rest * xi_max) / (1.0 - self.rest)


def hits(axis: str, case: str, law: Any, expected: Truth, speed: float = 1.0) -> Cell:
    """Return the cell of a ball of 1 kg that hits a wall."""
    scene = Scene([math.inf, 1.0], [0.0, 0.5], [0.1], [0.0, -speed])
    return Cell(axis, case, scene, expected, law, options={"until": until.separated(), "max_steps": 50_000})


def powers() -> Iterator[Cell]:
    """Elastic powers n/12 from 1 to 16, with traits and without."""
    for n, law in product(range(12, 193), (PowerLaw, PlainPower)):
        yield hits("powers", f"ξ^({n}/12), {law.__name__}", law(1.0, n / 12.0), power_contact(1.0, n / 12.0))


def power_contact(k: float, p: float) -> Truth:
    """One contact of 1 kg at 1 m/s under F = k ξ^p: depth from energy, duration by the Gamma function."""
    a = 1.0 / (p + 1.0)
    depth = ((p + 1.0) / (2.0 * k)) ** a
    duration = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + a) / math.gamma(0.5 + a) * depth
    return truth.one_contact(1.0, 1.0, duration=duration, xi_max=depth, force_max=k * depth**p, impulse=2.0)


def kinks() -> Iterator[Cell]:
    """Laws with a kink in the overlap, in the rate, or at the turn of a loading cycle."""
    for ratio, part, v in product((0.1, 0.5, 3.0, 30.0), (0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99), (1.0, 0.37)):
        bent = TwoStiffnesses(1e4, 1e4 * ratio, part * v / 100.0)
        case = f"stiffness times {ratio:g} at {part:g} of the depth, v = {v:g}"
        yield hits("own laws", case, bent, bent_contact(bent, v), v)
    for first, then in product((0.0, 1e-3, 0.1, 0.5, 0.9), repeat=2):
        damped = TwoDampings(1e4, 200.0 * first, 200.0 * then)
        yield hits("own laws", f"ζ = {first:g} loading, {then:g} unloading", damped, damped_contact(damped))
    for rest, k in product((0.01, 0.1, 0.3, 0.5, 0.8, 0.99), (1.0, 1e4, 1e8)):
        case = f"unloading to {rest:g} of the depth, k = {k:.0e}"
        yield hits("own laws", case, Hysteresis(k, rest), plastic_contact(k, rest))


def bent_contact(law: TwoStiffnesses, v: float) -> Truth:
    """1 kg at `v` in m/s against a spring in two pieces: arcs of two sines."""
    w1, w2, bend = math.sqrt(law.k), math.sqrt(law.k2), math.sqrt(law.k) * law.xi1
    turn, shift = math.sqrt((v - bend) * (v + bend)) / w2, law.k * law.xi1 / law.k2
    amplitude = math.hypot(shift, turn)
    duration = 2.0 * (math.asin(bend / v) / w1 + math.atan2(turn, shift) / w2)
    depth = law.xi1 + turn**2 / (amplitude + shift)
    return truth.one_contact(1.0, v, duration=duration, xi_max=depth, force_max=law.k2 * amplitude, impulse=2.0 * v)


def damped_contact(law: TwoDampings) -> Truth:
    """1 kg at 1 m/s: damped oscillation to the peak, and from rest there to F = 0 with the other damping."""
    w = math.sqrt(law.k)
    zeta = [0.5 * gamma / w for gamma in (law.loading, law.unloading)]
    phase = [math.acos(z) / math.sqrt((1.0 - z) * (1.0 + z)) for z in zeta]
    loss = [z * a for z, a in zip(zeta, phase, strict=True)]
    eps = math.exp(-sum(loss))
    return truth.one_contact(eps, 1.0, duration=sum(phase) / w, xi_max=math.exp(-loss[0]) / w, impulse=1.0 + eps)


def plastic_contact(k: float, rest: float) -> Truth:
    """1 kg at 1 m/s: two quarters of oscillations; what unloading gives back is 1 - rest of the energy."""
    w, left = math.sqrt(k), math.sqrt(1.0 - rest)
    return truth.one_contact(left, 1.0, duration=0.5 * math.pi * (1.0 + left) / w, xi_max=1.0 / w, force_max=w,
                             impulse=1.0 + left)  # fmt: skip
