"""The choice of material: the same ε, the same γ, or the same material in both contacts

How fast the upper ball leaves, and how often the balls touch, over ε of the floor contact.
"""

import math

import numpy as np
from setting import END, HARD, PAGE, SOFT, canvas, dashpots, hertz, letter, main

import granular as gr

SCENE = gr.scenes.three_balls()
SPEED = math.sqrt(2.0 * SCENE.gravity * SCENE.gap[0])
"""|v10|, with which both balls arrive, in m/s."""


def same_gamma(scene, restitution):
    """Linear dashpots with the γ that gives the floor contact this ε."""
    floor, upper = dashpots(scene, restitution)
    return [floor, gr.LinearDashpot(upper.k, floor.gamma)]


def same_material(scene, restitution):
    """One viscoelastic material whose floor contact has this ε at impact."""
    floor, upper = hertz(scene)
    law = gr.ViscoelasticHertz.from_restitution(restitution, k=floor.k, speed=SPEED, pair=scene.pairs[0])
    return [law, gr.ViscoelasticHertz(upper.k, law.gamma * upper.k / floor.k)]


CHOICES = {"same_eps": (r"same $\varepsilon$", dashpots), "same_gamma": (r"same $\gamma$", same_gamma),
           "same_material": ("same material", same_material)}
"""Title of each choice, and the laws it makes for an ε of the floor contact."""


def compute(points):
    """Launch speed v2′/|v10| of the upper ball, soft and hard, contacts, and ε of the upper pair."""
    eps, found = np.linspace(0.3, 1.0, points), {}
    for choice, (_, laws) in CHOICES.items():
        rows = zip(*(outcome(laws(SCENE, e)) for e in eps.tolist()), strict=True)
        found[choice] = dict(zip(("soft", "hard", "contacts", "upper_restitution"), map(np.array, rows), strict=True))
    return {"restitution": eps, **found}


def outcome(law):
    """What one run of each engine says, up to the second floor contact."""
    soft = gr.md.simulate(SCENE, law, until=END)
    hard = gr.edmd.simulate(SCENE, gr.restitution_of(law, SCENE), until=END)
    launch = [float(run.of(1)["v_out"][-1][1]) / SPEED for run in (soft, hard)]
    return *launch, soft.count(1), gr.binary.restitution(law[1], SCENE.pairs[1], SPEED)


def draw(data):
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


if __name__ == "__main__":
    main(compute, draw, 200)
