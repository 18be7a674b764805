"""Figure 3: when the two balls touch, over ε; numerical, and as the adiabatic theory has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granular import adiabatic
from granular._check import Array
from granular.paper import setting
from granular.paper.drawing import COLUMN, FLOOR, HARD, SOFT, canvas

Row = tuple[Array, float]
"""Begin and end in s of every contact (count, 2), and the end of the floor contact in s."""


def compute(points: int) -> dict[str, Any]:
    """Contacts of both solutions over ε, closer and closer to where their number jumps."""
    grid = np.linspace(0.3, 1.0, points)
    both = {}
    for name, row in (("numerical", _numerical), ("adiabatic", _adiabatic)):
        both[name] = follow(row, grid)
    return {"restitution": grid, **both, "spikes": spikes(both["numerical"])}


def follow(row: Callable[[float], Row], grid: Array, reach: int = 24) -> list[dict[str, Any]]:
    """Stretches of one kind: parameter, contacts (count, 2, S) and floor end, up to their very ends.

    Of one kind are points with as many contacts, the last of which begins before, or after, the end of the floor
    contact. Between two points of different kinds the boundary is bisected; the points of the bisection are kept.
    """
    known = {float(x): row(float(x)) for x in grid}
    for low, high in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        _bisect(row, known, low, high, reach)
    stretches: list[list[float]] = []
    for x in sorted(known):
        if stretches and kind(known[x]) == kind(known[stretches[-1][-1]]):
            stretches[-1].append(x)
        else:
            stretches.append([x])
    return [
        {"parameter": np.array(xs), "contacts": np.stack([known[x][0] for x in xs], axis=-1),
         "floor_end": np.array([known[x][1] for x in xs])}
        for xs in stretches
    ]  # fmt: skip


def spikes(stretches: Sequence[dict[str, Any]]) -> list[list[float]]:
    """[from, to, number] of ranges in which the last contact begins only after the floor contact has ended."""
    found = []
    for stretch in stretches:
        x, contacts = stretch["parameter"], stretch["contacts"]
        if len(contacts) > 1 and contacts[-1, 0, 0] > stretch["floor_end"][0]:
            found.append([float(x[0]), float(x[-1]), len(contacts)])
    return found


def kind(row: Row) -> tuple[int, bool]:
    """Number of contacts, and whether the last of them begins after the end of the floor contact."""
    contacts, floor_end = row
    return len(contacts), bool(len(contacts) and contacts[-1, 0] > floor_end)


def draw(data: dict[str, Any]) -> Any:
    """Time over ε: bands are contacts, lines their begins and ends as the adiabatic theory has them."""
    figure, ((axis,),) = canvas(COLUMN, 2.9)
    bands(axis, data["numerical"])
    for stretch in data["adiabatic"]:
        for begin, end in stretch["contacts"]:
            for line in (begin, end):
                axis.plot(stretch["parameter"], line * 1e3, color=HARD, lw=0.6, ls=(0, (4, 2)))
    axis.plot([], [], color=HARD, lw=0.6, ls=(0, (4, 2)), label="adiabatic theory")
    axis.set(xlabel=r"$\varepsilon$", ylim=(0.0, 1.2))
    legend(axis)
    return figure


def bands(axis: Any, stretches: Sequence[dict[str, Any]]) -> None:
    """Fill the contacts of the two balls, and draw the end of the floor contact."""
    for stretch in stretches:
        x = stretch["parameter"]
        for begin, end in stretch["contacts"]:
            axis.fill_between(x, begin * 1e3, end * 1e3, facecolor=SOFT, alpha=0.3, lw=0)
            for line in (begin, end):
                axis.plot(x, line * 1e3, color=SOFT, lw=0.5)
        axis.plot(x, stretch["floor_end"] * 1e3, color=FLOOR, lw=1.4)
    axis.fill_between([], [], facecolor=SOFT, alpha=0.3, edgecolor=SOFT, label="contacts 1–2")
    axis.plot([], [], color=FLOOR, lw=1.4, label="end of contact 0–1")
    axis.set(xlim=(stretches[0]["parameter"][0], stretches[-1]["parameter"][-1]), ylabel="$t-t_{10}$  (ms)")


def legend(axis: Any) -> None:
    """A legend above the frame, out of the way of the curves."""
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, columnspacing=1.0, handlelength=1.6)


def _bisect(row: Callable[[float], Row], known: dict[float, Row], low: float, high: float, depth: int) -> None:
    if depth == 0 or kind(known[low]) == kind(known[high]):
        return
    middle = 0.5 * (low + high)
    known[middle] = row(middle)
    _bisect(row, known, low, middle, depth - 1)
    _bisect(row, known, middle, high, depth - 1)


def _numerical(restitution: float) -> Row:
    scene = setting.drop()
    run = setting.until_second_floor_contact(scene, setting.dashpots(scene, restitution))
    return setting.intervals(run), float(run.of(0)["t_end"][0]) - setting.first_touch(scene)


def _adiabatic(restitution: float) -> Row:
    scene = setting.drop()
    solution = adiabatic.contacts(scene, setting.dashpots(scene, restitution))
    return solution.contacts, solution.floor_end
