"""Solution of the cells of a sweep in batches, one by one, or on an executor.

A batch is one compiled call for many cells. All three methods give bitwise the same results as one run of the located
engine per cell.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, reduce
from operator import xor
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granular import md
from granular._engine.check import Array, per_pair
from granular._engine.kernels import in_memory, worth
from granular.cases import Case
from granular.cases.build import sentence_of
from granular.cases.ready import first_impact_speed
from granular.comparison.align import followed
from granular.comparison.outcome import counts, order, separations
from granular.comparison.run import Comparison, compare
from granular.laws.contact_law import resolve
from granular.md.located import many
from granular.run.trajectory import Trajectory
from granular.run.until import LEVEL_TYPES
from granular.scene import Scene, velocities
from granular.studies.sweeps.results import CELL_ERRORS, STATUS_CODES, Answers, Result, impact_speed, specified
from granular.studies.sweeps.subject import Values

if TYPE_CHECKING:
    from granular.studies.sweeps.plan import Plan

LOADING_SECONDS, COMPILING_SECONDS = 0.7, 12.0
"""Times in s to load the machine code from disk, and to compile it."""
PILOT_CELLS = 16
"""Cells, spread over all cells, that are solved first to measure the time."""
MIN_BATCH_SECONDS, MAX_BATCH_SECONDS = 0.25, 2.0
"""Minimum time of a batch in s.

Scheduling takes some milliseconds, below 5 % of it, and progress is visible.
"""
MIN_BATCH_COUNT = 64
"""Minimum number of batches of a sweep, unless they are shorter than that."""
MIN_THREADED_SECONDS = 0.1
"""Total time of the cells in s from which on compiled calls use several threads."""

Batch = tuple[Values, Answers]


def checked(executor: Executor | None) -> None:
    """Return an executor, or raise an error."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"`executor` must be an object with submit(), such as a ProcessPoolExecutor or "
                        f"client.get_executor() of dask, got {executor!r}.")


@dataclass
class Answer:
    """One case on both engines. Runs happen when they are first used."""

    case: Case

    @cached_property
    def whole(self) -> Case:
        """The case with samples at its start and its end, in this order."""
        rest = {name: x for name, x in self.case.run.items() if name != "samples"}
        return self.case if len(rest) == len(self.case.run) else replace(self.case, run=rest)

    @cached_property
    def soft(self) -> Trajectory:
        """The soft-sphere run."""
        return self.whole.simulate("md")

    @cached_property
    def hard(self) -> Trajectory:
        """The event-driven run."""
        return self.whole.simulate("edmd")

    @cached_property
    def report(self) -> Comparison:
        """The comparison of both."""
        return compare(self.case.scene, self.case.physics("md"), self.case.rule, **self.case.options(compare))

    contacts = property(lambda self: counts(self.soft))
    t_f = property(lambda self: separations(self.soft)[1])
    v_final = property(lambda self: self.soft.velocity[-1])
    time = property(lambda self: self.soft.time[-1])
    impact = property(lambda self: impact_speed(self.case.scene))
    eps = property(lambda self: specified(self.case.scene, self.case.physics("md")))

    @cached_property
    def v_rel(self) -> Any:
        """Separation speeds in m/s after the last contact of each pair in the soft run.

        Contacts that are running at its end are followed to their end.
        """
        known = {name: x for name, x in self.case.options(md.simulate).items() if name in ("method", "dt", "engine")}
        return separations(followed(self.soft, known))[0]

    @property
    def longest(self) -> Any:
        """Longest completed contact of each pair in s."""
        log, longest = self.soft.contacts, np.full(self.soft.scene.n_pairs, math.nan)
        np.fmax.at(longest, log["pair"], np.where(np.isnan(log["t_end"]), math.nan, log["duration"]))
        return longest

    @property
    def order(self) -> int:
        """Number of the order of begins and ends in the runs used so far."""
        given = vars(self)
        runs = [*(given[name] for name in ("soft", "hard") if name in given),
                *(self.report.counted if "report" in given else ())]
        return reduce(xor, map(order, runs or [self.hard if self.case.law is None else self.soft]))

    def status(self, results: Mapping[str, Result]) -> int:
        """Status of the soft run, or of the hard one if only hard results are requested.

        The hard one also counts without force law.
        """
        if self.case.law is None or all(name.startswith("hard_") for name in results):
            return STATUS_CODES[self.hard.status.name]
        return STATUS_CODES[(self.report.soft if "report" in vars(self) else self.soft).status.name]


