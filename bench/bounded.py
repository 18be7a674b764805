"""Figure of bounded.md: ring gases, thermal walls, pendula, a hot floor.

`python bench/bounded.py` writes docs/figures/bounded.png. Its panels show Haff's law, the heat flow between two walls,
the energy of a cradle and the density above a hot floor. The run takes some minutes with numba. Without numba it takes
many hours, and the result is bitwise identical.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.kernels import have_numba
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, add_letters, canvas, style

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "bounded.png"
HOT_TEMPERATURE, COLD_TEMPERATURE = 2.0, 1.0
KNUDSEN_HEAT_FLOW = (HOT_TEMPERATURE - COLD_TEMPERATURE) / (
    math.sqrt(math.pi / 2.0) * (HOT_TEMPERATURE**-0.5 + COLD_TEMPERATURE**-0.5))
"""Heat flow in W carried by hard balls of 1 kg, one ball per metre."""
TOTAL_LOSSES, CONTACT_STIFFNESSES = (0.2, 2.0, 10.0), (1e4, 1e3, 1e2)
RUN_LIMITS = {"max_events": 10**9, "log": False}
STIFFNESS_POWERS = {1e4: "⁴", 1e3: "³", 1e2: "²"}
BLUES = ("#9dbfe0", "#4f81b0", SOFT_COLOUR)
"""Shades of soft spheres, from stiff to soft."""


def cooling_curves(n: int, seeds: int, end: float, rows: int) -> dict[str, Any]:
    """Energy over t/τ of ring gases for several N (1 - ε), averaged over the seeds."""
    found: dict[str, Any] = {"time": np.linspace(0.0, end, rows).tolist(), "hard": [], "soft": []}
    for model in ("hard", "soft"):
        for loss in TOTAL_LOSSES[: None if model == "hard" else 1]:
            curves = [energy_left(model, n, loss, seed, end, rows) for seed in range(seeds)]
            found[model].append(np.mean(curves, axis=0).tolist())
    return found


def energy_left(model: str, n: int, loss: float, seed: int, end: float, rows: int) -> np.ndarray:
    """Energy of one gas at the sample times, as a fraction of its initial energy."""
    scene, eps = gr.scenes.ring_gas(n, float(n), packing=0.0, seed=seed), 1.0 - loss / n
    options = {"t_end": end * math.sqrt(math.pi) / (1.0 - eps * eps), "samples": rows} | RUN_LIMITS
    if model == "hard":
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), collapse="merge", **options)
    else:
        law = gr.LinearDashpot.from_restitution(eps, k=1e4, pair=scene.pairs[0])
        run = gr.md.simulate(scene, law, max_steps=10**9, **options)
    return np.asarray(run.energy() / run.energy()[0])


def heat_flow_ratios(numbers: tuple[int, ...], end: float, seeds: int) -> dict[str, Any]:
    """Soft-to-hard ratio of the heat flow over the number of balls, per stiffness."""
    return {f"{k:g}": [heat_flow_ratio(n, k, end, seeds) for n in numbers] for k in CONTACT_STIFFNESSES}


def heat_flow_ratio(n: int, k: float, end: float, seeds: int) -> list[float]:
    """Number of balls, soft-to-hard ratio of the heat flow, and its standard error.

    Hard and soft gases of one seed draw the same speeds at each wall hit. Most of the noise therefore cancels in the
    difference of their heat flows.
    """
    law = gr.LinearDashpot(k)  # equal seeds, so that most noise cancels in the differences
    differences = [heat_flow(n, law, end, seed) - heat_flow(n, None, end, seed) for seed in range(seeds)]
    error = float(np.std(differences, ddof=1)) / math.sqrt(seeds) / KNUDSEN_HEAT_FLOW
    return [n, 1.0 + float(np.mean(differences)) / KNUDSEN_HEAT_FLOW, error]


def heat_flow(n: int, law: Any, end: float, seed: int) -> float:
    """Mean heat flow in W through one gas, of hard spheres if `law` is None.

    The first fifth of the run is discarded.
    """
    scene = gr.scenes.heated_gas(n, float(n), packing=0.0, lower=HOT_TEMPERATURE, upper=COLD_TEMPERATURE, seed=seed)
    engine = "compiled" if end > 100.0 and have_numba() else "auto"
    options = {"t_end": end, "samples": [0.2 * end, end], "engine": engine} | RUN_LIMITS
    if law is None:
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), **options)
    else:
        run = gr.md.simulate(scene, law, max_steps=10**9, **options)
    return float(np.diff(run.account()["heat"] @ [0.5, -0.5])[0] / (0.8 * end))


def cradle_energy(halves: int) -> dict[str, list[float]]:
    """Energy left after each half period of a cradle of five touching pendula.

    One pendulum starts at a distance of 1 m from its rest position. All contacts have ε = 0.9.
    """
    scene = gr.Scene([1.0] * 5, [0.1] * 5, [1.0, 0.0, 0.0, 0.0], [0.0] * 5, origin=-1.0, pendulum=1.0)
    law = gr.LinearDashpot.from_restitution(0.9, k=1e6, pair=scene.pairs[0])
    options = {"t_end": halves * math.pi, "samples": halves + 1} | RUN_LIMITS
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), ties="left", **options)
    soft = gr.md.simulate(scene, law, max_steps=10**9, **options)
    return {name: (run.energy() / run.energy()[0]).tolist() for name, run in (("hard", hard), ("soft", soft))}


def height_densities(n: int, end: float, rows: int) -> dict[str, list[float]]:
    """Density in 1/m of ball heights above a floor of T = 2 J under g = 4 m/s²."""
    scene = gr.scenes.heated_gas(n, lower=HOT_TEMPERATURE, gravity=4.0, packing=0.0, seed=1)
    options = {"t_end": end, "samples": rows} | RUN_LIMITS
    runs = {"hard": gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), **options),
            "soft": gr.md.simulate(scene, gr.LinearDashpot(2e3), max_steps=10**9, **options)}
    bins = np.linspace(0.0, 3.0, 25)
    return {name: (np.histogram(run.position[:, 1:], bins)[0] / (bins[1] * n * rows)).tolist()
            for name, run in runs.items()}


def compute(points: int) -> dict[str, Any]:
    """All numbers of the figure, from short runs if `points` < 10."""
    if points < 10:
        return {"haff": cooling_curves(40, 1, 0.02, 3), "heat": heat_flow_ratios((2,), 10.0, 2),
                "cradle": cradle_energy(2), "floor": height_densities(2, 4.0, 5)}
    return {"haff": cooling_curves(40, 40, 10.0, 101), "heat": heat_flow_ratios((1, 2, 4, 8, 16, 32, 64), 2.5e3, 96),
            "cradle": cradle_energy(60), "floor": height_densities(10, 4e3, 4001)}


def draw(data: dict[str, Any]) -> Any:
    """Draw the four panels."""
    figure, axes = canvas(2.0 * COLUMN_WIDTH, 1.7 * COLUMN_WIDTH, 2, 2)
    (cooling, heat), (swinging, floor) = axes
    draw_cooling(cooling, data["haff"])
    marks = zip(CONTACT_STIFFNESSES, "s^D", data["heat"].values(), BLUES, strict=True)
    for k, mark, rows, colour in marks:
        n, mean, error = np.transpose(rows)
        heat.errorbar(n, mean, error, fmt=mark + "-", lw=0.5, ms=3, mfc="none", capsize=1.5, color=colour,
                      label=f"soft, k = 10{STIFFNESS_POWERS[k]} N/m")
    heat.axhline(1.0, color=HARD_COLOUR, ls="--", label="hard")
    heat.set(xscale="log", xlabel="number of balls between the walls", ylabel="heat flow, soft/hard", ylim=(0.0, 1.1))
    heat.legend(loc="lower left")
    for name, colour, line, mark in (("hard", HARD_COLOUR, "--", "o"), ("soft", SOFT_COLOUR, "-", ".")):
        left_over = data["cradle"][name]
        swinging.plot(0.5 * np.arange(len(left_over)), left_over, mark, ls=line, lw=0.5, ms=3.5, color=colour,
                      mfc="none", label=name)
        density = data["floor"][name]
        floor.stairs(density, np.linspace(0.0, 3.0, len(density) + 1), color=colour, ls=line, label=name)
    swinging.axhline(0.2, color=GREY_COLOUR, lw=0.8, ls=":")
    swinging.set(xlabel="time (periods)", ylabel="energy left, $E/E_0$", ylim=(0.0, 1.05))
    swinging.legend()
    height = np.linspace(0.0, 3.0, 100)
    floor.plot(height, 2.0 * np.exp(-2.0 * height), color=GREY_COLOUR, lw=0.8, ls=":", label=r"$\propto\exp(-mgx/T)$")
    floor.set(yscale="log", xlabel="height, $x$ (m)", ylabel="probability density (1/m)", xlim=(0.0, 3.0))
    floor.legend()
    add_letters(axes.ravel())
    return figure


def draw_cooling(axis: Any, data: dict[str, Any]) -> None:
    """Draw the energy of the ring gases over time."""
    t = np.array(data["time"])
    for loss, left_over, line in zip(TOTAL_LOSSES, data["hard"], ("-", "--", "-."), strict=True):
        axis.plot(t, left_over, color=HARD_COLOUR, ls=line, label=f"hard, N (1 − ε) = {loss:g}")
    axis.plot(t[::5], data["soft"][0][::5], "s", ms=3.5, mfc="none", color=SOFT_COLOUR,
              label=f"soft, N (1 − ε) = {TOTAL_LOSSES[0]:g}")
    axis.plot(t, (1.0 + t) ** -2.0, color=GREY_COLOUR, lw=0.8, ls=":", label=r"$(1+t/\tau)^{-2}$")
    axis.set(yscale="log", xlabel=r"time, $t/\tau$", ylabel="energy left, $E/E_0$")
    axis.legend(loc="upper right")


if __name__ == "__main__":
    with style():
        draw(compute(20)).savefig(FIGURE_PATH, dpi=200)
    docs_data.store("bounded")
