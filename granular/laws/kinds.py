"""Force laws of a scene: grouped into kinds of pairs, and tested before a run.

Each law is resolved once per kind of pair. A gas of a million equal balls has one kind. A mistake in a law raises an
error with one sentence instead of giving a wrong result.

The following laws are rejected:

* the force is not a number, changes from call to call, or depends on the rate alone
* a trait contradicts the force
* the damping is negative: at the same overlap, the force is larger while bodies separate than while they approach

An attractive force is allowed, and so is a force that begins late (F = k (ξ - ξ₀)). The engine replaces an attractive
force by zero.
"""

from __future__ import annotations

import math
import types
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from functools import lru_cache
from itertools import count
from struct import pack, unpack
from typing import Any

import numpy as np

from granular._engine.callables import is_user_defined
from granular._engine.check import Array, per_pair
from granular.laws.contact_law import PairLaw, finite, instance, no_number, refused, resolve
from granular.scene.pair import Pairs
from granular.scene.places import speed_scale
from granular.scene.state import Scene

__all__ = ["check_deepest", "checked", "finite", "no_number"]

Ints = np.ndarray[tuple[int], np.dtype[np.int64]]
"""Array of indices or numbers, one per element."""
Kinds = np.ndarray[tuple[int], np.dtype[np.int32]]
"""Array with the number of the kind of each pair."""


class SceneLaws:
    """Sequence of one `PairLaw` per pair of a scene, created on access.

    Attributes
    ----------
    given : tuple
        Laws as passed by the user, one per pair.
    kind : (n-1,) array of int
        Index in `each` for every pair.
    each : list of PairLaw
        Laws with different traits, each resolved in the first pair of its kind. Quantities computed from them can
        depend on the sizes of a pair, see `in_pairs`.
    sound : bool
        Whether the traits are known to be true at every speed, see `checked`.
    notes : dict
        Results cached by engines, which depend on laws and sizes alone. Each engine uses keys of its own.
    """

    def __init__(self, given: tuple[Any, ...], pairs: Pairs, kind: Kinds, each: list[PairLaw]) -> None:
        self.given, self.kind, self.each, self._pairs = given, kind, each, pairs
        self.sound, self.notes = False, dict[str, Any]()

    def __len__(self) -> int:
        return len(self.given)

    def __getitem__(self, c: int) -> PairLaw:
        return replace(self.each[self.kind.item(c)], pair=self._pairs[c])

    def __iter__(self) -> Iterator[PairLaw]:
        return (replace(self.each[k], pair=pair) for k, pair in zip(self.kind.tolist(), self._pairs, strict=True))

    @property
    def in_pairs(self) -> tuple[Kinds, list[PairLaw]]:
        """Index array and list of `PairLaw`, one for every combination of law and sizes.

        Entry c of the array is the index of the law of pair c in the list. Sizes are m_eff and r_eff.
        """
        if "in_pairs" not in self.notes:
            kind, first = number_distinct_rows(self.kind, self._pairs.m_eff, self._pairs.r_eff)
            self.notes["in_pairs"] = kind, [self[c] for c in first.tolist()]
        result: tuple[Kinds, list[PairLaw]] = self.notes["in_pairs"]
        return result

    @property
    def elastic(self) -> bool:
        """Whether every law is elastic according to its traits."""
        return all(law.is_elastic for law in self.each)

    def column(self, value: Callable[[PairLaw], Any]) -> Any:
        """Return the array of `value(law)` for the `PairLaw` of every pair.

        `value` is called once for all pairs with equal laws and sizes.
        """
        kind, each = self.in_pairs
        return np.array([value(law) for law in each])[kind]


CACHED_PAIRS, CACHED_SCENES = 64, 64
"""Largest number of pairs of a cached scene, and number of cached scenes."""


