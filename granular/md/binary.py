"""One isolated contact under a force law: restitution, duration, peaks; the inverse; the rule made from a law.

Two bodies of effective mass m_eff meet at speed v and see nothing else: m_eff ξ̈ = -max(0, F(ξ, ξ̇)), ξ(0) = 0,
ξ̇(0) = v, until F returns to zero. This is all that event-driven simulation knows of a force law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check
from granular.laws import dashpot
from granular.laws.contact_law import PairLaw, instance, resolve
from granular.laws.kinds import held, resolved
from granular.laws.rules import ConstantRestitution, Rule
from granular.md.simulation import simulate
from granular.scene.pair import Pair, Pairs, checked_pair
from granular.scene.places import checked
from granular.scene.state import Scene

__all__ = ["Collision", "LawRestitution", "collision", "restitution", "restitution_of", "with_restitution"]
__dir__ = __all__.copy

MAX_STEPS = 20_000
"""Steps after which a contact is taken to go on forever."""
SLOWEST, FASTEST = 1e-50, 1e50
"""Impact speeds in m/s between which a contact is run: beyond, its overlaps, forces and energies are no numbers."""
STUCK = 1e-9
"""Part of the impact speed that may be left, downwards, of a contact that takes all of it."""


@check.face
@dataclass(frozen=True)
class Collision:
    """What one isolated contact does.

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


@check.face
def collision(law: Any, pair: Pair, speed: float) -> Collision:
    """Return the isolated contact of `pair` under `law` at impact speed `speed` in m/s.

    Closed forms for linear laws (any damping), undamped powers, `WaltonBraun`, and the restitution of damped powers
    F = k ξ^p + γ ξ^((p-1)/2) ξ̇, which map onto the dashpot with ζ = γ / √(2 (p+1) k m_eff) (Tsuji: α/√5); else the
    contact is run by the event-located method.

    Raises
    ------
    TypeError, ValueError
        If `speed` is not positive; if the contact never ends (ε = 0, or the law does not repel), gains energy, or its
        overlap or force is beyond the range of numbers (speeds below 1e-50 or above 1e50 m/s, except for linear laws).
    """
    known, v = _resolved(law, pair), _speed(speed)
    if known.form is not None and known.is_linear:
        return _in_range(_dashpot(known.form[0], known.form[2], pair, v), v)
    if known.form is not None and known.form[2] == 0.0 and SLOWEST <= v <= FASTEST:
        return _in_range(_elastic_power(known.form[0], known.form[1], pair, v), v)
    if is_bilinear(known) and SLOWEST <= v <= FASTEST:
        return _in_range(Collision(*law.isolated(pair, v)), v)
    return _integrated(law, pair, v)


@overload
def restitution(law: Any, pair: Pair, speed: float) -> float: ...


@overload
def restitution(law: Any, pair: Pair, speed: ArrayLike) -> float | check.Array: ...


@check.face
def restitution(law: Any, pair: Pair, speed: ArrayLike) -> float | check.Array:
    """ε of an isolated contact of `pair` under `law` at impact speed `speed` in m/s; see `collision`.

    For an array of speeds, an array of the same shape.
    """
    known = _resolved(law, pair)
    if check.is_one(speed):
        return at_speed(known, _speed(speed))
    speeds = check.array("speed", speed, ...)
    return np.array([at_speed(known, _speed(v)) for v in speeds.flat]).reshape(speeds.shape)


def at_speed(known: PairLaw, speed: float) -> float:
    """`restitution` at one speed, whatever it is: ε at rest is 1, or the limit for slow impacts."""
    if (same := steady(known)) is not None:
        return same
    if not speed > 0.0:
        return 1.0
    if known.form is not None and known.form[1::2] == (1.5, 0.5):
        from granular.laws import viscoelastic_restitution

        k, _, gamma, _ = known.form
        return float(viscoelastic_restitution.restitution(gamma * k**-0.6 * known.pair.m_eff**-0.4 * speed**0.2))
    return _integrated(known.law, known.pair, max(speed, SLOWEST)).restitution


def at_speed_or_nan(known: PairLaw, speed: float) -> float:
    """The same; nan if the contact does not end."""
    try:
        return at_speed(known, speed)
    except (ValueError, ArithmeticError):
        return math.nan


def steady(known: PairLaw) -> float | None:
    """ε if it is known to be the same at every speed, else None."""
    zeta = damping_ratio(known)
    if zeta is None:
        return float(known.law.restitution()) if is_bilinear(known) else None
    return dashpot.restitution(zeta)


def is_bilinear(known: PairLaw) -> bool:
    """Return whether the law is `WaltonBraun`, and none that is made of it."""
    if not known.memory:
        return False
    from granular.laws.springs import WaltonBraun

    return type(known.law) is WaltonBraun


