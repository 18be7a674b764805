"""Run times of this tree, divided by the run times of another commit.

`python bench/paired.py REF` runs the same scenes through the public functions of both trees. Each tree has its own
process, which stays alive. Rounds alternate between the two processes. The table shows the minimum time of each tree
and the ratio of this tree to REF. Kernels are compiled before the measurement.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from same_bits import REPO_ROOT, unpacked_tree

import granular as gr

TIMING_ROUNDS = 9
SCHEDULE_MODULES = ("granular.studies.sweeps.schedule", "granular.sweeps.schedule")
"""Modules that define the limits of sweeps, by version.

A tree without any of these modules cannot be timed.
"""
SCHEDULE_LIMITS = (("LOADING_SECONDS", "LOADING"), ("COMPILING_SECONDS", "MAKING"))
"""Names of the limits in these modules, by version."""
Workload = Callable[[], Any]


def gas(n: int, walls: bool = True) -> gr.Scene:
    """Unequal balls with random gaps, between walls by default."""
    rng = np.random.default_rng(n)
    end = [math.inf] if walls else []
    mass = [*end, *rng.uniform(0.5, 2.0, n), *end]
    inside = np.isfinite(mass)
    return gr.Scene(mass, 0.005 * inside, rng.uniform(0.001, 0.1, len(mass) - 1), rng.normal(size=len(mass)) * inside)


def stacked(n: int, gap: float = 0.0) -> gr.Scene:
    """Balls that fall on a floor at 1 m/s."""
    return gr.Scene([math.inf, *[1.0] * n], [0.0, *[0.05] * n], [0.0, *[gap] * (n - 1)], [0.0, *[-1.0] * n], 9.81)


def row(n: int) -> gr.Scene:
    """Touching balls, the first of which moves."""
    return gr.Scene([1.0] * n, [0.05] * n, [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))


def repeated(work: Workload, times: int = 30) -> Workload:
    """Workload that repeats a short workload `times` times."""
    return lambda: [work() for _ in range(times)]


def module_path(name: str) -> Path:
    """File of a module of the package."""
    return Path(str(gr.__file__)).parent.parent.joinpath(*name.split(".")).with_suffix(".py")


def remove_sweep_limits() -> None:
    """Let sweeps solve many cells per compiled call, even if they must be compiled."""
    name = next(name for name in SCHEDULE_MODULES if module_path(name).exists())
    schedule: Any = import_module(name)
    for names in SCHEDULE_LIMITS:
        # `next` raises if a tree has no limit, so that limits are never removed in one tree only
        setattr(schedule, next(name for name in names if hasattr(schedule, name)), 0.0)


def call_workloads() -> dict[str, Workload]:
    """Base scene, 30 calls per run, and maps of it with 25 and 900 cells."""
    remove_sweep_limits()
    scene, end = gr.scenes.three_balls(gap=1e-4), gr.until.contact(0, 2)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    rule = gr.ConstantRestitution(0.7)
    over = {"restitution": np.linspace(0.5, 1.0, 30), "gap": np.geomspace(1e-5, 1e-3, 30)}
    few = {name: values[::6] for name, values in over.items()}
    soft, hard = gr.md.simulate, gr.edmd.simulate
    return {
        "30 calls, located, compiled": repeated(lambda: soft(scene, law, until=end, engine="compiled")),
        "30 calls, located, new scenes": repeated(lambda: soft(
            gr.scenes.three_balls(gap=1e-4), law, until=end, engine="compiled")),
        "30 calls, located, interpreted": repeated(lambda: soft(scene, law, until=end, engine="plain")),
        "30 calls, hard, sorted": repeated(lambda: hard(scene, rule, until=end, engine="sorted")),
        "30 calls, hard, compiled": repeated(lambda: hard(scene, rule, until=end, engine="compiled")),
        "30 calls, compare": repeated(lambda: gr.compare(scene, law, until=end)),
        "map of 900, dashpot": lambda: gr.sweep("three-balls", over, "eps_ratio"),
        "map of 900, viscoelastic": lambda: gr.sweep("three-balls", over, "eps_ratio", law="ViscoelasticHertz"),
        "map of 900, Tsuji": lambda: gr.sweep("three-balls", over, "eps_ratio", law="TsujiHertz"),
        "map of 25, error": lambda: gr.sweep("three-balls", few, "error"),
    }


def workloads() -> dict[str, Workload]:
    """All workloads by name."""
    hard, soft = gr.edmd.simulate, gr.md.simulate
    elastic, lossy = gr.ConstantRestitution(1.0), gr.ConstantRestitution(0.9)
    dashpot, hertz, damped = gr.LinearDashpot(1e7, 30.0), gr.Hertz(1e8), gr.ViscoelasticHertz(1e8, 1e3)
    few, many, most, three = gas(10), gas(1000), gas(100_000), stacked(2, 1e-4)
    fast: dict[str, Any] = {"engine": "compiled"}
    over = {"restitution": np.linspace(0.5, 1.0, 30), "gap": np.geomspace(1e-5, 1e-3, 30)}
    steps: dict[str, Any] = {"method": "verlet", "dt": 1e-6, "t_end": 2e-3, "engine": "compiled"}
    return call_workloads() | {
        "hard, 10 balls, interpreted": lambda: hard(few, elastic, max_events=1000, engine="sorted"),
        "hard, 1 000 balls": lambda: hard(many, elastic, max_events=50_000, log=False, **fast),
        "hard, 1 000 balls, log": lambda: hard(many, elastic, max_events=50_000, **fast),
        "hard, 100 000 balls": lambda: hard(most, elastic, max_events=200_000, log=False, **fast),
        "hard, column that collapses": lambda: hard(stacked(30), lossy, max_events=50_000, **fast),
        "located, 3 balls, interpreted": lambda: soft(three, dashpot, t_end=0.01, engine="plain"),
        "located, 3 balls": lambda: soft(three, dashpot, t_end=0.01, **fast),
        "located, row of 50, Hertz": lambda: soft(row(50), hertz, t_end=0.02, **fast),
        "located, row of 50, dashpot": lambda: soft(row(50), dashpot, t_end=0.02, **fast),
        "located, column of 12, viscoelastic": lambda: soft(stacked(12), damped, t_end=0.05, **fast),
        "located, 1 000 balls, dashpot": lambda: soft(many, dashpot, t_end=0.2, **fast),
        "located, 1 000 balls, Hertz": lambda: soft(many, hertz, t_end=0.05, **fast),
        "located, 100 000 balls, dashpot": lambda: soft(most, dashpot, t_end=1e-3, log=False, **fast),
        "fixed, 1 000 balls, log": lambda: soft(many, hertz, **steps),
        "fixed, 1 000 balls": lambda: soft(many, hertz, log=False, **steps),
        "fixed, 1 000 balls, damped": lambda: soft(many, dashpot, log=False, **steps),
        "fixed, 10 balls, interpreted": lambda: soft(few, hertz, **steps | {"engine": "plain", "t_end": 1e-3}),
        "compare, 2 000 balls": lambda: gr.compare(gas(2000), dashpot, t_end=0.02),
        "sweep, 900 cells": lambda: gr.sweep("three-balls", over, "eps_ratio"),
    }


def serve_workloads() -> None:
    """Read names of workloads from stdin, run them and print their times in s."""
    known = workloads()
    for line in sys.stdin:
        work = known[line.strip()]
        begin = time.process_time()
        try:
            work()
            print(time.process_time() - begin, flush=True)
        except Exception as error:  # REF may lack the feature
            print(f"nan {error!r}".replace("\n", " "), flush=True)


def start_server(tree: Path) -> subprocess.Popen[str]:
    """Start a process that runs workloads with the package of a tree."""
    paths = {"PYTHONPATH": os.pathsep.join([str(tree), str(REPO_ROOT / "bench")]), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, __file__, "--serve"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                            text=True, env=os.environ | paths, cwd=tree)


def time_workload(process: subprocess.Popen[str], name: str) -> float:
    """Processor time of one run in s, or nan if the tree cannot run it."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(name + "\n")
    process.stdin.flush()
    return float(process.stdout.readline().split()[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ref", nargs="?", help="commit to compare with this tree")
    parser.add_argument("--only", default="", help="run only workloads whose names contain this text")
    parser.add_argument("--rounds", type=int, default=TIMING_ROUNDS, help="rounds per workload [%(default)s]")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        return serve_workloads()
    here, there = start_server(REPO_ROOT), start_server(unpacked_tree(given.ref))
    print(f"{'':38}{given.ref[:10]:>12}{'this tree':>12}{'ratio':>8}")
    for name in (one for one in workloads() if given.only in one):
        time_workload(there, name), time_workload(here, name)  # the first call compiles
        times = [(time_workload(there, name), time_workload(here, name)) for _ in range(given.rounds)]
        before, now = map(min, zip(*times, strict=True))
        print(f"{name:38}{1e3 * before:9.2f} ms{1e3 * now:9.2f} ms{now / before:8.2f}", flush=True)


if __name__ == "__main__":
    main()
