"""Driven walls as a run holds them: the flight of the pair at one, and its motion as one more series in pieces.

A pair at a driven wall closes with pull + m'', m the wall's motion towards the balls. In flight it follows the wall's
own path, of which the next touch is certified (`granular.scene.walls.hits`).
In an island the power series of m'' is added to that of the acceleration of its overlap; a piece ends at the latest
where the panel of the path does, an EDGE, at which the velocity of the wall may jump. Every path is read at the time
start + t + tail, with t + tail the run's own clock, so late starts cost no digits.

`pair.wall` is the number of the wall from 1 on, 0 of every other pair. Scenes without driven walls are run by kernels
in which DRIVEN is false, so that nothing of this is asked, nor compiled.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine.check import Array
from granular._engine.flight import gap_after, hung, hung_after, hung_rate_at_contact, rate_at_contact
from granular._engine.kernels import DRIVEN, HUNG, kernel
from granular._engine.records import packed, plain
from granular.md.located.records import ORDER
from granular.scene.places import driven_walls
from granular.scene.walls import path
from granular.scene.walls.gap import after
from granular.scene.walls.hits import first_hit, pressing_bounds
from granular.scene.walls.path import PANEL, TERMS, WALL, edge_jump, expansion, to_edge, total, wall_at

if TYPE_CHECKING:
    from granular.scene import Scene

Walls = namedtuple("Walls", "start wall panels path push")
"""Time in s at which the run's own clock is 0; records `WALL` of the driven walls and `PANEL` of all their panels; for
each wall scratch: the power series of side·m in m in the time, and that of its acceleration in τ."""
Hung = namedtuple("Hung", "omega square")
"""Ω in 1/s of pendula, and Ω²: what flights need to know of them, as of walls."""
GROWS = 4.0
"""A piece is so short that the terms of a wall's acceleration add up to no more than so many times its bound."""


def walls_of(scene: Scene, start: float, terms: int) -> Walls | None:
    """Return the driven walls of a scene whose instant is the time `start` in s, for series of so many `terms`; None if
    none of them ever moves."""
    driven = driven_walls(scene, start, still=False)
    if not driven:
        return None
    _, walls, panels = zip(*driven, strict=True)
    scratch = np.zeros((len(walls), TERMS)), np.zeros((len(walls), terms))
    return Walls(start, np.concatenate(walls), np.concatenate(panels), *scratch)


def numbers_at_ends(walls: Walls) -> tuple[int, int]:
    """Return the numbers from 1 on of the driven walls at the two ends of a scene, 0 without."""
    sides = [float(wall["side"]) for wall in walls.wall]
    return (1 if sides[0] > 0.0 else 0), (len(sides) if sides[-1] < 0.0 else 0)


def with_walls(walls: Walls, velocity: Array) -> Array:
    """Return the velocities (n,) in m/s of a scene's bodies with those of its driven walls at the start."""
    velocity = np.array(velocity)
    wall, panels = plain(walls.wall), plain(walls.panels)
    for one in wall:
        velocity[0 if one.side > 0.0 else -1] = path.wall_at(one, panels, walls.start, 0.0)[1]
    return velocity


def plain_walls(walls: Any) -> Any:
    """Return driven walls for interpreted code."""
    if not isinstance(walls, Walls) or isinstance(walls.wall, list):
        return walls
    return Walls(walls.start, plain(walls.wall), plain(walls.panels), walls.path.tolist(), walls.push.tolist())


def compiled_walls(walls: Any) -> Any:
    """Return driven walls for compiled code."""
    if not isinstance(walls, Walls):
        return walls
    scratch = np.array(walls.path), np.array(walls.push)
    return Walls(walls.start, packed(walls.wall, WALL), packed(walls.panels, PANEL), *scratch)


@kernel
def absolute(walls: Any, t: float, tail: float) -> tuple[float, float]:
    """Return the caller's time in two floats from that of the run's own clock."""
    high, low = total(walls.start, t)
    return high, low + tail


@kernel
def flown(field: Any, pair: Any, dt: float) -> tuple[float, float]:
    """Return overlap and rate of a free pair a time `dt` after its clock; before it, those of its asymptote."""
    if DRIVEN and pair.wall > 0:
        return flight_at_wall(field, pair, 0.0, -pair.xi, -pair.eta, dt)
    if HUNG:
        gap, rate = hung_after(-pair.xi, -pair.eta, field.omega, rest_gap(field, pair), dt)
        return -gap, -rate
    return -gap_after(-pair.xi, -pair.eta, pair.pull, dt), pair.eta + pair.pull * dt


