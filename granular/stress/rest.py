"""Rest: a pile that has come to lie still goes on to the end time, with its samples, to its equilibrium."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from granular._check import Array
from granular.laws import LinearDashpot, TsujiHertz, ViscoelasticHertz
from granular.scene import Scene
from granular.stress.cell import Again, Cell, Truth, judged_by
from granular.trajectory import Status, Trajectory

G = 9.81
ROWS = 11
SHORT = 4
"""Bodies up to which a cell takes part in a quick study."""


def rests() -> Iterator[Cell]:
    """A ball that oscillates on the floor, piles on a floor, piles between two walls."""
    for zeta, k, span in itertools.product((0.01, 0.1, 0.5, 0.9), (1e3, 1e6), (1.0, 1e3)):
        yield _oscillating(zeta, k, span)
    for n, law, drop in itertools.product((1, 2, 5), LAWS, (0.0, 1e-4, 1e-2)):
        yield _piled(n, law, drop)
    for n, law, gravity in itertools.product((1, 3, 6), LAWS, (0.0, G)):
        yield _between_walls(n, law, gravity)


LAWS: dict[str, tuple[Any, float]] = {
    "linear": (LinearDashpot(1e6, 500.0), 1.0),
    "viscoelastic": (ViscoelasticHertz(1e8, 3e4), 1.5),
    "tsuji": (TsujiHertz(1e8, 1.0), 1.5),
}
"""Law with its stiffness and damping, and the power of its force at rest."""


def _oscillating(zeta: float, k: float, span: float) -> Cell:
    """1 kg that lies 1.5 times as deep as it will: a damped oscillation that never opens the contact."""
    w = math.sqrt(k)
    depth, end = G / k, span * 2.0 / (zeta * w)
    scene = Scene([math.inf, 1.0], [0.0, 0.1], [-1.5 * depth], [0.0, 0.0], gravity=G)

    def error(run: Trajectory, again: Again) -> float:
        if not kept(run, end):
            return math.inf
        root = math.sqrt(1.0 - zeta * zeta)
        decay, phase = np.exp(-zeta * w * run.time), root * w * run.time
        xi = depth + 0.5 * depth * decay * (np.cos(phase) + zeta / root * np.sin(phase))
        rate = -0.5 * depth * w / root * decay * np.sin(phase)
        off, faster = np.abs(-run.gap[:, 0] / xi - 1.0), np.abs(-run.velocity[:, 1] - rate) / (w * depth)
        return float(max(off.max(), faster.max(), unbalanced(run)))

    return _cell(f"one ball oscillates, ζ = {zeta:g}, k = {k:.0e}, {span:g} decay times", scene,
                 LinearDashpot(k, 2.0 * zeta * w), end, Truth("damped oscillation, and momentum of the log", error),
                 1e-12)  # fmt: skip


def _piled(n: int, name: str, drop: float) -> Cell:
    """Balls that are dropped on a floor from `drop` in m lie at last as deep as their weight asks."""
    law, power = LAWS[name]
    gap = [drop, *np.zeros(n - 1)]
    scene = Scene([math.inf, *np.ones(n)], [0.0, *np.full(n, 0.1)], gap, np.zeros(n + 1), gravity=G)
    weight = G * np.arange(n, 0, -1.0)
    return _cell(f"{n} balls from {drop:g} m, {name}", scene, law, 1e3, lies(1e3, (weight / law.k) ** (1.0 / power)))


def _between_walls(n: int, name: str, gravity: float) -> Cell:
    """Balls pressed together by 2 mm a contact, unequally: forces differ by their weight alone in the end."""
    law, power = LAWS[name]
    press = 2e-3 * (1.0 + 0.3 * np.cos(np.arange(n + 1.0)))
    scene = Scene([math.inf, *np.ones(n), math.inf], [0.0, *np.full(n, 0.1), 0.0], -press, np.zeros(n + 2),
                  gravity=gravity)  # fmt: skip
    weight = gravity * np.arange(n, -1.0, -1.0)
    overlap = pressed(law.k, power, weight, float(press.sum()))
    return _cell(f"{n} balls pressed between walls, g = {gravity:g}, {name}", scene, law, 1e3, lies(1e3, overlap))


def pressed(k: float, power: float, weight: Array, total: float) -> Array:
    """Return overlaps in m that sum up to `total`, of forces that differ by the weights in N: by halving."""
    low, high = 0.0, k * total**power

    def overlaps(force: float) -> Array:
        found: Array = ((force + weight) / k) ** (1.0 / power)
        return found

    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if overlaps(middle).sum() < total else (low, middle)
    return overlaps(low)


@judged_by("the equilibrium of the pile, and momentum of the log")
def lies(run: Trajectory, again: Again, end: float, overlap: Sequence[float] | Array) -> float:
    """At `end` in s all lie still at these overlaps in m; rows and momentum of the log are kept."""
    if not kept(run, end) or not run.stats["resting"]:
        return math.inf
    off = np.abs(-run.gap[-1] / np.asarray(overlap) - 1.0).max()
    return float(max(off, np.abs(run.velocity[-1]).max(), unbalanced(run)))


def kept(run: Trajectory, end: float) -> bool:
    """Return whether the run went on to its end and kept the rows that were asked for."""
    return run.status is Status.time and run.time.tolist() == np.linspace(0.0, end, ROWS).tolist()


def unbalanced(run: Trajectory) -> float:
    """Return how far each ball's momentum is from the impulses of the log and its weight, as a part of the largest."""
    impulse, push = np.zeros(run.scene.n_pairs), np.zeros(run.scene.n)
    np.add.at(impulse, run.contacts["pair"], run.contacts["impulse"])
    lower, upper = run.scene.bodies(np.arange(run.scene.n_pairs))
    push[upper] += impulse
    push[lower] -= impulse
    balls = ~run.scene.is_wall
    time = run.time[-1] - run.time[0]
    gain = run.scene.mass[balls] * (run.velocity[-1] - run.velocity[0] + run.scene.gravity * time)[balls]
    return float(np.abs(gain - push[balls]).max() / impulse.max())


def _cell(case: str, scene: Scene, law: Any, end: float, expected: Truth, tolerance: float = 1e-11) -> Cell:
    return Cell("rest", case, scene, expected, law, tolerance=tolerance, options={"t_end": end, "samples": ROWS},
                slow=scene.n > SHORT)  # fmt: skip
