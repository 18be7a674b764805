"""Linear spring and dashpot, clipped at zero force, and its exact restitution for every damping.

With damping ratio ζ = γ / (2 √(k m_eff)), natural frequency ω₀ = √(k / m_eff) and

    f(ζ) = acos ζ / √(1-ζ²)  (ζ < 1),   1  (ζ = 1),   acosh ζ / √(ζ²-1)  (ζ > 1),

an isolated contact lasts t_c = 2 f / ω₀ and returns ε = exp(-2 ζ f) of the approach speed: it ends where the
force reaches zero, before the overlap does (Schwager & Pöschel 2007; Müller & Pöschel 2011, whose three branches
these are, with the over-damped duration they leave out). The often quoted exp(-πζ/√(1-ζ²)) belongs to *another* law,
one that pulls at the end of the contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

from granular._engine import check
from granular.scene import Pair, checked_pair


class _StiffAndDamped:
    """A dataclass whose first number is a stiffness k, positive, and whose second, if any, a damping, not negative."""

    k: float

    def __post_init__(self) -> None:
        check.number("k", self.k, above=0.0)
        for damping in fields(self)[1:]:  # type: ignore[arg-type]
            check.number(damping.name, getattr(self, damping.name), at_least=0.0)

    @property
    def rate_dependent(self) -> bool:
        """Whether ξ̇ enters the force."""
        return any(getattr(self, damping.name) != 0.0 for damping in fields(self)[1:])  # type: ignore[arg-type]


@check.face
@dataclass(frozen=True)
class LinearDashpot(_StiffAndDamped):
    """F = k ξ + γ ξ̇.

    Parameters
    ----------
    k : float
        Stiffness in N/m, positive.
    gamma : float
        Damping coefficient γ in kg/s, not negative. (The paper's k and γ of its *viscoelastic* law are divided by
        m_eff; here all coefficients are raw.)
    """

    k: float
    gamma: float = 0.0

    exponent = 1.0

    @classmethod
    def from_restitution(cls, restitution: float, k: float, pair: Pair) -> LinearDashpot:
        """Return the law of stiffness `k` whose isolated contact in `pair` has the given restitution in (0, 1]."""
        zeta, stiffness = damping_ratio(restitution), check.number("k", k, above=0.0)
        return cls(k, 2.0 * zeta * math.sqrt(stiffness * checked_pair(pair).m_eff))

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Force in N at overlap `xi` in m and overlap rate `xi_dot` in m/s, before the engine clips it at 0."""
        return self.k * xi + self.gamma * xi_dot

    def linear(self, pair: Pair) -> tuple[float, float]:
        """Stiffness in N/m and damping in kg/s: this law is linear."""
        return self.k, self.gamma

    def potential(self, xi: float, pair: Pair) -> float:
        """Elastic energy ½ k ξ² in J."""
        return 0.5 * self.k * xi * xi


@check.face
def restitution(zeta: float) -> float:
    """ε = exp(-2 ζ f(ζ)) of the clipped dashpot for a damping ratio ζ ≥ 0."""
    damping = check.number("zeta", zeta, at_least=0.0)
    return math.exp(-2.0 * damping * _half_duration(damping))


@check.face
def restitution_pulling(zeta: float) -> float:
    """exp(-πζ/√(1-ζ²)) of a dashpot that is *not* clipped and pulls until the overlap is gone; 0 from ζ = 1 on."""
    damping = check.number("zeta", zeta, at_least=0.0)
    return math.exp(-math.pi * damping / math.sqrt(1.0 - damping * damping)) if damping < 1.0 else 0.0


@check.face
def duration(zeta: float) -> float:
    """ω₀ t_c = 2 f(ζ) of the clipped dashpot for a damping ratio ζ ≥ 0."""
    return 2.0 * _half_duration(check.number("zeta", zeta, at_least=0.0))


@check.face
def damping_ratio(restitution: float) -> float:
    """ζ of the clipped dashpot with the given restitution in (0, 1]: the exact inverse of `restitution`.

    With L = -ln(ε)/2 it solves y cot y = L, ζ = cos y (L < 1), or y coth y = L, ζ = cosh y (L > 1).
    """
    length = 0.5 * abs(math.log(check.number("restitution", restitution, above=0.0, at_most=1.0)))
    if length == 1.0:
        return 1.0
    if length <= 0.5:
        return math.sin(_newton(_cot_complement, 2.0 * length / math.pi, length))
    tan, sin, cos, start = (math.tanh, math.sinh, math.cosh, length) if length > 1.0 else (
        math.tan, math.sin, math.cos, math.sqrt(3.0 * (1.0 - length)))
    return cos(_newton(lambda y: (y / tan(y), 1.0 / tan(y) - y / (sin(y) * sin(y))), start, length))


def _half_duration(zeta: float) -> float:
    root = math.sqrt(abs(1.0 - zeta)) * math.sqrt(1.0 + zeta)
    return 1.0 if root == 0.0 else math.atan2(root, zeta) / root if zeta < 1.0 else math.asinh(root) / root


def _newton(curve: Callable[[float], tuple[float, float]], y: float, target: float) -> float:
    """Solve value(y) = target by Newton's method for a `curve` that returns (value, slope)."""
    for _ in range(100):
        value, slope = curve(y)
        step = (value - target) / slope if value != target else 0.0
        y -= step
        if abs(step) <= 1e-16 * abs(y):
            break
    return y


def _cot_complement(z: float) -> tuple[float, float]:
    """y cot y with y = π/2 - z, which keeps the digits of ζ = sin z towards ε = 1."""
    y, t = 0.5 * math.pi - z, math.tan(z)
    return y * t, y * (1.0 + t * t) - t
