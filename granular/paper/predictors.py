"""Which measure predicts the error of event-driven simulation best, over scenes of several kinds."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.paper import longer
from granular.paper.breakdown import MEASURES
from granular.paper.drawing import PAGE, canvas, letter
from granular.sweeps import sweep

FLOOR = 1e-8
"""Smaller values are drawn there."""
CANDIDATES = {
    "shared_impulse": r"impulse not binary, $\varphi$",
    "crowding": "crowded collisions, $p$",
    "occupation": r"share of time in contact, $\Lambda$",
    "distance": "distance of velocities, $D$",
    "mass_centre": r"bounce of the whole, $|1-K_{\mathrm{cm}}|$",
}
MARKS = {"two balls": "o", "stack": "^", "cradle": "s", "column": "v", "gas": "x"}


def compute(points: int) -> dict[str, Any]:
    """Error and measures of many scenes, and the rank correlation of each measure with the error."""
    gaps = np.geomspace(1e-7, 1e-1, points)
    sweeps = {
        "two balls": sweep(longer.drop, {"gap": gaps, "ratio": [1.5, 4.0, 10.0]}, MEASURES),
        "stack": sweep(longer.stack, {"n": [3, 5], "gap": gaps}, MEASURES),
        "cradle": sweep(longer.cradle, {"exponent": [1.0, 1.5], "gap": gaps * 1e-2}, MEASURES),
        "column": sweep(longer.column, {"n": [3, 6], "gap": gaps}, MEASURES),
        "gas": sweep(longer.gas, {"packing": [0.1, 0.5], "duration": np.geomspace(1e-5, 0.3, points)}, MEASURES),
    }
    found: dict[str, Any] = {}
    for kind, data in sweeps.items():
        columns = {name: data[name].values.ravel() for name in MEASURES}
        columns["mass_centre"] = np.abs(1.0 - columns.pop("mass_centre_ratio"))
        found[kind] = columns
    return {"scenes": found, "rank_correlation": {name: _correlation(found, name) for name in CANDIDATES}}


def draw(data: dict[str, Any]) -> Any:
    """Error over each measure; a measure is good if the marks fall on one rising line."""
    figure, axes = canvas(PAGE, 4.4, 2, 3, sharey=True)
    for k, (name, title) in enumerate(CANDIDATES.items()):
        axis = axes.flat[k]
        for kind, columns in data["scenes"].items():
            x, y = (np.maximum(np.asarray(columns[key], float), FLOOR) for key in (name, "error"))
            axis.plot(x, y, MARKS[kind], ms=2.8, mew=0.6, mfc="none", label=kind)
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel(title)
        letter(axis, f"({'abcde'[k]})  rank correlation {data['rank_correlation'][name]:.2f}")
        axis.set_ylim(0.5 * FLOOR, 30.0)
    for axis in axes[:, 0]:
        axis.set_ylabel(r"error  $|\Delta v_r'|/v$")
    axes.flat[5].set_axis_off()
    axes.flat[5].legend(*axes.flat[0].get_legend_handles_labels(), loc="center left", fontsize=8)
    return figure


def _correlation(found: dict[str, Any], name: str) -> float:
    """Spearman's rank correlation of a measure with the error, over all scenes that have it."""
    from scipy.stats import spearmanr

    x = np.concatenate([columns[name] for columns in found.values()])
    y = np.concatenate([columns["error"] for columns in found.values()])
    known = np.isfinite(x) & np.isfinite(y)
    return float(spearmanr(np.maximum(x[known], FLOOR), np.maximum(y[known], FLOOR)).statistic)
