"""Properties of a force law that engines use: its `force` and optional traits.

A law is a frozen dataclass of floats with ``force(self, xi, xi_dot, pair)``. Optional attributes and methods, the
*traits*, enable faster paths:

* ``linear(pair) -> (k, gamma)``: F = k ξ + γ ξ̇
* ``power(pair) -> (k, p, gamma, d)``: F = k ξ^p + γ ξ^d ξ̇
* ``exponent``: power of ξ with which F begins
* ``rate_dependent``: whether F depends on ξ̇ (true by default)
* ``potential(xi, pair)``: elastic energy
* ``memory = True``: `force` also takes ``xi_max``

Engines do not read these traits. They use the `PairLaw` that `resolve` returns.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from granular._engine.callables import function_of, is_user_defined
from granular._engine.check import Array, misuse, must, quoted

if TYPE_CHECKING:
    from granular.scene import Pair

Form = tuple[float, float, float, float]
"""Coefficients (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇."""


@dataclass(frozen=True, slots=True, eq=False)
class PairLaw:
    """A force law in one pair, with its traits.

    Attributes
    ----------
    law, pair : law, Pair
        The law object with the method `force`, and the pair.
    form : (k, p, γ, d) or None
        Coefficients of F = k ξ^p + γ ξ^d ξ̇, if the law has the trait `power` or `linear`, or is proved to be linear.
    memory : bool
        Whether the force depends on the largest overlap since the bodies last separated.
    rate_dependent : bool
        Whether the force depends on ξ̇, true by default.
    exponent : float or None
        Power of ξ with which F begins, if the law has this trait.
    potential : callable or None
        Elastic energy in J as a function of overlap and pair, if the law has this trait.
    """

    law: Any
    pair: Pair
    form: Form | None
    memory: bool
    rate_dependent: bool
    exponent: float | None
    potential: Callable[[float, Pair], float] | None

    def force(self, xi: float, xi_dot: float, xi_max: float) -> float:
        """Return the unclipped force in N.

        Parameters
        ----------
        xi, xi_dot, xi_max : float
            Overlap in m, its rate in m/s, and the largest overlap so far in m.
        """
        return float(self.given(xi, xi_dot, xi_max))

    def given(self, xi: float, xi_dot: float, xi_max: float) -> Any:
        """Return the value of the law's `force` as it is, which is not always a number.

        The parameters are as in `force`.
        """
        return self.law.force(xi, xi_dot, self.pair, xi_max) if self.memory else self.law.force(xi, xi_dot, self.pair)

    @property
    def is_linear(self) -> bool:
        """Whether the law is proved to be F = k ξ + γ ξ̇."""
        return self.form is not None and self.form[1] == 1.0 and self.form[3] == 0.0

    @property
    def is_elastic(self) -> bool:
        """Whether the law has neither damping nor memory, according to its traits."""
        return not (self.memory or (self.rate_dependent if self.form is None else self.form[2] != 0.0))

    def tangent(self, xi: float) -> tuple[float, float]:
        """Return stiffness ∂F/∂ξ in N/m and damping ∂F/∂ξ̇ in kg/s at zero rate.

        The overlap `xi` in m must be positive. If the law is not linear, both are absolute values of finite
        differences.
        """
        if self.form is not None and self.is_linear:
            return self.form[0], self.form[2]
        # 1e-6 balances truncation and rounding errors of a one-sided difference
        step, here = 1e-6 * xi, self.force(xi, 0.0, xi)
        # backward difference: the unloading branch of a law with memory is stiffer
        k = (here - self.force(xi - step, 0.0, xi)) / step
        rate = xi * math.sqrt(abs(k) / self.pair.m_eff) if self.rate_dependent else 0.0
        return abs(k), abs(self.force(xi, rate, xi) - here) / rate if rate else 0.0

    def impact_stiffness(self, speed: float) -> float:
        """Return the stiffness ∂F/∂ξ in N/m at the largest overlap of an impact.

        `speed` is the approach speed in m/s. The overlap is computed without damping, see `overlap_at`. The stiffness
        is nan if the overlap is 0.
        """
        xi = self.overlap_at(speed)
        return self.tangent(xi)[0] if xi > 0.0 else math.nan

    def energy(self, xi: float) -> float:
        """Return the elastic energy U(ξ) in J at overlap `xi` in m.

        It is nan for a law with memory, because the overlap alone does not determine it.
        """
        return 0.0 if xi <= 0.0 else math.nan if self.memory else self.work(xi)

    def work(self, xi: float) -> float:
        """Return the work ∫₀^ξ F(s, 0) ds in J on first loading up to overlap `xi` in m.

        It is the `potential` of the law, or else a Gauss quadrature.
        """
        if self.potential is not None and not self.memory:
            return float(self.potential(xi, self.pair))
        total = 0.0
        for w, u in zip(*_quadrature(), strict=True):
            s = xi * u * u  # substitution that smooths forces which start like a root of ξ
            total += w * u * xi * self.given(s, 0.0, s)
        return float(total)

    def overlap_at(self, speed: float) -> float:
        """Return the largest overlap in m of an impact without damping.

        `speed` is the approach speed v of an isolated contact in m/s. At this overlap the `work` equals the kinetic
        energy ½ m_eff v². The result has about 7 digits.
        """
        energy = 0.5 * self.pair.m_eff * speed * speed
        if not energy > 0.0:
            return 0.0
        xi = 1.0
        # bracket the overlap by factors of 2; the limits end the search if the force vanishes or overflows
        while self.work(xi) < energy and xi < 1e100:
            xi *= 2.0
        while self.work(xi) > energy and xi > 1e-100:
            xi *= 0.5
        low, high = xi, 2.0 * xi
        # 20 bisections in ln ξ give 7 digits, enough for a scale
        for _ in range(20):
            xi = math.sqrt(low * high)
            low, high = (xi, high) if self.work(xi) < energy else (low, xi)
        return xi


def dissipative_traits(law: Any) -> tuple[bool, bool]:
    """Return whether a law has memory, and whether its force can depend on the rate.

    Both booleans are read from its traits and hold for any pair.
    """
    return bool(getattr(law, "memory", False)), bool(getattr(law, "rate_dependent", True))


def resolve(law: Any, pair: Pair) -> PairLaw:
    """Return the `PairLaw` of a law in a pair, with the traits of the law."""
    memory, rate_dependent = dissipative_traits(law)
    form = None if memory else _power_form(law, pair)
    return PairLaw(law, pair, form, memory, rate_dependent, getattr(law, "exponent", None),
                   getattr(law, "potential", None))


@cache
def _quadrature() -> tuple[Array, Array]:
    """Weights and nodes of the Gauss quadrature on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(40)
    return weight, 0.5 * (node + 1.0)


def _power_form(law: Any, pair: Pair) -> Form | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇ from the traits of a law, or None.

    A law without the traits `power` and `linear` has a form if `_linear_form` proves that it is linear.
    """
    if hasattr(law, "power"):
        k, p, gamma, d = map(float, law.power(pair))
        return k, p, gamma, d
    linear = law.linear(pair) if hasattr(law, "linear") else _linear_form(law, pair)
    if linear is None:
        return None
    k, gamma = map(float, linear)
    return k, 1.0, gamma, 0.0


@dataclass(frozen=True, eq=False)
class _Linear:
    """Linear expression xi·ξ + rate·ξ̇ with symbolic ξ and ξ̇.

    It detects linear laws without a trait. The `force` of a law is evaluated with the symbols ξ and ξ̇ as arguments. If
    `force` only adds them and multiplies them by numbers, it is exactly k ξ + γ ξ̇ for every overlap and rate. Any
    comparison, root or power of a symbol raises an exception, and the law then counts as not linear. No conclusion is
    drawn from samples.
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
    __bool__ = __eq__ = __hash__ = None  # type: ignore[assignment] # a symbol is neither true nor false


def _linear_form(law: Any, pair: Pair) -> tuple[float, float] | None:
    """Return (k, γ) if `force` is proved to be k ξ + γ ξ̇, else None.

    The proof also requires k > 0 and γ ≥ 0.
    """
    try:
        force = law.force(_Linear(1.0, 0.0), _Linear(0.0, 1.0), pair)
    except Exception:  # not linear; a mistake of the user is reported by the run
        return None
    if not isinstance(force, _Linear) or not (force.xi > 0.0 and force.rate >= 0.0):
        return None
    return force.xi, force.rate


TRAIT_ARGUMENTS = {"linear": ("pair",), "power": ("pair",), "potential": ("xi", "pair")}
"""Names of the traits that are methods, and of their arguments."""


def instance(name: str, law: Any, fix: str = "For hard spheres use granular.edmd.") -> Any:
    """Return a force law if it is an instance with a `force`, else raise `TypeError`.

    The arguments of `force` and of the traits of a user-defined law are checked too. `name` denotes the law in the
    message, and `fix` is a sentence with the usual correction.
    """
    if isinstance(law, type):
        values = ", ".join(f"{field}=..." for field in getattr(law, "__dataclass_fields__", {}))
        raise TypeError(must(name, f"an instance, such as {law.__name__}({values})", f"the class {law.__name__}"))
    if not callable(getattr(law, "force", None)):
        raise TypeError(misuse(name, law, "an object with force(self, xi, xi_dot, pair)", fix))
    if is_user_defined(law):
        has_memory = bool(getattr(law, "memory", False))
        extra = ("xi_max",) if has_memory else ()
        fix = "Without xi_max, leave `memory` out." if has_memory else "With xi_max, set memory = True."
        function_of(f"`force` of {quoted(name)}", law.force, "xi", "xi_dot", "pair", *extra, fix=fix)
        for trait, arguments in TRAIT_ARGUMENTS.items():
            if callable(function := getattr(law, trait, None)):
                function_of(f"`{trait}` of {quoted(name)}", function, *arguments)
    return law


class ForceLaw(Protocol):
    """Protocol of a user-defined force law, for editors and mypy.

    See `docs/guide/your-own-law.md`.
    """

    def force(self, xi: float, xi_dot: float, pair: Any, /) -> float:
        """Return the force in N, ≥ 0 for repulsion.

        Parameters
        ----------
        xi : float
            Overlap in m.
        xi_dot : float
            Rate of the overlap in m/s, positive while it grows.
        pair : Pair
            Pair of bodies in contact.
        """


class LawWithMemory(Protocol):
    """Protocol of a user-defined force law that depends on the largest overlap so far.

    Its attribute `memory` is True.
    """

    memory: bool

    def force(self, xi: float, xi_dot: float, pair: Any, xi_max: float, /) -> float:
        """Return the force in N, ≥ 0 for repulsion.

        The parameters are as in `ForceLaw.force`, and `xi_max`, the largest overlap in m since the bodies last
        separated.
        """


def finite(law: PairLaw, xi: float, xi_dot: float) -> float:
    """Return the force in N at overlap `xi` and rate `xi_dot`, checked to be finite.

    `xi` in m is taken as the largest overlap so far. Raises `ValueError` with a sentence if the force is not a finite
    number.
    """
    value, force = law.given(xi, xi_dot, xi), math.nan
    with suppress(TypeError, ValueError):
        force = math.nan if isinstance(value, (str, bytes)) else float(value)
    if not math.isfinite(force):
        raise no_number(law, xi, xi_dot, value)
    return force


def no_number(law: PairLaw, xi: float, xi_dot: float, value: Any) -> ValueError:
    """Return the error for a force that is not a finite number."""
    return refused(law, "must return a finite force in N",
                   f"got {value!r} at overlap ξ = {xi:.6g} m and rate ξ̇ = {xi_dot:.6g} m/s")


def refused(law: PairLaw, need: str, got: str, fix: str = "") -> ValueError:
    """Return the error for an invalid law.

    The message is "The law of pair …, `law`, `need`, `got`.", followed by the sentence `fix`.
    """
    return ValueError(f"The law of pair {law.pair.name}, {law.law!r}, {need}, {got}." + f" {fix}" * bool(fix))
