"""Times of the event-located engine in its compiled batch entry, beside scipy's DOP853 with events on one scene.

Run as a script: ``python bench/located_speed.py``. CPU time per solve, the least of several rounds.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from granular import until
from granular.laws import LinearDashpot
from granular.md import simulate as run
from granular.md.located import Scenes, solve_many
from granular.scene import Scene

M1, M2, SPEED = 3.7699111843077517, 0.0037699111843077517, 3.132091952673165
ROUNDS = 7


def least(solves: int, work: Any) -> float:
    """CPU time in µs per solve."""
    work()
    times = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return 1e6 * min(times) / solves


def three_balls(law: list[list[float]], solves: int, tol: float = 1e-16, m2: float = M2, speed: float = SPEED) -> float:
    """Floor and two balls, to the second floor contact."""
    gap = np.column_stack([np.zeros(solves), np.full(solves, 1e-4)])
    scenes = Scenes([math.inf, M1, m2], gap, [0.0, -speed, -speed], law, 9.81)
    return least(solves, lambda: solve_many(scenes, until=until.contact(0, 2), tol=tol, leave_piles=False))


def dashpot(eps: float) -> list[list[float]]:
    scene = Scene([math.inf, M1, M2], [0.0, 0.1, 0.01], [0.0, 1e-4], [0.0, 0.0, 0.0])
    laws = [LinearDashpot.from_restitution(eps, 5e7, pair) for pair in scene.pairs]
    return [[law.k, 1.0, law.gamma, 0.0] for law in laws]


def hertz_chain(n: int, solves: int, tol: float) -> float:
    """A touching chain of n equal balls, the first at speed 1, until the last has left."""
    scenes = Scenes([1.0] * n, np.zeros((solves, n - 1)), [1.0] + [0.0] * (n - 1), [[1.0, 1.5, 0.0, 0.0]] * (n - 1))
    return least(solves, lambda: solve_many(scenes, t_end=1.3 * n, tol=tol, leave_piles=False))


def interpreted(eps: float) -> float:
    scene = Scene([math.inf, M1, M2], [0.0, 0.1, 0.01], [0.0, 1e-4], [0.0, -SPEED, -SPEED], 9.81)
    laws = tuple(LinearDashpot.from_restitution(eps, 5e7, pair) for pair in scene.pairs)
    return least(1, lambda: run(scene, laws, until=until.contact(0, 2), engine="plain"))


def dop853(eps: float) -> float:
    """The same scene by an integrator with event functions, restarted at every event."""
    from scipy.integrate import solve_ivp

    k, gamma = np.array(dashpot(eps))[:, [0, 2]].T

    def force(y: Any) -> Any:
        return [max(0.0, k[c] * y[c] + gamma[c] * y[2 + c]) if y[c] > 0.0 else 0.0 for c in (0, 1)]

    def rates(t: float, y: Any) -> list[float]:
        f = force(y)
        return [y[2], y[3], 9.81 + (f[1] - f[0]) / M1, f[0] / M1 - (1 / M1 + 1 / M2) * f[1]]

    functions = [lambda t, y, c=c: y[c] for c in (0, 1)]
    functions += [lambda t, y, c=c: k[c] * y[c] + gamma[c] * y[2 + c] for c in (0, 1)]
    for function in functions:
        function.terminal = True  # type: ignore[attr-defined]

    def solve() -> None:
        t, y = 0.0, np.array([1e-300, -1e-4, SPEED, 0.0])
        while t < 1e-3:
            step = solve_ivp(rates, (t, 1e-3), y, method="DOP853", rtol=1e-12, atol=1e-16, events=functions)
            t, y = step.t[-1] + 1e-15, step.y[:, -1] + 1e-15 * np.array(rates(t, step.y[:, -1]))

    return least(1, solve)


def main() -> None:
    visco = [[13217461.484507333, 1.5, 5000.0, 0.5], [2064220.6826532697, 1.5, 15.0, 0.5]]
    table = {
        "three balls, dashpot, eps = 0.7": three_balls(dashpot(0.7), 10_000),
        "three balls, spring": three_balls(dashpot(1.0), 10_000),
        "three balls, viscoelastic, error 5e-13": three_balls(visco, 1_000, 1e-14, 5.890486225480862e-05, 3.0),
        "20 touching Hertz balls, error 1e-13": hertz_chain(20, 20, 1e-14),
        "three balls, dashpot, interpreted": interpreted(0.7),
        "three balls, dashpot, scipy DOP853 with events": dop853(0.7),
    }
    for name, value in table.items():
        print(f"{name:50s} {value:12.1f} µs")


if __name__ == "__main__":
    main()
