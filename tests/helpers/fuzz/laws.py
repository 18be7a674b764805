"""Laws of the fuzz: the built-in ones, and laws as users write them; each says itself a second time, by number.

`law` is what the engine gets; `by_number` is what the independent solver computes with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import granular as gr
from granular import Pair
from tests.helpers.fuzz import forces
from tests.helpers.scenes_at_random import OwnDashpot, OwnHertz, Stiffening

NUMBERS = {
    "LinearDashpot": lambda n, root, m, k, gamma: (forces.POWER, (n(k), n(1), n(gamma), n(0))),
    "Hertz": lambda n, root, m, k: (forces.POWER, (n(k), n(1.5), n(0), n(0))),
    "ViscoelasticHertz": lambda n, root, m, k, gamma: (forces.POWER, (n(k), n(1.5), n(gamma), n(0.5))),
    "TsujiHertz": lambda n, root, m, k, alpha: (forces.POWER, (n(k), n(1.5), n(alpha) * root(m * n(k)), n(0.25))),
    "PowerLaw": lambda n, root, m, k, exponent: (forces.POWER, (n(k), n(exponent), n(0), n(0))),
    "WaltonBraun": lambda n, root, m, k_load, k_unload: (forces.BRAUN, (n(k_load), n(k_unload))),
    "PlainHertz": lambda n, root, m, k: (forces.POWER, (n(k), n(1.5), n(0), n(0))),
    "PlainDashpot": lambda n, root, m, k, gamma: (forces.POWER, (n(k), n(1), n(gamma), n(0))),
    "PlainViscoelastic": lambda n, root, m, k, gamma: (forces.POWER, (n(k), n(1.5), n(gamma), n(0.5))),
    "PlainPower": lambda n, root, m, k, exponent: (forces.POWER, (n(k), n(exponent), n(0), n(0))),
    "DampedPower": lambda n, root, m, k, p, gamma, d: (forces.POWER, (n(k), n(p), n(gamma), n(d))),
    "TwoStiffnesses": lambda n, root, m, k, k2, xi1: (forces.TWO_STIFF, (n(k), n(k2), n(xi1), n(0))),
    "TwoDampings": lambda n, root, m, k, g1, g2: (forces.TWO_DAMP, (n(k), n(1), n(g1), n(g2), n(0))),
    "TwoViscosities": lambda n, root, m, k, g1, g2: (forces.TWO_DAMP, (n(k), n(1.5), n(g1), n(g2), n(0.5))),
    "Stiffening": lambda n, root, m, k, k3, gamma: (forces.STIFFEN, (n(k), n(k3), n(gamma))),
    "Exponential": lambda n, root, m, a, length: (forces.EXPO, (n(a), n(length))),
    "Hysteresis": lambda n, root, m, k, p, rest: (forces.HYSTERESIS, (n(k), n(p), n(rest))),
    "Saturated": lambda n, root, m, k, gamma, v: (forces.SATURATED, (n(k), n(gamma), n(v))),
}
"""Kind and numbers of each law for the solver, from its own fields, in the arithmetic of `n`."""


@dataclass(frozen=True)
class Spec:
    """A law by name and numbers."""

    name: str
    numbers: tuple[float, ...]

    def law(self) -> Any:
        """The law the engine gets."""
        return KINDS[self.name](*self.numbers)

    def by_number(self, number: Any, root: Any, m_eff: Any) -> tuple[int, tuple[Any, ...]]:
        """Kind and numbers for the solver."""
        return NUMBERS[self.name](number, root, m_eff, *self.numbers)


@dataclass(frozen=True)
class PlainPower:
    """F = k ξ^p."""

    k: float
    p: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * math.pow(xi, self.p)


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
class DampedPower:
    """F = k ξ^p + γ ξ^d ξ̇ with its `power` said."""

    k: float
    p: float
    gamma: float
    d: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return float(self.k * xi**self.p + self.gamma * xi**self.d * xi_dot)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        return self.k, self.p, self.gamma, self.d


@dataclass(frozen=True)
class TwoViscosities:
    """The same for spheres: √ξ (k ξ + γ± ξ̇)."""

    k: float
    loading: float
    unloading: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return math.sqrt(xi) * (self.k * xi + (self.loading if xi_dot > 0.0 else self.unloading) * xi_dot)


@dataclass(frozen=True)
class Exponential:
    """F = a (exp(ξ/length) - 1)."""

    a: float
    length: float

    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.a * math.expm1(xi / self.length)


@dataclass(frozen=True)
class Hysteresis:
    """Loading k ξ^p; unloading a curve of the same power that ends at rest · ξ_max: a law with memory."""

    k: float
    p: float
    rest: float

    memory = True
    rate_dependent = False

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        if xi >= xi_max:
            return float(self.k * xi**self.p)
        left = self.rest * xi_max
        if self.p == 1.0:
            return self.k * xi_max * (xi - left) / (xi_max - left)
        if xi <= left:
            return 0.0
        return float(self.k * xi_max**self.p * ((xi - left) / (xi_max - left)) ** self.p)


@dataclass(frozen=True)
class Saturated:
    """A dashpot whose damping force saturates: k ξ + γ v tanh(ξ̇/v)."""

    k: float
    gamma: float
    v: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi + self.gamma * self.v * math.tanh(xi_dot / self.v)


@dataclass(frozen=True)
class Rounded:
    """A law whose force is off by a unit in the last place, or not, as the last digits of its arguments draw it."""

    law: Any
    seed: int

    def force(self, xi: float, xi_dot: float, pair: Pair, *xi_max: float) -> float:
        force = self.law.force(xi, xi_dot, pair, *xi_max)
        return math.nextafter(force, (math.inf, -math.inf, force)[hash((xi, xi_dot, self.seed)) % 3])

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("law", "seed", "linear"):
            raise AttributeError(name)
        return getattr(self.law, name)


KINDS = {kind.__name__: kind for kind in (
    gr.LinearDashpot, gr.Hertz, gr.ViscoelasticHertz, gr.TsujiHertz, gr.PowerLaw, gr.WaltonBraun, PlainPower,
    PlainViscoelastic, TwoStiffnesses, TwoDampings, DampedPower, TwoViscosities, Stiffening, Exponential, Hysteresis,
    Saturated,
)} | {"PlainHertz": OwnHertz, "PlainDashpot": OwnDashpot}
"""Every law by its name."""
