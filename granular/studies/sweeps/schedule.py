"""Solution of the cells of a sweep in batches, one by one, or on an executor.

A batch is one compiled call for many cells. Results are bitwise identical to one run of the located engine per cell.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce
from operator import xor
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granular import md
from granular._engine.check import Array, per_pair
from granular._engine.kernels import is_in_memory, is_worthwhile
from granular.cases import Case
from granular.cases.build import error_sentence
from granular.cases.ready import first_impact_speed
from granular.comparison.align import follow_contacts
from granular.comparison.outcome import counts, order, separations
from granular.comparison.run import Comparison, compare
from granular.laws.contact_law import resolve
from granular.md.located import many
from granular.run.trajectory import Trajectory
from granular.run.until import LEVEL_TYPES
from granular.scene import Scene, velocities
from granular.studies.sweeps.executors import run_tasks
from granular.studies.sweeps.results import CELL_ERRORS, STATUS_CODES, Answers, Result, common_restitution, impact_speed
from granular.studies.sweeps.subject import Values

if TYPE_CHECKING:
    from granular.studies.sweeps.plan import Plan

LOADING_SECONDS, COMPILING_SECONDS = 0.7, 12.0
"""Times in s to load the machine code from disk, and to compile it."""
PILOT_CELLS = 16
"""Number of cells that are solved first to measure the time per cell.

They are distributed over all cells.
"""
MIN_BATCH_SECONDS, MAX_BATCH_SECONDS = 0.25, 2.0
"""Minimum and maximum time of a batch in s.

