"""Batches of cells, on this process or on any ``concurrent.futures.Executor``; many cells in one compiled call: what
the located engine would give one by one, bit for bit.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import replace
from functools import cache, lru_cache
from itertools import islice
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granular._engine.check import Array, per_pair
from granular._engine.kernels import in_memory, worth
from granular.cases import Case
from granular.cases.build import sentence_of
from granular.cases.ready import first_impact_speed
from granular.laws.contact_law import resolve
from granular.md.located import many
from granular.run.until import LEVELS
from granular.scene import Scene, velocities
from granular.studies.sweeps.results import REFUSED, Answer, Answers, impact_speed, specified
from granular.studies.sweeps.subject import Values

if TYPE_CHECKING:
    from granular.studies.sweeps.plan import Plan

LOADING, MAKING = 0.7, 12.0
"""Seconds that it takes to load the machine code from the disk, and to make it."""
PILOT = 16
"""Cells, spread over those to be solved, that are solved first to see how long one takes."""
SHORTEST, LONGEST = 0.25, 2.0
"""Seconds that a batch should take: some milliseconds of scheduling are then below 5 %, and progress is seen."""
SHARE = 64
"""A sweep is cut into at least that many batches if they are not shorter than that."""
WORTH = 0.1
"""Seconds of compiled calls from which on there are several threads of them."""

Batch = tuple[Values, Answers]


def checked(executor: Executor | None) -> None:
    """Raise if it is no executor."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor is {executor!r}: an object with submit() is needed, such as a ProcessPoolExecutor "
                        "or client.get_executor() of dask.")


def batches(
    plan: Plan, columns: Sequence[Values], cells: Values, executor: Executor | None, workers: int,
) -> Iterator[Batch]:
    """Solve `cells`, rows of `columns`, and yield them batch by batch as they are done, with their places.

    What a cell gives depends on nothing but its parameters, so neither cuts nor executor change a bit. Without an
    executor cells in compiled calls run in so many threads, `workers`, if that pays.
    """
    # without machine code in memory first one by one, with the same bits: no wait for a compiler
    way = replace(plan, at_once=plan.at_once and in_memory(many.solve_rows))
    rest, each, alone = yield from _pilot(way, columns, cells)
    if way.at_once is not plan.at_once and worth(many.solve_rows, each * len(rest), LOADING, MAKING):
        way = plan
        rest, each, alone = yield from _pilot(way, columns, rest)
    threaded = executor is None and way.at_once and workers > 1 and alone * len(rest) > WORTH
    size = max(1, round(min(max(each * len(rest) / SHARE, SHORTEST), LONGEST) / each))
    if threaded or executor is not None:
        size = min(size, math.ceil(len(rest) / (2 * workers)) or 1)
    parts = [rest[i : i + size] for i in range(0, len(rest), size)]
    if executor is not None:
        yield from _spread(way, columns, parts, executor)
    elif threaded:
        yield from _threaded(way, columns, parts, workers)
    else:
        for part in parts:
            yield part, solve(way, [column[part] for column in columns])


def solve(plan: Plan, columns: Sequence[Values]) -> Answers:
    """Solve the cells whose parameters are rows of `columns`: many at once where that is open, else one by one."""
    return _finished(plan, columns, ((one, one.solved()) for one in bundled(plan, columns)))


def _finished(plan: Plan, columns: Sequence[Values], solved: Iterable[tuple[Bundle, many.Many]]) -> Answers:
    """Return the answers of cells of which some have been solved at once, and the others, one by one."""
    answers, left = Answers(plan.results, len(columns[0])), np.ones(len(columns[0]), bool)
    for bundle, found in solved:
        left[_write(plan, bundle, found, answers)] = False
    for i in np.flatnonzero(left).tolist():
        try:
            answer = Answer(plan.case(_point(columns, i)))
            values = {name: np.reshape(result.of(answer), (1, -1) if result.dim else 1)
                     for name, result in plan.results.items()}
            answers.put([i], values | {"status": np.array([answer.status(plan.results)])})
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


