"""Force laws of a scene: grouped into kinds of pairs, and tested before a run.

Each law is resolved once per kind of pair. A gas of a million equal balls has one kind. A mistake in a law raises an
error with one sentence instead of giving a wrong answer.

The following laws are rejected:

* the force is not a number, changes from call to call, or depends on the rate alone
* a trait contradicts the force
* the damping is negative: at the same overlap, the force is larger while bodies separate than while they approach

An attractive force is allowed, and so is a force that begins late (F = k (ξ - ξ₀)). The engine replaces both by zero.
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

from granular._engine.check import Array, is_own, per_pair
from granular.laws.contact_law import PairLaw, finite, instance, no_number, refused, resolve
from granular.scene.pair import Pairs
from granular.scene.places import speed_scale
from granular.scene.state import Scene

__all__ = ["check_deepest", "checked", "finite", "no_number"]

Ints = np.ndarray[tuple[int], np.dtype[np.int64]]
Kinds = np.ndarray[tuple[int], np.dtype[np.int32]]


class SceneLaws:
    """Sequence of one `PairLaw` per pair, created on access.

    Attributes
    ----------
    given : tuple
        Laws as given, one per pair.
    kind : (n-1,) array of int
        Index in `each` for every pair.
    each : list of PairLaw
        Laws with different traits, each in the first pair of its kind: form, memory and other traits. Quantities
        computed from them can depend on the sizes of a pair, see `in_pairs`.
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
        """Index for every pair, and the laws: one for every law in pairs of equal sizes."""
        if "in_pairs" not in self.notes:
            kind, first = number_distinct_rows(self.kind, self._pairs.m_eff, self._pairs.r_eff)
            self.notes["in_pairs"] = kind, [self[c] for c in first.tolist()]
        found: tuple[Kinds, list[PairLaw]] = self.notes["in_pairs"]
        return found

    @property
    def elastic(self) -> bool:
        """Whether every law is elastic according to its traits."""
        return all(law.is_elastic for law in self.each)

    def column(self, value: Callable[[PairLaw], Any]) -> Any:
        """Return an array with a value computed from the law of every pair."""
        kind, each = self.in_pairs
        return np.array([value(law) for law in each])[kind]


CACHED_PAIRS, CACHED_SCENES = 64, 64
"""Largest number of pairs of a cached scene, and number of cached scenes."""


def resolved(laws: Sequence[Any] | SceneLaws, scene: Scene) -> SceneLaws:
    """Resolve the laws of a scene, given as one law per pair.

    Each law is resolved once if its traits do not depend on the pair. For laws of this package in small scenes the
    result is cached. A later scene with the same laws and sizes, bit by bit, reuses it.
    """
    if isinstance(laws, SceneLaws):
        return laws
    fits = isinstance(laws, tuple) and len(laws) == len(scene.gap)
    given, pairs = tuple(laws) if fits else per_pair("laws", laws, scene.n_pairs), scene.pairs
    each = {id(law): law for law in given} if len(given) <= CACHED_PAIRS else {0: None}
    floats = {number: _floats_of(law) for number, law in each.items()}
    if None in floats.values():
        return _requested(given, pairs)
    known = _remembered(tuple(map(floats.__getitem__, map(id, given))), pairs.m_eff.tobytes(), pairs.r_eff.tobytes(),
                        pairs.ends)
    found = SceneLaws(given, pairs, known.kind, known.each)
    found.sound, found.notes = known.sound, known.notes
    return found


def _floats_of(law: Any) -> tuple[type, tuple[str, ...], bytes] | None:
    """Return the class of a law, its field names and its values as bytes, or None.

    None is returned unless the law belongs to this package and all its values are floats.
    """
    holds = getattr(law, "__dict__", {"": None})
    if is_own(law) or not {float}.issuperset(map(type, holds.values())):
        return None
    return type(law), tuple(holds), pack(f"{len(holds)}d", *holds.values())


@lru_cache(maxsize=CACHED_SCENES)
def _remembered(
    floats: tuple[tuple[type, tuple[str, ...], bytes], ...], m_eff: bytes, r_eff: bytes, ends: tuple[str, str]
) -> SceneLaws:
    given = {one: one[0](**dict(zip(one[1], unpack(f"{len(one[1])}d", one[2]), strict=True))) for one in set(floats)}
    laws = _requested(tuple(given[one] for one in floats), Pairs(np.frombuffer(m_eff), np.frombuffer(r_eff), 0, ends))
    laws.sound = all(one.form is not None for one in laws.each)
    if laws.sound:
        _check_said(laws)
        laws.notes["records"] = None  # key of the engine that solves a scene of these laws
    return laws


