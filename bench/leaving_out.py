"""Cost of features: the same run with and without a feature, interleaved.

`python bench/leaving_out.py [ROUNDS]` prints a table of processor times per run, each the minimum of all rounds.
`test_leaving_out.py` passes the same pairs of runs to pytest-benchmark.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import granular as gr

Run = Callable[[], object]
BALL_COUNT, TIME_STEP = 1000, 1e-3


def ignore_event(_row: object) -> None:
    """Ignore an event."""


def compressed_chain(gravity: float = 0.0, floor: bool = False) -> gr.Scene:
    """Chain whose contacts stay closed."""
    random = np.random.default_rng(1)
    mass, radius, speed = np.ones(BALL_COUNT), np.full(BALL_COUNT, 0.5), random.uniform(-1e-3, 1e-3, BALL_COUNT)
    if floor:
        mass[0], radius[0], speed[0] = math.inf, 0.0, 0.0
    return gr.Scene(mass, radius, np.full(BALL_COUNT - 1, -1e-3), speed, gravity)


def gas(n: int, gravity: float = 0.0, walls: bool = True) -> gr.Scene:
    """Equal balls between two walls, or between two balls of 1e9 kg."""
    random = np.random.default_rng(n)
    end = [math.inf] if walls else [1e9]
    v = [0.0, *random.normal(size=n), 0.0]
    return gr.Scene([*end, *np.ones(n), *end], np.zeros(n + 2), random.exponential(1.0, n + 1), v, gravity)


def fixed_step_pairs() -> Iterator[tuple[str, Run, Run]]:
    """Compiled Verlet runs of 1000 balls and 10 000 steps with all contacts closed."""
    go = partial(gr.md.simulate, t_end=10_000 * TIME_STEP, dt=TIME_STEP, engine="compiled", log=False)
    hertz, scene = gr.Hertz(1e4), compressed_chain()
    bare = partial(go, scene, hertz)
    yield "gravity", bare, partial(go, compressed_chain(gravity=1e-6), hertz)
    yield "floor", bare, partial(go, compressed_chain(floor=True), hertz)
    yield "damping", bare, partial(go, scene, gr.ViscoelasticHertz(1e4, 0.1))
    yield "law not of the form √ξ(kξ+γξ')", bare, partial(go, scene, gr.TsujiHertz(1e4, 0.1))
    yield "memory", bare, partial(go, scene, gr.WaltonBraun(1e2, 2e2))
    yield "log", bare, partial(go, scene, hertz, log=True)
    yield "samples (20)", bare, partial(go, scene, hertz, samples=20)
    yield "on_event", bare, partial(go, scene, hertz, on_event=ignore_event)


def located_pairs() -> Iterator[tuple[str, Run, Run]]:
    """Compiled located runs of a soft gas of 100 balls, with about 1600 contacts."""
    go = partial(gr.md.simulate, t_end=30.0, engine="compiled", log=False)
    spring, scene = gr.LinearDashpot(1e6, 0.0), gas(100)
    bare = partial(go, scene, spring)
    yield "gravity", bare, partial(go, gas(100, gravity=1e-6), spring)
    yield "walls", partial(go, gas(100, walls=False), spring), bare
    yield "damping", bare, partial(go, scene, gr.LinearDashpot(1e6, 1e-6))
    yield "exponent 3/2", bare, partial(go, scene, gr.Hertz(1e7))
    yield "log", bare, partial(go, scene, spring, log=True)
    yield "samples (100)", bare, partial(go, scene, spring, samples=100)
    yield "on_event", bare, partial(go, scene, spring, on_event=ignore_event)


def edmd_pairs() -> Iterator[tuple[str, Run, Run]]:
    """Compiled hard-sphere runs of a gas of 1000 balls, with 20 000 collisions."""
    go = partial(gr.edmd.simulate, max_events=20_000, engine="compiled", log=False)
    elastic, scene = gr.ConstantRestitution(1.0), gas(BALL_COUNT)
    bare = partial(go, scene, elastic)
    yield "gravity", bare, partial(go, gas(BALL_COUNT, gravity=1e-6), elastic)
    yield "walls", partial(go, gas(BALL_COUNT, walls=False), elastic), bare
    yield "dissipation", bare, partial(go, scene, gr.ConstantRestitution(1.0 - 2.0**-40))
    yield "log", bare, partial(go, scene, elastic, log=True)
    yield "on_event", bare, partial(go, scene, elastic, on_event=ignore_event)


ENGINE_PAIRS = {"fixed": fixed_step_pairs, "located": located_pairs, "edmd": edmd_pairs}
RUN_PAIRS = {f"{engine}: {feature}": (without, with_it)
             for engine, pairs in ENGINE_PAIRS.items() for feature, without, with_it in pairs()}
"""Runs without and with a feature, by engine and feature."""


def main(rounds: int = 7) -> None:
    """Print the table."""
    print("| feature | without, ms | with, ms | ratio |\n|---|---|---|---|")
    for name, pair in RUN_PAIRS.items():
        times: list[list[float]] = [[], []]
        for turn in range(rounds + 1):
            for run, seconds in zip(pair, times, strict=True):
                begin = time.process_time()
                run()
                if turn:  # the first round compiles
                    seconds.append(time.process_time() - begin)
        without, with_it = (1e3 * min(seconds) for seconds in times)
        print(f"| {name} | {without:.2f} | {with_it:.2f} | {with_it / without:.2f} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