def _pilot(plan: Plan, columns: Sequence[Values], cells: Values) -> Generator[Batch, None, tuple[Values, float, float]]:
    """Solve a few cells and yield them; return the others and the seconds that a cell takes, in all and without its
    scene and law, which many cells may share."""
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(PILOT, len(cells))).astype(np.int64))
    begin = start = 0.0
    for part in filter(len, (chosen[:1], chosen[1:])):  # the first loads and compiles what is needed
        here, begin = [column[cells[part]] for column in columns], time.process_time()
        bundles, start = bundled(plan, here), time.process_time()
        yield cells[part], _finished(plan, here, ((one, one.solved()) for one in bundles))
    count, now = max(1, len(chosen) - 1), time.process_time()
    each, alone = (max(now - since, 1e-5) / count for since in (begin, start))  # a clock may stand still for a tick
    return np.delete(cells, chosen), each, alone


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


def _threaded(plan: Plan, columns: Sequence[Values], parts: list[Values], workers: int) -> Iterator[Batch]:
    """Solve parts, which this thread prepares and finishes, in compiled calls in other threads, which run nothing else:
    it can be interrupted, and they end within one call."""
    todo, ahead = iter(parts), deque[Any]()
    pool = ThreadPoolExecutor(workers)

    def begin(part: Values) -> Any:
        here = [column[part] for column in columns]
        return part, here, [(one, pool.submit(one.solved)) for one in bundled(plan, here)]

    try:
        ahead.extend(map(begin, islice(todo, workers + 1)))
        while ahead:
            part, here, solved = ahead.popleft()
            found = [(one, future.result()) for one, future in solved]
            ahead.extend(map(begin, islice(todo, 1)))
            yield part, _finished(plan, here, found)
    finally:
        pool.shutdown(cancel_futures=True)


class Start(NamedTuple):
    """What many cells share: a scene with its end, and what its laws depend on: masses, radii, first impact speed."""

    case: Case
    balls: Hashable


class Bundle(NamedTuple):
    """Cells of one size and one stop condition, in one compiled call: their places, their different scenes and which
    each has, ε_spec, and what is to be solved."""

    places: Values
    scenes: list[Scene]
    which: Values
    eps: Array
    begin: many.Scenes
    until: Any
    ends: Array

    def solved(self) -> many.Many:
        """Solve them: machine code, without the interpreter's lock."""
        return many.solve_many(self.begin, until=self.until, t_end=self.ends)


def bundled(plan: Plan, columns: Sequence[Values]) -> list[Bundle]:
    """Prepare cells that many at once can solve; scenes and laws are made once, however many cells share them.

    Left are what is refused, has options of its own, driven walls, forces, or laws that are no powers.
    """
    if not plan.at_once:
        return []
    memory = _memory(plan.key) if plan.subject.ready else {}
    shapes, others = ([column for column, shape in zip(columns, plan.shaping, strict=True) if shape is side]
                      for side in (True, False))
    first, which = _distinct(shapes, len(columns[0]))
    starts = [_recalled(memory, _point(shapes, i), _start, plan, _point(columns, i)) for i in first]
    first, law_of = _distinct([_numbered(start and start.balls for start in starts)[which], *others], len(which))
    laws = [start and _recalled(memory, (start.balls, _point(others, i)), _law, plan, _point(columns, i), start)
            for i in first for start in (starts[which[i]],)]
    alike = _numbered(start and (start.case.scene.n, start.case.until) for start in starts)[which]
    alike[np.array([law is None for law in laws])[law_of]] = -1
    return [_bundle(np.flatnonzero(alike == kind), starts, which, laws, law_of)
            for kind in np.unique(alike[alike >= 0])]


@lru_cache(maxsize=4)
def _memory(key: bytes) -> dict[Any, Any]:
    """Starts and laws that earlier batches of the same plan have made in this process."""
    return {}