def batches(
    plan: Plan, columns: Sequence[Values], cells: Values, executor: Executor | None, workers: int,
) -> Iterator[Batch]:
    """Solve `cells`, rows of `columns`, and yield each finished batch with its places.

    The answers of a cell depend only on its parameters. Batches, threads and executors therefore do not change a bit.
    Without an executor, compiled calls use `workers` threads.
    """
    # cells run one by one, with the same bits, until compiling or loading the machine code pays
    way = replace(plan, at_once=plan.at_once and in_memory(many.solve_rows))
    rest, each = yield from _pilot(way, columns, cells)
    if way.at_once is not plan.at_once and worth(many.solve_rows, each * len(rest), LOADING_SECONDS, COMPILING_SECONDS):
        way = plan
        rest, each = yield from _pilot(way, columns, rest)
    size = max(1, round(min(max(each * len(rest) / MIN_BATCH_COUNT, MIN_BATCH_SECONDS), MAX_BATCH_SECONDS) / each))
    if executor is not None:
        size = min(size, math.ceil(len(rest) / (2 * workers)) or 1)
    parts = [rest[i : i + size] for i in range(0, len(rest), size)]
    threads = workers if executor is None and each * len(rest) > MIN_THREADED_SECONDS else 1
    tasks = ((way, [column[part] for column in columns], threads) for part in parts)
    for k, found in each_done(executor, solve, tasks):
        yield parts[k], found


def solve(plan: Plan, columns: Sequence[Values], threads: int = 1) -> Answers:
    """Solve the cells that are rows of `columns`, in compiled calls where possible."""
    answers, left = Answers(plan.results, len(columns[0])), np.ones(len(columns[0]), bool)
    for bundle in bundled(plan, columns):
        left[_write(plan, bundle, bundle.solved(threads), answers)] = False
    for i in np.flatnonzero(left).tolist():
        try:
            answer = Answer(plan.case(_point(columns, i)))
            values = {name: np.reshape(result.of(answer), (1, -1) if result.dim else 1)
                     for name, result in plan.results.items()}
            answers.put([i], values | {"status": np.array([answer.status(plan.results)])})
        except CELL_ERRORS as error:
            answers.refuse(i, sentence_of(error))
    return answers


def each_done(
    executor: Executor | None, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]],
) -> Iterator[tuple[int, Any]]:
    """Call `function` for each task, here or on an executor. Yield place and result.

    Results of an executor are yielded as soon as they are available. On an exception the remaining calls are cancelled.
    """
    if executor is None:
        yield from ((k, function(*task)) for k, task in enumerate(tasks))
        return
    futures: dict[Any, int] = {}
    try:
        for k, task in enumerate(tasks):
            futures[executor.submit(_call_for_parent, function, task)] = k
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _call_for_parent(function: Callable[..., Any], task: tuple[Any, ...]) -> Any:
    end_with_parent(os.getpid())
    return function(*task)


@cache
def end_with_parent(process: int) -> None:
    """End this process of a pool together with the process that started it.

    Otherwise it would wait for work forever.
    """
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None and threading.current_thread() is threading.main_thread():
        threading.Thread(target=_follow, args=[parent], daemon=True).start()


def _follow(parent: Any) -> None:
    parent.join()
    os._exit(1)


def _pilot(plan: Plan, columns: Sequence[Values], cells: Values) -> Generator[Batch, None, tuple[Values, float]]:
    """Solve a few cells and yield them. Return the other cells and the time per cell."""
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(PILOT_CELLS, len(cells))).astype(np.int64))
    spent = 0.0
    for part in filter(len, (chosen[:1], chosen[1:])):  # the first loads and compiles what is needed
        begin = time.process_time()
        found = solve(plan, [column[cells[part]] for column in columns])
        spent = time.process_time() - begin
        yield cells[part], found
    return np.delete(cells, chosen), max(spent, 1e-5) / max(1, len(chosen) - 1)  # a clock may stand still for a tick


