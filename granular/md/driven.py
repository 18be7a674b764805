"""Walls that move along a path under a fixed time step, and the account of the energy beside walls that move.
May be skipped: rarer, walls that move.

In a step a wall drifts by the difference of two places on its path, and forces see the velocity of the path: nothing is
integrated, so each integrator keeps its order. Time is counted in steps from the start, in two floats.

Work of a wall, ∫ F x_w' dt, and what a pair dissipates, ∫ (F - F_el) ξ̇ dt with the elastic part F_el = F(ξ, ξ̇ = 0), are
summed step by step by Simpson's rule, whose middle is on the cubic through both ends.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular._records import packed, plain
from granular.md.contact_force import asked as force
from granular.scene import Scene
from granular.scene.walls import driven_walls
from granular.walls.gap import after
from granular.walls.hits import first_hit
from granular.walls.panels import PANEL, WALL
from granular.walls.path import moved, product, total

HALF, WHOLE, LAST, START, MIDDLE, END = range(6)
"""Of a wall in a step: its mean velocity in the first half, in all of it, and the one that makes the sum of
Runge-Kutta's rates that of all of it; its velocity at the start, in the middle, at the end."""

Walls = namedtuple("Walls", "paths panels bodies last time tail drive")
"""Records of the driven walls and of their panels, and the bodies they are; the last body; the time in s from which
steps are counted, in two floats; velocities of both ends in the step, (2, 6)."""


def walls_of(scene: Scene, start: float) -> Walls:
    """Return what kernels read of the walls of a scene that moves from `start` (s) on; plain objects and lists."""
    driven = driven_walls(scene, start)
    bodies = [body for body, _, _ in driven]
    paths, panels = ([record for each in driven for record in plain(each[i])] for i in (1, 2))
    drive = [[float(scene.velocity[body])] * 6 if scene.is_wall[body] else [0.0] * 6 for body in (0, scene.n - 1)]
    return Walls(paths, panels, bodies, scene.n - 1, start, 0.0, drive)


def packed_walls(walls: Walls) -> Walls:
    """Return the same for compiled code."""
    return walls._replace(paths=packed(walls.paths, WALL), panels=packed(walls.panels, PANEL),
                          bodies=np.array(walls.bodies, np.int64), drive=np.array(walls.drive))


@kernel
def clock(walls: Any, k: float, dt: float) -> tuple[float, float]:
    """Return the time in s, in two floats, k steps of `dt` after that from which steps are counted."""
    p, low = product(k, dt)
    t, rest = total(walls.time, p)
    return t, rest + (low + walls.tail)


@kernel
def ahead(physics: Any, k: int) -> None:
    """Note how driven walls move in step k."""
    walls, dt = physics.walls, physics.dt
    for i in range(len(walls.bodies)):
        wall, row = walls.paths[i], walls.drive[0 if walls.bodies[i] == 0 else 1]
        x0, v0, _ = on_path(walls, i, k + 0.0, dt)
        x1, v1, _ = on_path(walls, i, k + 0.5, dt)
        x2, v2, _ = on_path(walls, i, k + 1.0, dt)
        row[HALF] = wall.velocity + wall.side * ((x1 - x0) / (0.5 * dt))
        row[WHOLE] = wall.velocity + wall.side * ((x2 - x0) / dt)
        row[LAST] = 4.0 * row[WHOLE] - 3.0 * row[HALF]
        row[START], row[MIDDLE] = wall.velocity + wall.side * v0, wall.velocity + wall.side * v1
        row[END] = wall.velocity + wall.side * v2


@kernel
def on_path(walls: Any, i: int, k: float, dt: float) -> tuple[float, float, float]:
    """Return the motion of the i-th driven wall towards the balls, its rate and acceleration, at k steps."""
    t, tail = clock(walls, k, dt)
    return moved(walls.paths[i], walls.panels, t, tail)


@kernel
def steer(physics: Any, lo: int, m: int, drift: int, speed: int, a: Any) -> None:
    """Give driven walls in a window their drift in a step or stage, and the velocity that forces see at its end."""
    walls = physics.walls
    for i in range(len(walls.bodies)):
        place, row = walls.bodies[i] - lo, walls.drive[0 if walls.bodies[i] == 0 else 1]
        if 0 <= place <= m:
            a.half[place + 1], a.guess[place + 1] = row[drift], row[speed]


