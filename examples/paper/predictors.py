"""Predictors of the error of event-driven simulation

Error over six measures of many scenes. A measure is a good predictor if its marks lie on one rising line.
"""

import math

import numpy as np
from breakdown import COLUMN_PARAMETERS, ERROR_LABEL, MEASURES, STACK_PARAMETERS, cradle, gas
from scipy.stats import spearmanr
from setting import PAGE_WIDTH, add_letter, main, new_figure

import granular as gr

MIN_DRAWN_VALUE = 1e-8
"""Value at which all smaller values are drawn."""
CANDIDATE_LABELS = {
    "shared_impulse": r"shared impulse, $\varphi$", "crowding": "crowded collisions, $p$",
    "occupation": r"fraction of time in contact, $\Lambda$", "distance": "distance of velocities, $D$",
    "mass_centre": r"centre of mass, $|1-K_{\mathrm{cm}}|$",
    "restitution": r"restitution, $|1-\varepsilon_{\mathrm{eff}}/\varepsilon|$",
}
SCENE_MARKERS = {"two balls": "o", "stack": "^", "cradle": "s", "column": "v", "gas": "x"}


def compute(points):
    """Error and measures of many scenes, and their rank correlations."""
    gaps, found = np.geomspace(1e-7, 1e-1, points), {}
    kinds = {
        "two balls": ("three-balls", {"gap": gaps, "radii[0]": [0.015, 0.04, 0.1]}, {}),
        "stack": ("ball-stack", {"n": [3, 5], "gap": gaps}, STACK_PARAMETERS),
        "cradle": (cradle, {"exponent": [1.0, 1.5], "gap": gaps * 1e-2}, {}),
        "column": ("column", {"n": [3, 6], "gap": gaps}, COLUMN_PARAMETERS),
        "gas": (gas, {"packing": [0.1, 0.5], "duration": np.geomspace(1e-5, 0.3, points)}, {}),
    }
    for kind, (scene, over, fixed) in kinds.items():
        data = gr.sweep(scene, over, (*MEASURES, restitution), **fixed)
        found[kind] = {name: data[name].values.ravel() for name in (*MEASURES, "restitution")}
        found[kind]["mass_centre"] = np.abs(1.0 - found[kind].pop("mass_centre_ratio"))
    return {"scenes": found, "rank_correlation": {name: rank_correlation(found, name) for name in CANDIDATE_LABELS}}


def restitution(case):
    """|1 - ε_eff/ε|, or 1 if no ε_eff exists.

    With ε_eff hard spheres separate as fast as soft spheres.
    """
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    if math.isnan(report.pairs[-1].soft_v_rel):
        return math.nan
    spec = report.restitution_spec[-1]
    return min((abs(1.0 - eps / spec) for eps in report.effective_restitution(resolution=21)), default=1.0)


def rank_correlation(found, name):
    """Spearman's rank correlation of a measure with the error.

    Only scenes with a finite measure count.
    """
    x, y = (np.concatenate([columns[key] for columns in found.values()]) for key in (name, "error"))
    known = np.isfinite(x) & np.isfinite(y)
    return float(spearmanr(np.maximum(x[known], MIN_DRAWN_VALUE), np.maximum(y[known], MIN_DRAWN_VALUE)).statistic)


def draw(data):
    """Draw the error over each measure."""
    figure, axes = new_figure(PAGE_WIDTH, 4.7, 2, 3, sharey=True)
    for axis, tag, (name, title) in zip(axes.flat, "abcdef", CANDIDATE_LABELS.items(), strict=True):
        for kind, columns in data["scenes"].items():
            x, y = (np.maximum(columns[key], MIN_DRAWN_VALUE) for key in (name, "error"))
            axis.plot(x, y, SCENE_MARKERS[kind], ms=3.2, mew=0.6, mfc="none", label=kind)
        axis.set(xscale="log", yscale="log", xlabel=title, ylim=(0.5 * MIN_DRAWN_VALUE, 30.0))
        add_letter(axis, f"({tag})  rank correlation {data['rank_correlation'][name]:.2f}")
        axis.set_xticks(*ticks(axis.get_xlim()))
    for axis in axes[:, 0]:
        axis.set_yticks(*ticks(axis.get_ylim()))
        axis.set_ylabel(ERROR_LABEL)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=8)
    return figure


def ticks(limits):
    """Every other power of ten between limits, and the tick labels.

    The label of the smallest power stands for all smaller values.
    """
    low, high = math.ceil(math.log10(limits[0])), math.floor(math.log10(limits[1]))
    powers = range(low + low % 2, high + 1, 2)
    least = round(math.log10(MIN_DRAWN_VALUE))
    return [10.0**p for p in powers], [rf"$\leq 10^{{{p}}}$" if p <= least else f"$10^{{{p}}}$" for p in powers]


if __name__ == "__main__":
    main(compute, draw, 24)
