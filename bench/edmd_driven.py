"""Nanoseconds an event of hard spheres beside a shaken floor, under forces, and on a floor at rest, in one run.

Each scene runs in turns with the others; the least time of each counts, and its ratio to the plain column. The
remainder of the account is that of its last run, in units of the work done.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import granular as gr

EVENTS, ROUNDS = 100_000, 5


def column(n: int, gap: float = 1.0, **more: Any) -> gr.Scene:
    """Balls above a floor, with g = 1 m/s²."""
    velocity = np.r_[0.0, np.random.default_rng(n).normal(size=n) * math.sqrt(gap)]
    return gr.Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), [gap] * n, velocity, 1.0, **more)


def shaken(gamma: float) -> gr.walls.Sine:
    """A floor with ω = 1/s."""
    return gr.walls.Sine.from_acceleration(gamma, 0.5 / math.pi, 1.0)


def scenes() -> dict[str, tuple[gr.Scene, float]]:
    """What is timed, by name: scene and restitution."""
    lifted = np.r_[0.0, np.linspace(-0.1, 0.1, 10)]
    resting = column(10, 200.0)
    moving = resting.replace(velocity=np.r_[0.01, resting.velocity[1:]])
    return {
        "10 balls, floor at rest": (resting, 1.0),
        "10 balls, forces": (column(10, 200.0, external_force=lifted), 1.0),
        "10 balls, floor at constant speed": (moving, 1.0),
        "10 balls, shaken, fluid": (column(10, 200.0, floor=shaken(20.0)), 0.98),
        "10 balls, shaken, condensed": (column(10, floor=shaken(3.0)), 0.8),
        "1 ball, floor at rest": (column(1), 1.0),
        "1 ball, shaken": (column(1, floor=shaken(20.0)), 0.9),
        "1 ball, shaken, elastic": (column(1, floor=shaken(20.0)), 1.0),
        "1000 balls, floor at rest": (column(1000), 1.0),
        "1000 balls, shaken": (column(1000, floor=shaken(20.0)), 0.9998),
    }


def timed(scene: gr.Scene, eps: float) -> tuple[float, float]:
    """Nanoseconds an event, and the remainder of the account."""
    merging = {} if eps == 1.0 else {"collapse": "merge", "merge_below": 1e-3}
    begin = time.perf_counter()
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), engine="compiled", t_end=1e15, max_events=EVENTS,
                           log=False, **merging)
    took = time.perf_counter() - begin
    account = run.account()
    rest = np.ptp(account["energy"] - account["work"].sum(axis=1) + account["dissipated"])
    return 1e9 * took / run.stats["events"], float(rest / max(np.abs(account["work"]).max(), account["energy"].max()))


def main() -> None:
    """Print the table."""
    least = dict.fromkeys(scenes(), (math.inf, 0.0))
    for _ in range(ROUNDS):
        for name, (scene, eps) in scenes().items():
            least[name] = min(least[name], timed(scene, eps))
    print(f"{'scene':36}{'ns an event':>12}{'ratio':>8}{'remainder':>12}")
    plain = math.nan
    for name, (took, rest) in least.items():
        plain = took if name.endswith("rest") else plain
        print(f"{name:36}{took:12.0f}{took / plain:8.2f}{rest:12.1e}")


if __name__ == "__main__":
    main()
