"""Certified times of the first hit of a driven wall and of the first lift-off.

All searches step forward in time, and no step goes beyond the event. Consider a gap f with the rate f'. While its
closing acceleration is below M, the gap after a time s is above the parabola f + f's - ½Ms². A step to the root of this
parabola therefore cannot pass a hit. M is the bound of the current panel, or a narrower bound from the acceleration and
the bound of its rate. The steps converge quadratically at a hit, and few steps are needed at a near miss. Times at
which the wall cannot reach the ball are skipped.

A ball rests on the wall while its closing acceleration a = pull + m'' is positive (m towards the balls). The same
holds for a pile. The ball leaves the wall when a falls to 0, and immediately if a < 0. A jump of the wall velocity
towards the ball is a hit.
"""

from __future__ import annotations

import math

from granular._engine.flight import time_to_contact
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records
from granular.scene.walls.gap import (
    GAP_NOISE,
    State,
    coordinate,
    flight,
    gap_state,
    height_above_wall,
    is_panel_end_near,
    later_panel,
    next_panel,
    next_panel_state,
    rate_error,
    time_to_panel_end,
)
from granular.scene.walls.path import closing_acceleration_at

NO_HIT = math.inf
MAX_PERIODS = 2.0**50
"""Number of periods after which a float no longer resolves the phase of the wall.

If the search reaches this time without a hit, this time is returned as the hit.
"""
SHORT_STEP_SHARE = 2.0**-6
"""Fraction of the rest of a panel below which a step is short.

If a step is shorter, `opening_time` is tried as well.
"""


@rare
@kernel
def first_hit(
    wall: Record, panels: Records, t: float, tail: float, gap: float, rate: float, pull: float, within: float
) -> float:
    """Return the time (s) until a driven wall hits a ball, or inf without a hit.

    Parameters
    ----------
    wall, panels : records
        From `Panels.records`.
    t, tail : float
        Current time t + tail in s.
    gap : float
        Current gap in m, not negative.
    rate : float
        Rate of the gap in m/s, including the motion of the wall.
    pull : float
        Closing acceleration without the motion of the wall, in m/s²: g at a floor, -g at a ceiling, plus the
        acceleration by other forces on the ball. It is constant.
    within : float
        Length of the search in s, possibly inf. The search also ends with the path of a wall that is not periodic.

    Notes
    -----
    If the gap is 0 and closes, the result is 0. If the gap is 0 and opens, the ball has just been hit, and the next hit
    is returned. For a ball at rest on the wall the result is inf. `lift_off` returns when this ball leaves the wall.

    No hit is missed. A gap of at most twice its rounding error is a hit if it decreases. A minimum of the gap that does
    not stay above the rounding error, 4·2⁻⁵³ times its terms, is a hit as well. After `MAX_PERIODS` periods a float no
    longer resolves the phase of the wall. This time counts as the hit.
    """
    now, elapsed = gap_state(wall, panels, t, tail, gap, rate, pull), 0.0
    k, turns, s = now.panel, 0.0, 0.0
    # a ball at rest is not hit; `lift_off` returns when it leaves
    if gap == 0.0 and rate == 0.0 and opening_time(wall, panels[k], now, 0.0, 0.0) == 0.0:
        return NO_HIT
    while elapsed + s <= within:
        end = time_to_panel_end(wall, panels, now, k, turns)
        s, hit = hit_on_panel(wall, panels, now, k, turns, s, end)
        if hit:
            return elapsed + s if elapsed + s <= within else NO_HIT
        if s == NO_HIT:
            return NO_HIT
        # restart on the next panel while divided differences are precise there
        if k == now.panel and turns == 0.0 and is_panel_end_near(wall, panels, now, s):
            end = max(0.0, end)
            now = next_panel_state(wall, panels, now, end)
            elapsed += end
            s, k = max(0.0, s - end), now.panel
        s += time_out_of_reach(wall, now, s)
        if s == NO_HIT:
            return NO_HIT
        # a float no longer resolves the phase: this time counts as the hit
        if wall.periodic and wall.frequency * s > MAX_PERIODS:
            return elapsed + s if elapsed + s <= within else NO_HIT
        k, turns = panel_from_time(wall, panels, now, k, turns, s)
        if k < 0:
            return NO_HIT
    return NO_HIT


