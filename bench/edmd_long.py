"""Conservation of energy, momentum and order in long elastic runs.

`python bench/edmd_long.py [collisions]` runs 1e8 collisions by default, which takes about 20 s per gas. Equal balls are
also compared with their exact solution.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator

import numpy as np

import granular as gr

ELASTIC_RULE = gr.ConstantRestitution(1.0)


def gas(n: int, spread: float = 0.0, tiny: float = 0.0, walls: bool = True, seed: int = 1) -> gr.Scene:
    """Balls of masses e^±spread in equipartition, between walls or free.

    The fraction `tiny` of the gaps is 1e-15 m.
    """
    random = np.random.default_rng(seed)
    mass = np.exp(random.uniform(-spread, spread, n))
    v = random.normal(size=n) / np.sqrt(mass)
    gap = np.where(random.random(n + 1) < tiny, 1e-15, random.uniform(0.5, 1.5, n + 1))
    if not walls:
        return gr.Scene(mass, np.zeros(n), gap[1:-1], v)
    return gr.Scene([math.inf, *mass, math.inf], np.zeros(n + 2), gap, [0.0, *v, 0.0])


def energy(scene: gr.Scene, velocity: np.ndarray) -> float:
    """Kinetic energy, summed without rounding."""
    balls = ~scene.is_wall
    return math.fsum((0.5 * scene.mass[balls] * velocity[balls] ** 2).tolist())


def run_in_tenths(scene: gr.Scene, collisions: int, t_start: float = 0.0) -> Iterator[gr.Trajectory]:
    """Yield the run after each tenth of `collisions`."""
    run = gr.edmd.simulate(scene, ELASTIC_RULE, engine="compiled", log=False, max_events=1, t_start=t_start)
    for _ in range(10):
        run = gr.edmd.resume(run, engine="compiled", log=False, max_events=collisions // 10)
        yield run


def print_drift(name: str, scene: gr.Scene, collisions: int, t_start: float = 0.0) -> None:
    """Print the changes of energy, length and order."""
    before, worst, ordered, begin = energy(scene, scene.velocity), 0.0, True, time.perf_counter()
    for run in run_in_tenths(scene, collisions, t_start):
        worst = max(worst, abs(energy(scene, run.velocity[-1]) / before - 1.0))
        ordered &= bool((run.gap[-1] >= 0.0).all() and (np.diff(run.position[-1]) >= 0.0).all())
    rate = collisions / (time.perf_counter() - begin) * 1e-6
    length = run.gap[-1].sum() / scene.gap.sum() - 1.0
    print(f"{name:34s} {collisions:9.0e} collisions  max |dE/E| {worst:8.1e}  dL/L {length:8.1e}  ordered {ordered}  "
          f"clamps {run.stats['clamps']}  {rate:.1f} M/s", flush=True)


def print_momentum_change(spread: float, collisions: int) -> None:
    """Print the change of momentum of balls between two heavy balls.

    The end balls of 1e12 kg are not walls, so the total momentum is conserved.
    """
    inner = gas(1000, spread, walls=False)
    gap, v = [1.0, *inner.gap, 1.0], [0.0, *inner.velocity, 0.0]
    scene = gr.Scene([1e12, *inner.mass, 1e12], np.zeros(1002), gap, v)
    scale = float(scene.mass @ np.abs(scene.velocity))
    run = gr.edmd.simulate(scene, ELASTIC_RULE, engine="compiled", log=False, max_events=collisions)
    p = [math.fsum((scene.mass * u).tolist()) for u in run.velocity]
    change, ulp = p[1] - p[0], 1e12 * math.ulp(float(np.abs(run.velocity[-1, [0, -1]]).max()))
    print(f"momentum, masses e^±{spread:g}: {run.stats['events']:.0e} collisions, dP/Σm|v| {change / scale:.1e}; "
          f"one rounding of an end ball {ulp / scale:.1e}", flush=True)


def print_flight_error(collisions: int, t_start: float = 0.0) -> None:
    """Print the error of equal balls between walls against their exact positions.

    Equal elastic balls exchange velocities. The exact positions are free flights, folded at the walls and sorted.
    """
    scene = gas(1000)
    place = np.cumsum(scene.gap)
    double = 2 * np.longdouble(place[-1])
    worst = 0.0
    for run in run_in_tenths(scene, collisions, t_start):
        s = run.state
        elapsed = ((np.longdouble(s["epoch"]) - s["start"]) + s["epoch_low"]) + s["now"]
        path = np.mod(place[:-1] + scene.velocity[1:-1] * elapsed, double)
        exact = np.sort(np.minimum(path, double - path))
        worst = max(worst, float(np.abs(run.position[-1, 1:-1] - exact).max() / place[-1]))
    print(f"sorted free flight, t0 = {t_start:g}: {collisions:.0e} collisions, max error/L {worst:.1e}", flush=True)


def main() -> None:
    """Print all lines."""
    collisions = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**8
    ten, wide = math.log(10.0), 9.0 * math.log(10.0)
    print_drift("equal masses", gas(1000), collisions)
    print_drift("masses e^±3", gas(1000, 3.0), collisions)
    print_drift("masses e^±3, N = 200", gas(200, 3.0), collisions)
    print_drift("equal, gaps 1e-15, t0 = 1e12", gas(1000, 0.0, 1.0), collisions, 1e12)
    print_drift("1e±1, half the gaps 1e-15, t0 = 1e12", gas(1000, ten, 0.5), collisions, 1e12)
    print_drift("1e±9, half the gaps 1e-15, t0 = 1e12", gas(1000, wide, 0.5), collisions, 1e12)
    print_drift("1e±9, all gaps 1e-15, t0 = 1e12", gas(1000, wide, 1.0), collisions // 10, 1e12)
    for spread in (0.0, 3.0):
        print_momentum_change(spread, collisions)
    print_flight_error(collisions // 10)
    print_flight_error(collisions // 10, 1e12)


if __name__ == "__main__":
    main()
