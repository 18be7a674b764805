"""Longer scenes than the paper's: where they leave event-driven simulation, and which measure predicts its error.
May be skipped: figures beyond the paper, beside the engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from granular import cases, scenes, until
from granular.cases import Case
from granular.comparison import compare
from granular.drawing import HARD, PAGE, canvas, letter, shades
from granular.laws import PowerLaw
from granular.paper.maps import WRONG, joined
from granular.rules import ConstantRestitution
from granular.sweeps import sweep

MEASURES = ("error", "shared_impulse", "crowding", "occupation", "distance", "predictability", "mass_centre_ratio")
ERROR = r"error  $\max(|\Delta u_i|,\,|\Delta v_c'|)\,/\,U$"
"""Label of `granular.Comparison.error`: largest difference of a leaving velocity u or a separation speed v′."""
LEAST = 1e-8
"""Smaller values are drawn there."""
CANDIDATES = {
    "shared_impulse": r"impulse not binary, $\varphi$",
    "crowding": "crowded collisions, $p$",
    "occupation": r"share of time in contact, $\Lambda$",
    "distance": "distance of velocities, $D$",
    "mass_centre": r"bounce of the whole, $|1-K_{\mathrm{cm}}|$",
    "restitution": r"$|1-\varepsilon_{\mathrm{eff}}/\varepsilon|$  (1 where none exists)",
}
MARKS = {"two balls": "o", "stack": "^", "cradle": "s", "column": "v", "gas": "x"}


def drop(gap: float = 1e-4, ratio: float = 10.0) -> Case:
    """The paper's own scene."""
    return cases.make("three-balls", gap=gap, radii=(0.01 * ratio, 0.01))


def stack(n: int = 3, gap: float = 1e-3) -> Case:
    """Kerwin stack: `n` balls of mass ratio 1/3, 3 m/s, without gravity."""
    return cases.make("ball-stack", n=n, mass_ratio=1.0 / 3.0, speed=3.0, gap=gap, gravity=0.0, restitution=0.95,
                      t_end=100.0)  # fmt: skip


def column(n: int = 5, gap: float = 1e-3) -> Case:
    """Column of `n` equal balls of 1 kg that falls on a floor at 1 m/s, without gravity."""
    return cases.make("column", n=n, gap=gap, speed=1.0, restitution=0.95, t_end=100.0)


def cradle(gap: float = 1e-6, exponent: float = 1.5) -> Case:
    """Newton's cradle of five steel balls; F = k ξ^exponent, elastic, 1e-5 m deep at 1 m/s whatever the exponent."""
    depth, energy = 1e-5, 0.25
    law = PowerLaw(energy * (exponent + 1.0) / depth ** (exponent + 1.0), exponent)
    scene = scenes.newtons_cradle(5, gap=gap)
    return Case(scene, (law,) * 4, ConstantRestitution(1.0), until.separated(), 100.0)


def gas(packing: float = 0.1, duration: float = 0.01) -> Case:
    """Gas of 20 balls on 20 m, thermal speed 1 m/s, that cools while each crosses ten mean gaps; t_c in s, elastic."""
    return cases.make("gas", n=20, length=20.0, packing=packing, restitution=0.9,
                      stiffness=0.5 * (math.pi / duration) ** 2, t_end=10.0 * ((1.0 - packing) * 20.0 / 21.0))


