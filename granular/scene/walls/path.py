"""Position, velocity and acceleration of a wall at a time in two floats, t + tail.

The phase of a sine is kept as the fraction of f·t in two floats, so late times cost no digits. Panels contain, and most
kernels return, ``side·m``: the motion towards the balls, for floor and ceiling.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular._engine.kernels import kernel, rare

if TYPE_CHECKING:
    from granular._engine.records import Record, Records

# 2²⁷ + 1, which splits a float into two halves of at most 26 bits (Veltkamp)
SPLIT_FACTOR = 134217729.0
EDGE_TOLERANCE = 2.0**-96
"""Relative distance to an edge below which a time counts as on the edge.

Two floats do not resolve smaller distances.
"""
PERIODIC_EDGE_TOLERANCE = 2.0**-46
"""Distance to an edge in turns below which a time counts as on the edge.

This is accurate enough because the path of a periodic wall has no corners.
"""
MAX_TERMS = 20
"""Maximum number of coefficients per panel."""
PANEL_DTYPE = np.dtype(
    [
        ("left", float), ("right", float), ("centre", float), ("half", float),  # edges, middle, half width: s or turns
        ("per", float),  # dx/dt, 1/s
        ("jump", float),  # m/s by which the velocity jumps at the left edge
        ("most", float), ("least", float),  # bounds of the acceleration, m/s²
        ("rise", float), ("fall", float),  # bounds of its rate, m/s³: ≥ 0, ≤ 0
        ("bend", float), ("bow", float),  # bounds of its second rate, and of minus that, m/s⁴: ≥ 0
        ("degree", int), ("series", float, (MAX_TERMS,)),  # m
    ],
    align=True,
)
WALL_DTYPE = np.dtype(
    [
        ("side", float),  # 1 a floor, -1 a ceiling; panels hold side·m, so towards the balls is up
        ("first", int), ("panels", int), ("density", float),  # panels per s or turn, on average
        ("periodic", int),  # then its velocity is continuous too
        ("frequency", float), ("turn", float), ("turn_low", float),  # turns per s (1 if not periodic); at t = 0
        ("start", float), ("velocity", float), ("begin", float), ("origin", float),  # m, m/s, s; side·m at the start
        ("reach", float), ("extent", float), ("speed", float), ("stiff", float),  # bounds of side·m, |m|, |m'|, |m''|
        ("error", float),  # m, how far the panels may be from m
        ("about", float), ("about_tail", float), ("holds", float),  # s: of when and for how long an `expansion` is
    ],
    align=True,
)


@rare
@kernel
def product(a: float, b: float) -> tuple[float, float]:
    """Return a·b in two floats (Dekker)."""
    p, c, d = a * b, SPLIT_FACTOR * a, SPLIT_FACTOR * b
    ah, bh = c - (c - a), d - (d - b)
    al, bl = a - ah, b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@rare
@kernel
def total(a: float, b: float) -> tuple[float, float]:
    """Return a + b in two floats (Knuth)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@rare
@kernel
def reduced(wall: Record, t: float, tail: float) -> tuple[float, float]:
    """Return the reduced time of t + tail in two floats.

    For a periodic wall it is the fraction f·t + phase of its turn, from 0 to 1.
    """
    if wall.periodic == 0:
        return total(t, tail)
    a, a_low = product(wall.frequency, t)
    b, b_low = product(wall.frequency, tail)
    # whole turns are removed before the sum, so that no digits are lost
    y, low = total(a - math.floor(a), b - math.floor(b))
    y, rest = total(y - math.floor(y), wall.turn)
    return y - math.floor(y), low + rest + (a_low + b_low) + wall.turn_low


@rare
@kernel
def panel_at(wall: Record, panels: Records, y: float) -> int:
    """Return the panel of the reduced time y; at an edge, the later panel."""
    low, high = wall.first, wall.first + wall.panels - 1
    # correct for panels of equal length, else replaced by bisection
    guess = low + int(min(max((y - panels[low].left) * wall.density, 0.0), wall.panels - 1.0))
    if panels[guess].left <= y < panels[guess].right:
        return guess  # type: ignore[no-any-return]
    while low < high:
        middle = (low + high + 1) // 2
        if panels[middle].left <= y:
            low = middle
        else:
            high = middle - 1
    return low  # type: ignore[no-any-return]


@rare
@kernel
def value(panel: Record, x: float) -> tuple[float, float, float]:
    """Return side·m (m), its rate (m/s) and its acceleration (m/s²) at x on a panel."""
    v = d = dd = 0.0
    for j in range(panel.degree, -1, -1):
        dd = dd * x + d
        d = d * x + v
        v = v * x + panel.series[j]
    return v, panel.per * d, panel.per * panel.per * (2.0 * dd)


