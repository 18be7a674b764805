"""Three spheres in a row with an overlap of 0.15 µm: what should a physics engine say?

Two steel balls of one inch touch, or nearly, and a third one meets them. Rounding of positions to single precision puts
them 0.15 µm into each other. Which balls move then, and how fast?

:Published: An open question of a physics engine's users (newton-physics/newton, issue 3233): by an overlap of 0.15 µm
    contacts are solved together, and half the energy is lost. Rules for simultaneous collisions disagree: in turn
    (0, 0, 1), all at once (-1/3, 2/3, 2/3) (Moreau; Glocker & Pfeiffer, Nonlinear Dyn. 7, 471 (1995)), by reflections
    again (0, 0, 1) (Smith, Kaufman, Vouga, Tamstorf & Grinspun, ACM Trans. Graph. 31, 106 (2012)).
:Hard spheres: What the rule says: `ties="left"`, "right", "random", "reflect": (0, 0, 1); "newton", "poisson":
    (-1/3, 2/3, 2/3). An overlap is refused.
:Newton: Touching: (-0.071, 0.076, 0.995) at any speed. 0.15 µm of overlap at 1 m/s: (-0.073, 0.079, 0.994);
    at 1 cm/s (-0.159, 0.175, 0.984): the energy of the overlap is set free. Gaps of 10 µm at 1 cm/s: (0, 0, 1).
:New: There is a right answer, none of the rules'; rounding matters below some cm/s only: a collision presses two balls
    27 µm into each other at 1 m/s, 0.67 µm at 1 cm/s.
:Read: The beginning of that thread; the papers are quoted from memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

TIE_RULES = ("left", "right", "random", "newton", "poisson", "reflect")
ROUNDING_OVERLAP = 1.5e-7


def row(gap, speed=1.0):
    """Three steel balls of one inch; the first comes."""
    mass = 4.0 / 3.0 * np.pi * 0.0127**3 * gr.materials.steel.density
    return gr.Scene([mass] * 3, [0.0127] * 3, [gap] * 2, [speed, 0.0, 0.0])


def hard_speeds(ties):
    """Speeds afterwards of hard balls that touch, by a rule for simultaneous collisions."""
    return gr.edmd.simulate(row(0.0), gr.ConstantRestitution(1.0), ties=ties).velocity[-1]


def soft_speeds(gap, speed=1.0):
    """The same of Newton's balls with these gaps, negative ones are overlaps; in units of the first one's speed."""
    scene = row(gap, speed)
    law = [gr.Hertz.from_material(*gr.materials.steel, pair) for pair in scene.pairs]
    return gr.md.simulate(scene, law, until=gr.until.separated()).velocity[-1] / speed


def largest_overlap(speed):
    """Overlap of two such balls that collide, in m."""
    pair = row(1.0).pairs[0]
    return gr.binary.collision(gr.Hertz.from_material(*gr.materials.steel, pair), pair, speed).xi_max


if __name__ == "__main__":
    for ties in TIE_RULES:
        print(f"hard, ties = {ties:8}", hard_speeds(ties).round(4))
    for gap, speed in ((0.0, 1.0), (-ROUNDING_OVERLAP, 1.0), (-ROUNDING_OVERLAP, 0.01), (1e-5, 0.01)):
        overlap = f"largest overlap {1e6 * largest_overlap(speed):.2f} µm"
        print(f"gap {1e6 * gap:5.2f} µm, {speed:g} m/s:", soft_speeds(gap, speed).round(4), overlap)
    plt.rcParams.update({"font.size": 14, "lines.linewidth": 3.0, "legend.frameon": False})
    figure, axis = plt.subplots(figsize=(8.5, 5.0), layout="constrained")
    gaps = np.concatenate([np.linspace(-4e-7, 1e-6, 43), np.geomspace(1e-6, 1e-4, 25)])
    for speed, colour in ((1.0, "#1f4e79"), (0.1, "#4f81b0"), (0.01, "#9dbfe0")):
        axis.plot(1e6 * gaps, [soft_speeds(gap, speed)[1] for gap in gaps], color=colour, label=f"soft, {speed:g} m/s")
    axis.axvline(-1e6 * ROUNDING_OVERLAP, color="black", lw=1.0, ls="--")
    axis.axhline(0.0, color="#c1440e", label="hard, in turn: 0")
    axis.plot([], [], color="#c1440e", ls=":", label="hard, all at once: 0.667, off the scale")
    axis.text(-1.5e6 * ROUNDING_OVERLAP, 0.122, "overlap 0.15 µm", ha="right", rotation=90, fontsize=12)
    axis.set(xlabel="gap, µm", ylabel="speed of the middle ball, part of all", xlim=(-0.45, 100.0), ylim=(-0.01, 0.2))
    axis.set_xscale("symlog", linthresh=1.0)
    axis.set_xticks((0.0, 1.0, 10.0, 100.0), ("0", "1", "10", "100"))
    axis.legend()
    figure.savefig("touching.png")
