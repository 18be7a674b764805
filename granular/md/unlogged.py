"""Fixed steps of a run that keeps no log: in bulk where its laws allow, and as `march` does where they do not reach."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from typing import Any

import numpy as np

from granular._kernels import kernel
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import SceneLaws
from granular.md.bulk import LENGTH, REACH, ROWS, Chain, Given, leap
from granular.md.march import march
from granular.md.steps import VERLET, accelerations

Bulk = namedtuple("Bulk", "given old new work")
"""What `leap` needs; `old` is the state of the run itself."""

MANY = 32
"""Pairs from which compiled code gains from steps in bulk; interpreted code never does."""
PROBES = ((0.3, 0.7), (1.7e-3, -2.9), (5.3e-7, 0.011), (41.0, -0.13))
"""Overlaps and rates at which a law must give the very number of its power form."""


def power_rows(laws: SceneLaws) -> tuple[list[float], list[float], bool] | None:
    """Return k and γ of each pair, and whether √ξ is a factor, if all laws are √ξ (k ξ + γ ξ̇) or all k ξ + γ ξ̇."""
    roots = {_has_root(law) for law in laws.each}
    if len(roots) != 1 or None in roots:
        return None
    k, _, gamma, _ = laws.column(lambda law: law.form).T.tolist()
    return k, gamma, bool(roots.pop())


def _has_root(law: PairLaw) -> bool | None:
    """Whether a law computes just as √ξ (k ξ + γ ξ̇), or as k ξ + γ ξ̇, tried at a few points; None if neither."""
    if law.form is None:
        return None
    k, p, gamma, d = law.form
    if (p, d if gamma else p - 1.0) not in ((1.5, 0.5), (1.0, 0.0)):
        return None
    alike = all(
        law.given(xi, rate, xi) == (math.sqrt(xi) if p == 1.5 else 1.0) * (k * xi + gamma * rate) for xi, rate in PROBES
    )
    return p == 1.5 if alike else None


def bulk(
    rows: tuple[list[float], list[float], bool], physics: Any, memory: Any, make: Callable[[Any], Any] = np.array
) -> Bulk:
    """Gather what `leap` needs of a run; `make` says of what it is made."""
    k, gamma, root = make(rows[0]), make(rows[1]), rows[2]
    half, s, now = 0.5 * physics.dt, memory.s, memory.now
    before, after = (half, half) if physics.method == VERLET else (physics.dt, 0.0)
    given = Given(physics.w, physics.fall, k, gamma, root, physics.dt, before, after)
    old = Chain(s.xi, s.v, s.raw, now.deepest, now.beside, now.shared)
    return Bulk(given, old, Chain(*map(make, old)), make([0.0] * (ROWS * LENGTH)))


@kernel
def _deepest(xi: Any) -> int:
    best = 0
    for c in range(len(xi)):
        if xi[c] > xi[best]:
            best = c
    return best


@kernel
def _accept(new: Any, old: Any) -> None:
    for c in range(len(old.xi)):
        old.xi[c], old.raw[c], old.shared[c] = new.xi[c], new.raw[c], new.shared[c]
        old.deepest[c], old.beside[c] = new.deepest[c], new.beside[c]
    for i in range(len(old.v)):
        old.v[i] = new.v[i]


@kernel
def _settle(s: Any, w: Any, fall: Any) -> None:
    """Let forces and accelerations follow from the unclipped forces."""
    for c in range(len(s.xi)):
        s.force[c] = s.raw[c] if s.raw[c] > 0.0 else 0.0
    accelerations(s.force, w, fall, s.acc)


@kernel
def hurry(
    method: int, force: Any, laws: Any, pairs: Any, w: Any, fall: Any, dt: float, start: int, steps: int,
    room: int, s: Any, work: Any, old: Any, now: Any, log: Any, bulk: Any,
) -> tuple[int, int, int]:  # fmt: skip
    """Take up to `steps` steps as `march` would, bit for bit, but leave nothing in `log`.

    Steps are taken in bulk while the pair now deepest stays closed (so there is no free flight to be made) and fewer
    than `room` contacts end; if not, these few steps are forgotten and taken one by one.
    """
    k, contacts = start, 0
    while k < start + steps:
        reach, before = min(REACH, start + steps - k), k
        witness = _deepest(s.xi)
        while reach > 0 and s.xi[witness] > 0.0:
            ended = leap(reach, witness, bulk.given, bulk.old, bulk.new, bulk.work)
            if ended < 0 or contacts + ended > room:
                break
            _accept(bulk.new, bulk.old)
            k += reach
            contacts += ended
            reach = min(REACH, start + steps - k)
            witness = _deepest(s.xi)
        if k > before:
            _settle(s, w, fall)
        if reach > 0:
            why, k, rows = march(
                method, force, laws, pairs, w, fall, dt, k, reach, room - contacts, s, work, old, now, log, -1, 0
            )
            contacts += rows
            if why == 1 or contacts > room:
                return why, k, contacts
    return 0, k, contacts
