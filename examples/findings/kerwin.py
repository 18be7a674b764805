"""Kerwin's optimal masses do not hold for touching balls

A ball of 1 kg hits a row at rest that ends with a ball of 1/27 kg. The mass between them that passes on the most energy
is determined, and the energy passed on by longer rows.

:Published: The optimum is the geometric mean. In longer rows each mass is the geometric mean of its neighbours, and
    more balls pass on more energy (Kerwin, Am. J. Phys. 40, 1152 (1972); small gaps between the balls are assumed).
:Hard spheres: m = √(1/27) = 0.1925 kg passes on 0.2931, compared with 0.1378 without a ball between. Six balls between
    pass on 0.6808.
:Soft spheres: For touching steel balls the optimum is 0.107 kg, which passes on 0.2179. It is 0.098 kg and 0.2021 for
    Hertz contacts of one stiffness, 0.065 kg and 0.1762 for springs. At the geometric mean springs pass on 0.1238, less
    than without a ball between.
:New: The optimal masses of touching balls, and that Kerwin's masses are harmful with springs.
:Read: The abstract of Ricardo & Lee, Eur. J. Phys. 36, 025013 (2015), on the same rule. Kerwin is quoted from memory.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

SOFT_LAWS = {"steel, Hertz": lambda pair: gr.Hertz.from_material(*gr.materials.steel, pair),
             "Hertz, one k": lambda pair: gr.Hertz(k=1e9), "springs": lambda pair: gr.LinearDashpot(k=1e6, gamma=0.0)}
LAST_MASS, MASS_GRID = 1.0 / 27.0, np.geomspace(1.0 / 27.0, 1.0, 31)


def row(masses, gap):
    """Steel balls of these masses in kg, the first of which moves at 1 m/s."""
    radii = np.cbrt(0.75 / np.pi * np.array(masses) / gr.materials.steel.density)
    return gr.Scene(masses, radii, [gap] * (len(masses) - 1), [1.0] + [0.0] * (len(masses) - 1))


def hard_share(*masses):
    """Energy share of the last ball after one hard collision after the other."""
    run = gr.edmd.simulate(row(masses, 1e-3), gr.ConstantRestitution(1.0), until=gr.until.separated())
    return masses[-1] * run.velocity[-1][-1] ** 2


def soft_share(law, *masses):
    """Energy share of the last ball of a touching row."""
    scene = row(masses, 0.0)
    run = gr.md.simulate(scene, [law(pair) for pair in scene.pairs], until=gr.until.separated())
    return masses[-1] * run.velocity[-1][-1] ** 2


def best_mass(share):
    """Mass between the two balls with the largest share, to half a per cent."""
    near = max(MASS_GRID, key=lambda mass: share(1.0, mass, LAST_MASS))
    return max(np.geomspace(0.92 * near, 1.087 * near, 35), key=lambda mass: share(1.0, mass, LAST_MASS))


if __name__ == "__main__":
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2), layout="constrained")
    ways = {"hard spheres": (hard_share, "#c1440e")}
    for (name, law), colour in zip(SOFT_LAWS.items(), ("#1f4e79", "#6f9fc8", "#c8963e"), strict=True):
        ways[name] = partial(soft_share, law), colour
    print("                best m        share   at 0.1925   8 balls")
    for name, (share, colour) in ways.items():
        mass, rows = best_mass(share), [share(*np.geomspace(1.0, LAST_MASS, n)) for n in range(2, 9)]
        print(f"{name:14} {mass:8.3f} {share(1.0, mass, LAST_MASS):11.4f} {rows[1]:11.4f} {rows[-1]:10.4f}")
        axes[0].semilogx(MASS_GRID, [share(1.0, m, LAST_MASS) for m in MASS_GRID], color=colour)
        axes[0].plot(mass, share(1.0, mass, LAST_MASS), "o", color=colour, ms=5)
        axes[1].plot(range(2, 9), rows, "o-", color=colour, label=name)
    axes[0].axhline(hard_share(1.0, LAST_MASS), color="black", lw=1.0, ls="--")
    axes[0].text(0.038, 0.127, "no ball between")
    axes[0].axvline(LAST_MASS**0.5, color="black", lw=1.0, ls=":")
    axes[0].set(title="(a)", xlabel="mass of the ball between (kg)", ylabel="energy share of the last ball")
    axes[0].set_xticks([LAST_MASS, 0.1, LAST_MASS**0.5, 1.0], ["1/27", "0.1", "0.19", "1"])
    axes[1].set(title="(b)", xlabel="balls in a row, geometric masses", ylabel="energy share of the last ball")
    axes[1].legend(frameon=False)
    figure.savefig("kerwin.png")
