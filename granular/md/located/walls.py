"""Driven walls in a run: free flight next to a wall, and their series in pieces.

A pair at a driven wall closes at the acceleration pull + m'', where m is the displacement of the wall towards the
balls. In free flight the pair follows the exact path of the wall, and its next touch is certified
(`granular.scene.walls.hits`). In an island, the power series of m'' is added to the acceleration of the overlap. A
piece ends at the latest at the end of a panel of the path, the event EDGE, where the velocity of the wall can jump.
Paths are evaluated at start + t + tail with the run's own clock t + tail, so that a late start costs no digits.

`pair.wall` is the number of the wall, from 1 onwards, or 0 for other pairs. Scenes without driven walls use kernels
with `DRIVEN` false, in which nothing of this module is compiled.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.flight import gap_after, hung_after, hung_rate_at_contact, hung_time_to_contact, rate_at_contact
from granular._engine.kernels import DRIVEN, HUNG, kernel
from granular._engine.records import plain, record_array
from granular.md.located.records import SERIES_ORDER
from granular.scene.places import driven_walls
from granular.scene.walls import path
from granular.scene.walls.gap import gap_at_time
from granular.scene.walls.hits import first_hit, pressing_bounds
from granular.scene.walls.path import (
    MAX_TERMS,
    PANEL_DTYPE,
    WALL_DTYPE,
    edge_jump,
    exact_sum,
    expansion,
    time_to_edge,
    wall_at,
)

if TYPE_CHECKING:
    from granular.scene import Scene

Walls = namedtuple("Walls", "start wall panels path push")
"""Driven walls of a run.

`start` is the time in s at which the run's own clock is 0. `wall` and `panels` are records `WALL_DTYPE` and
`PANEL_DTYPE`. `path` and `push` are temporary storage per wall. `path` has the power series of the displacement side·m
in m, in powers of the time in s. `push` has the series of the acceleration in powers of τ."""
Pendula = namedtuple("Pendula", "omega square")
"""Parameters of pendula in free flight: Ω in 1/s, and Ω² in 1/s².

They are the `field` of a run with pendula, in place of `Walls`."""
MAX_TERM_SUM = 4.0
"""Maximum sum of the terms of a wall's acceleration series, in units of its bound.

