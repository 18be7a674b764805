"""Figures 1 and 2: the problem with its notation, and the forces of both contacts over time, ε = 0.7.
May be skipped: figures of the paper, beside the engines.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular import edmd, md, scenes
from granular.drawing import COLUMN, GREY, HARD, SOFT, canvas, letter
from granular.paper import setting
from granular.rules import ConstantRestitution

RESTITUTION = 0.7


def sketch(points: int) -> dict[str, Any]:
    """Nothing is computed: a sketch, in lengths of its own."""
    return {"R1": 1.0, "R2": 0.45, "gap": 0.28, "z1": 1.7}


def draw_sketch(data: dict[str, Any]) -> Any:
    """Two balls above a floor; bodies are numbered from the floor up."""
    from matplotlib.patches import Circle

    figure, ((axis,),) = canvas(COLUMN, 3.6)
    r1, r2, gap, z1 = data["R1"], data["R2"], data["gap"], data["z1"]
    top = z1 + r1 + gap
    z2 = top + r2
    axis.fill_between([-2.0, 2.2], -0.28, 0.0, facecolor="white", hatch="////", edgecolor=GREY, lw=0)
    axis.plot([-2.0, 2.2], [0.0, 0.0], color="black", lw=1.2)
    for z, r, name in ((z1, r1, "1"), (z2, r2, "2")):
        axis.add_patch(Circle((0.0, z), r, facecolor=SOFT + "2e", edgecolor=SOFT, lw=1.0))
        axis.plot([0.0], [z], ".", color="black", ms=3)
        axis.text(-0.08, z + 0.08, name, ha="right", va="bottom", fontsize=10)
        _arrow(axis, (0.0, z), (0.87 * r, z - 0.5 * r))
        axis.text(0.5 * r, z - 0.22 * r, f"$R_{name}$", ha="left", va="bottom")
    spans = ((1.25, 0.0, z1, "$z_1$"), (1.75, 0.0, z2, "$z_2$"), (-0.75, z1 + r1, top, r"$\Delta h$"))
    for x, low, high, name in spans:
        _arrow(axis, (x, low), (x, high), "<|-|>")
        axis.text(x + np.copysign(0.08, x), 0.5 * (low + high), name, ha="right" if x < 0.0 else "left", va="center")
    for z, left, right in ((z1, r1 + 0.05, 1.35), (z2, r2 + 0.05, 1.85), (z1 + r1, -0.85, 0.0), (top, -0.85, 0.0)):
        axis.plot([left, right], [z, z], color=GREY, lw=0.5, ls=(0, (4, 3)))
    _arrow(axis, (-1.6, 2.6), (-1.6, 1.9))
    axis.text(-1.5, 2.2, "$g$", ha="left", va="center")
    axis.text(-1.9, 0.06, "0 (floor)", ha="left", va="bottom")
    axis.set(xlim=(-2.05, 2.25), ylim=(-0.3, z2 + r2 + 0.1), aspect="equal")
    axis.set_axis_off()
    return figure


def _arrow(axis: Any, start: tuple[float, float], end: tuple[float, float], heads: str = "-|>") -> None:
    how = {"arrowstyle": heads, "lw": 0.7, "color": "black", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
    axis.annotate("", xy=end, xytext=start, arrowprops=how)


def forces(points: int) -> dict[str, Any]:
    """Forces in N at `points` times in s, contacts of both pairs, and the instants at which hard spheres collide."""
    scene = scenes.three_balls()
    law, start = setting.dashpots(scene, RESTITUTION), setting.first_touch(scene)
    run = setting.until_second_floor_contact(scene, law)
    times = np.linspace(-2e-5, 9e-4, points)
    soft = md.simulate(scene, law, t_end=start + 9e-4, samples=start + times)
    hard = edmd.simulate(scene, ConstantRestitution(RESTITUTION), until=setting.SECOND_FLOOR_CONTACT)
    floor, upper = np.transpose(np.asarray(soft.force))
    return {
        "restitution": RESTITUTION, "time_s": times, "F01_N": floor, "F12_N": upper,
        "contacts12_s": setting.intervals(run), "floor_end_s": run.of(0)["t_end"][0] - start,
        "hard_s": {"01": hard.of(0)["t_begin"] - start, "12": hard.of(1)["t_begin"] - start},
    }  # fmt: skip


def draw_forces(data: dict[str, Any]) -> Any:
    """Two panels over one clock."""
    figure, axes = canvas(COLUMN, 3.2, 2, 1, sharex=True)
    clock = data["time_s"] * 1e3
    panels = (("F01_N", 1e3, "$F_{01}$  (kN)", "01", "(a)"), ("F12_N", 1.0, "$F_{12}$  (N)", "12", "(b)"))
    for axis, (name, unit, label, pair, tag) in zip(axes[:, 0], panels, strict=True):
        for begin, end in data["contacts12_s"]:
            axis.axvspan(begin * 1e3, end * 1e3, color=SOFT, alpha=0.12, lw=0)
        axis.plot(clock, data[name] / unit, color=SOFT)
        for t in data["hard_s"][pair]:
            axis.axvline(t * 1e3, color=HARD, lw=0.9, ls="--", label="hard spheres collide")
        axis.set(ylim=(0.0, 1.12 * data[name].max() / unit), ylabel=label)
        letter(axis, tag, x=0.94)
    last = float(data["contacts12_s"][-1][1])
    _instant(axes[0, 0], 0.0, r"$t_{01}^{(b)}$", "left")
    _instant(axes[0, 0], data["floor_end_s"] * 1e3, r"$t_{01}^{(e)}$", "left")
    _instant(axes[1, 0], last * 1e3, r"$t_{12}^{(e)}=t_f$", "left")
    axes[1, 0].legend(loc="upper right", bbox_to_anchor=(0.93, 1.0))
    axes[1, 0].set(xlim=(clock[0], clock[-1]), xlabel="$t-t_{10}$  (ms)")
    figure.align_ylabels(axes)
    return figure


def _instant(axis: Any, t: float, name: str, side: str) -> None:
    """Name an instant at the foot of a panel."""
    axis.axvline(t, color=GREY, lw=0.6, ls=":")
    axis.annotate(name, (t, 0.0), (3, 8), xycoords=("data", "axes fraction"), textcoords="offset points", ha=side,
                  va="bottom", bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5})  # fmt: skip
