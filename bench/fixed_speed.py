"""Ball-steps per second and core of the fixed-step methods, compiled, beside a bare hand-written loop.

Run as a script: ``python bench/fixed_speed.py``. CPU time, the least of several rounds; the chains are compressed, so
that every contact stays closed, and warm: what is measured is the difference of a long and a short run.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numba import njit

import granular as gr

DT = 1e-3
ROUNDS = 7


def chain(n: int) -> gr.Scene:
    """Return a free, compressed chain with small random velocities."""
    return gr.Scene([1.0] * n, [0.5] * n, np.full(n - 1, -1e-3), np.random.default_rng(1).uniform(-1e-3, 1e-3, n))


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def bare(steps: int, k: float, xi: Any, v: Any, f: Any) -> None:
    """Symplectic Euler of equal Hertz balls and nothing else: no log, no counts, no bounds of validity."""
    n = len(v)
    for _ in range(steps):
        for c in range(n - 1):
            xi[c] += DT * (v[c] - v[c + 1])
            x = xi[c] if xi[c] > 0.0 else 0.0
            f[c] = k * x * math.sqrt(x)
        v[0] -= DT * f[0]
        for c in range(n - 2):
            v[c + 1] += DT * (f[c] - f[c + 1])
        v[n - 1] += DT * f[n - 2]


def least(work: Any, steps: int) -> float:
    """Least CPU time of `steps` steps: a run of so many more, less a short one."""
    times = []
    work(10)
    for _ in range(ROUNDS):
        stamps = [time.process_time()]
        for count in (10, 10 + steps):
            work(count)
            stamps.append(time.process_time())
        times.append((stamps[2] - stamps[1], stamps[1] - stamps[0]))
    return min(t for t, _ in times) - min(t for _, t in times)


def engine(n: int, steps: int, law: Any, **options: Any) -> float:
    """Ball-steps per second of a whole run."""
    scene = chain(n)
    options = {"engine": "compiled", "log": False, "dt": DT} | options
    return n * steps / least(lambda count: gr.md.simulate(scene, law, t_end=count * DT, **options), steps)


def main() -> None:
    """Print the table."""
    print("N, steps | bare | Hertz: verlet, Euler | dashpot | viscoelastic | Tsuji | Hertz with log, rk4, gear5")
    for n, steps in ((1_000, 40_000), (100_000, 2_000)):
        xi, v, f = np.full(n - 1, 1e-3), chain(n).velocity.copy(), np.zeros(n - 1)
        speeds = [n * steps / least(lambda count, a=(xi, v, f): bare(count, 1e4, *a), steps)]
        speeds += [engine(n, steps, gr.Hertz(1e4), method=method) for method in ("verlet", "symplectic-euler")]
        laws = (gr.LinearDashpot(100.0, 0.1), gr.ViscoelasticHertz(1e4, 0.1))
        speeds += [engine(n, steps, law, method="verlet") for law in laws]
        slow = ({"method": "verlet", "log": True}, {"method": "rk4"}, {"method": "gear5"})
        speeds += [engine(n, steps // 5, gr.TsujiHertz(1e4, 0.1), method="verlet")]
        speeds += [engine(n, steps // 5, gr.Hertz(1e4), **options) for options in slow]
        print(f"{n}, {steps} |", " ".join(f"{speed:.3g}" for speed in speeds), flush=True)


if __name__ == "__main__":
    main()