def _requested(given: tuple[Any, ...], pairs: Pairs) -> SceneLaws:
    kind, first = number_distinct_rows(_kinds_of(given, pairs))
    # refine the kinds in two stages: laws that need the sizes, then laws that need the number of the pair
    sized = np.array([not _is_independent(given[c], UNKNOWN_VALUE, formless=False) for c in first.tolist()])[kind]
    kind, first = number_distinct_rows(kind, np.where(sized, pairs.m_eff, 0.0), np.where(sized, pairs.r_eff, 0.0))
    numbered = np.array([
        sized[c] and not _is_independent(given[c], replace(pairs[c], index=UNKNOWN_VALUE)) for c in first.tolist()
    ])[kind]
    kind, first = number_distinct_rows(kind, np.where(numbered, np.arange(len(given)), 0))
    return SceneLaws(given, pairs, kind, [resolve(given[c], pairs[c]) for c in first.tolist()])


def number_distinct_rows(*columns: Array | Ints | Kinds) -> tuple[Kinds, Ints]:
    """Number the different rows of some columns, in order of occurrence.

    Returns
    -------
    kind, first : arrays
        Number of every row, and index of the first row with each number.
    """
    varying = [column.tolist() for column in columns if (column != column[0]).any()]
    if not varying:
        return np.zeros(len(columns[0]), np.int32), np.zeros(1, np.int64)
    return _numbered(zip(*varying, strict=True))


def _numbered(keys: Iterable[Any]) -> tuple[Kinds, Ints]:
    number = defaultdict[Any, int](count().__next__)
    kind = np.fromiter(map(number.__getitem__, keys), np.int32)
    return kind, np.unique(kind, return_index=True)[1]


def _kinds_of(laws: tuple[Any, ...], pairs: Pairs) -> Kinds:
    """Number the different laws.

    Frozen laws with equal contents have the same number.
    """
    kind, first = number_distinct_rows(np.fromiter(map(id, laws), np.int64, len(laws)))
    each = [instance(f"the law of pair {pairs.name(c)}", laws[c]) for c in first.tolist()]
    return _numbered(hashable_contents(law) or id(law) for law in each)[0][kind]


CONSTANT_TYPES = (type(None), bool, int, float, str, bytes, np.generic, Enum, type, types.BuiltinFunctionType, np.ufunc)
"""Types whose objects cannot change."""


def hashable_contents(law: Any) -> tuple[Any, ...] | None:
    """Return the contents of a frozen law as one hashable value, or None.

    Laws with equal contents compute the same force. None is returned for a law that can change.
    """
    cls = type(law)
    frozen = getattr(getattr(cls, "__dataclass_params__", None), "frozen", False)
    if not frozen or any("__slots__" in vars(one) for one in cls.__mro__):  # vars() would not contain all fields
        return None
    key = (cls, *vars(law).items())
    try:
        hash((law, key))
    except TypeError:
        return None
    return key if all(map(_is_value, vars(law).values())) else None


def _is_value(held_by: Any) -> bool:
    """Return whether an object cannot change.

    An object that is hashed by its identity can change.
    """
    if isinstance(held_by, (tuple, frozenset)):
        return all(map(_is_value, held_by))
    if isinstance(held_by, types.FunctionType):
        return held_by.__closure__ is None
    return isinstance(held_by, CONSTANT_TYPES) or hashable_contents(held_by) is not None


class _Unknown:
    """Placeholder without any attribute, which cannot be compared."""

    __eq__ = __hash__ = __bool__ = None  # type: ignore[assignment]


UNKNOWN_VALUE: Any = _Unknown()


def _is_independent(law: Any, pair: Any, formless: bool = True) -> bool:
    """Return whether the traits of a law do not need the unknown properties of a pair.

    If `formless` is false, the law must also have a form, because a law without a form depends on the sizes.
    """
    try:
        found = resolve(law, pair)
        found.force(1e-9, 0.0, 1e-9)
    except Exception:  # any error is raised again when the law is resolved in a real pair
        return False
    return formless or found.form is not None


OVERLAP_RATIO = 4.0
"""Ratio of successive overlaps at which a law is tested before a run."""
MAX_TESTED_PAIRS = 256
"""Maximum number of different pairs that are tested."""
TEST_RATE = 1e-6
"""Rate in m/s at which a law is tested in a scene at rest."""


def checked(law: Any, scene: Scene) -> SceneLaws:
    """Return the laws of all pairs after a test of each law.

    Raises `ValueError` if a force is not a finite number, or if a trait does not agree with the force.
    """
    laws = resolved(per_pair("law", law, scene.n_pairs), scene)
    if laws.sound:
        return laws
    speed = speed_scale(scene)
    for one in laws.each[:MAX_TESTED_PAIRS]:
        if is_own(one.law):
            _check_pure(one, speed)
    _check_said(laws)
    for one in laws.each[:MAX_TESTED_PAIRS]:
        if one.form is None:
            xi = _probed(one, speed)
            if one.potential is not None and not one.memory:
                _check_potential(one, float(one.potential(xi, one.pair)), xi)
    return laws


def _check_said(laws: SceneLaws) -> None:
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


