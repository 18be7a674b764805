"""Parallel steps of a long chain: each thread steps a group of windows.

Windows are independent of each other within one call of `march.take_steps`. Results are therefore bitwise independent
of the number of threads. Compiled kernels run without the interpreter lock. The source of `march.march` is used
unchanged, with the functions of this module in place of three kernels.
"""

from __future__ import annotations

from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from granular._engine.kernels import compiled
from granular._engine.reports import cores
from granular.md.fixed import march

MIN_PAIRS_PER_PART = 20_000
"""Minimum number of pairs per thread.

Stepping that number of pairs takes about ten times as long as synchronizing the threads."""

Workspaces = namedtuple("Workspaces", "whole parts pool code ended log pair nth")
"""Work space of a chain that is stepped in parallel.

`whole` is the `window.Work` of the chain, and `parts` are the work spaces of the threads. `pool` runs all parts except
the first, and `code` contains the compiled kernels. The last four fields are fields of `whole`."""


def parts(pairs: int) -> int:
    """Return the number of threads that step a chain of `pairs` pairs."""
    return max(1, min(cores(), pairs // MIN_PAIRS_PER_PART))


def parallel_workspace(whole: Any, works: list[Any], code: Any) -> Workspaces:
    """Return the work space for parallel steps with the given work spaces.

    `whole` is the work space of the chain, and `works` contains one work space per thread. `code` contains
    the compiled kernels.
    """
    return Workspaces(whole=whole, parts=works, pool=ThreadPoolExecutor(len(works) - 1), code=code,
                      ended=whole.ended, log=whole.log, pair=whole.pair, nth=whole.nth)


def take_steps(physics: Any, here: Any, there: Any, work: Workspaces, *arguments: Any) -> tuple[int, int]:
    """Take steps like `march.take_steps`, with each part in its own thread.

    `arguments` are the last four arguments of `march.take_steps`.
    """
    first_part, *other_parts = work.parts
    for part in work.parts:
        part.ended[0] = 0
    futures = [work.pool.submit(work.code.take_steps, physics, here, there, part, *arguments) for part in other_parts]
    results = [work.code.take_steps(physics, here, there, first_part, *arguments), *(f.result() for f in futures)]
    flags = 0
    for part, (_, part_flags) in zip(work.parts, results, strict=True):
        log_start, flags = work.ended[0], flags | part_flags
        work.ended[0] += part.ended[0]
        if physics.logged:
            work.log[log_start : work.ended[0]] = part.log[: part.ended[0]]
    return min(taken for taken, _ in results), flags


def log_contacts(first: int, stop: int, lo: int, k: int, physics: Any, was: Any, now: Any, work: Workspaces) -> None:
    """Record onsets and ends of contacts of the whole chain, see `notes.log_contacts`."""
    work.code.log_contacts(first, stop, lo, k, physics, was, now, work.whole)


def deepest(xi: Any) -> int:
    """Return the number of the pair with the largest overlap, see `march.deepest`."""
    return int(compiled(march.deepest)(xi))


MARCH_REPLACEMENTS = {"take_steps": take_steps, "log_contacts": log_contacts, "deepest": deepest}
"""Functions that replace the kernels of the same name in `march.march`."""
