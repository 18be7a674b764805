"""Longer scenes as functions of their parameters: what `breakdown` and `predictors` sweep over."""

from __future__ import annotations

import math

from granular import cases, scenes, until
from granular.cases import Case
from granular.laws import PowerLaw
from granular.paper import setting
from granular.rules import ConstantRestitution
from granular.scene import Scene

ERROR = r"error  $\max(|\Delta u_i|,\,|\Delta v_c'|)\,/\,v_1$"
"""Label of `granular.Comparison.error`: largest difference of a leaving velocity u or a separation speed v′."""


def stack(n: int = 3, gap: float = 1e-3, restitution: float = 0.95) -> Case:
    """Kerwin stack: `n` balls of mass ratio 1/3, 3 m/s, without gravity."""
    scene = scenes.ball_stack(n, 1.0 / 3.0, speed=3.0, gap=gap, gravity=0.0)
    return _case(scene, restitution)


def cradle(gap: float = 1e-6, exponent: float = 1.5) -> Case:
    """Newton's cradle of five steel balls; F = k ξ^exponent, elastic, 1e-5 m deep at 1 m/s whatever the exponent."""
    scene = scenes.newtons_cradle(5, gap=gap)
    depth, energy = 1e-5, 0.25
    stiffness = energy * (exponent + 1.0) / depth ** (exponent + 1.0)
    return Case(scene, (PowerLaw(stiffness, exponent),) * 4, ConstantRestitution(1.0), until.separated(), 100.0)


def column(n: int = 5, gap: float = 1e-3, restitution: float = 0.95) -> Case:
    """Column of `n` equal balls of 1 kg that falls on a floor at 1 m/s, without gravity."""
    return _case(scenes.column(n, gap=gap, speed=1.0), restitution)


def gas(packing: float = 0.1, duration: float = 0.01, restitution: float = 0.9) -> Case:
    """Gas of 20 balls on 20 m, thermal speed 1 m/s, that cools while each crosses ten mean gaps; t_c in s, elastic."""
    scene = scenes.gas(20, length=20.0, packing=packing)
    flight = (1.0 - packing) * 20.0 / 21.0
    stiffness = 0.5 * (math.pi / duration) ** 2
    laws = setting.dashpots(scene, restitution, stiffness)
    return Case(scene, tuple(laws), ConstantRestitution(restitution), None, 10.0 * flight)


def drop(gap: float = 1e-4, restitution: float = 0.7, ratio: float = 10.0) -> Case:
    """The paper's own scene."""
    return cases.make("three-balls", gap=gap, restitution=restitution, radii=(0.01 * ratio, 0.01))


def _case(scene: Scene, restitution: float) -> Case:
    laws = setting.dashpots(scene, restitution)
    return Case(scene, tuple(laws), ConstantRestitution(restitution), until.separated(), 100.0)
