"""What does not change during a run: the scene, its rules, and how ties, collapse and weak impacts are treated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from granular._kernels import kernel
from granular.edmd.groups import RULES, Solver
from granular.edmd.motion import Floats, Physics
from granular.edmd.state import felt_gravity
from granular.edmd.ties import ORDER
from granular.rules import Rule, constants, restitution_at
from granular.scene import Scene

Restitution = Callable[[int, float], float]


@dataclass(frozen=True, eq=False)
class Model:
    """The physics of a run.

    `eps` holds ε per pair if all rules are constant; else `rule` is called as ``rule(c, speed)``.
    """

    scene: Scene
    rules: tuple[Rule, ...]
    ties: str = "left"
    seed: int = 0
    merge_below: float = 0.0
    tc: float = 0.0
    elastic_below: float = 0.0
    eps: list[float] = field(init=False)
    rule: Restitution | None = field(init=False)
    low: list[float] = field(init=False)
    high: list[float] = field(init=False)
    mass: list[float] = field(init=False)
    m_eff: list[float] = field(init=False)

    def __post_init__(self) -> None:
        rules = self.rules
        eps = constants(rules, self.scene.pairs)
        pairs = () if eps else tuple(self.scene.pairs)
        low, high = shares(self.scene)
        object.__setattr__(self, "eps", eps or [1.0] * len(rules))
        object.__setattr__(
            self, "rule", None if eps else lambda c, speed: restitution_at(rules[c], speed, pairs[c])
        )
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        object.__setattr__(self, "mass", self.scene.mass.tolist())
        object.__setattr__(self, "m_eff", self.scene.pairs.m_eff.tolist())

    def physics(self) -> Physics:
        """Return what a collision needs to know."""
        lists = (self.low, self.high, self.m_eff, self.mass, self.eps)
        return (*lists, self.tc, self.elastic_below, self.merge_below, self.gravity)

    @cached_property
    def gravity(self) -> float:
        """Gravity that the run feels in m/s²."""
        return felt_gravity(self.scene)

    @property
    def tie(self) -> tuple[int, int]:
        """Number of the sequential tie rule and its seed."""
        return self.order, self.seed & 0x7FFFFFFF

    @property
    def order(self) -> int:
        """Number of the sequential tie rule."""
        return ORDER[self.ties]

    @property
    def solver(self) -> Solver | None:
        """The rule that solves touching groups as a whole, if that is how ties are treated."""
        return RULES.get(self.ties)

    @property
    def sticks(self) -> bool:
        """Whether all restitutions are 0."""
        return self.rule is None and max(self.eps) == 0.0

    @cached_property
    def may_collapse(self) -> bool:
        """Whether infinitely many collisions in finite time are possible at all."""
        remedy = self.tc > 0.0 or self.elastic_below > 0.0 or self.merge_below > 0.0
        return not remedy and (self.rule is not None or min(self.eps) < 1.0)


def shares(scene: Scene) -> tuple[list[float], list[float]]:
    """Return the shares of the lower and the upper body of each pair in a change of its relative velocity.

    They are m_eff/m_lower and m_eff/m_upper; the smaller is computed, the other is 1 minus it.
    """
    a, b = scene.sides(scene.mass)
    ratio = np.minimum(a, b) / np.maximum(a, b)
    small = ratio / (1.0 + ratio)
    low, high = np.where(a >= b, small, 1.0 - small), np.where(a >= b, 1.0 - small, small)
    return low.tolist(), high.tolist()


@kernel
def remedied(c: int, speed: float, e: float, now: float, last: Floats, tc: float, elastic_below: float) -> float:
    """Return ε of an impact of pair `c` with `speed` at time `now` where its rule says `e`.

    Elastic below a speed of `elastic_below`, and if one of its two bodies has collided less than `tc` ago (the TC
    model of Luding & McNamara, Granular Matter 1, 113 (1998)).
    """
    if speed < elastic_below:
        return 1.0
    recent = last[c]
    if c > 0 and last[c - 1] > recent:
        recent = last[c - 1]
    if c + 1 < len(last) and last[c + 1] > recent:
        recent = last[c + 1]
    return 1.0 if now - recent < tc else e
