"""Figure of oblique.md: oblique impacts, and errors of means against B.

`python bench/oblique.py` writes docs/figures/oblique.png. The ensembles of the third panel are stored by
`bench/threed/ensembles.py`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, add_letters, canvas, style

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "oblique.png"
ENSEMBLES_PATH = Path(__file__).parent / "threed" / "results.json"
IMPACT_PAIR, RELATIVE_DURATION = gr.Pair(m_eff=0.5, r_eff=0.25, index=0), 0.1
"""Spheres of mass and diameter 1, and v t_c/(R₁ + R₂) of a head-on impact."""
MARKERS = "os^vDP"


def impact_laws() -> dict[str, Any]:
    """Force laws of the first two panels, with equal contact durations."""
    duration = gr.binary.collision(gr.Hertz(1.0), IMPACT_PAIR, 1.0).duration
    return {"spring": gr.LinearDashpot(0.5 * (math.pi / RELATIVE_DURATION) ** 2),
            "Hertz": gr.Hertz((duration / RELATIVE_DURATION) ** 2.5)}


def compute(points: int) -> dict[str, Any]:
    """Rotation and normal restitution as functions of the angle of impact."""
    angles = np.linspace(0.0, 89.9, points)
    found: dict[str, Any] = {"angle": angles.tolist()}
    for name, law in impact_laws().items():
        hits = [gr.binary.oblique(law, IMPACT_PAIR, 1.0, math.cos(math.radians(a)), math.sin(math.radians(a)))
                for a in angles.tolist()]
        found[name] = {"rotation": [hit.rotation for hit in hits], "restitution": [hit.restitution for hit in hits],
                       "estimate": [hit.estimate for hit in hits]}
    return found


def draw(data: dict[str, Any]) -> Any:
    """Plot rotation and restitution against the angle, and errors of means against B."""
    figure, axes = canvas(2.0 * COLUMN_WIDTH, 0.9 * COLUMN_WIDTH, 1, 3)
    turned, normal, errors = axes[0]
    for name, colour in (("spring", SOFT_COLOUR), ("Hertz", HARD_COLOUR)):
        turned.plot(data["angle"], np.array(data[name]["rotation"]) / RELATIVE_DURATION, color=colour, label=name)
        normal.plot(data["angle"], data[name]["restitution"], color=colour, label=name)
    turned.plot(data["angle"], np.array(data["spring"]["estimate"]) / RELATIVE_DURATION, color="black", ls="--", lw=0.8,
                label="estimate")
    normal.axhline(0.0, color=GREY_COLOUR, lw=0.8, ls=":")
    turned.set(xlabel="angle of impact, θ (°)", ylabel="rotation over $v t_c/l$", xlim=(0.0, 90.0), ylim=(0.0, 1.6))
    normal.set(xlabel="angle of impact, θ (°)", ylabel="normal restitution, $\\varepsilon_n$", xlim=(0.0, 90.0))
    turned.legend(loc="upper left")
    stored = json.loads(ENSEMBLES_PATH.read_text(encoding="utf-8"))["groups"]
    for marker, (name, rows) in zip(MARKERS, sorted(stored.items()), strict=True):
        worst = [max(row["errors"].values(), key=lambda error: abs(error[0])) for row in rows]
        errors.errorbar([row["B"] for row in rows], [abs(error) for error, _ in worst], [sigma for _, sigma in worst],
                        fmt=marker, ms=3.5, lw=0.8, label=name)
    errors.plot([0.0, 0.15], [0.0, 0.15], color=GREY_COLOUR, lw=0.8, ls=":")
    errors.set(xlabel="estimate, $B = s + Z/2$", ylabel="largest error of means", xlim=(0.0, None), ylim=(0.0, None))
    errors.legend(loc="upper left", fontsize=6)
    add_letters(axes[0])
    return figure


if __name__ == "__main__":
    with style():
        draw(compute(181)).savefig(FIGURE_PATH, dpi=200)
    docs_data.store("oblique")
