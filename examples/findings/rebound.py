"""Two balls on a floor: a light one that flies late, or less far than the textbook says

Two balls fall on a floor, one on the other. How fast does each leave if they touch? And if the first bounce sends the
upper one up hardly at all, is that all of it?

:Published: Independent collisions of elastic balls leave v₁ = (1 - 3μ)/(1 + μ), v₂ = (3 - μ)/(1 + μ) times the speed of
    the fall, μ = m₂/m₁; balls of a kind that touch do not (Patrício, arXiv:physics/0402036). A small first bounce of
    the upper ball may be followed by a higher second one, a *delayed rebound* (Bartz, arXiv:2007.15005).
:Hard spheres: The textbook at any gap: 0 and 2 for μ = 1/3, 2.960 for μ = 0.01; a table-tennis ball on a basketball
    leaves at 2.3 times the speed of the fall at the first bounce.
:Newton: Touching balls of steel, each contact one: 0.5714 and 1.7380 for μ = 1/3, 1.1803 for μ = 0.01. The table-tennis
    ball leaves at 0.88 at the first bounce if it falls 1 mm behind, after four contacts, and at 1.72 at the second;
    touching at 0.80 and 0.98; 5 cm behind at 2.33.
:New: Light upper balls miss the textbook by a factor of 2.5, with one contact each; the late flight comes and goes
    with gaps of 0.1 to 10 mm, and hard spheres never have it.
:Read: The abstracts of both papers.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

STEEL = gr.materials.steel
SOFT_LAWS = {"steel, Hertz": lambda pair: gr.Hertz.from_material(*STEEL, pair),
             "springs": lambda pair: gr.LinearDashpot(k=1e6, gamma=0.0)}
DROP_HEIGHT, FALL_SPEED = 1.0, math.sqrt(2.0 * 9.81)


def textbook_speeds(mu):
    """Speeds of both balls after one collision with the floor and then one of the balls, in units of the fall's."""
    return np.array([1.0 - 3.0 * mu, 3.0 - mu]) / (1.0 + mu)


def touching_speeds(mu, law="steel, Hertz"):
    """Speeds of both balls, which touch and have masses of 1 and mu kg, after their fall at 1 m/s."""
    radii = np.cbrt(0.75 / math.pi * np.array([1.0, mu]) / STEEL.density)
    scene = gr.Scene([math.inf, 1.0, mu], [0.0, *radii], [1e-3, 0.0], [0.0, -1.0, -1.0])
    run = gr.md.simulate(scene, [SOFT_LAWS[law](pair) for pair in scene.pairs], until=gr.until.separated())
    return run.velocity[-1, 1:]


def bounces(gap, engine=gr.md):
    """Speed of a table-tennis ball, so far behind a basketball, after its last contact before the basketball meets the
    floor a second and a third time, in units of the fall's; and how many contacts it had by then."""
    lower, upper = gr.balls.BALLS["basketball"], gr.balls.BALLS["table-tennis ball"]
    scene = gr.Scene([math.inf, lower.mass, upper.mass], [0.0, lower.radius, upper.radius], [DROP_HEIGHT, gap],
                     [0.0] * 3, gravity=9.81)
    law = [gr.LinearDashpot.from_restitution(eps, k, pair) if engine is gr.md else gr.ConstantRestitution(eps)
           for eps, k, pair in zip((0.80, 0.85), (4e4, 3e4), scene.pairs, strict=True)]
    run = engine.simulate(scene, law, until=gr.until.contact(0, 3), t_end=3.0 * FALL_SPEED / 9.81)
    met = [run.of(1)[run.of(1)["t_begin"] < end] for end in (*run.of(0)["t_begin"][1:2], run.time[-1])]
    return [(part["v_out"][-1, 1] / FALL_SPEED, len(part)) for part in met]


if __name__ == "__main__":
    for mu in (0.01, 1.0 / 3.0, 3.0):
        print(f"μ = {mu:.3g}: textbook", textbook_speeds(mu).round(4), "steel", touching_speeds(mu).round(5))
    for gap in (0.0, 1e-4, 1e-3, 5e-3, 5e-2):
        print(f"{1e3 * gap:4.1f} mm behind:", *(f"{speed:.3f} after {count}" for speed, count in bounces(gap)))
    plt.rcParams.update({"font.size": 14, "lines.linewidth": 3.0, "legend.frameon": False})
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    mu, gaps = np.geomspace(0.01, 10.0, 25), np.geomspace(2e-5, 0.1, 180)
    axes[0].semilogx(mu, textbook_speeds(mu)[1], color="#c1440e", label="hard, upper")
    for law, line in zip(SOFT_LAWS, ("-", "--"), strict=True):
        axes[0].semilogx(mu, [touching_speeds(m, law)[1] for m in mu], line, color="#1f4e79", label=f"{law}, touching")
    axes[0].set(xlabel="upper mass / lower mass", ylabel="speed of the upper ball / fall")
    for nth, colour in enumerate(("#1f4e79", "#6f9fc8")):
        speeds = [bounces(gap)[nth][0] for gap in gaps]
        axes[1].semilogx(1e3 * gaps, speeds, ("-", ".")[nth], color=colour, ms=5, label=f"soft, bounce {nth + 1}")
    axes[1].semilogx(1e3 * gaps, [bounces(gap, gr.edmd)[0][0] for gap in gaps], color="#c1440e", label="hard, bounce 1")
    axes[1].set(xlabel="gap between the balls, mm", ylabel="speed of the table-tennis ball / fall", ylim=(0.0, 2.6))
    for axis, place in zip(axes, ("lower left", "lower right"), strict=True):
        axis.legend(loc=place, fontsize=12)
    figure.savefig("rebound.png")
