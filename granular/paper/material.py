"""The choice of material: same ε, same γ, or the same material in both contacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granular import edmd, md
from granular.binary import restitution, restitution_of
from granular.laws import LinearDashpot, ViscoelasticHertz
from granular.laws.hertz import hertz_stiffness
from granular.paper import setting
from granular.paper.drawing import HARD, PAGE, SOFT, canvas, letter
from granular.sweeps.results import impact_speed

YOUNG, POISSON = 5e7, 0.45
TITLES = {"same_eps": r"same $\varepsilon$", "same_gamma": r"same $\gamma$", "same_material": "same material"}


def compute(points: int) -> dict[str, Any]:
    """Launch speed v2′/|v10| of the upper ball and contacts, over ε of the floor contact, soft and hard."""
    scene, eps = setting.drop(), np.linspace(0.3, 1.0, points)
    choices: dict[str, Callable[[float], list[Any]]] = {
        "same_eps": lambda e: setting.dashpots(scene, e),
        "same_gamma": lambda e: [LinearDashpot(law.k, setting.dashpots(scene, e)[0].gamma)
                                 for law in setting.dashpots(scene, e)],
        "same_material": _viscoelastic,
    }
    found = {name: [_outcome(choice(float(e))) for e in eps] for name, choice in choices.items()}
    names = ("soft", "hard", "contacts", "upper_restitution")
    return {"restitution": eps, **{choice: dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
                                   for choice, rows in found.items()}}


def draw(data: dict[str, Any]) -> Any:
    """One column per choice: launch speed above, contacts and the ε of the upper contact below."""
    figure, axes = canvas(PAGE, 3.2, 2, 3, sharex=True, sharey="row", height_ratios=[1.5, 1.0])
    for k, (name, title) in enumerate(TITLES.items()):
        top, low = axes[:, k]
        rows = data[name]
        top.plot(data["restitution"], rows["hard"], color=HARD, ls="--", label="hard spheres")
        top.plot(data["restitution"], rows["soft"], color=SOFT, label="soft spheres")
        top.set_title(title)
        low.step(data["restitution"], rows["contacts"], where="mid", color=SOFT)
        low.set_xlabel(r"$\varepsilon_{01}$ at $|v_{10}|$")
        letter(top, f"({'abc'[k]})")
        letter(low, f"({'def'[k]})")
    axes[0, 1].legend(loc="upper center")
    axes[0, 0].set_ylabel("$v_2'/|v_{10}|$")
    axes[1, 0].set_ylabel("contacts")
    axes[0, 0].set_xlim(data["restitution"][0], data["restitution"][-1])
    return figure


def _viscoelastic(eps: float) -> list[Any]:
    """One material whose floor contact has this ε at impact."""
    scene = setting.drop()
    floor, upper = (hertz_stiffness(YOUNG, POISSON, pair) for pair in scene.pairs)
    law = ViscoelasticHertz.from_restitution(eps, k=floor, speed=impact_speed(scene), pair=scene.pairs[0])
    return [law, ViscoelasticHertz(upper, law.gamma * upper / floor)]


def _outcome(law: list[Any]) -> tuple[float, float, int, float]:
    """Soft and hard v2′/|v10| after the last contact before the second floor contact, contacts, ε of the upper pair."""
    scene = setting.drop()
    speed, end = impact_speed(scene), setting.SECOND_FLOOR_CONTACT
    soft = md.simulate(scene, law, until=end)
    hard = edmd.simulate(scene, restitution_of(law, scene), until=end)
    launch = [float(run.of(1)["v_out"][-1][1]) / speed for run in (soft, hard)]
    return launch[0], launch[1], soft.count(1), restitution(law[1], scene.pairs[1], speed)
