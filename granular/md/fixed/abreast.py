"""A long chain on several cores: each steps a part of the windows, and they meet when all have taken their steps.

Windows know nothing of each other until then, so who steps which changes no bit. Machine code runs without the
interpreter's lock; the loop of the march goes on as it stands.
"""

from __future__ import annotations

from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from granular._engine.kernels import compiled
from granular._engine.reports import cores
from granular.md.fixed import march

FEWEST = 20_000
"""Pairs of a part: it takes ten times as long as to meet."""

Crew = namedtuple("Crew", "whole parts pool code ended log pair nth")
"""The work of the chain and those of its parts; threads; kernels; four of the fields of the first."""


def parts(pairs: int) -> int:
    """Return in how many parts a chain is stepped."""
    return max(1, min(cores(), pairs // FEWEST))


def crew(whole: Any, works: list[Any], code: Any) -> Crew:
    """Return what `march.march` takes for its work in order to step parts of a chain side by side."""
    return Crew(whole, works, ThreadPoolExecutor(len(works) - 1), code, whole.ended, whole.log, whole.pair, whole.nth)


def take_steps(physics: Any, here: Any, there: Any, work: Crew, *how: Any) -> tuple[int, int]:
    """Take steps as `march.take_steps` does, all parts at once."""
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
    """Note contacts as `notes.log_contacts` does."""
    work.code.log_contacts(first, stop, lo, k, physics, was, now, work.whole)


def deepest(xi: Any) -> int:
    """Return what `march.deepest` does."""
    return int(compiled(march.deepest)(xi))


MARCH = {"take_steps": take_steps, "log_contacts": log_contacts, "deepest": deepest}
"""What stands in `march.march` for its kernels."""
