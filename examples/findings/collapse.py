"""Inelastic collapse near its threshold formula

N balls on a line approach each other. Below some ε they collide infinitely often in a finite time. A published formula
for this threshold is tested.

:Published: ε_N = tan²(π/4 (1 - 2/N)), the threshold of N/2 balls and a wall (Bernu & Mazighi, J. Phys. A 23, 5745
    (1990)). It is 7 - 4√3 = 0.0718 for three balls (McNamara & Young, Phys. Fluids A 4, 496 (1992)).
:Hard spheres: The formula holds for N = 3 and 4. Below it, a collapse is proved. Above it, there are up to hundreds of
    collisions, for three balls 2π/θ collisions with cos θ = (1 + ε)²/8ε - 1. Six balls still have a proved collapse at
    1.001 ε_N, where a sequence of 32 collisions repeats forever, and at 1.005 ε_N. Eight balls separate after 422 to
    712 collisions at 0.999 ε_N.
:Soft spheres: No collapse. Three balls separate after 7 to 23 contacts, eight balls after 46 to 83 contacts.
:New: To our knowledge, it is new that the threshold differs from the formula for N = 6 and 8. The runs are exact to the
    last collision. It also differs for N = 5, whose balls separate at 0.999 ε_N after 769 to 1526 collisions, in
    arithmetic of 1200 digits.
:Read: The abstracts of McNamara & Young, of Zhou & Kadanoff, mtrl-th/9604003, for three balls, and of Dolmaire &
    Hübner-Rosenau, arXiv:2411.10324, with other patterns for four balls. The formula is quoted from memory. As far as
    we remember, it was derived for one pattern of collisions in which all balls take part in turn.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

STATUS_COLOURS = {"collapse": "#c1440e", "bounded": "#d9d4cc", "quiet": "#1f4e79"}


def critical_restitution(n):
    """Threshold ε_N of the formula."""
    return math.tan(math.pi / 4.0 * (1.0 - 2.0 / n)) ** 2


def random_balls(n, seed):
    """Points at random positions, each approaching its neighbours."""
    draw = np.random.default_rng([seed, n])
    return gr.Scene([1.0] * n, [0.0] * n, draw.uniform(0.5, 1.5, n - 1), np.sort(draw.normal(size=n))[::-1])


def run_to_end(n, beyond, seed, engine=gr.edmd):
    """Status at ε = (1 + beyond) ε_N, and number of collisions or soft contacts."""
    scene, eps = random_balls(n, seed), critical_restitution(n) * (1.0 + beyond)
    soft = [gr.LinearDashpot.from_restitution(eps, 1e6, pair) for pair in scene.pairs]
    run = engine.simulate(scene, soft if engine is gr.md else gr.ConstantRestitution(eps))
    return run.status.name, len(run.contacts)


def three_ball_collisions(beyond):
    """Number of collisions of three balls above ε_3, to within one or two."""
    eps = critical_restitution(3) * (1.0 + beyond)
    return 2.0 * math.pi / np.arccos((1.0 + eps) ** 2 / (8.0 * eps) - 1.0)


if __name__ == "__main__":
    steps, above = (-0.03, -0.01, -0.001, 0.001, 0.01, 0.03), np.geomspace(3e-3, 0.3, 15)
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.9), layout="constrained")
    for n in range(3, 9):
        for place, beyond in enumerate(steps):
            ends = [run_to_end(n, beyond, seed) for seed in range(4)]
            print(f"N = {n}, {1.0 + beyond:.3f} ε_N:", *(f"{count} ({name})" for name, count in ends))
            for turn, (name, _) in enumerate(sorted(ends)):
                axes[0].plot(place + 0.18 * (turn - 1.5), n, "s", color=STATUS_COLOURS[name], ms=4)
    for name, colour in STATUS_COLOURS.items():
        axes[0].plot([], [], "s", color=colour, ms=4, label=name)
    labels = ("−3", "−1", "−0.1", "+0.1", "+1", "+3")
    axes[0].set(title="(a)", xticks=range(6), xticklabels=labels, ylim=(2.5, 8.5), ylabel="balls")
    axes[0].axvline(2.5, color="black", lw=1.0, ls="--")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    for n, colour in ((8, "#c8963e"), (4, "#6f9fc8"), (3, "#1f4e79")):
        counts = [run_to_end(n, beyond, 0)[1] for beyond in above]
        axes[1].loglog(100.0 * above, counts, "o", color=colour, ms=4, label=f"{n} balls")
    axes[1].loglog(100.0 * above, three_ball_collisions(above), color="#1f4e79", label="2π/θ")
    axes[1].set(title="(b)", xticks=(1, 10), xticklabels=(1, 10), ylabel="collisions until separation")
    axes[1].legend()
    figure.supxlabel("ε above the formula (%)")
    figure.savefig("collapse.png")
