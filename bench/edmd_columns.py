"""Columns falling on a floor: time to detect a collapse, and runs with a remedy."""

from __future__ import annotations

import math
import time

import numpy as np

import granular as gr

RESTITUTION_RULE = gr.ConstantRestitution(0.9)


def column(n: int) -> gr.Scene:
    """Column of `n` balls dropped from rest at random distances, g = 1 m/s²."""
    gap = np.random.default_rng(1).uniform(0.5, 1.5, n)
    return gr.Scene([math.inf] + [1.0] * n, [0.0] * (n + 1), gap, [0.0] * (n + 1), gravity=1.0)


def print_run(name: str, n: int, **options: object) -> None:
    """Run a column and print its final message and the elapsed time."""
    begin = time.perf_counter()
    run = gr.edmd.simulate(column(n), RESTITUTION_RULE, log=False, **options)  # type: ignore[arg-type]
    print(f"{name}, N = {n}: {time.perf_counter() - begin:.2f} s, {run.stats['engine']}: {run.message}", flush=True)


def main() -> None:
    """Print all lines."""
    for n in (100, 1000, 10_000, 100_000):
        print_run("collapse='stop'", n)
    for n in (100, 1000):
        print_run("collapse='merge'", n, collapse="merge", t_end=60.0, max_events=10**8)
    print_run("tc=1e-2", 1000, tc=1e-2, t_end=60.0, max_events=10**8)
    print_run("tc=1e-2, second run", 1000, tc=1e-2, t_end=60.0, max_events=10**8)


if __name__ == "__main__":
    main()
