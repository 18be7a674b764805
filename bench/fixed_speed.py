"""Ball-steps per second and core of the fixed-step methods, compiled, beside a bare hand-written loop.

Run as a script: ``python bench/fixed_speed.py``. CPU time, the least of several rounds; the chains are compressed, so
that every contact stays closed. What is measured is the time from one look at a run in progress to the next.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numba import njit

import granular as gr
from granular.md.fixed import run as fixed

DT = 1e-3
ROUNDS = 6


def chain(n: int) -> gr.Scene:
    """Return a chain of small random velocities, compressed between two walls."""
    v = np.random.default_rng(1).uniform(-1e-3, 1e-3, n)
    mass, radius, v[0], v[-1] = np.full(n, 1.0), np.full(n, 0.5), 0.0, 0.0
    mass[[0, -1]], radius[[0, -1]] = math.inf, 0.0
    return gr.Scene(mass, radius, np.full(n - 1, -1e-3), v)


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def bare(steps: int, k: float, xi: Any, v: Any, f: Any) -> None:
    """Symplectic Euler of equal Hertz balls and nothing else: no log, no counts, no bounds of validity."""
    n = len(v)
    for _ in range(steps):
        for c in range(n - 1):
            xi[c] += DT * (v[c] - v[c + 1])
            x = xi[c] if xi[c] > 0.0 else 0.0
            f[c] = k * x * math.sqrt(x)
        for c in range(n - 2):
            v[c + 1] += DT * (f[c] - f[c + 1])


def bare_speed(n: int, steps: int) -> float:
    """Ball-steps per second of the bare loop."""
    xi, v, f = np.full(n - 1, 1e-3), chain(n).velocity.copy(), np.zeros(n - 1)
    stamps = [time.process_time() for _ in range(ROUNDS) if bare(steps, 1e4, xi, v, f) is None]
    return n * steps / float(np.diff(stamps).min())


def speed(n: int, steps: int, law: Any, **options: Any) -> float:
    """Ball-steps per second of one run, which is looked at every so many steps."""
    stamps: list[float] = []
    fixed.CHUNK = steps
    options = {"engine": "compiled", "log": False, "dt": DT, "method": "verlet"} | options
    told = lambda _time, _contacts: stamps.append(time.process_time())  # noqa: E731
    gr.md.simulate(chain(n), law, t_end=ROUNDS * steps * DT, on_progress=told, **options)
    return n * steps / float(np.diff(stamps[:ROUNDS]).min())


def main() -> None:
    """Print the table."""
    for n in (1_000, 100_000):
        steps = 50_000_000 // n
        print(f"{n} balls: bare loop {bare_speed(n, steps):.3g}", flush=True)
        for law in (gr.Hertz(1e4), gr.LinearDashpot(100.0, 0.1), gr.ViscoelasticHertz(1e4, 0.1)):
            for method in ("verlet", "symplectic-euler"):
                print(f"  {type(law).__name__}, {method}: {speed(n, steps, law, method=method):.3g}", flush=True)
        for options in ({"log": True}, {"method": "rk4"}, {"method": "gear5"}):
            print(f"  Hertz, {options}: {speed(n, steps // 5, gr.Hertz(1e4), **options):.3g}", flush=True)


if __name__ == "__main__":
    main()
