"""Processor time per collision over the number of balls, and cost of features.

`python bench/edmd_scaling.py` writes docs/figures/edmd-scaling.png and prints the tables for both queues, blocks and
minimal loops. Each number is the minimum of several interleaved runs, so that other load on the machine affects all of
them equally. With ``plot`` it measures only the numbers of the figure, with ``redraw`` it measures nothing.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from edmd_peers import bare_sorted, bare_tree

import granular as gr
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, HARD_COLOUR, canvas, style
from granular.edmd import compiled_queue as blocks

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "edmd-scaling.png"
DATA_PATH = FIGURE_PATH.parent / "data" / "edmd-scaling.json"
ELASTIC_RULE = gr.ConstantRestitution(1.0)
Timer = Callable[[float], tuple[int, float]]
"""Function that runs to a time and returns collisions and processor time in s."""
LARGE = blocks.BLOCKS_ABOVE


def gas(n: int, gravity: float = 0.0, walls: bool = True) -> gr.Scene:
    """`n` equal balls in equilibrium, between walls or between balls of 1e9 kg."""
    random = np.random.default_rng(n)
    end = [math.inf] if walls else [1e9]
    v = [0.0, *random.normal(size=n), 0.0]
    return gr.Scene([*end, *np.ones(n), *end], np.zeros(n + 2), random.exponential(1.0, n + 1), v, gravity)


def engine_timer(
    scene: gr.Scene, name: str, rule: object = ELASTIC_RULE, one: bool = False, **options: object
) -> Timer:
    """Timer of an engine that starts from a warm state.

    `one` forces a single block of balls.
    """
    physics = {k: v for k, v in options.items() if k in ("tc", "collapse", "merge_below", "ties")}
    more = {k: v for k, v in options.items() if k not in physics}
    start = gr.edmd.simulate(scene, rule, engine=name, max_events=1, log=False, **physics)  # type: ignore[arg-type]

    def timed(t_end: float) -> tuple[int, float]:
        blocks.BLOCKS_ABOVE = 1 << 60 if one else LARGE
        stamps = [(0, time.process_time())]
        callbacks = {"on_progress": lambda _, events: stamps.append((events, time.process_time()))}
        if not one and name != "sorted":  # the set-up of a million balls takes longer than the measurement
            callbacks = {}
        run = gr.edmd.resume(start, engine=name, t_end=t_end, max_events=1 << 60, **{"log": False, **more, **callbacks})
        stamps.append((run.stats["events"], time.process_time()))
        (first, begin), (last, end) = stamps[1 : -1 : len(stamps) - 3] if callbacks else stamps
        return last - first, end - begin

    return timed


def bare_loop_timer(scene: gr.Scene, loop: Callable[..., float]) -> Timer:
    """Timer of a bare loop.

    The end time is converted to the expected number of collisions.
    """

    def timed(t_end: float) -> tuple[int, float]:
        events = int(t_end * len(scene.gap) / math.sqrt(math.pi))  # collision rate of the gas in equilibrium
        gap, u = scene.gap.copy(), scene.velocity.copy()
        low = np.full(len(gap), 0.5)
        low[[0, -1]] = 0.0, 1.0
        arrays = (gap, u, low, 1.0 - low)
        arguments = [a.tolist() for a in arrays] if loop is bare_sorted else arrays
        begin = time.process_time()
        loop(*arguments, events)
        return events, time.process_time() - begin

    return timed


def collision_costs(timers: dict[str, Timer], events: dict[str, float], n: int, turns: int = 5) -> dict[str, float]:
    """Processor time in ns per collision of each timer.

    The cost is the increase when the length of a run is doubled, from minima over several turns. `events` is the
    approximate number of collisions of the shorter run.
    """
    # index 0 is the run up to `events`, index 1 the run of twice that length
    best: dict[str, list[float]] = {name: [math.inf, math.inf] for name in timers}
    done: dict[str, list[int]] = {name: [0, 0] for name in timers}
    for _ in range(turns):
        for name, timed in timers.items():
            for k in (0, 1):
                count, seconds = timed((k + 1) * events[name] / n * math.sqrt(math.pi))
                done[name][k], best[name][k] = count, min(best[name][k], seconds)
    return {name: (best[name][1] - best[name][0]) / (done[name][1] - done[name][0]) * 1e9 for name in timers}


def measure_scaling() -> dict[str, dict[int, float]]:
    """Cost in ns per collision over the number of balls, per queue and bare loop."""
    table: dict[str, dict[int, float]] = {}
    for n in (100, 1000, 10_000, 100_000, 1_000_000):
        scene = gas(n)
        timers = {"compiled": engine_timer(scene, "compiled", one=True),
                  "bare winner tree": bare_loop_timer(scene, bare_tree)}
        events = dict.fromkeys(timers, 1e6 if n < 100_000 else 5.0 * n)
        if n >= LARGE:
            timers["compiled, in blocks"] = engine_timer(scene, "compiled")
            events["compiled, in blocks"] = 16.0 * n if n < 1_000_000 else 5.0 * n
        timers |= {"SortedList": engine_timer(scene, "sorted"),
                   "bare SortedList loop": bare_loop_timer(scene, bare_sorted)}
        events |= {"SortedList": 3e4, "bare SortedList loop": 3e4}
        found = collision_costs(timers, events, n, 5 if n < 1_000_000 else 1)
        for name, cost in found.items():
            table.setdefault(name, {})[n] = cost
            peer = found["bare SortedList loop" if "Sorted" in name else "bare winner tree"]
            print(f"{n:9d} balls, {name:22s} {cost:7.0f} ns, {cost / peer:5.2f} times its bare loop", flush=True)
    return table


LINE_STYLES: dict[str, dict[str, Any]] = {
    "SortedList": {"marker": "s", "label": "sorted engine"},
    "bare SortedList loop": {"ls": "--", "color": GREY_COLOUR, "label": "minimal loop, sorted list"},
    "compiled": {"marker": "o", "label": "compiled engine"},
    "compiled, in blocks": {"marker": "^", "label": "compiled engine, in blocks"},
    "bare winner tree": {"ls": ":", "color": GREY_COLOUR, "label": "minimal loop, tournament tree"},
}
"""Line style of each queue and minimal loop. Orange stands for hard spheres."""


def draw(table: dict[str, dict[int, float]]) -> Any:
    """Plot the cost over the number of balls."""
    figure, ((axis,),) = canvas(1.5 * COLUMN_WIDTH, 1.05 * COLUMN_WIDTH)
    for name, look in LINE_STYLES.items():
        costs = table[name]
        axis.plot(list(map(int, costs)), list(costs.values()), **{"color": HARD_COLOUR, "mfc": "white"} | look)
    axis.set(xscale="log", yscale="log", xlabel="number of balls", ylabel="processor time per collision (ns)",
             ylim=(50, 5e4))
    axis.legend(loc="center left", bbox_to_anchor=(0.0, 0.4))
    return figure


def print_feature_costs() -> None:
    """Print the cost of each optional feature with 1000 balls."""
    n, table = 1000, gr.TabulatedRestitution([0.0, 20.0], [1.0, 1.0])
    scene, walls = gas(n), "walls at the ends"
    nearly = gr.ConstantRestitution(1.0 - 2.0**-40)
    timers = {
        "no optional feature": engine_timer(scene, "compiled"), "with gravity": engine_timer(gas(n, 0.001), "compiled"),
        "with the log": engine_timer(scene, "compiled", log=True),
        "with watch=, dashpot": engine_timer(scene, "compiled", watch=gr.LinearDashpot(1e6)),
        "with watch=, viscoelastic": engine_timer(scene, "compiled", watch=gr.ViscoelasticHertz(1e8, 1e4)),
        "with dissipation (collapse detection)": engine_timer(scene, "compiled", nearly),
        "with tc=": engine_timer(scene, "compiled", nearly, tc=1e-6),
        "with collapse='merge'": engine_timer(scene, "compiled", nearly, collapse="merge", merge_below=1e-9),
        f"without {walls}": engine_timer(gas(n, walls=False), "compiled"),
    }
    sorted_timers = {
        "no optional feature": engine_timer(scene, "sorted"), "with gravity": engine_timer(gas(n, 0.001), "sorted"),
        "with the log": engine_timer(scene, "sorted", log=True),
        "with watch=, dashpot": engine_timer(scene, "sorted", watch=gr.LinearDashpot(1e6)),
        "with watch=, viscoelastic": engine_timer(scene, "sorted", watch=gr.ViscoelasticHertz(1e8, 1e4)),
        "with on_event": engine_timer(scene, "sorted", on_event=lambda row: None),
        "with dissipation (collapse detection)": engine_timer(scene, "sorted", nearly),
        "with a table ε(v)": engine_timer(scene, "sorted", table),
        "with a function ε(v)": engine_timer(scene, "sorted", lambda speed, pair: 1.0),
        "with ties='poisson'": engine_timer(scene, "sorted", ties="poisson"),
        f"without {walls}": engine_timer(gas(n, walls=False), "sorted"),
    }
    for queue, kinds, events in (("compiled", timers, 1e6), ("SortedList", sorted_timers, 3e4)):
        found = collision_costs(kinds, dict.fromkeys(kinds, events), n, 7)
        least = found["no optional feature"]
        for name, cost in found.items():
            print(f"| {queue} | {name} | {cost / least:.2f} | {cost:.0f} ns |", flush=True)


if __name__ == "__main__":
    if not {"plot", "redraw"} & set(sys.argv):
        print_feature_costs()
    if "redraw" not in sys.argv:
        DATA_PATH.write_text(json.dumps(measure_scaling()) + "\n", encoding="utf-8")
    with style():
        draw(json.loads(DATA_PATH.read_text(encoding="utf-8"))).savefig(FIGURE_PATH, dpi=200)
