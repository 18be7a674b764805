"""Three spheres in a row with an overlap of 0.15 µm: the right outcome

Two steel balls of one inch touch or nearly touch, and a third ball hits them. Rounding of positions to single precision
causes an overlap of 0.15 µm. The final speeds are determined.

:Published: An open question of users of a physics engine (newton-physics/newton, issue 3233): with an overlap of
    0.15 µm contacts are solved together, and half the energy is lost. Rules for simultaneous collisions disagree:
    successive collisions give (0, 0, 1), simultaneous collisions (-1/3, 2/3, 2/3) (Moreau; Glocker & Pfeiffer,
    Nonlinear Dyn. 7, 471 (1995)), and reflections again (0, 0, 1) (Smith, Kaufman, Vouga, Tamstorf & Grinspun, ACM
    Trans. Graph. 31, 106 (2012)).
:Hard spheres: The tie rule decides. `ties="left"`, "right", "random" and "reflect" give (0, 0, 1), "newton" and
    "poisson" (-1/3, 2/3, 2/3). An overlap is refused.
:Soft spheres: Touching balls have (-0.071, 0.076, 0.995) at any speed. An overlap of 0.15 µm gives
    (-0.073, 0.079, 0.994) at 1 m/s and (-0.159, 0.175, 0.984) at 1 cm/s, because the energy of the overlap is released.
    Gaps of 10 µm at 1 cm/s give (0, 0, 1).
:New: There is a right outcome for touching balls, which no rule gives. Rounding matters only below some cm/s: the
    largest overlap in a collision is 27 µm at 1 m/s and 0.67 µm at 1 cm/s.
:Read: The beginning of that thread. The papers are quoted from memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

TIE_RULES = ("left", "right", "random", "newton", "poisson", "reflect")
ROUNDING_OVERLAP = 1.5e-7


def row(gap, speed=1.0):
    """Three steel balls of one inch, the first of which moves."""
    mass = 4.0 / 3.0 * np.pi * 0.0127**3 * gr.materials.steel.density
    return gr.Scene([mass] * 3, [0.0127] * 3, [gap] * 2, [speed, 0.0, 0.0])


def hard_speeds(ties):
    """Final speeds of touching hard balls under a tie rule."""
    return gr.edmd.simulate(row(0.0), gr.ConstantRestitution(1.0), ties=ties).velocity[-1]


def soft_speeds(gap, speed=1.0):
    """Final speeds of soft balls, in units of the initial speed.

    Negative gaps are overlaps.
    """
    scene = row(gap, speed)
    law = [gr.Hertz.from_material(*gr.materials.steel, pair) for pair in scene.pairs]
    return gr.md.simulate(scene, law, until=gr.until.separated()).velocity[-1] / speed


def largest_overlap(speed):
    """Largest overlap in m in a collision of two such balls."""
    pair = row(1.0).pairs[0]
    return gr.binary.collision(gr.Hertz.from_material(*gr.materials.steel, pair), pair, speed).xi_max


if __name__ == "__main__":
    for ties in TIE_RULES:
        print(f"hard, ties = {ties:8}", hard_speeds(ties).round(4))
    for gap, speed in ((0.0, 1.0), (-ROUNDING_OVERLAP, 1.0), (-ROUNDING_OVERLAP, 0.01), (1e-5, 0.01)):
        overlap = f"largest overlap {1e6 * largest_overlap(speed):.2f} µm"
        print(f"gap {1e6 * gap:5.2f} µm, {speed:g} m/s:", soft_speeds(gap, speed).round(4), overlap)
    plt.style.use("granular.journal")
    figure, axis = plt.subplots(figsize=(4.6, 2.7), layout="constrained")
    gaps = np.concatenate([np.linspace(-4e-7, 1e-6, 43), np.geomspace(1e-6, 1e-4, 25)])
    for speed, colour in ((1.0, "#1f4e79"), (0.1, "#4f81b0"), (0.01, "#9dbfe0")):
        axis.plot(1e6 * gaps, [soft_speeds(gap, speed)[1] for gap in gaps], color=colour, label=f"soft, {speed:g} m/s")
    axis.axvline(-1e6 * ROUNDING_OVERLAP, color="black", lw=1.0, ls="--")
    axis.axhline(0.0, color="#c1440e", label="hard, successive: 0")
    axis.plot([], [], color="#c1440e", ls=":", label="hard, simultaneous: 0.667, off the scale")
    axis.text(-1.5e6 * ROUNDING_OVERLAP, 0.122, "overlap 0.15 µm", ha="right", rotation=90)
    axis.set(xlabel="gap (µm)", ylabel="speed of the middle ball / striker", xlim=(-0.45, 100.0), ylim=(-0.01, 0.2))
    axis.set_xscale("symlog", linthresh=1.0)
    axis.set_xticks((0.0, 1.0, 10.0, 100.0), ("0", "1", "10", "100"))
    axis.legend()
    figure.savefig("touching.png")
