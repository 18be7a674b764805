"""Figures 4, 5 and 6: contacts and ε_eff/ε_spec over ε, Δh and R1/R2, as maps and as curves; and a map of validity.
May be skipped: figures of the paper, beside the engines.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular.drawing import COLUMN, GREY, HARD, PAGE, SOFT, canvas, letter, shades
from granular.paper.problem import RESTITUTION
from granular.sweeps import sweep
from granular.sweeps.store import xarray_

WRONG = 0.01
"""Where ε_eff differs from ε_spec by more than this share, the scene may not be event-driven."""
LOWEST = 5e-4
"""Where the logarithmic axis of figure 5 begins."""
JUMP = 0.2
"""A ratio that changes from point to point by this share as a contact appears has jumped."""
NAMES = {"restitution": r"$\varepsilon$", "gap": r"$\Delta h$  (m)", "ratio": "$R_1/R_2$"}
RATIO = r"$\varepsilon_{\mathrm{eff}}/\varepsilon$"
RATIOS = [1, 5, 10, 15, 20]
BASE = {"gap": 1e-4, "ratio": 10.0}
"""What is held in figures 2 and 3, Δh in m."""
UPPER = 0.01
"""Radius R2 in m."""


def counts(points: int) -> Any:
    """Contacts of the two balls over (ε, Δh) and (ε, R1/R2)."""
    eps, gaps, radii = _axes(points)
    return joined(
        gap=sweep("three-balls", {"gap": gaps, "restitution": eps}, "contacts"),
        radii=_ratio(sweep("three-balls", {"radii[0]": radii, "restitution": eps}, "contacts")),
    )


def validity(points: int) -> Any:
    """ε_eff/ε_spec over (ε, Δh), and over (Δh, R1/R2) at ε = 0.8."""
    eps, gaps, radii = _axes(points)
    return joined(
        gap=sweep("three-balls", {"gap": gaps, "restitution": eps}, "eps_ratio"),
        radii=_ratio(sweep("three-balls", {"gap": gaps, "radii[0]": radii}, "eps_ratio", restitution=0.8)),
    )


def over_gap(points: int) -> dict[str, Any]:
    """Over Δh in m, ε = 0.9."""
    gap = np.geomspace(1e-7, 1e-1, points)
    return {"restitution": 0.9, "gap_m": gap, **_curves({"gap": gap}, 0.9)}


def over_radii(points: int) -> dict[str, Any]:
    """Over R1/R2, ε = 0.8, R2 and z1 held; ongoing: the balls still touch as the second floor contact begins."""
    ratio = np.unique(np.concatenate([np.linspace(1.0, 20.0, points), np.linspace(1.0, 1.6, points // 2 + 1)]))
    return {"restitution": 0.8, "ratio": ratio, **_curves({"radii[0]": UPPER * ratio}, 0.8)}


def _axes(points: int) -> tuple[Any, Any, Any]:
    """Values of ε, Δh in m, and R1 in m."""
    return (np.linspace(0.1, 1.0, points), np.geomspace(1e-7, 1e-2, points), UPPER * np.linspace(1.0, 20.0, points))


def _curves(over: dict[str, Any], restitution: float) -> dict[str, Any]:
    data = sweep("three-balls", over, ("contacts", "eps_ratio"), restitution=restitution)
    return {"eps_ratio": data["eps_ratio"].values, "contacts": data["contacts"].values[:, 1]}


def _ratio(data: Any) -> Any:
    """The axis of R1 as one of R1/R2."""
    scaled = data.assign_coords({"radii[0]": data["radii[0]"] / UPPER}).rename({"radii[0]": "ratio"})
    scaled["ratio"].attrs.update(units="1", long_name="R1/R2")
    return scaled


def joined(**parts: Any) -> Any:
    """Several maps in one data set, names and axes with their prefix."""
    alone = {prefix: data.drop_vars(["pair", "body"], errors="ignore") for prefix, data in parts.items()}
    named = [data.rename({name: f"{prefix}_{name}" for name in data.variables}) for prefix, data in alone.items()]
    return xarray_().merge(named, combine_attrs="drop_conflicts")


def draw_counts(data: Any) -> Any:
    """Two maps with one scale of colours, light to dark."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    maps = [data[f"{name}_contacts"].isel(pair=1) for name in ("gap", "radii")]
    most = max(int(one.max()) for one in maps)
    figure, bar = _maps(maps, "contacts of the two balls", cmap=ListedColormap(shades("viridis", most)),
                        norm=BoundaryNorm(np.arange(0.5, most + 1.0), most))  # fmt: skip
    bar.set_ticks(np.arange(1, most + 1, 2))
    bar.ax.minorticks_off()
    gaps, radii = figure.axes[:2]
    for axis, held, cut in ((gaps, BASE["gap"], 0.9), (radii, BASE["ratio"], 0.8)):
        axis.axhline(held, color="black", lw=0.6, ls="--")
        axis.axvline(cut, color="black", lw=0.6, ls="--")
        axis.plot([RESTITUTION], [held], "+", color="black", ms=8, mew=1.2)
    radii.axhline(1.0, color="black", lw=1.0)
    radii.set_ylim(bottom=0.4)
    return figure


def draw_validity(data: Any) -> Any:
    """Two maps of the ratio, with the line beyond which event-driven simulation is right to one per cent."""
    maps = [data["gap_eps_ratio"], data["radii_eps_ratio"].transpose("radii_gap", "radii_ratio")]
    figure, _ = _maps([one.clip(0.0, 1.0) for one in maps], RATIO, cmap="cividis", vmin=0.0, vmax=1.0)
    for axis, one in zip(figure.axes, maps, strict=False):
        x, y = (one[dim].values for dim in reversed(one.dims))
        axis.contour(x, y, np.abs(one.values - 1.0), [WRONG], colors=[HARD], linewidths=1.0)
    figure.axes[0].plot([], [], color=HARD, lw=1.0, label=f"{100 * WRONG:g} % from 1")
    figure.axes[0].legend(loc="lower left", labelcolor="white")
    return figure