@rare
@kernel
def panel_from_time(wall: Record, panels: Records, now: State, k: int, turns: float, s: float) -> tuple[int, float]:
    """Return the panel at the time s (s) after `now`: its index and its period number.

    The period number is the number of whole periods of the wall between the period of `now` and this panel. `k` and
    `turns` are the same two numbers for the previous step. At an edge the later panel is returned. The index is -1 if
    the path ends at that time.
    """
    end = time_to_panel_end(wall, panels, now, k, turns)
    if s > end:
        k, turns = later_panel(wall, panels, now, s)
        end = time_to_panel_end(wall, panels, now, k, turns)
    if s < end:
        return k, turns
    k, later = next_panel(wall, k, turns)
    return (k, later) if later == turns or wall.periodic else (-1, turns)


@rare
@kernel
def time_out_of_reach(wall: Record, now: State, s: float) -> float:
    """Return a time (s) during which the wall certainly cannot reach the ball.

    It is counted from the time s after `now`. It is `NO_HIT` (inf) if the wall never reaches the ball, and 0 if the
    ball is within reach.
    """
    height, rate, noise = height_above_wall(wall, now, s)
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
    """Search for a hit on panel k, from the time s to the time `end` after `now`.

    Return the time (s) of the hit after `now` and True. Without a hit, return False and a time, not before `end`, up to
    which the gap certainly does not close. Panel k is `turns` periods after the period of `now`.
    """
    panel, pull = panels[k], now.pull
    slack = GAP_NOISE * (abs(pull) + wall.stiff)  # rounding error of the closing acceleration
    while s < end:
        f, df, a, noise = flight(wall, panels, now, k, turns, s)
        # a rate within its rounding error has no sign
        df = df if abs(df) > rate_error(wall, now, s) else 0.0
        if f <= 2.0 * noise and df < 0.0:
            return refined_hit(s, f, df, a), True
        certain_gap, left = f - noise if f > noise else 0.0, end - s
        step = safe_step(panel, certain_gap, df, a - slack, pull + panel.most - slack, left)
        # The ball has just left the wall: `safe_step` is very short or 0, because the gap is about 0. The acceleration
        # alone keeps the gap open for a longer time.
        if df >= 0.0 and (a <= slack or s == df == 0.0) and step < SHORT_STEP_SHARE * left:
            step = max(step, opening_time(wall, panel, now, turns, s))
        if step >= left:
            if wall.periodic and certain_gap > noise:  # no velocity jumps: the bound holds on all panels
                return max(end, s + time_to_contact(certain_gap, df, pull + wall.stiff)), False
            return end, False
        # the step is below the resolution of time: the gap closes now
        if s + step == s:
            return s, True
        s += step
    return end, False


@rare
@kernel
def safe_step(panel: Record, f: float, df: float, a: float, most: float, left: float) -> float:
    """Return a time (s) during which a gap f (m) of rate df (m/s) does not close.

    It is at most `left`, the time (s) to the end of the panel. The closing acceleration (m/s²) is `a` now and at most
    `most` on the panel. Its bound over all of `left` gives a first step. Over four times this step the bound is
    narrower and gives a longer step, and so on.
    """
    if f == 0.0 and df == 0.0:
        return 0.0
    step = min(left, time_to_contact(f, df, min(most, a + panel.rise * left)))
    while 0.0 < step < left:
        interval = min(left, 4.0 * step)
        longer_step = time_to_contact(f, df, min(most, a + panel.rise * interval))
        if longer_step < interval:
            return max(step, longer_step)
        step = interval
    return step if step <= 0.0 else left


