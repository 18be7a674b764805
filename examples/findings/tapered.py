"""Tapered chains: accuracy of hard spheres

Twenty steel balls touch. Each radius is smaller than the previous radius by a share q. The first ball moves at 1 m/s.
The energy share of the last ball is determined.

:Published: Such chains spread an impulse (Nakagawa, Agui, Wu & Extramiana, Granular Matter 4, 167 (2003)). A theory of
    successive collisions is "quantitatively accurate" (Harbola, Rosas, Esposito & Lindenberg, Phys. Rev. E 80, 031303
    (2009)) or "not in good quantitative agreement" (Machado, Rosas & Lindenberg, arXiv:1307.1191).
:Hard spheres: a^19 [2/(1 + a)]^38 with a = (1 - q)³: 1 at q = 0, 0.8937 at 0.05, 0.6234 at 0.1.
:Soft spheres: 0.9716, 0.7520 and 0.2741 for steel. Hertz contacts of one stiffness give 0.9716, 0.7204 and 0.2037,
    springs 0.6491, 0.2063 and 0.0189.
:New: One number for both abstracts: compared with steel, hard spheres are off by 3 % at q = 0, by 19 % at 0.05, and by
    a factor of 2.3 at 0.1. Compared with springs, this factor is 33. A chain of equal balls with springs does not even
    pass on its energy.
:Read: The abstracts of all three papers. The pulses of the theory are not compared here.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

N = 20
SOFT_LAWS = {"steel, Hertz": (lambda pair: gr.Hertz.from_material(*gr.materials.steel, pair), "#1f4e79"),
             "Hertz, one k": (lambda pair: gr.Hertz(k=1e9), "#6f9fc8"),
             "springs": (lambda pair: gr.LinearDashpot(k=1e6, gamma=0.0), "#c8963e")}


def chain(q, gap):
    """Chain of balls with the radii R, (1 - q) R, (1 - q)² R, …"""
    return gr.scenes.chain(N, mass_ratio=(1.0 - q) ** 3, gap=gap)


def hard_share(q):
    """Energy share of the last hard ball."""
    run = gr.edmd.simulate(chain(q, 1e-3), gr.ConstantRestitution(1.0), until=gr.until.separated())
    return run.scene.mass[-1] * run.velocity[-1][-1] ** 2


def soft_share(q, law):
    """Energy share of the last soft ball if the balls touch."""
    scene = chain(q, 0.0)
    run = gr.md.simulate(scene, [law(pair) for pair in scene.pairs], until=gr.until.separated())
    return run.scene.mass[-1] * run.velocity[-1][-1] ** 2


if __name__ == "__main__":
    tapering = np.linspace(0.0, 0.1, 6)
    plt.style.use("granular.journal")
    figure, axis = plt.subplots(figsize=(4.6, 2.9), layout="constrained")
    shares = {"hard spheres": [hard_share(q) for q in tapering]}
    axis.plot(100.0 * tapering, shares["hard spheres"], "o-", color="#c1440e")
    for name, (law, colour) in SOFT_LAWS.items():
        shares[name] = [soft_share(q, law) for q in tapering]
        axis.plot(100.0 * tapering, shares[name], "o-", color=colour)
    print("q, %          ", *(f"{100.0 * q:8.0f}" for q in tapering))
    for name, values in shares.items():
        print(f"{name:14}", *(f"{value:8.4f}" for value in values))
    for name, x, y, colour in (("hard spheres", 6.2, 0.9, "#c1440e"), ("steel, Hertz", 7.6, 0.53, "#1f4e79"),
                               ("Hertz, one k", 3.6, 0.6, "#6f9fc8"), ("springs", 0.9, 0.4, "#c8963e")):
        axis.text(x, y, name, color=colour, weight="bold")
    axis.set(xlabel="decrease of the radius per ball (%)", ylabel="energy share of the last ball", ylim=(0.0, 1.05))
    figure.savefig("tapered.png")
