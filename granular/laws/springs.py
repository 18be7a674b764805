"""Force laws without rate dependence, absorbing chain ends, and static overlaps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular._engine import check, signature
from granular.laws.contact_law import PairLaw, finite
from granular.scene import Pair

__all__ = ["MatchedEnd", "PowerLaw", "WaltonBraun"]
OVERLAP_SHARE = 0.1
"""Overlap, in effective radii, of a contact with a constant force."""

FORCE_TOLERANCE = 1e-12
"""Relative difference below which forces count as equal."""


@signature.face
@dataclass(frozen=True)
class PowerLaw:
    """Elastic power law of the overlap, F = k ξ^n.

    It is *not* an inverse power of the distance.

    Parameters
    ----------
    k : float
        Stiffness in N/m^n, positive.
    exponent : float
        n ≥ 1: 1 is a linear spring, 3/2 Hertz, 2 a cone on a plane.
    """

    k: float
    exponent: float

    rate_dependent = False

    def __post_init__(self) -> None:
        check.number("k", self.k, above=0.0)
        check.number("exponent", self.exponent, at_least=1.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N at overlap `xi` in m."""
        return self.k * math.pow(xi, self.exponent)

    def power(self, pair: Pair) -> tuple[float, float, float, float]:
        """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇: (k, n, 0, 0)."""
        return self.k, self.exponent, 0.0, 0.0

    def potential(self, xi: float, pair: Pair) -> float:
        """Return the elastic energy k ξ^(n+1) / (n+1) in J."""
        return self.k * math.pow(xi, self.exponent + 1.0) / (self.exponent + 1.0)


@signature.face
@dataclass(frozen=True)
class WaltonBraun:
    """Elastic-plastic contact without rate dependence (Walton & Braun 1986).

    F = min(k_load ξ, k_load ξ_max - k_unload (ξ_max - ξ)). Loading follows k_load ξ. Unloading and reloading follow the
    steeper line through the largest overlap ξ_max so far, until ξ exceeds ξ_max. An isolated contact ends at
    ξ = (1 - k_load/k_unload) ξ_max with restitution ε = √(k_load/k_unload) after
    t_c = (π/2) (√(m_eff/k_load) + √(m_eff/k_unload)).

    Parameters
    ----------
    k_load, k_unload : float
        Stiffness in N/m while loading and while unloading, 0 < k_load ≤ k_unload.
    """

    k_load: float
    k_unload: float

    memory = True
    exponent = 1.0
    rate_dependent = False

    def __post_init__(self) -> None:
        check.number("k_load", self.k_load, above=0.0)
        check.number("k_unload", self.k_unload, at_least=self.k_load,
                      fix="Unloading must be at least as stiff as loading, or energy would be created.")

    @classmethod
    def from_restitution(cls, restitution: float, k_load: float) -> WaltonBraun:
        """Return the law with a given restitution.

        The unloading stiffness is k_load / ε².

        Parameters
        ----------
        restitution : float
            ε in (0, 1]. k_load / ε² must be a finite float.
        k_load : float
            Loading stiffness in N/m, positive.

        Returns
        -------
        WaltonBraun
        """
        eps = check.number("restitution", restitution, above=0.0, at_most=1.0)
        return cls(k_load, check.number("k_load", k_load, above=0.0) / (eps * eps))

    def force(self, xi: float, xi_dot: float, pair: Pair, xi_max: float) -> float:
        """Return the force in N before it is clipped at 0 by the engine.

        Parameters
        ----------
        xi : float
            Overlap in m.
        xi_dot : float
            Not used.
        pair : Pair
            Not used.
        xi_max : float
            Largest overlap in m since the bodies last separated, `xi_max` ≥ `xi`.
        """
        return min(self.k_load * xi, self.k_load * xi_max - self.k_unload * (xi_max - xi))

    def restitution(self) -> float:
        """Return the restitution √(k_load / k_unload), the same at any speed."""
        return math.sqrt(self.k_load / self.k_unload)

    def isolated(self, pair: Pair, speed: float) -> tuple[float, float, float, float, float]:
        """Return five properties of an isolated contact at an approach `speed` in m/s.

        They are ε, t_c in s, the largest overlap in m, the largest force in N, and the overlap in m at the end of the
        force.
        """
        eps, omega = self.restitution(), math.sqrt(self.k_load / pair.m_eff)
        deepest = speed / omega
        return eps, 0.5 * math.pi * (1.0 + eps) / omega, deepest, self.k_load * deepest, (1.0 - eps * eps) * deepest


