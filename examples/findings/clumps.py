"""Clumps beside a hot wall: there only if contacts are short

Inelastic points between a hot wall and a cold, elastic end. Hydrodynamics expects a smooth density; what do they do?

:Published: All but one of them crowd in a clump at the far end; one fast ball flies to and fro between the hot wall and
    the clump: hydrodynamics breaks down (Du, Li & Kadanoff, Phys. Rev. Lett. 74, 1268 (1995)).
:Hard spheres: So do ten balls of ε = 0.9, those that merge below 1 mm/s: the nine others stand within 0.021 ± 0.003 m
    (standard deviation of their places; 16 draws). Elastic below 1 mm/s: the same. The TC model with cut-offs of
    10⁻⁶, 10⁻⁵, 10⁻⁴, 10⁻³, 10⁻² s: 0.022 0.023 0.033 0.072 0.129 m.
:Newton: With contacts of 10⁻⁶, 10⁻⁵, 10⁻⁴, 10⁻³, 10⁻² s: 0.023 0.023 0.037 0.086 0.144 m. In a clump contacts overlap
    in time, and balls that are pressed together lose less. Within 1 cm, are hard balls right? Those that merge yes at
    10⁻⁵ s, no from 10⁻⁴ s on, a ten-thousandth of the time of a flight; those of the TC model, cut off at a contact's
    duration, yes up to 10⁻⁴ s, and above that 16 draws cannot tell.
:New: Up to which contact duration the clump is there; here TC follows Newton, as it does not where a column hits a wall
    (detachment).
:Read: Nothing: the paper's claim is from memory; its text was not to be had.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

N, EPS, END, DRAWS = 10, 0.9, 400.0, 16
TIMES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def box(seed):
    """Points of 1 kg at random in a box of 1 m; its floor has a temperature of 1 J, its ceiling takes no energy."""
    draw = np.random.default_rng(seed)
    gap, v = np.diff(np.sort([0.0, 1.0, *draw.uniform(size=N)])), draw.normal(size=N)
    mass = [math.inf, *[1.0] * N, math.inf]
    return gr.Scene(mass, [0.0] * (N + 2), gap, [0.0, *v, 0.0], floor=gr.walls.Thermal(1.0, seed))


def gas(seed, duration=1e-3, **options):
    """The box, with contacts of equal balls that last so long (s), and what hard spheres need to go on."""
    scene, k, eps = box(seed), 0.5 * (math.pi / duration) ** 2, [EPS] * N + [1.0]
    law = [gr.LinearDashpot.from_restitution(e, k, pair) for e, pair in zip(eps, scene.pairs, strict=True)]
    run = {"samples": np.linspace(0.5 * END, END, 400), "max_events": 10**7, "log": False} | options
    return gr.Case(scene, law, gr.ConstantRestitution(eps), t_end=END, run=run)


def spread(run):
    """Mean over time of the standard deviation of all places but that of the first ball, m."""
    return run.position[:, 2:-1].std(axis=1).mean()


def ensemble(duration, draws=DRAWS, **options):
    """Spreads of hard and of soft balls; are their means the same to 1 cm?"""
    return gr.ensemble(lambda seed: gas(seed, duration, **options), draws, "seed", spread, margin={"spread": 0.01})


if __name__ == "__main__":
    plt.rcParams.update({"font.size": 14, "legend.frameon": False})
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(14.0, 4.8), layout="constrained")
    times = np.linspace(END - 12.0, END, 4000)
    for axis, engine, title in ((left, "edmd", "hard: one flies, nine clump"), (middle, "md", "contacts of 10 ms")):
        run = gas(1, 1e-2, collapse="merge", samples=times).simulate(engine)
        axis.plot(run.time - times[0], run.position[:, 1:-1], color="#8a8f98", lw=1.0)
        axis.plot(run.time - times[0], run.position[:, 1], color="#c1440e", lw=2.0)
        axis.set(title=title, xlabel="t / s", ylabel="place / m", ylim=(0.0, 1.02))
    merged = [("merging", duration, ensemble(duration, collapse="merge", merge_below=1e-3)) for duration in TIMES[2:4]]
    cut = [("TC", duration, ensemble(duration, tc=duration)) for duration in TIMES]
    for name, duration, found in merged + cut:
        (hard, soft), (error, other) = found.worst.means, found.worst.errors
        print(f"{name}, {duration:g} s: {found.answer.name}; {hard:.3f} ± {error:.3f}, soft {soft:.3f} ± {other:.3f}")
    for which, mark, colour, said in ((1, "o", "#1f4e79", "soft"), (0, "s", "#c8963e", "TC model, as long")):
        told = np.array([[one.worst.means[which], one.worst.errors[which]] for *_, one in cut])
        right.errorbar(TIMES, *told.T, fmt=mark + "-", ms=8, color=colour, label=said)
    right.axhline(merged[0][-1].worst.means[0], color="#c1440e", lw=2.0, label="hard, merging")
    right.set(xscale="log", xlabel="contact duration / s", ylabel="spread of nine balls / m", ylim=(0.0, 0.16))
    right.legend(loc="upper left")
    figure.savefig("clumps.png")
