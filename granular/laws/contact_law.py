"""What an engine may know of a force law beyond its `force`: traits, never the class.

A law is a frozen dataclass of floats with ``force(self, xi, xi_dot, pair)``. Optional traits unlock more:

* ``linear(pair) -> (k, gamma)``: F = k ξ + γ ξ̇;
* ``power(pair) -> (k, p, gamma, d)``: F = k ξ^p + γ ξ^d ξ̇;
* ``exponent``: the power of ξ with which F begins; ``rate_dependent``: whether ξ̇ enters (true if not said);
* ``potential(xi, pair)``: the elastic energy; ``memory = True``: `force` also takes ``xi_max``.

`resolve` alone asks a law what it is; everyone else reads the `PairLaw` that it returns.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from granular._engine.check import Array, is_own, takes

if TYPE_CHECKING:
    from granular.scene import Pair

Form = tuple[float, float, float, float]
"""(k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇."""


@dataclass(frozen=True, slots=True, eq=False)
class PairLaw:
    """A force law in one pair, and what it is.

    Attributes
    ----------
    law, pair : law, Pair
        The law as it was given, and the pair.
    form : (k, p, γ, d) or None
        Coefficients of F = k ξ^p + γ ξ^d ξ̇, if the law says so by `power` or `linear`, or is seen to be linear.
    memory : bool
        Whether the force depends on the largest overlap since the bodies last parted.
    rate_dependent : bool
        Whether ξ̇ enters the force; true unless the law denies it.
    exponent : float or None
        The power of ξ with which F begins, if the law says so.
    potential : callable or None
        Elastic energy in J as a function of overlap and pair, if the law knows it.
    """

    law: Any
    pair: Pair
    form: Form | None
    memory: bool
    rate_dependent: bool
    exponent: float | None
    potential: Callable[[float, Pair], float] | None

    def force(self, xi: float, xi_dot: float, xi_max: float) -> float:
        """Force in N, not clipped, at overlap in m, its rate in m/s, and the largest overlap so far."""
        return float(self.given(xi, xi_dot, xi_max))

    def given(self, xi: float, xi_dot: float, xi_max: float) -> Any:
        """What the law itself returns as its force, perhaps no number."""
        return self.law.force(xi, xi_dot, self.pair, xi_max) if self.memory else self.law.force(xi, xi_dot, self.pair)

    @property
    def is_linear(self) -> bool:
        """Whether F = k ξ + γ ξ̇."""
        return self.form is not None and self.form[1] == 1.0 and self.form[3] == 0.0

    @property
    def is_elastic(self) -> bool:
        """Whether the law declares neither damping nor memory."""
        return not (self.memory or (self.rate_dependent if self.form is None else self.form[2] != 0.0))

    def tangent(self, xi: float) -> tuple[float, float]:
        """Stiffness ∂F/∂ξ in N/m and damping ∂F/∂ξ̇ in kg/s at overlap `xi` and rest, by differences."""
        if self.form is not None and self.is_linear:
            return self.form[0], self.form[2]
        step, here = 1e-6 * xi, self.force(xi, 0.0, xi)
        # backwards: the unloading branch of a law with memory is the stiffer one
        k = (here - self.force(xi - step, 0.0, xi)) / step
        rate = xi * math.sqrt(abs(k) / self.pair.m_eff) if self.rate_dependent else 0.0
        return abs(k), abs(self.force(xi, rate, xi) - here) / rate if rate else 0.0

    def impact_stiffness(self, speed: float) -> float:
        """∂F/∂ξ in N/m at the overlap that an impact at `speed` in m/s reaches; nan without one."""
        xi = self.overlap_at(speed)
        return self.tangent(xi)[0] if xi > 0.0 else math.nan

    def energy(self, xi: float) -> float:
        """Elastic energy U(ξ) in J; nan of a law with memory, for the overlap alone does not determine it."""
        return 0.0 if xi <= 0.0 else math.nan if self.memory else self.work(xi)

    def work(self, xi: float) -> float:
        """∫₀^ξ F(s, 0) ds in J at first loading, by the law's own `potential` or by Gauss quadrature."""
        if self.potential is not None and not self.memory:
            return float(self.potential(xi, self.pair))
        total = 0.0
        for w, u in zip(*_quadrature(), strict=True):
            s = xi * u * u  # smooths forces that start like a root of ξ
            total += w * u * xi * self.given(s, 0.0, s)
        return float(total)

    def overlap_at(self, speed: float) -> float:
        """Overlap in m at which `work` is the kinetic energy ½ m_eff v² of an isolated contact at `speed` in m/s."""
        energy = 0.5 * self.pair.m_eff * speed * speed
        if not energy > 0.0:
            return 0.0
        xi = 1.0
        while self.work(xi) < energy and xi < 1e100:
            xi *= 2.0
        while self.work(xi) > energy and xi > 1e-100:
            xi *= 0.5
        low, high = xi, 2.0 * xi
        for _ in range(20):
            xi = math.sqrt(low * high)
            low, high = (xi, high) if self.work(xi) < energy else (low, xi)
        return xi


def dissipative_traits(law: Any) -> tuple[bool, bool]:
    """Return whether a law declares memory, and whether its force may depend on the rate, in any pair."""
    return bool(getattr(law, "memory", False)), bool(getattr(law, "rate_dependent", True))


def resolve(law: Any, pair: Pair) -> PairLaw:
    """Ask a law what it is in a pair."""
    memory, rate_dependent = dissipative_traits(law)
    form = None if memory else _form(law, pair)
    return PairLaw(law, pair, form, memory, rate_dependent, getattr(law, "exponent", None),
                   getattr(law, "potential", None))


@cache
def _quadrature() -> tuple[Array, Array]:
    """Weights and nodes of Gauss on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(40)
    return weight, 0.5 * (node + 1.0)


def _form(law: Any, pair: Pair) -> Form | None:
    if hasattr(law, "power"):
        k, p, gamma, d = map(float, law.power(pair))
        return k, p, gamma, d
    found = law.linear(pair) if hasattr(law, "linear") else _traced(law, pair)
    if found is None:
        return None
    k, gamma = map(float, found)
    return k, 1.0, gamma, 0.0


@dataclass(frozen=True, eq=False)
class _Linear:
    """The expression xi·ξ + rate·ξ̇; it knows sums, and products with numbers.

    A law of one's own needs no trait for the exact path of linear laws: if its `force`, run on the symbols ξ and ξ̇,
    only adds them and multiplies them by numbers, then it *is* k ξ + γ ξ̇ for every overlap and rate. Any comparison,
    root or power of a symbol ends the attempt: nothing is guessed from samples.
    """

    xi: float
    rate: float

    def __add__(self, other: Any) -> _Linear:
        if isinstance(other, _Linear):
            return _Linear(self.xi + other.xi, self.rate + other.rate)
        return self if isinstance(other, (int, float)) and other == 0 else NotImplemented

    def __mul__(self, number: Any) -> _Linear:
        return _Linear(self.xi * number, self.rate * number) if isinstance(number, (int, float)) else NotImplemented

    def __truediv__(self, number: Any) -> _Linear:
        return _Linear(self.xi / number, self.rate / number) if isinstance(number, (int, float)) else NotImplemented

    def __neg__(self) -> _Linear:
        return _Linear(-self.xi, -self.rate)

    def __sub__(self, other: _Linear | float) -> _Linear:
        return self + -other

    def __rsub__(self, other: _Linear | float) -> _Linear:
        return -self + other

    __radd__, __rmul__ = __add__, __mul__
    __bool__ = __eq__ = __hash__ = None  # type: ignore[assignment] # a symbol is neither true nor false, nor compared


def _traced(law: Any, pair: Pair) -> tuple[float, float] | None:
    """Return (k, γ) if the law's `force` is proved to be k ξ + γ ξ̇ with k > 0 and γ ≥ 0, else None."""
    try:
        force = law.force(_Linear(1.0, 0.0), _Linear(0.0, 1.0), pair)
    except Exception:  # not linear; if it is the user's mistake, the run itself will show it
        return None
    if not isinstance(force, _Linear) or not (force.xi > 0.0 and force.rate >= 0.0):
        return None
    return force.xi, force.rate


TRAITS = {"linear": ("pair",), "power": ("pair",), "potential": ("xi", "pair")}
"""What the traits of a law that are methods are called with."""


def instance(name: str, law: Any, fix: str = "for hard spheres use granular.edmd") -> Any:
    """Return `law`, or raise if it is a class, or has no `force`."""
    if isinstance(law, type):
        values = ", ".join(f"{field}=..." for field in getattr(law, "__dataclass_fields__", {}))
        raise TypeError(f"{name} is the class {law.__name__}: an instance is needed, such as {law.__name__}({values}).")
    if not callable(getattr(law, "force", None)):
        raise TypeError(
            f"{name} is {law!r}: an object with force(self, xi, xi_dot, pair) is needed; {fix}."
        )
    if is_own(law):
        remembers = bool(getattr(law, "memory", False))
        more, fix = (("xi_max",), "without it leave memory out") if remembers else ((), "with xi_max set memory = True")
        takes(f"force of {name}", law.force, "xi", "xi_dot", "pair", *more, fix=fix)
        for trait, given in TRAITS.items():
            if callable(function := getattr(law, trait, None)):
                takes(f"{trait} of {name}", function, *given)
    return law


class ForceLaw(Protocol):
    """A force law of one's own, as an editor or mypy checks it; see `docs/your-own-law.md`."""

    def force(self, xi: float, xi_dot: float, pair: Any, /) -> float:
        """Force in N at an overlap `xi` in m that grows by `xi_dot` in m/s, ≥ 0 for repulsion."""


class LawWithMemory(Protocol):
    """A force law that also knows the largest overlap so far; its `memory` is True."""

    memory: bool

    def force(self, xi: float, xi_dot: float, pair: Any, xi_max: float, /) -> float:
        """Force in N, with the largest overlap `xi_max` in m of this contact so far."""


def finite(law: PairLaw, xi: float, xi_dot: float) -> float:
    """Return the force at an overlap that is the largest so far, or raise the sentence that says what is wrong."""
    value, force = law.given(xi, xi_dot, xi), math.nan
    with suppress(TypeError, ValueError):
        force = math.nan if isinstance(value, (str, bytes)) else float(value)
    if not math.isfinite(force):
        raise no_number(law, xi, xi_dot, value)
    return force


def no_number(law: PairLaw, xi: float, xi_dot: float, value: Any) -> ValueError:
    """Return the error of a force that is no finite number."""
    return refused(law, f"its force at overlap ξ = {xi:.6g} m and rate ξ̇ = {xi_dot:.6g} m/s is {value!r}; a "
                        "finite number in N is needed.")


def refused(law: PairLaw, what: str) -> ValueError:
    """Return the error of a law that is not one, in words."""
    return ValueError(f"law of pair {law.pair.index} is {law.law!r}: {what}")
