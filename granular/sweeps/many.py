"""Many cells in one compiled call: what the located engine would give one by one, bit for bit."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from granular._check import Array, per_pair
from granular.cases import Case
from granular.cases.ready import first_impact
from granular.laws.contact_law import resolve
from granular.md import located
from granular.scene import Scene, velocities
from granular.sweeps.answers import REFUSED, Answers
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan
from granular.sweeps.results import impact_speed, specified

KERNEL = located.solve_rows
"""What has to be compiled for it."""


@dataclass(frozen=True, eq=False)
class Start:
    """A case that cells begin from, |v10| in m/s, and what its laws depend on: masses, radii, first impact speed."""

    case: Case
    impact: float
    balls: Hashable


@dataclass(frozen=True, eq=False)
class Law:
    """(k, p, γ, d) of every pair, and ε_spec."""

    forms: list[Any]
    eps: float


@dataclass(frozen=True)
class Soft:
    """Soft runs of many cells, read as `granular.sweeps.results.Answer` is; arrays have one more axis in front."""

    found: Any
    impact: Array
    eps: Array
    v_final: Array

    contacts = property(lambda self: self.found.counts)
    v_rel = property(lambda self: np.where(self.found.ongoing, math.nan, self.found.v_upper - self.found.v_lower))
    t_f = property(lambda self: np.where(self.found.ongoing, math.nan, self.found.t_end))
    longest = property(lambda self: self.found.longest)
    time = property(lambda self: self.found.time)


def solve(plan: Plan, points: Sequence[tuple[Any, ...]], answers: Answers) -> list[int]:
    """Solve the cells at these points as far as possible; return those that are left.

    Left are what is refused, has options of its own or laws that are no powers, creeping piles, and contacts that are
    running at the end and must be followed.
    """
    memory = _memory(plan.key) if plan.subject.ready else {}
    prepared = [_prepared(plan, point, memory) for point in points]
    alike: dict[Any, list[int]] = defaultdict(list)
    for i, (start, law) in enumerate(prepared):
        if law is not None:
            alike[start.case.scene.n, start.case.until].append(i)
    left = np.ones(len(points), np.bool_)
    for places in alike.values():
        rows = np.array(places)
        done = _fill(plan, rows, [prepared[i] for i in places], answers)
        left[rows[done]] = False
    found: list[int] = np.flatnonzero(left).tolist()
    return found


def _prepared(plan: Plan, point: tuple[Any, ...], memory: dict[Any, Any]) -> tuple[Any, Any]:
    """Start and law of one cell, each made once, however many cells share it; None where they are refused."""
    shape = tuple(value for value, shapes in zip(point, plan.shaping, strict=True) if shapes)
    start = _recalled(memory, shape, _start, plan, point)
    if start is None:
        return None, None
    others = tuple(value for value, shapes in zip(point, plan.shaping, strict=True) if not shapes)
    return start, _recalled(memory, (start.balls, others), _law, plan, point, start)


def _recalled(memory: dict[Any, Any], key: Any, make: Callable[..., Any], *given: Any) -> Any:
    if key not in memory:
        try:
            memory[key] = make(*given)
        except REFUSED:
            memory[key] = None
    return memory[key]


@lru_cache(maxsize=4)
def _memory(key: bytes) -> dict[Any, Any]:
    """Starts and laws that earlier batches of the same plan have made in this process."""
    return {}


def _start(plan: Plan, point: tuple[Any, ...]) -> Start | None:
    case = plan.start(point)
    scene = case.scene
    balls = (scene.mass.tobytes(), scene.radius.tobytes(), first_impact(scene)) if plan.subject.ready else point
    return None if case.run else Start(case, impact_speed(scene), balls)


def _law(plan: Plan, point: tuple[Any, ...], start: Start) -> Law | None:
    scene = start.case.scene
    laws = per_pair("law", plan.laws(start.case, point), scene.n_pairs)
    forms = [resolve(law, pair).form for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else Law(forms, specified(scene, laws))


def _fill(plan: Plan, rows: Values, prepared: Sequence[tuple[Start, Law]], answers: Answers) -> Any:
    """Solve cells of one size and one stop condition; return which of them are done."""
    starts, which = _distinct([start for start, _ in prepared])
    laws, law_of = _distinct([law for _, law in prepared])
    scenes = [start.case.scene for start in starts]
    mass, gap, velocity, gravity = (
        np.array([getattr(scene, name) for scene in scenes])[which] for name in ("mass", "gap", "velocity", "gravity"))
    ends = np.array([math.inf if start.case.t_end is None else start.case.t_end for start in starts])[which]
    forms = np.array([law.forms for law in laws])[law_of]
    found = located.solve_many(located.Scenes(mass, gap, velocity, forms, gravity),
                                  until=starts[0].case.until, t_end=ends)
    soft = Soft(found, np.array([start.impact for start in starts])[which], np.array([law.eps for law in laws])[law_of],
                _final_velocities(scenes, which, found.rate, found.time))
    done: Any = found.status >= 0
    if any(result.many == "ended" for result in plan.results.values()):
        done &= ~found.ongoing.any(axis=1)
    answers.put(rows[done], {"status": found.status[done]}
                | {name: result.of(soft)[done] for name, result in plan.results.items()})
    return done


def _distinct(things: Sequence[Any]) -> tuple[list[Any], Values]:
    """Return what is different, and which of them each is."""
    number: dict[Any, int] = {}
    which = np.array([number.setdefault(thing, len(number)) for thing in things])
    return list(number), which


def _final_velocities(scenes: Sequence[Scene], which: Values, rate: Array, time: Array) -> Array:
    """Velocities of all bodies, as `granular.scene.velocities` finds them."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    rows = [velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)]
    return np.concatenate(rows)