@kernel
def arrive(physics: Any, lo: int, m: int, speed: int, a: Any) -> None:
    """Give driven walls in a window a velocity, at the end of a step that of their path."""
    walls = physics.walls
    for i in range(len(walls.bodies)):
        place, row = walls.bodies[i] - lo, walls.drive[0 if walls.bodies[i] == 0 else 1]
        if 0 <= place <= m:
            a.was_v[place + 1], a.v[place + 1] = row[START], row[speed]


@kernel
def book(physics: Any, lo: int, m: int, a: Any) -> None:
    """Add to the account of a window of `m` pairs what a step has done."""
    dt, elastic = physics.dt, 0.0 if physics.memory else 1.0
    for j in range(m):
        f0, f, f1, x, u0, u, u1 = pushes(physics, lo, j, a)
        f0 -= elastic * force(physics, lo, j, a.was_xi[j + 1], 0.0, a)
        f -= elastic * force(physics, lo, j, x, 0.0, a)
        f1 -= elastic * force(physics, lo, j, a.xi[j + 1], 0.0, a)
        a.lost[j + 1], low = total(a.lost[j + 1], (f0 * u0 + 4.0 * f * u + f1 * u1) * (dt / 6.0))
        a.lost_low[j + 1] += low
    for end in range(2):
        place, row = (0, 0) if end == 0 else (m - 1, m)
        if lo + row == end * physics.walls.last:
            f0, f, f1, _, _, _, _ = pushes(physics, lo, place, a)
            wall, sixth = physics.walls.drive[end], (1.0 - 2.0 * end) * dt / 6.0
            done = (f0 * wall[START] + 4.0 * f * wall[MIDDLE] + f1 * wall[END]) * sixth
            a.work[row + 1], low = total(a.work[row + 1], done)
            a.work_low[row + 1] += low


@kernel
def pushes(physics: Any, lo: int, j: int, a: Any) -> tuple[float, float, float, float, float, float, float]:
    """Return the forces of pair j at the start, in the middle and at the end of a step, the overlap in its middle, and
    the rates at the start, in the middle and at the end."""
    dt, x0, x1 = physics.dt, a.was_xi[j + 1], a.xi[j + 1]
    u0, u1 = a.was_v[j + 1] - a.was_v[j + 2], a.v[j + 1] - a.v[j + 2]
    x, u = 0.5 * (x0 + x1) + 0.125 * dt * (u0 - u1), 1.5 * (x1 - x0) / dt - 0.25 * (u0 + u1)
    raw = force(physics, lo, j, x, u, a)
    f0, f1 = a.was_raw[j + 1] if a.was_raw[j + 1] > 0.0 else 0.0, a.raw[j + 1] if a.raw[j + 1] > 0.0 else 0.0
    return f0, raw if raw > 0.0 else 0.0, f1, x, u0, u, u1


def next_touch(walls: Walls, t: float, tail: float, x: Any, pull: Any, within: float) -> float:
    """Return the time in s until the first gap beside a driven wall closes, from the time t + tail; inf if none does.

    `x` are rows of overlaps and velocities, see `window`. A ball that touches at rest is at its touch.
    """
    first = np.inf
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = beside(x, body)
        if gap == 0.0 and rate == 0.0:
            return 0.0
        first = min(first, first_hit(wall, walls.panels, t, tail, gap, rate, float(pull[c]), within))
    return float(first)


def beside(x: Any, body: int) -> tuple[float, float, int]:
    """Return the gap in m beside a wall, its rate in m/s, and the number of its pair."""
    xi, _, v = x[:3]
    c = body if body == 0 else body - 1
    return max(0.0, -float(xi[c + 1])), float(v[c + 2] - v[c + 1]), c


def flown(walls: Walls, t: float, tail: float, x: Any, pull: Any, dt: float) -> list[tuple[int, float, float]]:
    """Return of every driven wall its body, the gap beside it in m and its velocity in m/s a time `dt` later."""
    out = []
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = beside(x, body)
        later = after(wall, walls.panels, t, tail, gap, rate, float(pull[c]), dt)[0]
        end, rest = total(t, dt)
        out.append((body, later, wall.velocity + wall.side * moved(wall, walls.panels, end, rest + tail)[1]))
    return out
