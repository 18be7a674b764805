"""Shock-like cooling: soft spheres without a cut-off speed

Points on a ring, at random positions with random velocities, lose energy in every collision. The decay of energy with
time is measured, and its dependence on ε.

:Published: The energy decays first like (1 + t/τ)⁻², but soon like t^(-2/3) for every ε < 1, as in a gas of points that
    stick on contact (Ben-Naim, Chen, Doolen & Redner, Phys. Rev. Lett. 83, 4069 (1999)). Hard spheres need a speed
    below which they are elastic, otherwise they collide forever.
:Hard spheres: The exponent of 30 000 sticking points is -0.669 ± 0.004 over t = 10 … 2000 (8 draws). With ε = 0.5,
    seven of eight draws of 60 points collapse (bounded, not proved) at t = 4 to 14. With elastic collisions below
    3 mm/s the runs continue.
:Soft spheres: ε = 0.5 and contacts of 2 ms do not need a cut-off. Over 24 draws of 60 points the energy left at t = 16
    is 0.0595, with hard spheres 0.0594. The difference is a tenth of a standard deviation (8 draws do not decide).
    Eight draws have 5809 contacts and 27 586 collisions, because one contact replaces many collisions in a cluster.
:New: Soft spheres cool like hard spheres and need no cut-off. The result has an error margin and the
    numbers of events of both models.
:Read: The abstract and the first page.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

ELASTIC_SPEED = 3e-3
OUTPUT_TIMES = (1.0, 2.0, 4.0, 8.0, 16.0)


def ring(n, seed):
    """Points with a mean gap of 1 m and a mean square velocity of 1 m²/s²."""
    return gr.scenes.ring_gas(n, float(n), packing=1e-9, seed=seed)


def sticking_energy(n, seed, times):
    """Energy of sticking points at these times, in units of the initial energy."""
    run = gr.edmd.simulate(ring(n, seed), gr.ConstantRestitution(0.0), t_end=times[-1], samples=[0.0, *times],
                           log=False, max_events=10**7)
    return run.energy()[1:] / run.energy()[0]


def cooling_exponent(n, seed, last):
    """Exponent δ of E ~ t^δ of sticking points, from t = 10 to the last time."""
    times = np.geomspace(10.0, last, 25)
    return np.polyfit(np.log(times), np.log(sticking_energy(n, seed, times)), 1)[0]


def gas(seed, n=60, end=16.0):
    """Points with ε = 0.5, of which the hard points are elastic below 3 mm/s."""
    scene = ring(n, seed)
    laws = [gr.LinearDashpot.from_restitution(0.5, 1e6, pair) for pair in scene.pairs]
    return gr.Case(scene, laws, gr.ConstantRestitution(0.5), t_end=end,
                   run={"elastic_below": ELASTIC_SPEED, "max_events": 10**7})


def cooling_ensemble(end, draws=24):
    """Ensemble of the energy left in gases of soft and of hard points."""
    return gr.ensemble(gas, draws, "seed", "energy_left", end=end)


if __name__ == "__main__":
    found = [cooling_exponent(30_000, seed, 2000.0) for seed in range(8)]
    print(f"sticking: exponent {np.mean(found):.3f} ± {np.std(found, ddof=1) / len(found) ** 0.5:.3f}")
    ensembles = [cooling_ensemble(end) for end in OUTPUT_TIMES]
    print(ensembles[-1])
    plt.style.use("granular.journal")
    figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
    times = np.geomspace(0.3, 300.0, 40)
    axis.loglog(times, sticking_energy(30_000, 0, times), color="#c8963e", label="hard, sticking, 30 000 points")
    axis.loglog(times[18:], 0.30 * times[18:] ** (-2.0 / 3.0), ":", color="black", lw=1.0)
    axis.text(20.0, 0.018, "$t^{-2/3}$")
    for name, colour, shift, mark in (("hard", "#c1440e", 0.96, "s"), ("soft", "#1f4e79", 1.04, "o")):
        which = ("hard", "soft").index(name)
        rows = np.array([[one.worst.means[which], one.worst.errors[which]] for one in ensembles])
        axis.errorbar(shift * np.array(OUTPUT_TIMES), *rows.T, fmt=mark, ms=4, color=colour, label=f"{name}, ε = 0.5")
    axis.set(xlabel="time, mean distance / speed", ylabel="energy left, E / E₀")
    axis.legend(loc="lower left")
    figure.savefig("cooling.png")
