"""Newton's cradle: the gap at which the textbook result holds

Five steel balls of one inch hang side by side, and one of them hits the others at 0.15 m/s. In the textbook the last
ball leaves alone with the same speed. This result is tested for different gaps between the balls.

:Published: Rows of touching balls break up at the first impact, and later swing in phase (Herrmann & Schmälzle, Am. J.
    Phys. 49, 761 (1981); Hutzler, Delaney, Weaire & MacLeod, Am. J. Phys. 72, 1508 (2004)). In a long row the first
    ball keeps -0.071 of the speed, and the last two leave with 0.149 and 0.986 (Hinch & Saint-Jean, Proc. R. Soc. A
    455, 3201 (1999)).
:Hard spheres: The textbook result for any gap. Without a gap the rule for simultaneous collisions decides.
:Soft spheres: -0.071085, 0.148600 and 0.985679 in a long row. The fourth of five balls has 0.127 of the speed if the
    balls touch, 0.042 at gaps of 1 µm, 0.006 at 3 µm, and 0 at 10 µm. The striker moves 17 µm in the time of a contact.
    With ε = 0.98, 0.34 of the energy is left after 20 periods if the balls touch, 0.23 at gaps of 10 µm, and 0.21 with
    hard spheres.
:New: Six digits of the outcome, and the minimum gap: at 10 µm, a tenth of a hair's width, the textbook result holds.
    The cradle then loses its energy faster.
:Read: The web page of the Dublin group on their paper of 2004. The other papers are quoted from memory. Air drag is
    neglected.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

IMPACT_SPEED, BALL_MASS = 0.15, 0.0673
SWING_PERIOD = 2.0 * math.pi / math.sqrt(9.81)
STEEL = gr.materials.steel


def speeds_after_impact(gap, speed=IMPACT_SPEED):
    """Speeds of five balls after the impact, in units of the striker's speed."""
    scene = gr.scenes.newtons_cradle(5, gap=gap, speed=speed, mass=BALL_MASS)
    run = gr.md.simulate(scene, gr.Hertz.from_material(*STEEL, scene.pairs[0]), until=gr.until.separated())
    return run.velocity[-1] / speed


def long_row(n):
    """Speeds of a long row of touching balls, in units of the striker's speed."""
    run = gr.md.simulate(gr.scenes.newtons_cradle(n), gr.Hertz(k=1e9), until=gr.until.separated())
    return run.velocity[-1]


def swing_energy(gap, periods, engine=gr.md):
    """Energy at every half period of pendula 1 m long with ε = 0.98, over its start."""
    amplitude = IMPACT_SPEED * SWING_PERIOD / (2.0 * math.pi)
    scene = gr.scenes.pendulum_cradle(5, amplitude=amplitude, mass=BALL_MASS, rest_gap=gap)
    soft = gr.ViscoelasticHertz.from_material(*STEEL, restitution=0.98, speed=IMPACT_SPEED, pair=scene.pairs[0])
    law = soft if engine is gr.md else gr.ConstantRestitution(0.98)
    run = engine.simulate(scene, law, t_end=periods * SWING_PERIOD, samples=2 * periods + 1)
    return run.energy() / run.energy()[0]


if __name__ == "__main__":
    for gap in (0.0, 1e-6, 3e-6, 1e-5):
        print(f"gaps {1e6 * gap:2.0f} µm: speeds", *(f"{speed:8.4f}" for speed in speeds_after_impact(gap)))
    print("30 touching balls: first", long_row(30)[0].round(6), "last", long_row(30)[-2:].round(6))
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2), layout="constrained")
    gaps, blue = np.geomspace(1e-7, 4e-5, 21), ("#1f4e79", "#6f9fc8")
    for speed, line, colour in zip((1.0, IMPACT_SPEED), ("--", "-"), blue[::-1], strict=True):
        fourth = [speeds_after_impact(gap, speed)[3] for gap in gaps]
        axes[0].semilogx(1e6 * gaps, fourth, line, color=colour, label=f"{speed:g} m/s")
    axes[0].set(title="(a)", xlabel="gaps between steel balls (µm)", ylabel="speed of the fourth ball / striker")
    for gap, colour in zip((0.0, 1e-6, 1e-5), (*blue, "#c8963e"), strict=True):
        name = f"soft, gaps {1e6 * gap:.0f} µm"
        axes[1].plot(np.arange(0, 20.5, 0.5), swing_energy(gap, 20), color=colour, label=name)
    axes[1].plot(np.arange(0, 20.5, 0.5), swing_energy(0.0, 20, gr.edmd), ":", color="#c1440e", label="hard")
    axes[1].set(title="(b)", xlabel="periods", ylabel="energy / initial energy", ylim=(0.0, 1.02))
    for axis in axes:
        axis.set_xticks(*(((0.1, 1, 10), ("0.1", "1", "10")) if axis is axes[0] else (range(0, 21, 5),)))
        axis.legend()
    figure.savefig("cradle.png")
