"""What does not change during a run: the scene, its rules, and how ties, collapse and weak impacts are treated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from granular import _check
from granular._check import Array
from granular.edmd.groups import RULES
from granular.edmd.ties import ORDER
from granular.rules import Rule, constants, restitution_at
from granular.scene import Scene

Restitution = Callable[[int, float], float]
OPTIONS = ("ties", "seed", "merge_below", "tc", "elastic_below")
"""Those that change the physics: a saved run holds them by these names."""


@dataclass(frozen=True, eq=False)
class Model:
    """The physics of a run."""

    scene: Scene
    rules: tuple[Rule, ...]
    ties: str
    seed: int
    merge_below: float
    tc: float
    elastic_below: float

    @cached_property
    def eps(self) -> Array:
        """Restitution per pair; nan if not all rules are constant, and `rule` has to be asked."""
        known = constants(self.rules, self.scene.gap)
        return np.full(self.scene.n_pairs, math.nan) if known is None else np.array(known)

    @cached_property
    def rule(self) -> Restitution | None:
        """ε of a pair at a speed (m/s); None if all rules are constant."""
        if not math.isnan(self.eps[0]):
            return None
        rules, pairs = self.rules, tuple(self.scene.pairs)
        return lambda c, speed: restitution_at(rules[c], speed, pairs[c])


def checked(
    scene: Scene,
    rules: tuple[Rule, ...],
    *,
    ties: str,
    seed: int,
    collapse: str,
    merge_below: float | None,
    tc: float,
    elastic_below: float,
) -> Model:
    """Return the physics of a run, or raise what is wrong with an option."""
    merging = _check.choice("collapse", collapse, ("stop", "merge")) == "merge"
    if merge_below is not None and not merging:
        raise ValueError(f"merge_below is {merge_below!r}: it needs collapse='merge'.")
    below = 0.01 * scales(scene)[0] if merging else 0.0
    if merge_below is not None:
        below = _check.number("merge_below", merge_below, above=0.0)
    model = Model(
        scene,
        rules,
        _check.choice("ties", ties, tuple(ORDER)),
        _check.whole("seed", seed),
        below,
        _check.number("tc", tc, at_least=0.0),
        _check.number("elastic_below", elastic_below, at_least=0.0),
    )
    if model.eps.max() == 0.0:
        model = replace(model, merge_below=math.inf)
    _check_ties(model)
    _check_remedies(model)
    return model


def _check_ties(model: Model) -> None:
    if model.ties in ("newton", "reflect") and model.eps.min() != model.eps.max():
        why = "different ones can multiply the energy" if model.ties == "newton" else "others have no meaning"
        raise ValueError(f"ties is {model.ties!r}: one constant restitution for all pairs is needed ({why}); "
                         "use ties='poisson'.")  # fmt: skip
    if model.ties in RULES and (model.merge_below > 0.0 or model.tc > 0.0 or model.elastic_below > 0.0):
        raise ValueError(f"ties is {model.ties!r}: groups solved as a whole do not go with sticking balls, "
                         "collapse='merge', tc= or elastic_below=; use ties='left'.")  # fmt: skip


def _check_remedies(model: Model) -> None:
    named = [name for name in ("merge_below", "tc", "elastic_below") if getattr(model, name) > 0.0]
    if len(named) > 1:
        names = " and ".join("sticking or collapse='merge'" if name == "merge_below" else name for name in named)
        raise ValueError(f"{names} are given together: one remedy at a time is needed.")
    some = np.flatnonzero(model.eps == 0.0)
    if 0 < len(some) < model.scene.n_pairs:
        raise ValueError(f"restitution of pair {some[0]} is 0.0 but not of all pairs: 0 means balls that stick, "
                         "for all pairs or none; use a small number, such as 0.01.")  # fmt: skip


def felt_gravity(scene: Scene) -> float:
    """Return gravity (m/s²) in the frame of a run: without a wall that frame falls too, and velocities keep digits."""
    return scene.gravity if scene.is_wall.any() else 0.0


def scales(scene: Scene) -> tuple[float, float, float]:
    """Return the speed scale (m/s), the speed of falling through the mean gap, and the mean gap (m) of a scene."""
    length = float(np.mean(scene.gap)) or float(np.mean(scene.radius))
    fall = math.sqrt(2.0 * felt_gravity(scene) * length)
    return max(float(np.abs(np.diff(scene.velocity)).max()), fall), fall, length


def shares(scene: Scene) -> tuple[Array, Array]:
    """Return m_eff/m_lower and m_eff/m_upper of each pair: shares of its bodies in a change of its relative velocity.

    The smaller is computed, the other is 1 minus it.
    """
    a, b = scene.sides(scene.mass)
    ratio = np.minimum(a, b) / np.maximum(a, b)
    small = ratio / (1.0 + ratio)
    return np.where(a >= b, small, 1.0 - small), np.where(a >= b, 1.0 - small, small)