class Start(NamedTuple):
    """Scene with its end, shared by cells, and properties on which laws depend.

    They are masses, radii and the speed of the first impact.
    """

    case: Case
    balls: Hashable


class Bundle(NamedTuple):
    """Cells of one size and one stop condition, for one compiled call.

    It has their places, their different scenes and the scene of each, ε_spec, and the problem to solve.
    """

    places: Values
    scenes: list[Scene]
    which: Values
    eps: Array
    begin: many.Scenes
    until: Any
    ends: Array

    def solved(self, threads: int = 1) -> many.Many:
        """Solve the cells in machine code without the interpreter lock, in threads.

        Thread k solves every k-th cell.
        """
        threads = min(threads, len(self.places))

        def part(k: int) -> many.Many:
            begin = many.Scenes(*(np.asarray(column)[k::threads] for column in self.begin))
            return many.solve_many(begin, until=self.until, t_end=self.ends[k::threads])

        if threads == 1:
            return part(0)
        with ThreadPoolExecutor(threads) as pool:
            columns = zip(*pool.map(part, range(threads)), strict=True)
        back = np.argsort(np.concatenate([self.places[k::threads] for k in range(threads)]))
        return many.Many(*(np.concatenate(column)[back] for column in columns))


def bundled(plan: Plan, columns: Sequence[Values]) -> list[Bundle]:
    """Prepare cells that can be solved in one call. Scenes and laws are shared.

    Cells that are refused or have options of their own, driven walls, forces, or other laws than powers are left out.
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
    """Return starts and laws from earlier batches of the plan in this process."""
    return {}


def _distinct(columns: Sequence[Values], count: int) -> tuple[list[int], Values]:
    """Return the first index of each distinct row, and the group number of all rows."""
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
    """Return a start or law, created once. None if it is refused."""
    if key not in memory:
        try:
            memory[key] = make(*given)
        except CELL_ERRORS:
            memory[key] = None
    return memory[key]


def _start(plan: Plan, point: tuple[Any, ...]) -> Start | None:
    case = plan.start(point)
    balls = case.scene.mass.tobytes(), case.scene.radius.tobytes(), first_impact_speed(case.scene)
    singly = bool(case.run or case.scene._flags) or isinstance(case.until, LEVEL_TYPES)
    return None if singly else Start(case, balls if plan.subject.ready else point)


def _law(plan: Plan, point: tuple[Any, ...], start: Start) -> tuple[Any, float] | None:
    """Return (k, p, γ, d) of every pair, and ε_spec. None for other laws."""
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
    """Write the answers of finished cells, and return their places.

    Piles that settle slowly, and contacts that are running at the end, are left out.
    """
    soft = SimpleNamespace(
        contacts=found.counts, v_rel=np.where(found.ongoing, math.nan, found.v_upper - found.v_lower),
        t_f=np.where(found.ongoing, math.nan, found.t_end), longest=found.longest, time=found.time,
        v_final=_final_velocities(bundle.scenes, bundle.which, found.rate, found.time),
        impact=np.array(list(map(impact_speed, bundle.scenes)))[bundle.which],
        eps=bundle.eps)  # read as an `Answer`
    done: Any = found.status >= 0
    if any(result.many == "ended" for result in plan.results.values()):
        done &= ~found.ongoing.any(axis=1)
    places: Values = bundle.places[done]
    answers.put(places, {"status": found.status[done]}
                | {name: result.of(soft)[done] for name, result in plan.results.items()})
    return places


def _final_velocities(scenes: Sequence[Scene], which: Values, rate: Array, time: Array) -> Array:
    """Return the velocities of all bodies, like `granular.scene.velocities`."""
    if all(scene.is_wall[0] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    return np.concatenate([velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)])
