"""Validity of event-driven simulation

Maps of ε_eff/ε. Near 1, hard spheres reproduce the outcome of soft spheres.
"""

import numpy as np
from counts import UPPER_RADIUS, draw_maps, with_ratio_axis
from setting import main, prefixed_arrays

import granular as gr

ERROR_LIMIT = 0.01
"""Relative difference of ε_eff and ε above which hard spheres are not valid."""


def compute(points):
    """ε_eff/ε over (ε, Δh), and over (Δh, R1/R2) at ε = 0.8."""
    gaps, radii = np.geomspace(1e-7, 1e-2, points), UPPER_RADIUS * np.linspace(1.0, 20.0, points)
    over = {"gap": gaps, "restitution": np.linspace(0.1, 1.0, points)}
    over_gap = gr.sweep("three-balls", over, "eps_ratio")
    over_radii = gr.sweep("three-balls", {"gap": gaps, "radii[0]": radii}, "eps_ratio", restitution=0.8)
    return prefixed_arrays("gap", over_gap) | prefixed_arrays("radii", with_ratio_axis(over_radii))


def draw(data):
    """Draw two maps of the ratio, with a line where it differs from 1 by one per cent."""
    maps = [(data[f"{name}_eps_ratio"], ("gap", data[f"{name}_gap"]), (across, data[f"{name}_{across}"]))
            for name, across in (("gap", "restitution"), ("radii", "ratio"))]
    title = r"$\varepsilon_{\mathrm{eff}}/\varepsilon$"
    shown = [(np.clip(one, 0.0, 1.0), up, across) for one, up, across in maps]
    figure, _ = draw_maps(shown, title, cmap="cividis", vmin=0.0, vmax=1.0)
    for axis, (one, (_, y), (_, x)) in zip(figure.axes, maps, strict=False):
        axis.contour(x, y, np.abs(one - 1.0), [ERROR_LIMIT], colors="black", linewidths=1.0)
    figure.axes[0].plot([], [], color="black", lw=1.0, label=f"{100 * ERROR_LIMIT:g} % from 1")
    figure.axes[0].legend(loc="lower left", frameon=True, framealpha=0.9, edgecolor="none")
    return figure


if __name__ == "__main__":
    main(compute, draw, 200)
