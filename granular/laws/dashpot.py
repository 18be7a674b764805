"""Linear spring and dashpot, clipped at zero force, and its exact restitution.

With damping ratio ζ = γ / (2 √(k m_eff)), natural frequency ω₀ = √(k / m_eff) and

    f(ζ) = acos ζ / √(1-ζ²)  (ζ < 1),   1  (ζ = 1),   acosh ζ / √(ζ²-1)  (ζ > 1),

an isolated contact lasts t_c = 2 f / ω₀ and has the restitution ε = exp(-2 ζ f), for every damping. The contact ends
when the force reaches zero, before the overlap does (Schwager & Pöschel 2007). The three branches of the restitution
are from Müller & Pöschel 2011, who omit the over-damped duration. The common formula exp(-πζ/√(1-ζ²)) belongs to
*another* law, whose force is attractive at the end of the contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

from granular._engine import check, signature
from granular.scene import Pair, checked_pair


class _StiffAndDamped:
    """Base of laws whose first field is a positive stiffness k.

    All further fields are damping coefficients and must not be negative.
    """

    k: float

    def __post_init__(self) -> None:
        check.number("k", self.k, above=0.0)
        for damping in fields(self)[1:]:  # type: ignore[arg-type]
            check.number(damping.name, getattr(self, damping.name), at_least=0.0)

    @property
    def rate_dependent(self) -> bool:
        """Whether the force depends on ξ̇."""
        return any(getattr(self, damping.name) != 0.0 for damping in fields(self)[1:])  # type: ignore[arg-type]


@signature.face
@dataclass(frozen=True)
class LinearDashpot(_StiffAndDamped):
    """Linear spring and dashpot, F = k ξ + γ ξ̇.

    Parameters
    ----------
    k : float
        Stiffness in N/m, positive.
    gamma : float
        Damping coefficient γ in kg/s, not negative. Defaults to 0. It is not divided by m_eff.
        (Müller & Pöschel 2011 divide k and γ of their *viscoelastic* law by m_eff.)
    """

    k: float
    gamma: float = 0.0

    exponent = 1.0

    @classmethod
    def from_restitution(
        cls, restitution: float, k: float | None = None, pair: Pair | None = None, *, duration: float | None = None,
    ) -> LinearDashpot:
        """Return the law with a given restitution of an isolated contact in `pair`.

        Either the stiffness or the contact duration t_c is given. With the damping ratio ζ(ε), and
        f(ζ) as defined in `granular.laws.dashpot`, k = m_eff (2 f / t_c)² and γ = 4 ζ f m_eff / t_c. An isolated
        contact of the law has exactly this ε and this t_c.

        Parameters
        ----------
        restitution : float
            ε in (0, 1].
        k : float
            Stiffness in N/m, positive.
        pair : Pair
            Pair with the effective mass. Required.
        duration : float
            Instead of `k`: contact duration t_c in s, positive, from the touch until the force is zero.

        Returns
        -------
        LinearDashpot

        Raises
        ------
        ValueError
            If both or neither of `k` and `duration` are given.

        Examples
        --------
        >>> import granular as gr
        >>> pair = gr.scenes.three_balls().pairs[1]
        >>> law = gr.LinearDashpot.from_restitution(0.75, duration=0.1, pair=pair)
        >>> hit = gr.binary.collision(law, pair, speed=1.0)
        >>> round(hit.restitution, 12), round(hit.duration, 12)
        (0.75, 0.1)
        """
        zeta, m_eff = damping_ratio(restitution), checked_pair(pair).m_eff
        if (contact_duration := _duration_instead_of_k(k, duration)) is None:
            return cls(k, 2.0 * zeta * math.sqrt(check.number("k", k, above=0.0) * m_eff))  # type: ignore[arg-type]
        frequency = 2.0 * _half_duration(zeta) / contact_duration
        return cls(frequency * frequency * m_eff, 2.0 * zeta * frequency * m_eff)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N before it is clipped at 0 by the engine.

        Parameters
        ----------
        xi : float
            Overlap in m.
        xi_dot : float
            Rate of the overlap in m/s.
        pair : Pair
            Not used.
        """
        return self.k * xi + self.gamma * xi_dot

    def linear(self, pair: Pair) -> tuple[float, float]:
        """Return stiffness in N/m and damping in kg/s of this linear law."""
        return self.k, self.gamma

    def potential(self, xi: float, pair: Pair) -> float:
        """Return the elastic energy ½ k ξ² in J."""
        return 0.5 * self.k * xi * xi


