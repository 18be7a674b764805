"""The collision rule that force laws make: for the hard spheres of a comparison."""

from __future__ import annotations

from typing import Any

from granular.binary import LawRestitution, restitution_of
from granular.scene import Pair, Scene


class LawRule(LawRestitution):
    """The rule that a comparison makes out of force laws: it speaks of the law where that gives no ε in [0, 1]."""

    def __call__(self, speed: float, pair: Pair) -> float:
        eps = super().__call__(speed, pair)
        if not 0.0 <= eps <= 1.0 + 1e-9:  # rounding is the engine's business
            law = self.laws[pair.index]
            raise ValueError(
                f"law of pair {pair.index} is {law!r}: its restitution at {speed:g} m/s is {eps:.6g}, so no hard-sphere"
                " rule can be made of it; a law that repels and gives no energy is needed, or a rule of yours, rule=..."
            )
        return eps


def rule_of(laws: tuple[Any, ...], scene: Scene) -> Any:
    rule = restitution_of(laws, scene)
    return LawRule(laws) if isinstance(rule, LawRestitution) else rule