def _probed(law: PairLaw, speed: float) -> float:
    """Test the force up to the overlap of an impact at `speed`.

    Returns the largest overlap (m) of the test.
    """
    deepest = _size(law)
    # from far below typical overlaps up to the radius
    xi, energy, dampings = 1e-10 * deepest, 0.5 * law.pair.m_eff * speed * speed, set()
    speed = speed or TEST_RATE
    while True:
        force, closing, parting = (finite(law, xi, rate) for rate in (0.0, speed, -speed))
        dampings.add(math.nan if force > 0.0 else closing)
        for rate, moving in ((speed, closing), (-speed, parting)):
            if not law.rate_dependent and abs(moving - force) > 1e-9 * abs(force):
                raise _denied(law, xi, rate)
        # 1e-9 allows for rounding in the expression of the law
        if parting > max(0.0, closing) + 1e-9 * abs(closing):
            raise _gains(law, xi, speed)
        # the impact certainly stops before the next overlap
        if 0.5 * OVERLAP_RATIO * OVERLAP_RATIO * xi * force > energy or OVERLAP_RATIO * xi > deepest:
            break
        xi *= OVERLAP_RATIO
    # the same push at every overlap, and no push at rest
    if len(dampings) == 1 and (damping := dampings.pop()) > 0.0:
        raise _without_spring(law, damping, speed)
    return xi


def _size(law: PairLaw) -> float:
    """Return r_eff of a pair in m, or 1 m for point particles."""
    return law.pair.r_eff if 0.0 < law.pair.r_eff < math.inf else 1.0


def _check_pure(law: PairLaw, speed: float) -> None:
    """Raise `ValueError` if a law returns different forces for the same arguments."""
    asked = [(share * _size(law), rate) for share in (1e-8, 1e-4) for rate in (speed, 0.0, -speed)]
    before: dict[tuple[float, float], float] = {}
    for at in asked:
        with suppress(ArithmeticError):  # outside the range of the law, such as an overflow of its exponentials
            before[at] = finite(law, *at)
    for at, first in before.items():
        if (again := finite(law, *at)) != first:
            raise refused(law, "must be a pure function, without state or randomness",
                          f"got {first!r} and {again!r} N from two calls with ξ = {at[0]:.6g} m and ξ̇ = "
                          f"{at[1]:.6g} m/s")


def _check_potential(law: PairLaw, said: float, xi: float) -> None:
    """Raise `ValueError` if the potential is not the integral of the force.

    The integral is taken from 0 to `xi`.
    """
    if law.form is not None:
        k, p = law.form[:2]
        got, doubt = k * math.pow(xi, p + 1.0) / (p + 1.0), 0.0
    else:
        from scipy.integrate import quad

        got, doubt = quad(lambda x: law.force(x, 0.0, x), 0.0, xi, limit=200)
    if not abs(got - said) <= 1e-6 * abs(got) + 10.0 * doubt:
        raise refused(law, "must have a potential that is the integral of its force",
                      f"got {said!r} J for the potential and {got!r} J for the integral at overlap {xi:.6g} m",
                      "Fix the trait or leave it out.")


def _check_form(law: PairLaw, k: float, p: float, gamma: float, d: float) -> None:
    """Raise `ValueError` if the form of a law contradicts its force or its traits.

    The form must also not gain energy.
    """
    # dyadic arguments, so that products with them are exact
    for xi, rate in ((0.25, 0.5), (0.5, -0.25)):
        said, got = k * math.pow(xi, p) + gamma * math.pow(xi, d) * rate, law.force(xi, rate, xi)
        if not abs(got - said) <= 1e-9 * (abs(k) + abs(gamma)):
            raise refused(law, "must have a force that agrees with its linear or power trait",
                          f"got force({xi}, {rate}) = {got!r} and {said!r} by the trait",
                          "Fix the trait or leave it out.")
    if k == 0.0 < gamma and d == 0.0:
        raise _without_spring(law, gamma, 1.0)
    if gamma < 0.0:
        raise _gains(law, 0.5, 1.0)
    if gamma != 0.0 and not law.rate_dependent:
        raise _denied(law, 0.5, 1.0)


def _without_spring(law: PairLaw, damping: float, speed: float) -> ValueError:
    """Return the error for a law whose force depends on the rate alone.

    Under such a law bodies would overlap more and more.
    """
    return refused(law, "must repel bodies at rest at some overlap",
                   f"got a force of {damping!r} N at rate {speed:.6g} m/s at every overlap, and none at rest",
                   "Are the arguments (xi, xi_dot, pair)?")


def _denied(law: PairLaw, xi: float, rate: float) -> ValueError:
    """Return the error for a force that depends on the rate against its declaration."""
    still, moving = law.force(xi, 0.0, xi), law.force(xi, rate, xi)
    return refused(law, "must not depend on the rate if rate_dependent is False",
                   f"got force({xi:.6g}, 0) = {still!r} and force({xi:.6g}, {rate:.6g}) = {moving!r}",
                   "Fix the trait or leave it out.")


def _gains(law: PairLaw, xi: float, speed: float) -> ValueError:
    """Return the error for a law whose force is larger in separation than in approach."""
    closing, parting = (max(0.0, law.force(xi, rate, xi)) for rate in (speed, -speed))
    return refused(law, "must not gain energy",
                   f"got {parting:.6g} N while the bodies separate and {closing:.6g} N while they approach, at "
                   f"overlap ξ = {xi:.6g} m and {speed:.6g} m/s", "Damping must not be negative.")
