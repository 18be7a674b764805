"""Balls that rest on a moving wall: when they leave it, and bounds of what presses them on.
May be skipped: rarer, walls that shake.

A ball that rides presses on the wall while a = pull + m'' > 0 (m towards the balls); a pile does as one ball does. It
leaves where a falls to 0, at once where a < 0, and is kicked where the velocity of the wall jumps towards it.
"""

from __future__ import annotations

import math

from granular._flight import time_to_contact
from granular._kernels import kernel, rare
from granular._records import Record, Records
from granular.walls.gap import NOISE, State, coordinate, lasts, state
from granular.walls.path import pressed

NEVER = math.inf


@rare
@kernel
def lift_off(
    wall: Record, panels: Records, t: float, tail: float, pull: float, within: float
) -> tuple[float, float]:
    """Return the time (s) after now at which a ball at rest on a wall ceases to ride, and the gap's rate (m/s) then.

    Parameters
    ----------
    wall, panels : records
        From `Panels.records`.
    t, tail : float
        Now, t + tail, in s.
    pull : float
        Constant closing acceleration in m/s²: g at a floor, -g at a ceiling.
    within : float
        How long to look, in s. The path of a wall that is not periodic ends the search too.

    Returns
    -------
    s, rate : float
        inf and 0 if it rides on. A rate of 0: the ball leaves where pull + m'' falls to 0 (s is 0 if it is below it);
        above 0: it leaves where the wall's velocity jumps away from it; below 0: the wall jumps against it, a hit.

    Notes
    -----
    Dips of pull + m'' below 0 by no more than rounding, 4 2⁻⁵³ (|pull| + max |m''|), lift nothing.
    """
    now = state(wall, panels, t, tail, 0.0, 0.0, pull)
    k, turns, s = now[2], 0.0, 0.0
    for _ in range(wall.panels + 1):
        end = lasts(wall, panels, now, k, turns)
        if pull + panels[k].least < 0.0:
            found = falls_on_panel(wall, panels, now, k, turns, s, end)
            if found < NEVER:
                return (found, 0.0) if found <= within else (NEVER, 0.0)
        s = max(s, end)
        k += 1
        if k == wall.first + wall.panels:
            k = wall.first
            turns += 1.0
        if s > within or (turns > 0.0 and wall.periodic == 0):
            return NEVER, 0.0
        if panels[k].jump != 0.0:
            return s, -panels[k].jump
    return NEVER, 0.0


@rare
@kernel
def falls_on_panel(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float, end: float
) -> float:
    """Return the time after `now` at which pull + m'' falls below 0 on panel k, before `end`; inf if it does not.

    Steps from below: with a bound of its second rate it stays above a parabola.
    """
    panel, noise = panels[k], NOISE * (abs(now[6]) + wall.stiff)
    while s < end:
        a, j = pressed(panel, now[6], coordinate(wall, panel, now, turns, s))
        if a <= -noise:
            return s
        if a <= 0.0 and j < 0.0 and j * j >= 4.0 * max(panel.bow, panel.bend) * noise:
            return max(0.0, s + a / -j)
        step = time_to_contact(a + noise, j, panel.bow)
        if s + step == s:
            return s
        s += step
    return NEVER


@rare
@kernel
def pressing(
    wall: Record, panels: Records, t: float, tail: float, pull: float, span: float
) -> tuple[float, float]:
    """Return certain bounds, below and above, of pull + m'' (m/s²) from now, t + tail, to `span` (s) later.

    A bouncing ball may be taken to its rest on the wall while the lower one is above 0 up to the end of its bounces;
    the flank of an isolated contact is no more convex than max(0, -lower). Beyond its end a path goes on as it does on
    its last panel. Bounds of a short time are as narrow as the acceleration changes in it.
    """
    now = state(wall, panels, t, tail, 0.0, 0.0, pull)
    least, most = NEVER, -NEVER
    k, turns, s = now[2], 0.0, 0.0
    for _ in range(wall.panels + 1):
        end = lasts(wall, panels, now, k, turns)
        last = end >= span or (wall.periodic == 0 and k + 1 == wall.first + wall.panels)
        low, high = bounds(wall, panels[k], now, turns, s, span if last else end)
        least, most = min(least, low), max(most, high)
        if last:
            return least, most
        s = max(s, end)
        k += 1
        if k == wall.first + wall.panels:
            k = wall.first
            turns += 1.0
    return least, most


@rare
@kernel
def bounds(
    wall: Record, panel: Record, now: State, turns: float, s: float, until: float
) -> tuple[float, float]:
    """Return bounds of pull + m'' on a panel between two times after `now`: those of the panel, or, if narrower, what
    the values at both and the bounds of the rate allow between them."""
    pull, length = now[6], max(0.0, until - s)
    noise = NOISE * (abs(pull) + wall.stiff)
    a, _ = pressed(panel, pull, coordinate(wall, panel, now, turns, s))
    b, _ = pressed(panel, pull, coordinate(wall, panel, now, turns, s + length))
    low = lowest(a, b, panel.rise, -panel.fall, length)
    high = -lowest(-a, -b, -panel.fall, panel.rise, length)
    return max(low, pull + panel.least) - noise, min(high, pull + panel.most) + noise


@rare
@kernel
def lowest(a: float, b: float, rise: float, fall: float, length: float) -> float:
    """Return the least a function can be that goes from a to b in `length`, rising and falling no faster than said."""
    if rise + fall == 0.0:
        return min(a, b)
    down = min(max((a - b + rise * length) / (rise + fall), 0.0), length)
    return a - fall * down
