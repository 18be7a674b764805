"""Position, velocity and acceleration of a driven wall at the time t + tail.

A time is the sum of two floats in s, so no digits are lost at late times. The path of the wall consists of panels:
intervals of time with one polynomial each. Edges of panels are *reduced times*: times in s, or for a periodic wall
turns, the fraction of the period from 0 to 1.

Panels contain, and most kernels return, ``side·m``: the motion m of the wall in the direction of the balls. `side` is 1
for a floor and -1 for a ceiling.
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
"""Largest distance from an edge at which a time counts as on the edge.

It is relative to the time. The sum of two floats does not resolve smaller distances.
"""
PERIODIC_EDGE_TOLERANCE = 2.0**-46
"""`EDGE_TOLERANCE` of a periodic wall, in turns.

This is accurate enough, because the velocity of a periodic wall is continuous.
"""
MAX_TERMS = 20
"""Maximum number of coefficients of the polynomial of a panel."""
PANEL_DTYPE = np.dtype(
    [
        ("left", float), ("right", float), ("centre", float), ("half", float),  # edges, middle, half width: s or turns
        ("per", float),  # dx/dt in 1/s, where x from -1 to 1 is the coordinate on the panel
        ("jump", float),  # jump of the velocity of side·m at the left edge, m/s
        ("most", float), ("least", float),  # upper and lower bound of the acceleration a of side·m, m/s²
        ("rise", float), ("fall", float),  # upper bound ≥ 0 and lower bound ≤ 0 of da/dt, m/s³
        ("bend", float), ("bow", float),  # upper bounds ≥ 0 of d²a/dt² and of -d²a/dt², m/s⁴
        ("degree", int), ("series", float, (MAX_TERMS,)),  # side·m = Σ series[j] x^j, m
    ],
    align=True,
)
WALL_DTYPE = np.dtype(
    [
        ("side", float),  # 1 for a floor, -1 for a ceiling
        ("first", int), ("panels", int), ("density", float),  # first panel, number of panels, mean number per s or turn
        ("periodic", int),  # 1 for a periodic motion, whose velocity is continuous
        ("frequency", float), ("turn", float), ("turn_low", float),  # turns per s (1 if not periodic); turns at t = 0
        ("start", float), ("velocity", float), ("begin", float),  # position (m) at the time `begin` (s); constant m/s
        ("origin", float),  # side·m at the time `begin`, m
        ("reach", float), ("extent", float), ("speed", float), ("stiff", float),  # bounds of side·m, |m|, |m'|, |m''|
        ("error", float),  # maximum deviation of the panels from m, m
        ("about", float), ("about_tail", float), ("holds", float),  # time and validity of a stored `expansion`, s
    ],
    align=True,
)


@rare
@kernel
def exact_product(a: float, b: float) -> tuple[float, float]:
    """Return a·b exactly, as the sum of two floats (Dekker)."""
    p, c, d = a * b, SPLIT_FACTOR * a, SPLIT_FACTOR * b
    ah, bh = c - (c - a), d - (d - b)
    al, bl = a - ah, b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@rare
@kernel
def exact_sum(a: float, b: float) -> tuple[float, float]:
    """Return a + b exactly, as the sum of two floats (Knuth)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@rare
@kernel
def reduced_time(wall: Record, t: float, tail: float) -> tuple[float, float]:
    """Return the reduced time of t + tail as the sum of two floats.

    For a periodic wall it is the fractional part of f·(t + tail) + phase in turns, else the time itself in s.
    """
    if wall.periodic == 0:
        return exact_sum(t, tail)
    a, a_low = exact_product(wall.frequency, t)
    b, b_low = exact_product(wall.frequency, tail)
    # whole turns are removed before the sum, so that no digits are lost
    y, low = exact_sum(a - math.floor(a), b - math.floor(b))
    y, rest = exact_sum(y - math.floor(y), wall.turn)
    return y - math.floor(y), low + rest + (a_low + b_low) + wall.turn_low


@rare
@kernel
def panel_at(wall: Record, panels: Records, y: float) -> int:
    """Return the index of the panel that contains the reduced time y.

    At an edge it is the later panel. Before and after the path it is the first and the last panel.
    """
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
def motion_on_panel(panel: Record, x: float) -> tuple[float, float, float]:
    """Return side·m (m), its velocity (m/s) and its acceleration (m/s²) on a panel.

    `x` is the coordinate on the panel, from -1 to 1.
    """
    v = d = dd = 0.0
    for j in range(panel.degree, -1, -1):
        dd = dd * x + d
        d = d * x + v
        v = v * x + panel.series[j]
    return v, panel.per * d, panel.per * panel.per * (2.0 * dd)


