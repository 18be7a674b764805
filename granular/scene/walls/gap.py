"""Gap between a driven wall and the ball next to it, between two collisions.

The acceleration of the gap is -(pull + m''), where the motion m of the wall is positive towards the balls. The constant
`pull` is the closing acceleration without this motion: g at a floor, -g at a ceiling.

Two formulas agree to rounding. On the panel of the current time the gap is computed by divided differences, which keep
all digits even of the smallest bounce. On later panels it is the difference of the positions of ball and wall.
"""

from __future__ import annotations

import math
from collections import namedtuple

from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.scene.walls.path import exact_product, motion_on_panel, panel_at, reduced_time

GAP_NOISE = 4.0 * 2.0**-53
"""Bound of the rounding error of a gap, relative to the size of its terms."""
State = namedtuple("State", "time low panel x gap rate pull height drift closing time_error")
"""State of a gap at one time, from which `flight` computes the gap at later times.

`time` + `low` is the reduced time (s or turns). `panel` is the index of its panel, and `x` its coordinate there.
`gap` (m), its `rate` (m/s) and `pull` (m/s²) are arguments of `gap_state`. `height` (m) and `drift` (m/s) are height
and velocity of the ball above the position of the wall at m = 0. `closing` is pull + m'' (m/s²). `time_error` is a
bound of the rounding error of the time in s.
"""


@rare
@kernel
def gap_state(wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float) -> State:
    """Return the state of a gap at the time t + tail (s).

    `gap` (m) and `rate` (m/s) are the gap between wall and ball and its rate. Without the displacement m of the wall
    towards the ball, the gap would be gap + m and its rate rate + m'. These are height and velocity of the ball above
    the position of the wall at m = 0. `pull` is the closing acceleration without m'', in m/s².
    """
    y, low = reduced_time(wall, t, tail)
    k = panel_at(wall, panels, y)
    x = (((y - panels[k].left) - panels[k].half) + low) / panels[k].half
    m, v, a = motion_on_panel(panels[k], x)
    return State(y, low, k, x, gap, rate, pull, gap + m, rate + v, pull + a, 2.0**-51 * (abs(t) + abs(tail)))


