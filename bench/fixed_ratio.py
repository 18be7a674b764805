"""Fixed-step Verlet compared with a bare loop.

`python bench/fixed_ratio.py` prints the ratios. The scene is a chain of equal balls between two walls, compressed so
that every contact stays closed. A bare loop and the package with and without a contact log run interleaved in one
process. The time per step is the difference between a long and a short run in processor time, the minimum of several
rounds. The remaining cost of a run is printed separately. All runs must end in the same state. If the package is more
than a tenth faster than its bare loop, one of them skips work, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

import granular as gr

TIME_STEP = 1e-3
FORCE_LAWS: dict[str, Any] = {"Hertz": gr.Hertz(1e4), "dashpot": gr.LinearDashpot(100.0, 0.1),
                              "Tsuji": gr.TsujiHertz(1e4, 0.05)}
SHORT_RUN_SIZE, LONG_RUN_SIZE = 20_000_000, 180_000_000
"""Balls times steps of the short and of the long run."""
CACHED_BALLS = 1_000
"""Largest number of balls in the bare loop, whose data then fit into the cache.

Its time per ball is also used for longer chains.
"""
MIN_PLAUSIBLE_RATIO = 0.9
"""Ratio to the bare loop below which the benchmark is invalid."""


def chain(n: int) -> gr.Scene:
    """Chain with small random velocities, compressed between two walls."""
    v = np.random.default_rng(1).uniform(-1e-3, 1e-3, n)
    mass, radius, v[0], v[-1] = np.full(n, 1.0), np.full(n, 0.5), 0.0, 0.0
    mass[[0, -1]], radius[[0, -1]] = math.inf, 0.0
    return gr.Scene(mass, radius, np.full(n - 1, -1e-3), v)


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def hertz(steps: int, xi: Any, v: Any, f: Any, half: Any, _: Any) -> None:
    """Verlet steps of equal Hertz balls of 1 kg, without log, counters or checks."""
    n, k = len(v), 1e4
    for c in range(n - 1):
        f[c] = math.sqrt(xi[c]) * (k * xi[c])
    for i in range(1, n - 1):
        half[i] = v[i] + 0.5 * TIME_STEP * (f[i - 1] - f[i])
    for _step in range(steps):
        for c in range(n - 1):
            xi[c] += TIME_STEP * (half[c] - half[c + 1])
            x = xi[c] if xi[c] > 0.0 else 0.0  # no force without overlap
            f[c] = math.sqrt(x) * (k * x)
        for c in range(n - 2):
            acc = f[c] - f[c + 1]
            v[c + 1] = half[c + 1] + 0.5 * TIME_STEP * acc
            half[c + 1] = v[c + 1] + 0.5 * TIME_STEP * acc


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def dashpot(steps: int, xi: Any, v: Any, f: Any, half: Any, guess: Any) -> None:
    """Verlet steps with dashpots, whose force uses predicted velocities."""
    n, k, gamma = len(v), 100.0, 0.1
    for c in range(n - 1):
        f[c] = max(0.0, k * xi[c] + gamma * (v[c] - v[c + 1]))
    for i in range(1, n - 1):
        acc = f[i - 1] - f[i]
        half[i], guess[i] = v[i] + 0.5 * TIME_STEP * acc, v[i] + TIME_STEP * acc
    for _step in range(steps):
        for c in range(n - 1):
            xi[c] += TIME_STEP * (half[c] - half[c + 1])
            raw = k * xi[c] + gamma * (guess[c] - guess[c + 1])
            f[c] = raw if xi[c] > 0.0 and raw > 0.0 else 0.0  # clipped, and no force without overlap
        for c in range(n - 2):
            acc = f[c] - f[c + 1]
            v[c + 1] = half[c + 1] + 0.5 * TIME_STEP * acc
            guess[c + 1], half[c + 1] = v[c + 1] + TIME_STEP * acc, v[c + 1] + 0.5 * TIME_STEP * acc


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def tsuji(steps: int, xi: Any, v: Any, f: Any, half: Any, guess: Any) -> None:
    """Verlet steps with Tsuji's damping.

    The effective mass of a ball at a wall is twice the effective mass of two balls.
    """
    n, k, gamma, wall = len(v), 1e4, 0.05 * math.sqrt(0.5 * 1e4), 0.05 * math.sqrt(1e4)
    for c in range(n - 1):
        g = gamma if 0 < c < n - 2 else wall
        root = math.sqrt(xi[c])
        f[c] = max(0.0, k * xi[c] * root + g * math.sqrt(root) * (v[c] - v[c + 1]))
    for i in range(1, n - 1):
        acc = f[i - 1] - f[i]
        half[i], guess[i] = v[i] + 0.5 * TIME_STEP * acc, v[i] + TIME_STEP * acc
    for _step in range(steps):
        for c in range(n - 1):
            g = gamma if 0 < c < n - 2 else wall
            xi[c] += TIME_STEP * (half[c] - half[c + 1])
            x = xi[c] if xi[c] > 0.0 else 0.0
            root = math.sqrt(x)
            raw = k * x * root + g * math.sqrt(root) * (guess[c] - guess[c + 1])
            f[c] = raw if raw > 0.0 else 0.0
        for c in range(n - 2):
            acc = f[c] - f[c + 1]
            v[c + 1] = half[c + 1] + 0.5 * TIME_STEP * acc
            guess[c + 1], half[c + 1] = v[c + 1] + TIME_STEP * acc, v[c + 1] + 0.5 * TIME_STEP * acc


BARE_LOOPS: dict[str, Any] = {"Hertz": hertz, "dashpot": dashpot, "Tsuji": tsuji}


def run_bare_loop(n: int, steps: int, law: str) -> tuple[Any, Any]:
    """Overlaps and velocities after `steps` steps of the bare loop."""
    xi, v = np.full(n - 1, 1e-3), chain(n).velocity.copy()
    BARE_LOOPS[law](steps, xi, v, np.zeros(n - 1), np.zeros(n), np.zeros(n))
    return xi, v


def run_package(n: int, steps: int, law: str, log: bool) -> tuple[Any, Any]:
    """Overlaps and velocities after `steps` steps of the package."""
    run = gr.md.simulate(chain(n), FORCE_LAWS[law], method="verlet", dt=TIME_STEP, t_end=steps * TIME_STEP, log=log,
                         engine="compiled")
    return -run.gap[-1], run.velocity[-1]


def cpu_seconds(work: Callable[..., Any], *given: Any) -> float:
    """Processor time of one call in s."""
    begun = time.process_time()
    work(*given)
    return time.process_time() - begun


def measure_times(n: int, law: str, rounds: int) -> dict[str, tuple[float, float]]:
    """Time in ns per ball and step, and in µs per ball outside the steps.

    The times are given for the bare loop and for the package without and with a log.
    """
    ways: dict[str, tuple[Any, ...]] = {
        "bare": (run_bare_loop,), "no log": (run_package, False), "log": (run_package, True)}
    least = {way: [math.inf, math.inf] for way in ways}
    sizes = {way: min(n, CACHED_BALLS) if way == "bare" else n for way in ways}
    for _ in range(rounds):
        for way, (work, *more) in ways.items():
            for i, total in enumerate((SHORT_RUN_SIZE, LONG_RUN_SIZE)):
                took = cpu_seconds(work, sizes[way], total // sizes[way], law, *more)
                least[way][i] = min(least[way][i], took)
    out = {}
    for way, (short, long) in least.items():
        few, many = (total // sizes[way] for total in (SHORT_RUN_SIZE, LONG_RUN_SIZE))
        step = (long - short) / (many - few)  # the set-up time cancels
        out[way] = 1e9 * step / sizes[way], 1e6 * (short - few * step) / sizes[way]
    return out


def check_final_states(n: int, law: str) -> None:
    """Raise unless the bare loop and the package end in the same state."""
    there = run_bare_loop(n, 200, law)
    for log in (False, True):
        for name, one, other in zip(("overlap", "velocity"), run_package(n, 200, law, log), there, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * np.abs(other).max(), err_msg=name)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--balls", type=int, nargs="+", default=[100, 1_000, 10_000, 100_000])
    given = parser.parse_args()
    print("law, balls: bare loop, ns per ball and step | no log ÷ bare | log ÷ no log | µs per ball outside the steps")
    broken = False
    for law in FORCE_LAWS:
        for n in given.balls:
            check_final_states(n, law)
            found = measure_times(n, law, given.rounds)
            (bare, _), (quiet, one), (logged, other) = (found[way] for way in ("bare", "no log", "log"))
            broken |= min(quiet, logged) < MIN_PLAUSIBLE_RATIO * bare
            print(f"{law:8} {n:7}: {bare:6.3f} | {quiet / bare:5.2f} | {logged / quiet:5.2f} | {one:6.2f} {other:6.2f}",
                  flush=True)
    if broken:
        sys.exit("The package is more than 10 % faster than its bare loop: this benchmark is invalid.")


if __name__ == "__main__":
    main()