The duration of a piece is limited so that the sum stays below this value."""


def walls_of(scene: Scene, start: float, terms: int) -> Walls | None:
    """Return the driven walls of a scene for a run that starts at time `start` in s.

    `terms` is the number of coefficients of the acceleration series in a piece. Returns None if no wall ever moves.
    """
    driven = driven_walls(scene, start, still=False)
    if not driven:
        return None
    _, walls, panels = zip(*driven, strict=True)
    scratch = np.zeros((len(walls), MAX_TERMS)), np.zeros((len(walls), terms))
    return Walls(start, np.concatenate(walls), np.concatenate(panels), *scratch)


def numbers_at_ends(walls: Walls) -> tuple[int, int]:
    """Return the numbers of the driven walls at the lower and upper end of a scene.

    Numbers start with 1. The number is 0 at an end without a driven wall.
    """
    sides = [float(wall["side"]) for wall in walls.wall]
    return (1 if sides[0] > 0.0 else 0), (len(sides) if sides[-1] < 0.0 else 0)


def with_walls(walls: Walls, velocity: Array) -> Array:
    """Return the velocities of the bodies in m/s, with driven walls at the start time.

    `velocity` has shape (n,) and is not modified.
    """
    velocity = np.array(velocity)
    wall, panels = plain(walls.wall), plain(walls.panels)
    for record in wall:
        velocity[0 if record.side > 0.0 else -1] = path.wall_at(record, panels, walls.start, 0.0)[1]
    return velocity


def plain_walls(walls: Any) -> Any:
    """Convert driven walls to plain objects and lists for interpreted code.

    Pendula and None are returned unchanged.
    """
    if not isinstance(walls, Walls) or isinstance(walls.wall, list):
        return walls
    return Walls(walls.start, plain(walls.wall), plain(walls.panels), walls.path.tolist(), walls.push.tolist())


def compiled_walls(walls: Any) -> Any:
    """Convert driven walls to numpy arrays for compiled code.

    Pendula and None are returned unchanged.
    """
    if not isinstance(walls, Walls):
        return walls
    scratch = np.array(walls.path), np.array(walls.push)
    return Walls(walls.start, record_array(walls.wall, WALL_DTYPE), record_array(walls.panels, PANEL_DTYPE), *scratch)


@kernel
def caller_time(walls: Any, t: float, tail: float) -> tuple[float, float]:
    """Return the time of the scene in s at the time t + tail of the run's own clock.

    It is `walls.start` + t + tail, as the sum of two floats.
    """
    high, low = exact_sum(walls.start, t)
    return high, low + tail


@kernel
def free_flight(field: Any, pair: Any, dt: float) -> tuple[float, float]:
    """Return overlap (m) and rate (m/s) of a pair after `dt` (s) of free flight.

    The flight starts at the clock of the pair. The clock can be ahead of the run, at the end of a contact. A negative
    `dt` then gives the free motion continued backwards into this contact (the asymptote), not the motion during the
    contact. `field` is the record of driven walls or pendula, or None.
    """
    if DRIVEN and pair.wall > 0:
        return flight_at_wall(field, pair, 0.0, -pair.xi, -pair.eta, dt)
    if HUNG:
        gap, rate = hung_after(-pair.xi, -pair.eta, field.omega, rest_gap(field, pair), dt)
        return -gap, -rate
    return -gap_after(-pair.xi, -pair.eta, pair.pull, dt), pair.eta + pair.pull * dt


@kernel
def rest_gap(field: Any, pair: Any) -> float:
    """Return the gap in m between two pendula in their rest positions."""
    return float(-pair.pull / field.square)


@kernel
def rate_at(field: Any, pair: Any, t: float) -> float:
    """Return the rate of the overlap in m/s of a pair in free flight at time `t` in s."""
    if HUNG or (DRIVEN and pair.wall > 0):
        return float(free_flight(field, pair, (t - pair.t) - pair.tail)[1])
    return float(pair.eta + pair.pull * (t - pair.t))


@kernel
def flight_at_wall(walls: Any, pair: Any, ahead: float, gap: float, rate: float, dt: float) -> tuple[float, float]:
    """Return the overlap and rate of a pair at a driven wall after a flight of `dt`.

    The flight starts a time `ahead` (s) after the clock of the pair, with the given gap in m and its rate in m/s. A
    positive rate opens the gap. Of the results, a positive overlap rate closes it.
    """
    t, tail = caller_time(walls, pair.t, pair.tail + ahead)
    gap, rate = gap_at_time(walls.wall[pair.wall - 1], walls.panels, t, tail, gap, rate, pair.pull, dt)
    return -gap, -rate


@kernel
def touching_rate(field: Any, pair: Any, wait: float) -> float:
    """Return the rate of the overlap in m/s at which an open pair touches.

    The touch is a time `wait` in s after the clock of the pair.
    """
    if DRIVEN and pair.wall > 0:
        return free_flight(field, pair, wait)[1]
    if HUNG:
        return -hung_rate_at_contact(max(0.0, -pair.xi), -pair.eta, field.omega, rest_gap(field, pair))
    # an open pair can have a positive overlap by rounding
    return -rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull)


@kernel
def next_touch(field: Any, pair: Any) -> float:
    """Return the time in s until an open pair (ξ ≤ 0) touches next, or inf.

    The pair is in free flight. The time is counted from the pair's own clock, t + tail. The pair is at a driven wall,
    or the scene consists of pendula.
    """
    if HUNG:
        return hung_time_to_contact(max(0.0, -pair.xi), -pair.eta, field.omega, rest_gap(field, pair))
    t, tail = caller_time(field, pair.t, pair.tail)
    gap = max(0.0, -pair.xi)
    return first_hit(field.wall[pair.wall - 1], field.panels, t, tail, gap, -pair.eta, pair.pull, math.inf)


@kernel
def convexity(field: Any, pair: Any, ahead: float, span: float) -> float:
    """Return the largest acceleration in m/s² at which the gap of a flying pair opens.

    The maximum is over the interval `span` (s) that starts a time `ahead` (s) after its clock. It is 0 if gravity and
    the wall only close the gap.
    """
    if DRIVEN and pair.wall > 0:
        t, tail = caller_time(field, pair.t, pair.tail + ahead)
        lowest, _ = pressing_bounds(field.wall[pair.wall - 1], field.panels, t, tail, pair.pull, span)
        return max(0.0, -lowest)
    return float(max(0.0, -pair.pull))


@kernel
def update_walls(walls: Any, s: Any) -> None:
    """Set the velocities of driven walls, and the pulls at them, at the current event.

    Only pairs in islands have a pull that includes the acceleration of the wall.
    """
    run = s.run[0]
    for i in range(len(walls.wall)):
        c, b = (0, 0) if walls.wall[i].side > 0.0 else (len(s.pairs) - 1, len(s.bodies) - 1)
        s.bodies[b].v, push = velocity_of_wall(walls, i, run.t, run.tail)
        s.bodies[b].t, s.bodies[b].tail = run.t, run.tail
        if s.pairs[c].slot >= 0:
            s.pool[s.pairs[c].slot].pull = s.pairs[c].pull + push


@kernel
def gap_later(field: Any, pair: Any, ahead: float, gap: float, rate: float, dt: float) -> float:
    """Return the gap in m after a flight of `dt` from the given gap and its rate.

    The flight starts a time `ahead` (s) after the clock of the pair. `gap` is in m, and `rate` in m/s is positive if
    the gap opens.
    """
    if DRIVEN and pair.wall > 0:
        return -flight_at_wall(field, pair, ahead, gap, rate, dt)[0]
    if HUNG:
        return hung_after(gap, rate, field.omega, rest_gap(field, pair), dt)[0]
    return gap_after(gap, rate, pair.pull, dt)


@kernel
def rate_later(field: Any, pair: Any, gap: float, eta: float, dt: float) -> float:
    """Return the rate of the overlap in m/s after a flight of `dt` that ends at `gap`.

    `eta` is the rate of the overlap at the clock of the pair, where the flight starts.
    """
    if HUNG and dt > 0.0:
        cosine, sine = math.cos(field.omega * dt), math.sin(field.omega * dt)
        offset = (gap - rest_gap(field, pair) + eta / field.omega * sine) / cosine  # from the gap at rest, initially
        return float(eta * cosine + field.omega * offset * sine)
    if DRIVEN and pair.wall > 0 and dt > 0.0:
        return flight_at_wall(field, pair, 0.0, 0.0, -eta, dt)[1]
    return float(pair.pull * dt + eta)


@kernel
def speed_at(walls: Any, pair: Any, body: Any, block: Any) -> float:
    """Return the velocity in m/s of a wall at the clock of a block, upwards positive.

    `pair` is the pair at the wall, and `body` the record of the wall.
    """
    if DRIVEN and pair.wall > 0:
        return velocity_of_wall(walls, pair.wall - 1, block.t, block.tail)[0]
    return float(body.v)


@kernel
def velocity_of_wall(walls: Any, i: int, t: float, tail: float) -> tuple[float, float]:
    """Return the velocity of driven wall `i` and its acceleration towards the balls.

    The velocity in m/s is upwards positive. The acceleration is in m/s². Both are those at the time t + tail.
    """
    high, low = caller_time(walls, t, tail)
    _, v, a = wall_at(walls.wall[i], walls.panels, high, low)
    return v, walls.wall[i].side * a


@kernel
def expand_paths(walls: Any, pairs: Any, pool: Any, lo: int) -> float:
    """Expand the paths of driven walls in power series, for an island's next piece.

    The series start at the clock of the block whose first pair is `lo`. Returns the longest duration in s of the piece
    for which the series may be used, or inf without a driven wall. Where the path has edges, it is at most `holds` of
    the block, the time in s to the next edge of a panel, which is set here. Two fields of each pair at a driven wall
    are set as well, both in m/s²: `pull`, its closing acceleration at the start of the piece, and `sway`, a bound of
    the magnitude of this acceleration at any time.
    """
    reach = math.inf
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    block.holds = math.inf
    for c in range(lo, hi):
        if pairs[c].wall > 0:
            holds = expand_path(walls, pairs[c].wall - 1, block)
            wall, path = walls.wall[pairs[c].wall - 1], walls.path[pairs[c].wall - 1]
            member, bound = pool[pairs[c].slot], wall.stiff + abs(pairs[c].pull)
            # the constant term of the wall's acceleration is part of the pull
            member.pull, member.sway = pairs[c].pull + 2.0 * path[2], bound
            block.holds = min(block.holds, holds)
            reach = min(reach, series_time_limit(path, holds, bound))
    return reach


@kernel
def expand_path(walls: Any, i: int, block: Any) -> float:
    """Expand the path of driven wall `i` about the clock of a block, if necessary.

    Returns the time in s for which the expansion is valid.
    """
    wall = walls.wall[i]
    if not (wall.about == block.t and wall.about_tail == block.tail):
        t, tail = caller_time(walls, block.t, block.tail)
        wall.holds = expansion(wall, walls.panels, t, tail, walls.path[i])
        wall.about, wall.about_tail = block.t, block.tail
    return wall.holds  # type: ignore[no-any-return]


@kernel
def series_time_limit(path: Any, reach: float, bound: float) -> float:
    """Return a time up to `reach` in which the acceleration series of a wall is small.

    Times are in s. `path` has the coefficients of the displacement in m in powers of the time. The sum of the absolute
    values of the terms of the acceleration is at most `MAX_TERM_SUM` times `bound` (m/s²). If `reach` is inf, no single
    term exceeds `bound` instead.
    """
    if not reach < math.inf:
        # a path without edges: every term on its own stays below the bound
        reach = 1e300
        for j in range(3, len(path)):
            if path[j] != 0.0:
                reach = min(reach, math.pow(bound / abs(j * (j - 1) * path[j]), 1.0 / (j - 2)))
        return reach if reach < 1e300 else math.inf
    while True:
        size, power = 0.0, 1.0
        for j in range(2, len(path)):
            size += j * (j - 1) * abs(path[j]) * power
            power *= reach
        if not size > MAX_TERM_SUM * bound:
            return reach
        # this ends, because the constant term alone is within the bound
        reach *= 0.5


@kernel
def drive(walls: Any, pairs: Any, lo: int, hi: int, h: float, q: int) -> None:
    """Compute the accelerations of driven walls as power series in τ, with t = (hτ)^q.

    They are stored in `walls.push` in m/s². The constant terms are left out because they are part of the pull.
    """
    for c in range(lo, hi):
        if pairs[c].wall > 0:
            path, push, scale, h_to_q = walls.path[pairs[c].wall - 1], walls.push[pairs[c].wall - 1], 1.0, h
            for _ in range(1, q):
                h_to_q *= h
            for n in range(SERIES_ORDER + 1):
                push[n] = 0.0
            j = 1
            while j * q <= SERIES_ORDER and j + 2 < len(path):
                scale *= h_to_q
                # t^j is h^(jq) τ^(jq)
                push[j * q] = (j + 1) * (j + 2) * path[j + 2] * scale
                j += 1


@kernel
def time_to_wall_edge(walls: Any, pair: Any, block: Any) -> float:
    """Return the signed time in s from the clock of a block to the edge of a panel.

    The result is 0 if the edge is farther away than rounding, if the path is periodic, or if `pair` is not at a driven
    wall.
    """
    if pair.wall <= 0:
        return 0.0
    t, tail = caller_time(walls, block.t, block.tail)
    return float(time_to_edge(walls.wall[pair.wall - 1], walls.panels, t, tail))


@kernel
def rate_jump(walls: Any, pair: Any, t: float, tail: float) -> tuple[float, float]:
    """Return the jump in m/s of the rate of a pair at an edge of its wall's path.

    The second number is the same jump between the two panels as stored, with their rounding errors. Both are 0 if t +
    tail is not at an edge.
    """
    wall = walls.wall[pair.wall - 1]
    high, low = caller_time(walls, t, tail)
    return edge_jump(wall, walls.panels, high, low)

