"""Shock-like cooling: soft spheres are in the class, without a cut-off

Points on a ring, at random places with random velocities, lose energy whenever two of them meet. How does the energy
fall with time, and does ε matter?

:Published: First like (1 + t/τ)⁻², but soon like t^(-2/3) for every ε < 1, as in the gas of points that stick at once
    (Ben-Naim, Chen, Doolen & Redner, Phys. Rev. Lett. 83, 4069 (1999)). Hard spheres need a speed below which they are
    elastic, or they collide forever.
:Hard spheres: Sticking, 30 000 points: exponent -0.669 ± 0.004 over t = 10 … 2000 (8 draws). With ε = 0.5 seven of
    eight draws of 60 points collapse, bounded, not proved, at t = 4 to 14; elastic below 3 mm/s they go on.
:Newton: ε = 0.5, contacts of 2 ms: nothing has to be cut off. Over 24 draws of 60 points the energy left at t = 16 is
    0.0595, that of hard ones 0.0594: the same within a tenth of a standard deviation (8 draws leave that undecided).
    Eight draws have 5809 contacts and 27 586 collisions: where a crowd pushes at once, one contact is many of them.
:New: Soft spheres cool as hard ones do and need no cut-off: with a margin, and events counted on either side.
:Read: The abstract and the first page.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

ELASTIC_SPEED = 3e-3
OUTPUT_TIMES = (1.0, 2.0, 4.0, 8.0, 16.0)


def ring(n, seed):
    """Points, one a metre on the average, with velocities of mean square 1 m²/s²."""
    return gr.scenes.ring_gas(n, float(n), packing=1e-9, seed=seed)


def sticking_energy(n, seed, times):
    """Energy at these times in units of the first, of points that stick together."""
    run = gr.edmd.simulate(ring(n, seed), gr.ConstantRestitution(0.0), t_end=times[-1], samples=[0.0, *times],
                           log=False, max_events=10**7)
    return run.energy()[1:] / run.energy()[0]


def cooling_exponent(n, seed, last):
    """δ of E ~ t^δ from t = 10 to the last time, of sticking points."""
    times = np.geomspace(10.0, last, 25)
    return np.polyfit(np.log(times), np.log(sticking_energy(n, seed, times)), 1)[0]


def gas(seed, n=60, end=16.0):
    """Points with ε = 0.5, soft ones and hard ones that are elastic below 3 mm/s."""
    scene = ring(n, seed)
    laws = [gr.LinearDashpot.from_restitution(0.5, 1e6, pair) for pair in scene.pairs]
    return gr.Case(scene, laws, gr.ConstantRestitution(0.5), t_end=end,
                   run={"elastic_below": ELASTIC_SPEED, "max_events": 10**7})


def cooling_ensemble(end, draws=24):
    """Ensemble of the energy left, of soft and of hard points."""
    return gr.ensemble(gas, draws, "seed", "energy_left", end=end)


if __name__ == "__main__":
    found = [cooling_exponent(30_000, seed, 2000.0) for seed in range(8)]
    print(f"sticking: exponent {np.mean(found):.3f} ± {np.std(found, ddof=1) / len(found) ** 0.5:.3f}")
    ensembles = [cooling_ensemble(end) for end in OUTPUT_TIMES]
    print(ensembles[-1])
    plt.rcParams.update({"font.size": 14, "lines.linewidth": 3.0, "legend.frameon": False})
    figure, axis = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
    times = np.geomspace(0.3, 300.0, 40)
    axis.loglog(times, sticking_energy(30_000, 0, times), color="#c8963e", label="hard, sticking, 30 000 points")
    axis.loglog(times[18:], 0.30 * times[18:] ** (-2.0 / 3.0), ":", color="black", lw=2.0)
    axis.text(20.0, 0.018, "$t^{-2/3}$")
    for name, colour, shift, mark in (("hard", "#c1440e", 0.96, "s"), ("soft", "#1f4e79", 1.04, "o")):
        which = ("hard", "soft").index(name)
        rows = np.array([[one.worst.means[which], one.worst.errors[which]] for one in ensembles])
        axis.errorbar(shift * np.array(OUTPUT_TIMES), *rows.T, fmt=mark, ms=9, color=colour, label=f"{name}, ε = 0.5")
    axis.set(xlabel="time, mean distance / speed", ylabel="energy left, E / E₀")
    axis.legend(loc="lower left")
    figure.savefig("cooling.png")
