"""How the balls of a ready-made case touch: force laws and a collision rule from a few numbers, or the kind of ball.
May be skipped: files and the command, no physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from granular import _check, balls, walls
from granular.cases import build
from granular.laws import Hertz, LinearDashpot
from granular.rules import ConstantRestitution
from granular.scene import Scene


def first_impact(scene: Scene) -> float:
    """Largest speed in m/s at which a pair would meet first if it were alone, with walls at their fastest; 0 if none
    meets."""
    closing = -scene.across(scene.velocity)
    gap = np.maximum(scene.gap, 0.0)
    rest = 0.0 if scene.rest_gap is None else scene.rest_gap
    square = closing * np.abs(closing) + gap * (2.0 * scene.pull + scene.pendulum**2 * (gap - 2.0 * rest))
    speed = np.sqrt(np.maximum(0.0, square))
    speed[0] += walls.fastest(scene.floor)
    speed[-1] += walls.fastest(scene.ceiling)
    return float(speed.max())


def contact(
    scene: Scene, restitution: float | Sequence[float] = 0.7, stiffness: float = 5e7, law: str = "LinearDashpot"
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and the collision rule of the same restitution for all pairs of a scene.

    Parameters
    ----------
    restitution : float or floats
        Coefficient of restitution in (0, 1]: one for all pairs, or one per pair bottom to top.
    stiffness : float
        Stiffness k: in N/m, for the Hertz laws in N/m^(3/2).
    law : str
        LinearDashpot, Hertz (elastic: restitution 1), TsujiHertz, WaltonBraun, or ViscoelasticHertz (restitution then
        holds at the speed of the first impact, and falls with speed).

    Returns
    -------
    tuple of laws, rule or None
        The rule is None where restitution depends on speed: then it is to be taken from the laws.
    """
    way = WAYS[_check.choice("law", law, list(WAYS))]
    needs = {parameter.name for parameter in build.parameters(way)}
    k = _check.number("stiffness", stiffness, above=0.0)
    given = {"k": k, "k_load": k, "speed": first_impact(scene)}
    values = {key: value for key, value in given.items() if key in needs}
    eps = list(restitution) if isinstance(restitution, Sequence) else restitution
    laws = build.each_pair(lambda e, pair: build.call([way], {"restitution": e} | values, pair=pair),
                           _check.per_pair("restitution", eps, scene.n_pairs), scene.pairs)
    return laws, None if "speed" in needs else ConstantRestitution(eps)


def _elastic_hertz(restitution: float, k: float) -> Hertz:
    """Hertz's law, which has one restitution."""
    fix = "Hertz's law is elastic; TsujiHertz and ViscoelasticHertz are damped"
    _check.number("restitution", restitution, at_least=1.0, at_most=1.0, fix=fix)
    return Hertz(k)


WAYS = {"Hertz": _elastic_hertz} | {
    name: kind.from_restitution for name, kind in build.LAWS.items() if hasattr(kind, "from_restitution")}
"""Laws that `contact` makes, and how."""


def of_balls(
    scene: Scene, lower: str | balls.Ball = "basketball", upper: str | balls.Ball | None = "tennis ball",
    pair_rule: str = "lens",
) -> tuple[tuple[Any, ...], Any]:
    """Return force laws and the collision rule of real balls, from what each does on a floor (`granular.balls`).

    Parameters
    ----------
    lower, upper : str or Ball
        The balls of the scene.
    pair_rule : {"lens", "series"}
        How the two press on each other.
    """
    _check.choice("pair_rule", pair_rule, balls.RULES)
    floor = balls.named(lower, "lower")
    each = [floor, floor if upper is None else balls.contact(lower, upper, pair_rule)][: scene.n_pairs]
    laws = [LinearDashpot.from_restitution(one.restitution, one.stiffness, pair)
            for one, pair in zip(each, scene.pairs, strict=True)]
    return tuple(laws), ConstantRestitution([one.restitution for one in each])
