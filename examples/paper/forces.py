"""Figure 2: the forces of both contacts over time

Hard spheres collide once. Soft spheres have four short contacts while the lower ball is on the floor. ε = 0.7.
"""

import numpy as np
from setting import (
    COLUMN_WIDTH,
    GREY_COLOUR,
    HARD_COLOUR,
    SECOND_BOUNCE,
    SOFT_COLOUR,
    add_letter,
    contacts,
    dashpot_laws,
    main,
    new_figure,
)

import granular as gr

RESTITUTION = 0.7


def compute(points):
    """Forces in N at `points` times in s, contacts, and times of hard collisions."""
    scene = gr.scenes.three_balls()
    law, times = dashpot_laws(scene, RESTITUTION), np.linspace(-2e-5, 9e-4, points)
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(RESTITUTION), until=SECOND_BOUNCE)
    start = hard.of(0)["t_begin"][0]
    soft = gr.md.simulate(scene, law, t_end=start + 9e-4, samples=start + times)
    floor, upper = np.transpose(soft.force)
    touches, floor_end = contacts(scene, law)
    return {"restitution": RESTITUTION, "time_s": times, "F01_N": floor, "F12_N": upper,
            "contacts12_s": touches, "floor_end_s": floor_end,
            "hard_s": {"01": hard.of(0)["t_begin"] - start, "12": hard.of(1)["t_begin"] - start}}


def draw(data):
    """Draw two panels over the same time axis."""
    figure, axes = new_figure(COLUMN_WIDTH, 3.2, 2, 1, sharex=True)
    clock = data["time_s"] * 1e3
    panels = (("F01_N", 1e3, "$F_{01}$  (kN)", "01", "(a)"), ("F12_N", 1.0, "$F_{12}$  (N)", "12", "(b)"))
    for axis, (name, unit, label, pair, tag) in zip(axes[:, 0], panels, strict=True):
        for begin, end in data["contacts12_s"]:
            axis.axvspan(begin * 1e3, end * 1e3, color=SOFT_COLOUR, alpha=0.12, lw=0)
        axis.plot(clock, data[name] / unit, color=SOFT_COLOUR)
        for t in data["hard_s"][pair]:
            axis.axvline(t * 1e3, color=HARD_COLOUR, lw=0.9, ls="--", label="hard spheres collide")
        axis.set(ylim=(0.0, 1.12 * data[name].max() / unit), ylabel=label)
        add_letter(axis, tag, x=0.94)
    instants = ((0, 0.0, "$t_{01}^{(b)}$"), (0, data["floor_end_s"], "$t_{01}^{(e)}$"),
                (1, data["contacts12_s"][-1][1], "$t_{12}^{(e)}=t_f$"))
    for row, t, name in instants:
        axes[row, 0].axvline(t * 1e3, color=GREY_COLOUR, lw=0.6, ls=":")
        axes[row, 0].annotate(name, (t * 1e3, 0.0), (3, 8), xycoords=("data", "axes fraction"), va="bottom",
                              textcoords="offset points",
                              bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5})
    axes[1, 0].legend(loc="upper right", bbox_to_anchor=(0.93, 1.0))
    axes[1, 0].set(xlim=(clock[0], clock[-1]), xlabel="$t-t_{10}$  (ms)")
    figure.align_ylabels(axes)
    return figure


if __name__ == "__main__":
    main(compute, draw, 2000)
