"""Nanoseconds a contact: isolated soft contacts beside hard collisions of the same gas, and what a ball takes.

Usage: python bench/isolated_speed.py [what ...] [--most N] [--rounds R]; what: gas own share floor size set-up.
Hard and soft runs take turns and the least of some rounds counts, for others use the machine too.
"""

from __future__ import annotations

import argparse
import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import granular as gr

INF = math.inf


@dataclass(frozen=True)
class Own:
    """F = k ξ + k3 ξ³ + γ ξ̇, as a user writes it."""

    k: float
    k3: float
    gamma: float

    def force(self, xi: float, xi_dot: float, pair: gr.Pair) -> float:
        return self.k * xi + self.k3 * xi**3 + self.gamma * xi_dot


GOALS = {"spring": 2.0, "dashpot": 2.0, "Hertz": 2.5, "viscoelastic": 3.5}
LAWS: dict[str, tuple[Any, float]] = {
    "spring": (gr.LinearDashpot(1e10), 1.0), "dashpot": (gr.LinearDashpot(1e10, 60.0), 0.999),
    "Hertz": (gr.Hertz(1e12), 1.0), "viscoelastic": (gr.ViscoelasticHertz(1e12, 1e4), 0.999),
    "Tsuji": (gr.TsujiHertz(1e12, 1e-3), 0.999),
}


def gas(n: int, seed: int = 1, spread: bool = True) -> gr.Scene:
    """Balls about 1 m apart between two walls at some m/s: contacts of 1e-5 s are far apart."""
    rng = np.random.default_rng(seed)
    mass = np.concatenate([[INF], rng.uniform(0.5, 2.0, n) if spread else np.ones(n), [INF]])
    return gr.Scene(mass, np.zeros(n + 2), rng.exponential(1.0, n + 1), np.concatenate([[0], rng.normal(size=n), [0]]))


def timed(run: Callable[[int], Any], few: int, many: int) -> float:
    """Processor time in ns of a contact beyond the first `few`: set-up and compilation do not count."""
    spent = []
    for count in (few, many):
        start = time.process_time()
        run(count)
        spent.append(time.process_time() - start)
    return (spent[1] - spent[0]) / (many - few) * 1e9


def beside(runs: dict[str, Callable[[int], Any]], few: int, many: int, rounds: int) -> dict[str, float]:
    """The least of some rounds in which the runs take turns."""
    for run in runs.values():
        run(few)
    all_of = [{name: timed(run, few, many) for name, run in runs.items()} for _ in range(rounds)]
    return {name: min(one[name] for one in all_of) for name in runs}


def soft(scene: gr.Scene, law: Any, log: bool = True, engine: str = "compiled") -> Callable[[int], Any]:
    return lambda n: gr.md.simulate(scene, law, max_events=n, log=log, engine=engine)


def hard(scene: gr.Scene, eps: float, log: bool = True, engine: str = "compiled") -> Callable[[int], Any]:
    return lambda n: gr.edmd.simulate(scene, gr.ConstantRestitution(eps), max_events=n, log=log, engine=engine)


def dilute(most: int, rounds: int) -> None:
    """Compiled, every law beside compiled hard collisions of its own restitution."""
    for n in (10**e for e in range(2, 7)):
        if n > most:
            break
        few, many = max(2000, n // 2), max(102_000, n // 2 + 100_000)
        for name, (law, eps) in LAWS.items():
            scene = gas(n)
            for log in (True, False):
                ns = beside({"hard": hard(scene, eps, log), "soft": soft(scene, law, log)}, few, many, rounds)
                ratio = ns["soft"] / ns["hard"]
                goal = GOALS.get(name, INF)
                missed = "" if ratio <= goal else " MISSED"
                verdict = f"goal {goal}{missed}" if name in GOALS else ""
                print(f"N {n:8d} {name:13s} {'log' if log else '   '} hard {ns['hard']:6.0f} soft {ns['soft']:6.0f} ns"
                      f"  {ratio:5.2f} {verdict}", flush=True)


def own(most: int, rounds: int) -> None:
    """A user's law, interpreted beside interpreted hard collisions; tables are made on the way."""
    scene, law = gas(100, spread=False), Own(1e10, 1e16, 60.0)
    runs = {"hard": hard(scene, 0.999, engine="sorted"), "soft": soft(scene, law, engine="plain")}
    ns = beside(runs, 20_000, 40_000, 1)
    print(f"own law, interpreted: hard {ns['hard']:.0f} soft {ns['soft']:.0f} ns  {ns['soft'] / ns['hard']:.2f}")


def share(most: int, rounds: int) -> None:
    """Over t_c × rate: share that is isolated, and time; run it at another commit for the column beside it."""
    for name, make, low in (("spring", gr.LinearDashpot, 1), ("Hertz", gr.Hertz, 3)):
        for decade in range(10, low - 1, -1):
            scene, law = gas(300), make(10.0**decade)
            few, many = (500, 6000) if name == "spring" else (200, 1500)
            ns = beside({"soft": soft(scene, law, False)}, few, many, rounds)["soft"]
            run = gr.md.simulate(scene, law, max_events=many, engine="compiled")
            begun = len(run.contacts)
            rate = np.nanmedian(run.contacts["duration"]) * 2.0 * begun / (scene.n_pairs * run.time[-1])
            print(f"{name} 1e{decade:<2d} t_c rate {rate:8.2e} isolated {run.stats.get('isolated', 0) / begun:6.1%}"
                  f"  {ns:8.0f} ns", flush=True)


def floor(most: int, rounds: int) -> None:
    """A ball that bounces, and a column that falls."""
    ball = gr.Scene([INF, 1.0], [0.0, 0.1], [0.5], [0.0, 0.0], 9.81)
    column = gr.Scene([INF] + [1.0] * 10, np.zeros(11), [0.1] * 10, np.zeros(11), 9.81)
    for scene, title in ((ball, "ball"), (column, "column of 10")):
        for name in ("spring", "Hertz"):
            law = LAWS[name][0]
            ns = beside({"hard": hard(scene, 1.0), "soft": soft(scene, law)}, 2000, 42_000, rounds)
            ratio = ns["soft"] / ns["hard"]
            print(f"{title:13s} {name:8s} hard {ns['hard']:5.0f} soft {ns['soft']:6.0f} ns  {ratio:.2f}", flush=True)


def size(most: int, rounds: int) -> None:
    """Bytes a ball: the peak of a run, its scene apart."""
    scene, law = gas(min(most, 100_000)), LAWS["spring"][0]
    soft(scene, law, False)(100)
    tracemalloc.start()
    soft(scene, law, False)(1000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    print(f"N {scene.n - 2}: {peak / scene.n:.0f} B a ball (goal 300)")


def set_up(most: int, rounds: int) -> None:
    """µs a ball of a run of one contact."""
    scene, law = gas(most), LAWS["spring"][0]
    ns = []
    for _ in range(rounds + 1):
        start = time.process_time()
        soft(scene, law, False)(1)
        ns.append(time.process_time() - start)
    print(f"N {most}: {min(ns) / most * 1e6:.2f} µs a ball of set-up (goal 2)")


ALL = {"gas": dilute, "own": own, "share": share, "floor": floor, "size": size, "set-up": set_up}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="*", choices=list(ALL), default=list(ALL))
    parser.add_argument("--most", type=int, default=1_000_000, help="balls")
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    for what in asked.what:
        ALL[what](asked.most, asked.rounds)
