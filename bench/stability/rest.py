"""Ends of runs: piles that come to rest, and runs that stop between samples.

A pile at rest is continued to the end time and to its equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from bench.stability.cell import DEFAULT_METHODS, ELASTIC_RULE, Cell, Rerun, Truth, at_wall, compared_with
from granular import scenes, until
from granular._engine.check import Array
from granular.laws import Hertz, LinearDashpot, TsujiHertz, ViscoelasticHertz
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene

G, LONG_TIME = 9.81, 1e3
SAMPLE_COUNT = 11
QUICK_BODIES = 4
"""Maximum number of bodies of a cell in a quick study."""
PILE_LAWS: dict[str, tuple[Any, float]] = {
    "linear": (LinearDashpot(1e6, 500.0), 1.0),
    "viscoelastic": (ViscoelasticHertz(1e8, 3e4), 1.5),
    "tsuji": (TsujiHertz(1e8, 1.0), 1.5),
}
"""Law with its stiffness and damping, and the power of its force at rest."""


def rests() -> Iterator[Cell]:
    """Oscillating ball, piles on a floor, and piles between two walls."""
    for zeta, k, span in product((0.01, 0.1, 0.5, 0.9), (1e3, 1e6), (1.0, 1e3)):
        w = math.sqrt(k)
        end, scene = span * 2.0 / (zeta * w), at_wall([-1.5 * (G / k)], [0.0], gravity=G)
        yield rest_cell(f"one ball oscillates, ζ = {zeta:g}, k = {k:.0e}, {span:g} decay times", scene,
                        LinearDashpot(k, 2.0 * zeta * w), oscillates(end, zeta, k), end, 1e-12)
    for n, (name, (law, power)), drop in product((1, 2, 5), PILE_LAWS.items(), (0.0, 1e-4, 1e-2)):
        scene = at_wall([drop, *np.zeros(n - 1)], np.zeros(n), gravity=G)
        lie = lies(LONG_TIME, (G * np.arange(n, 0, -1.0) / law.k) ** (1.0 / power))
        yield rest_cell(f"{n} balls from {drop:g} m, {name}", scene, law, lie)
    for n, (name, (law, power)), g in product((1, 3, 6), PILE_LAWS.items(), (0.0, G)):
        press = 2e-3 * (1.0 + 0.3 * np.cos(np.arange(n + 1.0)))
        scene = Scene([math.inf, *np.ones(n), math.inf], [0.0, *np.full(n, 0.1), 0.0], -press, np.zeros(n + 2), g)
        lie = lies(LONG_TIME, pressed(law.k, power, g * np.arange(n, -1.0, -1.0), float(press.sum())))
        yield rest_cell(f"{n} balls pressed between walls, g = {g:g}, {name}", scene, law, lie)


def rest_cell(
    case: str, scene: Scene, law: Any, expected: Truth, end: float = LONG_TIME, tolerance: float = 1e-11
) -> Cell:
    """Cell of a scene that comes to rest before `end` in s."""
    return Cell("rest", case, scene, expected, law, tolerance=tolerance,
                options={"t_end": end, "samples": SAMPLE_COUNT}, slow=scene.n > QUICK_BODIES)


@compared_with("damped oscillation, and momentum from the log")
def oscillates(run: Trajectory, rerun: Rerun, end: float, zeta: float, k: float) -> float:
    """Error of a damped oscillation of 1 kg that never opens its contact.

    The ball starts at 1.5 times its equilibrium overlap.
    """
    w, depth, root = math.sqrt(k), G / k, math.sqrt(1.0 - zeta * zeta)
    decay, phase = np.exp(-zeta * w * run.time), root * w * run.time
    xi = depth + 0.5 * depth * decay * (np.cos(phase) + zeta / root * np.sin(phase))
    rate = -0.5 * depth * w / root * decay * np.sin(phase)
    return rest_error(run, end, -run.gap[:, 0] / xi - 1.0, (-run.velocity[:, 1] - rate) / (w * depth))


@compared_with("equilibrium of the pile, and momentum from the log")
def lies(run: Trajectory, rerun: Rerun, end: float, overlap: Array) -> float:
    """Error of the state at rest at `end` in s, for known overlaps in m.

    The error is infinite if the run does not report rest.
    """
    off = rest_error(run, end, -run.gap[-1] / overlap - 1.0, run.velocity[-1])
    return off if run.stats["resting"] else math.inf


def rest_error(run: Trajectory, end: float, *errors: Array) -> float:
    """Largest of the errors and of `momentum_defect`.

    The error is infinite unless the run reached `end` with all samples.
    """
    kept = run.status is Status.time and run.time.tolist() == np.linspace(0.0, end, SAMPLE_COUNT).tolist()
    return float(max([momentum_defect(run), *(np.abs(error).max() for error in errors)])) if kept else math.inf


def pressed(k: float, power: float, weight: Array, total: float) -> Array:
    """Overlaps in m with the sum `total`, found by bisection.

    The contact forces differ by the weights in N.
    """
    low, high = 0.0, k * total**power
    while low < (middle := 0.5 * (low + high)) < high:  # until no float lies between
        enough = (((middle + weight) / k) ** (1.0 / power)).sum() >= total
        low, high = (low, middle) if enough else (middle, high)
    found: Array = ((low + weight) / k) ** (1.0 / power)
    return found


def momentum_defect(run: Trajectory) -> float:
    """Largest difference between gained momentum and logged impulses of a ball.

    Weight is taken into account. The difference is a share of the largest impulse.
    """
    impulse, balls = np.zeros(run.scene.n_pairs), ~run.scene.is_wall
    np.add.at(impulse, run.contacts["pair"], run.contacts["impulse"])
    push = -np.diff(impulse, prepend=0.0, append=0.0)
    fallen = run.scene.gravity * (run.time[-1] - run.time[0])
    gain = run.scene.mass[balls] * (run.velocity[-1] - run.velocity[0] + fallen)[balls]
    return float(np.abs(gain - push[balls]).max() / impulse.max())


def last_rows() -> Iterator[Cell]:
    """Runs that a condition stops before their last sample.

    The last row must contain the time and the state of the end.
    """
    for k, rows in product((1e4, 1e8), (2, 3, 10, 301)):
        walls = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [0.25, 0.5], [0.0, -1.0, 0.0])
        pair = Scene([1.0, 1.0], [0.1, 0.1], [0.5], [1.0, -1.0])
        moving = Scene([math.inf, 1.0], [0.0, 0.1], [1.0], [0.5, -0.5])
        lasts = math.pi / math.sqrt(k)
        each = [
            (f"before contact {nth} of a ball between walls", walls, 0.25 + 1.5 * (nth - 1), (2 * nth - 2) * lasts,
             [0.0, -1.0, 0.0], [0.0, 0.75], until.contact(0, nth)) for nth in (1, 2, 3)
        ]
        parted = ("two balls that part", pair, 0.25, lasts / math.sqrt(2.0), [-1.0, 1.0], [0.0], until.separated())
        hit = ("a wall that moves", moving, 1.0, 0.0, [0.5, -0.5], [0.0], until.contact(0, 1))
        for case, scene, flown, pause, velocity, gap, stop in (*each, parted, hit):
            yield Cell("last row", f"{case}, k = {k:.0e}, {rows} rows", scene,
                       ends_at(flown, pause, rows, velocity, gap), LinearDashpot(k), ELASTIC_RULE,
                       options={"t_end": 30.0, "samples": rows, "until": stop}, methods=DEFAULT_METHODS)
    for method, rows in product(DEFAULT_METHODS, (2, 10)):
        end = 2.5 * math.sqrt(2.0)  # 2.5 fall times for 1 m at g = 1 m/s²: between two bounces
        yield Cell("last row", f"bounces counted by max_events, {rows} rows, {method}",
                   scenes.bouncing_ball(1.0, gravity=1.0), in_order(rows, 10.0 * end), LinearDashpot(1e8), ELASTIC_RULE,
                   options={"t_end": 10.0 * end, "samples": rows, "max_events": 2}, methods=(method,), cut=True)
    touching = Scene(np.ones(4), np.full(4, 0.5), [0.1, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    for c, rows in product((0, 1, 2), (2, 10)):
        yield Cell("last row", f"before the touch of row {c} of a chain at rest, {rows} rows", touching,
                   ends_at(0.1, 0.0, rows, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), Hertz(1.0),
                   options={"t_end": 30.0, "samples": rows, "until": until.contact(c, 1)})


@compared_with("free flight until the final contact")
def ends_at(
    run: Trajectory, rerun: Rerun, flown: float, pause: float, rows: int, velocity: list[float], gap: list[float]
) -> float:
    """Error of the final state of a run that ends after `flown` s of flight.

    A soft run additionally has `pause` s of contact. Earlier rows must be the requested samples, spread over 30 s.
    """
    end = flown + (pause if run.law is not None else 0.0)
    way = np.array(velocity) * (run.time[-1] - run.time[-2])  # free flight
    moved = np.abs(run.position[-1] - run.position[-2] - way).max() if pause == 0.0 else 0.0
    differences = (run.time[-1] / end - 1.0, run.velocity[-1] - velocity, run.gap[-1] - gap, moved)
    return float(max(np.abs(d).max() for d in differences)) if rows_kept(run, rows, 30.0, end) else math.inf


@compared_with("samples at the requested times, with the initial energy")
def in_order(run: Trajectory, rerun: Rerun, rows: int, last: float) -> float:
    """Largest relative error of the energy, infinite for missing samples.

    The run must contain the requested samples up to its end, and its end once.
    """
    off = float(np.abs(run.energy() / run.energy()[0] - 1.0).max())
    return off if rows_kept(run, rows, last, run.time[-1]) else math.inf


def rows_kept(run: Trajectory, rows: int, last: float, end: float) -> bool:
    """Whether the run has the requested samples before `end`, and one more row.

    The samples are spread up to `last` in s.
    """
    asked = np.linspace(0.0, last, rows)
    return bool(run.time[:-1].tolist() == asked[asked < end].tolist())
