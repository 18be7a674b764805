"""Properties of two neighbours that force laws and rules of restitution depend on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, overload

import numpy as np

from granular._engine.check import Array, misuse, number
from granular._engine.signature import face


@face
@dataclass(frozen=True, slots=True)
class Pair:
    """Two neighbouring bodies between which a force law or collision rule acts.

    Pair ``index`` joins bodies ``index`` and ``index + 1``. On a ring the last pair joins the last ball and ball 0.
    The two bodies remain neighbours during the whole run.

    Attributes
    ----------
    m_eff : float
        Effective mass m_a m_b / (m_a + m_b) in kg. Against a wall it is the mass of the ball.
    r_eff : float
        Effective radius 1 / (κ_a + κ_b) in m. The curvature κ is 1/R for a ball and 0 for a flat wall.
        A ball of radius R against a wall therefore has r_eff = R.
    index : int
        Number of the pair, counted from the bottom (left).
    label : str
        Name of the pair in messages, such as "floor–1". Empty by default: the pair is then named by
        the numbers of its bodies.
    """

    m_eff: float
    r_eff: float
    index: int
    label: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (type(self.m_eff) is type(self.r_eff) is float and 0.0 < self.m_eff < math.inf and self.r_eff >= 0.0):
            number("m_eff", self.m_eff, above=0.0)
            number("r_eff", self.r_eff, at_least=0.0, finite=False)

    @property
    def name(self) -> str:
        """Name of the pair in messages, such as "1–2" or "floor–1"."""
        return self.label or f"{self.index}–{self.index + 1}"


class Pairs(Sequence[Pair]):
    """Sequence of the pairs of a scene, stored as two arrays.

    Each `Pair` is created when it is read.

    Parameters
    ----------
    m_eff, r_eff : (p,) arrays
        Effective masses in kg and effective radii in m.
    start : int
        Number of the first pair.
    ends : (str, str)
        Names of the body below the first pair and of the body above the last pair. By default their numbers.
    """

    __slots__ = ("ends", "m_eff", "r_eff", "start")

    def __init__(self, m_eff: Array, r_eff: Array, start: int = 0, ends: tuple[str, str] = ("", "")) -> None:
        self.m_eff, self.r_eff, self.start, self.ends = m_eff, r_eff, start, ends
        wrong = np.flatnonzero(~((m_eff > 0.0) & np.isfinite(m_eff) & (r_eff >= 0.0)))
        if len(wrong):
            self[int(wrong[0])]  # raises

    @classmethod
    def between(
        cls, mass: tuple[Array, Array], radius: tuple[Array, Array], ends: tuple[str, str] = ("", "")
    ) -> Pairs:
        """Return the pairs of neighbouring bodies with these masses and radii.

        Parameters
        ----------
        mass, radius : (array, array)
            Values of the lower and of the upper body of each pair, in kg and in m. Both are inf for a wall.
        ends : (str, str)
            Names of the first body of the first pair and of the second body of the last pair, as in `Pairs`.
        """
        light, heavy = np.minimum(*mass), np.maximum(*mass)
        with np.errstate(divide="ignore"):
            return cls(light / (1.0 + light / heavy), 1.0 / (1.0 / radius[0] + 1.0 / radius[1]), 0, ends)

    def __len__(self) -> int:
        return len(self.m_eff)

    @overload
    def __getitem__(self, c: int) -> Pair: ...

    @overload
    def __getitem__(self, c: slice) -> tuple[Pair, ...]: ...

    def __getitem__(self, c: int | slice) -> Pair | tuple[Pair, ...]:
        if isinstance(c, slice):
            return tuple(self[i] for i in range(*c.indices(len(self))))
        n = len(self.m_eff)
        i = range(n)[c]
        label = "" if 0 < i < n - 1 else self._label(self.start + i)  # inner pairs are named by their numbers
        return Pair(self.m_eff.item(i), self.r_eff.item(i), self.start + i, label)

    def __iter__(self) -> Iterator[Pair]:
        numbers = range(self.start, self.start + len(self))
        labels = [self._label(numbers[0]), *[""] * (len(self) - 2), self._label(numbers[-1])]
        return map(Pair, self.m_eff.tolist(), self.r_eff.tolist(), numbers, labels)

    def name(self, index: int) -> str:
        """Return the name of a pair from its number, such as "1–2" or "floor–1"."""
        return self._label(index) or f"{index}–{index + 1}"

    def _label(self, index: int) -> str:
        """Return the name of a pair at a named end (see `ends`), else an empty string."""
        below = self.ends[0] if index == self.start else ""
        above = self.ends[1] if index == self.start + len(self.m_eff) - 1 else ""
        return f"{below or index}–{above or index + 1}" if below or above else ""

    def __eq__(self, other: object) -> bool:
        return tuple(self) == tuple(other) if isinstance(other, (Pairs, tuple)) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))


def checked_pair(pair: Any) -> Pair:
    """Return `pair` if it is a `Pair`, else raise `TypeError`."""
    if not isinstance(pair, Pair):
        raise TypeError(misuse("pair", pair, "a Pair, such as scene.pairs[0]"))
    return pair


def body_name(scene: Any, body: int) -> str:
    """Return the name of a body in messages: its number, or "floor" or "ceiling".

    Without gravity the name of a wall is "wall".
    """
    return str(body) if not scene.is_wall[body] else "wall" if not scene.gravity else "ceiling" if body else "floor"
