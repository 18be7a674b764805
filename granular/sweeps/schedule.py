"""Batches of cells, on this process or on any ``concurrent.futures.Executor``.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from granular._kernels import in_memory, worth
from granular.cases.named import sentence_of
from granular.sweeps import many
from granular.sweeps.answers import REFUSED, Answers
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan
from granular.sweeps.results import Answer

LOADING, MAKING = 1.5, 20.0
"""Seconds that it takes to load the machine code from the disk, and to make it."""
PILOT = 16
"""Cells, spread over those to be solved, that are solved first to see how long one takes."""
SHORTEST, LONGEST = 0.25, 2.0
"""Seconds that a batch should take: some milliseconds of scheduling are then below 5 %, and progress is seen."""
SHARE = 64
"""A sweep is cut into at least that many batches if they are not shorter than that."""

Batch = tuple[Values, Answers]


def batches(plan: Plan, columns: Sequence[Values], cells: Values, executor: Executor | None) -> Iterator[Batch]:
    """Solve `cells`, rows of `columns`, and yield them batch by batch as they are done, with their places.

    What a cell gives depends on nothing but its parameters, so neither cuts nor executor change a bit.
    """
    # without machine code in memory first one by one, with the same bits: no wait for a compiler
    way = replace(plan, at_once=plan.at_once and in_memory(many.KERNEL))
    rest, each = yield from _pilot(way, columns, cells)
    if way.at_once is not plan.at_once and worth(many.KERNEL, each * len(rest), LOADING, MAKING):
        way = plan
        rest, each = yield from _pilot(way, columns, rest)
    seconds = min(max(each * len(rest) / SHARE, SHORTEST), LONGEST)
    size = max(1, round(seconds / max(each, 1e-9)))
    parts = [rest[i : i + size] for i in range(0, len(rest), size)]
    if executor is not None:
        yield from _spread(way, columns, parts, executor)
    else:
        for part in parts:
            yield part, solve(way, [column[part] for column in columns])


def solve(plan: Plan, columns: Sequence[Values]) -> Answers:
    """Solve the cells whose parameters are rows of `columns`: many at once where that is open, else one by one."""
    points = list(zip(*(column.tolist() for column in columns), strict=True))
    answers = Answers(plan.results, len(points))
    for i in many.solve(plan, points, answers) if plan.at_once else range(len(points)):
        try:
            answer = Answer(plan.case(points[i]))
            found = {name: np.reshape(result.of(answer), (1, -1) if result.dim else 1)
                     for name, result in plan.results.items()}
            answers.put([i], found | {"status": np.array([answer.status(plan.results)])})
        except REFUSED as error:
            answers.refuse(i, sentence_of(error))
    return answers


def _solve_for_parent(plan: Plan, columns: Sequence[Values]) -> Answers:
    end_with_parent(os.getpid())
    return solve(plan, columns)


@cache
def end_with_parent(process: int) -> None:
    """Have this process of a pool end when the one that started it does, however that ends: it would wait for work
    forever."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None and threading.current_thread() is threading.main_thread():
        threading.Thread(target=_follow, args=[parent], daemon=True).start()


def _follow(parent: Any) -> None:
    parent.join()
    os._exit(1)


def _pilot(plan: Plan, columns: Sequence[Values], cells: Values) -> Generator[Batch, None, tuple[Values, float]]:
    """Solve a few cells and yield them; return the others and the seconds that a cell takes."""
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(PILOT, len(cells))).astype(np.int64))
    start = 0.0
    for part in filter(len, (chosen[:1], chosen[1:])):  # the first loads and compiles what is needed
        start = time.perf_counter()
        yield cells[part], solve(plan, [column[cells[part]] for column in columns])
    return np.delete(cells, chosen), (time.perf_counter() - start) / max(1, len(chosen) - 1)


def _spread(plan: Plan, columns: Sequence[Values], parts: list[Values], executor: Executor) -> Iterator[Batch]:
    futures: dict[Any, Values] = {}
    try:
        for part in parts:
            futures[executor.submit(_solve_for_parent, plan, [column[part] for column in columns])] = part
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()