@signature.face
def restitution(zeta: float) -> float:
    """Return ε = exp(-2 ζ f(ζ)) of the clipped dashpot for a damping ratio ζ ≥ 0."""
    damping = check.number("zeta", zeta, at_least=0.0)
    return math.exp(-2.0 * damping * _half_duration(damping))


@signature.face
def restitution_pulling(zeta: float) -> float:
    """Return ε of a dashpot that is *not* clipped at zero force.

    It is exp(-πζ/√(1-ζ²)) for a damping ratio 0 ≤ ζ < 1, and 0 for ζ ≥ 1. The force is attractive at the end of the
    contact, which lasts until the overlap is 0.
    """
    damping = check.number("zeta", zeta, at_least=0.0)
    return math.exp(-math.pi * damping / math.sqrt(1.0 - damping * damping)) if damping < 1.0 else 0.0


@signature.face
def reduced_duration(zeta: float) -> float:
    """Return the dimensionless contact duration ω₀ t_c of the clipped dashpot.

    It is 2 f(ζ), where f is defined in the module docstring. `zeta` is the damping ratio ζ ≥ 0.
    """
    return 2.0 * _half_duration(check.number("zeta", zeta, at_least=0.0))


@signature.face
def damping_ratio(restitution: float) -> float:
    """Return ζ of the clipped dashpot with a given restitution in (0, 1].

    This is the exact inverse of `restitution`. With L = -ln(ε)/2, if L < 1, y is the root of y cot y = L,
    and ζ = cos y. If L > 1, y is the root of y coth y = L, and ζ = cosh y.
    """
    length = 0.5 * abs(math.log(_positive_restitution(restitution)))
    # critical damping, where both branches below are 0/0
    if length == 1.0:
        return 1.0
    # near ε = 1 the complement z = π/2 - y keeps the digits of small ζ
    if length <= 0.5:
        return math.sin(_newton_root(_cotangent_curve, 2.0 * length / math.pi, length))
    tan, sin, cos, start = (math.tanh, math.sinh, math.cosh, length) if length > 1.0 else (
        math.tan, math.sin, math.cos, math.sqrt(3.0 * (1.0 - length)))
    return cos(_newton_root(lambda y: (y / tan(y), 1.0 / tan(y) - y / (sin(y) * sin(y))), start, length))


def _positive_restitution(restitution: float) -> float:
    """Return ε after checking that it is in (0, 1]."""
    return check.number(
        "restitution", restitution, above=0.0, at_most=1.0,
        fix="A contact without rebound never ends. Give a small restitution, such as 0.01."
        if isinstance(restitution, (int, float)) and restitution == 0.0 else "")


def _duration_instead_of_k(k: float | None, duration: float | None) -> float | None:
    """Return the checked contact duration in s, or None if `k` is given instead.

    Raises `ValueError` if both or neither are given.
    """
    if (k is None) == (duration is None):
        raise ValueError("Exactly one of `k` and `duration` must be given, got " + (
            "neither. Give the stiffness or the contact duration." if k is None else
            f"k = {k!r} and duration = {duration!r}. Restitution and duration determine the stiffness: omit `k`."))
    return None if duration is None else check.number("duration", duration, above=0.0)


def _half_duration(zeta: float) -> float:
    # √|1 - ζ²| in factors, without cancellation near ζ = 1
    """Return f(ζ) of the module docstring, half the contact duration in units of 1/ω₀."""
    root = math.sqrt(abs(1.0 - zeta)) * math.sqrt(1.0 + zeta)
    return 1.0 if root == 0.0 else math.atan2(root, zeta) / root if zeta < 1.0 else math.asinh(root) / root


def _newton_root(curve: Callable[[float], tuple[float, float]], y: float, target: float) -> float:
    """Return the root y of value(y) = target, by Newton's method from a start value.

    `curve` returns (value, slope) at y.
    """
    # converges quadratically; the limit only guards against steps that alternate by rounding
    for _ in range(100):
        value, slope = curve(y)
        step = (value - target) / slope if value != target else 0.0
        y -= step
        if abs(step) <= 1e-16 * abs(y):
            break
    return y


def _cotangent_curve(z: float) -> tuple[float, float]:
    """Return y cot y and its derivative with respect to z, where y = π/2 - z.

    This variable keeps the digits of ζ = sin z near ε = 1.
    """
    y, t = 0.5 * math.pi - z, math.tan(z)
    return y * t, y * (1.0 + t * t) - t
