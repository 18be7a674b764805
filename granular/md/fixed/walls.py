"""Driven and thermal walls under a fixed time step, with their energy account.

In a step a driven wall moves by the difference of two positions on its path, and forces see the velocity of the path.
Nothing is integrated, so each integrator keeps its order. Time is counted in steps from the start, in two floats.

The work of a wall is ∫ F x_w' dt. The energy dissipated by a pair is ∫ (F - F_el) ξ̇ dt, with the elastic part F_el =
F(ξ, ξ̇ = 0). Both are summed per step by Simpson's rule, with the midpoint on the cubic through both ends.

A ball that would hit a thermal wall within a step does so on the parabola of its current velocity and acceleration. At
the root the wall gives it a new speed. The step then starts on the new parabola, traced back to the start of the step.
A hit therefore has no step error if nothing else touches the ball. Beside a contact it has order 2, and order 1 where a
damped force jumps with the velocity. Several hits in a step are processed in the order of their times.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.flight import rate_at_contact, time_to_contact
from granular._engine.kernels import kernel
from granular._engine.records import packed, plain
from granular.md.fixed.contact_force import object_force as force
from granular.md.fixed.integrators import ball_acceleration
from granular.md.fixed.window import END, HALF, LAST, MIDDLE, START, WHOLE
from granular.scene import Scene
from granular.scene.places import driven_walls
from granular.scene.walls.gap import after
from granular.scene.walls.hits import first_hit
from granular.scene.walls.path import PANEL_DTYPE, WALL_DTYPE, moved, product, total
from granular.scene.walls.thermal import drawn

Walls = namedtuple("Walls", "paths panels bodies last time tail drive")
"""Walls as kernels read them.

Records of the driven walls and of their panels, the bodies that they are, and the last body. Time in s from which steps
are counted, in two floats. Velocities of both ends in the step, (2, 6)."""
HIT, HALT, CROWD = 4, 8, 16
"""Flags of a step with thermal walls.

A ball has left a thermal wall. The hit to stop at would occur. There are more than `MAX_HITS_PER_STEP` hits in the
step."""
MAX_HITS_PER_STEP = 64
"""Largest number of hits per step."""
HEATER_RECORD = np.dtype(
    [("pair", int), ("side", int), ("temperature", float), ("seed", int), ("mass", float)], align=True
)
"""A thermal wall.

