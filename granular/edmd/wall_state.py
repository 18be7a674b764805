"""State of driven walls and forces: start, samples, epoch and energy balance.

A ball on a shaken plate can fly for longer than a window, and each bounce begins a new window. The event loop therefore
moves the zero of time itself, at the same times as `State.shift_to` would.

Work and heat of each wall, and the dissipated energy, are compensated sums. A wall does the work J·ẋ_w in a collision
with the impulse J. While a ball of mass m under a force f rests on a wall, the wall does the work by which ½mẋ_w² + (mg
- f) x_w has grown since the ball came to rest. A ball that moves with its wall therefore needs no events.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._engine.check import Array
from granular._engine.kernels import kernel, rare
from granular._engine.records import Record, Records, column, plain
from granular.edmd.driven import beside, place, synchronise
from granular.edmd.motion import COLLISION_NOISE, add, impulse, rebase, span
from granular.edmd.physics import frame_velocity
from granular.edmd.records import BOTH, CEILING, FLOOR, FREE, WALL_FIELDS, Walls
from granular.scene import Scene
from granular.scene.places import driven_walls
from granular.scene.walls.path import PANEL_DTYPE

BALANCE_FIELDS = ("work", "work_low", "lost", "lost_low", "heat", "heat_low", "given", "given_low")
"""Saved fields of the energy balance."""
NEXT_BELOW_FACTOR = 1.0 - 2.0**-53
"""Factor that turns a power of two into the next smaller float."""


def walls(scene: Scene, t_start: float) -> tuple[Any, Any]:
    """Return the records `WALL_FIELDS` of both walls, and the panels of both."""
    sides = np.zeros(2, WALL_FIELDS)
    sides["velocity"] = np.where(scene.is_wall, scene.velocity - frame_velocity(scene), 0.0)[[0, -1]]
    driven = driven_walls(scene, t_start)
    for body, one, _ in driven:
        for name in one.dtype.names or ():
            sides[name][0 if body == 0 else 1] = one[name][0]
    for side, heat in zip(sides, scene.heat, strict=True):
        if heat is not None:
            side["temperature"], side["seed"] = heat.temperature, heat.seed
    sides["begin"] = t_start
    # An empty panel gives kernels the type of the array.
    return sides, np.concatenate([rows for _, _, rows in driven] or [np.zeros(1, PANEL_DTYPE)])


def begin(state: Any, scene: Scene) -> None:
    """Initialise the fields of a new state that forces and walls need."""
    sides, forces, (pairs, bodies) = state.walls.sides, scene.external_force, (state.pairs, state.bodies)
    bodies["own_acceleration"] = 0.0 if forces is None else scene.lift
    bodies["force_acceleration"] = bodies["own_acceleration"]
    pairs["wall"], pairs["wait"], pairs["heat"] = -1, 0.0, -1
    if forces is not None:
        pairs["closing_acceleration"] -= scene.across(bodies["own_acceleration"])
    sides["forces"] = forces is not None
    sides["lands"] = scene.driven or forces is not None
    set_epoch(state)
    seen = _seen(state)
    for which in (0, 1):
        if sides["temperature"][which] > 0.0:
            pairs["heat"][-which] = which
        if sides["panels"][which]:
            pairs["wall"][-which] = which
            bodies["fall_velocity"][-which] = place(seen, which, 0.0)[1]
            speed = float(sides["speed"][which])
            # The velocity of a driven wall is computed, and so has a rounding error.
            bodies["noise"][-which] = COLLISION_NOISE * speed * speed


def set_epoch(state: Any) -> None:
    """Copy the epoch of the clock into the wall records."""
    for side in state.walls.sides:
        side["epoch"], side["low"] = state.clock.epoch, state.clock.epoch_low


def show(state: Any, tau: float, velocity: Array, gap: Array) -> None:
    """Add the effects of forces and walls to `velocity` and `gap` at `tau`.

    Both arrays are changed in place.
    """
    velocity += column(state.bodies, "force_acceleration") * tau
    seen = _seen(state)
    stuck, wall = column(state.pairs, "stuck"), column(state.pairs, "wall")
    gap[stuck > 0] = 0.0
    for c in np.flatnonzero((wall >= 0) & (stuck == 0)).tolist():
        (pair,), (lower, upper) = plain(state.pairs[c : c + 1]), plain(state.bodies[c : c + 2])
        # Rounding can make a closing gap negative.
        gap[c] = max(0.0, beside(pair, lower, upper, tau, seen)[0])
    for i, which in at_walls(state):
        if seen.sides[which].panels:
            velocity[i] = place(seen, which, tau)[1]


def ledger(state: Any, tau: float) -> Array:
    """Return work, heat and dissipated energy in J from the start to `tau`.

    See `granular.run.trajectory.Row`.
    """
    seen = _seen(state)
    done = [side.work + side.work_low for side in seen.sides]
    for i, which in at_walls(state):
        body = plain(state.bodies[i : i + 1])[0]
        if body.mass < math.inf:
            x, v = place(seen, which, tau)
            done[which] += body.mass * (0.5 * v * v + (state.run.gravity - body.own_acceleration) * x)
    heat = [side.heat + side.heat_low for side in seen.sides]
    return np.array([*done, *heat, seen.sides[0].lost + seen.sides[0].lost_low])


def at_walls(state: Any) -> list[tuple[int, int]]:
    """Return the bodies that are walls or rest on a wall, each with its wall.

    The wall is 0 for the floor and 1 for the ceiling.
    """
    mass, stuck = column(state.bodies, "mass"), column(state.pairs, "stuck")
    n, below, above = len(mass), int((stuck == FLOOR).sum()), int((stuck == CEILING).sum())
    floor = [(i, 0) for i in range(below + 1)] if math.isinf(mass[0]) else []
    return floor + ([(i, 1) for i in range(n - 1 - above, n)] if math.isinf(mass[-1]) else [])


def rests_soundly(state: Any, pairs: Any, bodies: Any) -> bool:
    """Whether resting balls form connected piles without acceleration.

    Also checks that pairs are marked only beside existing driven walls.
    """
    rests, stuck = bodies["is_free"] == 0.0, pairs["stuck"]
    there = [i for i, _ in at_walls(state)]
    free = (stuck == FREE) & (pairs["wall"] < 0)
    driven = [which for which in (0, 1) if column(state.walls.sides, "panels")[which] > 0]
    pull = state.run.gravity * np.diff(bodies["is_free"]) - np.diff(bodies["force_acceleration"])
    return all([
        rests[there].all() and rests.sum() == len(there),
        not bodies["force_acceleration"][rests].any() and not pairs["gap"][stuck != FREE].any(),
        (pairs["closing_acceleration"][free] == pull[free]).all(),
        np.isin(pairs["wall"], [-1, *driven, *([BOTH] if len(driven) == 2 else [])]).all(),
    ])


def _seen(state: Any) -> Walls:
    """Return the records of the walls as objects for interpreted code."""
    return Walls(plain(state.walls.sides), plain(state.walls.panels), state.clock)


@rare
@kernel
def advance_epoch(
    run: Record, pairs: Records, bodies: Records, rows: Records | None, done: int, now: float, walls: Walls
) -> bool:
    """Move the zero of time forward for an event at `now` beyond the window.

    Does nothing if the event is later than the goal of the clock. The first `done` log rows get their final times
    before. Returns whether the zero of time was moved.
    """
    clock = walls.clock
    if not now <= (clock.goal - clock.epoch) - clock.epoch_low or now == math.inf:
        return False
    date_rows(clock, rows, done)
    # By whole windows, as `State.shift_to` does.
    shift(run, pairs, bodies, now - now % clock.window, walls)
    run.edge = min((clock.goal - clock.epoch) - clock.epoch_low, clock.window * NEXT_BELOW_FACTOR)
    return True


@kernel
def date_rows(clock: Record, rows: Records | None, done: int) -> None:
    """Replace times since the epoch by times in s, in log rows up to `done`."""
    if rows is not None:
        for k in range(clock.dated, done):
            rows[k].t_begin = clock.epoch + (clock.epoch_low + rows[k].t_begin)
    clock.dated = done


@kernel
def shift(run: Record, pairs: Records, bodies: Records, by: float, walls: Walls) -> None:
    """Move the epoch forward by `by` s and adapt the window.

    The new epoch is not earlier than the last change of any pair.
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
    synchronise(pairs, bodies, walls)
    for c in range(n):
        total += pairs[c].gap
        speed = max(speed, abs(bodies[c + 1].fall_velocity - bodies[c].fall_velocity))
    clock.length, clock.speed = max(clock.length, total / n), speed  # a shaken gas expands
    if run.slow >= 0.0:
        # The same factor as `state.SLOW_BITS`.
        run.slow = speed * 2.0**-16
    if speed > 0.0:
        clock.window = max(clock.window, span(clock.length, speed, clock.strength))


