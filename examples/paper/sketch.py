"""Figure 1: the problem and its notation

Two balls above a floor, with bodies numbered from the floor upwards. Nothing is computed.
"""

import numpy as np
from matplotlib.patches import Circle
from setting import COLUMN_WIDTH, GREY_COLOUR, SOFT_COLOUR, main, new_figure


def compute(points):
    """Lengths of the sketch in arbitrary units."""
    return {"R1": 1.0, "R2": 0.45, "gap": 0.28, "z1": 1.7}


def draw(data):
    """Draw balls, lengths and gravity."""
    figure, ((axis,),) = new_figure(COLUMN_WIDTH, 3.6)
    r1, r2, gap, z1 = data["R1"], data["R2"], data["gap"], data["z1"]
    top = z1 + r1 + gap
    z2 = top + r2
    axis.fill_between([-2.0, 2.2], -0.28, 0.0, facecolor="white", hatch="////", edgecolor=GREY_COLOUR, lw=0)
    axis.plot([-2.0, 2.2], [0.0, 0.0], color="black", lw=1.2)
    for z, r, name in ((z1, r1, "1"), (z2, r2, "2")):
        axis.add_patch(Circle((0.0, z), r, facecolor=SOFT_COLOUR + "2e", edgecolor=SOFT_COLOUR, lw=1.0))
        axis.plot([0.0], [z], ".", color="black", ms=3)
        axis.text(-0.08, z + 0.08, name, ha="right", va="bottom", fontsize=10)
        arrow(axis, (0.0, z), (0.87 * r, z - 0.5 * r))
        axis.text(0.5 * r, z - 0.22 * r, f"$R_{name}$", ha="left", va="bottom")
    spans = ((1.25, 0.0, z1, "$z_1$"), (1.75, 0.0, z2, "$z_2$"), (-0.75, z1 + r1, top, r"$\Delta h$"))
    for x, low, high, name in spans:
        arrow(axis, (x, low), (x, high), "<|-|>")
        axis.text(x + np.copysign(0.08, x), 0.5 * (low + high), name, ha="right" if x < 0.0 else "left", va="center")
    for z, left, right in ((z1, r1 + 0.05, 1.35), (z2, r2 + 0.05, 1.85), (z1 + r1, -0.85, 0.0), (top, -0.85, 0.0)):
        axis.plot([left, right], [z, z], color=GREY_COLOUR, lw=0.5, ls=(0, (4, 3)))
    arrow(axis, (-1.6, 2.6), (-1.6, 1.9))
    axis.text(-1.5, 2.2, "$g$", ha="left", va="center")
    axis.text(-1.9, 0.06, "0 (floor)", ha="left", va="bottom")
    axis.set(xlim=(-2.05, 2.25), ylim=(-0.3, z2 + r2 + 0.1), aspect="equal")
    axis.set_axis_off()
    return figure


def arrow(axis, start, end, heads="-|>"):
    """Draw a thin arrow."""
    how = {"arrowstyle": heads, "lw": 0.7, "color": "black", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
    axis.annotate("", xy=end, xytext=start, arrowprops=how)


if __name__ == "__main__":
    main(compute, draw, 1)
