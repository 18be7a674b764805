"""Longer scenes than the paper's: where they leave event-driven simulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.paper import longer
from granular.paper.drawing import HARD, PAGE, canvas, letter
from granular.paper.maps import WRONG, _join
from granular.sweeps import sweep

MEASURES = ("error", "shared_impulse", "crowding", "occupation", "distance", "predictability", "mass_centre_ratio")


def compute(points: int) -> Any:
    """All measures over two parameters of each scene."""
    gaps = np.geomspace(3e-6, 3e-2, points)
    half = max(2, points // 2)
    return _join(
        stack=sweep(longer.stack, {"n": [2, 3, 4, 5, 6, 7], "gap": gaps}, MEASURES),
        cradle=sweep(longer.cradle, {"exponent": [1.0, 1.25, 1.5, 2.0, 2.5, 3.0], "gap": gaps * 1e-2}, MEASURES),
        column=sweep(longer.column, {"n": [2, 3, 5, 8, 12, 20][: max(2, half)], "gap": gaps}, MEASURES),
        gas=sweep(longer.gas, {"packing": np.linspace(0.05, 0.9, half), "duration": np.geomspace(1e-4, 0.3, half)},
                  MEASURES),
    )


def draw(data: Any) -> Any:
    """Errors of stack and cradle, bounce of the column, share of impulse that is not binary in the gas."""
    from matplotlib.colors import LogNorm

    figure, axes = canvas(PAGE, 4.6, 2, 2)
    _curves(axes[0, 0], data, "stack", "n", "error", "balls", longer.ERROR)
    _curves(axes[0, 1], data, "cradle", "exponent", "error", "$F\\sim\\xi^p$, $p$", longer.ERROR)
    _curves(axes[1, 0], data, "column", "n", "mass_centre_ratio", "balls", "bounce of the whole, soft/hard")
    gas = data["gas_shared_impulse"]
    axis = axes[1, 1]
    image = axis.pcolormesh(gas["gas_duration"], gas["gas_packing"], np.maximum(gas.values, 1e-6), shading="nearest",
                            norm=LogNorm(1e-3, 1.0), cmap="cividis", rasterized=True)
    axis.set(xscale="log", xlabel="$t_c$ (s), at thermal speed 1 m/s and 1 ball/m", ylabel="packing")
    figure.colorbar(image, ax=axis, label=r"impulse not binary, $\varphi$", extend="min")
    for axis, tag in zip(axes.flat, "abcd", strict=True):
        letter(axis, f"({tag})", x=0.93, color="white" if tag == "d" else "black")
    axes[0, 0].axhline(WRONG, color=HARD, lw=0.7, ls="--")
    axes[0, 1].axhline(WRONG, color=HARD, lw=0.7, ls="--")
    return figure


def _curves(axis: Any, data: Any, scene: str, parameter: str, measure: str, title: str, label: str) -> None:
    import matplotlib

    array = data[f"{scene}_{measure}"]
    values = array[f"{scene}_{parameter}"].values
    shades = matplotlib.colormaps["viridis"](np.linspace(0.9, 0.0, len(values)))
    for value, row, shade in zip(values, array.values, shades, strict=True):
        axis.plot(array[f"{scene}_gap"], row, color=shade, label=f"{value:g}", marker=".", ms=2.5, lw=0.7)
    axis.set_xscale("log")
    if measure == "error":
        axis.set(yscale="log", ylim=(1e-4, 30.0))
    axis.set(xlabel="gap  (m)", ylabel=label)
    axis.legend(title=title, title_fontsize=7, fontsize=6.5, ncols=2, loc="best")