def _maps(maps: list[Any], title: str, **colours: Any) -> tuple[Any, Any]:
    """Two arrays side by side, each over its two axes, the first upwards; the figure and its bar of colours."""
    figure, (axes,) = canvas(PAGE, 2.7, 1, 2)
    for axis, one, tag in zip(axes, maps, "ab", strict=True):
        up, across = (str(dim) for dim in one.dims)
        image = axis.pcolormesh(one[across], one[up], one.values, rasterized=True, shading="nearest", **colours)
        for dim, letter_of in ((up, "y"), (across, "x")):
            kind = dim.rpartition("_")[2]
            axis.set(**{f"{letter_of}scale": "log" if kind == "gap" else "linear", f"{letter_of}label": NAMES[kind]})
            if kind == "ratio":
                axis.set(**{f"{letter_of}ticks": RATIOS})
        letter(axis, f"({tag})", bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5})
    return figure, figure.colorbar(image, ax=axes, label=title, pad=0.015)


def draw_gap(data: dict[str, Any]) -> Any:
    """Ratio with its small values magnified, and contacts below."""
    figure, axes = canvas(COLUMN, 4.0, 3, 1, sharex=True, height_ratios=[1.2, 1.0, 0.8])
    gap, ratio = data["gap_m"], data["eps_ratio"]
    inset = _magnified(axes[0, 0], gap, ratio, (0.09, 0.36, 0.3, 0.44), ratio[-1])
    inset.yaxis.tick_right()  # beside the axis on the left they would read as one
    inset.set(xscale="log", xlim=(2e-3, 1e-1), ylim=(0.9985, 1.0015))
    inset.set_yticks([0.999, 1.0, ratio[-1]], ["0.999", "1", f"{ratio[-1]:.6f}"])
    axes[0, 0].set_ylim(-0.03, 1.2)
    axes[1, 0].plot(*closed(gap, ratio, data["contacts"]), color=SOFT)
    axes[1, 0].set(yscale="log", ylim=(LOWEST, 2.0), ylabel=RATIO)
    _steps(axes[2, 0], gap, data["contacts"])
    axes[2, 0].set(xscale="log", xlabel=NAMES["gap"])
    for axis, tag in zip(axes[:, 0], "abc", strict=True):
        letter(axis, f"({tag})")
    figure.align_ylabels(axes)
    return figure


def closed(x: Any, ratio: Any, contacts: Any) -> tuple[Any, Any]:
    """The same curve with its dips drawn on to below `LOWEST`, however coarse the grid.

    Towards a gap at which the last contact vanishes it comes later and later, up to the second floor contact, and the
    ratio falls to 2e-8 (Δh = 2.7e-6 m) … 2.2e-4 (Δh = 4.7e-4 m): a point is added between the two of the grid beside
    the jump.
    """
    x, ratio, contacts = (np.asarray(values, float) for values in (x, ratio, contacts))
    more = np.sign(np.diff(contacts))
    jumps = more * np.diff(np.log(np.maximum(ratio, 1e-300))) < -JUMP
    at = np.flatnonzero(jumps)
    between = np.sqrt(x[at] * x[at + 1])
    return np.insert(x, at + 1, between), np.insert(ratio, at + 1, 0.5 * LOWEST)


def draw_radii(data: dict[str, Any]) -> Any:
    """Ratio with the region above 1 as inset, and contacts below."""
    figure, axes = canvas(COLUMN, 3.3, 2, 1, sharex=True, height_ratios=[1.5, 0.8])
    ratio, value = data["ratio"], data["eps_ratio"]
    peak = int(np.nanargmax(value))
    inset = _magnified(axes[0, 0], ratio, value, (0.42, 0.34, 0.48, 0.56), 1.0)
    inset.plot(ratio[peak], value[peak], ".", color=SOFT, ms=4)
    inset.annotate(f"{value[peak]:.5f} at {ratio[peak]:.3f}", (ratio[peak], value[peak]), (0.44, 0.14),
                   textcoords="axes fraction", ha="center", fontsize=6.5)
    inset.set(xlim=(1.0, 1.6), ylim=(0.9965, 1.0032))
    axes[0, 0].set_ylim(-0.03, 1.12)
    letter(axes[0, 0], "(a)", x=0.94)
    _steps(axes[1, 0], ratio, data["contacts"])
    axes[1, 0].set(xticks=RATIOS, xlabel=NAMES["ratio"])
    letter(axes[1, 0], "(b)")
    figure.align_ylabels(axes)
    return figure


def _magnified(axis: Any, x: Any, ratio: Any, place: tuple[float, ...], level: float) -> Any:
    """The ratio, with 1 marked, and an inset for a part of it, with a level marked."""
    inset = axis.inset_axes(place)
    for one, marked in ((axis, 1.0), (inset, level)):
        one.axhline(marked, color=GREY, lw=0.5, ls="--")
        one.plot(x, ratio, color=SOFT)
    axis.set_ylabel(RATIO)
    inset.tick_params(labelsize=6)
    return inset


def _steps(axis: Any, x: Any, contacts: Any) -> None:
    axis.step(x, contacts, where="mid", color=SOFT)
    axis.set(ylabel="contacts", xlim=(x[0], x[-1]), ylim=(0.0, max(contacts) + 1.5),
             yticks=range(0, max(contacts) + 2, 2 if max(contacts) < 10 else 4))
