"""Many cells solved in a row: the compiled way where it is open, else one run after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from granular import _check
from granular import until as stop
from granular.cases import ready
from granular.laws.contact_law import Form
from granular.scene import Scene
from granular.sweeps import compiled
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan
from granular.sweeps.results import CODE, MISUSE, Answer, impact_speed, specified

REFUSED = (ValueError, ArithmeticError)
"""What a cell may raise without stopping the sweep; anything else is a mistake, of the program or the user."""


class Block(NamedTuple):
    """Results of some cells: arrays by name, and the first sentence of misuse with its place, if any."""

    values: dict[str, Any]
    refusal: tuple[int, str] | None


def solve(plan: Plan, columns: Sequence[Values], bodies: int) -> Block:
    """Solve the cells whose parameters are rows of `columns`; sizes are padded to those of `bodies`."""
    count = len(columns[0])
    values = empty(plan, count, bodies)
    left = np.arange(count)
    if compiled.open_to(plan.asked, plan.run):
        left = _solve_compiled(plan, columns, values)
    refusal = None
    for i in left.tolist():
        try:
            _put(values, i, plan, Answer(plan.case([column[i] for column in columns])))
        except REFUSED as error:
            values["status"][i] = MISUSE
            refusal = refusal or (int(i), str(error))
    return Block(values, refusal)


def empty(plan: Plan, count: int, bodies: int) -> dict[str, Any]:
    """Arrays of `count` cells that have not been run."""
    sizes = {"": (), "pair": (bodies - 1,), "body": (bodies,)}
    found = {name: np.full((count, *sizes[result.dim]), result.fill) for name, result in plan.results.items()}
    return {"status": np.full(count, -1)} | found


def _put(values: dict[str, Any], i: int, plan: Plan, answer: Answer) -> None:
    """Write one answer into row `i`."""
    for name, result in plan.results.items():
        value = np.atleast_1d(np.asarray(result.of(answer)))
        if result.dim:
            values[name][i, : len(value)] = value
        else:
            values[name][i] = value[0]
    values["status"][i] = CODE[_status(plan, answer)]


def _status(plan: Plan, answer: Answer) -> str:
    """Status of the soft run; of the hard one if the case has no force law or only hard results are asked."""
    if answer.case.law is None or all(str(ask).startswith("hard_") for ask in plan.asked):
        return answer.hard.status.name
    run = answer.report.soft if "report" in answer.__dict__ else answer.soft
    return run.status.name


def _solve_compiled(plan: Plan, columns: Sequence[Values], values: dict[str, Any]) -> Values:
    """Fill in what the compiled way can do; return the cells that are left."""
    setup = _by_name(plan, columns) if isinstance(plan.make, str) else _by_function(plan, columns)
    left = np.ones(len(columns[0]), np.bool_)
    for size in {scene.n for scene in setup.scenes if scene is not None}:
        fits = np.array([scene is not None and scene.n == size for scene in setup.scenes])[setup.scene_of]
        rows = np.flatnonzero(fits & np.array([law is not None for law in setup.laws])[setup.law_of])
        for until in {setup.untils[i] for i in np.unique(setup.scene_of[rows])}:
            same = rows[np.array([setup.untils[i] == until for i in range(len(setup.scenes))])[setup.scene_of[rows]]]
            _fill(setup, same, until, values, left)
    return np.flatnonzero(left)


class _Setup(NamedTuple):
    """Cells as indices into the scenes and laws that differ."""

    scenes: list[Scene | None]
    t_ends: list[float | None]
    untils: list[stop.Until | None]
    impacts: list[float]
    scene_of: Values
    laws: list[Any]  # coefficients of every pair and ε_spec, or None
    law_of: Values


def _fill(setup: _Setup, rows: Values, until: Any, values: dict[str, Any], left: Values) -> None:
    """Solve the cells `rows`, of one size and one stop condition; creeping piles, running contacts go the slow way."""
    used, which = np.unique(setup.scene_of[rows], return_inverse=True)
    scenes = [scene for scene in (setup.scenes[i] for i in used) if scene is not None]
    ends = np.array([math.inf if setup.t_ends[i] is None else setup.t_ends[i] for i in used], np.float64)
    kinds, law_of = np.unique(setup.law_of[rows], return_inverse=True)
    law = np.array([setup.laws[i][0] for i in kinds])[law_of]
    eps = np.array([setup.laws[i][1] for i in kinds])[law_of]
    impact = np.array([setup.impacts[i] for i in used])[which]
    found = compiled.answers(scenes, which, law, until, ends[which], impact, eps)
    follow = {"v_rel", "eps_eff", "eps_ratio"} & values.keys()
    done = (found["status"] >= 0) & ~(found["ongoing"] & bool(follow))
    for name, array in values.items():
        fresh = found[name][done]
        array[(rows[done], *map(slice, fresh.shape[1:]))] = fresh
    left[rows[done]] = False


def _by_name(plan: Plan, columns: Sequence[Values]) -> _Setup:
    """Scenes and laws of a ready-made case: each made once, however many cells share it."""
    rows = np.stack([np.unique(column, return_inverse=True)[1] for column in columns], axis=1)
    shapes = [k for k, name in enumerate(plan.names) if name.partition("[")[0] in {*plan.of_scene, "t_end"}]
    first, scene_of = _distinct(rows[:, shapes])
    memory = _memory(repr(plan))
    points = [tuple(column[i].item() for column in columns) for i in first]
    made = [_recall(memory, tuple(p[k] for k in shapes), _scene, plan, p) for p in points]
    balls = [one.balls for one in made]
    number = {each: k for k, each in enumerate(dict.fromkeys(balls))}
    others = [k for k in range(len(columns)) if k not in shapes]
    kind = np.array([number[each] for each in balls])[scene_of]
    first, law_of = _distinct(np.column_stack([rows[:, others], kind]))
    laws = []
    for i in first:
        point = tuple(column[i].item() for column in columns)
        key = (balls[scene_of[i]], *(point[k] for k in others))
        laws.append(_recall(memory, key, _law, plan, made[scene_of[i]].scene, point))
    until = ready.READY[str(plan.make)].until
    scenes, t_ends, impacts = ([getattr(one, name) for one in made] for name in ("scene", "t_end", "impact"))
    return _Setup(scenes, t_ends, [until] * len(made), impacts, scene_of, laws, law_of)


def _by_function(plan: Plan, columns: Sequence[Values]) -> _Setup:
    """Scenes and laws of cases that a user's function makes: one per cell."""
    scenes, ends, untils, impacts, laws = [], [], [], [], []
    for values in zip(*columns, strict=True):
        try:
            case = plan.case(values)
            law = _coefficients(case.scene, case.physics("md")) if not case.run else None
        except REFUSED:
            case, law = None, None
        scenes.append(None if case is None else case.scene)
        ends.append(None if case is None else case.t_end)
        untils.append(None if case is None else case.until)
        impacts.append(math.nan if case is None else impact_speed(case.scene))
        laws.append(law)
    each = np.arange(len(scenes))
    return _Setup(scenes, ends, untils, impacts, each, laws, each)