def damping_ratio(known: PairLaw) -> float | None:
    """ζ of the dashpot with the law's restitution at every speed; None if ε is not known to be the same at all."""
    if known.form is None:
        return None
    k, p, gamma, d = known.form
    same = gamma == 0.0 or d == 0.5 * (p - 1.0)
    return gamma / math.sqrt(2.0 * (p + 1.0) * k * known.pair.m_eff) if same else None


class Stuck(ValueError):
    """A contact damped so strongly that the bodies stop and do not part."""


@check.face
@dataclass(frozen=True)
class LawRestitution:
    """The collision rule made from force laws: ε as a function of impact speed and pair.

    Attributes
    ----------
    laws : tuple
        One law for all pairs, or one per pair from the bottom up.
    """

    laws: tuple[Any, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.laws, (tuple, list)) or not self.laws:
            raise TypeError(f"laws is {self.laws!r}: a tuple of force laws is needed, one for all or one per pair.")
        for law in self.laws:
            instance("law", law)

    def __call__(self, speed: float, pair: Pair) -> float:
        """Restitution at impact speed `speed` in m/s; 0 where a contact takes all speed and does not end."""
        try:
            return at_speed(resolve(self.laws[0 if len(self.laws) == 1 else pair.index], pair), speed)
        except Stuck:
            return 0.0


@check.face
def restitution_of(law: Any | Sequence[Any], scene: Scene | None = None) -> Rule:
    """Return the collision rule of a force law, or of a list with one law per pair.

    Given the scene, it is a `ConstantRestitution` where ε depends on no speed: faster, and exact about collapse.
    """
    laws = tuple(law) if isinstance(law, (list, tuple)) else (law,)
    for one in laws:
        instance("law", one)
    if scene is not None:
        known = resolved(check.per_pair("law", laws if len(laws) > 1 else laws[0], checked(scene).n_pairs), scene)
        if None not in map(steady, known.each):
            return ConstantRestitution(known.column(lambda one: at_speed(one, 1.0)))
    return LawRestitution(laws)


@check.face
class LawRule(LawRestitution):
    """The rule that a comparison makes out of force laws: it speaks of the law where that gives no ε in [0, 1]."""

    def __call__(self, speed: float, pair: Pair) -> float:
        eps = super().__call__(speed, pair)
        if not 0.0 <= eps <= 1.0 + 1e-9:  # rounding is the engine's business
            law = self.laws[pair.index]
            raise ValueError(
                f"law of pair {pair.index} is {law!r}: its restitution at {speed:g} m/s is {eps:.6g}, so no hard-sphere"
                " rule can be made of it; a law that repels and gives no energy is needed, or a rule of yours, rule=..."
            )
        return eps


def rule_of_comparison(laws: tuple[Any, ...], scene: Scene) -> Rule:
    """The rule that a comparison makes of the laws."""
    rule = restitution_of(laws, scene)
    return LawRule(laws) if isinstance(rule, LawRestitution) else rule


@check.face
def with_restitution(law: Any, target: float, pair: Pair, speed: float = 1.0, field: str = "gamma") -> Any:
    """Return a copy of `law` whose `field` is chosen so that an isolated contact has restitution `target`.

    The inverse of `restitution`, for any law whose ε falls as `field` grows (damping). `speed` in m/s matters only
    for laws whose ε depends on it.

    Raises
    ------
    ValueError
        If `law` has no such field, or no value of it gives the target.
    """
    from scipy.optimize import brentq

    goal = check.number("target", target, above=0.0, at_most=1.0)
    known, v = _resolved(law, pair), _speed(speed)
    if not isinstance(field, str) or field not in getattr(law, "__dataclass_fields__", ()):
        raise ValueError(f"field is {field!r}: {type(law).__name__} has no such field; name the damping of the law.")

    def miss(log_value: float) -> float:
        return at_speed(resolve(replace(law, **{field: math.exp(log_value)}), pair), v) - goal

    # a dashpot of this strength is near critical
    near = 0.5 * math.log(known.tangent(known.overlap_at(v))[0] * pair.m_eff)
    low = high = near if goal < 1.0 else -math.inf
    while miss(low) < 0.0 and low > -300.0:
        low, high = low - 4.0, low
    while miss(high) > 0.0 and high < 300.0:
        low, high = high, high + 4.0
    if not (miss(low) >= -1e-9 * (goal == 1.0) and miss(high) <= 0.0):
        raise ValueError(f"target is {target!r}: no value of {field} gives this restitution at {speed} m/s.")
    found = brentq(miss, low, high, xtol=1e-14, rtol=1e-14) if low < high else low
    return replace(law, **{field: math.exp(found)})


def _speed(value: Any) -> float:
    return check.number("speed", value, above=0.0)


def _resolved(law: Any, pair: Pair) -> PairLaw:
    return resolve(instance("law", law), checked_pair(pair))


