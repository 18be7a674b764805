"""Certified times of the first hit of a moving wall and of the first lift-off.

All searches step forward from below and never pass the event.

While the closing acceleration stays below M, the gap stays above the parabola f + f's - ½Ms². A step to the root of
this parabola is therefore safe. On each panel, M is the bound of the panel, or a narrower bound from the acceleration
and the bound of its rate. The steps converge quadratically at a hit and pass a near miss quickly. Times at which the
wall cannot reach the ball are skipped.

A ball that rests on the wall presses on it while a = pull + m'' > 0 (m towards the balls). The same holds for a pile.
The ball leaves where a falls to 0, and immediately where a < 0. A jump of the wall velocity towards the ball is a hit.
"""

from __future__ import annotations

import math

from granular._engine.flight import time_to_contact
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.scene.walls.gap import (
    GAP_NOISE,
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

NO_HIT = math.inf
MAX_PERIODS = 2.0**50
"""Number of periods after which a float no longer resolves the phase of the wall.

A gap that is still open then counts as closed at that time.
"""
SHORT_STEP_SHARE = 2.0**-6
"""Share of the rest of a panel below which a step triggers a refined bound."""


@rare
@kernel
def first_hit(
    wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float, within: float
) -> float:
    """Return the time (s) from now at which a gap closes, or inf.

    The result is inf if the gap does not close within `within` (s).

    Parameters
    ----------
    wall, panels : records
        From `Panels.records`.
    t, tail : float
        Current time t + tail in s.
    gap : float
        Current gap in m, not negative.
    rate : float
        Its total rate in m/s, including the motion of the wall.
    pull : float
        Its constant closing acceleration in m/s²: g at a floor, -g at a ceiling, plus other forces on the ball.
    within : float
        Length of the search in s, possibly inf. The search also ends with the path of a wall that is not periodic.

    Notes
    -----
    A gap of 0 that closes is hit now. A gap of 0 that opens or rests belongs to the previous hit, which is not found
    again. `lift_off` returns when a ball at rest leaves the wall. A minimum of the gap is a hit unless it stays above
    the noise of the gap, 4 2⁻⁵³ of its terms. No hit is missed. A hit is reported once the gap is at most twice the
    noise.
    """
    now, passed = state(wall, panels, t, tail, gap, rate, pull), 0.0
    k, turns, s = now.panel, 0.0, 0.0
    # a ball at rest is not hit; `lift_off` returns when it leaves
    if gap == 0.0 and rate == 0.0 and opens(wall, panels[k], now, 0.0, 0.0) == 0.0:
        return NO_HIT
    while passed + s <= within:
        end = lasts(wall, panels, now, k, turns)
        s, hit = hit_on_panel(wall, panels, now, k, turns, s, end)
        if hit:
            return passed + s if passed + s <= within else NO_HIT
        if s == NO_HIT:
            return NO_HIT
        # restart on the next panel while divided differences are precise there
        if k == now.panel and turns == 0.0 and short(wall, panels, now, s):
            end = max(0.0, end)
            now = hop(wall, panels, now, end)
            passed += end
            s, k = max(0.0, s - end), now.panel
        s += out_of_reach(wall, now, s)
        if s == NO_HIT:
            return NO_HIT
        if wall.periodic and wall.frequency * s > MAX_PERIODS:
            return passed + s if passed + s <= within else NO_HIT
        k, turns = onward(wall, panels, now, k, turns, s)
        if k < 0:
            return NO_HIT
    return NO_HIT


@rare
@kernel
def onward(wall: Record, panels: Records, now: State, k: int, turns: float, s: float) -> tuple[int, float]:
    """Return the panel for the time s after `now`, and its turns.

    That time is on the panel, possibly at its start. The number is -1 if the path ends there. The previous panel was k.
    """
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
    """Return a time in s for which the ball stays out of reach of the wall.

    The interval starts a time s after `now`. The result is `NO_HIT` for all times, and 0 if the ball is within reach.
    """
    height, rate, noise = above(wall, now, s)
    if rate == 0.0 and now.pull == 0.0 and wall.speed == 0.0:
        return NO_HIT
    room = height - wall.reach - noise
    # the factor keeps the rounded time below the exact time
    return 0.0 if room <= 0.0 else time_to_contact(room, rate, now.pull) * (1.0 - 2.0**-50)


@rare
@kernel
def hit_on_panel(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float, end: float
) -> tuple[float, bool]:
    """Return the time after `now` at which the gap closes on panel k, and True.

    Without a hit on panel k it returns False and a time, `end` or later, before which the gap does not close.
    """
    panel, pull = panels[k], now.pull
    slack = GAP_NOISE * (abs(pull) + wall.stiff)
    while s < end:
        f, df, a, noise = flight(wall, panels, now, k, turns, s)
        # a rate within its rounding error has no sign
        df = df if abs(df) > faint(wall, now, s) else 0.0
        if f <= 2.0 * noise and df < 0.0:
            return touch(s, f, df, a), True
        sure, left = f - noise if f > noise else 0.0, end - s
        step = stays_open(panel, sure, df, a - slack, pull + panel.most - slack, left)
        if df >= 0.0 and (a <= slack or s == df == 0.0) and step < SHORT_STEP_SHARE * left:
            step = max(step, opens(wall, panel, now, turns, s))
        if step >= left:
            if wall.periodic and sure > noise:  # no velocity jumps: the bound holds on all panels
                return max(end, s + time_to_contact(sure, df, pull + wall.stiff)), False
            return end, False
        # the step is below the resolution of time
        if s + step == s:
            return s, True
        s += step
    return end, False


@rare
@kernel
def stays_open(panel: Record, f: float, df: float, a: float, most: float, left: float) -> float:
    """Return a time during which a gap f of rate df does not close, at most `left`.

    `left` is the time to the end of the panel. The closing acceleration is a now and at most `most` on the panel. A
    bound of it over all of `left` gives a first step. Over four times that step the bound is narrower, and so on.
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
    """Return how long a gap that does not close is pulled open on this panel, else 0.

    The interval starts a time s after `now`. It follows from the acceleration, its rate and the bound of its second
    rate. In this way a ball leaves after lift-off.
    """
    a, j = pressed(panel, now.pull, coordinate(wall, panel, now, turns, s))
    if a > GAP_NOISE * (abs(now.pull) + wall.stiff) + max(0.0, -j) * now.blur:
        return 0.0
    a = min(a, 0.0)
    # root of a + j s/3 + bend s²/12, at which a lower bound of the gap returns to 0
    root = math.sqrt(j * j - 3.0 * a * panel.bend)
    # of the two forms of the root, the one without cancellation
    if j > 0.0:
        return -6.0 * a / (j + root)
    return 2.0 * (root - j) / panel.bend if panel.bend > 0.0 else NO_HIT


@rare
@kernel
def touch(s: float, f: float, df: float, a: float) -> float:
    """Return the time of a hit from a state whose gap is 0 up to rounding errors.

    `f`, `df` and `a` are gap, rate and acceleration. If the gap is still positive, one last step is added.
    """
    if f <= 0.0:
        return s
    step = time_to_contact(f, df, a)
    return s + step if step < NO_HIT else s


@rare
@kernel
def lift_off(
    wall: Record, panels: Records, t: float, tail: float, pull: float, within: float
) -> tuple[float, float]:
    """Return the time (s) at which a ball at rest leaves a wall, and the rate then.

    Parameters
    ----------
    wall, panels : records
        From `Panels.records`.
    t, tail : float
        Current time t + tail in s.
    pull : float
        Constant closing acceleration in m/s²: g at a floor, -g at a ceiling.
    within : float
        Length of the search in s. The search also ends with the path of a wall that is not periodic.

    Returns
    -------
    s, rate : float
        Time in s from now, and rate of the gap in m/s at that time. They are inf and 0 if the ball stays on the wall.
        A rate of 0 means that pull + m'' falls to 0 (s is 0 if it is already below 0). A positive rate means that the
        velocity of the wall jumps away from the ball. A negative rate means that it jumps against the ball, a hit.

    Notes
    -----
    Values of pull + m'' below 0 by no more than rounding, 4 2⁻⁵³ (|pull| + max |m''|), do not lift a ball.
    """
    now = state(wall, panels, t, tail, 0.0, 0.0, pull)
    k, turns, s = now.panel, 0.0, 0.0
    # a full turn and the rest of the first panel
    for _ in range(wall.panels + 1):
        end = lasts(wall, panels, now, k, turns)
        if pull + panels[k].least < 0.0:
            found = falls_on_panel(wall, panels, now, k, turns, s, end)
            if found < NO_HIT:
                return (found, 0.0) if found <= within else (NO_HIT, 0.0)
        s = max(s, end)
        k, turns = next_panel(wall, k, turns)
        if s > within or (turns > 0.0 and wall.periodic == 0):
            return NO_HIT, 0.0
        if panels[k].jump != 0.0:
            return s, -panels[k].jump
    return NO_HIT, 0.0


@rare
@kernel
def falls_on_panel(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float, end: float
) -> float:
    """Return the time at which pull + m'' falls below 0 on panel k, or inf.

    The time is counted from `now`, and the search ends at `end`. It steps from below: a bound of the second rate keeps
    pull + m'' above a parabola.
    """
    panel, noise = panels[k], GAP_NOISE * (abs(now.pull) + wall.stiff)
    while s < end:
        a, j = pressed(panel, now.pull, coordinate(wall, panel, now, turns, s))
        if a <= -noise:
            return s
        # certain to fall: even if its second rate is `bend`, the minimum a - j²/(2 bend) is below -noise. The event
        # is at the root of the tangent
        if a <= 0.0 and j < 0.0 and j * j >= 4.0 * max(panel.bow, panel.bend) * noise:
            return max(0.0, s + a / -j)
        step = time_to_contact(a + noise, j, panel.bow)
        if s + step == s:
            return s
        s += step
    return NO_HIT


@rare
@kernel
def pressing_bounds(
    wall: Record, panels: Records, t: float, tail: float, pull: float, span: float
) -> tuple[float, float]:
    """Return certain lower and upper bounds of pull + m'' (m/s²) during `span` (s).

    The interval starts now, at t + tail. A bouncing ball can be set to rest on the wall if the lower bound is above 0
    until the end of its bounces. The flank of an isolated contact is at most as convex as max(0, -lower). A path that
    has ended is continued by its last panel. Bounds for a short time are as narrow as the change of acceleration in
    it.
    """
    now = state(wall, panels, t, tail, 0.0, 0.0, pull)
    least, most = NO_HIT, -NO_HIT
    k, turns, s = now.panel, 0.0, 0.0
    # a full turn and the rest of the first panel
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
    """Return bounds of pull + m'' on a panel between two times after `now`.

    They are the bounds of the panel, or narrower ones from the values at both times and the bounds of the rate.
    """
    pull, length = now.pull, max(0.0, until - s)
    noise = GAP_NOISE * (abs(pull) + wall.stiff)
    a, _ = pressed(panel, pull, coordinate(wall, panel, now, turns, s))
    b, _ = pressed(panel, pull, coordinate(wall, panel, now, turns, s + length))
    low = lowest(a, b, panel.rise, -panel.fall, length)
    high = -lowest(-a, -b, -panel.fall, panel.rise, length)
    return max(low, pull + panel.least) - noise, min(high, pull + panel.most) + noise


@rare
@kernel
def lowest(a: float, b: float, rise: float, fall: float, length: float) -> float:
    """Return a lower bound of functions that change from a to b in `length`.

    Their rates of increase and decrease are at most `rise` and `fall`, both not negative.
    """
    if rise + fall == 0.0:
        return min(a, b)
    # time for which the steepest path falls before it has to rise to b
    down = min(max((a - b + rise * length) / (rise + fall), 0.0), length)
    return a - fall * down