@rare
@kernel
def flight(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float
) -> tuple[float, float, float, float]:
    """Return a gap (m), its rate (m/s), its closing acceleration (m/s²) and its error.

    They hold at a later time than `now`. The error is a bound of the rounding error of the gap in m.

    Parameters
    ----------
    now : State
        State at the current time.
    k : int
        Index of the panel of the later time.
    turns : float
        Period of that panel, counted from the period of `now`.
    s : float
        Later time in s after `now`.
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
    m, v, a = motion_on_panel(panel, coordinate(wall, panel, now, turns, s))
    height, drift, noise = height_above_wall(wall, now, s)
    return height - m, drift - v, pull + a, noise


@rare
@kernel
def height_above_wall(wall: Record, now: State, s: float) -> tuple[float, float, float]:
    """Return height (m) and velocity (m/s) of the ball, and the error of the gap (m).

    They hold at the time s (s) after `now`. Height and velocity are relative to the position of the wall at m = 0. The
    error is a bound of the rounding error of a gap that is computed as the height minus m.
    """
    drift, pull = now.drift, now.pull
    size = abs(now.height) + wall.extent + s * (wall.speed + abs(drift) + 0.5 * abs(pull) * s)
    return now.height + s * (drift - 0.5 * pull * s), drift - pull * s, GAP_NOISE * size + wall.error


@rare
@kernel
def rate_error(wall: Record, now: State, s: float) -> float:
    """Return a bound of the rounding error (m/s) of a rate at the time s after `now`."""
    return GAP_NOISE * (abs(now.rate) + (abs(now.pull) + wall.stiff) * s)  # type: ignore[no-any-return]


@rare
@kernel
def coordinate(wall: Record, panel: Record, now: State, turns: float, s: float) -> float:
    """Return the coordinate x on a panel at the time s after `now`, from -1 to 1.

    The panel is `turns` periods after the period of `now`.
    """
    p, p_low = s, 0.0
    if wall.periodic:
        # two floats, because whole turns are subtracted from f·s
        p, p_low = exact_product(wall.frequency, s)
    return (((p - turns) + ((now.time - panel.left) - panel.half)) + (now.low + p_low)) / panel.half  # type: ignore[no-any-return]


@rare
@kernel
def time_to_panel_end(wall: Record, panels: Records, now: State, k: int, turns: float) -> float:
    """Return the time (s) from `now` to the end of panel k, `turns` periods later."""
    return ((panels[k].right - now.time) - now.low + turns) / wall.frequency  # type: ignore[no-any-return]


@rare
@kernel
def next_panel(wall: Record, k: int, turns: float) -> tuple[int, float]:
    """Return index and period of the panel after panel k, whose period is `turns`.

    The last panel is followed by the first panel of the next period.
    """
    if k + 1 < wall.first + wall.panels:
        return k + 1, turns
    return wall.first, turns + 1.0


@rare
@kernel
def later_panel(wall: Record, panels: Records, now: State, s: float) -> tuple[int, float]:
    """Return index and period of the panel at the time s after `now`.

    The period is counted from the period of `now`.
    """
    y, turns = now.time + wall.frequency * s, 0.0
    if wall.periodic:
        turns = float(math.floor(y))
    return panel_at(wall, panels, y - turns), turns


@rare
@kernel
def next_panel_state(wall: Record, panels: Records, now: State, s: float) -> State:
    """Return the state of the gap at the start of the next panel.

    `s` is the time in s from `now` to the end of its panel. `flight` computes the gap by divided differences only on
    the panel of its state. Divided differences keep the digits of a bounce that is small compared with the motion of
    the wall. Each panel therefore needs a new state.
    """
    gap, rate, _, noise = flight(wall, panels, now, now.panel, 0.0, s)
    # values within their noise have no sign
    gap = gap if abs(gap) > noise else 0.0
    rate = rate if abs(rate) > rate_error(wall, now, s) else 0.0
    if now.gap == 0.0 and now.rate == 0.0 and s <= 4.0 * now.time_error:  # a ball that has just lifted off
        gap = rate = 0.0
    k, _ = next_panel(wall, now.panel, 0.0)
    height, drift, _ = height_above_wall(wall, now, s)
    a = now.pull + motion_on_panel(panels[k], -1.0)[2]
    # x = -1 is the left edge of the new panel
    return State(panels[k].left, 0.0, k, -1.0, gap, rate - panels[k].jump, now.pull, height, drift, a, now.time_error)


@rare
@kernel
def is_panel_end_near(wall: Record, panels: Records, now: State, s: float) -> bool:
    """Return whether to continue a gap from its state at the end of the panel.

    The path must continue there. The time `s` (s) from `now`, at or after this end, must be at most half of the length
    of the panel.
    """
    k = now.panel
    return panels[k].per * s <= 1.0 and (wall.periodic == 1 or k + 1 < wall.first + wall.panels)  # type: ignore[no-any-return]


@rare
@kernel
def gap_at_time(
    wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float, s: float
) -> tuple[float, float]:
    """Return a gap (m) and its rate (m/s) at the time s (s) after t + tail.

    The other parameters are as in `first_hit`, whose formulas are used. Rounding can make a closing gap negative,
    so callers clamp it at 0.
    """
    now = gap_state(wall, panels, t, tail, gap, rate, pull)
    end = max(0.0, time_to_panel_end(wall, panels, now, now.panel, 0.0))
    # a longer s would lose digits
    if s > end and is_panel_end_near(wall, panels, now, end) and panels[now.panel].per * s <= 4.0:
        now = next_panel_state(wall, panels, now, end)
        s -= end
    k, turns = later_panel(wall, panels, now, s)
    f, df, _, _ = flight(wall, panels, now, k, turns, s)
    return f, df
