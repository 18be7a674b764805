"""Properties of two neighbours that force laws and rules of restitution depend on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from granular._engine.check import Array, face, misuse, number


@face
@dataclass(frozen=True, slots=True)
class Pair:
    """Two neighbouring bodies, which a force law acts on.

    Pair ``index`` joins bodies ``index`` and ``index + 1``. The two bodies remain neighbours during the whole run.

    Attributes
    ----------
    m_eff : float
        Effective mass m_a m_b / (m_a + m_b) in kg. Against a wall it is the mass of the ball.
    r_eff : float
        Effective radius 1 / (κ_a + κ_b) in m. The curvature κ is 1/R for a ball and 0 for a flat wall.
        A ball of radius R against a wall therefore has r_eff = R.
    index : int
        Number of the pair, counted from the bottom (left).
    """

    m_eff: float
    r_eff: float
    index: int

    def __post_init__(self) -> None:
        if not (type(self.m_eff) is type(self.r_eff) is float and 0.0 < self.m_eff < math.inf and self.r_eff >= 0.0):
            number("m_eff", self.m_eff, above=0.0)
            number("r_eff", self.r_eff, at_least=0.0, finite=False)


class Pairs(Sequence[Pair]):
    """Pairs of a scene as two columns.

    A `Pair` is created on access.

    Parameters
    ----------
    m_eff, r_eff : (p,) arrays
        Effective masses in kg and effective radii in m.
    start : int
        Number of the first pair.
    """

    __slots__ = ("m_eff", "r_eff", "start")

    def __init__(self, m_eff: Array, r_eff: Array, start: int = 0) -> None:
        self.m_eff, self.r_eff, self.start = m_eff, r_eff, start
        wrong = np.flatnonzero(~((m_eff > 0.0) & np.isfinite(m_eff) & (r_eff >= 0.0)))
        if len(wrong):
            self[int(wrong[0])]  # raises

    @classmethod
    def between(cls, mass: tuple[Array, Array], radius: tuple[Array, Array]) -> Pairs:
        """Return the pairs of bodies with given masses and radii.

        Parameters
        ----------
        mass, radius : (array, array)
            Values of the lower and of the upper body of each pair, in kg and in m. Both are inf for a wall.
        """
        light, heavy = np.minimum(*mass), np.maximum(*mass)
        with np.errstate(divide="ignore"):
            return cls(light / (1.0 + light / heavy), 1.0 / (1.0 / radius[0] + 1.0 / radius[1]))

    def __len__(self) -> int:
        return len(self.m_eff)

    @overload
    def __getitem__(self, c: int) -> Pair: ...

    @overload
    def __getitem__(self, c: slice) -> tuple[Pair, ...]: ...

    def __getitem__(self, c: int | slice) -> Pair | tuple[Pair, ...]:
        if isinstance(c, slice):
            return tuple(self[i] for i in range(*c.indices(len(self))))
        i = range(len(self))[c]
        return Pair(self.m_eff.item(i), self.r_eff.item(i), self.start + i)

    def __iter__(self) -> Iterator[Pair]:
        return map(Pair, self.m_eff.tolist(), self.r_eff.tolist(), range(self.start, self.start + len(self)))

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
