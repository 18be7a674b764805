"""Detachment effect: energy loss of touching balls in three models

Ten balls with equal gaps s₀ are thrown at a wall with speed v. Each isolated contact has ε = 0.9 and lasts t_c. The
energy left after the separation of all balls is compared.

:Published: Soft spheres dissipate less energy than hard spheres if many contacts overlap in time, the *detachment
    effect* (Luding, Clément, Blumen, Rajchenbach & Duran, Phys. Rev. E 50, 4113 (1994)). The *TC model* corrects this:
    a collision is elastic if one of its balls has collided less than t_c before (Luding & McNamara, Granular Matter 1,
    113 (1998)).
:Hard spheres: 0.108 of the energy for any gap.
:TC model: 0.98 below 1.9 v t_c, where only one collision dissipates energy. Another t_c only shifts this curve.
:Soft spheres: 0.930 as s₀ → 0, 0.64 at 0.3 v t_c, 0.19 at 1, 0.108 from 2 on. From 2.4 on every contact is isolated.
:New: The TC model is more accurate than plain hard spheres only up to 0.39 v t_c, also with random gaps. No value of
    t_c is right.
:Read: The abstract of the paper of 1998. The paper of 1994 is quoted from memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

N, EPS, K = 10, 0.9, 1e6
HARD_RULE = gr.ConstantRestitution(EPS)
MODEL_COLOURS = {"soft spheres": "#1f4e79", "TC model": "#c8963e", "hard spheres": "#c1440e"}


def laws(scene):
    """Dashpots with one ε in all contacts."""
    return [gr.LinearDashpot.from_restitution(EPS, k=K, pair=pair) for pair in scene.pairs]


COLUMN_SCENE = gr.scenes.column(N)
T_C = gr.binary.collision(laws(COLUMN_SCENE)[-1], COLUMN_SCENE.pairs[-1], speed=1.0).duration


def energy_left(gaps):
    """Energy shares left with soft spheres, the TC model and hard spheres.

    Gaps are in v t_c, the gap above the floor first.
    """
    scene = gr.scenes.column(N, gap=np.broadcast_to(gaps, N) * T_C)
    hard = [gr.edmd.simulate(scene, HARD_RULE, **options) for options in ({"tc": T_C}, {})]
    runs = [gr.md.simulate(scene, laws(scene)), *hard]
    return [run.energy()[-1] / run.energy()[0] for run in runs]


if __name__ == "__main__":
    print("s0 / v t_c     soft      TC    hard")
    for gap in (1e-6, 0.1, 0.3, 1.0, 3.0, 10.0):
        print(f"{gap:10g}", *(f"{part:8.4f}" for part in energy_left(gap)))
    equal, apart = np.geomspace(0.03, 30.0, 31), np.geomspace(0.1, 30.0, 6)
    of_equal, draws = np.array([energy_left(gap) for gap in equal]), np.random.default_rng(1).exponential(size=(12, N))
    of_drawn = np.array([[energy_left(gap * draw) for draw in draws] for gap in apart])
    limit = np.interp(-0.544, -of_equal[:, 0], equal)  # 0.544: mean of the hard and of the TC energy
    print(f"the TC model is more accurate than hard spheres up to s0 = {limit:.2f} v t_c")

    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), sharey=True, layout="constrained")
    for column, (colour, mark) in enumerate(zip(MODEL_COLOURS.values(), "os^", strict=True)):
        axes[0].plot(equal, of_equal[:, column], mark, ls="-", markevery=3, color=colour)
        error = of_drawn[:, :, column].std(axis=1, ddof=1) / len(draws) ** 0.5
        axes[1].errorbar(apart, of_drawn[:, :, column].mean(axis=1), error, color=colour, fmt=mark + "-")
    for text, *place in (("soft spheres", 0.035, 0.7), ("TC model", 0.45, 1.01), ("hard spheres", 0.035, 0.03)):
        axes[0].text(*place, text, color=MODEL_COLOURS[text])
    axes[0].set(title="(a) equal gaps $s_0$", ylabel="energy left, $E/E_0$", ylim=(0.0, 1.08))
    axes[1].set(title="(b) random gaps, mean $s_0$")
    axes[1].tick_params(labelleft=True)
    plt.setp(axes, xscale="log", xticks=(0.1, 1.0, 10.0), xticklabels=("0.1", "1", "10"))
    figure.supxlabel("gap, $s_0/(v\\,t_c)$")
    figure.savefig("detachment.png")
