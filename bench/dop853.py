"""Compiled DOP853 for chains of balls, compared with the located method.

    python bench/dop853.py

DOP853 is an explicit Runge–Kutta method of order 8 with error estimates of order 5 and 3 (Hairer, Nørsett & Wanner
1993, II.5). The coefficients are scipy's, the step-size controller is the usual one, and numba compiles the loop. It
has no event location: steps cross onsets and ends of contacts, which reduces the order and the step size. Such a loop
is the first implementation that most people would write.

For each tolerance the table lists errors of the final velocities in units of the initial speed, relative to the located
method at 1e-16. Times are processor times in µs, minima of interleaved rounds. The peer, DOP853, is a bare function.
The public call is timed for the located method. "beyond" is its excess over a call that ends after a thousandth of the
time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as table

import granular as gr

STAGE_COUNT = table.N_STAGES
A, B = np.ascontiguousarray(table.A[:STAGE_COUNT, :STAGE_COUNT]), np.ascontiguousarray(table.B)
FIFTH_ORDER_ERROR, THIRD_ORDER_ERROR = np.ascontiguousarray(table.E5), np.ascontiguousarray(table.E3)
SAFETY_FACTOR, MIN_STEP_FACTOR, MAX_STEP_FACTOR = 0.9, 0.2, 10.0
TIMING_ROUNDS = 15


@numba.njit(error_model="numpy")
def rates(y: np.ndarray, k: float, gamma: float, p: float, inverse: np.ndarray, out: np.ndarray) -> None:
    """Write the time derivatives of gaps and velocities into `out`.

    The force of a pair is F = k ξ^p + γ ξ̇, clipped at 0.
    """
    n = len(inverse)
    below = 0.0
    for i in range(n):
        force = 0.0
        if i < n - 1:
            xi, rate = -y[i], y[n - 1 + i] - y[n + i]
            out[i] = -rate
            if xi > 0.0:
                bent = xi * math.sqrt(xi) if p == 1.5 else xi
                force = max(0.0, k * bent + gamma * rate)
        out[n - 1 + i] = inverse[i] * (below - force)
        below = force


@numba.njit(error_model="numpy")
def solve(
    y: np.ndarray, end: float, tol: float, least: float, k: float, gamma: float, p: float, inverse: np.ndarray
) -> int:
    """Advance gaps and velocities `y` in place to the time `end`.

    Errors of values smaller than `least` are absolute. Return the number of evaluations of `rates`.
    """
    m = len(y)
    stage, trial, now, evaluations = np.zeros((STAGE_COUNT + 1, m)), np.zeros(m), 0.0, 1
    h = 1e-6 * end  # a short first step, which the controller lengthens
    rates(y, k, gamma, p, inverse, stage[0])
    while now < end:
        h = min(h, end - now)
        for s in range(1, STAGE_COUNT):
            for i in range(m):
                total = 0.0
                for j in range(s):
                    total += A[s, j] * stage[j, i]
                trial[i] = y[i] + h * total
            rates(trial, k, gamma, p, inverse, stage[s])
        for i in range(m):
            total = 0.0
            for j in range(STAGE_COUNT):
                total += B[j] * stage[j, i]
            trial[i] = y[i] + h * total
        rates(trial, k, gamma, p, inverse, stage[STAGE_COUNT])
        evaluations += STAGE_COUNT
        fifth, third = 0.0, 0.0
        for i in range(m):
            scale = tol * (least + max(abs(y[i]), abs(trial[i])))
            e5, e3 = 0.0, 0.0
            for j in range(STAGE_COUNT + 1):
                e5 += FIFTH_ORDER_ERROR[j] * stage[j, i]
                e3 += THIRD_ORDER_ERROR[j] * stage[j, i]
            fifth, third = fifth + (e5 / scale) ** 2, third + (e3 / scale) ** 2
        error = 0.0
        if fifth > 0.0:
            error = h * fifth / math.sqrt((fifth + 0.01 * third) * m)  # Hairer's blend of both estimates
        factor = MAX_STEP_FACTOR
        if error > 0.0:
            factor = min(MAX_STEP_FACTOR, max(MIN_STEP_FACTOR, SAFETY_FACTOR * error ** -0.125))  # order 8
        if error <= 1.0:
            now += h
            for i in range(m):
                y[i], stage[0, i] = trial[i], stage[STAGE_COUNT, i]
        else:
            factor = min(1.0, factor)  # a rejected step must not grow
        h *= factor
    return evaluations


def dop853(scene: gr.Scene, law: Any, end: float, tol: float) -> np.ndarray:
    """Final velocities of balls without gravity, computed by the compiled DOP853."""
    gamma, p = (0.0, 1.5) if isinstance(law, gr.Hertz) else (law.gamma, 1.0)
    y = np.concatenate([scene.gap, scene.velocity])
    solve(y, end, tol, 1e-3 * float(np.abs(scene.velocity).max()), law.k, gamma, p, 1.0 / scene.mass)
    return y[scene.n - 1 :]


def located(scene: gr.Scene, law: Any, end: float, tol: float) -> np.ndarray:
    """Final velocities of the same balls, computed by the located method."""
    run = gr.md.simulate(scene, law, t_end=end, tol=max(tol, 1e-16), engine="compiled", log=False)
    return np.asarray(run.velocity[-1])


def cpu_microseconds(work: Callable[[], Any]) -> float:
    """Processor time of one call in µs."""
    begin = time.process_time_ns()
    work()
    return (time.process_time_ns() - begin) / 1e3


def main() -> None:
    """Print the table."""
    scenes = {
        "20 touching Hertz balls": (20, gr.Hertz(1e8), 2e-3), "5 touching Hertz balls": (5, gr.Hertz(1e8), 1e-3),
        "5 touching dashpot balls": (5, gr.LinearDashpot(1e7, 30.0), 3e-3),
    }
    print(f"{'':26}{'tol':>8}{'located: error':>16}{'µs':>8}{'beyond':>8}{'DOP853: error':>16}{'µs':>8}")
    for name, (n, law, end) in scenes.items():
        scene = gr.Scene([0.1] * n, [0.01] * n, [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))
        exact = located(scene, law, end, 1e-16)
        for tol in (1e-3, 1e-6, 1e-9, 1e-12):
            works = [partial(method, scene, law, until, tol)
                     for method, until in ((located, end), (dop853, end), (located, 1e-3 * end))]
            rounds = ([cpu_microseconds(work) for work in works] for _ in range(TIMING_ROUNDS))
            ours, peer, call = map(min, zip(*rounds, strict=True))
            error, peer_error = (np.abs(work() - exact).max() for work in works[:2])
            print(f"{name:26}{tol:8.0e}{error:16.1e}{ours:8.0f}{ours - call:8.0f}{peer_error:16.1e}{peer:8.0f}",
                  flush=True)


if __name__ == "__main__":
    main()
