"""Clumps far from a hot wall in gases of hard and of soft spheres

Points with N (1 - ε) = 1 lie in a box of 1 m between a hot wall with a thermal speed of 1 m/s and an elastic wall. Heat
enters at one end. Two numbers describe the steady state: the spread of all balls except the first in m (0.29 for a
uniform distribution), and the energy share of the first ball.

:Published: However close ε is to 1, almost all balls move slowly in a clump at the far wall. The first ball moves
    between wall and clump with nearly all the energy. Hydrodynamics has no such state (Du, Li & Kadanoff, Phys. Rev.
    Lett. 74, 1268 (1995)).
:Hard spheres: 20 balls have a spread of 0.012 ± 0.001 (32 draws) and a share of 0.965 ± 0.007: a clump, which opens now
    and then. No remedy is needed. Elastic collisions below 0.01 m/s give 0.015 ± 0.001. Merging below 0.01 m/s gives
    0.001 in most draws.
:Soft spheres: Contacts of 0.3 ms give 0.133 ± 0.002 and 0.41 ± 0.01, whether the balls start as a clump or as a
    gas. Contacts of 30 μs, as of steel balls of 1 cm at 1 m/s, give 0.067 ± 0.003 and 0.66 ± 0.02. The clump of hard
    spheres appears at 0.3 μs: 0.013 ± 0.001.
:TC model: Contacts of 0.3 ms give 0.055 ± 0.002 and 0.81 ± 0.01, contacts of 30 μs 0.026 ± 0.001. These values lie
    between both models, and there is still a clump.
:New: Collisions without duration cause the clump. A share of 0.4 of its gaps is smaller than the distance that a ball
    at 1 m/s covers in 0.3 ms. A ball that hits 19 nearly touching balls leaves 0.164 of its energy in soft balls,
    0.0002 in hard balls and 0.0006 in the TC model. More balls need shorter contacts: 50 balls with ε = 0.98 and 0.3 μs
    have a spread of 0.053 ± 0.005, hard balls 0.008 ± 0.002.
:Read: The paper was not read. It is quoted from memory and from the first lines about it in Puglisi's thesis, where the
    hot wall gives Gaussian speeds. Here the speeds follow the flux. The abstract of Eshuis et al., Phys. Rev. E 80,
    011302 (2009), was read.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr


def case(scene, lasts, **how):
    """Balls of 1 kg, N (1 - ε) = 1, duration `lasts` to 1 %, elastic last wall."""
    eps, k = [1.0 - 1.0 / np.isfinite(scene.mass).sum()] * (scene.n_pairs - 1) + [1.0], 0.5 * (np.pi / lasts) ** 2
    laws = [gr.LinearDashpot.from_restitution(e, k, pair) for e, pair in zip(eps, scene.pairs, strict=True)]
    return gr.Case(scene, laws, [gr.ConstantRestitution(e) for e in eps], **how)


def box(lasts, remedy, seed=0, n=20, start=300.0, end=1200.0):
    """Points between a hot and an elastic wall, sampled in the steady state."""
    scene = gr.scenes.heated_gas(n, 1.0, 0.0, lower=1.0, seed=seed).replace(ceiling=None)
    run = {"samples": np.linspace(start, end, 201), "log": False, "max_events": 10**8, "engine": "compiled", **remedy}
    return case(scene, lasts, t_end=end, run=run)


def spread(run):
    """Standard deviation of all positions except the first, averaged over time."""
    return run.position[:, 2:-1].std(axis=1).mean()


def first_share(run):
    """Energy share of the ball beside the hot wall."""
    return (run.velocity[:, 1] ** 2).sum() / (run.velocity[:, 1:-1] ** 2).sum()


def row_energy(engine, gap=1e-6, n=20, lasts=1e-3, **remedy):
    """Energy share left in a row before a wall, for gaps in speed × duration."""
    scene = gr.Scene([1.0] * n + [np.inf], [0.0] * (n + 1), [gap * lasts] * n, [1.0] + [0.0] * n)
    return (case(scene, lasts).simulate(engine, **remedy).velocity[-1, 1:] ** 2).sum()


if __name__ == "__main__":
    print("energy left in the row: soft, hard, TC:", row_energy("md"), row_energy("edmd"), row_energy("edmd", tc=1e-3))
    cases = [(3e-4, {}), (3e-4, {"elastic_below": 0.01}), (3e-4, {"collapse": "merge", "merge_below": 0.01}),
             *((lasts, {"tc": lasts}) for lasts in (3e-2, 3e-3, 3e-4, 3e-5, 3e-6, 3e-7))]
    found = [gr.ensemble(box, 8, "seed", [spread, first_share], lasts=lasts, remedy=remedy) for lasts, remedy in cases]
    print(*(f"contacts of {x[0]:g} s, hard {x[1]}: {one}" for x, one in zip(cases, found, strict=True)), sep="\n\n")
    plt.style.use("granular.journal")
    figure, axes = plt.subplot_mosaic("ac;bc", figsize=(7, 3.4), width_ratios=(1.0, 1.1), layout="constrained")
    for place, engine, name, colour in (("a", "edmd", "hard", "#c1440e"), ("b", "md", "soft", "#1f4e79")):
        run = box(3e-4, {}, start=500.0, end=515.0).simulate(engine)
        axes[place].plot(run.time - 500.0, run.position[:, 2:-1], color=colour, lw=0.8)
        axes[place].plot(run.time - 500.0, run.position[:, 1], color="black", lw=1.5)
        axes[place].set(title=f"({place}) {name}", xlabel="time (s)", yticks=(0, 1), yticklabels=("hot", "elastic"))
    named = ("-", 0.77, "hard, no remedy"), (":", 1.1, "hard, elastic below 0.01 m/s"), ("--", 1.1, "hard, merged")
    for (style, place, name), one in zip(named, found, strict=False):
        axes["c"].axhline(one.quantities[0].means[0], color="#c1440e", ls=style)
        axes["c"].text(4e-2, place * one.quantities[0].means[0], name, color="#c1440e", ha="right")
    for which, name, colour in ((0, "TC model", "#c8963e"), (1, "soft", "#1f4e79")):
        means = [(one.quantities[0].means[which], one.quantities[0].errors[which]) for one in found[3:]]
        axes["c"].errorbar([lasts for lasts, _ in cases[3:]], *np.array(means).T, fmt="o-", color=colour, label=name)
    axes["c"].set(title="(c)", xscale="log", yscale="log", xlabel="contact duration (s)", ylabel="spread (m)")
    axes["c"].legend()
    figure.savefig("clumps.png")
