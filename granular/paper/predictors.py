"""Which measure predicts the error of event-driven simulation best, over scenes of several kinds."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from granular.cases import Case
from granular.comparison import compare
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
    "restitution": r"$|1-\varepsilon_{\mathrm{eff}}/\varepsilon|$, 1: no $\varepsilon_{\mathrm{eff}}$",
}
MARKS = {"two balls": "o", "stack": "^", "cradle": "s", "column": "v", "gas": "x"}


def compute(points: int) -> dict[str, Any]:
    """Error and measures of many scenes, and the rank correlation of each measure with the error."""
    gaps = np.geomspace(1e-7, 1e-1, points)
    scenes: dict[str, tuple[Callable[..., Case], dict[str, Any]]] = {
        "two balls": (longer.drop, {"gap": gaps, "ratio": [1.5, 4.0, 10.0]}),
        "stack": (longer.stack, {"n": [3, 5], "gap": gaps}),
        "cradle": (longer.cradle, {"exponent": [1.0, 1.5], "gap": gaps * 1e-2}),
        "column": (longer.column, {"n": [3, 6], "gap": gaps}),
        "gas": (longer.gas, {"packing": [0.1, 0.5], "duration": np.geomspace(1e-5, 0.3, points)}),
    }
    found: dict[str, Any] = {}
    for kind, (make, over) in scenes.items():
        data = sweep(make, over, MEASURES)
        columns = {name: data[name].values.ravel() for name in MEASURES}
        columns["mass_centre"] = np.abs(1.0 - columns.pop("mass_centre_ratio"))
        columns["restitution"] = np.array([_restitution_off(make(**dict(zip(over, values, strict=True))))
                                           for values in product(*over.values())])
        found[kind] = columns
    return {"scenes": found, "rank_correlation": {name: _correlation(found, name) for name in CANDIDATES}}


def draw(data: dict[str, Any]) -> Any:
    """Error over each measure; a measure is good if the marks fall on one rising line."""
    figure, axes = canvas(PAGE, 4.7, 2, 3, sharey=True)
    for k, (name, title) in enumerate(CANDIDATES.items()):
        axis = axes.flat[k]
        for kind, columns in data["scenes"].items():
            x, y = (np.maximum(np.asarray(columns[key], float), FLOOR) for key in (name, "error"))
            axis.plot(x, y, MARKS[kind], ms=2.8, mew=0.6, mfc="none", label=kind)
        axis.set(xscale="log", yscale="log", xlabel=title, ylim=(0.5 * FLOOR, 30.0))
        letter(axis, f"({'abcdef'[k]})  rank correlation {data['rank_correlation'][name]:.2f}")
    for axis in axes[:, 0]:
        axis.set_ylabel(longer.ERROR)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=8)
    return figure


def _restitution_off(case: Case) -> float:
    """|1 - ε_eff/ε|: how far ε must be changed for hard spheres to part as the soft do; 1 where none does it."""
    report = compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    if math.isnan(report.pairs[-1].soft_v_rel):
        return math.nan
    spec = report.restitution_spec[-1]
    return min((abs(1.0 - eps / spec) for eps in report.effective_restitution(resolution=21)), default=1.0)


def _correlation(found: dict[str, Any], name: str) -> float:
    """Spearman's rank correlation of a measure with the error, over all scenes that have it."""
    from scipy.stats import spearmanr

    x = np.concatenate([columns[name] for columns in found.values()])
    y = np.concatenate([columns["error"] for columns in found.values()])
    known = np.isfinite(x) & np.isfinite(y)
    return float(spearmanr(np.maximum(x[known], FLOOR), np.maximum(y[known], FLOOR)).statistic)