@kernel
def book(lower: Record, upper: Record, w: float, e: float, walls: Walls) -> float:
    """Add a collision at rate `w` ≤ 0 with restitution `e` to the energy balance.

    Walls must have their velocities at the time of the collision. Returns the impulse in N s, not negative.
    """
    exchanged = impulse(lower, upper, (1.0 + e) * w)
    enter(lower, upper, exchanged, -0.5 * (1.0 - e) * w * exchanged, walls)
    return exchanged


@rare
@kernel
def enter(lower: Record, upper: Record, exchanged: float, lost: float, walls: Walls) -> None:
    """Add an impulse (N s, from below) and a loss (J) to the energy balance.

    The impulse does work if one of the bodies is a wall or rests on a wall.
    """
    if lower.is_free == 0.0:
        work(walls.sides[0], exchanged * lower.fall_velocity)
    if upper.is_free == 0.0:
        work(walls.sides[1], -exchanged * upper.fall_velocity)
    side = walls.sides[0]
    side.lost, side.lost_low = add(side.lost, side.lost_low, lost)


@kernel
def work(side: Record, done: float) -> None:
    """Add work (J) to the work of a wall."""
    side.work, side.work_low = add(side.work, side.work_low, done)


@rare
@kernel
def borne(run: Record, body: Record, which: int, now: float, v: float, sign: float, walls: Walls) -> None:
    """Account for a ball that comes to rest on a wall or leaves it.

    `sign` is -1 for coming to rest and 1 for leaving. The wall moves at `v` (m/s).
    """
    x, _ = place(walls, which, now)
    work(walls.sides[which], sign * (body.mass * (0.5 * v * v + (run.gravity - body.own_acceleration) * x)))
