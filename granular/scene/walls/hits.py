"""The first time at which a gap beside a moving wall closes, or a ball that rests on it leaves: certified.

Both are stepped to from below, never over.

While the closing acceleration stays below M, the gap stays above the parabola f + f's - ½Ms², so the time at which that
parabola closes is safe to go to. On each panel M is the bound of the panel, or what acceleration and the bound of its
rate allow: the steps end quadratically at a hit, and pass a graze quickly. What the wall cannot reach is skipped.

A ball that rides presses on the wall while a = pull + m'' > 0 (m towards the balls); a pile does as one ball does. It
leaves where a falls to 0, at once where a < 0, and is kicked where the velocity of the wall jumps towards it.
"""

from __future__ import annotations

import math

from granular._engine.flight import time_to_contact
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.scene.walls.gap import (
    NOISE,
    State,
    above,
    coordinate,
    faint,
    flight,
    hop,
    lasts,
    next_panel,
    panel_later,
    short,
    state,
)
from granular.scene.walls.path import pressed

NEVER = math.inf
PHASES = 2.0**50
"""Periods from now after which a float no longer tells where in its period a wall is: what has not hit by then does."""
SHORT = 2.0**-6
"""Steps shorter than this share of what is left of a panel call for a closer look."""


@rare
@kernel
def first_hit(
    wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float, within: float
) -> float:
    """Return the time (s) after now at which a gap closes, inf if it does not within `within` (s).

    Parameters
    ----------
    wall, panels : records
        From `Panels.records`.
    t, tail : float
        Now, t + tail, in s.
    gap : float
        The gap now in m, not negative.
    rate : float
        Its rate in m/s: all of it, the wall's motion included.
    pull : float
        Its constant closing acceleration in m/s²: g at a floor, -g at a ceiling, and what else acts on the ball.
    within : float
        How long to look, in s; inf is allowed. The path of a wall that is not periodic ends the search too.

    Notes
    -----
    A gap that is 0 and closes is hit now; one that is 0 and opens, or rests, was just left: that hit is not found
    again. `lift_off` says when a ball that rests on the wall leaves it. A dip is a hit unless it stays above the
    noise of the gap, 4 2⁻⁵³ of its terms: none is missed, and what is hit early is hit within twice the noise.
    """
    now, passed = state(wall, panels, t, tail, gap, rate, pull), 0.0
    k, turns, s = now.panel, 0.0, 0.0
    if gap == 0.0 and rate == 0.0 and opens(wall, panels[k], now, 0.0, 0.0) == 0.0:
        return NEVER
    while passed + s <= within:
        end = lasts(wall, panels, now, k, turns)
        s, hit = hit_on_panel(wall, panels, now, k, turns, s, end)
        if hit:
            return passed + s if passed + s <= within else NEVER
        if s == NEVER:
            return NEVER
        if k == now.panel and turns == 0.0 and short(wall, panels, now, s):
            end = max(0.0, end)
            now = hop(wall, panels, now, end)
            passed += end
            s, k = max(0.0, s - end), now.panel
        s += out_of_reach(wall, now, s)
        if s == NEVER:
            return NEVER
        if wall.periodic and wall.frequency * s > PHASES:
            return passed + s if passed + s <= within else NEVER
        k, turns = onward(wall, panels, now, k, turns, s)
        if k < 0:
            return NEVER
    return NEVER


@rare
@kernel
def onward(wall: Record, panels: Records, now: State, k: int, turns: float, s: float) -> tuple[int, float]:
    """Return the panel on which to go on a time s after `now`, at its start or later, and its turns; -1 if the path
    ends there. The one before was k."""
    end = lasts(wall, panels, now, k, turns)
    if s > end:
        k, turns = panel_later(wall, panels, now, s)
        end = lasts(wall, panels, now, k, turns)
    if s < end:
        return k, turns
    k, later = next_panel(wall, k, turns)
    return (k, later) if later == turns or wall.periodic else (-1, turns)


@rare
@kernel
def out_of_reach(wall: Record, now: State, s: float) -> float:
    """Return how long, from a time s after `now`, the ball is certain to be where the wall never comes."""
    height, rate, noise = above(wall, now, s)
    if rate == 0.0 and now.pull == 0.0 and wall.speed == 0.0:
        return NEVER
    room = height - wall.reach - noise
    return 0.0 if room <= 0.0 else time_to_contact(room, rate, now.pull) * (1.0 - 2.0**-50)


@rare
@kernel
def hit_on_panel(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float, end: float
) -> tuple[float, bool]:
    """Return the time after `now` at which the gap closes, and True; if not on panel k, False, and a time, `end` or
    later, before which it does not."""
    panel, pull = panels[k], now.pull
    slack = NOISE * (abs(pull) + wall.stiff)
    while s < end:
        f, df, a, noise = flight(wall, panels, now, k, turns, s)
        df = df if abs(df) > faint(wall, now, s) else 0.0
        if f <= 2.0 * noise and df < 0.0:
            return touch(s, f, df, a), True
        sure, left = f - noise if f > noise else 0.0, end - s
        step = stays_open(panel, sure, df, a - slack, pull + panel.most - slack, left)
        if df >= 0.0 and (a <= slack or s == df == 0.0) and step < SHORT * left:
            step = max(step, opens(wall, panel, now, turns, s))
        if step >= left:
            if wall.periodic and sure > noise:  # velocity does not jump: a bound for all panels serves beyond this one
                return max(end, s + time_to_contact(sure, df, pull + wall.stiff)), False
            return end, False
        if s + step == s:
            return s, True
        s += step
    return end, False