def resolved(laws: Sequence[Any] | SceneLaws, scene: Scene) -> SceneLaws:
    """Resolve the laws of a scene, given as one law per pair.

    Each law is resolved once if its traits do not depend on the pair. For laws of this package in small scenes the
    result is cached. It is used again for a later scene with bitwise identical laws and sizes.
    """
    if isinstance(laws, SceneLaws):
        return laws
    is_ready = isinstance(laws, tuple) and len(laws) == len(scene.gap)
    given, pairs = tuple(laws) if is_ready else per_pair("laws", laws, scene.n_pairs), scene.pairs
    # None without examining the laws: scenes with more pairs are not cached
    distinct_laws = {id(law): law for law in given} if len(given) <= CACHED_PAIRS else {0: None}
    floats = {number: _law_floats(law) for number, law in distinct_laws.items()}
    if None in floats.values():
        return _laws_by_kind(given, pairs)
    cached = _cached_laws(tuple(map(floats.__getitem__, map(id, given))), pairs.m_eff.tobytes(), pairs.r_eff.tobytes(),
                        pairs.ends)
    result = SceneLaws(given, pairs, cached.kind, cached.each)
    result.sound, result.notes = cached.sound, cached.notes
    return result


def _law_floats(law: Any) -> tuple[type, tuple[str, ...], bytes] | None:
    """Return the class of a law, its field names and its values as bytes, or None.

    It is None for a user-defined law, and for a law with a value that is not a float.
    """
    fields = getattr(law, "__dict__", {"": None})
    if is_user_defined(law) or not {float}.issuperset(map(type, fields.values())):
        return None
    return type(law), tuple(fields), pack(f"{len(fields)}d", *fields.values())


@lru_cache(maxsize=CACHED_SCENES)
def _cached_laws(
    floats: tuple[tuple[type, tuple[str, ...], bytes], ...], m_eff: bytes, r_eff: bytes, ends: tuple[str, str]
) -> SceneLaws:
    """Return the laws of a small scene, from a cache if possible.

    The key of the cache is the bytes of the values of the laws and of the sizes of the pairs. Each entry of `floats` is
    class, field names and values of the law of one pair. `ends` are the names of the outer bodies in the names of
    pairs.
    """
    given = {key: key[0](**dict(zip(key[1], unpack(f"{len(key[1])}d", key[2]), strict=True))) for key in set(floats)}
    laws = _laws_by_kind(
        tuple(given[key] for key in floats), Pairs(np.frombuffer(m_eff), np.frombuffer(r_eff), 0, ends))
    laws.sound = all(law.form is not None for law in laws.each)
    if laws.sound:
        _check_traits(laws)
        # placeholder: the presence of this key allows the soft-sphere engine to cache its records here
        # (`md.located.system`)
        laws.notes["records"] = None
    return laws


def _laws_by_kind(given: tuple[Any, ...], pairs: Pairs) -> SceneLaws:
    """Group the laws of all pairs into kinds, and resolve one law per kind."""
    kind, first = number_distinct_rows(_law_kinds(given, pairs))
    # refine the kinds in two stages: laws that need the sizes, then laws that need the number of the pair
    sized = np.array([not _is_independent(given[c], UNKNOWN_VALUE, allow_no_form=False) for c in first.tolist()])[kind]
    kind, first = number_distinct_rows(kind, np.where(sized, pairs.m_eff, 0.0), np.where(sized, pairs.r_eff, 0.0))
    numbered = np.array([
        sized[c] and not _is_independent(given[c], replace(pairs[c], index=UNKNOWN_VALUE)) for c in first.tolist()
    ])[kind]
    kind, first = number_distinct_rows(kind, np.where(numbered, np.arange(len(given)), 0))
    return SceneLaws(given, pairs, kind, [resolve(given[c], pairs[c]) for c in first.tolist()])


