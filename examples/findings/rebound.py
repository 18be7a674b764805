"""Two balls on a floor: slow or late rebound of a light upper ball

Two balls fall on a floor, one above the other. Their speeds are determined for touching balls. For a small first
rebound of the upper ball, its second rebound is determined as well.

:Published: Independent collisions of elastic balls give v₁ = (1 - 3μ)/(1 + μ) and v₂ = (3 - μ)/(1 + μ) in units of the
    speed of the fall, with μ = m₂/m₁. Touching balls of one material have other speeds (Patrício,
    arXiv:physics/0402036). A small first bounce of the upper ball can be followed by a higher second bounce, a *delayed
    rebound* (Bartz, arXiv:2007.15005).
:Hard spheres: The textbook speeds for any gap: 0 and 2 for μ = 1/3, 2.960 for μ = 0.01. A table-tennis ball on a
    basketball leaves at 2.3 times the speed of the fall at the first bounce.
:Soft spheres: Touching steel balls with one contact each have 0.5714 and 1.7380 for μ = 1/3, and 1.1803 for μ = 0.01.
    A table-tennis ball 1 mm behind leaves at 0.88 at the first bounce, after four contacts, and at 1.72 at the second
    bounce. If it touches, it leaves at 0.80 and 0.98. A ball 5 cm behind leaves at 2.33.
:New: Light upper balls differ from the textbook by a factor of 2.5, with one contact each. The delayed rebound appears
    and disappears for gaps of 0.1 to 10 mm, and hard spheres never have it.
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
    """Speeds of both balls after independent collisions, over the speed of the fall."""
    return np.array([1.0 - 3.0 * mu, 3.0 - mu]) / (1.0 + mu)


def touching_speeds(mu, law="steel, Hertz"):
    """Speeds of two touching balls of 1 and mu kg after their fall at 1 m/s."""
    radii = np.cbrt(0.75 / math.pi * np.array([1.0, mu]) / STEEL.density)
    scene = gr.Scene([math.inf, 1.0, mu], [0.0, *radii], [1e-3, 0.0], [0.0, -1.0, -1.0])
    run = gr.md.simulate(scene, [SOFT_LAWS[law](pair) for pair in scene.pairs], until=gr.until.separated())
    return run.velocity[-1, 1:]


def bounces(gap, engine=gr.md):
    """Launch speed over the speed of the fall, and contacts, up to bounces 1 and 2."""
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
        print(f"{1e3 * gap:4.1f} mm behind:", *(f"{speed:.3f} after {count} contacts" for speed, count in bounces(gap)))
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
    mu, gaps = np.geomspace(0.01, 10.0, 25), np.geomspace(2e-5, 0.1, 180)
    axes[0].semilogx(mu, textbook_speeds(mu)[1], color="#c1440e", label="hard, upper")
    for law, line in zip(SOFT_LAWS, ("-", "--"), strict=True):
        axes[0].semilogx(mu, [touching_speeds(m, law)[1] for m in mu], line, color="#1f4e79", label=f"{law}, touching")
    axes[0].set(title="(a)", xlabel="upper mass / lower mass", ylabel="speed of the upper ball / fall")
    for nth, colour in enumerate(("#1f4e79", "#6f9fc8")):
        speeds = [bounces(gap)[nth][0] for gap in gaps]
        axes[1].semilogx(1e3 * gaps, speeds, ("-", ".")[nth], color=colour, ms=3, label=f"soft, bounce {nth + 1}")
    axes[1].semilogx(1e3 * gaps, [bounces(gap, gr.edmd)[0][0] for gap in gaps], color="#c1440e", label="hard, bounce 1")
    axes[1].set(title="(b)", xlabel="gap between balls (mm)", ylabel="speed of the upper ball / fall", ylim=(0.0, 2.6))
    for axis, place in zip(axes, ("lower left", "lower right"), strict=True):
        axis.legend(loc=place)
    figure.savefig("rebound.png")