Its pair, side (0: floor, 1: ceiling), k_B T in J, seed, and mass in kg of its ball."""


def walls_of(scene: Scene, start: float) -> Walls:
    """Return the walls of a scene as plain objects and lists.

    `start` is the time in s at which the scene starts.
    """
    driven = driven_walls(scene, start)
    bodies = [body for body, _, _ in driven]
    paths, panels = ([record for each in driven for record in plain(each[i])] for i in (1, 2))
    drive = [[float(scene.velocity[body])] * 6 if scene.is_wall[body] else [0.0] * 6 for body in (0, scene.n - 1)]
    return Walls(paths, panels, bodies, scene.n - 1, start, 0.0, drive)


def packed_walls(walls: Walls) -> Walls:
    """Return the walls for compiled code."""
    return walls._replace(paths=packed(walls.paths, WALL_DTYPE), panels=packed(walls.panels, PANEL_DTYPE),
                          bodies=np.array(walls.bodies, np.int64), drive=np.array(walls.drive))


@kernel
def clock(walls: Any, k: float, dt: float) -> tuple[float, float]:
    """Return the time in s, in two floats, after k steps of `dt`."""
    p, low = product(k, dt)
    t, rest = total(walls.time, p)
    return t, rest + (low + walls.tail)


@kernel
def compute_wall_motion(physics: Any, k: int) -> None:
    """Compute the motion of driven walls in step k."""
    walls, dt = physics.walls, physics.dt
    for i in range(len(walls.bodies)):
        wall, row = walls.paths[i], walls.drive[0 if walls.bodies[i] == 0 else 1]
        x0, v0, _ = on_path(walls, i, k + 0.0, dt)
        x1, v1, _ = on_path(walls, i, k + 0.5, dt)
        x2, v2, _ = on_path(walls, i, k + 1.0, dt)
        row[HALF] = wall.velocity + wall.side * ((x1 - x0) / (0.5 * dt))
        row[WHOLE] = wall.velocity + wall.side * ((x2 - x0) / dt)
        # Runge-Kutta sums (1 + 2) HALF + 2 WHOLE + LAST, which has to be 6 WHOLE
        row[LAST] = 4.0 * row[WHOLE] - 3.0 * row[HALF]
        row[START], row[MIDDLE] = wall.velocity + wall.side * v0, wall.velocity + wall.side * v1
        row[END] = wall.velocity + wall.side * v2


@kernel
def on_path(walls: Any, i: int, k: float, dt: float) -> tuple[float, float, float]:
    """Return the motion of the i-th driven wall towards the balls after k steps.

    Position, rate and acceleration are returned.
    """
    t, tail = clock(walls, k, dt)
    return moved(walls.paths[i], walls.panels, t, tail)


@kernel
def book(physics: Any, lo: int, m: int, a: Any) -> None:
    """Add dissipated energy to `lost` of each pair, and work to `work` of each end.

    These are ∫ (F − F_el) ξ̇ dt and ∫ F x_w′ dt, by Simpson's rule. Under laws with memory, F_el is unknown. ∫ F ξ̇ dt
    is then added to `lost`, which is reported as nan while they exert a force.
    """
    dt, has_elastic_part = physics.dt, 0.0 if physics.memory else 1.0
    for j in range(m):
        f0, f_mid, f1, x, u0, u_mid, u1 = pushes(physics, lo, j, a)
        f0 -= has_elastic_part * force(physics, lo, j, a.was_xi[j + 1], 0.0, a)
        f_mid -= has_elastic_part * force(physics, lo, j, x, 0.0, a)
        f1 -= has_elastic_part * force(physics, lo, j, a.xi[j + 1], 0.0, a)
        a.lost[j + 1], low = total(a.lost[j + 1], (f0 * u0 + 4.0 * f_mid * u_mid + f1 * u1) * (dt / 6.0))
        a.lost_low[j + 1] += low
    for end in range(2):
        place, row = (0, 0) if end == 0 else (m - 1, m)
        if lo + row == end * physics.walls.last:  # the window contains this end
            f0, f_mid, f1, _, _, _, _ = pushes(physics, lo, place, a)
            wall, sixth = physics.walls.drive[end], (1.0 - 2.0 * end) * dt / 6.0
            done = (f0 * wall[START] + 4.0 * f_mid * wall[MIDDLE] + f1 * wall[END]) * sixth
            a.work[row + 1], low = total(a.work[row + 1], done)
            a.work_low[row + 1] += low


@kernel
def pushes(physics: Any, lo: int, j: int, a: Any) -> tuple[float, float, float, float, float, float, float]:
    """Return forces, middle overlap and rates of pair j in a step.

    The forces and the rates are given at the start, in the middle and at the end of the step.
    """
    dt, x0, x1 = physics.dt, a.was_xi[j + 1], a.xi[j + 1]
    u0, u1 = a.was_v[j + 1] - a.was_v[j + 2], a.v[j + 1] - a.v[j + 2]
    # value and slope of the cubic Hermite polynomial in the middle of the step
    x, u = 0.5 * (x0 + x1) + 0.125 * dt * (u0 - u1), 1.5 * (x1 - x0) / dt - 0.25 * (u0 + u1)
    raw = force(physics, lo, j, x, u, a)
    f0, f1 = a.was_raw[j + 1] if a.was_raw[j + 1] > 0.0 else 0.0, a.raw[j + 1] if a.raw[j + 1] > 0.0 else 0.0
    return f0, raw if raw > 0.0 else 0.0, f1, x, u0, u, u1


def next_touch(walls: Walls, t: float, tail: float, x: Any, pull: Any, within: float) -> float:
    """Return the time in s until the first gap at a driven wall closes, or inf.

    Time starts at t + tail. `x` are rows of overlaps and velocities, see `window`. A ball that touches at rest touches
    immediately.
    """
    first = np.inf
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = beside(x, body)
        if gap == 0.0 and rate == 0.0:
            return 0.0
        first = min(first, first_hit(wall, walls.panels, t, tail, gap, rate, float(pull[c]), within))
    return float(first)


def beside(x: Any, body: int) -> tuple[float, float, int]:
    """Return the gap in m at a wall, its rate in m/s, and the number of its pair."""
    xi, _, v = x[:3]
    c = body if body == 0 else body - 1
    return max(0.0, -float(xi[c + 1])), float(v[c + 2] - v[c + 1]), c


def flown(walls: Walls, t: float, tail: float, x: Any, pull: Any, dt: float) -> list[tuple[int, float, float]]:
    """Return body, gap in m and velocity in m/s of each driven wall after a time `dt`."""
    out = []
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = beside(x, body)
        later = after(wall, walls.panels, t, tail, gap, rate, float(pull[c]), dt)[0]
        end, rest = total(t, dt)
        out.append((body, later, wall.velocity + wall.side * moved(wall, walls.panels, end, rest + tail)[1]))
    return out


def heaters(scene: Scene) -> list[Any]:
    """Return the thermal walls of a scene as plain objects."""
    rows = [(side * (scene.n_pairs - 1), side, heat.temperature, heat.seed, scene.mass[-2 if side else 1])
            for side, heat in enumerate(scene.heat) if heat is not None]
    return plain(np.array(rows, HEATER_RECORD))


@kernel
def heat(physics: Any, lo: int, m: int, first: int, stop: int, k: int, work: Any) -> int:
    """Process the hits of thermal walls in step `k` of a window, and return flags.

    The window has `m` pairs. Hits are logged for the pairs from `first` to before `stop`.
    """
    a, s, hits, flags = work.window, 0.0, 0, 0
    while True:
        best, at = -1, physics.dt
        for i in range(len(physics.heat)):
            j = physics.heat[i].pair - lo
            if 0 <= j < m:
                gap, rate, pull = _flight(physics.heat[i].side, j, s, a)
                pressed = gap == 0.0 and rate == 0.0 and pull > 0.0  # at rest on the wall: it hits immediately
                t = s + (0.0 if pressed else time_to_contact(gap, rate, pull))
                # a hit exactly at the end of the step belongs to this step
                if t < at or (best < 0 and t == at):
                    best, at = i, t
        if best < 0:
            return flags
        wall = physics.heat[best]
        if wall.pair == work.pair and a.count[wall.pair - lo + 1] + 1.0 == work.nth:
            a.part[wall.pair - lo + 1] = at / physics.dt
            return flags | HALT
        if hits == MAX_HITS_PER_STEP:
            return flags | CROWD
        gap, rate, pull = _flight(wall.side, wall.pair - lo, s, a)
        was = -rate_at_contact(gap, rate, pull)
        speed = drawn(wall.temperature, wall.seed, wall.side, int(a.count[wall.pair - lo + 1]), wall.mass)
        if first <= wall.pair < stop:
            if physics.logged:
                _note(work.log[work.ended[0]], wall, lo, was, speed, k, at / physics.dt, a)
            work.ended[0] += 1
        _leave(wall, wall.pair - lo, m, at, was, speed, pull, a)
        s, hits, flags = at, hits + 1, HIT


@kernel
def _flight(side: int, j: int, s: float, a: Any) -> tuple[float, float, float]:
    """Return a thermal wall's gap, its rate and closing acceleration, `s` into a step."""
    i = j + 1 if side == 0 else j
    acc = ball_acceleration(i, a.raw[i], a.raw[i + 1], a)
    gap, rate, pull = -a.xi[j + 1], a.v[j + 2] - a.v[j + 1], -acc if side == 0 else acc
    gap += s * (rate - 0.5 * pull * s)
    return gap if gap > 0.0 else 0.0, rate - pull * s, pull


