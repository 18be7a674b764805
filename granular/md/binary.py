"""Isolated contact of two bodies: restitution, duration, overlap and force.

Two bodies of effective mass m_eff meet at speed v without other forces: m_eff ξ̈ = -max(0, F(ξ, ξ̇)), ξ(0) = 0,
ξ̇(0) = v, until F returns to zero. `with_restitution` solves the inverse problem. Event-driven simulation uses only the
restitution of a force law, and `restitution_of` creates the collision rule.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check, signature
from granular.laws import dashpot
from granular.laws.contact_law import PairLaw, instance, resolve
from granular.laws.kinds import hashable_contents, resolved
from granular.laws.rules import ConstantRestitution, Rule
from granular.md.oblique_impact import Oblique, oblique_impact
from granular.md.simulation import simulate
from granular.scene.pair import Pair, Pairs, checked_pair
from granular.scene.places import checked
from granular.scene.state import Scene

__all__ = [
    "Collision", "LawRestitution", "Oblique", "collision", "oblique", "restitution", "restitution_of",
    "with_restitution",
]
__dir__ = __all__.copy

MAX_CONTACT_STEPS = 20_000
"""Number of integration steps after which a contact is assumed not to end."""
SLOWEST_IMPACT, FASTEST_IMPACT = 1e-50, 1e50
"""Lowest and highest impact speed in m/s for which a contact is integrated.

At other speeds overlaps, forces or energies exceed the range of floats."""
STUCK_SPEED_RATIO = 1e-9
"""Final speed of a contact that counts as 0, relative to the impact speed.