@rare
@kernel
def pressed(panel: Record, pull: float, x: float) -> tuple[float, float]:
    """Return pull + m'' (m/s²) at x on a panel, and its rate (m/s³)."""
    v = d = dd = ddd = 0.0
    for j in range(panel.degree, -1, -1):
        ddd = ddd * x + dd
        dd = dd * x + d
        d = d * x + v
        v = v * x + panel.series[j]
    square = panel.per * panel.per
    return pull + square * (2.0 * dd), square * panel.per * (6.0 * ddd)


@rare
@kernel
def moved(wall: Record, panels: Records, t: float, tail: float) -> tuple[float, float, float]:
    """Return side·m (m), its rate (m/s) and its acceleration (m/s²) at t + tail."""
    y, low = reduced(wall, t, tail)
    panel = panels[panel_at(wall, panels, y)]
    return value(panel, (((y - panel.left) - panel.half) + low) / panel.half)


@rare
@kernel
def wall_at(wall: Record, panels: Records, t: float, tail: float) -> tuple[float, float, float]:
    """Return position (m), velocity (m/s) and acceleration (m/s²) of a wall.

    The time is t + tail (s).
    """
    m, v, a = moved(wall, panels, t, tail)
    x = wall.start + wall.velocity * ((t - wall.begin) + tail) + wall.side * (m - wall.origin)
    return x, wall.velocity + wall.side * v, wall.side * a


@rare
@kernel
def phase(wall: Record, t: float, tail: float) -> float:
    """Return the phase of a periodic wall at t + tail, in turns from 0 to 1, else nan."""
    if wall.periodic == 0:
        return math.nan
    y, low = reduced(wall, t, tail)
    y += low
    return y - math.floor(y)


@rare
@kernel
def panel_from(wall: Record, panels: Records, t: float, tail: float) -> int:
    """Return the panel that continues the path from the time t + tail.

    At an edge, to rounding, it is the later panel.
    """
    y, low = reduced(wall, t, tail)
    k = panel_at(wall, panels, y)
    if (panels[k].right - y) - low > near(wall, t, tail, panels[k].right):
        return k
    if k + 1 < wall.first + wall.panels:
        return k + 1
    return wall.first if wall.periodic else k


@kernel
def near(wall: Record, t: float, tail: float, edge: float) -> float:
    """Return the distance in s or turns below which t + tail is at an `edge`."""
    return PERIODIC_EDGE_TOLERANCE if wall.periodic else EDGE_TOLERANCE * (abs(t) + abs(tail) + abs(edge))


@kernel
def to_edge(wall: Record, panels: Records, t: float, tail: float) -> float:
    """Return the time in s from t + tail to the nearest edge, if it is only rounding.

    The result is 0 if the edge is farther away than the rounding of a float, or if the path is periodic.
    """
    if wall.periodic:
        return 0.0
    y, low = reduced(wall, t, tail)
    panel = panels[panel_at(wall, panels, y)]
    before, after = (panel.left - y) - low, (panel.right - y) - low
    nearest = before if abs(before) < abs(after) else after
    return nearest if abs(nearest) <= 2.0**-48 * (abs(t) + abs(panel.left) + abs(panel.right)) else 0.0


@kernel
def edge_jump(wall: Record, panels: Records, t: float, tail: float) -> tuple[float, float]:
    """Return the jump of the velocity of side·m (m/s) at t + tail, in two versions.

    The first version omits jumps by rounding of the path. The second includes them. Both are 0 away from an edge and
    for periodic paths.
    """
    y, low = reduced(wall, t, tail)
    k = panel_from(wall, panels, t, tail)
    if wall.periodic or k == wall.first or not (
            abs((y - panels[k].left) + low) <= near(wall, t, tail, panels[k].left)):
        return 0.0, 0.0
    return panels[k].jump, value(panels[k], -1.0)[1] - value(panels[k - 1], 1.0)[1]


@kernel
def expansion(wall: Record, panels: Records, t: float, tail: float, series: list[float]) -> float:
    """Fill `series` with the power series of side·m (m) in the time s after t + tail.

    `series` has 20 entries. The return value is the time in s up to which the series holds: the end of the panel, or
    inf on the last panel of a path that is not periodic.
    """
    y, low = reduced(wall, t, tail)
    k = panel_from(wall, panels, t, tail)
    panel = panels[k]
    if wall.periodic and y > panel.right:  # at the end of a turn
        y -= 1.0
    x = (((y - panel.left) - panel.half) + low) / panel.half
    for j in range(len(series)):
        series[j] = panel.series[j]
    for i in range(panel.degree - 1, -1, -1):  # Horner's scheme by columns, whose sums are independent
        for j in range(i, panel.degree):
            series[j] += x * series[j + 1]
    power = 1.0
    for j in range(panel.degree + 1):
        series[j] *= power
        power *= panel.per
    if wall.periodic == 0 and k + 1 == wall.first + wall.panels:
        return math.inf
    return ((panel.right - y) - low) / wall.frequency  # type: ignore[no-any-return]