@kernel
def rest_gap(field: Any, pair: Any) -> float:
    """Return how far apart the balls of a pair of pendula hang at rest."""
    return float(-pair.pull / field.square)


@kernel
def rate_at(field: Any, pair: Any, t: float) -> float:
    """Return the rate of the overlap of a free pair at time t."""
    if HUNG or (DRIVEN and pair.wall > 0):
        return float(flown(field, pair, (t - pair.t) - pair.tail)[1])
    return float(pair.eta + pair.pull * (t - pair.t))


@kernel
def flight_at_wall(walls: Any, pair: Any, ahead: float, gap: float, rate: float, dt: float) -> tuple[float, float]:
    """Return overlap and rate, after a flight of `dt`, of a pair at a driven wall that had a gap and its rate a time
    `ahead` after its clock."""
    t, tail = absolute(walls, pair.t, pair.tail + ahead)
    gap, rate = after(walls.wall[pair.wall - 1], walls.panels, t, tail, gap, rate, pair.pull, dt)
    return -gap, -rate


@kernel
def touching_rate(field: Any, pair: Any, wait: float) -> float:
    """Return the rate of the overlap of an open pair that touches a time `wait` after its clock."""
    if DRIVEN and pair.wall > 0:
        return flown(field, pair, wait)[1]
    if HUNG:
        return -hung_rate_at_contact(max(0.0, -pair.xi), -pair.eta, field.omega, rest_gap(field, pair))
    return -rate_at_contact(max(0.0, -pair.xi), -pair.eta, pair.pull)


@kernel
def next_touch(field: Any, pair: Any) -> float:
    """Return the time after its clock at which an open pair at a driven wall, or of pendula, touches; inf if it never
    does."""
    if HUNG:
        return hung(max(0.0, -pair.xi), -pair.eta, field.omega, rest_gap(field, pair))
    t, tail = absolute(field, pair.t, pair.tail)
    gap = max(0.0, -pair.xi)
    return first_hit(field.wall[pair.wall - 1], field.panels, t, tail, gap, -pair.eta, pair.pull, math.inf)


@kernel
def convexity(field: Any, pair: Any, ahead: float, span: float) -> float:
    """Return the largest acceleration at which the gap of a pair in flight opens, within `span` from `ahead` after its
    clock on; 0 if it is concave."""
    if DRIVEN and pair.wall > 0:
        t, tail = absolute(field, pair.t, pair.tail + ahead)
        least, _ = pressing_bounds(field.wall[pair.wall - 1], field.panels, t, tail, pair.pull, span)
        return max(0.0, -least)
    return float(max(0.0, -pair.pull))


@kernel
def carry_walls(walls: Any, s: Any) -> None:
    """Let driven walls have the velocities, and islands at them the pull, of the time of the event under way."""
    run = s.run[0]
    for i in range(len(walls.wall)):
        c, b = (0, 0) if walls.wall[i].side > 0.0 else (len(s.pairs) - 1, len(s.bodies) - 1)
        s.bodies[b].v, push = velocity_of_wall(walls, i, run.t, run.tail)
        s.bodies[b].t, s.bodies[b].tail = run.t, run.tail
        if s.pairs[c].slot >= 0:
            s.pool[s.pairs[c].slot].pull = s.pairs[c].pull + push


@kernel
def gap_later(field: Any, pair: Any, ahead: float, gap: float, rate: float, dt: float) -> float:
    """Return the gap after a flight of `dt` from a gap and its rate a time `ahead` after the clock of a pair."""
    if DRIVEN and pair.wall > 0:
        return -flight_at_wall(field, pair, ahead, gap, rate, dt)[0]
    if HUNG:
        return hung_after(gap, rate, field.omega, rest_gap(field, pair), dt)[0]
    return gap_after(gap, rate, pair.pull, dt)


