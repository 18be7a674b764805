"""Numbers of collisions that are known exactly, and runs that end before their last sample."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from granular import scenes, until
from granular._check import Array
from granular.laws import Hertz, LinearDashpot
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.stress.cell import Again, Cell, judged_by
from granular.trajectory import Trajectory

BOTH = ("located", "edmd")
STIFF = 1e14
"""Stiffness in N/m at which contacts, of 1e-7 s, do not overlap in time."""


def counts(draws: int = 8) -> Iterator[Cell]:
    """Equal elastic balls pass on velocities as if they went through each other; so the number of contacts is known."""
    law, elastic = LinearDashpot(STIFF), ConstantRestitution(1.0)
    for n, seed in itertools.product((2, 3, 4, 5, 8, 12), range(draws)):
        rng = np.random.default_rng([n, seed])
        v, gap = np.sort(rng.uniform(0.1, 1.0, n)), rng.uniform(0.1, 1.0, n)
        free = Scene(np.ones(n), np.full(n, 0.1), gap[1:], v[::-1])
        for case, scene, many, after in (
            ("all meet once", free, n * (n - 1) // 2, v),
            ("slower ones first to the wall", at_wall(gap, -v), n * n, np.insert(v, 0, 0.0)),
            ("faster ones first to the wall", at_wall(gap, -v[::-1]), n * (n + 1) // 2, np.insert(v, 0, 0.0)),
        ):
            yield Cell("counts", f"{n} balls, {case}, draw {seed}", scene, exactly(many, after), law, elastic,
                       options={"max_steps": 50_000}, methods=BOTH)  # fmt: skip
    for n in range(2, 13):
        mass, height = [math.inf] + [2.0 / (k * (k + 1.0)) for k in range(1, n + 1)], [0.0] + [0.1] * n
        scene = Scene(mass, height, np.full(n, 0.1), [0.0] + [-1.0] * n)
        yield Cell("counts", f"each of {n} falling balls hands on all it has", scene,
                   exactly(n, n * (np.arange(n + 1.0) == n)), law, elastic, options={"max_steps": 50_000},
                   methods=BOTH)  # fmt: skip


def at_wall(gap: Array, velocity: Array) -> Scene:
    """Return equal balls that fly towards a wall."""
    n = len(gap)
    return Scene([math.inf, *np.ones(n)], [0.0, *np.full(n, 0.1)], gap, [0.0, *velocity])


@judged_by("the number of contacts of balls that pass through each other")
def exactly(run: Trajectory, again: Again, many: int, velocity: Array) -> float:
    """That many contacts in all, and these velocities in m/s at the end."""
    if len(run.contacts) != many:
        return math.inf
    return float(np.abs(run.velocity[-1] - velocity).max() / np.abs(velocity).max())


def last_rows() -> Iterator[Cell]:
    """Runs that a condition ends before their last sample: the last row has the time and the state of the end."""
    elastic = ConstantRestitution(1.0)
    for k, rows in itertools.product((1e4, 1e8), (2, 3, 10, 301)):
        law = LinearDashpot(k)
        lasts = math.pi / math.sqrt(k)
        options = {"t_end": 30.0, "samples": rows}
        scene = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [0.25, 0.5], [0.0, -1.0, 0.0])
        for nth in (1, 2, 3):
            flown, pause = 0.25 + 1.5 * (nth - 1), (2 * nth - 2) * lasts
            yield Cell("last row", f"before contact {nth} of a ball between walls, k = {k:.0e}, {rows} rows", scene,
                       ends_at(flown, pause, rows, [0.0, -1.0, 0.0], [0.0, 0.75]), law, elastic,
                       options=options | {"until": until.contact(0, nth)}, methods=BOTH)  # fmt: skip
        pair = Scene([1.0, 1.0], [0.1, 0.1], [0.5], [1.0, -1.0])
        yield Cell("last row", f"two balls that part, k = {k:.0e}, {rows} rows", pair,
                   ends_at(0.25, lasts / math.sqrt(2.0), rows, [-1.0, 1.0], [0.0]), law, elastic,
                   options=options | {"until": until.separated()}, methods=BOTH)  # fmt: skip
        moving = Scene([math.inf, 1.0], [0.0, 0.1], [1.0], [0.5, -0.5])
        yield Cell("last row", f"a wall that moves, k = {k:.0e}, {rows} rows", moving,
                   ends_at(1.0, 0.0, rows, [0.5, -0.5], [0.0]), law, elastic,
                   options=options | {"until": until.contact(0, 1)}, methods=BOTH)  # fmt: skip
    for method, rows in itertools.product(BOTH, (2, 10)):
        end = 2.5 * math.sqrt(2.0)  # at rest above the floor in between: after one bounce of 1 m at g = 1 m/s²
        yield Cell("last row", f"bounces counted by max_events, {rows} rows, {method}",
                   scenes.bouncing_ball(1.0, gravity=1.0), in_order(rows, 10.0 * end), LinearDashpot(1e8), elastic,
                   options={"t_end": 10.0 * end, "samples": rows, "max_events": 2}, methods=(method,), cut=True,
                   )  # fmt: skip
    touching = Scene(np.ones(4), np.full(4, 0.5), [0.1, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    for pair_, rows in itertools.product((0, 1, 2), (2, 10)):
        yield Cell("last row", f"before the touch of row {pair_} of a chain at rest, {rows} rows", touching,
                   ends_at(0.1, 0.0, rows, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), Hertz(1.0),
                   options={"t_end": 30.0, "samples": rows, "until": until.contact(pair_, 1)})  # fmt: skip


@judged_by("free flight up to the contact that ends the run")
def ends_at(
    run: Trajectory, again: Again, flown: float, pause: float, rows: int, velocity: list[float], gap: list[float]
) -> float:
    """The run ends after that much flight and, if soft, that much contact in s, with these velocities and gaps.

    Rows before are those asked for, spread over 30 s.
    """
    end = flown + (pause if run.law is not None else 0.0)
    if not rows_kept(run, rows, 30.0, end):
        return math.inf
    way = np.array(velocity) * (run.time[-1] - run.time[-2])  # flown freely
    moved = np.abs(run.position[-1] - run.position[-2] - way).max() if pause == 0.0 else 0.0
    differences = (run.time[-1] / end - 1.0, run.velocity[-1] - velocity, run.gap[-1] - gap, moved)
    return float(max(np.abs(d).max() for d in differences))


@judged_by("each row at its own time, with the energy of the start")
def in_order(run: Trajectory, again: Again, rows: int, last: float) -> float:
    """The rows that were asked for, up to the end, and the end once, where the ball is by energy."""
    if not rows_kept(run, rows, last, run.time[-1]):
        return math.inf
    return float(np.abs(run.energy() / run.energy()[0] - 1.0).max())


def rows_kept(run: Trajectory, rows: int, last: float, end: float) -> bool:
    """Return whether the run has the rows asked for up to `last` in s that are before `end`, and one more."""
    asked = np.linspace(0.0, last, rows)
    return bool(run.time[:-1].tolist() == asked[asked < end].tolist())
