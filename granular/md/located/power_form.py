"""Coefficients of laws as kernels read them, and contact maps of power laws.

A contact map gives the results of an isolated contact in closed form. Isolated contacts of elastic powers, and of
powers damped with the exponent d = (p-1)/2, are similar at all speeds. With s = ξ^((p+1)/2) and the time dτ =
ξ^((p-1)/2) dt, the contact m ξ̈ = -k ξ^p - γ ξ^((p-1)/2) ξ̇ becomes a dashpot,

    s″ + 2 ζ ω s′ + ω² s = 0 ,  ω² = (p+1) k / (2m) ,  ζ = γ / √(2 (p+1) k m) .

Here m is the effective mass. The restitution equals the restitution of this dashpot (Tsuji, Tanaka & Ishida 1992 found
ε = ε(α) in this way), and t = ∫ s^(-β) dτ with β = (p-1)/(p+1). In units of the length X = (m v²/k)^(1/(p+1)) and the
time X/v, all contacts with the same p and ζ are identical.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granular._engine.check import Array
from granular._engine.records import copied
from granular.md.located.records import (
    DAMPED,
    DASHPOT,
    ELASTIC,
    GENERAL,
    LAW_KIND_RECORD,
    LINEAR,
    MAX_CLOCK_EXPONENT,
    MAX_START_EXPONENT,
    NO_MAP,
    SELF_SIMILAR,
    VISCOELASTIC,
)
from granular.scene.places import speed_scale

if TYPE_CHECKING:
    from granular.laws.contact_law import Form, PairLaw
    from granular.laws.kinds import SceneLaws
    from granular.scene.state import Scene

QUADRATURE_POINTS = 40
"""Number of quadrature points, sufficient for an error of rounding size."""
MAX_DAMPED_EXPONENT = 3.0
"""Largest exponent of a damped law for which a `Shape` is computed.

The integrals of larger exponents lose digits."""
STRONG_DAMPING_RATIO = 0.3
"""Damping ratio from which the integral is computed up to its end.