@kernel
def rate_later(field: Any, pair: Any, gap: float, eta: float, dt: float) -> float:
    """Return the rate of a pair's overlap, now `eta` at its clock, after a flight of `dt` to some `gap`."""
    if HUNG and dt > 0.0:
        cosine, sine = math.cos(field.omega * dt), math.sin(field.omega * dt)
        off = (gap - rest_gap(field, pair) + eta / field.omega * sine) / cosine  # from the gap at rest, now
        return float(eta * cosine + field.omega * off * sine)
    if DRIVEN and pair.wall > 0 and dt > 0.0:
        return flight_at_wall(field, pair, 0.0, 0.0, -eta, dt)[1]
    return float(pair.pull * dt + eta)


@kernel
def speed_at(walls: Any, pair: Any, body: Any, block: Any) -> float:
    """Return the velocity of a wall, `body`, at the clock of a block, `pair` being the pair at it."""
    if DRIVEN and pair.wall > 0:
        return velocity_of_wall(walls, pair.wall - 1, block.t, block.tail)[0]
    return float(body.v)


@kernel
def velocity_of_wall(walls: Any, i: int, t: float, tail: float) -> tuple[float, float]:
    """Return the velocity of a driven wall, and its acceleration towards the balls."""
    high, low = absolute(walls, t, tail)
    _, v, a = wall_at(walls.wall[i], walls.panels, high, low)
    return v, walls.wall[i].side * a


@kernel
def foresee_walls(walls: Any, pairs: Any, pool: Any, lo: int) -> float:
    """Expand the paths of the driven walls of the island that starts with `lo` about its clock; return the time for
    which a piece may go on, inf without walls. `holds` of the block is that to the next panel."""
    reach = math.inf
    hi, block = pairs[lo].hi, pool[pairs[lo].slot]
    block.holds = math.inf
    for c in range(lo, hi):
        if pairs[c].wall > 0:
            holds = expand_path(walls, pairs[c].wall - 1, block)
            wall, path = walls.wall[pairs[c].wall - 1], walls.path[pairs[c].wall - 1]
            member, bound = pool[pairs[c].slot], wall.stiff + abs(pairs[c].pull)
            member.pull, member.sway = pairs[c].pull + 2.0 * path[2], bound
            block.holds = min(block.holds, holds)
            reach = min(reach, tame(path, holds, bound))
    return reach


@kernel
def expand_path(walls: Any, i: int, block: Any) -> float:
    """Expand the path of driven wall `i` about the clock of a block, unless it is; return for how long it holds."""
    wall = walls.wall[i]
    if not (wall.about == block.t and wall.about_tail == block.tail):
        t, tail = absolute(walls, block.t, block.tail)
        wall.holds = expansion(wall, walls.panels, t, tail, walls.path[i])
        wall.about, wall.about_tail = block.t, block.tail
    return wall.holds  # type: ignore[no-any-return]


@kernel
def tame(path: Any, reach: float, bound: float) -> float:
    """Return a time up to `reach` within which no term of a wall's acceleration is large beside its bound."""
    if not reach < math.inf:
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
        if not size > GROWS * bound:
            return reach
        reach *= 0.5


@kernel
def drive(walls: Any, pairs: Any, lo: int, hi: int, h: float, q: int) -> None:
    """Write the accelerations of driven walls, but for their first terms, as power series in τ, t = (hτ)^q."""
    for c in range(lo, hi):
        if pairs[c].wall > 0:
            path, push, scale, per = walls.path[pairs[c].wall - 1], walls.push[pairs[c].wall - 1], 1.0, h
            for _ in range(1, q):
                per *= h
            for n in range(ORDER + 1):
                push[n] = 0.0
            j = 1
            while j * q <= ORDER and j + 2 < len(path):
                scale *= per
                push[j * q] = (j + 1) * (j + 2) * path[j + 2] * scale
                j += 1


@kernel
def beside_edge(walls: Any, pair: Any, block: Any) -> float:
    """Return the time from the clock of a block, brought to an EDGE in one float, to where that is; 0 if `pair` is at
    no driven wall."""
    if pair.wall <= 0:
        return 0.0
    t, tail = absolute(walls, block.t, block.tail)
    return float(to_edge(walls.wall[pair.wall - 1], walls.panels, t, tail))


@kernel
def jump_at(walls: Any, pair: Any, t: float, tail: float) -> tuple[float, float]:
    """Return by how much the rate of a pair's overlap jumps at an edge of its wall's path, if that is now, and then
    with the rounding of the path."""
    wall = walls.wall[pair.wall - 1]
    high, low = absolute(walls, t, tail)
    return edge_jump(wall, walls.panels, high, low)

