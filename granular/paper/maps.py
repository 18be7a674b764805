"""Figure 4, the number of contacts as maps; and ε_eff/ε_spec as maps, which the paper does not have."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.paper.drawing import HARD, PAGE, canvas, colours, letter
from granular.sweeps import sweep

WRONG = 0.01
"""Where ε_eff differs from ε_spec by more than this share, the scene may not be event-driven."""
NAMES = {"restitution": r"$\varepsilon$", "gap": r"$\Delta h$  (m)", "ratio": "$R_1/R_2$"}
UPPER = 0.01
"""Radius R2 in m."""


def counts(points: int) -> Any:
    """Contacts of the two balls over (ε, Δh) and (ε, R1/R2)."""
    eps = np.linspace(0.1, 1.0, points)
    return _join(
        gap=sweep("three-balls", {"gap": _gaps(points), "restitution": eps}, ("contacts",)),
        radii=_ratio(sweep("three-balls", {"radii[0]": _radii(points), "restitution": eps}, ("contacts",))),
    )


def draw_counts(data: Any) -> Any:
    """Two maps with one scale of colours."""
    figure, ((left, right),) = canvas(PAGE, 2.7, 1, 2)
    maps = [data[f"{name}_contacts"].isel(pair=1) for name in ("gap", "radii")]
    shades, norm = colours(max(int(one.max()) for one in maps))
    for axis, one, tag in zip((left, right), maps, "ab", strict=True):
        image = _map(axis, one, cmap=shades, norm=norm)
        letter(axis, f"({tag})", bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5})
    bar = figure.colorbar(image, ax=[left, right], label="contacts of the two balls", pad=0.015)
    bar.set_ticks(np.arange(1, shades.N + 1, 2))
    bar.ax.minorticks_off()
    return figure


def validity(points: int) -> Any:
    """ε_eff/ε_spec over (ε, Δh), and over (Δh, R1/R2) at ε = 0.8."""
    eps = np.linspace(0.1, 1.0, points)
    radii = {"gap": _gaps(points), "radii[0]": _radii(points)}
    return _join(
        gap=sweep("three-balls", {"gap": _gaps(points), "restitution": eps}, ("eps_ratio",)),
        radii=_ratio(sweep("three-balls", radii, ("eps_ratio",), restitution=0.8)),
    )


def draw_validity(data: Any) -> Any:
    """Two maps of the ratio, with the line beyond which event-driven simulation is right to one per cent."""
    figure, ((left, right),) = canvas(PAGE, 2.7, 1, 2)
    for axis, name, tag in ((left, "gap", "a"), (right, "radii", "b")):
        one = data[f"{name}_eps_ratio"]
        one = one if name == "gap" else one.transpose("radii_gap", "radii_ratio")
        image = _map(axis, one.clip(0.0, 1.0), cmap="cividis", vmin=0.0, vmax=1.0)
        x, y = (one[dim].values for dim in reversed(one.dims))
        axis.contour(x, y, np.abs(one.values - 1.0), [WRONG], colors=[HARD], linewidths=1.0)
        letter(axis, f"({tag})")
    figure.colorbar(image, ax=[left, right], label=r"$\varepsilon_{\mathrm{eff}}/\varepsilon$", pad=0.015)
    return figure


def _map(axis: Any, one: Any, **colours: Any) -> Any:
    """Draw an array over its two axes, the first upwards; a gap is logarithmic."""
    up, across = (str(dim) for dim in one.dims)
    x, y = one[across].values, one[up].values
    image = axis.pcolormesh(x, y, one.values, rasterized=True, shading="nearest", **colours)
    for dim, scale, label in ((up, axis.set_yscale, axis.set_ylabel), (across, axis.set_xscale, axis.set_xlabel)):
        kind = dim.rpartition("_")[2]
        scale("log" if kind == "gap" else "linear")
        label(NAMES[kind])
        if kind == "ratio":
            (axis.set_xticks if dim == across else axis.set_yticks)([1, 5, 10, 15, 20])
    return image


def _gaps(points: int) -> Any:
    return np.geomspace(1e-7, 1e-2, points)


def _radii(points: int) -> Any:
    return UPPER * np.linspace(1.0, 20.0, points)


def _ratio(data: Any) -> Any:
    """The axis of R1 as one of R1/R2."""
    scaled = data.assign_coords({"radii[0]": data["radii[0]"] / UPPER}).rename({"radii[0]": "ratio"})
    scaled["ratio"].attrs.update(units="1", long_name="R1/R2")
    return scaled


def _join(**parts: Any) -> Any:
    """Several maps in one data set, names and axes with their prefix."""
    from granular.sweeps.store import xarray_

    named = []
    for prefix, data in parts.items():
        names = {name: f"{prefix}_{name}" for name in data.variables if name not in ("pair", "body")}
        named.append(data.drop_vars(["pair", "body"], errors="ignore").rename(names))
    return xarray_().merge(named, combine_attrs="drop_conflicts")
