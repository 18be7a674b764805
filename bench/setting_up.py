"""What it takes to set up a large gas: ``python bench/setting_up.py [N]``.

Seconds of the processor (the least of three runs of one event) and bytes a ball (the most that Python and numpy hold
at a time, the scene apart) of hard spheres and of the located method, machine code being loaded.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections.abc import Callable

import granular as gr

ELASTIC, SPRING = gr.ConstantRestitution(1.0), gr.LinearDashpot(1e6)
RUNS: dict[str, Callable[[gr.Scene], gr.Trajectory]] = {
    "hard": lambda scene: gr.edmd.simulate(scene, ELASTIC, max_events=1, log=False),
    "located": lambda scene: gr.md.simulate(scene, SPRING, max_events=1, log=False, engine="compiled"),
}


def seconds(run: Callable[[gr.Scene], gr.Trajectory], n: int) -> float:
    """Seconds of the processor."""
    scene = gr.scenes.gas(n, float(n), seed=1)
    begin = time.process_time()
    run(scene)
    return time.process_time() - begin


def size(run: Callable[[gr.Scene], gr.Trajectory], n: int) -> float:
    """Bytes a ball."""
    scene = gr.scenes.gas(n, float(n), seed=1)
    tracemalloc.start()
    run(scene)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / n


def main() -> None:
    """Print a line for each."""
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000
    for name, run in RUNS.items():
        run(gr.scenes.gas(200_000, 2e5, seed=1))
        print(f"{name:32} {n} balls: {min(seconds(run, n) for _ in range(3)):.2f} s, {size(run, n):.0f} B a ball")


if __name__ == "__main__":
    main()
