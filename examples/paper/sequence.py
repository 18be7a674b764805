"""Figure 3: the sequence of contacts over ε

Each vertical line is a run. Bands are contacts of the two balls. Dashed lines show the adiabatic theory.
"""

import numpy as np
from forces import RESTITUTION
from setting import (
    COLUMN_WIDTH,
    FLOOR_COLOUR,
    GREY_COLOUR,
    SOFT_COLOUR,
    contacts,
    dashpot_laws,
    main,
    new_figure,
    sequence_kind,
    stretches_of_one_kind,
)

import granular as gr

BASE_SCENE = gr.scenes.three_balls()


def compute(points):
    """Contacts of the simulation and of the adiabatic theory over ε.

    The grid is refined where the number of contacts jumps.
    """
    grid = np.linspace(0.3, 1.0, points)

    def adiabatic(restitution):
        theory = gr.adiabatic.contacts(BASE_SCENE, dashpot_laws(BASE_SCENE, restitution))
        return theory.contacts, theory.floor_end

    return {"restitution": grid, **numerical_sequence(dashpot_contacts, grid),
            "adiabatic": stretches_of_one_kind(adiabatic, grid)}


def dashpot_contacts(restitution):
    """Contacts with linear dashpots of one ε."""
    return contacts(BASE_SCENE, dashpot_laws(BASE_SCENE, restitution))


def numerical_sequence(row, grid):
    """Stretches of runs, and "spikes": [from, to, number of contacts].

    In a spike, the last contact begins after the end of the floor contact.
    """
    stretches = stretches_of_one_kind(row, grid)
    kinds = [(one["parameter"], *sequence_kind((one["contacts"][..., 0], one["floor_end"][0]))) for one in stretches]
    return {"numerical": stretches,
            "spikes": [[float(x[0]), float(x[-1]), count] for x, count, late in kinds if count > 1 and late]}


def draw(data, label=r"$\varepsilon$", top=1.2, unit=1.0, marked=RESTITUTION):
    """Draw contact times over a parameter in a unit.

    The thick line marks the run of figure 2.
    """
    figure, ((axis,),) = new_figure(COLUMN_WIDTH, 2.9)
    for one in data["numerical"]:
        x = one["parameter"] * unit
        for onset, end in one["contacts"] * 1e3:
            axis.fill_between(x, onset, end, facecolor=SOFT_COLOUR, alpha=0.3, lw=0)
            axis.plot(x, np.transpose([onset, end]), color=SOFT_COLOUR, lw=0.5)
        axis.plot(x, one["floor_end"] * 1e3, color=FLOOR_COLOUR, lw=1.4)
    axis.fill_between([], [], facecolor=SOFT_COLOUR, alpha=0.3, edgecolor=SOFT_COLOUR, label="contacts 1–2")
    axis.plot([], [], color=FLOOR_COLOUR, lw=1.4, label="end of contact 0–1")
    theory = {"color": "black", "lw": 0.6, "ls": (0, (4, 2))}
    for one in data.get("adiabatic", ()):
        axis.plot(one["parameter"], one["contacts"].reshape(-1, len(one["parameter"])).T * 1e3, **theory)
    if "adiabatic" in data:
        axis.plot([], [], label="adiabatic theory", **theory)
    if marked is not None:
        axis.axvline(marked, color=GREY_COLOUR, lw=2.5, alpha=0.5, zorder=0)
        axis.annotate("figure 2", (marked, 0.03), (4, 0), xycoords=("data", "axes fraction"),
                      textcoords="offset points", color="#555555")
    first, last = data["numerical"][0], data["numerical"][-1]
    axis.set(xlabel=label, ylabel="$t-t_{10}$  (ms)", ylim=(0.0, top),
             xlim=(first["parameter"][0] * unit, last["parameter"][-1] * unit))
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, columnspacing=1.0, handlelength=1.6)
    return figure


if __name__ == "__main__":
    main(compute, draw, 400)
