"""Processor time of an answer and of a printed report, relative to its two runs.

`python bench/answers.py` prints a table for four scenes. The hard run (sorted engine), the soft run, the answer and the
report are timed in turns, so that the load of the machine affects all of them equally. The result is the median of many
rounds. An answer includes a further hard run from shifted gaps, and for touching balls runs under other tie rules.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import granular as gr

ROUNDS, WARMING_ROUNDS = 60, 400
"""Number of timed rounds, and of earlier rounds that load compiled code."""


def dashpots(scene: gr.Scene, restitution: float, k: float) -> list[Any]:
    """Return a dashpot per pair, with this restitution and stiffness in N/m."""
    return [gr.LinearDashpot.from_restitution(restitution, k=k, pair=pair) for pair in scene.pairs]


def scenes() -> Iterator[tuple[str, gr.Scene, Any, dict[str, Any]]]:
    """Yield name, scene, laws and end condition of the four scenes."""
    drop, stack, gas = gr.scenes.three_balls(gap=1e-4), gr.scenes.ball_stack(4), gr.scenes.gas(20)
    separated = {"until": gr.until.separated()}
    yield "base scene", drop, dashpots(drop, 0.7, 5e7), {"until": gr.until.contact(pair=0, nth=2)}
    yield "cradle of 5", gr.scenes.newtons_cradle(5), gr.Hertz(1e10), separated
    yield "stack of 4", stack, dashpots(stack, 0.9, 5e7), separated
    yield "gas of 20", gas, dashpots(gas, 0.9, 1e8), {"t_end": 0.5}


def milliseconds(parts: list[Callable[[], object]]) -> list[float]:
    """Median processor time of each part in ms, with the parts timed in turns."""
    times: list[list[float]] = [[] for _ in parts]
    for _ in range(ROUNDS):
        for part, spent in zip(parts, times, strict=True):
            begin = time.process_time_ns()
            part()
            spent.append((time.process_time_ns() - begin) * 1e-6)
    return [statistics.median(spent) for spent in times]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=("compiled", "plain"), default="compiled", help="of the soft runs")
    engine = parser.parse_args().engine
    print(f"{'scene':14}{'hard, ms':>10}{'soft, ms':>10}{'answer / both':>16}{'report / both':>16}")
    for name, scene, law, end in scenes():
        rule = gr.compare(scene, law, engine=engine, **end).rule
        parts: list[Callable[[], object]] = [
            lambda scene=scene, rule=rule, end=end: gr.edmd.simulate(scene, rule, **end),
            lambda scene=scene, law=law, end=end: gr.md.simulate(scene, law, engine=engine, **end),
            lambda scene=scene, law=law, end=end: gr.compare(scene, law, engine=engine, **end).answer,
            lambda scene=scene, law=law, end=end: str(gr.compare(scene, law, engine=engine, **end)),
        ]
        for _ in range(WARMING_ROUNDS if engine == "compiled" else 2):
            parts[2]()
        hard, soft, answer, report = milliseconds(parts)
        print(f"{name:14}{hard:10.3f}{soft:10.3f}{answer / (hard + soft):16.2f}{report / (hard + soft):16.2f}")


if __name__ == "__main__":
    main()
