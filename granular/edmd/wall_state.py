"""State of driven walls and forces: start, samples, epoch and energy balance.

A ball on a shaken plate can fly for longer than a window (see `granular.edmd.motion`). The event loop therefore moves
the epoch itself, at the same times as `State.shift_to` would.

Work and heat of each wall, and the dissipated energy, are compensated sums. In a collision with the impulse J, a
wall with the velocity ẋ_w does the work J·ẋ_w. While a ball of mass m under a force f rests on a wall at the position
x_w, the work of the wall is the increase of ½mẋ_w² + (mg - f) x_w since the ball came to rest. A ball that moves with
its wall therefore needs no events.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records, column, plain
from granular.edmd.driven import gap_at_wall, update_wall_velocities, wall_displacement
from granular.edmd.epoch import rebase, window_length
from granular.edmd.motion import COLLISION_NOISE, add_compensated, impulse
from granular.edmd.physics import frame_velocity
from granular.edmd.records import BOTH, CEILING, FLOOR, FREE, WALL_FIELDS, Walls
from granular.scene import Scene
from granular.scene.places import driven_walls
from granular.scene.walls.path import PANEL_DTYPE

BALANCE_FIELDS = ("work", "work_low", "lost", "lost_low", "heat", "heat_low", "given", "given_low")
"""Fields of the wall records that form the energy balance and are saved."""
NEXT_BELOW_FACTOR = 1.0 - 2.0**-53
"""Factor that turns a power of two into the next smaller float."""


def walls(scene: Scene, t_start: float) -> tuple[Any, Any]:
    """Return the records `WALL_FIELDS` of floor and ceiling, and their path panels.

    `t_start` is the time in s at the start of the run.
    """
    sides = np.zeros(2, WALL_FIELDS)
    sides["velocity"] = np.where(scene.is_wall, scene.velocity - frame_velocity(scene), 0.0)[[0, -1]]
    driven = driven_walls(scene, t_start)
    for body, record, _ in driven:
        for name in record.dtype.names or ():
            sides[name][0 if body == 0 else 1] = record[name][0]
    for side, heat in zip(sides, scene.thermal_walls, strict=True):
        if heat is not None:
            side["temperature"], side["seed"] = heat.temperature, heat.seed
    sides["begin"] = t_start
    # An empty panel gives kernels the type of the array.
    return sides, np.concatenate([rows for _, _, rows in driven] or [np.zeros(1, PANEL_DTYPE)])


def begin(state: Any, scene: Scene) -> None:
    """Set the fields of a new state that are needed for forces and walls."""
    sides, forces, (pairs, bodies) = state.walls.sides, scene.external_force, (state.pairs, state.bodies)
    bodies["own_acceleration"] = 0.0 if forces is None else scene.lift
    bodies["force_acceleration"] = bodies["own_acceleration"]
    pairs["wall"], pairs["wait"], pairs["heat"] = -1, 0.0, -1
    if forces is not None:
        pairs["closing_acceleration"] -= scene.across(bodies["own_acceleration"])
    sides["forces"] = forces is not None
    sides["lands"] = scene.driven or forces is not None
    set_epoch(state)
    records = _interpreted_walls(state)
    for which in (0, 1):
        if sides["temperature"][which] > 0.0:
            pairs["heat"][-which] = which
        if sides["panels"][which]:
            pairs["wall"][-which] = which
            bodies["fall_velocity"][-which] = wall_displacement(records, which, 0.0)[1]
            speed = float(sides["speed"][which])
            # The velocity of a driven wall is computed, and so has a rounding error.
            bodies["noise"][-which] = COLLISION_NOISE * speed * speed


def set_epoch(state: Any) -> None:
    """Copy the epoch of the clock into the wall records."""
    for side in state.walls.sides:
        side["epoch"], side["low"] = state.clock.epoch, state.clock.epoch_low


def add_to_sample(state: Any, tau: float, velocity: Array, gap: Array) -> None:
    """Add the effects of forces and walls to a sample at time `tau`.

    The arrays `velocity` (m/s) and `gap` (m) are changed in place. `tau` is in s since the epoch.
    """
    velocity += column(state.bodies, "force_acceleration") * tau
    records = _interpreted_walls(state)
    stuck, wall = column(state.pairs, "stuck"), column(state.pairs, "wall")
    gap[stuck > 0] = 0.0
    for c in np.flatnonzero((wall >= 0) & (stuck == 0)).tolist():
        (pair,), (lower, upper) = plain(state.pairs[c : c + 1]), plain(state.bodies[c : c + 2])
        # Rounding can make a closing gap negative.
        gap[c] = max(0.0, gap_at_wall(pair, lower, upper, tau, records)[0])
    for i, which in at_walls(state):
        if records.sides[which].panels:
            velocity[i] = wall_displacement(records, which, tau)[1]


def energy_account(state: Any, tau: float) -> Array:
    """Return work, heat and dissipated energy in J from the start to time `tau`.

    The five entries are the work of the floor and of the ceiling, the heat of both, and the dissipated energy. `tau`
    is in s since the epoch.
    """
    records = _interpreted_walls(state)
    done = [side.work + side.work_low for side in records.sides]
    for i, which in at_walls(state):
        body = plain(state.bodies[i : i + 1])[0]
        if body.mass < math.inf:
            x, v = wall_displacement(records, which, tau)
            done[which] += body.mass * (0.5 * v * v + (state.run.gravity - body.own_acceleration) * x)
    heat = [side.heat + side.heat_low for side in records.sides]
    return np.array([*done, *heat, records.sides[0].lost + records.sides[0].lost_low])


def at_walls(state: Any) -> list[tuple[int, int]]:
    """Return the bodies that are walls or rest on a wall, each with its wall.

    Each entry is the number of the body and the wall: 0 for the floor, 1 for the ceiling.
    """
    mass, stuck = column(state.bodies, "mass"), column(state.pairs, "stuck")
    n, below, above = len(mass), int((stuck == FLOOR).sum()), int((stuck == CEILING).sum())
    floor = [(i, 0) for i in range(below + 1)] if math.isinf(mass[0]) else []
    return floor + ([(i, 1) for i in range(n - 1 - above, n)] if math.isinf(mass[-1]) else [])


def rests_soundly(state: Any, pairs: Any, bodies: Any) -> bool:
    """Return whether resting balls and pair records of a saved state are possible.

    Resting balls must form connected piles at the walls, without gaps and without acceleration by forces. The closing
    acceleration of every free pair that is not at a driven wall must follow from gravity and forces. The field `wall`
    of a pair can only contain a driven wall (or both), or -1.
    """
    is_resting, stuck = bodies["is_free"] == 0.0, pairs["stuck"]
    resting = [i for i, _ in at_walls(state)]
    is_free = (stuck == FREE) & (pairs["wall"] < 0)
    driven = [which for which in (0, 1) if column(state.walls.sides, "panels")[which] > 0]
    pull = state.run.gravity * np.diff(bodies["is_free"]) - np.diff(bodies["force_acceleration"])
    return all([
        is_resting[resting].all() and is_resting.sum() == len(resting),
        not bodies["force_acceleration"][is_resting].any() and not pairs["gap"][stuck != FREE].any(),
        (pairs["closing_acceleration"][is_free] == pull[is_free]).all(),
        np.isin(pairs["wall"], [-1, *driven, *([BOTH] if len(driven) == 2 else [])]).all(),
    ])


def _interpreted_walls(state: Any) -> Walls:
    """Return the records of the walls as objects for interpreted code."""
    return Walls(plain(state.walls.sides), plain(state.walls.panels), state.clock)


@rare
@kernel
def advance_epoch(
    run: Record, pairs: Records, bodies: Records, rows: Records | None, done: int, now: float, walls: Walls
) -> bool:
    """Move the epoch forward by whole windows, to the window that contains time `now`.

    `now` is the time of the next event in s since the epoch. The function is called only if this event is beyond the
    current window. The epoch is not moved if the event is later than `clock.goal`, the end of the current call. Before
    the move, the times of the first `done` log rows are converted to s. Returns whether the epoch was moved. For epoch
    and window see `granular.edmd.motion`.
    """
    clock = walls.clock
    if not now <= (clock.goal - clock.epoch) - clock.epoch_low or now == math.inf:
        return False
    date_rows(clock, rows, done)
    # By whole windows, as `State.shift_to` does.
    shift_epoch(run, pairs, bodies, now - now % clock.window, walls)
    run.edge = min((clock.goal - clock.epoch) - clock.epoch_low, clock.window * NEXT_BELOW_FACTOR)
    return True


@kernel
def date_rows(clock: Record, rows: Records | None, done: int) -> None:
    """Convert times since the epoch to times in s, in log rows before number `done`.

    Rows that are already converted are not changed.
    """
    if rows is not None:
        for k in range(clock.dated, done):
            rows[k].t_begin = clock.epoch + (clock.epoch_low + rows[k].t_begin)
    clock.dated = done


@kernel
def shift_epoch(run: Record, pairs: Records, bodies: Records, by: float, walls: Walls) -> None:
    """Move the epoch forward by `by` s and adapt the window to the speeds.

    The new epoch must not be earlier than the last change of any pair.
    """
    clock, n, total, speed = walls.clock, len(pairs), 0.0, walls.clock.fall
    rebase(run, pairs, bodies, by, walls)
    # Compensated sum: `epoch_low` collects the rounding error of the epoch.
    epoch = clock.epoch + by
    back = epoch - clock.epoch
    clock.epoch_low += (clock.epoch - (epoch - back)) + (by - back)
    clock.epoch = epoch
    clock.rebases += 1
    run.now -= by
    for which in range(2):
        walls.sides[which].epoch, walls.sides[which].low = clock.epoch, clock.epoch_low
    update_wall_velocities(pairs, bodies, walls)
    for c in range(n):
        total += pairs[c].gap
        speed = max(speed, abs(bodies[c + 1].fall_velocity - bodies[c].fall_velocity))
    clock.length, clock.speed = max(clock.length, total / n), speed  # a shaken gas expands
    if run.slow >= 0.0:
        # The same factor as `state.SLOW_BITS`.
        run.slow = speed * 2.0**-16
    if speed > 0.0:
        clock.window = max(clock.window, window_length(clock.length, speed, clock.strength))


@kernel
def account_collision(lower: Record, upper: Record, w: float, e: float, walls: Walls) -> float:
    """Add a collision to the energy balance and return its impulse in N s (≥ 0).

    `w` ≤ 0 is the rate (m/s) before the collision, and `e` is ε. The records of walls must have their velocities at
    the time of the collision.
    """
    exchanged = impulse(lower, upper, (1.0 + e) * w)
    account_impulse(lower, upper, exchanged, -0.5 * (1.0 - e) * w * exchanged, walls)
    return exchanged


@rare
@kernel
def account_impulse(lower: Record, upper: Record, exchanged: float, lost: float, walls: Walls) -> None:
    """Add an impulse and an energy loss of a collision to the energy balance.

    `exchanged` (N s) acts upwards on the upper body and downwards on the lower body. `lost` is in J. The impulse does
    work if one of the bodies is a wall or rests on a wall.
    """
    if lower.is_free == 0.0:
        work(walls.sides[0], exchanged * lower.fall_velocity)
    if upper.is_free == 0.0:
        work(walls.sides[1], -exchanged * upper.fall_velocity)
    side = walls.sides[0]
    side.lost, side.lost_low = add_compensated(side.lost, side.lost_low, lost)


@kernel
def work(side: Record, done: float) -> None:
    """Add `done` (J) to the work of a wall."""
    side.work, side.work_low = add_compensated(side.work, side.work_low, done)


@rare
@kernel
def account_rest(run: Record, body: Record, which: int, now: float, v: float, sign: float, walls: Walls) -> None:
    """Add the work of a wall on a ball that comes to rest on it or leaves it.

    `sign` is -1 if the ball comes to rest, and 1 if it leaves. `which` is 0 for the floor and 1 for the ceiling, and
    `v` (m/s) is the velocity of the wall. The contributions of both events add to the work in between.
    """
    x, _ = wall_displacement(walls, which, now)
    work(walls.sides[which], sign * (body.mass * (0.5 * v * v + (run.gravity - body.own_acceleration) * x)))
