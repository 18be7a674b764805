"""Many cells in one compiled call: what the located engine would give one by one, bit for bit.
May be skipped: faster, same results.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array, per_pair
from granular.cases import Case
from granular.cases.contacts import first_impact
from granular.laws.contact_law import resolve
from granular.md import located
from granular.scene import Scene, velocities
from granular.scene.flags import flags
from granular.sweeps.answers import REFUSED, Answers
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan
from granular.sweeps.results import impact_speed, specified

KERNEL = located.solve_rows
"""What has to be compiled for it."""


class Start(NamedTuple):
    """What many cells share: a scene with its end, and what its laws depend on: masses, radii, first impact speed."""

    case: Case
    balls: Hashable


def solve(plan: Plan, points: Sequence[tuple[Any, ...]], answers: Answers) -> list[int]:
    """Solve the cells at these points as far as possible; return those that are left.

    Left are what is refused, has options of its own, driven walls, forces, or laws that are no powers, creeping piles,
    and contacts that are running at the end and must be followed.
    """
    memory = _memory(plan.key) if plan.subject.ready else {}
    prepared = [_prepared(plan, point, memory) for point in points]
    alike: dict[Any, list[int]] = defaultdict(list)
    for i, (start, law) in enumerate(prepared):
        if law is not None:
            alike[start.case.scene.n, start.case.until].append(i)
    left = set(range(len(points)))
    for places in alike.values():
        starts, laws = zip(*(prepared[i] for i in places), strict=True)
        left -= set(_fill(plan, np.array(places), starts, laws, answers))
    return sorted(left)


@lru_cache(maxsize=4)
def _memory(key: bytes) -> dict[Any, Any]:
    """Starts and laws that earlier batches of the same plan have made in this process."""
    return {}


def _prepared(plan: Plan, point: tuple[Any, ...], memory: dict[Any, Any]) -> tuple[Any, Any]:
    """Start and law of one cell, each made once, however many cells share it; None where they are refused."""
    shape, others = plan.parted(point)
    start = _recalled(memory, shape, _start, plan, point)
    return start, start and _recalled(memory, (start.balls, others), _law, plan, point, start)


def _recalled(memory: dict[Any, Any], key: Any, make: Callable[..., Any], *given: Any) -> Any:
    if key not in memory:
        try:
            memory[key] = make(*given)
        except REFUSED:
            memory[key] = None
    return memory[key]


def _start(plan: Plan, point: tuple[Any, ...]) -> Start | None:
    case = plan.start(point)
    balls = case.scene.mass.tobytes(), case.scene.radius.tobytes(), first_impact(case.scene)
    return None if case.run or flags(case.scene) else Start(case, balls if plan.subject.ready else point)


def _law(plan: Plan, point: tuple[Any, ...], start: Start) -> tuple[Any, float] | None:
    """(k, p, γ, d) of every pair, and ε_spec; None if a law is no power law."""
    scene = start.case.scene
    laws = per_pair("law", plan.laws(start.case, point), scene.n_pairs)
    forms = [resolve(law, pair).form for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else (forms, specified(scene, laws))


def _fill(plan: Plan, rows: Values, starts: Sequence[Start], laws: Sequence[Any], answers: Answers) -> list[int]:
    """Solve cells of one size and one stop condition; return those that are done."""
    begin, which = _distinct(starts)
    law, law_of = _distinct(laws)
    scenes = [start.case.scene for start in begin]
    mass, gap, velocity, gravity = (
        np.array([getattr(scene, name) for scene in scenes])[which] for name in ("mass", "gap", "velocity", "gravity"))
    ends = np.array([math.inf if start.case.t_end is None else start.case.t_end for start in begin])[which]
    forms, eps = (np.array(column)[law_of] for column in zip(*law, strict=True))
    found = located.solve_many(located.Scenes(mass, gap, velocity, forms, gravity),
                               until=starts[0].case.until, t_end=ends)
    soft = SimpleNamespace(
        contacts=found.counts, v_rel=np.where(found.ongoing, math.nan, found.v_upper - found.v_lower),
        t_f=np.where(found.ongoing, math.nan, found.t_end), longest=found.longest, time=found.time,
        v_final=_final_velocities(scenes, which, found.rate, found.time),
        impact=np.array(list(map(impact_speed, scenes)))[which], eps=eps)  # read as `granular.sweeps.results.Answer`
    done: Any = found.status >= 0
    if any(result.many == "ended" for result in plan.results.values()):
        done &= ~found.ongoing.any(axis=1)
    answers.put(rows[done], {"status": found.status[done]}
                | {name: result.of(soft)[done] for name, result in plan.results.items()})
    solved: list[int] = rows[done].tolist()
    return solved


def _distinct(things: Sequence[Any]) -> tuple[list[Any], Values]:
    """Return what is different, and which of them each is."""
    number = {key: i for i, key in enumerate(dict.fromkeys(map(id, things)))}
    which = np.array([number[id(thing)] for thing in things])
    return list({id(thing): thing for thing in things}.values()), which


def _final_velocities(scenes: Sequence[Scene], which: Values, rate: Array, time: Array) -> Array:
    """Velocities of all bodies, as `granular.scene.velocities` finds them."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    rows = [velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)]
    return np.concatenate(rows)
