"""The choice of material: same ε, same γ, or the same material in both contacts.
May be skipped: figures beyond the paper, beside the engines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granular import edmd, md, scenes
from granular.binary import restitution, restitution_of
from granular.drawing import HARD, PAGE, SOFT, canvas, letter
from granular.laws import LinearDashpot, ViscoelasticHertz
from granular.paper import setting
from granular.scene import Scene
from granular.sweeps.results import impact_speed


def same_gamma(scene: Scene, eps: float) -> list[Any]:
    """Linear dashpots with the γ that gives the floor contact this ε."""
    floor, upper = setting.dashpots(scene, eps)
    return [floor, LinearDashpot(upper.k, floor.gamma)]


def same_material(scene: Scene, eps: float) -> list[Any]:
    """One viscoelastic material whose floor contact has this ε at impact."""
    floor, upper = setting.hertz(scene)
    law = ViscoelasticHertz.from_restitution(eps, k=floor, speed=impact_speed(scene), pair=scene.pairs[0])
    return [law, ViscoelasticHertz(upper, law.gamma * upper / floor)]


CHOICES: dict[str, tuple[str, Callable[[Scene, float], Sequence[Any]]]] = {
    "same_eps": (r"same $\varepsilon$", setting.dashpots),
    "same_gamma": (r"same $\gamma$", same_gamma),
    "same_material": ("same material", same_material),
}
"""Title of each choice, and the laws it makes for an ε of the floor contact."""


def compute(points: int) -> dict[str, Any]:
    """Launch speed v2′/|v10| of the upper ball and contacts, over ε of the floor contact, soft and hard."""
    scene, eps = scenes.three_balls(), np.linspace(0.3, 1.0, points)
    names = ("soft", "hard", "contacts", "upper_restitution")
    found: dict[str, Any] = {"restitution": eps}
    for choice, (_, laws) in CHOICES.items():
        columns = zip(*(_outcome(scene, laws(scene, e)) for e in eps.tolist()), strict=True)
        found[choice] = dict(zip(names, map(np.array, columns), strict=True))
    return found


def _outcome(scene: Scene, law: Sequence[Any]) -> tuple[float, float, int, float]:
    """Soft and hard v2′/|v10| after the last contact before the second floor contact, contacts, ε of the upper pair."""
    speed, end = impact_speed(scene), setting.SECOND_FLOOR_CONTACT
    soft = md.simulate(scene, law, until=end)
    hard = edmd.simulate(scene, restitution_of(law, scene), until=end)
    launch = [float(run.of(1)["v_out"][-1][1]) / speed for run in (soft, hard)]
    return launch[0], launch[1], soft.count(1), restitution(law[1], scene.pairs[1], speed)


def draw(data: dict[str, Any]) -> Any:
    """One column per choice: launch speed above, contacts below."""
    figure, axes = canvas(PAGE, 3.2, 2, 3, sharex=True, sharey="row", height_ratios=[1.5, 1.0])
    eps = data["restitution"]
    for (top, low), tags, (choice, (title, _)) in zip(axes.T, ("ad", "be", "cf"), CHOICES.items(), strict=True):
        rows = data[choice]
        top.plot(eps, rows["hard"], color=HARD, ls="--", label="hard spheres")
        top.plot(eps, rows["soft"], color=SOFT, label="soft spheres")
        top.set_title(title)
        low.step(eps, rows["contacts"], where="mid", color=SOFT)
        low.set_xlabel(r"$\varepsilon_{01}$ at $|v_{10}|$")
        letter(top, f"({tags[0]})")
        letter(low, f"({tags[1]})")
    axes[0, 1].legend(loc="upper center")
    axes[0, 0].set(ylabel="$v_2'/|v_{10}|$", xlim=(eps[0], eps[-1]))
    axes[1, 0].set_ylabel("contacts")
    return figure