@rare
@kernel
def closing_acceleration_at(panel: Record, pull: float, x: float) -> tuple[float, float]:
    """Return the closing acceleration pull + m'' (m/s²) of a gap, and its rate (m/s³).

    `pull` is the closing acceleration without the motion m of the wall towards the balls, such as g at a floor. `x` is
    the coordinate on the panel, from -1 to 1.
    """
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
    """Return side·m (m), its velocity (m/s) and its acceleration (m/s²) at a time.

    The time is t + tail (s).
    """
    y, low = reduced_time(wall, t, tail)
    panel = panels[panel_at(wall, panels, y)]
    return motion_on_panel(panel, (((y - panel.left) - panel.half) + low) / panel.half)


@rare
@kernel
def wall_at(wall: Record, panels: Records, t: float, tail: float) -> tuple[float, float, float]:
    """Return position (m), velocity (m/s) and acceleration (m/s²) of a wall at a time.

    The time is t + tail (s). Upwards is positive, also for a ceiling.
    """
    m, v, a = moved(wall, panels, t, tail)
    x = wall.start + wall.velocity * ((t - wall.begin) + tail) + wall.side * (m - wall.origin)
    return x, wall.velocity + wall.side * v, wall.side * a


@rare
@kernel
def phase(wall: Record, t: float, tail: float) -> float:
    """Return the phase of a periodic wall at t + tail (s) in turns, from 0 to 1.

    For other walls it is nan.
    """
    if wall.periodic == 0:
        return math.nan
    y, low = reduced_time(wall, t, tail)
    y += low
    return y - math.floor(y)


@rare
@kernel
def panel_from(wall: Record, panels: Records, t: float, tail: float) -> int:
    """Return the index of the panel that contains the path just after t + tail (s).

    A time within rounding error of an edge is considered to be on the edge. The result is then the later panel.
    """
    y, low = reduced_time(wall, t, tail)
    k = panel_at(wall, panels, y)
    if (panels[k].right - y) - low > edge_tolerance(wall, t, tail, panels[k].right):
        return k
    if k + 1 < wall.first + wall.panels:
        return k + 1
    return wall.first if wall.periodic else k


@kernel
def edge_tolerance(wall: Record, t: float, tail: float, edge: float) -> float:
    """Return the distance (s or turns) within which t + tail is on an `edge`."""
    return PERIODIC_EDGE_TOLERANCE if wall.periodic else EDGE_TOLERANCE * (abs(t) + abs(tail) + abs(edge))


@kernel
def time_to_edge(wall: Record, panels: Records, t: float, tail: float) -> float:
    """Return the signed time (s) from t + tail to an edge within rounding error.

    The result is 0 if the nearest edge is farther away than the rounding error of a float, or if the path is periodic.
    """
    if wall.periodic:
        return 0.0
    y, low = reduced_time(wall, t, tail)
    panel = panels[panel_at(wall, panels, y)]
    to_left, to_right = (panel.left - y) - low, (panel.right - y) - low
    to_nearest = to_left if abs(to_left) < abs(to_right) else to_right
    return to_nearest if abs(to_nearest) <= 2.0**-48 * (abs(t) + abs(panel.left) + abs(panel.right)) else 0.0


@kernel
def edge_jump(wall: Record, panels: Records, t: float, tail: float) -> tuple[float, float]:
    """Return the jump of the wall's velocity towards the balls (m/s), in two versions.

    The jump is at the time t + tail, if this time is at an edge between two panels. The first value is 0 if the
    velocities of both panels differ only by rounding. The second value is their computed difference. Both values are 0
    away from an edge and for periodic paths.
    """
    y, low = reduced_time(wall, t, tail)
    k = panel_from(wall, panels, t, tail)
    if wall.periodic or k == wall.first or not (
            abs((y - panels[k].left) + low) <= edge_tolerance(wall, t, tail, panels[k].left)):
        return 0.0, 0.0
    return panels[k].jump, motion_on_panel(panels[k], -1.0)[1] - motion_on_panel(panels[k - 1], 1.0)[1]


@kernel
def expansion(wall: Record, panels: Records, t: float, tail: float, series: list[float]) -> float:
    """Expand side·m (m) in powers of the time s (s) after t + tail.

    The coefficients are written to `series`, which has `MAX_TERMS` entries. The return value is the time in s from
    t + tail to the end of the panel. It is inf on the last panel of a path that is not periodic.
    """
    y, low = reduced_time(wall, t, tail)
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
