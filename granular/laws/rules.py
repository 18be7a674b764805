"""Restitution rules for hard spheres: constants, tables, formulas and callables.

A rule is called as ``rule(speed, pair)`` with the impact speed in m/s (positive) and the `Pair`. It returns the
coefficient of restitution ε in [0, 1], which is minus the ratio of the relative velocities after and before the impact.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence, Sized
from contextlib import suppress
from dataclasses import dataclass
from itertools import repeat
from operator import is_
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.callables import function_of, is_user_defined
from granular.scene import Pair, checked_pair

Rule = Callable[[float, Pair], float]
"""Type of a restitution rule: ε in [0, 1] as a function of speed in m/s and pair."""


@signature.face
@dataclass(frozen=True)
class ConstantRestitution:
    """Coefficient of restitution that is the same at every speed.

    Parameters
    ----------
    restitution : float or sequence of float
        ε in [0, 1]: one for all pairs, or one per pair from the bottom up. 1 is elastic. With 0 for all pairs, balls
        stick together.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number in [0, 1].
    """

    restitution: float | tuple[float, ...]

    def __init__(self, restitution: float | Sequence[float]) -> None:
        name, fix = "restitution", "1 is elastic, 0 sticks."
        if isinstance(restitution, float) or check.is_single(restitution):
            value: Any = check.number(name, restitution, at_least=0.0, at_most=1.0, fix=fix)
        else:
            values = check.array(name, restitution)
            if len(values) == 0:
                raise ValueError("`restitution` must be one number for all pairs, or one per pair, got an empty array.")
            value = tuple(_unit_interval(values, fix).tolist())
        object.__setattr__(self, name, value)

    def __call__(self, speed: float, pair: Pair) -> float:
        """Return ε of `pair`, which is the same at every `speed`."""
        return self.restitution if isinstance(self.restitution, float) else self.restitution[pair.index]


@signature.face
@dataclass(frozen=True, eq=False)
class TabulatedRestitution:
    """Table of the restitution as a function of impact speed.

    The values can come from experiments or from a force law. They are interpolated linearly in speed. Outside the table
    the restitution is constant and equal to the first or the last entry, so the table should cover the required range.

    Parameters
    ----------
    speed : (k,) array
        Impact speeds in m/s, not negative, strictly increasing, with k ≥ 2.
    restitution : (k,) array
        ε at those speeds, each in [0, 1].

    Raises
    ------
    TypeError, ValueError
        If an entry is invalid. The message names the entry.
    """

    speed: check.Array
    restitution: check.Array

    def __init__(self, speed: Any, restitution: Any) -> None:
        v = check.increasing_array("speed", speed, "finite and non-negative", at_least=0.0)
        e = _unit_interval(check.array("restitution", restitution, v.shape, fix="Give one per speed."))
        self.__dict__.update(speed=v, restitution=e, _rows=(v.tolist(), e.tolist()))

    @classmethod
    def from_intervals(cls, times: Any, gravity: float = 9.81, *, sigma_t: float = 0.0) -> TabulatedRestitution:
        """Return the table of a bouncing ball from the intervals between its bounces.

        An interval T is one flight, which starts and ends at the speed g T/2. The restitution of the bounce between two
        intervals T_j and T_(j+1) is ε = T_(j+1)/T_j, at the impact speed g T_j/2. Drag and the durations of contacts
        are neglected.

        Parameters
        ----------
        times : (k+1,) array
            Intervals in s between successive bounces, as an acoustic stopwatch shows them. Each interval is shorter
            than the interval before it, and k ≥ 2. Convert times of bounces with ``numpy.diff``.
        gravity : float
            g in m/s². Defaults to 9.81.
        sigma_t : float
            Standard error in s of the time of one bounce. Defaults to 0. An interval has √2 times this error. A late
            bounce makes one interval longer and the next one shorter. `covariance` contains both effects.

        Returns
        -------
        TabulatedRestitution
            Table of k entries by increasing speed: the last bounce is first. With `covariance` and `standard_error`.

        Raises
        ------
        TypeError, ValueError
            If there are fewer than 3 intervals, if they do not decrease, or if an argument is not valid.
        """
        g, sigma = check.number("gravity", gravity, above=0.0), check.number("sigma_t", sigma_t, at_least=0.0)
        late = sigma * np.diff(np.eye(np.size(times) + 1), axis=0)
        return cls._of_ratios("times", times, 1.0, lambda t: 0.5 * g * t, late @ late.T,
                              "If these are times of bounces, use numpy.diff(times).")

    @classmethod
    def from_heights(cls, heights: Any, gravity: float = 9.81, *, sigma_h: float = 0.0) -> TabulatedRestitution:
        """Return the table of a bouncing ball from its drop and rebound heights.

        After a fall from the height h_j, the ball hits the floor at the speed √(2 g h_j). The restitution of this
        bounce is ε = √(h_(j+1)/h_j). Drag is neglected.

        Parameters
        ----------
        heights : (k+1,) array
            Heights in m of the lowest point of the ball above the floor: the drop height, then the apex after each
            bounce. Each height is lower than the height before it, and k ≥ 2.
        gravity : float
            g in m/s². Defaults to 9.81.
        sigma_h : float
            Standard error in m of each height. Defaults to 0. Errors of different heights are independent.

        Returns
        -------
        TabulatedRestitution
            Table of k entries by increasing speed: the last bounce is first. With `covariance` and `standard_error`.

        Raises
        ------
        TypeError, ValueError
            If there are fewer than 3 heights, if they do not decrease, or if an argument is not valid.
        """
        g, sigma = check.number("gravity", gravity, above=0.0), check.number("sigma_h", sigma_h, at_least=0.0)
        return cls._of_ratios("heights", heights, 0.5, lambda h: np.sqrt(2.0 * g * h),
                              sigma**2 * np.eye(np.size(heights)), "The drop height is the first.")

    @classmethod
    def _of_ratios(
        cls, name: str, series: Any, power: float, speed: Callable[[Any], Any], covariance: Any, fix: str
    ) -> TabulatedRestitution:
        """Return the table of ε = (y_(j+1)/y_j)^power from a decreasing series y.

        `covariance` is the covariance matrix of y, and `speed` computes the impact speed from y. `name` is the name of
        the series in messages. `fix` is the last sentence of the message about an entry that is not smaller than the
        one before it.
        """
        y = check.positive(name, series, "number")
        check.raise_if_true({check.must(name, "an array of at least 3 entries, before, between and after two bounces",
                                        f"{len(y)}"): len(y) < 3})
        check.every(name, y, np.diff(y, prepend=math.inf) < 0.0, "smaller than the entry before it (ε < 1)", fix)
        e = (y[1:] / y[:-1]) ** power
        slopes = power * e[:, None] * np.diff(np.eye(len(y)), axis=0) / y
        table = cls(speed(y[-2::-1]), e[::-1])
        table.__dict__["_covariance"] = (slopes @ covariance @ slopes.T)[::-1, ::-1]
        return table

    @property
    def covariance(self) -> check.Array:
        """Covariance matrix (k, k) of the entries of `restitution`.

        It is 0 unless the table was created from measurements with a standard error. Neighbouring entries are
        correlated, because they share a measured value. Saved files do not contain it.
        """
        return np.array(self.__dict__.get("_covariance", np.zeros((len(self.speed), len(self.speed)))))

    @property
    def standard_error(self) -> check.Array:
        """Standard error of each entry of `restitution`, from `covariance`."""
        return np.sqrt(np.diag(self.covariance))

    def __call__(self, speed: float, pair: Pair) -> float:
        """Return ε at impact `speed` (m/s), the same for every pair."""
        v, e = self.__dict__["_rows"]
        k = bisect_right(v, speed)
        if k == 0 or speed >= v[-1]:
            return float(e[0] if k == 0 else e[-1])
        return float(e[k - 1] + (e[k] - e[k - 1]) * ((speed - v[k - 1]) / (v[k] - v[k - 1])))


@signature.face
@dataclass(frozen=True)
class ThorntonRestitution:
    """Elastic-plastic spheres with a limiting contact pressure, without rate effects.

    Up to the yield speed the contact is a Hertz contact. Above it the pressure stays at its limit p_y while the contact
    area grows, so the force increases linearly. The flattened contact unloads as a Hertz contact of larger radius.
    With r = v_y/v:

        ε² = (6/5) (1 - r²/6) / √s,      s = 1/3 + (2/3) √(6/5 - r²/5) / r      for v > v_y, else ε = 1,

    where s is the ratio of the largest overlap to the overlap at first yield. This equals the formula of Thornton
    (1997), ε = (6√3/5)^½ (1 - r²/6)^½ [r / (r + 2 √(6/5 - r²/5))]^¼. For fast impacts ε → 1.1850 (v_y/v)^¼.

    Parameters
    ----------
    yield_speed : float
        v_y in m/s, positive: the lowest impact speed at which the material yields.

    References
    ----------
    C. Thornton, J. Appl. Mech. 64, 383 (1997).
    """

    yield_speed: float

    def __post_init__(self) -> None:
        check.number("yield_speed", self.yield_speed, above=0.0)

    @classmethod
    def from_material(cls, young: float, poisson: float, yield_pressure: float, pair: Pair) -> ThorntonRestitution:
        """Return the rule of `pair` for two bodies of one material.

        The yield speed is v_y = (π / (2 E*))² √(8 π r_eff³ / (15 m_eff)) p_y^(5/2) with E* = Y / (2 (1 - ν²)). At this
        speed the largest pressure of a Hertz contact, 2 E* √(ξ/r_eff) / π, reaches p_y.

        Parameters
        ----------
        young, poisson : float
            Young's modulus Y in Pa, and Poisson's ratio ν in [0, 0.5].
        yield_pressure : float
            Limiting contact pressure p_y in Pa. Ductile metals first yield at 1.6 times their yield stress.
        pair : Pair
            Pair with m_eff and r_eff.

        Returns
        -------
        ThorntonRestitution
        """
        nu = check.number("poisson", poisson, at_least=0.0, at_most=0.5)
        modulus = check.number("young", young, above=0.0) / (2.0 * (1.0 - nu * nu))
        pressure = check.number("yield_pressure", yield_pressure, above=0.0)
        at = f"`r_eff` of pair {checked_pair(pair).name}"
        r_eff = check.number(at, pair.r_eff, above=0.0, fix="Point particles cannot yield.")
        shape = math.sqrt(8.0 * math.pi / 15.0 * r_eff**3 * pressure / pair.m_eff)
        return cls((0.5 * math.pi * pressure / modulus) ** 2 * shape)

    def __call__(self, speed: float, pair: Pair) -> float:
        """Return ε at impact `speed` (m/s), the same for every pair."""
        if speed <= self.yield_speed:
            return 1.0
        r = self.yield_speed / speed
        # r can underflow to 0 for very fast impacts
        depth = (r + 2.0 * math.sqrt(1.2 - 0.2 * r * r)) / (3.0 * r) if r > 0.0 else math.inf
        return math.sqrt(1.2 * (1.0 - r * r / 6.0) / math.sqrt(depth))


def _unit_interval(values: check.Array, fix: str = "") -> check.Array:
    """Return an array of coefficients of restitution, checked to be in [0, 1].

    Raises `ValueError` with the sentence `fix` otherwise.
    """
    check.every("restitution", values, (values >= 0.0) & (values <= 1.0), "a number in [0, 1]", fix)
    return values


def restitution_at(rule: Rule, speed: float, pair: Pair) -> float:
    """Return ε of a rule for an impact of `pair` at `speed` in m/s, as a float.

    Raises `ValueError` with a sentence if ``rule(speed, pair)`` is not a number in [0, 1].
    """
    value, restitution = rule(speed, pair), math.nan
    with suppress(TypeError, ValueError):
        restitution = math.nan if isinstance(value, (str, bytes)) else float(value)
    if not 0.0 <= restitution <= 1.0:
        raise ValueError(
            f"The restitution rule of pair {pair.name} must return a number in [0, 1], got {value!r} at an approach "
            f"speed of {speed:g} m/s."
        )
    return restitution


def checked(rule: Any, pairs: Sized) -> tuple[Rule, ...]:
    """Return a tuple with one restitution rule per pair.

    `rule` is one rule for all pairs, or a sequence with one per pair. Raises `TypeError` or `ValueError` if a rule is
    not callable or does not fit the number of pairs.
    """
    rules = check.per_pair("rule", rule, len(pairs))
    for each_rule in different(rules):
        if not callable(each_rule):
            e = each_rule if isinstance(each_rule, (int, float)) else 0.7
            fix = f"Use granular.ConstantRestitution({e})."
            raise TypeError(check.misuse("rule", each_rule, "a function of (speed, pair)", fix))
        if is_user_defined(each_rule):
            function_of("rule", each_rule, "speed", "pair")
            continue
        for name, least in (("restitution", 1), ("laws", 2)):  # one law stands for all pairs
            if isinstance(per_pair_values := getattr(each_rule, name, None), tuple) and len(per_pair_values) >= least:
                check.per_pair(name, per_pair_values, len(pairs))
    return rules


def elastic(rules: Sequence[Rule]) -> bool:
    """Return whether all rules are known to give ε = 1 at every speed.

    It is False for a user-defined callable, because its values are not known.
    """
    for rule in different(rules):
        if is_user_defined(rule):
            return False
        if hasattr(rule, "laws"):  # a `granular.binary.LawRestitution`, whose module is expensive to import
            from granular.laws.contact_law import dissipative_traits

            if any(any(dissipative_traits(law)) for law in rule.laws):
                return False
        elif np.min(getattr(rule, "restitution", 0.0)) < 1.0:
            return False
    return True


def different(rules: Sequence[Rule]) -> list[Rule]:
    """Return the distinct objects of a sequence of rules, in order of occurrence."""
    if all(map(is_, rules, repeat(rules[0]))):
        return [rules[0]]
    return list(dict(zip(map(id, rules), rules, strict=True)).values())


def constants(rules: Sequence[Rule], pairs: Sized) -> list[float] | None:
    """Return a list of ε per pair if every rule is a `ConstantRestitution`.

    Otherwise None is returned.
    """
    first, *others = different(rules)
    if not isinstance(first, ConstantRestitution):
        return None
    if not others:
        e = first.restitution
        return [e] * len(pairs) if isinstance(e, float) else list(e)
    if not all(isinstance(rule, ConstantRestitution) for rule in others):
        return None
    return [e if isinstance(e, float) else e[c]
            for c, e in enumerate(rule.restitution for rule in rules)]  # type: ignore[attr-defined]
