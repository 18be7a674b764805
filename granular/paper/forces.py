"""Figure 2: the forces of both contacts over time, ε = 0.7."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular import edmd, md
from granular.paper import setting
from granular.paper.drawing import COLUMN, HARD, SOFT, canvas, letter
from granular.rules import ConstantRestitution

RESTITUTION = 0.7


def compute(points: int) -> dict[str, Any]:
    """Forces in N at `points` times in s, contacts of both pairs, and the instants at which hard spheres collide."""
    scene = setting.drop()
    law, start = setting.dashpots(scene, RESTITUTION), setting.first_touch(scene)
    run = setting.until_second_floor_contact(scene, law)
    times = np.linspace(-2e-5, 9e-4, points)
    soft = md.simulate(scene, law, t_end=start + 9e-4, samples=start + times)
    hard = edmd.simulate(scene, ConstantRestitution(RESTITUTION), until=setting.SECOND_FLOOR_CONTACT)
    assert soft.force is not None
    return {
        "restitution": RESTITUTION, "time_s": times, "F01_N": soft.force[:, 0], "F12_N": soft.force[:, 1],
        "contacts12_s": setting.intervals(run), "floor_end_s": run.of(0)["t_end"][0] - start,
        "hard_s": {"01": hard.of(0)["t_begin"] - start, "12": hard.of(1)["t_begin"] - start},
    }  # fmt: skip


def draw(data: dict[str, Any]) -> Any:
    """Two panels over one clock."""
    figure, axes = canvas(COLUMN, 3.2, 2, 1, sharex=True)
    clock = data["time_s"] * 1e3
    panels = (("F01_N", 1e3, "$F_{01}$  (kN)", "01", "(a)"), ("F12_N", 1.0, "$F_{12}$  (N)", "12", "(b)"))
    for axis, (name, unit, label, pair, tag) in zip(axes[:, 0], panels, strict=True):
        for begin, end in data["contacts12_s"]:
            axis.axvspan(begin * 1e3, end * 1e3, color=SOFT, alpha=0.12, lw=0)
        axis.plot(clock, data[name] / unit, color=SOFT)
        for t in data["hard_s"][pair]:
            axis.axvline(t * 1e3, color=HARD, lw=0.9, ls="--")
        axis.set(ylim=(0.0, 1.12 * data[name].max() / unit), ylabel=label)
        letter(axis, tag, x=0.94)
    axes[1, 0].plot([], [], color=HARD, ls="--", lw=0.9, label="hard spheres collide")
    axes[1, 0].legend(loc="upper right", bbox_to_anchor=(0.93, 1.0))
    axes[1, 0].set(xlim=(clock[0], clock[-1]), xlabel="$t-t_{10}$  (ms)")
    figure.align_ylabels(axes)
    return figure
