"""Where the energy of a driven run comes from and goes to: work and heat of each wall, and what is dissipated.
May be skipped: sums of what collisions say.

Each is added up by itself, with the rounding of its sum carried along. A wall does the work J·ẋ_w in a collision with
the impulse J. While a ball of mass m under a force f rests on it, it does that of ½mẋ_w² + (mg - f) x_w: what this has
grown by since it came to rest, so that a ball that rides needs no events.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granular._kernels import kernel, rare
from granular._records import Record
from granular.edmd.driven import place
from granular.edmd.motion import Walls, impulse
from granular.edmd.sums import add

SUMS = ("work", "work_low", "lost", "lost_low", "heat", "heat_low", "given", "given_low")
"""What is saved of an account."""


@kernel
def book(lower: Record, upper: Record, w: float, e: float, walls: Walls) -> None:
    """Enter a collision at rate `w` with restitution `e`; walls have the velocities of that time."""
    exchanged = impulse(lower, upper, (1.0 + e) * w)
    enter(lower, upper, exchanged, -0.5 * (1.0 - e) * w * exchanged, walls)


@rare
@kernel
def enter(lower: Record, upper: Record, exchanged: float, lost: float, walls: Walls) -> None:
    """Enter the work of an impulse (N s) from below, if one of the bodies is a wall or rests on it, and a loss (J)."""
    if lower.falls == 0.0:
        work(walls[0][0], exchanged * lower.u)
    if upper.falls == 0.0:
        work(walls[0][1], -exchanged * upper.u)
    side = walls[0][0]
    side.lost, side.lost_low = add(side.lost, side.lost_low, lost)


@kernel
def work(side: Record, done: float) -> None:
    """Add work (J) to that of a wall."""
    side.work, side.work_low = add(side.work, side.work_low, done)


@rare
@kernel
def borne(run: Record, body: Record, which: int, now: float, v: float, sign: float, walls: Walls) -> None:
    """Enter that a ball comes to rest (sign -1) on a wall, which moves at `v` (m/s), or leaves it (sign 1)."""
    x, _ = place(walls, which, now)
    weight = run.gravity - body.own
    work(walls[0][which], sign * (body.mass * (0.5 * v * v + weight * x)))


def ledger(run: Any, resting: list[tuple[Any, int]], walls: Walls, now: float) -> Any:
    """Return what `granular.trajectory.Row` says at a time (tau, s), from plain records.

    `resting` are the bodies that rest, each with its wall.
    """
    sides = walls[0]
    done = [sides[which].work + sides[which].work_low for which in (0, 1)]
    for body, which in resting:
        x, v = place(walls, which, now)
        done[which] += body.mass * (0.5 * v * v + (run.gravity - body.own) * x)
    heat = [side.heat + side.heat_low for side in sides]
    return np.array([*done, *heat, sides[0].lost + sides[0].lost_low])
