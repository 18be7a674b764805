"""Figure 5: ε_eff over the gap

ε_eff/ε and contacts over Δh at ε = 0.9. The limit at large gaps is not 1, because gravity acts during the floor
contact.
"""

import numpy as np
from counts import AXIS_LABELS
from setting import COLUMN_WIDTH, GREY_COLOUR, SOFT_COLOUR, add_letter, main, new_figure

import granular as gr

RATIO_LABEL = r"$\varepsilon_{\mathrm{eff}}/\varepsilon$"
AXIS_MINIMUM, JUMP_SHARE = 5e-4, 0.2
"""Minimum of the logarithmic axis, and relative change that counts as a jump."""


def compute(points):
    """ε_eff/ε and contacts over Δh in m."""
    gap = np.geomspace(1e-7, 1e-1, points)
    data = gr.sweep("three-balls", {"gap": gap}, ("contacts", "eps_ratio"), restitution=0.9)
    return {"restitution": 0.9, "gap_m": gap, "eps_ratio": data["eps_ratio"].values,
            "contacts": data["contacts"].values[:, 1]}


def curve_with_dips(x, ratio, contacts):
    """Curve with an additional point below `AXIS_MINIMUM` beside each jump.

    The points make dips visible on any grid. Towards a gap at which the last contact vanishes, this contact comes later
    and later, up to the second floor contact. The ratio falls to 2e-8 (Δh = 2.7e-6 m) … 2.2e-4 (Δh = 4.7e-4 m).
    """
    x, ratio, contacts = (np.asarray(values, float) for values in (x, ratio, contacts))
    jumps = np.sign(np.diff(contacts)) * np.diff(np.log(np.maximum(ratio, 1e-300))) < -JUMP_SHARE
    at = np.flatnonzero(jumps)
    return np.insert(x, at + 1, np.sqrt(x[at] * x[at + 1])), np.insert(ratio, at + 1, 0.5 * AXIS_MINIMUM)


def draw(data):
    """Draw the ratio with its small values magnified, and the contacts below."""
    figure, axes = new_figure(COLUMN_WIDTH, 4.0, 3, 1, sharex=True, height_ratios=[1.2, 1.0, 0.8])
    gap, ratio = data["gap_m"], data["eps_ratio"]
    inset = draw_with_inset(axes[0, 0], gap, ratio, (0.09, 0.36, 0.3, 0.44), ratio[-1])
    inset.yaxis.tick_right()  # on the left they would touch the labels of the main axis
    inset.set(xscale="log", xlim=(2e-3, 1e-1), ylim=(0.9985, 1.0015))
    inset.set_yticks([0.999, 1.0, ratio[-1]], ["0.999", "1", f"{ratio[-1]:.6f}"])
    axes[0, 0].set_ylim(-0.03, 1.2)
    axes[1, 0].plot(*curve_with_dips(gap, ratio, data["contacts"]), color=SOFT_COLOUR)
    axes[1, 0].set(yscale="log", ylim=(AXIS_MINIMUM, 2.0), ylabel=RATIO_LABEL)
    draw_staircase(axes[2, 0], gap, data["contacts"])
    axes[2, 0].set(xscale="log", xlabel=AXIS_LABELS["gap"])
    for axis, tag in zip(axes[:, 0], "abc", strict=True):
        add_letter(axis, f"({tag})")
    figure.align_ylabels(axes)
    return figure


def draw_with_inset(axis, x, ratio, place, level):
    """Draw the ratio with a line at 1, and an inset with a line at `level`."""
    inset = axis.inset_axes(place)
    for one, marked in ((axis, 1.0), (inset, level)):
        one.axhline(marked, color=GREY_COLOUR, lw=0.5, ls="--")
        one.plot(x, ratio, color=SOFT_COLOUR)
    axis.set_ylabel(RATIO_LABEL)
    inset.tick_params(labelsize=6)
    return inset


def draw_staircase(axis, x, contacts):
    """Draw the number of contacts as a staircase."""
    most = max(contacts)
    axis.step(x, contacts, where="mid", color=SOFT_COLOUR)
    axis.set(ylabel="contacts", xlim=(x[0], x[-1]), ylim=(0.0, most + 1.5))
    axis.set_yticks(range(0, most + 2, 2 if most < 10 else 4))


if __name__ == "__main__":
    main(compute, draw, 1500)
