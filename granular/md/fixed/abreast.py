"""Parallel steps of a long chain: each core steps a part of the windows.

Windows are independent until all parts have taken their steps, so the assignment to cores changes no bit. Compiled code
runs without the interpreter lock. The loop of the march itself is unchanged.
"""

from __future__ import annotations

from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from granular._engine.kernels import compiled
from granular._engine.reports import cores
from granular.md.fixed import march

MIN_PAIRS_PER_PART = 20_000
"""Smallest number of pairs per part.

Stepping them takes ten times as long as synchronizing."""

Crew = namedtuple("Crew", "whole parts pool code ended log pair nth")
"""Work spaces of the whole chain and of its parts, thread pool and kernels.

The other four fields are fields of the first work space."""


def parts(pairs: int) -> int:
    """Return the number of parts in which a chain is stepped."""
    return max(1, min(cores(), pairs // MIN_PAIRS_PER_PART))


def parallel_workspace(whole: Any, works: list[Any], code: Any) -> Crew:
    """Return the work space of `march.march` for steps of the parts in parallel."""
    return Crew(whole, works, ThreadPoolExecutor(len(works) - 1), code, whole.ended, whole.log, whole.pair, whole.nth)


def take_steps(physics: Any, here: Any, there: Any, work: Crew, *how: Any) -> tuple[int, int]:
    """Take steps as `march.take_steps` does, all parts in parallel."""
    mine, *others = work.parts
    for part in work.parts:
        part.ended[0] = 0
    waited = [work.pool.submit(work.code.take_steps, physics, here, there, part, *how) for part in others]
    found = [work.code.take_steps(physics, here, there, mine, *how), *(one.result() for one in waited)]
    flags = 0
    for part, (_, seen) in zip(work.parts, found, strict=True):
        begun, flags = work.ended[0], flags | seen
        work.ended[0] += part.ended[0]
        if physics.logged:
            work.log[begun : work.ended[0]] = part.log[: part.ended[0]]
    return min(taken for taken, _ in found), flags


def log_contacts(first: int, stop: int, lo: int, k: int, physics: Any, was: Any, now: Any, work: Crew) -> None:
    """Log contacts as `notes.log_contacts` does."""
    work.code.log_contacts(first, stop, lo, k, physics, was, now, work.whole)


def deepest(xi: Any) -> int:
    """Return the same as `march.deepest`."""
    return int(compiled(march.deepest)(xi))


MARCH_REPLACEMENTS = {"take_steps": take_steps, "log_contacts": log_contacts, "deepest": deepest}
"""Functions that replace the kernels of the same name in `march.march`."""
