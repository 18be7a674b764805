"""Thermal walls: a ball that hits one leaves with a speed drawn anew.
May be skipped: rarer, walls that heat.

The kernels of `riding` and `driven` once more, with another event for the pair beside such a wall. What is drawn hangs
on how often this pair has hit before, so every queue, and a run that goes on, draws the same. It is never part of a
touching group or of a closer look, and never merges: a ball that stands on such a wall, pressed on it, is hit at once.
"""

from __future__ import annotations

from granular._kernels import kernel, rare, specialised
from granular._records import Record, Records
from granular.edmd.account import enter
from granular.edmd.driven import meets
from granular.edmd.driven import predicted as predicted_driven
from granular.edmd.driven import touches as touches_driven
from granular.edmd.groups import group as group_driven
from granular.edmd.motion import NOISE, Walls, impulse, velocities
from granular.edmd.parting import wake
from granular.edmd.physics import Restitution
from granular.edmd.riding import event as event_driven
from granular.edmd.sums import add
from granular.walls.thermal import drawn


@kernel
def predicted(pair: Record, lower: Record, upper: Record, walls: Walls) -> float:
    """Return the time at which a pair collides; that of one at rest on a thermal wall is now, if it is pressed on."""
    if pair.heat >= 0 and pair.gap == 0.0 and pair.pull > 0.0 and (upper.u - lower.u) - pair.pull * pair.at <= 0.0:
        return pair.at  # type: ignore[no-any-return]
    return predicted_driven(pair, lower, upper, walls)


@kernel
def touches(pair: Record, lower: Record, upper: Record, now: float, walls: Walls) -> bool:
    """Return whether a pair is part of a touching group at time `now`."""
    return pair.heat < 0 and touches_driven(pair, lower, upper, now, walls)


group_without = specialised(group_driven, touches=touches)

@rare
@kernel
def group(pairs: Records, bodies: Records, c: int, now: float, walls: Walls) -> tuple[int, int]:
    """Return the first and the last pair of the group around pair `c` that touches at time `now`."""
    if pairs[c].heat >= 0:
        return c, c
    return group_without(pairs, bodies, c, now, walls)


@kernel
def event(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, rule: Restitution | None, row: Record | None,
    walls: Walls,
) -> tuple[int, int, float]:  # fmt: skip
    """Let pair `c` collide at time `now`; return the first and the last pair to predict anew, and the rate after."""
    if pairs[c].heat >= 0:
        return heated(run, pairs, bodies, c, now, row, walls)
    return event_driven(run, pairs, bodies, c, now, rule, row, walls)


@rare
@kernel
def heated(
    run: Record, pairs: Records, bodies: Records, c: int, now: float, row: Record | None, walls: Walls
) -> tuple[int, int, float]:
    """Let the ball of pair `c` leave the thermal wall it hits at time `now`; return what `event` does.

    With w the rate before and s the speed drawn, the wall gives the impulse m(s - w), the work of that at its own
    velocity, and the heat ½m(s² - w²).
    """
    pair, lower, upper, g = pairs[c], bodies[c], bodies[c + 1], run.gravity
    side, w = walls[0][pair.heat], meets(pair, lower, upper, walls)
    if row is not None:
        row.pair, row.t_begin = c, now
        row.lower_in, row.upper_in = velocities(lower, upper, g, now)
    pair.gap, pair.at = 0.0, now
    start, end = wake(run, pairs, bodies, c, now, walls)
    ball = upper if pair.heat == 0 else lower
    s = drawn(side.temperature, side.seed, pair.heat, pair.hits, ball.mass)
    if pair.heat == 0:
        upper.u = lower.u + (pair.pull * now + s)
    else:
        lower.u = upper.u - (pair.pull * now + s)
    ball.noise = NOISE * (ball.u * ball.u + s * s)
    given = impulse(lower, upper, w - s)
    enter(lower, upper, given, 0.0, walls)
    side.heat, side.heat_low = add(side.heat, side.heat_low, 0.5 * (s + w) * given)
    side.given, side.given_low = add(side.given, side.given_low, given)
    if row is not None:
        row.lower_out, row.upper_out = velocities(lower, upper, g, now)
        row.impulse = given
    pair.hits += 1
    pair.last = now
    return start, end, s
