"""Figures 5 and 6: ε_eff/ε_spec and the number of contacts, over Δh and over R1/R2."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.paper.drawing import COLUMN, GREY, SOFT, canvas, letter
from granular.paper.maps import UPPER
from granular.sweeps import sweep

RATIO = r"$\varepsilon_{\mathrm{eff}}/\varepsilon$"


def over_gap(points: int) -> dict[str, Any]:
    """Over Δh in m, ε = 0.9."""
    data = sweep("three-balls", {"gap": np.geomspace(1e-7, 1e-1, points)}, ("contacts", "eps_ratio"), restitution=0.9)
    return {"restitution": 0.9, "gap_m": data["gap"].values, **_of(data)}


def over_radii(points: int) -> dict[str, Any]:
    """Over R1/R2, ε = 0.8, R2 and z1 held; ongoing: the balls still touch as the second floor contact begins."""
    ratio = np.unique(np.concatenate([np.linspace(1.0, 20.0, points), np.linspace(1.0, 1.6, points // 2 + 1)]))
    radii = {"radii[0]": UPPER * ratio}
    return {"restitution": 0.8, "ratio": ratio,
            **_of(sweep("three-balls", radii, ("contacts", "eps_ratio"), restitution=0.8))}


def draw_gap(data: dict[str, Any]) -> Any:
    """Ratio with its small values magnified, and contacts below."""
    figure, axes = canvas(COLUMN, 4.0, 3, 1, sharex=True, height_ratios=[1.2, 1.0, 0.8])
    top, middle, low = axes[:, 0]
    gap, ratio = data["gap_m"], data["eps_ratio"]
    top.axhline(1.0, color=GREY, lw=0.5, ls="--")
    for axis, tag in ((top, "(a)"), (middle, "(b)")):
        axis.plot(gap, ratio, color=SOFT)
        axis.set_ylabel(RATIO)
        letter(axis, tag)
    top.set_ylim(-0.03, 1.2)
    middle.set(yscale="log", ylim=(5e-4, 2.0))
    _steps(low, gap, data["contacts"])
    letter(low, "(c)")
    low.set(xscale="log", xlim=(gap[0], gap[-1]), xlabel=r"$\Delta h$  (m)")
    inset = top.inset_axes((0.16, 0.42, 0.34, 0.46))
    inset.plot(gap, ratio, color=SOFT)
    inset.axhline(ratio[-1], color=GREY, lw=0.5, ls="--")
    inset.set(xscale="log", xlim=(2e-3, 1e-1), ylim=(0.9985, 1.0015))
    inset.set_yticks([0.999, 1.0, ratio[-1]], ["0.999", "1", f"{ratio[-1]:.6f}"])
    inset.tick_params(labelsize=6)
    figure.align_ylabels(axes)
    return figure


def draw_radii(data: dict[str, Any]) -> Any:
    """Ratio with the region above 1 as inset, and contacts below."""
    figure, axes = canvas(COLUMN, 3.3, 2, 1, sharex=True, height_ratios=[1.5, 0.8])
    top, low = axes[:, 0]
    ratio, value = data["ratio"], data["eps_ratio"]
    top.axhline(1.0, color=GREY, lw=0.5, ls="--")
    top.plot(ratio, value, color=SOFT)
    top.set(ylabel=RATIO, ylim=(-0.03, 1.12))
    letter(top, "(a)", x=0.94)
    inset = top.inset_axes((0.42, 0.34, 0.48, 0.56))
    inset.plot(ratio, value, color=SOFT)
    inset.axhline(1.0, color=GREY, lw=0.5, ls="--")
    peak = int(np.nanargmax(value))
    inset.plot(ratio[peak], value[peak], ".", color=SOFT, ms=4)
    inset.annotate(f"{value[peak]:.5f} at {ratio[peak]:.3f}", (ratio[peak], value[peak]), (0.44, 0.14),
                   textcoords="axes fraction", ha="center", fontsize=6.5)
    inset.set(xlim=(1.0, 1.6), ylim=(0.9965, 1.0032))
    inset.tick_params(labelsize=6)
    _steps(low, ratio, data["contacts"])
    letter(low, "(b)")
    low.set(xlim=(ratio[0], ratio[-1]), xticks=[1, 5, 10, 15, 20], xlabel="$R_1/R_2$")
    figure.align_ylabels(axes)
    return figure


def _steps(axis: Any, x: Any, contacts: Any) -> None:
    axis.step(x, contacts, where="mid", color=SOFT)
    axis.set(ylabel="contacts", ylim=(0.0, max(contacts) + 1.5),
             yticks=range(0, max(contacts) + 2, 2 if max(contacts) < 10 else 4))


def _of(data: Any) -> dict[str, Any]:
    return {"eps_ratio": data["eps_ratio"].values, "contacts": data["contacts"].values[:, 1]}
