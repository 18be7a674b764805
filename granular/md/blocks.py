"""Fixed steps of a long chain without a log: some steps of one block while it lies in the cache, then the next.

May be skipped: faster, same bits. A push goes one ball far with each evaluation of the forces. So a block with a margin
of ``REACH + 1`` pairs on either side takes its steps without asking the rest; what the margins then hold is wrong and
is thrown away.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.md.contact_force import Columns
from granular.md.integrators import Physics, Scratch, State
from granular.md.integrators import verlet as step
from granular.md.march import Memory, ends, exchange, march, overlaps, pushes

REACH = 24
"""Evaluations of each force in a block before the next one has its turn."""
BLOCK = 600
"""Pairs of a block, without margins; its columns should fit in the cache nearest to the core, nearly."""

Window = namedtuple("Window", "memory then reach")
"""Work space: a short chain; what is noted of the whole chain after the steps; steps a block takes at once."""


def window(memory: Memory, evaluations: int) -> Window:
    """Return the work space for a run."""
    length = min(len(memory.s.xi), BLOCK + 2 * (REACH + 1)) + 1
    short = [type(group)._make(column[:length].copy() for column in group) for group in memory[:-1]]
    then = memory.now._replace(**{name: np.zeros(len(memory.s.xi)) for name in ("deepest", "beside", "shared")})
    return Window(Memory._make([*short, memory.log]), then, max(1, REACH // evaluations))


@kernel
def _part(s: Any, lo: int, hi: int) -> Any:
    """The state of some pairs and of their balls."""
    end = hi + 1
    return State(s.xi[lo:hi], s.v[lo:end], s.acc[lo:end], s.raw[lo:hi], s.top[lo:hi], s.jerk[lo:end], s.snap[lo:end])


@kernel
def _noted(now: Any, lo: int, hi: int) -> Any:
    """What is noted of some pairs."""
    return now.deepest[lo:hi], now.beside[lo:hi], now.shared[lo:hi]


@kernel
def _copy(sources: Any, targets: Any) -> None:
    for source, target in zip(sources, targets):  # noqa: B905
        for a in range(len(target)):
            target[a] = source[a]


@kernel
def _block(physics: Any, lo: int, hi: int) -> Any:
    laws = Columns(physics.laws.k[lo:hi], physics.laws.gamma[lo:hi])
    return Physics(laws, physics.w[lo : hi + 1], physics.fall[lo : hi + 1], physics.dt)


@kernel
def _leap(physics: Any, here: Any, there: Any, reach: int, witness: int, window: Any) -> int:
    """Take `reach` steps of all from `here` to `there`; return contacts ended, or -1 if the pair `witness` opened."""
    pairs, ended, room = len(here.s.xi), 0, window.memory
    for first in range(0, pairs, BLOCK):
        stop = min(first + BLOCK, pairs)
        lo, hi = max(0, first - REACH - 1), min(pairs, stop + REACH + 1)
        m, a, b = hi - lo, first - lo, stop - lo
        part = _block(physics, lo, hi)
        work = Scratch(room.work.v[: m + 1], room.work.rate[:m], room.work.acc[: m + 1])
        s, old = _part(room.s, 0, m), _part(room.old, 0, m)
        _copy(_part(here.s, lo, hi), s)
        _copy(_noted(here.now, lo, hi), _noted(room.now, 0, m))
        for _ in range(reach):
            old, s = s, old
            step(part, old, s, work)
            if pushes(0.5 * physics.dt, old, s, room.now) == 1:
                ended += ends(a, b, old, s)
            overlaps(s.xi, room.now)
            if first <= witness < stop and s.xi[witness - lo] <= 0.0:
                return -1
        _copy(_part(s, a, b), _part(there.s, first, stop))
        _copy(_noted(room.now, a, b), _noted(there.now, first, stop))
    return ended


@kernel
def _deepest(xi: Any) -> int:
    best = 0
    for c in range(len(xi)):
        if xi[c] > xi[best]:
            best = c
    return best


@kernel
def _walk(physics: Any, memory: Any, start: int, steps: int, room: int, window: Any) -> tuple[int, int, int, bool]:
    k, contacts, witness, depth, turned = start, 0, 0, math.inf, False
    here, there = memory, Memory(memory.old, memory.s, memory.work, window.then, memory.log)
    while k < start + steps:
        reach, ended = min(window.reach, start + steps - k), -1
        if not here.s.xi[witness] > 0.5 * depth:
            witness = _deepest(here.s.xi)
            depth = here.s.xi[witness]
        if depth > 0.0:
            ended = _leap(physics, here, there, reach, witness, window)
        if ended >= 0 and contacts + ended <= room:
            here, there, turned = there, here, not turned
            k += reach
            contacts += ended
        else:
            why, k, rows = march(physics, here, k, reach, room - contacts, -1, 0)
            contacts += rows
            if why == 1 or contacts > room:
                return why, k, contacts, turned
    return 0, k, contacts, turned


@kernel
def march_in_blocks(physics: Any, memory: Any, start: int, steps: int, room: int, window: Any) -> tuple[int, int, int]:
    """Take up to `steps` steps as `granular.md.march.march` would, bit for bit, but leave nothing in the log.

    Blocks are used while a pair that was the deepest stays closed (so there is no free flight to be made) and fewer
    than `room` contacts end; if not, these few steps are forgotten and all balls take them together.
    """
    why, k, contacts, turned = _walk(physics, memory, start, steps, room, window)
    if turned:
        exchange(memory.old, memory.s)
        _copy(_noted(window.then, 0, len(memory.s.xi)), _noted(memory.now, 0, len(memory.s.xi)))
    return why, k, contacts
