"""A ball on a shaken plate, and a shaken column: hard and soft spheres side by side.

Run with ``python bench/driven.py``; writes docs/figures/driven.png.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.reports import COLUMN, GREY, HARD, SOFT, canvas, style

FIGURE = Path(__file__).parent.parent / "docs" / "figures" / "driven.png"
EPS, G, FREQUENCY, RATIO = 0.5, 9.81, 50.0, 100.0
OMEGA = 2.0 * math.pi * FREQUENCY
EXISTS = math.pi * (1.0 - EPS) / (1.0 + EPS)
DOUBLES = math.hypot(EXISTS, 2.0 * (1.0 + EPS**2) / (1.0 + EPS) ** 2)
KEPT, CHAOS, CHAOTIC_EPS = 16, 6.0, 0.8
N, GAMMA = 10, 20.0
"""Balls of the column, and how hard it is shaken."""


def orbit(gamma: float) -> gr.Scene:
    """A point ball that has just left the plate about on the orbit of one period."""
    plate = gr.walls.Sine.from_acceleration(gamma, FREQUENCY, G, math.acos(EXISTS / gamma))
    off = 1e-3 * plate.amplitude
    return gr.Scene([math.inf, 1.0], [0.0, 0.0], [off], [0.0, math.pi * G / OMEGA], G, floor=plate)


def runs(scene: gr.Scene, eps: float, bounces: int) -> dict[str, Any]:
    """The scene as hard and as soft spheres."""
    law = gr.LinearDashpot.from_restitution(eps, k=(RATIO * OMEGA) ** 2, pair=scene.pairs[0])
    end = gr.until.contact(pair=0, nth=bounces)
    return {"hard": gr.edmd.simulate(scene, gr.ConstantRestitution(eps), until=end),
            "soft": gr.md.simulate(scene, law, until=end)}


def doubling(points: int, bounces: int) -> dict[str, Any]:
    """The last phases over Γ."""
    gammas = np.linspace(0.95 * DOUBLES, 1.05 * DOUBLES, points).tolist()
    each = [runs(orbit(gamma), EPS, bounces) for gamma in gammas]
    return {"gamma": gammas} | {
        way: [gr.measures.section(run[way])["phase"][-KEPT:].tolist() for run in each] for way in ("hard", "soft")}


def chaos(bounces: int) -> dict[str, Any]:
    """Phase and speed after each bounce, in turns and Aω."""
    found: dict[str, Any] = {}
    for way, run in runs(orbit(CHAOS), CHAOTIC_EPS, bounces).items():
        section, plate = gr.measures.section(run), run.scene.floor
        found[way] = [section["phase"].tolist(), (section["after"] / (plate.amplitude * plate.omega)).tolist()]
    return found


def heights(points: int, periods: int) -> dict[str, Any]:
    """Mean height of the centre of mass of a column of hard spheres above that at rest, in (Aω)²/g."""
    losses = np.geomspace(0.1, 2.0, points).tolist()
    return {"loss": losses, "height": [height(1.0 - loss / N, periods) for loss in losses]}


def height(eps: float, periods: int) -> float:
    """One of them; the first quarter of the time is left out."""
    scene = gr.scenes.vibrated_column(N, GAMMA, FREQUENCY)
    plate = scene.floor
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), t_end=periods / FREQUENCY, samples=7 * periods + 1,
                           collapse="merge", max_events=10**8, log=False)
    above = run.position[len(run.time) // 4 :, 1:].mean() - 0.005 * N + plate.displacement(0.0)
    return float(above * G / (plate.amplitude * plate.omega) ** 2)


def compute(points: int) -> dict[str, Any]:
    """All of it; at few points short runs."""
    few = points < 10
    return {"doubling": doubling(points, 100 if few else 1000), "chaos": chaos(10 if few else 4000),
            "column": heights(2 if few else 7, 10 if few else 1500)}


def draw(data: dict[str, Any]) -> Any:
    """Three panels."""
    figure, axes = canvas(2.0 * COLUMN, 0.9 * COLUMN, 1, 3)
    left, middle, right = axes[0]
    for way, colour in (("hard", HARD), ("soft", SOFT)):
        rows = data["doubling"]
        gamma = np.repeat(rows["gamma"], KEPT)
        left.plot(gamma, np.ravel(rows[way]), ls="", marker=".", ms=2, color=colour, label=f"{way} spheres")
        middle.plot(*data["chaos"][way], ls="", marker=",", color=colour)
    left.axvline(DOUBLES, color=GREY, lw=0.8, ls=":")
    left.set(xlabel="Γ", ylabel="phase at impact, turns")
    left.legend()
    middle.set(xlabel="phase at impact, turns", ylabel="speed after, Aω", xlim=(0, 1))
    loss, above = map(np.array, data["column"].values())
    right.plot(loss, above, "o-", ms=3, color=HARD)
    right.plot(loss, 1.25 / loss, color=GREY, lw=0.8, ls=":")
    right.set(xscale="log", yscale="log", xlabel="N (1 - ε)", ylabel="height of the centre of mass, (Aω)²/g")
    return figure


if __name__ == "__main__":
    with style():
        draw(compute(41)).savefig(FIGURE, dpi=200)
    docs_data.store("driven")
