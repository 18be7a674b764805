"""`threshold`: scan of a parameter with bisection of every change of the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.progress import Told, shown
from granular.cases.build import sentence_of
from granular.studies.sweeps.plan import Plan, planned
from granular.studies.sweeps.results import CELL_ERRORS
from granular.studies.sweeps.subject import SceneLike
from granular.studies.threshold_result import THRESHOLD_CRITERIA, UNDECIDED, Criterion, Crossing, Threshold, Value

__all__ = ["Crossing", "Threshold", "Value", "threshold"]

GRID_SPACINGS: Mapping[str, Callable[[float, float, int], check.Array]] = {"log": np.geomspace, "linear": np.linspace}
DEFAULT_GAPS = (1e-6, 1e-2)
"""Default interval of gaps in m."""
MAX_SCAN_VALUES = 100_000
"""Maximum number of values of a scan."""
ZERO_SHARE = 1e-9
"""Share of the interval below which a value is equivalent to 0."""


@check.face
def threshold(
    scene: SceneLike,
    over: str = "gap",
    between: Sequence[float] | None = None,
    criterion: str = "isolated",
    *,
    error: float = 0.01,
    within: float = 0.01,
    points: int = 40,
    spacing: str = "log",
    run: Mapping[str, Any] | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> Threshold:
    """Find where along one parameter hard spheres are valid.

    The parameter is scanned, and every change of the verdict is bisected.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    over : str
        The parameter, as in `granular.sweep`: gap, stiffness, gap[1], law.k, ... Integer parameters are scanned at
        integer values only.
    between : two floats, optional
        First and last value of the scan, in SI units. Defaults to 1e-6 and 1e-2 m for a gap.
    criterion : {"isolated", "error"}
        Hard spheres are valid if every contact of the soft run is isolated up to the stop condition, or if the error of
        a comparison is at most `error`.
    error : float
        Largest error, in units of the fastest impact, for the second criterion, see `granular.Comparison.error`.
    within : float
        Width to which every crossing is bisected, relative to its value.
    points : int
        Number of values of the scan. Intervals between two neighbours with the same verdict are missed.
    spacing : {"log", "linear"}
        Spacing of the values.
    run : mapping, optional
        Options of the engines, such as ``{"max_events": 1000}``.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called with the share of the work that is done, as far as it is known, and
        the number of values tried.
    progress : bool
        Show the progress on standard error after 2 s, as a bar if tqdm is installed.
    **fixed
        Other parameters, as in `granular.sweep`.

    Returns
    -------
    Threshold
        All crossings: hard spheres can be valid in several intervals. A run that reaches a limit, or is refused, leaves
        its value undecided.

    Raises
    ------
    TypeError, ValueError
        For misuse: an unknown parameter or criterion, ends that are not in order or missing for a parameter other than
        a gap, or if every value is refused.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.threshold("three-balls", over="gap", points=9, within=0.1)
    >>> [f"{crossing.value:.1e}" for crossing in found.crossings]
    ['2.7e-03']
    """
    asked = THRESHOLD_CRITERIA[check.choice("criterion", criterion, list(THRESHOLD_CRITERIA))]
    check.of_kind("over", over, str, "the name of one parameter, such as 'gap'")
    plan = planned(scene, {over: np.zeros(0)}, (), fixed, run)
    if between is None and over.partition("[")[0] not in ("gap", "scene.gap"):
        raise ValueError(f"`between` must give the first and the last value of {over}, such as (0.5, 2), got None.")
    low, high = _ends(
        DEFAULT_GAPS if between is None else between, check.choice("spacing", spacing, list(GRID_SPACINGS))
    )
    number = check.whole("points", points, at_least=2, at_most=MAX_SCAN_VALUES)
    width = check.number("within", within, at_least=1e-12, at_most=0.5)
    limit = check.number("error", error, above=0.0)
    grid = GRID_SPACINGS[spacing](low, high, number)
    grid[[0, -1]] = low, high
    if plan.subject.is_whole(over):
        grid = _wholes(over, grid)
    with shown(progress, on_progress, "values", math.inf) as tell:
        values = _judged(plan, asked, limit, grid.tolist(), width, tell)
    units, judged_by = plan.subject.attributes(over)["units"], limit if criterion == "error" else math.nan
    return Threshold(plan.subject.title, over, units, (low, high), criterion, judged_by, width, number, spacing,
                     dict(fixed), values)


def _ends(between: Any, spacing: str) -> tuple[float, float]:
    """Return the checked ends of the scan."""
    if isinstance(between, str) or not hasattr(between, "__len__") or len(between) != 2:
        raise ValueError(f"`between` must be two numbers, such as (1e-6, 1e-2), got {between!r}.")
    low, high = (check.number(f"between[{i}]", end) for i, end in enumerate(between))
    check.refuse({
        f"`between` must be in ascending order, got ({low!r}, {high!r}).": not low < high,
        f"`between` must be positive for spacing='log', got ({low!r}, {high!r}). Use spacing='linear'.":
            spacing == "log" and not low > 0.0,
    })
    return low, high


def _wholes(over: str, grid: check.Array) -> check.Array:
    """Return the integers next to the values of a grid, each once."""
    low, high = grid[[0, -1]].tolist()
    if not (low.is_integer() and high.is_integer()):
        raise ValueError(f"`between` must be integers, because {over} is an integer, got ({low!r}, {high!r}).")
    return np.unique(np.round(grid))


def _judged(
    plan: Plan, asked: Criterion, limit: float, grid: list[float], within: float,
    tell: Told | None,
) -> tuple[Value, ...]:
    """Return every value that was tried, ascending."""
    refused: list[str] = []
    whole = plan.subject.is_whole(plan.names[0])

    def judge(value: float) -> Value:
        try:
            return Value(value, *asked.judge(plan.case((int(value) if whole else value,)), limit))
        except CELL_ERRORS as refusal:
            refused.append(sentence_of(refusal))
            return Value(value, UNDECIDED, math.nan, refused[-1])

    found: list[Value] = []
    for one in scanned(judge, grid, within, whole):
        found.append(one)
        if len(found) == len(refused) == len(grid):
            raise ValueError(refused[0])
        if tell is not None:
            tell(min(1.0, len(found) / len(grid)), len(found))
    return tuple(sorted(found, key=lambda one: one.value))


def scanned(
    judge: Callable[[float], Value], grid: Sequence[float], within: float, whole: bool = False
) -> Iterator[Value]:
    """Evaluate every value of an ascending grid, then bisect changes of the verdict.

    Changes are known to `within`, relative to the value, or to `ZERO_SHARE` of the interval if that is larger. If a
    midpoint has a third verdict, both halves are bisected. Intervals between two neighbours of the grid with the same
    verdict are missed. For `whole` parameters only integers are tried.
    """
    found: list[Value] = []
    least = ZERO_SHARE * (grid[-1] - grid[0])
    todo: Sequence[float] = grid
    while todo:
        for value in todo:
            found.append(judge(value))
            yield found[-1]
        found.sort(key=lambda one: one.value)
        todo = [middle(a.value, b.value, whole) for a, b in pairwise(found)
                if a.verdict != b.verdict and wide(a.value, b.value, within, least, whole)]


def wide(low: float, high: float, within: float, least: float, whole: bool) -> bool:
    """Whether an interval is too wide, and can be divided."""
    return high - low > within * max(abs(low), abs(high), least) and low < middle(low, high, whole) < high


def middle(low: float, high: float, whole: bool) -> float:
    """Return the midpoint of an interval: the geometric mean, or the mean.

    The geometric mean is used for intervals that span a factor of two or more.
    """
    mean = math.sqrt(low) * math.sqrt(high) if 0.0 < 2.0 * low < high else 0.5 * low + 0.5 * high
    return float(round(mean)) if whole else mean
