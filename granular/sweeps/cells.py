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


def solve_cells(plan: Plan, columns: Sequence[Values], bodies: int) -> Block:
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
    kinds = [None if one.scene is None else (one.scene.n, one.until) for one in setup.starts]
    known = np.array([law is not None for law in setup.laws])[setup.law_of]
    for kind in {kind for kind in kinds if kind is not None}:
        same = np.flatnonzero(known & np.array([kind == other for other in kinds])[setup.start_of])
        if len(same):
            _fill(setup, same, values, left)
    return np.flatnonzero(left)


class _Start(NamedTuple):
    """A scene, when it stops, and |v10|; `balls` is what its laws depend on: masses, radii, first impact speed."""

    scene: Scene | None = None
    t_end: float | None = None
    until: stop.Until | None = None
    impact: float = math.nan
    balls: Any = None


class _Setup(NamedTuple):
    """Cells as indices into the starts and laws that differ."""

    starts: list[_Start]
    start_of: Values
    laws: list[Any]  # coefficients of every pair and ε_spec, or None
    law_of: Values


def _fill(setup: _Setup, rows: Values, values: dict[str, Any], left: Values) -> None:
    """Solve the cells `rows`, of one size and one stop condition; creeping piles, running contacts go the slow way."""
    used, which = np.unique(setup.start_of[rows], return_inverse=True)
    starts = [setup.starts[i] for i in used]
    scenes = [start.scene for start in starts if start.scene is not None]
    ends = np.array([math.inf if start.t_end is None else start.t_end for start in starts], np.float64)[which]
    kinds, law_of = np.unique(setup.law_of[rows], return_inverse=True)
    law, eps = (np.array([setup.laws[i][k] for i in kinds])[law_of] for k in (0, 1))
    impact = np.array([start.impact for start in starts])[which]
    found = compiled.answers(scenes, which, law, starts[0].until, ends, impact, eps)
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
    first, start_of = _distinct(rows[:, shapes])
    memory = _memory(repr(plan))
    points = [tuple(column[i].item() for column in columns) for i in first]
    made = [_recall(memory, tuple(p[k] for k in shapes), _scene, plan, p) for p in points]
    balls = [one.balls for one in made]
    number = {each: k for k, each in enumerate(dict.fromkeys(balls))}
    others = [k for k in range(len(columns)) if k not in shapes]
    kind = np.array([number[each] for each in balls])[start_of]
    first, law_of = _distinct(np.column_stack([rows[:, others], kind]))
    laws = []
    for i in first:
        point = tuple(column[i].item() for column in columns)
        key = (balls[start_of[i]], *(point[k] for k in others))
        laws.append(_recall(memory, key, _law, plan, made[start_of[i]].scene, point))
    return _Setup(made, start_of, laws, law_of)


def _by_function(plan: Plan, columns: Sequence[Values]) -> _Setup:
    """Scenes and laws of cases that a user's function makes: one per cell."""
    cells = [_cell(plan, values) for values in zip(*columns, strict=True)]
    each = np.arange(len(cells))
    return _Setup([start for start, _ in cells], each, [law for _, law in cells], each)


def _cell(plan: Plan, values: tuple[Any, ...]) -> tuple[_Start, Any]:
    """Scene and law of the case at these values; none if they are refused."""
    try:
        case = plan.case(values)
        law = _coefficients(case.scene, case.physics("md")) if not case.run else None
    except REFUSED:
        return _Start(), None
    return _Start(case.scene, case.t_end, case.until, impact_speed(case.scene)), law


def _scene(plan: Plan, values: tuple[Any, ...]) -> _Start:
    """The scene at these values; None if they are refused."""
    try:
        scene, t_end = plan.scene(values)
    except REFUSED:
        return _Start()
    balls = scene.mass.tobytes(), scene.radius.tobytes(), ready.first_impact(scene)
    return _Start(scene, t_end, ready.TEMPLATES[str(plan.make)].until, impact_speed(scene), balls)


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