class _Start(NamedTuple):
    """A scene with its end time and |v10|; `balls` is what its laws depend on: masses, radii, first impact speed."""

    scene: Scene | None
    t_end: float | None
    impact: float
    balls: Any


def _scene(plan: Plan, values: tuple[Any, ...]) -> _Start:
    """The scene at these values; None if they are refused."""
    try:
        scene, t_end = plan.scene(values)
    except REFUSED:
        return _Start(None, None, math.nan, None)
    balls = scene.mass.tobytes(), scene.radius.tobytes(), ready.first_impact(scene)
    return _Start(scene, t_end, impact_speed(scene), balls)


def _law(plan: Plan, scene: Scene | None, values: tuple[Any, ...]) -> Any:
    """Coefficients and ε_spec at these values; None if they are refused, or no power law."""
    if scene is None:
        return None
    try:
        return _coefficients(scene, plan.laws(scene, values))
    except REFUSED:
        return None


@lru_cache(maxsize=4)
def _memory(plan: str) -> dict[Any, Any]:
    """Scenes and laws that earlier batches of the same plan have made in this process."""
    return {}


def _recall(memory: dict[Any, Any], key: Any, make: Callable[..., Any], *arguments: Any) -> Any:
    if key not in memory:
        memory[key] = make(*arguments)
    return memory[key]


def _coefficients(scene: Scene, laws: Any) -> tuple[list[Form], float] | None:
    each = _check.per_pair("law", laws, scene.n_pairs)
    forms = compiled.coefficients(scene, each)
    return None if forms is None else (forms, specified(scene, each))


def _distinct(rows: Values) -> tuple[Values, Values]:
    """Return the first place of every distinct row, and which of them each row is."""
    if not rows.shape[1]:
        return np.zeros(1, np.int64), np.zeros(len(rows), np.int64)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, which.reshape(-1)