Scheduling takes some milliseconds per batch, less than 5 % of the minimum. Progress is reported after each batch.
"""
MIN_BATCH_COUNT = 64
"""Minimum number of batches of a sweep, unless batches would be too short."""
MIN_THREADED_SECONDS = 0.1
"""Total time of the cells in s above which compiled calls use several threads."""

Batch = tuple[Values, Answers]


@dataclass
class Answer:
    """One case on both engines. Each run takes place when its result is first used."""

    case: Case

    @cached_property
    def whole(self) -> Case:
        """The case without the option `samples`, so that runs record their start and end."""
        options = {name: x for name, x in self.case.run.items() if name != "samples"}
        return self.case if len(options) == len(self.case.run) else replace(self.case, run=options)

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
        """The comparison of both engines."""
        return compare(self.case.scene, self.case.physics("md"), self.case.rule, **self.case.options(compare))

    contacts = property(lambda self: counts(self.soft))
    t_f = property(lambda self: separations(self.soft)[1])
    v_final = property(lambda self: self.soft.velocity[-1])
    time = property(lambda self: self.soft.time[-1])
    impact = property(lambda self: impact_speed(self.case.scene))
    eps = property(lambda self: common_restitution(self.case.scene, self.case.physics("md")))

    @cached_property
    def v_rel(self) -> Any:
        """Separation speeds in m/s after the last contact of each pair in the soft run.

        Unfinished contacts at the end of the run are continued to their end.
        """
        options = {name: x for name, x in self.case.options(md.simulate).items() if name in ("method", "dt", "engine")}
        return separations(follow_contacts(self.soft, options))[0]

    @property
    def longest(self) -> Any:
        """Duration in s of the longest completed contact of each pair, nan without one."""
        log, longest = self.soft.contacts, np.full(self.soft.scene.n_pairs, math.nan)
        np.fmax.at(longest, log["pair"], np.where(np.isnan(log["t_end"]), math.nan, log["duration"]))
        return longest

    @property
    def order(self) -> int:
        """Number that identifies the order of onsets and ends in the runs used so far."""
        computed = vars(self)
        runs = [*(computed[name] for name in ("soft", "hard") if name in computed),
                *(self.report.counted if "report" in computed else ())]
        return reduce(xor, map(order, runs or [self.hard if self.case.law is None else self.soft]))

    def status(self, results: Mapping[str, Result]) -> int:
        """Return the status code of the soft run, or of the hard run.

        The hard run counts if only hard results are requested, or if the case has no force law.
        """
        if self.case.law is None or all(name.startswith("hard_") for name in results):
            return STATUS_CODES[self.hard.status.name]
        return STATUS_CODES[(self.report.soft if "report" in vars(self) else self.soft).status.name]


def solve_in_batches(
    plan: Plan, columns: Sequence[Values], cells: Values, executor: Executor | None, workers: int,
) -> Iterator[Batch]:
    """Solve cells in batches. Yield the numbers and the answers of their cells.

    The answers of a cell depend only on its parameters. They are bitwise identical for any batches, threads and
    executors.

    Parameters
    ----------
    plan : Plan
        The plan.
    columns : sequence of arrays
        Values of the varied parameters, one per cell.
    cells : array of int
        Numbers of the cells to solve.
    executor : Executor or None
        Executor of the batches. None for this process.
    workers : int
        Number of threads of compiled calls without an executor.
    """
    # cells run one by one, with bitwise identical results, until loading or compiling machine code pays off
    current_plan = replace(plan, at_once=plan.at_once and is_in_memory(many.solve_rows))
    rest, seconds = yield from _pilot(current_plan, columns, cells)
    if current_plan.at_once is not plan.at_once and is_worthwhile(
            many.solve_rows, seconds * len(rest), LOADING_SECONDS, COMPILING_SECONDS):
        current_plan = plan
        rest, seconds = yield from _pilot(current_plan, columns, rest)
    size = max(1, round(
        min(max(seconds * len(rest) / MIN_BATCH_COUNT, MIN_BATCH_SECONDS), MAX_BATCH_SECONDS) / seconds))
    if executor is not None:
        size = min(size, math.ceil(len(rest) / (2 * workers)) or 1)
    parts = [rest[i : i + size] for i in range(0, len(rest), size)]
    threads = workers if executor is None and seconds * len(rest) > MIN_THREADED_SECONDS else 1
    tasks = ((current_plan, [column[part] for column in columns], threads) for part in parts)
    for k, answers in run_tasks(executor, solve, tasks):
        yield parts[k], answers


def solve(plan: Plan, columns: Sequence[Values], threads: int = 1) -> Answers:
    """Solve the cells with parameters `columns`, in compiled calls if possible."""
    answers, unsolved = Answers(plan.results, len(columns[0])), np.ones(len(columns[0]), bool)
    for bundle in bundled(plan, columns):
        unsolved[_write(plan, bundle, bundle.solved(threads), answers)] = False
    for i in np.flatnonzero(unsolved).tolist():
        try:
            answer = Answer(plan.case(_point(columns, i)))
            values = {name: np.reshape(result.of(answer), (1, -1) if result.dim else 1)
                     for name, result in plan.results.items()}
            answers.put([i], values | {"status": np.array([answer.status(plan.results)])})
        except CELL_ERRORS as error:
            answers.refuse(i, error_sentence(error))
    return answers


def _pilot(plan: Plan, columns: Sequence[Values], cells: Values) -> Generator[Batch, None, tuple[Values, float]]:
    """Solve a few cells and yield them. Return the other cells and the time per cell.

    The time is in s of processor time.
    """
    chosen = np.unique(np.linspace(0, len(cells) - 1, min(PILOT_CELLS, len(cells))).astype(np.int64))
    seconds = 0.0
    for part in filter(len, (chosen[:1], chosen[1:])):  # the first cell loads and compiles the kernels
        begin = time.process_time()
        answers = solve(plan, [column[cells[part]] for column in columns])
        seconds = time.process_time() - begin
        yield cells[part], answers
    return np.delete(cells, chosen), max(seconds, 1e-5) / max(1, len(chosen) - 1)  # a clock can stand still for a tick


class Start(NamedTuple):
    """Case of a cell without contacts, shared by many cells.

    `balls` identifies the properties on which laws depend: masses, radii and the speed of the first impact.
    """

    case: Case
    balls: Hashable


class Bundle(NamedTuple):
    """Cells for one compiled call, with equal number of bodies and stop condition.

    Attributes
    ----------
    places : array (n,)
        Numbers of the cells.
    scenes : list of Scene
        The different scenes.
    which : array (n,)
        Number of the scene of each cell.
    eps : array (n,)
        ε_spec of each cell.
    begin, until, ends
        Initial states with force laws, stop condition, and end times in s.
    """

    places: Values
    scenes: list[Scene]
    which: Values
    eps: Array
    begin: many.Scenes
    until: Any
    ends: Array

    def solved(self, threads: int = 1) -> many.Many:
        """Solve the cells in machine code, in threads without the interpreter lock.

        Thread k solves the cells k, k + `threads`, k + 2 `threads`, …
        """
        threads = min(threads, len(self.places))

        def part(k: int) -> many.Many:
            begin = many.Scenes(*(np.asarray(column)[k::threads] for column in self.begin))
            return many.solve_many(begin, until=self.until, t_end=self.ends[k::threads])

        if threads == 1:
            return part(0)
        with ThreadPoolExecutor(threads) as pool:
            columns = zip(*pool.map(part, range(threads)), strict=True)
        order_of_cells = np.argsort(np.concatenate([self.places[k::threads] for k in range(threads)]))
        return many.Many(*(np.concatenate(column)[order_of_cells] for column in columns))


def bundled(plan: Plan, columns: Sequence[Values]) -> list[Bundle]:
    """Return the bundles of cells that can be solved in compiled calls.

    Equal scenes and laws are created once. The bundles exclude cells that are refused, and cells with options, driven
    walls, forces, or laws other than powers.
    """
    if not plan.at_once:
        return []
    memory = _memory(plan.key) if plan.subject.ready else {}
    scene_columns, law_columns = ([column for column, shape in zip(columns, plan.shaping, strict=True) if shape is side]
                      for side in (True, False))
    first, which = _groups_of_rows(scene_columns, len(columns[0]))
    starts = [_created_once(memory, _point(scene_columns, i), _start, plan, _point(columns, i)) for i in first]
    first, law_of = _groups_of_rows(
        [_numbers_of_keys(start and start.balls for start in starts)[which], *law_columns], len(which))
    laws = [start and _created_once(
                memory, (start.balls, _point(law_columns, i)), _law, plan, _point(columns, i), start)
            for i in first for start in (starts[which[i]],)]
    group = _numbers_of_keys(start and (start.case.scene.n, start.case.until) for start in starts)[which]
    group[np.array([law is None for law in laws])[law_of]] = -1
    return [_bundle(np.flatnonzero(group == kind), starts, which, laws, law_of)
            for kind in np.unique(group[group >= 0])]


@lru_cache(maxsize=4)
def _memory(key: bytes) -> dict[Any, Any]:
    """Return the cases and laws of earlier batches of the plan in this process."""
    return {}


def _groups_of_rows(columns: Sequence[Values], count: int) -> tuple[list[int], Values]:
    """Return the first index of each group of equal rows, and the group of every row.

    Row i consists of the entries i of all `columns`. `count` is the number of rows.
    """
    which = np.zeros(count, np.int64)
    for column in columns:
        values, code = np.unique(column, return_inverse=True)
        which = np.unique(which * len(values) + code, return_inverse=True)[1]
    return np.unique(which, return_index=True)[1].tolist(), which


def _numbers_of_keys(keys: Iterable[Any]) -> Values:
    number: dict[Any, int] = {}
    return np.array([number.setdefault(key, len(number)) for key in keys])


def _point(columns: Sequence[Values], i: int) -> tuple[Any, ...]:
    return tuple(column[i].item() for column in columns)


def _created_once(memory: dict[Any, Any], key: Any, make: Callable[..., Any], *given: Any) -> Any:
    """Return ``make(*given)`` from `memory`, or call `make` and store the result.

    The result is None if `make` raises an exception of `CELL_ERRORS`.
    """
    if key not in memory:
        try:
            memory[key] = make(*given)
        except CELL_ERRORS:
            memory[key] = None
    return memory[key]


def _start(plan: Plan, point: tuple[Any, ...]) -> Start | None:
    case = plan.start(point)
    balls = case.scene.mass.tobytes(), case.scene.radius.tobytes(), first_impact_speed(case.scene)
    is_special = bool(case.run or case.scene._flags) or isinstance(case.until, LEVEL_TYPES)
    return None if is_special else Start(case, balls if plan.subject.ready else point)


def _law(plan: Plan, point: tuple[Any, ...], start: Start) -> tuple[Any, float] | None:
    """Return (k, p, γ, d) of every pair, and ε_spec. None if a law is not a power law."""
    scene = start.case.scene
    laws = per_pair("law", plan.laws(start.case, point), scene.n_pairs)
    forms = [resolve(law, pair).form for law, pair in zip(laws, scene.pairs, strict=True)]
    return None if None in forms else (forms, common_restitution(scene, laws))


def _bundle(places: Values, starts: Sequence[Start], which: Values, laws: Sequence[Any], law_of: Values) -> Bundle:
    """Return the arrays of the cells `places` as a `Bundle`."""
    used, which = np.unique(which[places], return_inverse=True)
    cases = [starts[i].case for i in used]
    scenes = [case.scene for case in cases]
    mass, gap, velocity, gravity = (
        np.array([getattr(scene, name) for scene in scenes])[which] for name in ("mass", "gap", "velocity", "gravity"))
    ends = np.array([math.inf if case.t_end is None else case.t_end for case in cases])[which]
    used, law_of = np.unique(law_of[places], return_inverse=True)
    forms, eps = (np.array(column)[law_of] for column in zip(*(laws[i] for i in used), strict=True))
    return Bundle(places, scenes, which, eps, many.Scenes(mass, gap, velocity, forms, gravity), cases[0].until, ends)


def _write(plan: Plan, bundle: Bundle, solution: many.Many, answers: Answers) -> Values:
    """Store the answers of the cells of a bundle, and return the cells' numbers.

    Cells whose run did not end are left out, such as piles that settle slowly. If a result requires it, cells with
    unfinished contacts are left out, too.
    """
    soft = SimpleNamespace(
        contacts=solution.counts, v_rel=np.where(solution.ongoing, math.nan, solution.v_upper - solution.v_lower),
        t_f=np.where(solution.ongoing, math.nan, solution.t_end), longest=solution.longest, time=solution.time,
        v_final=_final_velocities(bundle.scenes, bundle.which, solution.rate, solution.time),
        impact=np.array(list(map(impact_speed, bundle.scenes)))[bundle.which],
        eps=bundle.eps)  # read as an `Answer`
    is_finished: Any = solution.status >= 0
    if any(result.many == "ended" for result in plan.results.values()):
        is_finished &= ~solution.ongoing.any(axis=1)
    places: Values = bundle.places[is_finished]
    answers.put(places, {"status": solution.status[is_finished]}
                | {name: result.of(soft)[is_finished] for name, result in plan.results.items()})
    return places


def _final_velocities(scenes: Sequence[Scene], which: Values, rate: Array, time: Array) -> Array:
    """Return the velocities of all bodies in m/s at the end, shape (cells, bodies).

    They are equal to `granular.scene.velocities`.
    """
    if all(scene.is_wall[0] and not scene.is_wall[-1] for scene in scenes):
        floor = np.array([scene.velocity[0] for scene in scenes])[which]
        offset = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=-1)], axis=-1)
        return np.asarray((floor - offset[:, 0])[:, None] + offset)
    return np.concatenate([velocities(scenes[i], r[None], t[None]) for i, r, t in zip(which, rate, time, strict=True)])
