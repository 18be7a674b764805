"""The laws of a scene, asked once for every kind of pair: a gas of a million equal balls has one.
May be skipped: faster, same results.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from granular._check import Array
from granular.laws.contact_law import PairLaw, instance, resolve
from granular.scene import Pairs, Scene

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
        return replace(self.each[self.kind.item(c)], pair=self._pairs[c])

    def __iter__(self) -> Iterator[PairLaw]:
        return (replace(self.each[k], pair=pair) for k, pair in zip(self.kind.tolist(), self._pairs, strict=True))

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
    kind, first = alike(_kinds_of(given))
    sized = np.array([not _says(given[c], UNKNOWN, formless=False) for c in first.tolist()])[kind]
    kind, first = alike(kind, np.where(sized, pairs.m_eff, 0.0), np.where(sized, pairs.r_eff, 0.0))
    numbered = np.array([
        sized[c] and not _says(given[c], replace(pairs[c], index=UNKNOWN)) for c in first.tolist()
    ])[kind]
    kind, first = alike(kind, np.where(numbered, np.arange(len(given)), 0))
    return SceneLaws(given, pairs, kind, [resolve(given[c], pairs[c]) for c in first.tolist()])


def alike(*columns: Array | Ints | Kinds) -> tuple[Kinds, Ints]:
    """Number the different rows of some columns, in the order in which they come; return also where each is first."""
    varying = [column.tolist() for column in columns if (column != column[0]).any()]
    if not varying:
        return np.zeros(len(columns[0]), np.int32), np.zeros(1, np.int64)
    return _numbered(zip(*varying, strict=True))


def _numbered(keys: Iterable[Any]) -> tuple[Kinds, Ints]:
    number = defaultdict[Any, int](count().__next__)
    kind = np.fromiter(map(number.__getitem__, keys), np.int32)
    return kind, np.unique(kind, return_index=True)[1]


def _kinds_of(laws: tuple[Any, ...]) -> Kinds:
    """Number the different laws: those that are frozen are the same if all that they hold is."""
    kind, first = alike(np.fromiter(map(id, laws), np.int64, len(laws)))
    each = [instance(f"law of pair {c}", laws[c]) for c in first.tolist()]
    return _numbered(held(law) or id(law) for law in each)[0][kind]


def held(law: Any) -> tuple[Any, ...] | None:
    """All that a frozen law holds, as one value: what is equal in it computes the same. None of a law that may change.
    """
    cls = type(law)
    frozen = getattr(getattr(cls, "__dataclass_params__", None), "frozen", False)
    if not frozen or any("__slots__" in vars(one) for one in cls.__mro__):  # not all that it holds is in its dict
        return None
    key = (cls, *vars(law).items())
    try:
        hash((law, key))
    except TypeError:
        return None
    return key


class _Unknown:
    """What nothing can be asked of, nor compared with."""

    __eq__ = __hash__ = __bool__ = None  # type: ignore[assignment]


UNKNOWN: Any = _Unknown()


def _says(law: Any, pair: Any, formless: bool = True) -> bool:
    """Whether a law says what it is in a pair of which not all is known; one without a form hangs on the sizes."""
    try:
        found = resolve(law, pair)
        found.force(1e-9, 0.0, 1e-9)
    except Exception:  # what is wrong with it is said where it is asked in earnest
        return False
    return formless or found.form is not None