def number_distinct_rows(*columns: Array | Ints | Kinds) -> tuple[Kinds, Ints]:
    """Number the different rows of some columns, in order of their first occurrence.

    Returns
    -------
    kind, first : arrays
        Number of every row, and index of the first row with each number.
    """
    varying = [column.tolist() for column in columns if (column != column[0]).any()]
    if not varying:
        return np.zeros(len(columns[0]), np.int32), np.zeros(1, np.int64)
    return _key_numbers(zip(*varying, strict=True))


def _key_numbers(keys: Iterable[Any]) -> tuple[Kinds, Ints]:
    """Return the number of every key, and the index of the first key with each number."""
    number = defaultdict[Any, int](count().__next__)
    kind = np.fromiter(map(number.__getitem__, keys), np.int32)
    return kind, np.unique(kind, return_index=True)[1]


def _law_kinds(laws: tuple[Any, ...], pairs: Pairs) -> Kinds:
    """Return a number for the law of every pair, the same number for the same law.

    Frozen laws with equal contents are the same law.
    """
    kind, first = number_distinct_rows(np.fromiter(map(id, laws), np.int64, len(laws)))
    each = [instance(f"the law of pair {pairs.name(c)}", laws[c]) for c in first.tolist()]
    return _key_numbers(hashable_contents(law) or id(law) for law in each)[0][kind]


CONSTANT_TYPES = (type(None), bool, int, float, str, bytes, np.generic, Enum, type, types.BuiltinFunctionType, np.ufunc)
"""Types whose objects cannot change."""


def hashable_contents(law: Any) -> tuple[Any, ...] | None:
    """Return class and field values of a frozen law as one hashable value, or None.

    Laws with equal contents compute the same force. None is returned for a law that can change.
    """
    cls = type(law)
    frozen = getattr(getattr(cls, "__dataclass_params__", None), "frozen", False)
    if not frozen or any("__slots__" in vars(base) for base in cls.__mro__):  # vars() would not contain all fields
        return None
    key = (cls, *vars(law).items())
    try:
        hash((law, key))
    except TypeError:
        return None
    return key if all(map(_is_constant, vars(law).values())) else None


def _is_constant(value: Any) -> bool:
    """Return whether an object is constant.

    An object that is hashed by its identity counts as changeable.
    """
    if isinstance(value, (tuple, frozenset)):
        return all(map(_is_constant, value))
    if isinstance(value, types.FunctionType):
        return value.__closure__ is None
    return isinstance(value, CONSTANT_TYPES) or hashable_contents(value) is not None


class _Unknown:
    """Placeholder for an unknown property of a pair, whose use raises an exception."""

    __eq__ = __hash__ = __bool__ = None  # type: ignore[assignment]


UNKNOWN_VALUE: Any = _Unknown()
"""The only instance of `_Unknown`."""


def _is_independent(law: Any, pair: Any, allow_no_form: bool = True) -> bool:
    """Return whether the traits of a law need no unknown property of a pair.

    `pair` contains `UNKNOWN_VALUE` where a property is unknown, or is `UNKNOWN_VALUE` itself. If `allow_no_form` is
    false, the law must also have a form, because a law without a form depends on the sizes.
    """
    try:
        resolved_law = resolve(law, pair)
        resolved_law.force(1e-9, 0.0, 1e-9)
    except Exception:  # any error is raised again when the law is resolved in a real pair
        return False
    return allow_no_form or resolved_law.form is not None


OVERLAP_RATIO = 4.0
"""Ratio of successive overlaps at which the force of a law is tested before a run."""
MAX_TESTED_PAIRS = 256
"""Maximum number of different pairs that are tested."""
TEST_RATE = 1e-6
"""Rate in m/s at which a law is tested in a scene at rest."""


