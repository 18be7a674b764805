"""Limits of event-driven simulation in longer scenes

Stacks, cradles and columns over their gaps, and a gas over its packing and the duration of a contact.
"""

import math

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from setting import PAGE_WIDTH, add_letter, main, new_figure, prefixed_arrays
from validity import ERROR_LIMIT

import granular as gr

MEASURES = ("error", "shared_impulse", "crowding", "occupation", "distance", "predictability", "mass_centre_ratio")
ERROR_LABEL = r"error  $\max |\Delta u_i|\,/\,U$"
"""Label of `gr.Comparison.error`.

The error is the largest difference of a velocity with which a ball leaves an episode of contacts.
"""
STACK_PARAMETERS = {"mass_ratio": 1.0 / 3.0, "speed": 3.0, "gravity": 0.0, "restitution": 0.95, "t_end": 100.0}
COLUMN_PARAMETERS = {"speed": 1.0, "restitution": 0.95, "t_end": 100.0}
"""Fixed parameters of Kerwin's stacks, and of columns that fall on a floor.

Columns consist of equal balls. Neither scene has gravity.
"""


def cradle(gap=1e-6, exponent=1.5):
    """Newton's cradle of five elastic steel balls with F = k ξ^exponent.

    The largest overlap at 1 m/s is 1e-5 m for every exponent.
    """
    law = gr.PowerLaw(0.25 * (exponent + 1.0) / 1e-5 ** (exponent + 1.0), exponent)
    scene = gr.scenes.newtons_cradle(5, gap=gap)
    return gr.Case(scene, (law,) * 4, gr.ConstantRestitution(1.0), gr.until.separated(), 100.0)


def gas(packing=0.1, duration=0.01):
    """Gas of 20 balls on 20 m that cools while each ball crosses ten mean gaps.

    The thermal speed is 1 m/s. `duration` is the elastic contact duration in s.
    """
    return gr.cases.make("gas", n=20, length=20.0, packing=packing, restitution=0.9,
                         stiffness=0.5 * (math.pi / duration) ** 2, t_end=10.0 * ((1.0 - packing) * 20.0 / 21.0))


def compute(points):
    """All measures over two parameters of each scene."""
    gaps, half = np.geomspace(3e-6, 3e-2, points), max(2, points // 2)
    maps = {
        "stack": gr.sweep("ball-stack", {"n": [2, 3, 4, 5, 6, 7], "gap": gaps}, MEASURES, **STACK_PARAMETERS),
        "cradle": gr.sweep(cradle, {"exponent": [1.0, 1.25, 1.5, 2.0, 2.5, 3.0], "gap": gaps * 1e-2}, MEASURES),
        "column": gr.sweep("column", {"n": [2, 3, 5, 8, 12, 20][:half], "gap": gaps}, MEASURES, **COLUMN_PARAMETERS),
        "gas": gr.sweep(gas, {"packing": np.linspace(0.05, 0.9, half), "duration": np.geomspace(1e-4, 0.3, half)},
                        MEASURES),
    }
    return {key: values for name, data in maps.items() for key, values in prefixed_arrays(name, data).items()}


def draw(data):
    """Draw errors of stack and cradle, the restitution of the column, and the gas.

    The panel of the gas shows the shared impulse.
    """
    figure, axes = new_figure(PAGE_WIDTH, 4.8, 2, 2)
    draw_curves(axes[0, 0], data, "stack_n", "error", "balls")
    draw_curves(axes[0, 1], data, "cradle_exponent", "error", "$p$ of $F\\sim\\xi^p$")
    for axis in axes[0]:
        axis.set(yscale="log", ylim=(1e-4, 30.0), ylabel=ERROR_LABEL)
        axis.axhline(ERROR_LIMIT, color="black", lw=0.7, ls="--")
        axis.annotate(f"{100 * ERROR_LIMIT:g} % limit", (0.98, ERROR_LIMIT), (0, 2), fontsize=7.5, ha="right",
                      xycoords=("axes fraction", "data"), textcoords="offset points")
    draw_curves(axes[1, 0], data, "column_n", "mass_centre_ratio", "balls")
    axes[1, 0].set_ylabel("centre-of-mass restitution, soft/hard")
    shared = data["gas_shared_impulse"]
    image = axes[1, 1].pcolormesh(data["gas_duration"], data["gas_packing"], np.maximum(shared, 1e-6),
                                  shading="nearest", norm=LogNorm(1e-3, 1.0), cmap="cividis", rasterized=True)
    axes[1, 1].set(xscale="log", xlabel="contact duration, $t_c$ (s)", ylabel="packing fraction")
    figure.colorbar(image, ax=axes[1, 1], label=r"shared impulse, $\varphi$", extend="min")
    for axis, tag in zip(axes.flat, "abcd", strict=True):
        add_letter(axis, f"({tag})", x=0.93, color="white" if tag == "d" else "black")
    return figure


def draw_curves(axis, data, name, measure, title):
    """Draw a measure over the gap, one line per value of the parameter `name`."""
    kind, values = name.partition("_")[0], data[name]
    colours = matplotlib.colormaps["viridis"](np.linspace(0.7, 0.0, len(values)))
    looks = zip(values, data[f"{kind}_{measure}"], colours, "o^sDvP"[: len(values)], strict=True)
    for value, row, shade, mark in looks:
        axis.plot(data[f"{kind}_gap"], row, mark, ls="-", color=shade, label=f"{value:g}", ms=2.8, lw=0.7, mew=0.5,
                  mfc="white")
    axis.set(xscale="log", xlabel="gap (m)")
    axis.legend(title=title, title_fontsize=7.5, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.4,
                borderaxespad=0.3)


if __name__ == "__main__":
    main(compute, draw, 24)