def _distinct(columns: Sequence[Values], count: int) -> tuple[list[int], Values]:
    """Return where the different rows of some columns are first, and which of them each row is."""
    which = np.zeros(count, np.int64)
    for column in columns:
        values, code = np.unique(column, return_inverse=True)
        which = np.unique(which * len(values) + code, return_inverse=True)[1]
    return np.unique(which, return_index=True)[1].tolist(), which


def _numbered(keys: Iterable[Any]) -> Values:
    number: dict[Any, int] = {}
    return np.array([number.setdefault(key, len(number)) for key in keys])


def _point(columns: Sequence[Values], i: int) -> tuple[Any, ...]:
    return tuple(column[i].item() for column in columns)


def _recalled(memory: dict[Any, Any], key: Any, make: Callable[..., Any], *given: Any) -> Any:
    """Start or law, made once; None where it is refused."""
    if key not in memory:
        try:
            memory[key] = make(*given)
        except REFUSED:
            memory[key] = None
    return memory[key]


def _start(plan: Plan, point: tuple[Any, ...]) -> Start | None:
    case = plan.start(point)
    balls = case.scene.mass.tobytes(), case.scene.radius.tobytes(), first_impact_speed(case.scene)
    singly = bool(case.run or case.scene._flags) or isinstance(case.until, LEVELS)
    return None if singly else Start(case, balls if plan.subject.ready else point)


def _law(plan: Plan, point: tuple[Any, ...], start: Start) -> tuple[Any, float] | None:
    """(k, p, γ, d) of every pair, and ε_spec; None if a law is no power law."""
    scene = start.case.scene
    laws = per_pair("law", plan.laws(start.case, point), scene.n_pairs)
    forms = [resolve(law, pair).form for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else (forms, specified(scene, laws))


def _bundle(places: Values, starts: Sequence[Start], which: Values, laws: Sequence[Any], law_of: Values) -> Bundle:
    used, which = np.unique(which[places], return_inverse=True)
    cases = [starts[i].case for i in used]
    scenes = [case.scene for case in cases]
    mass, gap, velocity, gravity = (
        np.array([getattr(scene, name) for scene in scenes])[which] for name in ("mass", "gap", "velocity", "gravity"))
    ends = np.array([math.inf if case.t_end is None else case.t_end for case in cases])[which]
    used, law_of = np.unique(law_of[places], return_inverse=True)
    forms, eps = (np.array(column)[law_of] for column in zip(*(laws[i] for i in used), strict=True))
    return Bundle(places, scenes, which, eps, many.Scenes(mass, gap, velocity, forms, gravity), cases[0].until, ends)


def _write(plan: Plan, bundle: Bundle, found: many.Many, answers: Answers) -> Values:
    """Write the answers of cells that are done, and return the places of these; left are creeping piles, and contacts
    that are running at the end and must be followed."""
    soft = SimpleNamespace(
        contacts=found.counts, v_rel=np.where(found.ongoing, math.nan, found.v_upper - found.v_lower),
        t_f=np.where(found.ongoing, math.nan, found.t_end), longest=found.longest, time=found.time,
        v_final=_final_velocities(bundle.scenes, bundle.which, found.rate, found.time),
        impact=np.array(list(map(impact_speed, bundle.scenes)))[bundle.which],
        eps=bundle.eps)  # read as `granular.studies.sweeps.results.Answer`
    done: Any = found.status >= 0
    if any(result.many == "ended" for result in plan.results.values()):
        done &= ~found.ongoing.any(axis=1)
    places: Values = bundle.places[done]
    answers.put(places, {"status": found.status[done]}
                | {name: result.of(soft)[done] for name, result in plan.results.items()})
    return places


def _final_velocities(scenes: Sequence[Scene], which: Values, rate: Array, time: Array) -> Array:
    """Velocities of all bodies, as `granular.scene.velocities` finds them."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    return np.concatenate([velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)])
