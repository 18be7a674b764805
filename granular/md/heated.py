"""Thermal walls under a fixed time step.
May be skipped: rarer, walls that heat.

A ball that would meet a thermal wall within a step does so on the parabola of its present velocity and acceleration: at
its root the wall gives it a new speed, and the step begins on the parabola that it leaves on, traced back to the step's
start. So a hit has no error of the step where nothing else touches the ball; next to a contact it has order 2, and 1
where a damped force jumps with the speed. Hits of a step follow one another so in the order of their times.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from granular._flight import rate_at_contact, time_to_contact
from granular._kernels import kernel
from granular._records import plain
from granular.md.integrators import pulled
from granular.scene import Scene
from granular.walls.path import total
from granular.walls.thermal import drawn

HIT, HALT, CROWD = 4, 8, 16
"""Flags: a ball has left a thermal wall anew; the hit at which to stop would come; more than `MOST` hits in it."""
MOST = 64
"""Hits in a step."""
HEATER = np.dtype([("pair", int), ("side", int), ("temperature", float), ("seed", int), ("mass", float)], align=True)
"""A thermal wall: its pair; 0 of a floor, 1 of a ceiling; k_B T in J, seed; mass in kg of its ball."""


def heaters(scene: Scene) -> list[Any]:
    """Return what kernels read of the thermal walls of a scene; plain objects."""
    rows = [(side * (scene.n_pairs - 1), side, heat.temperature, heat.seed, scene.mass[-2 if side else 1])
            for side, heat in enumerate(scene.heat) if heat is not None]
    return plain(np.array(rows, HEATER))


@kernel
def heat(physics: Any, lo: int, m: int, first: int, stop: int, k: int, work: Any) -> int:
    """Let the balls of a window of `m` pairs hit thermal walls in step `k`, at its start; return flags.

    Hits are logged for the pairs from `first` to before `stop`.
    """
    a, s, hits, flags = work.window, 0.0, 0, 0
    while True:
        best, at = -1, physics.dt
        for i in range(len(physics.heat)):
            j = physics.heat[i].pair - lo
            if 0 <= j < m:
                gap, rate, pull = _flight(physics.heat[i].side, j, s, a)
                t = s + _until_hit(gap, rate, pull)
                if t < at or (best < 0 and t == at):
                    best, at = i, t
        if best < 0:
            return flags
        wall = physics.heat[best]
        if wall.pair == work.pair and a.count[wall.pair - lo + 1] + 1.0 == work.nth:
            a.part[wall.pair - lo + 1] = at / physics.dt
            return flags | HALT
        if hits == MOST:
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
    """Return a thermal wall's gap, its rate and its closing acceleration at a time s into a step."""
    acc = pulled(j + 1, a) if side == 0 else pulled(j, a)
    gap, rate, pull = -a.xi[j + 1], a.v[j + 2] - a.v[j + 1], -acc if side == 0 else acc
    gap += s * (rate - 0.5 * pull * s)
    return gap if gap > 0.0 else 0.0, rate - pull * s, pull


@kernel
def _leave(wall: Any, j: int, m: int, at: float, was: float, speed: float, pull: float, a: Any) -> None:
    """Put the ball that met a thermal wall at a time `at` into the step onto the parabola that it leaves on; book that.
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
def _until_hit(gap: float, rate: float, pull: float) -> float:
    """Time in s until the ball meets the wall; what is pressed against it at rest does so now."""
    return 0.0 if gap == 0.0 and rate == 0.0 and pull > 0.0 else time_to_contact(gap, rate, pull)


@kernel
def _note(row: Any, wall: Any, lo: int, was: float, speed: float, k: int, part: float, a: Any) -> None:
    """Write down a hit: an instant, at which a ball that came with the speed `was` turns."""
    v = a.v[wall.pair - lo + 1 + wall.side]
    row.pair, row.step_in, row.part_in, row.step_out, row.part_out = wall.pair, k, part, k, part
    row.lower_in, row.lower_out, row.upper_in, row.upper_out = v, v, v, v
    if wall.side == 0:
        row.upper_in, row.upper_out = v - was, v + speed
    else:
        row.lower_in, row.lower_out = v + was, v - speed
    row.xi_max, row.force_max, row.impulse = 0.0, math.nan, wall.mass * (speed + was)
