"""The laws of a scene, asked once for every kind of pair: a gas of a million equal balls has one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from granular._check import Array
from granular.laws.contact_law import PairLaw, instance, resolve
from granular.scene import Pair, Pairs, Scene

Ints = np.ndarray[tuple[int], np.dtype[np.int64]]
Kinds = np.ndarray[tuple[int], np.dtype[np.int32]]


class SceneLaws:
    """One `PairLaw` per pair, made when it is asked for.

    Attributes
    ----------
    given : tuple
        The laws as they were given, one per pair.
    kind : (n-1,) array of int
        Which of `each` a pair is of.
    each : list of PairLaw
        The different ones, each in the first pair of its kind.
    """

    def __init__(self, given: tuple[Any, ...], pairs: Pairs, kind: Kinds, each: list[PairLaw]) -> None:
        self.given, self.kind, self.each, self._pairs = given, kind, each, pairs

    def __len__(self) -> int:
        return len(self.given)

    def __getitem__(self, c: int) -> PairLaw:
        return _in_pair(self.each[self.kind[c]], self._pairs[c])

    def __iter__(self) -> Iterator[PairLaw]:
        return map(_in_pair, map(self.each.__getitem__, self.kind.tolist()), self._pairs)

    def column(self, value: Callable[[PairLaw], Any]) -> Any:
        """An array with the value of its law for every pair."""
        return np.array([value(law) for law in self.each])[self.kind]


def resolved(laws: Sequence[Any] | SceneLaws, scene: Scene) -> SceneLaws:
    """Ask the laws of a scene, one per pair, what they are."""
    if isinstance(laws, SceneLaws):
        return laws
    given, pairs = tuple(laws), scene.pairs
    kind, first = alike(_numbers(given), pairs.m_eff, pairs.r_eff)
    found = [_whatever_number(given[c], pairs[c]) for c in first.tolist()]
    each = [law for law in found if law is not None]
    if len(each) < len(found):
        asks = np.array([law is None for law in found])[kind]
        kind, first = alike(kind, np.where(asks, np.arange(len(given)), 0))
        each = [resolve(given[c], pairs[c]) for c in first.tolist()]
    return SceneLaws(given, pairs, kind, each)


def alike(*columns: Array | Ints | Kinds) -> tuple[Kinds, Ints]:
    """Number the different rows of some columns, in the order in which they come; return also where each is first."""
    if all((column == column[0]).all() for column in columns):
        return np.zeros(len(columns[0]), np.int32), np.zeros(1, np.int64)
    first: dict[Any, int] = {}
    rows = zip(*(column.tolist() for column in columns), strict=True)
    like = [first.setdefault(row, c) for c, row in enumerate(rows)]
    where = np.fromiter(first.values(), np.int64, len(first))
    return np.searchsorted(where, like).astype(np.int32), where


def _numbers(laws: tuple[Any, ...]) -> Kinds:
    """Number the different laws: those that are frozen are the same if all that they hold is."""
    kind, first = alike(np.fromiter(map(id, laws), np.int64, len(laws)))
    known: dict[Any, int] = {}
    number = [known.setdefault(_identity(instance(f"law of pair {c}", laws[c])), len(known)) for c in first.tolist()]
    return np.array(number, np.int32)[kind]


def _identity(law: Any) -> Any:
    made = getattr(type(law), "__dataclass_params__", None)
    try:
        key = (type(law), *vars(law).items())
        hash(key)
    except TypeError:
        return id(law)
    return key if made is not None and made.frozen else id(law)


class _Numbered(Pair):
    """A pair that notes whether its number is asked for."""

    __slots__ = ("asked",)
    asked: bool

    @classmethod
    def like(cls, pair: Pair) -> _Numbered:
        """Return a copy of `pair`."""
        copy = cls.__new__(cls)
        for name in ("m_eff", "r_eff", "index"):
            vars(Pair)[name].__set__(copy, getattr(pair, name))
        object.__setattr__(copy, "asked", False)
        return copy

    @property
    def index(self) -> int:
        object.__setattr__(self, "asked", True)
        number: int = vars(Pair)["index"].__get__(self)
        return number


def _whatever_number(law: Any, pair: Pair) -> PairLaw | None:
    """What a law is in all pairs that are alike except for their number; None if it asks for that number."""
    probe = _Numbered.like(pair)
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    try:
        found = resolve(law, probe)
        if found.form is None:
            found.force(xi, 0.0, xi)
    except Exception:  # what is wrong with it is said where it is asked in earnest
        return None
    return None if probe.asked else _in_pair(found, pair)


def _in_pair(law: PairLaw, pair: Pair) -> PairLaw:
    return PairLaw(law.law, pair, law.form, law.memory, law.rate_dependent, law.exponent, law.potential)
