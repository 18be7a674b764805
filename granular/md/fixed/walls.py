"""Driven and thermal walls under a fixed time step, with their energy account.

In a step a driven wall moves by the difference of two positions on its path. Contact forces depend on the velocity of
the path. The path is not integrated, so each integrator keeps its order. Times are sums of two floats, computed from
the step number.

The work of a wall is ∫ F x_w' dt. The energy dissipated by a pair is ∫ (F - F_el) ξ̇ dt, with the elastic part F_el =
F(ξ, ξ̇ = 0). Each integral is summed per step by Simpson's rule. The midpoint is taken from the cubic through the
states at both ends of the step.

Hits of thermal walls are found before each step. The ball moves on the parabola given by its current velocity and
acceleration. At the time of the hit the wall gives it a new speed, and thus a new parabola. The new parabola is traced
back to the start of the step, and the step starts there. A hit therefore has no step error if nothing else touches the
ball. During another contact of the ball it has order 2, and order 1 if a damped force jumps with the velocity. Several
hits in a step are processed in the order of their times.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._engine.flight import rate_at_contact, time_to_contact
from granular._engine.kernels import kernel
from granular._engine.records import plain, record_array
from granular.md.fixed.contact_force import object_force as force
from granular.md.fixed.integrators import ball_acceleration
from granular.md.fixed.window import END, HALF, LAST, MIDDLE, START, WHOLE
from granular.scene import Scene
from granular.scene.places import driven_walls
from granular.scene.walls.gap import gap_at_time
from granular.scene.walls.hits import first_hit
from granular.scene.walls.path import PANEL_DTYPE, WALL_DTYPE, exact_product, exact_sum, moved
from granular.scene.walls.thermal import drawn

Walls = namedtuple("Walls", "paths panels bodies last time tail drive")
"""Driven walls, as the kernels read them.

* `paths`, `panels`: records of the walls and of the panels of their paths, see `granular.scene.walls.path`.
* `bodies`, `last`: body numbers of the walls, and number of the last body of the scene.
* `time`, `tail`: time in s of step 0, as a sum of two floats.
* `drive`: velocities in m/s of both ends of the chain in the current step, shape (2, 6), see `window.HALF`."""
HIT, HALT, CROWD = 4, 8, 16
"""Flags of a step with thermal walls.

`HIT`: a ball was thrown back. `HALT`: the hit to stop at would occur. `CROWD`: the step would have more than
`MAX_HITS_PER_STEP` hits."""
MAX_HITS_PER_STEP = 64
"""Maximum number of hits of thermal walls per step."""
HEATER_RECORD = np.dtype(
    [("pair", int), ("side", int), ("temperature", float), ("seed", int), ("mass", float)], align=True
)
"""Record of a thermal wall.

