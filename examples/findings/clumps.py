"""Clumps far from a hot wall: hard spheres make them, Newton hardly

Points, N (1 - ε) = 1, in a box of 1 m between a hot wall, thermal speed 1 m/s, and an elastic one: heat comes in at one
end. How far are all balls but the first spread, in m (0.29 if evenly), and what share of the energy has the first?

:Published: Be ε ever so near to 1, almost all balls crawl in a clump at the far wall, the first one commutes with
    nearly all the energy, and hydrodynamics has no such state (Du, Li & Kadanoff, Phys. Rev. Lett. 74, 1268 (1995)).
:Hard spheres: 20 balls spread over 0.012 ± 0.001 (32 draws), the share is 0.965 ± 0.007: a clump, which opens now and
    then. No remedy is needed; elastic below 0.01 m/s: 0.015 ± 0.001; merged below that: most draws have 0.001.
:Newton: Contacts of 0.3 ms: 0.133 ± 0.002 and 0.41 ± 0.01, from a clump as from a gas. Of 30 μs, as steel balls of 1 cm
    have at 1 m/s: 0.067 ± 0.003 and 0.66 ± 0.02. The clump of hard spheres comes at 0.3 μs: 0.013 ± 0.001.
:TC model: Contacts of 0.3 ms: 0.055 ± 0.002 and 0.81 ± 0.01; 30 μs: 0.026 ± 0.001. Half-way, and still a clump.
:New: The clump is made by collisions without duration. Of its gaps 0.4 are less than a ball at 1 m/s goes in 0.3 ms;
    and a ball that hits 19 nearly touching ones leaves 0.164 of its energy among them, hard ones 0.0002, TC 0.0006.
    More balls need shorter contacts: 50 with ε = 0.98 and 0.3 μs have 0.053 ± 0.005, hard ones 0.008 ± 0.002.
:Read: Not the paper, which is quoted from memory and from the first lines on it in Puglisi's thesis, where the hot
    wall gives Gaussian speeds; here, of the flux. And the abstract of Eshuis et al., Phys. Rev. E 80, 011302 (2009).
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr


def case(scene, lasts, **how):
    """N balls of 1 kg with N (1 - ε) = 1, in contacts of that duration, to 1 %; the last wall is elastic."""
    eps, k = [1.0 - 1.0 / np.isfinite(scene.mass).sum()] * (scene.n_pairs - 1) + [1.0], 0.5 * (np.pi / lasts) ** 2
    laws = [gr.LinearDashpot.from_restitution(e, k, pair) for e, pair in zip(eps, scene.pairs, strict=True)]
    return gr.Case(scene, laws, [gr.ConstantRestitution(e) for e in eps], **how)


def box(lasts, remedy, seed=0, n=20, start=300.0, end=1200.0):
    """Points between a hot wall and an elastic one, in rows from a time at which all have forgotten how they began."""
    scene = gr.scenes.heated_gas(n, 1.0, 0.0, lower=1.0, seed=seed).replace(ceiling=None)
    run = {"samples": np.linspace(start, end, 201), "log": False, "max_events": 10**8, "engine": "compiled", **remedy}
    return case(scene, lasts, t_end=end, run=run)


def spread(run):
    """Standard deviation of the places of all balls but the first, the mean of all rows."""
    return run.position[:, 2:-1].std(axis=1).mean()


def first_share(run):
    """Share of the energy that the ball beside the hot wall has."""
    return (run.velocity[:, 1] ** 2).sum() / (run.velocity[:, 1:-1] ** 2).sum()


def row_energy(engine, gap=1e-6, n=20, lasts=1e-3, **remedy):
    """Share of its energy that a ball leaves in a row before a wall; gaps in ways of the ball in a contact."""
    scene = gr.Scene([1.0] * n + [np.inf], [0.0] * (n + 1), [gap * lasts] * n, [1.0] + [0.0] * n)
    return (case(scene, lasts).simulate(engine, **remedy).velocity[-1, 1:] ** 2).sum()


if __name__ == "__main__":
    print("energy left in the row: soft, hard, TC:", row_energy("md"), row_energy("edmd"), row_energy("edmd", tc=1e-3))
    cases = [(3e-4, {}), (3e-4, {"elastic_below": 0.01}), (3e-4, {"collapse": "merge", "merge_below": 0.01}),
             *((lasts, {"tc": lasts}) for lasts in (3e-2, 3e-3, 3e-4, 3e-5, 3e-6, 3e-7))]
    found = [gr.ensemble(box, 8, "seed", [spread, first_share], lasts=lasts, remedy=remedy) for lasts, remedy in cases]
    print(*(f"contacts of {x[0]:g} s, hard {x[1]}: {one}" for x, one in zip(cases, found, strict=True)), sep="\n\n")
    plt.rcParams.update({"font.size": 14, "lines.linewidth": 2.5, "legend.frameon": False})
    figure, axes = plt.subplot_mosaic("ac;bc", figsize=(12.5, 5.6), width_ratios=(1.0, 1.1), layout="constrained")
    for place, engine, name, colour in (("a", "edmd", "hard spheres", "#c1440e"), ("b", "md", "Newton", "#1f4e79")):
        run = box(3e-4, {}, start=500.0, end=515.0).simulate(engine)
        axes[place].plot(run.time - 500.0, run.position[:, 2:-1], color=colour, lw=0.8)
        axes[place].plot(run.time - 500.0, run.position[:, 1], color="black", lw=1.5)
        axes[place].set(title=name, xlabel="time, s", xlim=(0, 15), yticks=(0, 1), yticklabels=("hot", "elastic"))
    named = ("-", 0.77, "hard, no remedy"), (":", 1.1, "hard, elastic below 0.01 m/s"), ("--", 1.1, "hard, merged")
    for (style, place, name), one in zip(named, found, strict=False):
        axes["c"].axhline(one.quantities[0].means[0], color="#c1440e", ls=style)
        axes["c"].text(4e-2, place * one.quantities[0].means[0], name, color="#c1440e", ha="right")
    for which, name, colour in ((0, "TC model", "#c8963e"), (1, "Newton", "#1f4e79")):
        means = [(one.quantities[0].means[which], one.quantities[0].errors[which]) for one in found[3:]]
        axes["c"].errorbar([lasts for lasts, _ in cases[3:]], *np.array(means).T, fmt="o-", color=colour, label=name)
    axes["c"].set(xscale="log", yscale="log", xlabel="duration of a contact, s", ylabel="spread, m", ylim=(1e-3, 0.4))
    axes["c"].legend()
    figure.savefig("clumps.png")