def checked(law: Any, scene: Scene) -> SceneLaws:
    """Return the laws of all pairs of a scene after a test of each law.

    `law` is one law for all pairs, or one per pair.

    Raises
    ------
    ValueError
        If a force is not a finite number, if a trait contradicts the force, or if the law is rejected for another
        reason in the module docstring.
    """
    laws = resolved(per_pair("law", law, scene.n_pairs), scene)
    if laws.sound:
        return laws
    speed = speed_scale(scene)
    for one in laws.each[:MAX_TESTED_PAIRS]:
        if is_user_defined(one.law):
            _check_pure(one, speed)
    _check_traits(laws)
    for one in laws.each[:MAX_TESTED_PAIRS]:
        if one.form is None:
            xi = _largest_tested_overlap(one, speed)
            if one.potential is not None and not one.memory:
                _check_potential(one, float(one.potential(xi, one.pair)), xi)
    return laws


def _check_traits(laws: SceneLaws) -> None:
    """Raise `ValueError` if the form or the potential of a law contradicts its force."""
    for number, one in enumerate(laws.each):
        if one.form is not None:
            _check_form(one, *one.form)
            if one.potential is not None and number < MAX_TESTED_PAIRS:
                _check_potential(one, float(one.potential(0.5, one.pair)), 0.5)


def check_deepest(laws: SceneLaws, contacts: Any) -> None:
    """Raise `ValueError` if a force is not finite at the largest overlap of a contact.

    Fixed-step integrators would otherwise treat that value as zero force.
    """
    deepest, (kind, each) = np.zeros(len(laws)), laws.in_pairs
    np.maximum.at(deepest, contacts["pair"], contacts["xi_max"])
    for c in np.flatnonzero(deepest > 0.0).tolist():
        try:
            finite(each[kind[c]], float(deepest[c]), 0.0)
        except ValueError:
            finite(laws[c], float(deepest[c]), 0.0)  # the same error with the number of this pair


def _largest_tested_overlap(law: PairLaw, speed: float) -> float:
    """Test the force of a law up to the overlap of an impact at `speed` in m/s.

    Returns the largest overlap of the test in m. Raises `ValueError` for a law that is rejected in the module
    docstring.
    """
    deepest = _length_scale(law)
    # from far below typical overlaps up to the radius
    xi, energy, dampings = 1e-10 * deepest, 0.5 * law.pair.m_eff * speed * speed, set()
    speed = speed or TEST_RATE
    while True:
        force, closing, parting = (finite(law, xi, rate) for rate in (0.0, speed, -speed))
        dampings.add(math.nan if force > 0.0 else closing)
        for rate, moving in ((speed, closing), (-speed, parting)):
            if not law.rate_dependent and abs(moving - force) > 1e-9 * abs(force):
                raise _rate_error(law, xi, rate)
        # 1e-9 allows for rounding in the expression of the law
        if parting > max(0.0, closing) + 1e-9 * abs(closing):
            raise _energy_gain_error(law, xi, speed)
        # the impact certainly stops before the next overlap
        if 0.5 * OVERLAP_RATIO * OVERLAP_RATIO * xi * force > energy or OVERLAP_RATIO * xi > deepest:
            break
        xi *= OVERLAP_RATIO
    # the same force at every overlap, and no force at rest
    if len(dampings) == 1 and (damping := dampings.pop()) > 0.0:
        raise _no_spring_error(law, damping, speed)
    return xi


def _length_scale(law: PairLaw) -> float:
    """Return the length scale of a contact in m: r_eff, or 1 m for point particles."""
    return law.pair.r_eff if 0.0 < law.pair.r_eff < math.inf else 1.0


def _check_pure(law: PairLaw, speed: float) -> None:
    """Raise `ValueError` if a law returns different forces for the same arguments.

    The rates of the test are ±`speed` in m/s and 0.
    """
    arguments = [(share * _length_scale(law), rate) for share in (1e-8, 1e-4) for rate in (speed, 0.0, -speed)]
    before: dict[tuple[float, float], float] = {}
    for argument in arguments:
        with suppress(ArithmeticError):  # outside the range of the law, such as an overflow of its exponentials
            before[argument] = finite(law, *argument)
    for argument, first in before.items():
        if (again := finite(law, *argument)) != first:
            raise refused(law, "must be a pure function, without state or randomness",
                          f"got {first!r} and {again!r} N from two calls with ξ = {argument[0]:.6g} m and ξ̇ = "
                          f"{argument[1]:.6g} m/s")


