"""Gap beside a moving wall between its collisions, for both engines.

The acceleration of the gap is -(pull + m''), where m is directed towards the balls. The constant `pull` is the closing
acceleration of the pair: g at a floor, -g at a ceiling. Two formulas agree to rounding. On the first panel the gap is
computed by divided differences, which are exact to the last digits of the smallest bounce. On later panels it is
computed from the path of the wall.
"""

from __future__ import annotations

import math
from collections import namedtuple

from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.scene.walls.path import panel_at, product, reduced, value

GAP_NOISE = 4.0 * 2.0**-53
"""Rounding error of a gap, relative to the terms of its sum."""
State = namedtuple("State", "time low panel x gap rate pull height drift closing blur")
"""State of a gap at a reduced `time` + `low`, at the coordinate `x` of `panel`.

`height` (m) and `drift` (m/s) are height and rate of the ball above the wall at rest. `closing` is pull + m''. `blur`
is the largest rounding error of the time (s).
"""


@rare
@kernel
def state(wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float) -> State:
    """Return the state from which `flight` is computed, at the time t + tail.

    `gap` is in m. `rate` in m/s includes the motion of the wall.
    """
    y, low = reduced(wall, t, tail)
    k = panel_at(wall, panels, y)
    x = (((y - panels[k].left) - panels[k].half) + low) / panels[k].half
    m, v, a = value(panels[k], x)
    return State(y, low, k, x, gap, rate, pull, gap + m, rate + v, pull + a, 2.0**-51 * (abs(t) + abs(tail)))


@rare
@kernel
def flight(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float
) -> tuple[float, float, float, float]:
    """Return gap (m), rate (m/s), closing acceleration (m/s²) and noise of the gap.

    They are evaluated a time s after `now`, which must lie on panel k, a number of `turns` later.
    """
    panel, pull = panels[k], now.pull
    # divided differences do not subtract nearly equal positions of ball and wall
    if k == now.panel and turns == 0.0:
        gap, rate, x0 = now.gap, now.rate, now.x
        if s == 0.0:
            return gap, rate, now.closing, GAP_NOISE * abs(gap)
        dx = panel.per * s
        x, v0, d0, v, d, dd, d2, d3 = x0 + dx, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(panel.degree, -1, -1):  # divided differences: d2 of (x0, x0, x), d3 of (x0, x0, x, x)
            d3 = x * d3 + d2
            d2 = x0 * d2 + d0
            d0 = x0 * d0 + v0
            dd = x * dd + d
            d = x * d + v
            v0 = panel.series[j] + x * v0
            v = panel.series[j] + x * v
        f = gap + s * (rate - 0.5 * pull * s) - dx * dx * d2
        df = rate - pull * s - panel.per * dx * (2.0 * d2 + dx * d3)
        size = abs(gap) + s * (abs(rate) + 0.5 * (abs(pull) + wall.stiff) * s)
        return f, df, pull + panel.per * panel.per * (2.0 * dd), GAP_NOISE * size
    m, v, a = value(panel, coordinate(wall, panel, now, turns, s))
    height, drift, noise = above(wall, now, s)
    return height - m, drift - v, pull + a, noise


@rare
@kernel
def above(wall: Record, now: State, s: float) -> tuple[float, float, float]:
    """Return height (m), rate (m/s) and noise of the ball above the wall at rest.

    They are evaluated a time s after `now`. The noise applies to a gap computed as a difference to the path of the
    wall.
    """
    drift, pull = now.drift, now.pull
    size = abs(now.height) + wall.extent + s * (wall.speed + abs(drift) + 0.5 * abs(pull) * s)
    return now.height + s * (drift - 0.5 * pull * s), drift - pull * s, GAP_NOISE * size + wall.error


@rare
@kernel
def faint(wall: Record, now: State, s: float) -> float:
    """Return the rounding error of a rate (m/s) a time s after `now`."""
    return GAP_NOISE * (abs(now.rate) + (abs(now.pull) + wall.stiff) * s)  # type: ignore[no-any-return]


@rare
@kernel
def coordinate(wall: Record, panel: Record, now: State, turns: float, s: float) -> float:
    """Return the coordinate x on a panel, `turns` later, at a time s after `now`."""
    p, p_low = s, 0.0
    if wall.periodic:
        # two floats, because whole turns are subtracted from f·s
        p, p_low = product(wall.frequency, s)
    return (((p - turns) + ((now.time - panel.left) - panel.half)) + (now.low + p_low)) / panel.half  # type: ignore[no-any-return]


@rare
@kernel
def lasts(wall: Record, panels: Records, now: State, k: int, turns: float) -> float:
    """Return the time after `now` at which panel k, `turns` later, ends."""
    return ((panels[k].right - now.time) - now.low + turns) / wall.frequency  # type: ignore[no-any-return]


@rare
@kernel
def next_panel(wall: Record, k: int, turns: float) -> tuple[int, float]:
    """Return the panel after k and its turns.

    The first panel of the next turn follows the last panel."""
    if k + 1 < wall.first + wall.panels:
        return k + 1, turns
    return wall.first, turns + 1.0


@rare
@kernel
def panel_later(wall: Record, panels: Records, now: State, s: float) -> tuple[int, float]:
    """Return the panel a time s after `now`, and the number of turns in between."""
    y, turns = now.time + wall.frequency * s, 0.0
    if wall.periodic:
        turns = float(math.floor(y))
    return panel_at(wall, panels, y - turns), turns


@rare
@kernel
def hop(wall: Record, panels: Records, now: State, s: float) -> State:
    """Return the state a time s after `now`, at the start of the next panel.

    Its panel must end at that time. No digits are lost for a bounce that is small compared with the motion of the wall.
    """
    f, df, _, noise = flight(wall, panels, now, now.panel, 0.0, s)
    # values within their noise have no sign
    f = f if abs(f) > noise else 0.0
    df = df if abs(df) > faint(wall, now, s) else 0.0
    if now.gap == 0.0 and now.rate == 0.0 and s <= 4.0 * now.blur:  # a ball that has just lifted off
        f = df = 0.0
    k, _ = next_panel(wall, now.panel, 0.0)
    height, drift, _ = above(wall, now, s)
    a = now.pull + value(panels[k], -1.0)[2]
    return State(panels[k].left, 0.0, k, -1.0, f, df - panels[k].jump, now.pull, height, drift, a, now.blur)


@rare
@kernel
def short(wall: Record, panels: Records, now: State, s: float) -> bool:
    """Return whether the gap should be continued from the end of its panel.

    That end must be a short time s ahead, and the path must continue.
    """
    k = now.panel
    return panels[k].per * s <= 1.0 and (wall.periodic == 1 or k + 1 < wall.first + wall.panels)  # type: ignore[no-any-return]


@rare
@kernel
def after(
    wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float, s: float
) -> tuple[float, float]:
    """Return a gap (m) and its rate (m/s) a time s (s) after t + tail.

    The expressions and the other parameters are the same as in `first_hit`. Rounding can make a closing gap negative,
    so callers clamp it at 0.
    """
    now = state(wall, panels, t, tail, gap, rate, pull)
    end = max(0.0, lasts(wall, panels, now, now.panel, 0.0))
    # a longer s would lose digits
    if s > end and short(wall, panels, now, end) and panels[now.panel].per * s <= 4.0:
        now = hop(wall, panels, now, end)
        s -= end
    k, turns = panel_later(wall, panels, now, s)
    f, df, _, _ = flight(wall, panels, now, k, turns, s)
    return f, df