def breakdown(points: int) -> Any:
    """All measures over two parameters of each scene."""
    gaps = np.geomspace(3e-6, 3e-2, points)
    half = max(2, points // 2)
    return joined(
        stack=sweep(stack, {"n": [2, 3, 4, 5, 6, 7], "gap": gaps}, MEASURES),
        cradle=sweep(cradle, {"exponent": [1.0, 1.25, 1.5, 2.0, 2.5, 3.0], "gap": gaps * 1e-2}, MEASURES),
        column=sweep(column, {"n": [2, 3, 5, 8, 12, 20][:half], "gap": gaps}, MEASURES),
        gas=sweep(gas, {"packing": np.linspace(0.05, 0.9, half), "duration": np.geomspace(1e-4, 0.3, half)}, MEASURES),
    )


def draw_breakdown(data: Any) -> Any:
    """Errors of stack and cradle, bounce of the column, share of impulse that is not binary in the gas."""
    from matplotlib.colors import LogNorm

    figure, axes = canvas(PAGE, 4.6, 2, 2)
    panels = ((axes[0, 0], "stack_n", "balls"), (axes[0, 1], "cradle_exponent", "$p$ of $F\\sim\\xi^p$"))
    for axis, name, title in panels:
        _curves(axis, data, name, "error", title)
        axis.set(yscale="log", ylim=(1e-4, 30.0), ylabel=ERROR)
        axis.axhline(WRONG, color=HARD, lw=0.7, ls="--")
        axis.annotate(f"{100 * WRONG:g} %: limit of Yes", (0.98, WRONG), (0, 2), xycoords=("axes fraction", "data"),
                      textcoords="offset points", color=HARD, fontsize=7, ha="right")  # fmt: skip
    _curves(axes[1, 0], data, "column_n", "mass_centre_ratio", "balls")
    axes[1, 0].set_ylabel("bounce of the whole, soft/hard")
    gas = data["gas_shared_impulse"]
    image = axes[1, 1].pcolormesh(gas["gas_duration"], gas["gas_packing"], np.maximum(gas.values, 1e-6),
                                  shading="nearest", norm=LogNorm(1e-3, 1.0), cmap="cividis", rasterized=True)
    axes[1, 1].set(xscale="log", xlabel="$t_c$ (s), at thermal speed 1 m/s and 1 ball/m", ylabel="packing")
    axes[1, 1].set_title(" × ".join(map(str, gas.shape)) + " runs", fontsize=7, loc="right")
    figure.colorbar(image, ax=axes[1, 1], label=r"impulse not binary, $\varphi$", extend="min")
    for axis, tag in zip(axes.flat, "abcd", strict=True):
        letter(axis, f"({tag})", x=0.93, color="white" if tag == "d" else "black")
    return figure


def _curves(axis: Any, data: Any, name: str, measure: str, title: str) -> None:
    """A measure over the gap, one line a value of the parameter called `name`."""
    kind, values = name.partition("_")[0], data[name].values
    colours = shades("viridis", len(values), 0.9)
    for value, row, shade in zip(values, data[f"{kind}_{measure}"].values, colours, strict=True):
        axis.plot(data[f"{kind}_gap"], row, color=shade, label=f"{value:g}", marker=".", ms=2.5, lw=0.7)
    axis.set(xscale="log", xlabel="gap  (m)")
    axis.legend(title=title, title_fontsize=7, fontsize=6.5, ncols=2, loc="best")


def predictors(points: int) -> dict[str, Any]:
    """Error and measures of many scenes, and the rank correlation of each measure with the error."""
    gaps = np.geomspace(1e-7, 1e-1, points)
    kinds: dict[str, tuple[Callable[..., Case], dict[str, Any]]] = {
        "two balls": (drop, {"gap": gaps, "ratio": [1.5, 4.0, 10.0]}),
        "stack": (stack, {"n": [3, 5], "gap": gaps}),
        "cradle": (cradle, {"exponent": [1.0, 1.5], "gap": gaps * 1e-2}),
        "column": (column, {"n": [3, 6], "gap": gaps}),
        "gas": (gas, {"packing": [0.1, 0.5], "duration": np.geomspace(1e-5, 0.3, points)}),
    }
    found: dict[str, Any] = {}
    for kind, (make, over) in kinds.items():
        data = sweep(make, over, MEASURES)
        columns = found[kind] = {name: data[name].values.ravel() for name in MEASURES}
        columns["mass_centre"] = np.abs(1.0 - columns.pop("mass_centre_ratio"))
        each = product(*over.values())
        columns["restitution"] = np.array([_off(make(**dict(zip(over, values, strict=True)))) for values in each])
    return {"scenes": found, "rank_correlation": {name: _correlation(found, name) for name in CANDIDATES}}


def draw_predictors(data: dict[str, Any]) -> Any:
    """Error over each measure; a measure is good if the marks fall on one rising line."""
    figure, axes = canvas(PAGE, 4.7, 2, 3, sharey=True)
    for axis, tag, (name, title) in zip(axes.flat, "abcdef", CANDIDATES.items(), strict=True):
        for kind, columns in data["scenes"].items():
            x, y = (np.maximum(np.asarray(columns[key], float), LEAST) for key in (name, "error"))
            axis.plot(x, y, MARKS[kind], ms=2.8, mew=0.6, mfc="none", label=kind)
        axis.set(xscale="log", yscale="log", xlabel=title, ylim=(0.5 * LEAST, 30.0))
        letter(axis, f"({tag})  rank correlation {data['rank_correlation'][name]:.2f}")
        axis.set_xticks(ticks := _decades(axis.get_xlim()), _least(ticks))
    for axis in axes[:, 0]:
        axis.set_yticks(ticks := _decades(axis.get_ylim()), _least(ticks))
        axis.set_ylabel(ERROR)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=8)
    return figure


def _decades(limits: tuple[float, float]) -> list[float]:
    """Every other power of ten between limits."""
    low, high = math.ceil(math.log10(limits[0])), math.floor(math.log10(limits[1]))
    return [10.0**power for power in range(low + low % 2, high + 1, 2)]


def _least(ticks: list[float]) -> list[str]:
    """Their names: the least stands for all that is smaller."""
    powers = [round(math.log10(tick)) for tick in ticks]
    return [rf"$\leq 10^{{{power}}}$" if 10.0**power <= 1.01 * LEAST else f"$10^{{{power}}}$" for power in powers]


def _off(case: Case) -> float:
    """|1 - ε_eff/ε|: how far ε must be changed for hard spheres to part as the soft do; 1 where none does it."""
    report = compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    if math.isnan(report.pairs[-1].soft_v_rel):
        return math.nan
    spec = report.restitution_spec[-1]
    return min((abs(1.0 - eps / spec) for eps in report.effective_restitution(resolution=21)), default=1.0)


def _correlation(found: dict[str, Any], name: str) -> float:
    """Spearman's rank correlation of a measure with the error, over all scenes that have it."""
    from scipy.stats import spearmanr

    x, y = (np.concatenate([columns[key] for columns in found.values()]) for key in (name, "error"))
    known = np.isfinite(x) & np.isfinite(y)
    return float(spearmanr(np.maximum(x[known], LEAST), np.maximum(y[known], LEAST)).statistic)