@kernel
def _leave(wall: Any, j: int, m: int, at: float, was: float, speed: float, pull: float, a: Any) -> None:
    """Put a ball that hits a thermal wall onto its new parabola, and book the energy.

    The hit occurs `at` seconds into the step. The parabola is traced back to the start of the step.
    """
    ball, body, beside = (j + 2, j + 1, j + 2) if wall.side == 0 else (j + 1, j + 2, j)
    away, impulse, gap = 1.0 - 2.0 * wall.side, wall.mass * (speed + was), -at * (speed + 0.5 * pull * at)
    a.work[body], low = total(a.work[body], away * impulse * a.v[body])
    a.work_low[body] += low
    a.heat[body], low = total(a.heat[body], 0.5 * impulse * (speed - was))
    a.heat_low[body] += low
    a.count[j + 1] += 1.0
    if 1 <= beside <= m:
        a.xi[beside] += gap + a.xi[j + 1]
    a.xi[j + 1], a.v[ball] = -gap, a.v[body] + away * (speed + pull * at)


@kernel
def _note(row: Any, wall: Any, lo: int, was: float, speed: float, k: int, part: float, a: Any) -> None:
    """Log a hit as a contact of zero duration.

    `was` is the speed of the incoming ball, `speed` the new one.
    """
    v = a.v[wall.pair - lo + 1 + wall.side]
    row.pair, row.step_in, row.part_in, row.step_out, row.part_out = wall.pair, k, part, k, part
    row.lower_in, row.lower_out, row.upper_in, row.upper_out = v, v, v, v
    if wall.side == 0:
        row.upper_in, row.upper_out = v - was, v + speed
    else:
        row.lower_in, row.lower_out = v + was, v - speed
    row.xi_max, row.force_max, row.impulse = 0.0, math.nan, wall.mass * (speed + was)
