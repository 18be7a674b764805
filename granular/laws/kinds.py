"""The laws of a scene, asked once for every kind of pair: a gas of a million equal balls has one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
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
        The laws that say different things of themselves, each in the first pair of its kind: a form, memory, traits.
        What follows from them may differ with the sizes of a pair, see `in_pairs`.
    """

    def __init__(self, given: tuple[Any, ...], pairs: Pairs, kind: Kinds, each: list[PairLaw]) -> None:
        self.given, self.kind, self.each, self._pairs = given, kind, each, pairs

    def __len__(self) -> int:
        return len(self.given)

    def __getitem__(self, c: int) -> PairLaw:
        return _in_pair(self.each[self.kind[c]], self._pairs[c])

    def __iter__(self) -> Iterator[PairLaw]:
        return map(_in_pair, map(self.each.__getitem__, self.kind.tolist()), self._pairs)

    @cached_property
    def in_pairs(self) -> tuple[Kinds, list[PairLaw]]:
        """Which of some laws a pair has, and these laws: one for every law in pairs of equal sizes."""
        kind, first = alike(self.kind, self._pairs.m_eff, self._pairs.r_eff)
        return kind, [self[c] for c in first.tolist()]

    def column(self, value: Callable[[PairLaw], Any]) -> Any:
        """An array with the value of its law for every pair."""
        kind, each = self.in_pairs
        return np.array([value(law) for law in each])[kind]


def resolved(laws: Sequence[Any] | SceneLaws, scene: Scene) -> SceneLaws:
    """Ask the laws of a scene, one per pair, what they are; once where they do not ask for their pair."""
    if isinstance(laws, SceneLaws):
        return laws
    given, pairs = tuple(laws), scene.pairs
    number, probed = _numbers(given), set[int]()
    asks: dict[int, set[str]] = {}
    kind, first = alike(number)
    while new := [c for c in first.tolist() if c not in probed]:
        for c in new:
            asks.setdefault(int(number[c]), set()).update(_asks(given[c], pairs[c]))
        probed.update(new)
        if any(asks.values()):  # what they are may hang on it, and so may what they ask for
            size, index = (np.array([what in asks[i] for i in range(len(asks))])[number] for what in ("size", "index"))
            m_eff, r_eff = (np.where(size, column, 0.0) for column in (pairs.m_eff, pairs.r_eff))
            kind, first = alike(number, m_eff, r_eff, np.where(index, np.arange(len(given)), 0))
    return SceneLaws(given, pairs, kind, [resolve(given[c], pairs[c]) for c in first.tolist()])


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
    if any("__slots__" in vars(one) for one in type(law).__mro__):  # not all that it holds is in its dict
        return id(law)
    try:
        key = (type(law), *vars(law).items())
        hash(key)
    except TypeError:
        return id(law)
    return key if made is not None and made.frozen else id(law)


class _Noting(Pair):
    """A pair that notes what of it is asked for: its "size" or its "index"."""

    __slots__ = ("asked",)
    asked: set[str]

    @classmethod
    def like(cls, pair: Pair) -> _Noting:
        """Return a copy of `pair`."""
        copy = cls.__new__(cls)
        for name in ("m_eff", "r_eff", "index"):
            vars(Pair)[name].__set__(copy, getattr(pair, name))
        object.__setattr__(copy, "asked", set())
        return copy

    @property
    def m_eff(self) -> float:
        return float(self._noted("m_eff", "size"))

    @property
    def r_eff(self) -> float:
        return float(self._noted("r_eff", "size"))

    @property
    def index(self) -> int:
        return int(self._noted("index", "index"))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pair) and (self.m_eff, self.r_eff, self.index) == (
            other.m_eff, other.r_eff, other.index
        )  # fmt: skip

    def __hash__(self) -> int:
        return hash((self.m_eff, self.r_eff, self.index))

    def _noted(self, name: str, what: str) -> Any:
        self.asked.add(what)
        return vars(Pair)[name].__get__(self)


def _asks(law: Any, pair: Pair) -> set[str]:
    """What a law asks of its pair to say what it is; one without a form is another one in pairs of other sizes."""
    probe = _Noting.like(pair)
    xi = 1e-3 * pair.r_eff if 0.0 < pair.r_eff < math.inf else 1e-3
    try:
        found = resolve(law, probe)
        found.force(xi, 0.0, xi)
    except Exception:  # what is wrong with it is said where it is asked in earnest
        return {"size", "index"}
    return probe.asked if found.form is not None else probe.asked | {"size"}


def _in_pair(law: PairLaw, pair: Pair) -> PairLaw:
    return PairLaw(law.law, pair, law.form, law.memory, law.rate_dependent, law.exponent, law.potential)
