"""What does not change during a run: the scene, its rules, and how ties, collapse and weak impacts are treated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from granular._check import Array
from granular.edmd.groups import RULES, Solver
from granular.edmd.ties import ORDER
from granular.rules import Rule, constants, restitution_at
from granular.scene import Scene

Restitution = Callable[[int, float], float]


@dataclass(frozen=True, eq=False)
class Model:
    """The physics of a run."""

    scene: Scene
    rules: tuple[Rule, ...]
    ties: str = "left"
    seed: int = 0
    merge_below: float = 0.0
    tc: float = 0.0
    elastic_below: float = 0.0

    @cached_property
    def constant(self) -> Array | None:
        """Restitution per pair if all rules are constant."""
        eps = constants(self.rules, self.scene.pairs)
        return None if eps is None else np.array(eps)

    @cached_property
    def eps(self) -> Array:
        """ε per pair if all rules are constant, else 1, to be asked of `rule`."""
        return np.ones(self.scene.n_pairs) if self.constant is None else self.constant

    @cached_property
    def rule(self) -> Restitution | None:
        """ε of a pair at a speed (m/s); None if all rules are constant."""
        if self.constant is not None:
            return None
        rules, pairs = self.rules, tuple(self.scene.pairs)
        return lambda c, speed: restitution_at(rules[c], speed, pairs[c])

    @cached_property
    def gravity(self) -> float:
        """Gravity that the run feels in m/s²."""
        return felt_gravity(self.scene)

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
        return bool(self.eps.max() == 0.0)

    @cached_property
    def may_collapse(self) -> bool:
        """Whether infinitely many collisions in finite time are possible at all."""
        remedy = self.tc > 0.0 or self.elastic_below > 0.0 or self.merge_below > 0.0
        return not remedy and (self.rule is not None or bool(self.eps.min() < 1.0))


def felt_gravity(scene: Scene) -> float:
    """Return gravity (m/s²) in the frame of a run: without a wall that frame falls too, and velocities keep digits."""
    return scene.gravity if scene.is_wall.any() else 0.0


def scales(scene: Scene) -> tuple[float, float, float]:
    """Return the speed scale (m/s), the speed of falling through the mean gap, and the mean gap (m) of a scene."""
    length = float(np.mean(scene.gap)) or float(np.mean(scene.radius))
    fall = math.sqrt(2.0 * felt_gravity(scene) * length)
    return max(float(np.abs(np.diff(scene.velocity)).max()), fall), fall, length


def shares(scene: Scene) -> tuple[Array, Array, Array]:
    """Return m_eff/m_lower and m_eff/m_upper of each pair, and m_eff in kg.

    They are the shares of its two bodies in a change of its relative velocity; the smaller is computed, the other is 1
    minus it.
    """
    a, b = scene.sides(scene.mass)
    light = np.minimum(a, b)
    ratio = light / np.maximum(a, b)
    small = ratio / (1.0 + ratio)
    return np.where(a >= b, small, 1.0 - small), np.where(a >= b, 1.0 - small, small), light / (1.0 + ratio)