@rare
@kernel
def stays_open(panel: Record, f: float, df: float, a: float, most: float, left: float) -> float:
    """Return a time for which a gap f of rate df does not close, at best `left`, that to the end of its panel.

    Its closing acceleration is a now and at most `most` on the panel. The parabola of a bound of it over all of `left`
    lasts a while; over four times that while the bound is narrower, and so on.
    """
    if f == 0.0 and df == 0.0:
        return 0.0
    step = min(left, time_to_contact(f, df, min(most, a + panel.rise * left)))
    while 0.0 < step < left:
        near = min(left, 4.0 * step)
        longer = time_to_contact(f, df, min(most, a + panel.rise * near))
        if longer < near:
            return max(step, longer)
        step = near
    return step if step <= 0.0 else left


@rare
@kernel
def opens(wall: Record, panel: Record, now: State, turns: float, s: float) -> float:
    """Return how long a gap that is not closing, at a time s after `now`, stays open on this panel because it is pulled
    open: from acceleration, its rate and the bound of its second rate. So balls leave that are lifted off. 0 if it is
    not pulled open."""
    a, j = pressed(panel, now.pull, coordinate(wall, panel, now, turns, s))
    if a > NOISE * (abs(now.pull) + wall.stiff) + max(0.0, -j) * now.blur:
        return 0.0
    a = min(a, 0.0)
    root = math.sqrt(j * j - 3.0 * a * panel.bend)
    if j > 0.0:
        return -6.0 * a / (j + root)
    return 2.0 * (root - j) / panel.bend if panel.bend > 0.0 else NEVER


@rare
@kernel
def touch(s: float, f: float, df: float, a: float) -> float:
    """Return the time of a hit from a state within rounding of it: one last step, if there is room for it."""
    if f <= 0.0:
        return s
    step = time_to_contact(f, df, a)
    return s + step if step < NEVER else s


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
    k, turns, s = now.panel, 0.0, 0.0
    for _ in range(wall.panels + 1):
        end = lasts(wall, panels, now, k, turns)
        if pull + panels[k].least < 0.0:
            found = falls_on_panel(wall, panels, now, k, turns, s, end)
            if found < NEVER:
                return (found, 0.0) if found <= within else (NEVER, 0.0)
        s = max(s, end)
        k, turns = next_panel(wall, k, turns)
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
    panel, noise = panels[k], NOISE * (abs(now.pull) + wall.stiff)
    while s < end:
        a, j = pressed(panel, now.pull, coordinate(wall, panel, now, turns, s))
        if a <= -noise:
            return s
        # certain to fall: though its second rate be `bend`, its least, a - j²/(2 bend), is below -noise; it fell
        # through 0 where its tangent does
        if a <= 0.0 and j < 0.0 and j * j >= 4.0 * max(panel.bow, panel.bend) * noise:
            return max(0.0, s + a / -j)
        step = time_to_contact(a + noise, j, panel.bow)
        if s + step == s:
            return s
        s += step
    return NEVER


@rare
@kernel
def pressing_bounds(
    wall: Record, panels: Records, t: float, tail: float, pull: float, span: float
) -> tuple[float, float]:
    """Return certain bounds, below and above, of pull + m'' (m/s²) from now, t + tail, to `span` (s) later.

    A bouncing ball may be taken to its rest on the wall while the lower one is above 0 up to the end of its bounces;
    the flank of an isolated contact is no more convex than max(0, -lower). Beyond its end a path goes on as it does on
    its last panel. Bounds of a short time are as narrow as the acceleration changes in it.
    """
    now = state(wall, panels, t, tail, 0.0, 0.0, pull)
    least, most = NEVER, -NEVER
    k, turns, s = now.panel, 0.0, 0.0
    for _ in range(wall.panels + 1):
        end = lasts(wall, panels, now, k, turns)
        last = end >= span or (wall.periodic == 0 and k + 1 == wall.first + wall.panels)
        low, high = bounds(wall, panels[k], now, turns, s, span if last else end)
        least, most = min(least, low), max(most, high)
        if last:
            return least, most
        s = max(s, end)
        k, turns = next_panel(wall, k, turns)
    return least, most


@rare
@kernel
def bounds(
    wall: Record, panel: Record, now: State, turns: float, s: float, until: float
) -> tuple[float, float]:
    """Return bounds of pull + m'' on a panel between two times after `now`: those of the panel, or, if narrower, what
    the values at both and the bounds of the rate allow between them."""
    pull, length = now.pull, max(0.0, until - s)
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