@rare
@kernel
def opening_time(wall: Record, panel: Record, now: State, turns: float, s: float) -> float:
    """Return a time (s) during which the acceleration keeps a gap open on this panel.

    It is counted from the time s after `now`, at which the rate of the gap must not be negative. It is 0 if the
    acceleration closes the gap. It follows from the acceleration, its rate and the bound of its second derivative. The
    function is used for a ball that has just left the wall.
    """
    a, j = closing_acceleration_at(panel, now.pull, coordinate(wall, panel, now, turns, s))
    if a > GAP_NOISE * (abs(now.pull) + wall.stiff) + max(0.0, -j) * now.time_error:
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
def refined_hit(s: float, f: float, df: float, a: float) -> float:
    """Return the time (s) of a hit near `s`, where the gap is 0 up to rounding errors.

    `f` (m), `df` (m/s) and `a` (m/s²) are gap, rate and closing acceleration at `s`. If the gap is still positive, the
    time until it closes is added.
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
    """Return when a resting ball leaves a driven wall, and the rate of the gap then.

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
        Time in s from now, and rate of the gap in m/s just after it. They are inf and 0 if the ball stays on the wall.
        If the rate is 0, the ball lifts off because pull + m'' falls below 0 (s is 0 if it is already negative). If the
        rate is positive, the velocity of the wall jumps away from the ball. If it is negative, the velocity jumps
        towards the ball: a hit.

    Notes
    -----
    pull + m'' is the closing acceleration, where m(t) is the displacement of the wall towards the ball. A ball stays on
    the wall while pull + m'' is negative only by rounding, at most 4·2⁻⁵³ (|pull| + max |m''|).
    """
    now = gap_state(wall, panels, t, tail, 0.0, 0.0, pull)
    k, turns, s = now.panel, 0.0, 0.0
    # a full turn and the rest of the first panel
    for _ in range(wall.panels + 1):
        end = time_to_panel_end(wall, panels, now, k, turns)
        if pull + panels[k].least < 0.0:
            time = lift_off_on_panel(wall, panels, now, k, turns, s, end)
            if time < NO_HIT:
                return (time, 0.0) if time <= within else (NO_HIT, 0.0)
        s = max(s, end)
        k, turns = next_panel(wall, k, turns)
        if s > within or (turns > 0.0 and wall.periodic == 0):
            return NO_HIT, 0.0
        if panels[k].jump != 0.0:
            return s, -panels[k].jump
    return NO_HIT, 0.0


@rare
@kernel
def lift_off_on_panel(
    wall: Record, panels: Records, now: State, k: int, turns: float, s: float, end: float
) -> float:
    """Return the time (s) after `now` at which pull + m'' falls below 0 on panel k.

    The search goes from the time s to the time `end` after `now`. The result is inf if pull + m'' stays positive. No
    step goes beyond the event, because the bound of the second derivative keeps pull + m'' above a parabola.
    """
    panel, noise = panels[k], GAP_NOISE * (abs(now.pull) + wall.stiff)
    while s < end:
        a, j = closing_acceleration_at(panel, now.pull, coordinate(wall, panel, now, turns, s))
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
    """Return guaranteed bounds of the closing acceleration pull + m'' (m/s²).

    The lower and the upper bound hold for `span` (s) from the time t + tail. If the lower bound is positive until the
    end of the bounces of a ball, the ball can be set to rest on the wall. The second derivative of a gap at the wall is
    at most -lower. The last panel of a path is used for all later times. For a short interval, the bounds are as narrow
    as the change of the acceleration.
    """
    now = gap_state(wall, panels, t, tail, 0.0, 0.0, pull)
    least, most = NO_HIT, -NO_HIT
    k, turns, s = now.panel, 0.0, 0.0
    # a full turn and the rest of the first panel
    for _ in range(wall.panels + 1):
        end = time_to_panel_end(wall, panels, now, k, turns)
        last = end >= span or (wall.periodic == 0 and k + 1 == wall.first + wall.panels)
        low, high = pressing_bounds_on_panel(wall, panels[k], now, turns, s, span if last else end)
        least, most = min(least, low), max(most, high)
        if last:
            return least, most
        s = max(s, end)
        k, turns = next_panel(wall, k, turns)
    return least, most


@rare
@kernel
def pressing_bounds_on_panel(
    wall: Record, panel: Record, now: State, turns: float, s: float, until: float
) -> tuple[float, float]:
    """Return guaranteed bounds of pull + m'' (m/s²) during a part of a panel.

    The part is between the times `s` and `until` (s) after `now`. The result consists of the bounds of the panel, or of
    narrower bounds from the values at both times and the bounds of the rate.
    """
    pull, length = now.pull, max(0.0, until - s)
    noise = GAP_NOISE * (abs(pull) + wall.stiff)
    a, _ = closing_acceleration_at(panel, pull, coordinate(wall, panel, now, turns, s))
    b, _ = closing_acceleration_at(panel, pull, coordinate(wall, panel, now, turns, s + length))
    # panel.fall ≤ 0 is a bound of the derivative, `lower_bound` expects its magnitude
    low = lower_bound(a, b, panel.rise, -panel.fall, length)
    # minus the lower bound of the negative function, whose rise and fall are exchanged
    high = -lower_bound(-a, -b, -panel.fall, panel.rise, length)
    return max(low, pull + panel.least) - noise, min(high, pull + panel.most) + noise


@rare
@kernel
def lower_bound(a: float, b: float, rise: float, fall: float, length: float) -> float:
    """Return a lower bound of a function on an interval from its values at the ends.

    The values are a and b, the derivative is between -fall ≤ 0 and rise ≥ 0, and `length` is the length of the
    interval.
    """
    if rise + fall == 0.0:
        return min(a, b)
    # time for which the steepest path falls before it has to rise to b
    falling_time = min(max((a - b + rise * length) / (rise + fall), 0.0), length)
    return a - fall * falling_time
