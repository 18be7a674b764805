"""Batches of cells, on this process or on any ``concurrent.futures.Executor``."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import replace
from typing import Any

import numpy as np

from granular._kernels import worth
from granular.sweeps import compiled
from granular.sweeps.axes import Values
from granular.sweeps.cells import Block, solve_cells
from granular.sweeps.plan import Plan

LOADING, MAKING = 1.5, 20.0
"""Seconds that it takes to load the machine code from the disk, and to make it."""
PILOT = 16
"""Cells, spread over those to be solved, that are solved first to see how long one takes."""
SHORTEST, LONGEST = 0.25, 2.0
"""Seconds that a batch should take: some milliseconds of scheduling are then below 5 %, and progress is seen."""
SHARE = 64
"""A sweep is cut into at least that many batches if they are not shorter than that."""

Batch = tuple[Values, Block]


def batches(plan: Plan, columns: Sequence[Values], bodies: int, cells: Values, executor: Executor | None) \
        -> Iterator[Batch]:
    """Solve `cells`, rows of `columns`, and yield them batch by batch as they are done, with their places.

    What a cell gives depends on nothing but its parameters, so neither cuts nor executor change a bit.
    """
    if not len(cells):
        return
    way = plan
    if compiled.open_to(plan.asked, plan.run) and not compiled.at_hand():
        way = replace(plan, run={"engine": "auto"})  # one by one: the same bits, no wait for a compiler
    rest, each = yield from _pilot(way, columns, bodies, cells)
    if way is not plan and worth(compiled.KERNEL, each * len(rest), LOADING, MAKING):
        way = plan
        rest, each = yield from _pilot(way, columns, bodies, rest)
    parts = _cut(rest, each)
    if executor is None:
        for part in parts:
            yield part, _solve(way, columns, bodies, part)
    else:
        yield from _spread(way, columns, bodies, parts, executor)


def _pilot(
    plan: Plan, columns: Sequence[Values], bodies: int, cells: Values
) -> Generator[Batch, None, tuple[Values, float]]:
    """Solve a few cells and yield them; return the others and the seconds that a cell takes."""
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(PILOT, len(cells))).astype(np.int64))
    pilot = cells[chosen]
    yield pilot[:1], _solve(plan, columns, bodies, pilot[:1])  # loads and compiles what is needed
    start = time.perf_counter()
    if len(pilot) > 1:
        yield pilot[1:], _solve(plan, columns, bodies, pilot[1:])
    return np.delete(cells, chosen), (time.perf_counter() - start) / max(1, len(pilot) - 1)


def _spread(
    plan: Plan, columns: Sequence[Values], bodies: int, parts: list[Values], executor: Executor
) -> Iterator[Batch]:
    futures: dict[Any, Values] = {}
    try:
        for part in parts:
            futures[executor.submit(solve_cells, plan, [column[part] for column in columns], bodies)] = part
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _solve(plan: Plan, columns: Sequence[Values], bodies: int, cells: Values) -> Block:
    return solve_cells(plan, [column[cells] for column in columns], bodies)


def _cut(cells: Values, each: float) -> list[Values]:
    """Cut into batches of consecutive cells, `each` seconds a cell."""
    seconds = min(max(each * len(cells) / SHARE, SHORTEST), LONGEST)
    size = max(1, round(seconds / max(each, 1e-9)))
    return [cells[i : i + size] for i in range(0, len(cells), size)]