def _dashpot(k: float, gamma: float, pair: Pair, v: float) -> Collision:
    """All of a linear contact, with phase α = acos ζ: ξ peaks at ω₀t = f, F at ωt = 3α - π or, for ζ ≥ ½, at touch."""
    omega, zeta = math.sqrt(k / pair.m_eff), 0.5 * gamma / math.sqrt(k * pair.m_eff)
    eps, t_c = dashpot.restitution(zeta), dashpot.duration(zeta)
    peak = 2.0 * zeta if zeta >= 0.5 else math.exp(
        -zeta * (3.0 * math.acos(zeta) - math.pi) / math.sqrt((1.0 - zeta) * (1.0 + zeta)))
    deepest = v / omega * math.exp(-0.5 * zeta * t_c)
    return Collision(eps, t_c / omega, deepest, peak * pair.m_eff * omega * v, 2.0 * zeta * eps * v / omega)


def _elastic_power(k: float, p: float, pair: Pair, v: float) -> Collision:
    """ξ_max = ((p+1) m v² / (2k))^(1/(p+1)); t_c v / ξ_max = 2 √π Γ(1 + 1/(p+1)) / Γ(½ + 1/(p+1))."""
    deepest = math.pow(0.5 * (p + 1.0) * pair.m_eff * v * v / k, 1.0 / (p + 1.0))
    shape = 2.0 * math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / (p + 1.0)) / math.gamma(0.5 + 1.0 / (p + 1.0))
    return Collision(1.0, shape * deepest / v, deepest, k * math.pow(deepest, p), 0.0)


def _integrated(law: Any, pair: Pair, v: float) -> Collision:
    """The contact by the event-located method; remembered for laws that cannot change."""
    values = held(law)
    return _bounce(law, pair, v) if values is None else _remembered(values, law, pair, v)


@lru_cache(maxsize=4096)
def _remembered(values: tuple[Any, ...], law: Any, pair: Pair, v: float) -> Collision:
    return _bounce(law, pair, v)


def _bounce(law: Any, pair: Pair, v: float) -> Collision:
    """Let a ball of mass m_eff meet a wall.

    Where the force sets in late, the touch before counts in the log as a contact without force: the contact with the
    largest impulse is meant.
    """
    if not SLOWEST <= v <= FASTEST:
        raise _no_numbers(v)
    scene = Scene([math.inf, pair.m_eff], [0.0, min(pair.r_eff, 1.0)], [0.0], [0.0, -v])
    # the law sees the very pair that was asked about
    scene.__dict__["pairs"] = Pairs(np.array([pair.m_eff]), np.array([pair.r_eff]), pair.index)
    run = simulate(scene, law, max_events=8, max_steps=MAX_STEPS)
    contact = run.contacts[int(np.argmax(run.contacts["impulse"]))]
    if not math.isfinite(contact["force_max"]):
        raise _no_numbers(v)
    left = float(run.velocity[-1][1] if math.isnan(contact["t_end"]) else contact["v_out"][1])
    if contact["impulse"] > 0.5 * pair.m_eff * v and abs(left) <= STUCK * v and not left > 0.0:
        raise Stuck(f"law is {law!r}: a contact at {v!r} m/s takes all speed, does not end; weaker damping is needed.")
    if contact["force_max"] == 0.0 or contact["v_out"][1] < 0.0:
        raise ValueError(f"law is {law!r}: it does not repel at {v!r} m/s; the bodies pass through each other, and "
                         "there is no restitution.")
    if math.isnan(contact["t_end"]):
        raise ValueError(f"law is {law!r}: a contact at {v!r} m/s does not end; weaker damping is needed.")
    eps = float(contact["v_out"][1]) / v
    if eps > 1.0 + 1e-9:
        raise ValueError(f"law is {law!r}: a contact at {v!r} m/s gains energy, its restitution is {eps!r}; a force "
                         "that is no larger while the bodies part than while they approach is needed.")
    at_end = simulate(scene, law, t_end=float(contact["t_end"]), log=False)
    duration, xi_max, force_max = (float(contact[name]) for name in ("duration", "xi_max", "force_max"))
    return _in_range(Collision(min(eps, 1.0), duration, xi_max, force_max, max(0.0, -float(at_end.gap[-1][0]))), v)


def _in_range(found: Collision, v: float) -> Collision:
    """Return what was found, or raise if some of it is beyond the range of numbers."""
    if not all(0.0 < x < math.inf for x in (found.duration, found.xi_max, found.force_max)):
        raise _no_numbers(v)
    return found


def _no_numbers(v: float) -> ValueError:
    return ValueError(f"speed is {v!r}: overlap, force or duration of the contact is beyond the range of numbers; "
                      "usual units (SI) and a usual speed are needed.")
