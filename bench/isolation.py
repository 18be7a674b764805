"""Figure of threshold.md: two balls on a floor, over the gap between them.

`python bench/isolation.py` writes docs/figures/isolation.png. It compares hard spheres, soft spheres with every contact
treated as isolated, and the exact soft result.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, HARD_COLOUR, SOFT_COLOUR, add_letters, canvas, style
from granular.comparison.outcome import separations

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "isolation.png"
RESTITUTION, GAP_RANGE = 0.9, (1e-6, 1e-2)
LINE_STYLES: dict[str, dict[str, Any]] = {
    "hard": {"color": HARD_COLOUR, "lw": 2.4, "label": "hard spheres"},
    "ignore": {"color": "black", "lw": 1.0, "ls": "--", "label": "soft, contacts isolated"},
    "resolve": {"color": SOFT_COLOUR, "lw": 1.2, "marker": "o", "ms": 2.5, "label": "soft, exact"},
}
"""Line style of each model."""


def separation_speed(gap: float, model: str) -> float:
    """Separation speed of the two balls in m/s."""
    case = gr.cases.make("three-balls", gap=gap, restitution=RESTITUTION)
    run = case.simulate("edmd") if model == "hard" else case.simulate("md", disturbed=model)
    return float(separations(run)[0][-1])


def compute(points: int) -> dict[str, Any]:
    """Separation speeds over the gap, and the minimum gap of isolated contacts."""
    gaps = np.geomspace(*GAP_RANGE, points).tolist()
    found = gr.threshold("three-balls", "gap", GAP_RANGE, points=20, restitution=RESTITUTION)
    return {"gap": gaps, "threshold": found.holds[0][0],
            **{model: [separation_speed(gap, model) for gap in gaps] for model in LINE_STYLES}}


def draw(data: dict[str, Any]) -> Any:
    """Draw separation speeds above, and differences to the exact result below."""
    figure, axes = canvas(1.5 * COLUMN_WIDTH, 1.4 * COLUMN_WIDTH, 2, 1, sharex=True, height_ratios=(3, 2))
    (speeds,), (errors,) = axes
    exact = np.array(data["resolve"])
    for model, look in LINE_STYLES.items():
        speeds.plot(data["gap"], data[model], **look)
        if model != "resolve":
            errors.plot(data["gap"], np.maximum(np.abs(np.array(data[model]) - exact), 1e-16), **look)
    for axis in (speeds, errors):
        axis.axvline(data["threshold"], color=GREY_COLOUR, lw=0.8, ls=":")
    speeds.annotate("every contact\nisolated", (data["threshold"], 1.2), (4, 0), textcoords="offset points", fontsize=7)
    speeds.set(ylabel="separation speed (m/s)", xscale="log", xlim=GAP_RANGE)
    speeds.legend(loc="center left")
    errors.set(ylabel="|difference to exact| (m/s)", yscale="log", xlabel="gap between the balls, Δh (m)")
    add_letters((speeds, errors))
    return figure


if __name__ == "__main__":
    with style():
        draw(compute(121)).savefig(FIGURE_PATH, dpi=200)
    docs_data.store("isolation")