def _check_potential(law: PairLaw, potential: float, xi: float) -> None:
    """Raise `ValueError` if a potential is not the integral of its force.

    `potential` is its value in J at the overlap `xi` in m. The integral of the force at rest is from 0 to `xi`.
    """
    if law.form is not None:
        k, p = law.form[:2]
        integral, error = k * math.pow(xi, p + 1.0) / (p + 1.0), 0.0
    else:
        from scipy.integrate import quad

        integral, error = quad(lambda x: law.force(x, 0.0, x), 0.0, xi, limit=200)
    if not abs(integral - potential) <= 1e-6 * abs(integral) + 10.0 * error:
        raise refused(law, "must have a potential that is the integral of its force",
                      f"got {potential!r} J for the potential and {integral!r} J for the integral at overlap "
                      f"{xi:.6g} m",
                      "Fix the trait or leave it out.")


def _check_form(law: PairLaw, k: float, p: float, gamma: float, d: float) -> None:
    """Raise `ValueError` if (k, p, γ, d) contradict the force or the traits of a law.

    The form must also not gain energy, and must repel bodies at rest.
    """
    # dyadic arguments, so that products with them are exact
    for xi, rate in ((0.25, 0.5), (0.5, -0.25)):
        by_trait, by_force = k * math.pow(xi, p) + gamma * math.pow(xi, d) * rate, law.force(xi, rate, xi)
        if not abs(by_force - by_trait) <= 1e-9 * (abs(k) + abs(gamma)):
            raise refused(law, "must have a force that agrees with its linear or power trait",
                          f"got force({xi}, {rate}) = {by_force!r} and {by_trait!r} by the trait",
                          "Fix the trait or leave it out.")
    if k == 0.0 < gamma and d == 0.0:
        raise _no_spring_error(law, gamma, 1.0)
    if gamma < 0.0:
        raise _energy_gain_error(law, 0.5, 1.0)
    if gamma != 0.0 and not law.rate_dependent:
        raise _rate_error(law, 0.5, 1.0)


def _no_spring_error(law: PairLaw, damping: float, speed: float) -> ValueError:
    """Return the error for a law whose force depends on the rate alone.

    Under such a law the overlap of bodies would grow without limit. `damping` is the force in N at the rate `speed` in
    m/s.
    """
    return refused(law, "must repel bodies at rest at some overlap",
                   f"got a force of {damping!r} N at rate {speed:.6g} m/s at every overlap, and none at rest",
                   "Check that the arguments of `force` are (xi, xi_dot, pair).")


def _rate_error(law: PairLaw, xi: float, rate: float) -> ValueError:
    """Return the error for a force that depends on the rate despite its traits.

    `rate_dependent` of the law is False, but its force differs between the rates 0 and `rate` in m/s."""
    at_rest, in_motion = law.force(xi, 0.0, xi), law.force(xi, rate, xi)
    return refused(law, "must not depend on the rate if rate_dependent is False",
                   f"got force({xi:.6g}, 0) = {at_rest!r} and force({xi:.6g}, {rate:.6g}) = {in_motion!r}",
                   "Fix the trait or leave it out.")


def _energy_gain_error(law: PairLaw, xi: float, speed: float) -> ValueError:
    """Return the error for a force that is larger in separation than in approach.

    `speed` is the magnitude of the rate in m/s at the overlap `xi` in m.
    """
    closing, parting = (max(0.0, law.force(xi, rate, xi)) for rate in (speed, -speed))
    return refused(law, "must not gain energy",
                   f"got {parting:.6g} N while the bodies separate and {closing:.6g} N while they approach, at "
                   f"overlap ξ = {xi:.6g} m and {speed:.6g} m/s", "Damping must not be negative.")
