"""Figure 4: maps of the number of contacts

Contacts of the two balls over ε and the gap Δh, and over ε and the ratio of radii R1/R2.
"""

import matplotlib
import numpy as np
from forces import RESTITUTION
from matplotlib.colors import BoundaryNorm, ListedColormap
from setting import PAGE_WIDTH, add_letter, main, new_figure, prefixed_arrays

import granular as gr

UPPER_RADIUS = 0.01
"""Radius R2 in m."""
AXIS_LABELS = {"restitution": r"$\varepsilon$", "gap": r"$\Delta h$  (m)", "ratio": "$R_1/R_2$"}


def compute(points):
    """Number of contacts over (ε, Δh) and (ε, R1/R2)."""
    eps, gaps = np.linspace(0.1, 1.0, points), np.geomspace(1e-7, 1e-2, points)
    over_gap = {"gap": gaps, "restitution": eps}
    over_radii = {"radii[0]": UPPER_RADIUS * np.linspace(1.0, 20.0, points), "restitution": eps}
    gap, radii = (gr.sweep("three-balls", over, "contacts") for over in (over_gap, over_radii))
    return prefixed_arrays("gap", gap) | prefixed_arrays("radii", with_ratio_axis(radii))


def with_ratio_axis(data):
    """Replace the axis of R1 by an axis of R1/R2."""
    return data.assign_coords({"radii[0]": data["radii[0]"] / UPPER_RADIUS}).rename({"radii[0]": "ratio"})


def draw(data):
    """Draw two maps with one colour scale, from light to dark."""
    maps = [(data[f"{name}_contacts"][..., 1], (up, data[f"{name}_{up}"]), ("restitution", data[f"{name}_restitution"]))
            for name, up in (("gap", "gap"), ("radii", "ratio"))]
    most = max(int(one.max()) for one, *_ in maps)
    shades = {"cmap": ListedColormap(matplotlib.colormaps["viridis"](np.linspace(1.0, 0.0, most))),
              "norm": BoundaryNorm(np.arange(0.5, most + 1.0), most)}
    figure, bar = draw_maps(maps, "contacts of the two balls", **shades)
    bar.set_ticks(np.arange(1, most + 1, 2))
    bar.ax.minorticks_off()
    gaps, radii = figure.axes[:2]
    for axis, held, cut in ((gaps, 1e-4, 0.9), (radii, 10.0, 0.8)):
        axis.axhline(held, color="black", lw=0.6, ls="--")
        axis.axvline(cut, color="black", lw=0.6, ls="--")
        axis.plot([RESTITUTION], [held], "+", color="black", ms=8, mew=1.2)
    radii.axhline(1.0, color="black", lw=1.0)
    radii.set_ylim(bottom=0.4)
    return figure


def draw_maps(maps, title, **colours):
    """Draw arrays side by side, and return the figure and its colour bar.

    Each array is drawn over its two axes, the first of which points upwards.
    """
    figure, (axes,) = new_figure(PAGE_WIDTH, 2.7, 1, 2)
    for axis, (values, (up, y), (across, x)), tag in zip(axes, maps, "ab", strict=True):
        image = axis.pcolormesh(x, y, values, rasterized=True, shading="nearest", **colours)
        axis.set(xlabel=AXIS_LABELS[across], ylabel=AXIS_LABELS[up], yscale="log" if up == "gap" else "linear")
        for name, ticks in ((up, axis.yaxis), (across, axis.xaxis)):
            if name == "ratio":
                ticks.set_ticks([1, 5, 10, 15, 20])
        add_letter(axis, f"({tag})", bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5})
    return figure, figure.colorbar(image, ax=axes, label=title, pad=0.015)


if __name__ == "__main__":
    main(compute, draw, 300)
