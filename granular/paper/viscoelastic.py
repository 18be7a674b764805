"""Figures 7 and 8: contact sequences of viscoelastic spheres, v = 3 m/s, over ε and over the material's constant A."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from granular.laws import ViscoelasticHertz
from granular.laws.hertz import hertz_stiffness
from granular.paper import setting
from granular.paper.drawing import COLUMN, canvas
from granular.paper.sequence import Row, bands, follow, legend, spikes
from granular.scene import Scene

SPEED = 3.0
RADII = (0.1, 0.0025)
YOUNG, POISSON, DENSITY = 5e7, 0.45, 900.0


def over_restitution(points: int) -> dict[str, Any]:
    """Contacts over an ε that both pairs have at 3 m/s."""
    stretches = follow(lambda eps: _row(with_restitution(eps)), np.linspace(0.3, 1.0, points))
    return {"parameter": "restitution at 3 m/s", "numerical": stretches, "spikes": spikes(stretches)}


def over_constant(points: int) -> dict[str, Any]:
    """Contacts over the dissipative constant A in s that both pairs have."""
    grid = np.concatenate([[0.0], np.geomspace(1e-7, 3e-5, points)])
    stretches = follow(lambda a: _row(with_constant(a)), grid)
    return {"parameter": "A in s", "numerical": stretches, "spikes": spikes(stretches)}


def scene() -> Scene:
    """The lower ball meets the floor at t = 0; both balls have 3 m/s then."""
    dropped = setting.drop(radii=RADII, height=RADII[0], density=DENSITY)
    return dropped.replace(velocity=[0.0, -SPEED, -SPEED])


def with_restitution(restitution: float) -> list[ViscoelasticHertz]:
    """Laws of both pairs with one ε at 3 m/s; A then differs from pair to pair."""
    return [
        ViscoelasticHertz.from_restitution(restitution, k=hertz_stiffness(YOUNG, POISSON, pair), speed=SPEED, pair=pair)
        for pair in scene().pairs
    ]


def with_constant(a: float) -> list[ViscoelasticHertz]:
    """Laws of both pairs for one material of dissipative constant `a` in s: γ = (3/2) A k."""
    stiffness = [hertz_stiffness(YOUNG, POISSON, pair) for pair in scene().pairs]
    return [ViscoelasticHertz(k, 1.5 * a * k) for k in stiffness]


def draw(data: dict[str, Any], label: str, unit: float) -> Any:
    """Time over a parameter in a unit."""
    figure, ((axis,),) = canvas(COLUMN, 2.9)
    bands(axis, [stretch | {"parameter": stretch["parameter"] * unit} for stretch in data["numerical"]])
    axis.set(xlabel=label, ylim=(0.0, 10.0))
    legend(axis)
    return figure


draw_restitution = partial(draw, label=r"$\varepsilon$ at 3 m/s of both contacts", unit=1.0)
draw_constant = partial(draw, label=r"$A$  ($\mu$s)", unit=1e6)


def _row(law: list[ViscoelasticHertz]) -> Row:
    run = setting.until_second_floor_contact(scene(), law)
    floor = run.of(0)["t_end"]
    return setting.intervals(run), float(floor[0]) if len(floor) else math.nan
