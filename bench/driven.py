"""Figure of driven.md: a ball on a shaken plate, and a shaken column.

`python bench/driven.py` writes docs/figures/driven.png, which compares hard and soft spheres.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, add_letters, canvas, style

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "driven.png"
EPS, G, FREQUENCY, FREQUENCY_RATIO = 0.5, 9.81, 50.0, 100.0
OMEGA = 2.0 * math.pi * FREQUENCY
ORBIT_THRESHOLD = math.pi * (1.0 - EPS) / (1.0 + EPS)
"""Acceleration amplitude over g from which the bounce of one period exists."""
DOUBLING_THRESHOLD = math.hypot(ORBIT_THRESHOLD, 2.0 * (1.0 + EPS**2) / (1.0 + EPS) ** 2)
"""Acceleration amplitude over g at which the period doubles."""
PLOTTED_BOUNCES, CHAOTIC_ACCELERATION, CHAOTIC_EPS = 16, 6.0, 0.8
COLUMN_BALLS, COLUMN_ACCELERATION = 10, 20.0
"""Number of balls in the column, and acceleration amplitude of its floor over g."""


def periodic_orbit(gamma: float) -> gr.Scene:
    """Point ball that has just left the plate, close to the orbit of one period."""
    plate = gr.walls.Sine.from_acceleration(gamma, FREQUENCY, G, math.acos(ORBIT_THRESHOLD / gamma))
    off = 1e-3 * plate.amplitude
    return gr.Scene([math.inf, 1.0], [0.0, 0.0], [off], [0.0, math.pi * G / OMEGA], G, floor=plate)


def hard_and_soft_runs(scene: gr.Scene, eps: float, bounces: int) -> dict[str, Any]:
    """Runs of the scene as hard and as soft spheres, up to a number of bounces."""
    law = gr.LinearDashpot.from_restitution(eps, k=(FREQUENCY_RATIO * OMEGA) ** 2, pair=scene.pairs[0])
    end = gr.until.contact(pair=0, nth=bounces)
    return {"hard": gr.edmd.simulate(scene, gr.ConstantRestitution(eps), until=end),
            "soft": gr.md.simulate(scene, law, until=end)}


def period_doubling(points: int, bounces: int) -> dict[str, Any]:
    """Phases of the last bounces over Γ."""
    gammas = np.linspace(0.95 * DOUBLING_THRESHOLD, 1.05 * DOUBLING_THRESHOLD, points).tolist()
    each = [hard_and_soft_runs(periodic_orbit(gamma), EPS, bounces) for gamma in gammas]
    return {"gamma": gammas} | {
        model: [gr.measures.section(run[model])["phase"][-PLOTTED_BOUNCES:].tolist() for run in each]
        for model in ("hard", "soft")}


def chaotic_bounces(bounces: int) -> dict[str, Any]:
    """Phase in turns and speed in Aω after each bounce."""
    found: dict[str, Any] = {}
    for model, run in hard_and_soft_runs(periodic_orbit(CHAOTIC_ACCELERATION), CHAOTIC_EPS, bounces).items():
        section, plate = gr.measures.section(run), run.scene.floor
        found[model] = [section["phase"].tolist(), (section["after"] / (plate.amplitude * plate.omega)).tolist()]
    return found


def column_heights(points: int, periods: int) -> dict[str, Any]:
    """Mean height of the centre of mass of a hard column above its rest position.

    Heights are in units of (Aω)²/g, over N (1 - ε).
    """
    losses = np.geomspace(0.1, 2.0, points).tolist()
    return {"loss": losses, "height": [column_height(1.0 - loss / COLUMN_BALLS, periods) for loss in losses]}


def column_height(eps: float, periods: int) -> float:
    """Mean height for one ε, with the first quarter of the run discarded."""
    scene = gr.scenes.vibrated_column(COLUMN_BALLS, COLUMN_ACCELERATION, FREQUENCY)
    plate = scene.floor
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), t_end=periods / FREQUENCY, samples=7 * periods + 1,
                           collapse="merge", max_events=10**8, log=False)
    above = run.position[len(run.time) // 4 :, 1:].mean() - 0.005 * COLUMN_BALLS + plate.displacement(0.0)
    return float(above * G / (plate.amplitude * plate.omega) ** 2)


def compute(points: int) -> dict[str, Any]:
    """All numbers of the figure, from short runs if `points` < 10."""
    few = points < 10
    return {"doubling": period_doubling(points, 100 if few else 1000), "chaos": chaotic_bounces(10 if few else 4000),
            "column": column_heights(2 if few else 7, 10 if few else 1500)}


def draw(data: dict[str, Any]) -> Any:
    """Draw the three panels."""
    figure, (axes,) = canvas(2.0 * COLUMN_WIDTH, 0.85 * COLUMN_WIDTH, 1, 3)
    left, middle, right = axes
    looks: dict[str, dict[str, Any]] = {"hard": {"color": HARD_COLOUR, "marker": "o", "mfc": "none"},
                                        "soft": {"color": SOFT_COLOUR, "marker": "."}}
    for model, look in looks.items():
        rows = data["doubling"]
        gamma = np.repeat(rows["gamma"], PLOTTED_BOUNCES)
        left.plot(gamma, np.ravel(rows[model]), ls="", ms=3, mew=0.6, label=f"{model} spheres", **look)
        middle.plot(*data["chaos"][model], ls="", marker=".", ms=2.2, mew=0, color=look["color"], alpha=0.7)
    left.axvline(DOUBLING_THRESHOLD, color=GREY_COLOUR, lw=0.8, ls=":")
    left.set(xlabel="acceleration amplitude over g, Γ", ylabel="phase at impact (turns)")
    middle.set(xlabel="phase at impact (turns)", ylabel="speed after impact (Aω)", xlim=(0, 1))
    loss, above = map(np.array, data["column"].values())
    right.plot(loss, above, "-", **looks["hard"])
    right.plot(loss, 1.25 / loss, color=GREY_COLOUR, ls=":", label="1.25/(N (1 − ε))")
    right.set(xscale="log", yscale="log", xlabel="total loss, N (1 − ε)",
              ylabel="height of the centre of mass (A²ω²/g)")
    add_letters(axes)
    figure.legend(loc="outside upper center", ncols=3)
    return figure


if __name__ == "__main__":
    with style():
        draw(compute(41)).savefig(FIGURE_PATH, dpi=200)
    docs_data.store("driven")
