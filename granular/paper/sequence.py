"""Figures 3, 7 and 8: when the two balls touch, over ε or over a material; and as the adiabatic theory has it.
May be skipped: figures of the paper, beside the engines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from granular import adiabatic, scenes
from granular._check import Array
from granular.drawing import COLUMN, FLOOR, GREY, HARD, SOFT, canvas
from granular.laws import ViscoelasticHertz
from granular.paper import setting
from granular.paper.problem import RESTITUTION
from granular.scene import Scene

Row = tuple[Array, float]
"""Onset and end in s of every contact (count, 2), and the end of the floor contact in s."""
SPEED = 3.0
"""Of both viscoelastic balls as the lower one meets the floor, in m/s."""
AT_SPEED = rf"$\varepsilon$ of both contacts, each at an impact speed of {SPEED:g} m/s"
RADII, DENSITY = (0.1, 0.0025), 900.0


def over_restitution(points: int) -> dict[str, Any]:
    """Contacts of both solutions over ε, closer and closer to where their number jumps."""
    grid = np.linspace(0.3, 1.0, points)
    return {"restitution": grid, **_numerical(dashpots, grid), "adiabatic": follow(_adiabatic, grid)}


def over_viscoelastic_restitution(points: int) -> dict[str, Any]:
    """Contacts over an ε that both pairs have at 3 m/s."""
    scene, grid = viscoelastic_scene(), np.linspace(0.3, 1.0, points)
    return {"parameter": "restitution at 3 m/s", **_numerical(lambda eps: _row(scene, with_restitution(eps)), grid)}


def over_constant(points: int) -> dict[str, Any]:
    """Contacts over the dissipative constant A in s that both pairs have."""
    scene, grid = viscoelastic_scene(), np.append(0.0, np.geomspace(1e-7, 3e-5, points))
    return {"parameter": "A in s", **_numerical(lambda a: _row(scene, with_constant(a)), grid)}


def _numerical(row: Callable[[float], Row], grid: Array) -> dict[str, Any]:
    stretches = follow(row, grid)
    return {"numerical": stretches, "spikes": spikes(stretches)}


def follow(row: Callable[[float], Row], grid: Array, reach: int = 24) -> list[dict[str, Any]]:
    """Stretches of one kind: parameter, contacts (count, 2, S) and floor end, up to their very ends.

    Of one kind are points with as many contacts, the last of which begins before, or after, the end of the floor
    contact. Between two points of different kinds the boundary is bisected; the points of the bisection are kept.
    """
    known = {x: row(x) for x in grid.tolist()}
    for low, high in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        _bisect(row, known, low, high, reach)
    alike = [list(xs) for _, xs in groupby(sorted(known), lambda x: kind(known[x]))]
    return [
        {"parameter": np.array(xs), "contacts": np.stack([known[x][0] for x in xs], axis=-1),
         "floor_end": np.array([known[x][1] for x in xs])}
        for xs in alike
    ]  # fmt: skip


def _bisect(row: Callable[[float], Row], known: dict[float, Row], low: float, high: float, depth: int) -> None:
    if depth == 0 or kind(known[low]) == kind(known[high]):
        return
    middle = 0.5 * (low + high)
    known[middle] = row(middle)
    _bisect(row, known, low, middle, depth - 1)
    _bisect(row, known, middle, high, depth - 1)


def kind(row: Row) -> tuple[int, bool]:
    """Number of contacts, and whether the last of them begins after the end of the floor contact."""
    contacts, floor_end = row
    return len(contacts), bool(len(contacts) and contacts[-1, 0] > floor_end)


def spikes(stretches: Sequence[dict[str, Any]]) -> list[list[float]]:
    """[from, to, number] of ranges in which the last contact begins only after the floor contact has ended."""
    kinds = [kind((stretch["contacts"][..., 0], stretch["floor_end"][0])) for stretch in stretches]
    return [[float(stretch["parameter"][0]), float(stretch["parameter"][-1]), count]
            for stretch, (count, late) in zip(stretches, kinds, strict=True) if count > 1 and late]  # fmt: skip


def dashpots(restitution: float) -> Row:
    """Contacts of linear dashpots of one ε."""
    scene = scenes.three_balls()
    return _row(scene, setting.dashpots(scene, restitution))


def _adiabatic(restitution: float) -> Row:
    scene = scenes.three_balls()
    solution = adiabatic.contacts(scene, setting.dashpots(scene, restitution))
    return solution.contacts, solution.floor_end


def _row(scene: Scene, law: Sequence[Any]) -> Row:
    run = setting.until_second_floor_contact(scene, law)
    return setting.intervals(run), float(run.of(0)["t_end"][0]) - setting.first_touch(scene)


def viscoelastic_scene() -> Scene:
    """The lower ball meets the floor at t = 0; both balls have 3 m/s then."""
    dropped = scenes.three_balls(radii=RADII, height=RADII[0], density=DENSITY)
    return dropped.replace(velocity=[0.0, -SPEED, -SPEED])


def with_restitution(restitution: float) -> list[ViscoelasticHertz]:
    """Laws of both pairs with one ε at 3 m/s; A then differs from pair to pair."""
    scene = viscoelastic_scene()
    return [ViscoelasticHertz.from_restitution(restitution, k=k, speed=SPEED, pair=pair)
            for k, pair in zip(setting.hertz(scene), scene.pairs, strict=True)]  # fmt: skip


def with_constant(a: float) -> list[ViscoelasticHertz]:
    """Laws of both pairs for one material of dissipative constant `a` in s: γ = (3/2) A k."""
    return [ViscoelasticHertz(k, 1.5 * a * k) for k in setting.hertz(viscoelastic_scene())]


def draw(data: dict[str, Any], label: str, top: float, unit: float = 1.0, marked: float | None = None) -> Any:
    """Time over a parameter in a unit: bands are contacts, broken lines their ends as the adiabatic theory has them;
    the fat line is the run of figure 2."""
    figure, ((axis,),) = canvas(COLUMN, 2.9)
    for stretch in data["numerical"]:
        x = stretch["parameter"] * unit
        for onset, end in stretch["contacts"] * 1e3:
            axis.fill_between(x, onset, end, facecolor=SOFT, alpha=0.3, lw=0)
            axis.plot(x, np.transpose([onset, end]), color=SOFT, lw=0.5)
        axis.plot(x, stretch["floor_end"] * 1e3, color=FLOOR, lw=1.4)
    axis.fill_between([], [], facecolor=SOFT, alpha=0.3, edgecolor=SOFT, label="contacts 1–2")
    axis.plot([], [], color=FLOOR, lw=1.4, label="end of contact 0–1")
    theory: dict[str, Any] = {"color": HARD, "lw": 0.6, "ls": (0, (4, 2))}
    for stretch in data.get("adiabatic", ()):
        axis.plot(stretch["parameter"], stretch["contacts"].reshape(-1, len(stretch["parameter"])).T * 1e3, **theory)
    if "adiabatic" in data:
        axis.plot([], [], label="adiabatic theory", **theory)
    if marked is not None:
        axis.axvline(marked, color=GREY, lw=2.5, alpha=0.5, zorder=0)
        axis.annotate("figure 2", (marked, 0.03), (4, 0), xycoords=("data", "axes fraction"),
                      textcoords="offset points", color="#555555")  # fmt: skip
    first, last = data["numerical"][0], data["numerical"][-1]
    axis.set(xlabel=label, ylabel="$t-t_{10}$  (ms)", ylim=(0.0, top),
             xlim=(first["parameter"][0] * unit, last["parameter"][-1] * unit))  # fmt: skip
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, columnspacing=1.0, handlelength=1.6)
    return figure


draw_restitution = partial(draw, label=r"$\varepsilon$", top=1.2, marked=RESTITUTION)
draw_viscoelastic_restitution = partial(draw, label=AT_SPEED, top=10.0)
draw_constant = partial(draw, label=r"$A$  ($\mu$s)", top=10.0, unit=1e6)