@signature.face
@dataclass(frozen=True)
class MatchedEnd:
    """Absorbing end of a chain: F = F₀ + √(K m) ξ̇ between its last ball and a wall.

    m is the mass of the last ball. √(K m) is the impedance of an infinite chain for slow waves. The static force F₀
    keeps the force positive where √(K m) |ξ̇| < F₀. Without F₀, the dashpot force would be clipped to 0 half
    of the time. A wave of frequency ω = ω_c sin(θ/2) is reflected with tan(θ/4) of its amplitude, where ω_c is the
    cut-off frequency. θ is the phase difference between neighbouring balls.

    Parameters
    ----------
    load : float
        F₀ in N, positive: static force in the chain.
    stiffness : float
        Stiffness K in N/m of the contacts of the chain under that force, see `granular.waves.stiffness`.

    Notes
    -----
    The static force F₀ is the same at every overlap. The last ball therefore does not return to its initial position.
    """

    load: float
    stiffness: float

    def __post_init__(self) -> None:
        check.number("load", self.load, above=0.0, fix="A chain without static force has no slow waves.")
        check.number("stiffness", self.stiffness, above=0.0)

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        """Return the force in N before it is clipped at 0 by the engine.

        Parameters
        ----------
        xi : float
            Not used.
        xi_dot : float
            Rate of the overlap in m/s.
        pair : Pair
            Pair with the effective mass.
        """
        return self.load + math.sqrt(self.stiffness * pair.m_eff) * xi_dot

    def potential(self, xi: float, pair: Pair) -> float:
        """Return the elastic energy F₀ ξ in J."""
        return self.load * xi


def static_overlap(law: PairLaw, force: float) -> float:
    """Return the overlap in m at which the force of a contact at rest is `force` in N.

    It is (F/k)^(1/p) for a power law. For other laws it is computed by bisection to the last digit. If the force does
    not depend on the overlap, as for a `MatchedEnd`, the result is a tenth of r_eff.

    Raises
    ------
    ValueError
        If no overlap gives that force.
    """
    if force == 0.0:
        return 0.0
    if law.form is not None:
        return math.pow(force / law.form[0], 1.0 / law.form[1]) if law.form[0] > 0.0 else _raise_no_overlap(law, force)
    size = law.pair.r_eff if 0.0 < law.pair.r_eff < math.inf else 1.0
    # a force that is constant over 8 decades of overlap does not determine it
    if all(abs(force_at_rest(law, share * size) - force) <= FORCE_TOLERANCE * force
           for share in (1e-9, OVERLAP_SHARE)):
        return OVERLAP_SHARE * size
    high = size
    while not force_at_rest(law, high) >= force:
        high = 2.0 * high if high < 1e100 * size else _raise_no_overlap(law, force)
    low = high
    while force_at_rest(law, low) >= force:
        low = 0.5 * low if low > 1e-100 * size else _raise_no_overlap(law, force)
    # until no float lies between the bounds
    while (middle := low + 0.5 * (high - low)) not in (low, high):
        low, high = (low, middle) if force_at_rest(law, middle) >= force else (middle, high)
    return high


def stiffness_at(law: PairLaw, xi: float) -> float:
    """Return the stiffness dF/dξ in N/m of a contact at rest at overlap `xi` in m.

    It is 0 without an overlap. For a law with memory it is the stiffness of the unloading that begins there, which
    applies to small oscillations.
    """
    if not xi > 0.0:
        return 0.0
    if law.form is not None:
        k, p = law.form[:2]
        return k * p * math.pow(xi, p - 1.0)
    if law.memory:
        return law.tangent(xi)[0]
    h = 1e-3 * xi  # central differences of order 4: relative error 4e-12 for powers of ξ
    near, far = (force_at_rest(law, xi + j * h) - force_at_rest(law, xi - j * h) for j in (1, 2))
    return (8.0 * near - far) / (12.0 * h)


def force_at_rest(law: PairLaw, xi: float) -> float:
    """Return the force in N at rest, on first loading to overlap `xi` in m.

    Raises `ValueError` if the force is not a finite number.
    """
    return finite(law, xi, 0.0)


def _raise_no_overlap(law: PairLaw, force: float) -> float:
    """Raise `ValueError`, because no overlap of a contact at rest gives `force` in N."""
    raise ValueError(f"`force` must be a force that {law.law!r} reaches at rest, got {force!r} N at pair "
                     f"{law.pair.name}.")
