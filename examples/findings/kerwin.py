"""Kerwin's best masses fail for touching balls

A ball of 1 kg hits a row at whose end one of 1/27 kg waits, both at rest. Which mass between them hands on most of the
energy? And do more balls hand on more?

:Published: The geometric mean; in longer rows each mass is that of its neighbours, and the more balls the more energy
    (Kerwin, Am. J. Phys. 40, 1152 (1972); small gaps between the balls are assumed).
:Hard spheres: m = √(1/27) = 0.1925 kg hands on 0.2931, against 0.1378 without a ball between; 0.6808 with six.
:Newton: Touching steel balls: best is 0.107 kg, 0.2179; Hertz contacts of one stiffness 0.098 kg, 0.2021; springs
    0.065 kg, 0.1762. At the geometric mean springs hand on 0.1238: less than with no ball between.
:New: The best masses of touching balls, and that Kerwin's does harm under springs.
:Read: The abstract of Ricardo & Lee, Eur. J. Phys. 36, 025013 (2015), on the same rule; Kerwin is quoted from memory.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

SOFT_LAWS = {"steel, Hertz": lambda pair: gr.Hertz.from_material(*gr.materials.steel, pair),
             "Hertz, one k": lambda pair: gr.Hertz(k=1e9), "springs": lambda pair: gr.LinearDashpot(k=1e6, gamma=0.0)}
LAST_MASS, MASS_GRID = 1.0 / 27.0, np.geomspace(1.0 / 27.0, 1.0, 31)


def row(masses, gap):
    """Steel balls of these masses in kg; the first comes at 1 m/s."""
    radii = np.cbrt(0.75 / np.pi * np.array(masses) / gr.materials.steel.density)
    return gr.Scene(masses, radii, [gap] * (len(masses) - 1), [1.0] + [0.0] * (len(masses) - 1))


def hard_share(*masses):
    """Part of the energy that the last of some balls takes, one collision after the other."""
    run = gr.edmd.simulate(row(masses, 1e-3), gr.ConstantRestitution(1.0), until=gr.until.separated())
    return masses[-1] * run.velocity[-1][-1] ** 2


def soft_share(law, *masses):
    """The same if they touch."""
    scene = row(masses, 0.0)
    run = gr.md.simulate(scene, [law(pair) for pair in scene.pairs], until=gr.until.separated())
    return masses[-1] * run.velocity[-1][-1] ** 2


def best_mass(share):
    """The mass between the two at which their share is largest, to half a per cent."""
    near = max(MASS_GRID, key=lambda mass: share(1.0, mass, LAST_MASS))
    return max(np.geomspace(0.92 * near, 1.087 * near, 35), key=lambda mass: share(1.0, mass, LAST_MASS))


if __name__ == "__main__":
    plt.rcParams.update({"font.size": 14, "lines.linewidth": 3.0})
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    ways = {"hard spheres": (hard_share, "#c1440e")}
    for (name, law), colour in zip(SOFT_LAWS.items(), ("#1f4e79", "#6f9fc8", "#c8963e"), strict=True):
        ways[name] = partial(soft_share, law), colour
    print("                best m    its share   at 0.1925   8 balls")
    for name, (share, colour) in ways.items():
        mass, rows = best_mass(share), [share(*np.geomspace(1.0, LAST_MASS, n)) for n in range(2, 9)]
        print(f"{name:14} {mass:8.3f} {share(1.0, mass, LAST_MASS):11.4f} {rows[1]:11.4f} {rows[-1]:10.4f}")
        axes[0].semilogx(MASS_GRID, [share(1.0, m, LAST_MASS) for m in MASS_GRID], color=colour)
        axes[0].plot(mass, share(1.0, mass, LAST_MASS), "o", color=colour, ms=10)
        axes[1].plot(range(2, 9), rows, "o-", color=colour, label=name)
    axes[0].axhline(hard_share(1.0, LAST_MASS), color="black", lw=1.0, ls="--")
    axes[0].text(0.038, 0.127, "no ball between")
    axes[0].axvline(LAST_MASS**0.5, color="black", lw=1.0, ls=":")
    axes[0].set(xlabel="mass of the ball between, kg", ylabel="energy of the last ball, part of all")
    axes[0].set_xticks([LAST_MASS, 0.1, LAST_MASS**0.5, 1.0], ["1/27", "0.1", "0.19", "1"])
    axes[1].set(xlabel="balls in a row, masses geometric")
    axes[1].legend(frameon=False)
    figure.savefig("kerwin.png")