Below this ratio, it is computed as a half period minus the missing part."""


def set_contact_maps(kinds: Any, m_eff: Array) -> None:
    """Set the contact maps of power laws, and the shapes of their contacts.

    `kinds` are records `LAW_KIND_RECORD` with their coefficients, and `m_eff` effective masses in kg, of the same
    shape.
    """
    k, p, gamma, d = (kinds[name] for name in ("k", "p", "gamma", "d"))
    linear = p == 1.0
    kinds["map"] = np.where(linear, DASHPOT, np.where((p == 1.5) & (gamma > 0.0) & (d == 0.5), VISCOELASTIC, NO_MAP))
    if linear.all():
        return
    shapes = np.full((*k.shape, len(Shape._fields)), np.nan)
    for exponent in np.unique(p[~linear]):
        is_elastic, is_similar = (
            (p == exponent) & (gamma == 0.0), (p == exponent) & (gamma > 0.0) & (d == 0.5 * (p - 1.0))
        )
        shapes[is_elastic] = np.transpose(elastic_shape(exponent))
        if is_similar.any():
            zeta = gamma[is_similar] / np.sqrt(2.0 * (exponent + 1.0) * k[is_similar] * m_eff[is_similar])
            zeta, index = np.unique(zeta, return_inverse=True)  # a parameter map has few different values
            shapes[is_similar] = np.transpose(damped_shape(exponent, zeta))[index]
    kinds["map"][shapes[..., 0] > 0.0] = SELF_SIMILAR
    for name, values in zip(Shape._fields, np.moveaxis(shapes, -1, 0), strict=True):
        kinds[name] = values


def law_kinds(laws: SceneLaws, scene: Scene) -> Any:
    """Return the laws of a scene as records of `LAW_KIND_RECORD`.

    The records are cached in `laws` if all laws have power forms.
    """
    if "kinds" in laws.notes:
        return copied(laws.notes["kinds"])
    speed, pull = speed_scale(scene), scene.gravity
    if scene.external_force is not None:
        pull = float(np.abs(scene.closing_acceleration).max())
    kinds = np.zeros(len(laws.each), LAW_KIND_RECORD)
    rows = zip(*(law_coefficients(law, speed, pull) for law in laws.each), strict=True)
    for name, values in zip(LAW_KIND_RECORD.names or (), rows, strict=False):
        kinds[name] = values
    kinds["elastic"] = [not (law.rate_dependent or law.memory) for law in laws.each]
    write_maps(kinds, laws, scene)
    if (kinds["kind"] == GENERAL).any():  # one general law, and all laws are evaluated by collocation
        kinds["kind"], kinds["s"] = GENERAL, 0.0
    else:
        laws.notes["kinds"] = copied(kinds)
    return kinds


def write_maps(kinds: Any, laws: SceneLaws, scene: Scene) -> None:
    """Set the closed-form contact map of every kind of law in a scene.

    For contact maps see the module docstring. A damped self-similar map holds for one damping ratio only. Damped
    kinds whose pairs have different effective masses therefore get `NO_MAP`, unless they are linear or viscoelastic.
    General laws also get `NO_MAP`.
    """
    set_contact_maps(kinds, np.array([law.pair.m_eff for law in laws.each]))
    kinds["map"][kinds["kind"] == GENERAL] = NO_MAP
    damped = (kinds["map"] == SELF_SIMILAR) & (kinds["gamma"] > 0.0)
    if damped.any():
        lightest, heaviest = np.full(len(kinds), np.inf), np.zeros(len(kinds))
        np.minimum.at(lightest, laws.kind, scene.pairs.m_eff)
        np.maximum.at(heaviest, laws.kind, scene.pairs.m_eff)
        kinds["map"][damped & (lightest < heaviest)] = NO_MAP


def law_coefficients(law: PairLaw, speed: float, gravity: float) -> tuple[float, ...]:
    """Return the kind of a law and its coefficients: the start of a `LAW_KIND_RECORD`.

    `speed` in m/s and `gravity` in m/s² are typical of the scene. They are used for general laws only.
    """
    form = power_form(law)
    if form is None:
        k, p, q = _rough_form(law, speed, gravity)
        return GENERAL, q, law.memory, k, 0.0, p, 0.0, 0.0
    k, p, gamma, d = form
    d = damping_exponent(p, gamma, d)
    return *kind_and_q(*form), law.memory, k, gamma, p, d, p - d


def power_form(law: PairLaw) -> Form | None:
    """Return (k, p, γ, d) of F = k ξ^p + γ ξ^d ξ̇, or None for a general law.

    The exponents must be such that a power series can represent the law.
    """
    return law.form if law.form is not None and kind_and_q(*law.form)[0] != GENERAL else None


def _rough_form(law: PairLaw, speed: float, gravity: float) -> tuple[float, float, int]:
    """Return k and p of a power law comparable to `law`, and q of its start series.

    q is the exponent of t = (hτ)^q: 1 if the force starts smoothly in time, else 2. The result only sets scales, such
    as the first step. The two laws agree at the overlap of an impact at `speed` (m/s), or of a weight at rest under
    `gravity` (m/s²).
    """
    pair = law.pair
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    typical = xi
    # go up until the force stops the impact, then down to the first overlap that does not
    for step in (4.0, 0.25):
        while 1e-100 < xi < 1e100 and speed + gravity > 0.0:
            stops_impact = abs(_bounded_force(law, xi)) * xi >= pair.m_eff * (speed * speed + gravity * xi)
            if stops_impact == (step > 1.0):
                break
            xi *= step
    if not 1e-100 < xi < 1e100:  # the law cannot bear the weight, or does not stop an impact
        return _rough_form(law, speed, 0.0) if gravity > 0.0 else _form_at_overlap(law, typical)
    return _form_at_overlap(law, xi)


def _form_at_overlap(law: PairLaw, xi: float) -> tuple[float, float, int]:
    """Return (k, p, q) of the power law that is tangent to a law at overlap `xi` in m.

    See `_rough_form`.
    """
    p, onset = (_force_exponent(law, x) for x in (xi, 1e-6 * xi))
    k = abs(_bounded_force(law, xi)) / math.pow(xi, p)
    return (k if 0.0 < k < math.inf else 1.0), p, (1 if abs(onset - round(onset)) < 1e-3 else 2)


def _force_exponent(law: PairLaw, xi: float) -> float:
    """Return the exponent d ln F / d ln ξ at rest at overlap `xi` in m, within [1, 3].

    It is 1.5 where it is not defined.
    """
    near, far = abs(_bounded_force(law, xi)), abs(_bounded_force(law, 1.01 * xi))
    if not 0.0 < near < math.inf or not 0.0 < far < math.inf:
        return 1.5
    # the exponent only sets scales: limit it to exponents of common laws
    return min(max(1.0, math.log(far / near) / math.log(1.01)), 3.0)


def _bounded_force(law: PairLaw, xi: float) -> float:
    """Return the force in N at rest at overlap `xi` in m, or 0 on overflow."""
    try:
        return law.force(xi, 0.0, xi)
    except OverflowError:
        return 0.0


def kind_and_q(k: float, p: float, gamma: float, d: float) -> tuple[int, int]:
    """Return the kind of the law F = k ξ^p + γ ξ^d ξ̇, and an exponent q.

    q is the exponent of pieces that start at an onset. The kind is LINEAR, ELASTIC, DAMPED or GENERAL. F is a power
    series in ξ^(1/q), so at an onset it is expanded in τ with t = (hτ)^q. A law that is not LINEAR is GENERAL if k ≤ 0,
    if q or q·p is too large, or if it is damped with d outside [0, p).
    """
    if p == 1.0 and (gamma == 0.0 or d == 0.0):
        return LINEAR, 1
    q = _denominator(p) if gamma == 0.0 else math.lcm(_denominator(p), _denominator(d))
    if k > 0.0 and q <= MAX_CLOCK_EXPONENT and q * p <= MAX_START_EXPONENT and (gamma == 0.0 or 0.0 <= d < p):
        return (ELASTIC if gamma == 0.0 else DAMPED), q
    return GENERAL, min(q, MAX_CLOCK_EXPONENT)


def damping_exponent(p: float, gamma: float, d: float) -> float:
    """Return the exponent d of F = ξ^d (k ξ^(p-d) + γ ξ̇).

    Without damping it is arbitrary: ½ for Hertz's law, else 0.
    """
    return d if gamma != 0.0 else 0.5 if p == 1.5 else 0.0


@cache
def _denominator(exponent: float) -> int:
    """Return the smallest q with q·exponent an integer, or `MAX_CLOCK_EXPONENT` + 1."""
    # 1e-12: exponents such as 1/3 are not exact floats
    matches = (q for q in range(1, MAX_CLOCK_EXPONENT + 1) if abs(q * exponent - round(q * exponent)) < 1e-12)
    return next(matches, MAX_CLOCK_EXPONENT + 1)


class Shape(NamedTuple):
    """Isolated contacts of power laws with one exponent p.

    The arrays have one entry per damping ratio ζ.

    Attributes
    ----------
    force_ends : (n,) array
        Time from the touch at which the force vanishes, in units of X/v (see the module docstring).
    parts : (n,) array
        Time from the touch at which the overlap vanishes and the balls part, in units of X/v.
    restitution : (n,) array
        Coefficient of restitution.
    deepest, strongest : (n,) arrays
        Largest overlap in units of X, and largest force in units of k X^p.
    """

    force_ends: Array
    parts: Array
    restitution: Array
    deepest: Array
    strongest: Array


def elastic_shape(p: float) -> Shape:
    """Return the `Shape` of isolated elastic contacts with exponent `p`.

    Its fields are arrays (1,).
    """
    part = 1.0 / (p + 1.0)
    deepest = math.pow(0.5 * (p + 1.0), part)
    arc = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + part) / math.gamma(0.5 + part) * deepest
    return Shape(*(np.array([x]) for x in (arc, arc, 1.0, deepest, math.pow(deepest, p))))


def damped_shape(p: float, zeta: Array) -> Shape:
    """Return the `Shape` of isolated contacts of damped power laws.

    `p` is the exponent of the laws, and `zeta` > 0 are their damping ratios, of shape (n,). The fields of the
    result are arrays (n,) in the units of `Shape`. Values are nan for ζ ≥ 1, where s has no half period, and for p >
    `MAX_DAMPED_EXPONENT`.
    """
    zeta = np.where((zeta < 1.0) & (p <= MAX_DAMPED_EXPONENT), zeta, np.nan)[:, None]
    beta, root, omega = (p - 1.0) / (p + 1.0), np.sqrt((1.0 - zeta) * (1.0 + zeta)), math.sqrt(0.5 * (p + 1.0))
    fade, height = zeta / root, omega / root
    end, missing = 2.0 * np.arctan2(root, zeta), 2.0 * np.arctan2(zeta, root)  # phases; together half a period

    def s(phase: Any) -> Any:
        return height * np.exp(-fade * phase) * np.sin(phase)

    def s_from_end(phase: Any) -> Any:  # phase counted backwards from the half period
        return height * np.exp(-fade * (math.pi - phase)) * np.sin(phase)

    def force(phase: Any) -> Any:
        rate = (np.cos(phase) - fade * np.sin(phase)) * np.exp(-fade * phase)  # ξ̇
        return s(phase) ** beta * (s(phase) + 2.0 * zeta * omega * rate)

    half = np.full_like(zeta, 0.5 * math.pi)
    whole = (
        _phase_integral(s, half, beta)
        + _phase_integral(s_from_end, half, beta)
        - _phase_integral(s_from_end, missing, beta)
    )
    integral = np.where(zeta < STRONG_DAMPING_RATIO, whole, _phase_integral(s, end, beta))
    duration, restitution = integral / (omega * root), np.exp(-fade * end)
    remaining = height * restitution * np.sin(missing)  # s where the force is zero
    parts = duration + remaining ** (2.0 / (p + 1.0)) / restitution
    deepest = s(0.5 * end) ** (2.0 / (p + 1.0))
    return Shape(*(x[:, 0] for x in (duration, parts, restitution, deepest, _largest_force(force, 0.5 * end))))


def _phase_integral(s: Callable[[Any], Any], high: Array, beta: float) -> Array:
    """Return ∫ s^(-β) dφ from φ = 0, where s is zero, to `high`."""
    x, weight = _jacobi_points(beta)
    half = 0.5 * high
    total: Array = half * np.sum(weight * (s(half * (1.0 + x)) / (1.0 + x)) ** -beta, axis=1, keepdims=True)
    return total


@cache
def _jacobi_points(beta: float) -> tuple[Array, Array]:
    """Return points and weights on [-1, 1] for the weight function (1+x)^-β.

    The method is described by Golub & Welsch (1969).
    """
    k = np.arange(1.0, QUADRATURE_POINTS)
    middle = beta * beta / ((2.0 * k - beta) * (2.0 * k - beta + 2.0))
    beside = 4.0 * (k * (k - beta)) ** 2 / ((2.0 * k - beta) ** 2 * ((2.0 * k - beta) ** 2 - 1.0))
    # k = 1, with the common factor 1 - β cancelled
    beside[0] = 4.0 * (1.0 - beta) / ((2.0 - beta) ** 2 * (3.0 - beta))
    rows = np.diag(np.append(-beta / (2.0 - beta), middle)) + np.diag(np.sqrt(beside), 1) + np.diag(np.sqrt(beside), -1)
    x, vectors = np.linalg.eigh(rows)
    return x, 2.0 ** (1.0 - beta) / (1.0 - beta) * vectors[0] ** 2


def _largest_force(force: Callable[[Any], Any], high: Array) -> Array:
    """Return the largest value of a force that rises and then falls before `high`.

    The method is a golden-section search in the phase.
    """
    low = np.zeros_like(high)
    # 0.618^50 = 4e-11: the error of a maximum is of second order
    for _ in range(50):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        rises = force(a) < force(b)
        low, high = np.where(rises, a, low), np.where(rises, high, b)
    largest: Array = force(0.5 * (low + high))
    return largest