With a smaller final speed the contact absorbs all kinetic energy."""


@signature.face
@dataclass(frozen=True)
class Collision:
    """Restitution, duration, peaks and final overlap of one isolated contact.

    Attributes
    ----------
    restitution : float
        ε = separation speed / approach speed.
    duration : float
        t_c in s, from ξ = 0 to F = 0.
    xi_max, force_max : float
        Largest overlap in m and largest force in N.
    xi_end : float
        Overlap in m at which the force vanishes: 0 for elastic laws, positive with damping.
    """

    restitution: float
    duration: float
    xi_max: float
    force_max: float
    xi_end: float


@signature.face
def collision(law: Any, pair: Pair, speed: float) -> Collision:
    """Compute the isolated contact of `pair` under `law` at impact speed `speed`.

    Linear laws (with any damping), undamped powers and `WaltonBraun` have closed forms. The restitution of damped
    powers F = k ξ^p + γ ξ^((p-1)/2) ξ̇ also has a closed form. It is the restitution of the dashpot with
    ζ = γ / √(2 (p+1) k m_eff) (Tsuji: α/√5). All other contacts are integrated by the event-located method.

    Parameters
    ----------
    law : force law
        Law of the contact.
    pair : Pair
        The two bodies, such as ``scene.pairs[0]``.
    speed : float
        Impact speed in m/s.

    Returns
    -------
    Collision
        Restitution, duration and peaks.

    Raises
    ------
    TypeError, ValueError
        If `speed` is not positive, if the contact does not end (ε = 0, or the law does not repel), if it gains energy,
        or if its overlap or force exceeds the range of floats. The last case includes speeds below 1e-50 or above
        1e50 m/s, except for linear laws.

    Examples
    --------
    >>> import granular as gr
    >>> pair = gr.scenes.three_balls().pairs[1]
    >>> hit = gr.binary.collision(gr.LinearDashpot(k=1e5, gamma=0.5), pair, speed=3.0)
    >>> round(hit.restitution, 6), float(f"{hit.duration:.4g}")
    (0.960653, 0.0006047)
    """
    pair_law, v = _resolved(law, pair), _speed(speed)
    if pair_law.form is not None and pair_law.is_linear:
        return _checked_range(_linear_contact(pair_law.form[0], pair_law.form[2], pair, v), v)
    if pair_law.form is not None and pair_law.form[2] == 0.0 and SLOWEST_IMPACT <= v <= FASTEST_IMPACT:
        return _checked_range(_elastic_contact(pair_law.form[0], pair_law.form[1], pair, v), v)
    if is_bilinear(pair_law) and SLOWEST_IMPACT <= v <= FASTEST_IMPACT:
        return _checked_range(Collision(*law.isolated(pair, v)), v)
    return _integrated_contact(law, pair, v)


@overload
def restitution(law: Any, pair: Pair, speed: float) -> float: ...


@overload
def restitution(law: Any, pair: Pair, speed: ArrayLike) -> float | check.Array: ...


@signature.face
def restitution(law: Any, pair: Pair, speed: ArrayLike) -> float | check.Array:
    """Return ε of an isolated contact of `pair` under `law` at impact speed `speed`.

    Parameters
    ----------
    law, pair
        As for `collision`.
    speed : float or array
        Impact speed in m/s.

    Returns
    -------
    float or array
        ε, with the shape of `speed`.

    Raises
    ------
    TypeError, ValueError
        As for `collision`.

    Examples
    --------
    >>> import granular as gr
    >>> pair = gr.scenes.three_balls().pairs[1]
    >>> gr.binary.restitution(gr.LinearDashpot(k=1e5, gamma=0.5), pair, [1.0, 3.0]).round(6).tolist()
    [0.960653, 0.960653]
    """
    pair_law = _resolved(law, pair)
    if check.is_single(speed):
        return restitution_at_speed(pair_law, _speed(speed))
    speeds = check.array("speed", speed, ...)
    return np.array([restitution_at_speed(pair_law, _speed(v)) for v in speeds.flat]).reshape(speeds.shape)


def restitution_at_speed(pair_law: PairLaw, speed: float) -> float:
    """Return ε at an impact speed in m/s, without checking the speed.

    At speed 0 the result is 1, unless ε is the same at every speed.
    """
    if (constant := constant_restitution(pair_law)) is not None:
        return constant
    if not speed > 0.0:
        return 1.0
    if pair_law.form is not None and pair_law.form[1::2] == (1.5, 0.5):
        from granular.laws import viscoelastic_restitution

        k, _, gamma, _ = pair_law.form
        return float(viscoelastic_restitution.restitution(gamma * k**-0.6 * pair_law.pair.m_eff**-0.4 * speed**0.2))
    return _integrated_contact(pair_law.law, pair_law.pair, max(speed, SLOWEST_IMPACT)).restitution


def restitution_or_nan(pair_law: PairLaw, speed: float) -> float:
    """Return ε at an impact speed in m/s, or nan if it cannot be computed.

    The result is nan for a contact that does not end, for example.
    """
    try:
        return restitution_at_speed(pair_law, speed)
    except (ValueError, ArithmeticError):
        return math.nan


def constant_restitution(pair_law: PairLaw) -> float | None:
    """Return ε if it is known to be the same at every speed, else None."""
    zeta = damping_ratio(pair_law)
    if zeta is None:
        return float(pair_law.law.restitution()) if is_bilinear(pair_law) else None
    return dashpot.restitution(zeta)


def is_bilinear(pair_law: PairLaw) -> bool:
    """Return whether the law is an instance of `WaltonBraun`, not of a subclass."""
    if not pair_law.memory:
        return False
    from granular.laws.springs import WaltonBraun

    return type(pair_law.law) is WaltonBraun


def damping_ratio(pair_law: PairLaw) -> float | None:
    """Return ζ of the linear dashpot with the same ε as the law, or None.

    The result is None if ε is not known to be the same at every speed.
    """
    if pair_law.form is None:
        return None
    k, p, gamma, d = pair_law.form
    is_constant = gamma == 0.0 or d == 0.5 * (p - 1.0)
    return gamma / math.sqrt(2.0 * (p + 1.0) * k * pair_law.pair.m_eff) if is_constant else None


class StuckError(ValueError):
    """Exception for a contact whose damping stops the bodies, so they do not separate."""


@signature.face
@dataclass(frozen=True)
class LawRestitution:
    """Collision rule that computes ε from force laws, for an impact speed and a pair.

    Attributes
    ----------
    laws : tuple
        One law for all pairs, or one per pair from the bottom up.
    """

    laws: tuple[Any, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.laws, (tuple, list)) or not self.laws:
            raise TypeError(f"`laws` must be a tuple of force laws, one for all or one per pair, got {self.laws!r}.")
        for law in self.laws:
            instance("law", law)

    def __call__(self, speed: float, pair: Pair) -> float:
        """Return ε of `pair` at the impact speed `speed` in m/s.

        ε is 0 if the contact absorbs all kinetic energy and does not end.
        """
        try:
            return restitution_at_speed(resolve(self.laws[0 if len(self.laws) == 1 else pair.index], pair), speed)
        except StuckError:
            return 0.0


@signature.face
def restitution_of(law: Any | Sequence[Any], scene: Scene | None = None) -> Rule:
    """Return the collision rule of one force law, or of a list with one law per pair.

    Parameters
    ----------
    law : force law or sequence of force laws
        One law for all pairs, or one per pair from the bottom up.
    scene : Scene, optional
        If ε is independent of the speed in all pairs of this scene, the rule is a `ConstantRestitution`. With this rule
        hard-sphere runs are faster, and inelastic collapse is detected exactly.

    Returns
    -------
    Rule
        ``rule(speed, pair)`` for `granular.edmd.simulate`.

    Raises
    ------
    TypeError, ValueError
        For invalid arguments.

    Examples
    --------
    >>> import granular as gr
    >>> scene = gr.scenes.three_balls()
    >>> rule = gr.restitution_of(gr.LinearDashpot(k=1e5, gamma=0.5), scene)
    >>> round(rule(1.0, scene.pairs[1]), 6)
    0.960653
    """
    laws = tuple(law) if isinstance(law, (list, tuple)) else (law,)
    for each_law in laws:
        instance("law", each_law)
    if scene is not None:
        pair_laws = resolved(check.per_pair("law", laws if len(laws) > 1 else laws[0], checked(scene).n_pairs), scene)
        if None not in map(constant_restitution, pair_laws.each):
            return ConstantRestitution(pair_laws.column(lambda pair_law: restitution_at_speed(pair_law, 1.0)))
    return LawRestitution(laws)


@signature.face
class LawRule(LawRestitution):
    """Collision rule of a comparison, which also checks the range of ε.

    It raises a `ValueError` that names the law if ε is outside [0, 1].
    """

    def __call__(self, speed: float, pair: Pair) -> float:
        eps = super().__call__(speed, pair)
        if not 0.0 <= eps <= 1.0 + 1e-9:  # the engine handles an excess by rounding
            law = self.laws[pair.index]
            raise ValueError(
                f"The law of pair {pair.name}, {law!r}, must have a restitution in [0, 1], got {eps:.6g} at an "
                f"approach speed of {speed:g} m/s. Use a law that repels and does not gain energy, or give your own "
                "rule=..."
            )
        return eps


def rule_of_comparison(laws: tuple[Any, ...], scene: Scene) -> Rule:
    """Return the collision rule with which a comparison replaces the force laws.

    `laws` contains one force law per pair.
    """
    rule = restitution_of(laws, scene)
    return LawRule(laws) if isinstance(rule, LawRestitution) else rule


@signature.face
def with_restitution(law: Any, target: float, pair: Pair, speed: float = 1.0, field: str = "gamma") -> Any:
    """Return a copy of `law` with `field` chosen so that the restitution is `target`.

    This is the inverse of `restitution`, for any law whose ε decreases as the damping coefficient `field` increases.

    Parameters
    ----------
    law : force law
        A dataclass with the field.
    target : float
        Restitution of an isolated contact, in (0, 1].
    pair : Pair
        The two bodies.
    speed : float
        Impact speed in m/s. It matters only for laws whose ε depends on it. Defaults to 1.
    field : str
        Name of the damping coefficient. Defaults to "gamma".

    Returns
    -------
    force law
        Copy of `law` with a new value of `field`.

    Raises
    ------
    ValueError
        If `law` does not have this field, or no value of it gives the target.

    Examples
    --------
    >>> import granular as gr
    >>> pair = gr.scenes.three_balls().pairs[1]
    >>> law = gr.binary.with_restitution(gr.LinearDashpot(k=1e5, gamma=0.0), 0.9, pair)
    >>> round(gr.binary.restitution(law, pair, 1.0), 12)
    0.9
    """
    from scipy.optimize import brentq

    target_number = check.number("target", target, above=0.0, at_most=1.0)
    pair_law, v = _resolved(law, pair), _speed(speed)
    if not isinstance(field, str) or field not in getattr(law, "__dataclass_fields__", ()):
        raise ValueError(f"`field` must be a field of {type(law).__name__}, got {field!r}. Name the damping of the "
                         "law.")

    def restitution_error(log_value: float) -> float:
        return restitution_at_speed(resolve(replace(law, **{field: math.exp(log_value)}), pair), v) - target_number

    # a dashpot with this damping is near critical, so the search starts within a few e-foldings of the root
    initial_log = 0.5 * math.log(pair_law.tangent(pair_law.overlap_at(v))[0] * pair.m_eff)
    low = high = initial_log if target_number < 1.0 else -math.inf
    # widen the bracket by factors of e^4; exp(±300) is close to the range of floats
    while restitution_error(low) < 0.0 and low > -300.0:
        low, high = low - 4.0, low
    while restitution_error(high) > 0.0 and high < 300.0:
        low, high = high, high + 4.0
    if not (restitution_error(low) >= -1e-9 * (target_number == 1.0) and restitution_error(high) <= 0.0):
        raise ValueError(f"`target` must be a restitution that `{field}` can reach at {speed} m/s, got {target!r}.")
    log_field = brentq(restitution_error, low, high, xtol=1e-14, rtol=1e-14) if low < high else low
    return replace(law, **{field: math.exp(log_field)})


@signature.face
def oblique(law: Any, pair: Pair, distance: float, normal_speed: float, tangential_speed: float) -> Oblique:
    """Compute the oblique impact of two frictionless spheres, in three dimensions.

    During a contact the line of centres turns, so a soft impact deviates from a hard-sphere collision even without
    other contacts. At 45° the rotation in rad is about three times the relative overlap
    ξ_max/(R₁ + R₂). Nearer to head-on it is proportional to tangential_speed/normal_speed.

    Parameters
    ----------
    law, pair
        As for `collision`.
    distance : float
        Distance R₁ + R₂ of the centres in m at first touch. It must be larger than the largest overlap.
    normal_speed, tangential_speed : float
        Components of the relative velocity in m/s along and across the line of centres at first touch. The normal speed
        must be positive.

    Returns
    -------
    Oblique
        Rotation, duration, restitutions and deviation from hard spheres.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, `collision` refuses the contact, or the contact does not end.

    Examples
    --------
    A spring with v t_c/(R₁ + R₂) = 0.1, hit at 45°:

    >>> import math
    >>> import granular as gr
    >>> pair = gr.Pair(m_eff=0.5, r_eff=0.25, index=0)
    >>> law = gr.LinearDashpot(k=0.5 * (math.pi / 0.1) ** 2)
    >>> hit = gr.binary.oblique(law, pair, 1.0, math.sqrt(0.5), math.sqrt(0.5))
    >>> round(hit.rotation, 9), round(hit.restitution, 6), round(hit.tangential, 6)
    (0.071648192, 0.925847, 1.069021)
    """
    length = check.number("distance", distance, above=0.0)
    normal = check.number("normal_speed", normal_speed, above=0.0)
    tangential = check.number("tangential_speed", tangential_speed, at_least=0.0)
    pair_law, head_on = _resolved(law, pair), collision(law, pair, normal)
    if not head_on.xi_max < length:
        raise ValueError(check.misuse("distance", distance, f"larger than the overlap {head_on.xi_max:.6g} m",
                                      "Use a stiffer law or a lower speed."))
    return oblique_impact(pair_law, head_on, length, normal, tangential)


def _speed(value: Any) -> float:
    """Return an impact speed in m/s after checking that it is positive."""
    return check.number("speed", value, above=0.0)


def _resolved(law: Any, pair: Pair) -> PairLaw:
    """Return the law of one pair, after checking both."""
    return resolve(instance("law", law), checked_pair(pair))


def _linear_contact(k: float, gamma: float, pair: Pair, v: float) -> Collision:
    """Compute the contact of a linear dashpot at impact speed `v` in closed form.

    `k` is in N/m, `gamma` in kg/s and `v` in m/s. The overlap is largest after half of the contact duration. For ζ ≥ ½
    the force is largest at the onset, otherwise at ωt = 3α - π with α = acos ζ and ω = ω₀ √(1 - ζ²).
    """
    omega, zeta = math.sqrt(k / pair.m_eff), 0.5 * gamma / math.sqrt(k * pair.m_eff)
    eps, t_c = dashpot.restitution(zeta), dashpot.reduced_duration(zeta)
    peak = 2.0 * zeta if zeta >= 0.5 else math.exp(
        -zeta * (3.0 * math.acos(zeta) - math.pi) / math.sqrt((1.0 - zeta) * (1.0 + zeta)))
    deepest = v / omega * math.exp(-0.5 * zeta * t_c)
    return Collision(eps, t_c / omega, deepest, peak * pair.m_eff * omega * v, 2.0 * zeta * eps * v / omega)


def _elastic_contact(k: float, p: float, pair: Pair, v: float) -> Collision:
    """Compute the contact of the undamped law F = k ξ^p in closed form.

    `k` is in N/m^p, and `v` is the impact speed in m/s. The formulas are ξ_max = ((p+1) m v² / (2k))^(1/(p+1)) and
    t_c v / ξ_max = 2 √π Γ(1 + 1/(p+1)) / Γ(½ + 1/(p+1)).
    """
    deepest = math.pow(0.5 * (p + 1.0) * pair.m_eff * v * v / k, 1.0 / (p + 1.0))
    shape = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / (p + 1.0)) / math.gamma(0.5 + 1.0 / (p + 1.0))
    return Collision(1.0, shape * deepest / v, deepest, k * math.pow(deepest, p), 0.0)


def _integrated_contact(law: Any, pair: Pair, v: float) -> Collision:
    """Compute a contact at impact speed `v` in m/s by the event-located method.

    Results are cached for immutable laws.
    """
    values = hashable_contents(law)
    return _simulate_contact(law, pair, v) if values is None else _cached_contact(values, law, pair, v)


@lru_cache(maxsize=4096)
def _cached_contact(values: tuple[Any, ...], law: Any, pair: Pair, v: float) -> Collision:
    """Compute a contact as `_simulate_contact` does, with a cache.

    `values` are the contents of the law, so that a changed law is not found in the cache.
    """
    return _simulate_contact(law, pair, v)


def _simulate_contact(law: Any, pair: Pair, v: float) -> Collision:
    """Compute a contact by simulating a ball of mass m_eff that hits a wall.

    `v` is the impact speed in m/s. If the force of the law starts only at a positive overlap, the touch is logged as a
    separate contact without force. The contact with the largest impulse is therefore evaluated.
    """
    if not SLOWEST_IMPACT <= v <= FASTEST_IMPACT:
        raise _range_error(v)
    scene = Scene([math.inf, pair.m_eff], [0.0, min(pair.r_eff, 1.0)], [0.0], [0.0, -v])
    # the law must receive the original pair, not the pair of this auxiliary scene
    scene.__dict__["pairs"] = Pairs(np.array([pair.m_eff]), np.array([pair.r_eff]), pair.index)
    run = simulate(scene, law, max_events=8, max_steps=MAX_CONTACT_STEPS)
    contact = run.contacts[int(np.argmax(run.contacts["impulse"]))]
    if not math.isfinite(contact["force_max"]):
        raise _range_error(v)
    # the row of an unfinished contact has no values at its end: use the final state instead
    v_end = float(run.velocity[-1][1] if math.isnan(contact["t_end"]) else contact["v_out"][1])
    if contact["impulse"] > 0.5 * pair.m_eff * v and abs(v_end) <= STUCK_SPEED_RATIO * v and not v_end > 0.0:
        raise StuckError(f"`law` must let the bodies separate, got {law!r}. At {v!r} m/s a contact "
                         "absorbs all kinetic energy and does not end. Use weaker damping.")
    if contact["force_max"] == 0.0 or contact["v_out"][1] < 0.0:
        raise ValueError(f"`law` must repel, got {law!r}. At {v!r} m/s the bodies pass through each other, so there is "
                         "no restitution.")
    if math.isnan(contact["t_end"]):
        raise ValueError(f"`law` must let the bodies separate, got {law!r}. At {v!r} m/s a contact does not end. Use "
                         "weaker damping.")
    eps = float(contact["v_out"][1]) / v
    if eps > 1.0 + 1e-9:
        raise ValueError(f"`law` must not gain energy, got {law!r}. At {v!r} m/s its restitution is {eps!r}. Its force "
                         "must not be larger while the bodies separate than while they approach.")
    at_end = simulate(scene, law, t_end=float(contact["t_end"]), log=False)
    duration, xi_max, force_max = (float(contact[name]) for name in ("duration", "xi_max", "force_max"))
    return _checked_range(Collision(min(eps, 1.0), duration, xi_max, force_max, max(0.0, -float(at_end.gap[-1][0]))), v)


def _checked_range(contact: Collision, v: float) -> Collision:
    """Return `contact`, or raise `ValueError` if a number exceeds the range of floats.

    `v` is the impact speed in m/s.
    """
    if not all(0.0 < x < math.inf for x in (contact.duration, contact.xi_max, contact.force_max)):
        raise _range_error(v)
    return contact


def _range_error(v: float) -> ValueError:
    """Return the exception for a contact whose numbers exceed the range of floats."""
    return ValueError(f"`speed` must lead to a contact within the range of floating-point numbers, got {v!r}: its "
                      "overlap, force or duration exceeds it. Use SI units.")