It contains the number of its pair, its side (0: floor, 1: ceiling), k_B T in J, the seed of its random speeds, and the
mass in kg of the ball next to it."""


def driven_wall_data(scene: Scene, start: float) -> Walls:
    """Return the driven walls of a scene for interpreted kernels.

    `start` is the time in s of the initial state.
    """
    driven = driven_walls(scene, start)
    bodies = [body for body, _, _ in driven]
    paths, panels = ([record for wall in driven for record in plain(wall[i])] for i in (1, 2))
    # per end of the chain one velocity for each of HALF … END of `window`; 0 if it is a ball
    drive = [[float(scene.velocity[body])] * 6 if scene.is_wall[body] else [0.0] * 6 for body in (0, scene.n - 1)]
    return Walls(paths, panels, bodies, scene.n - 1, start, 0.0, drive)


def packed_walls(walls: Walls) -> Walls:
    """Return the driven walls converted to arrays, for compiled kernels."""
    return walls._replace(paths=record_array(walls.paths, WALL_DTYPE), panels=record_array(walls.panels, PANEL_DTYPE),
                          bodies=np.array(walls.bodies, np.int64), drive=np.array(walls.drive))


@kernel
def clock(walls: Any, k: float, dt: float) -> tuple[float, float]:
    """Return the time in s after `k` steps of `dt` in s, as a sum of two floats."""
    p, low = exact_product(k, dt)
    t, rest = exact_sum(walls.time, p)
    return t, rest + (low + walls.tail)


@kernel
def compute_wall_motion(physics: Any, k: int) -> None:
    """Store the velocities of driven walls in step `k` in `physics.walls.drive`."""
    walls, dt = physics.walls, physics.dt
    for i in range(len(walls.bodies)):
        wall, row = walls.paths[i], walls.drive[0 if walls.bodies[i] == 0 else 1]
        x0, v0, _ = wall_motion(walls, i, k + 0.0, dt)
        x1, v1, _ = wall_motion(walls, i, k + 0.5, dt)
        x2, v2, _ = wall_motion(walls, i, k + 1.0, dt)
        row[HALF] = wall.velocity + wall.side * ((x1 - x0) / (0.5 * dt))
        row[WHOLE] = wall.velocity + wall.side * ((x2 - x0) / dt)
        # Runge-Kutta sums (1 + 2) HALF + 2 WHOLE + LAST, which has to be 6 WHOLE
        row[LAST] = 4.0 * row[WHOLE] - 3.0 * row[HALF]
        row[START], row[MIDDLE] = wall.velocity + wall.side * v0, wall.velocity + wall.side * v1
        row[END] = wall.velocity + wall.side * v2


@kernel
def wall_motion(walls: Any, i: int, k: float, dt: float) -> tuple[float, float, float]:
    """Return the motion of driven wall number `i` after `k` steps of `dt` in s.

    Displacement in m, velocity in m/s and acceleration in m/s² along its path are returned. They are positive towards
    the balls.
    """
    t, tail = clock(walls, k, dt)
    return moved(walls.paths[i], walls.panels, t, tail)


@kernel
def add_energies(physics: Any, lo: int, m: int, a: Any) -> None:
    """Add the energies of the last step to the account of a window with `m` pairs.

    The energy in J dissipated by each pair, ∫ (F − F_el) ξ̇ dt, is added to `lost`. The work in J of each wall,
    ∫ F x_w′ dt, is added to `work`. The integrals are evaluated by Simpson's rule. For laws with memory, F_el is
    unknown. Then ∫ F ξ̇ dt is added to `lost`, which is correct between contacts.
    """
    dt, has_elastic_part = physics.dt, 0.0 if physics.memory else 1.0
    for j in range(m):
        f0, f_mid, f1, x, u0, u_mid, u1 = forces_in_step(physics, lo, j, a)
        f0 -= has_elastic_part * force(physics, lo, j, a.was_xi[j + 1], 0.0, a)
        f_mid -= has_elastic_part * force(physics, lo, j, x, 0.0, a)
        f1 -= has_elastic_part * force(physics, lo, j, a.xi[j + 1], 0.0, a)
        a.lost[j + 1], low = exact_sum(a.lost[j + 1], (f0 * u0 + 4.0 * f_mid * u_mid + f1 * u1) * (dt / 6.0))
        a.lost_low[j + 1] += low
    for side in range(2):
        j_wall, row = (0, 0) if side == 0 else (m - 1, m)
        if lo + row == side * physics.walls.last:  # the window contains this end
            f0, f_mid, f1, _, _, _, _ = forces_in_step(physics, lo, j_wall, a)
            wall, sixth = physics.walls.drive[side], (1.0 - 2.0 * side) * dt / 6.0
            done = (f0 * wall[START] + 4.0 * f_mid * wall[MIDDLE] + f1 * wall[END]) * sixth
            a.work[row + 1], low = exact_sum(a.work[row + 1], done)
            a.work_low[row + 1] += low


@kernel
def forces_in_step(physics: Any, lo: int, j: int, a: Any) -> tuple[float, float, float, float, float, float, float]:
    """Return force and overlap rate of pair `j` at three times of the last step.

    The times are the start, the middle and the end of the step. The seven results are three clipped forces in N, the
    overlap in m in the middle, and three overlap rates in m/s.
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

    Parameters
    ----------
    t, tail : float
        Current time in s, as a sum of two floats.
    x : state table
        Current state without contacts, see `window`.
    pull : sequence of float
        Closing acceleration of each pair in m/s².
    within : float
        Time in s that is searched at least.

    Notes
    -----
    For a ball that touches its wall at rest, the result is 0.
    """
    first = np.inf
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = state_at_wall(x, body)
        if gap == 0.0 and rate == 0.0:
            return 0.0
        first = min(first, first_hit(wall, walls.panels, t, tail, gap, rate, float(pull[c]), within))
    return float(first)


def state_at_wall(x: Any, body: int) -> tuple[float, float, int]:
    """Return gap in m, gap rate in m/s and pair number at the wall `body`.

    `x` is the state table.
    """
    xi, _, v = x[:3]
    c = body if body == 0 else body - 1
    return max(0.0, -float(xi[c + 1])), float(v[c + 2] - v[c + 1]), c


def walls_after(walls: Walls, t: float, tail: float, x: Any, pull: Any, dt: float) -> list[tuple[int, float, float]]:
    """Return body number, gap in m and velocity in m/s of each driven wall.

    They are evaluated after a free flight of `dt` s from the time t + tail and the state table `x`. `pull` is the
    closing acceleration of each pair in m/s².
    """
    states = []
    for wall, body in zip(walls.paths, walls.bodies, strict=True):
        gap, rate, c = state_at_wall(x, body)
        new_gap = gap_at_time(wall, walls.panels, t, tail, gap, rate, float(pull[c]), dt)[0]
        end, rest = exact_sum(t, dt)
        states.append((body, new_gap, wall.velocity + wall.side * moved(wall, walls.panels, end, rest + tail)[1]))
    return states


def thermal_walls(scene: Scene) -> list[Any]:
    """Return the thermal walls of a scene as objects with fields of `HEATER_RECORD`."""
    rows = [(side * (scene.n_pairs - 1), side, thermal.temperature, thermal.seed, scene.mass[-2 if side else 1])
            for side, thermal in enumerate(scene.thermal_walls) if thermal is not None]
    return plain(np.array(rows, HEATER_RECORD))


@kernel
def process_hits(physics: Any, lo: int, m: int, first: int, stop: int, k: int, work: Any) -> int:
    """Process the hits of thermal walls in step `k` of a window, and return flags.

    The window has `m` pairs from pair `lo` onwards. Hits are counted and logged only if their pair is one of `first` to
    `stop` - 1. The flags are 0, `HIT`, `HALT` or `CROWD`.
    """
    a, s, hits, flags = work.window, 0.0, 0, 0
    while True:
        first_wall, hit_time = -1, physics.dt
        for i in range(len(physics.heat)):
            j = physics.heat[i].pair - lo
            if 0 <= j < m:
                gap, rate, pull = _flight_towards_wall(physics.heat[i].side, j, s, a)
                pressed = gap == 0.0 and rate == 0.0 and pull > 0.0  # at rest on the wall: it hits immediately
                t = s + (0.0 if pressed else time_to_contact(gap, rate, pull))
                # a hit exactly at the end of the step belongs to this step
                if t < hit_time or (first_wall < 0 and t == hit_time):
                    first_wall, hit_time = i, t
        if first_wall < 0:
            return flags
        wall = physics.heat[first_wall]
        if wall.pair == work.pair and a.count[wall.pair - lo + 1] + 1.0 == work.nth:
            a.part[wall.pair - lo + 1] = hit_time / physics.dt
            return flags | HALT
        if hits == MAX_HITS_PER_STEP:
            return flags | CROWD
        gap, rate, pull = _flight_towards_wall(wall.side, wall.pair - lo, s, a)
        speed_in = -rate_at_contact(gap, rate, pull)
        speed_out = drawn(wall.temperature, wall.seed, wall.side, int(a.count[wall.pair - lo + 1]), wall.mass)
        if first <= wall.pair < stop:
            if physics.logged:
                _log_hit(work.log[work.ended[0]], wall, lo, speed_in, speed_out, k, hit_time / physics.dt, a)
            work.ended[0] += 1
        _throw_back(wall, wall.pair - lo, m, hit_time, speed_in, speed_out, pull, a)
        s, hits, flags = hit_time, hits + 1, HIT


@kernel
def _flight_towards_wall(side: int, j: int, s: float, a: Any) -> tuple[float, float, float]:
    """Return gap, gap rate and closing acceleration of pair `j` at a thermal wall.

    They are in m, m/s and m/s², at a time `s` in s after the start of the step. `side` is 0 for a floor, 1 for a
    ceiling.
    """
    # rows of a window (see `window`): pair j at index j + 1, body i at i + 1
    ball = j + 1 if side == 0 else j
    acc = ball_acceleration(ball, a.raw[ball], a.raw[ball + 1], a)
    gap, rate, pull = -a.xi[j + 1], a.v[j + 2] - a.v[j + 1], -acc if side == 0 else acc
    gap += s * (rate - 0.5 * pull * s)
    return gap if gap > 0.0 else 0.0, rate - pull * s, pull


@kernel
def _throw_back(wall: Any, j: int, m: int, time: float, speed_in: float, speed_out: float, pull: float, a: Any) -> None:
    """Throw a ball back from a thermal wall, and add the energy to the account.

    After the hit the ball moves on a new parabola. The parabola is traced back to the start of the step, and its state
    there replaces the state in the window.

    Parameters
    ----------
    j : int
        Index of the pair of the wall.
    time : float
        Time of the hit in s after the start of the step.
    speed_in, speed_out : float
        Speeds of the ball relative to the wall in m/s, before and after the hit.
    pull : float
        Closing acceleration of the pair in m/s².
    """
    ball, body, neighbour = (j + 2, j + 1, j + 2) if wall.side == 0 else (j + 1, j + 2, j)
    sign, impulse, gap = (
        1.0 - 2.0 * wall.side, wall.mass * (speed_out + speed_in), -time * (speed_out + 0.5 * pull * time))
    a.work[body], low = exact_sum(a.work[body], sign * impulse * a.v[body])
    a.work_low[body] += low
    a.heat[body], low = exact_sum(a.heat[body], 0.5 * impulse * (speed_out - speed_in))
    a.heat_low[body] += low
    a.count[j + 1] += 1.0
    if 1 <= neighbour <= m:
        a.xi[neighbour] += gap + a.xi[j + 1]
    a.xi[j + 1], a.v[ball] = -gap, a.v[body] + sign * (speed_out + pull * time)


@kernel
def _log_hit(row: Any, wall: Any, lo: int, speed_in: float, speed_out: float, k: int, part: float, a: Any) -> None:
    """Write a hit of a thermal wall to a log row, as a contact of zero duration.

    `speed_in` and `speed_out` are the speeds of the ball relative to the wall in m/s. The hit occurs at the fraction
    `part` of step `k`.
    """
    v = a.v[wall.pair - lo + 1 + wall.side]
    row.pair, row.step_in, row.part_in, row.step_out, row.part_out = wall.pair, k, part, k, part
    row.lower_in, row.lower_out, row.upper_in, row.upper_out = v, v, v, v
    if wall.side == 0:
        row.upper_in, row.upper_out = v - speed_in, v + speed_out
    else:
        row.lower_in, row.lower_out = v + speed_in, v - speed_out
    row.xi_max, row.force_max, row.impulse = 0.0, math.nan, wall.mass * (speed_out + speed_in)
