"""Choice of material: same ε, same γ, or same material in both contacts

Launch speed of the upper ball, and number of contacts of the balls, over ε of the floor contact.
"""

import math

import numpy as np
from setting import (
    HARD_COLOUR,
    PAGE_WIDTH,
    SECOND_BOUNCE,
    SOFT_COLOUR,
    add_letter,
    dashpot_laws,
    hertz_laws,
    main,
    new_figure,
)

import granular as gr

BASE_SCENE = gr.scenes.three_balls()
IMPACT_SPEED = math.sqrt(2.0 * BASE_SCENE.gravity * BASE_SCENE.gap[0])
"""Impact speed |v10| of both balls in m/s."""


def same_gamma(scene, restitution):
    """Linear dashpots with the γ that gives the floor contact this ε."""
    floor, upper = dashpot_laws(scene, restitution)
    return [floor, gr.LinearDashpot(upper.k, floor.gamma)]


def same_material(scene, restitution):
    """One viscoelastic material whose floor contact has this ε at impact."""
    floor, upper = hertz_laws(scene)
    law = gr.ViscoelasticHertz.from_restitution(restitution, k=floor.k, speed=IMPACT_SPEED, pair=scene.pairs[0])
    return [law, gr.ViscoelasticHertz(upper.k, law.gamma * upper.k / floor.k)]


MATERIAL_CHOICES = {"same_eps": (r"same $\varepsilon$", dashpot_laws), "same_gamma": (r"same $\gamma$", same_gamma),
                    "same_material": ("same material", same_material)}
"""Title of each choice, and its laws for an ε of the floor contact."""


def compute(points):
    """Soft and hard launch speeds v2′/|v10|, contacts, and ε of the upper pair."""
    eps, found = np.linspace(0.3, 1.0, points), {}
    for choice, (_, laws) in MATERIAL_CHOICES.items():
        rows = zip(*(outcome(laws(BASE_SCENE, e)) for e in eps.tolist()), strict=True)
        found[choice] = dict(zip(("soft", "hard", "contacts", "upper_restitution"), map(np.array, rows), strict=True))
    return {"restitution": eps, **found}


def outcome(law):
    """Launch speeds, contacts and ε of one law, up to the second floor contact."""
    soft = gr.md.simulate(BASE_SCENE, law, until=SECOND_BOUNCE)
    hard = gr.edmd.simulate(BASE_SCENE, gr.restitution_of(law, BASE_SCENE), until=SECOND_BOUNCE)
    launch = [float(run.of(1)["v_out"][-1][1]) / IMPACT_SPEED for run in (soft, hard)]
    return *launch, soft.count(1), gr.binary.restitution(law[1], BASE_SCENE.pairs[1], IMPACT_SPEED)


def draw(data):
    """Draw one column per choice, with launch speeds above and contacts below."""
    figure, axes = new_figure(PAGE_WIDTH, 3.2, 2, 3, sharex=True, sharey="row", height_ratios=[1.5, 1.0])
    eps = data["restitution"]
    panels = zip(axes.T, ("ad", "be", "cf"), MATERIAL_CHOICES.items(), strict=True)
    for (top, low), tags, (choice, (title, _)) in panels:
        rows = data[choice]
        top.plot(eps, rows["hard"], color=HARD_COLOUR, ls="--", label="hard spheres")
        top.plot(eps, rows["soft"], color=SOFT_COLOUR, label="soft spheres")
        top.set_title(title)
        low.step(eps, rows["contacts"], where="mid", color=SOFT_COLOUR)
        low.set_xlabel(r"$\varepsilon_{01}$ at $|v_{10}|$")
        add_letter(top, f"({tags[0]})")
        add_letter(low, f"({tags[1]})")
    axes[0, 1].legend(loc="upper center")
    axes[0, 0].set(ylabel="$v_2'/|v_{10}|$", xlim=(eps[0], eps[-1]))
    axes[1, 0].set_ylabel("contacts")
    return figure


if __name__ == "__main__":
    main(compute, draw, 200)
