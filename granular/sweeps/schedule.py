"""Batches of cells, on this process or on any ``concurrent.futures.Executor``; many cells in one compiled call: what
the located engine would give one by one, bit for bit.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Hashable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import replace
from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array, per_pair
from granular._kernels import flags, in_memory, worth
from granular.cases import Case
from granular.cases.build import sentence_of
from granular.cases.ready import first_impact_speed
from granular.laws.contact_law import resolve
from granular.md.located import many
from granular.scene import Scene, velocities
from granular.sweeps.plan import Plan
from granular.sweeps.results import REFUSED, Answer, Answers, impact_speed, specified
from granular.sweeps.subject import Values

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
    way = replace(plan, at_once=plan.at_once and in_memory(many.solve_rows))
    rest, each = yield from _pilot(way, columns, cells)
    if way.at_once is not plan.at_once and worth(many.solve_rows, each * len(rest), LOADING, MAKING):
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
    for i in solve_at_once(plan, points, answers) if plan.at_once else range(len(points)):
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
        start = time.process_time()
        yield cells[part], solve(plan, [column[cells[part]] for column in columns])
    return np.delete(cells, chosen), (time.process_time() - start) / max(1, len(chosen) - 1)


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


class Start(NamedTuple):
    """What many cells share: a scene with its end, and what its laws depend on: masses, radii, first impact speed."""

    case: Case
    balls: Hashable


def solve_at_once(plan: Plan, points: Sequence[tuple[Any, ...]], answers: Answers) -> list[int]:
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
    balls = case.scene.mass.tobytes(), case.scene.radius.tobytes(), first_impact_speed(case.scene)
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
    found = many.solve_many(many.Scenes(mass, gap, velocity, forms, gravity),
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
