"""Figure 6: ε_eff over the ratio of radii

ε_eff/ε and contacts over R1/R2 at ε = 0.8, with constant R2 and z1. ε_eff can exceed ε.
"""

import numpy as np
from counts import AXIS_LABELS, UPPER_RADIUS
from gap import draw_staircase, draw_with_inset
from setting import COLUMN_WIDTH, SOFT_COLOUR, add_letter, main, new_figure

import granular as gr


def compute(points):
    """ε_eff/ε and contacts over R1/R2, on a finer grid below 1.6."""
    ratio = np.unique(np.concatenate([np.linspace(1.0, 20.0, points), np.linspace(1.0, 1.6, points // 2 + 1)]))
    data = gr.sweep("three-balls", {"radii[0]": UPPER_RADIUS * ratio}, ("contacts", "eps_ratio"), restitution=0.8)
    return {"restitution": 0.8, "ratio": ratio, "eps_ratio": data["eps_ratio"].values,
            "contacts": data["contacts"].values[:, 1]}


def draw(data):
    """Draw the ratio with an inset of the region above 1, and the contacts below."""
    figure, axes = new_figure(COLUMN_WIDTH, 3.3, 2, 1, sharex=True, height_ratios=[1.5, 0.8])
    ratio, value = data["ratio"], data["eps_ratio"]
    peak = int(np.nanargmax(value))
    inset = draw_with_inset(axes[0, 0], ratio, value, (0.42, 0.34, 0.48, 0.56), 1.0)
    inset.plot(ratio[peak], value[peak], ".", color=SOFT_COLOUR, ms=4)
    inset.annotate(f"{value[peak]:.5f} at {ratio[peak]:.3f}", (ratio[peak], value[peak]), (0.44, 0.14),
                   textcoords="axes fraction", ha="center", fontsize=6.5)
    inset.set(xlim=(1.0, 1.6), ylim=(0.9965, 1.0032))
    axes[0, 0].set_ylim(-0.03, 1.12)
    add_letter(axes[0, 0], "(a)", x=0.94)
    draw_staircase(axes[1, 0], ratio, data["contacts"])
    axes[1, 0].set(xticks=[1, 5, 10, 15, 20], xlabel=AXIS_LABELS["ratio"])
    add_letter(axes[1, 0], "(b)")
    figure.align_ylabels(axes)
    return figure


if __name__ == "__main__":
    main(compute, draw, 1500)
