"""`threshold`: scan of a parameter, and bisection of every change of the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.progress import ProgressCallback, progress_callback
from granular.cases.build import error_sentence
from granular.studies.sweeps.plan import Plan, make_plan
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
"""Fraction of the interval below which a value is equivalent to 0."""


@signature.face
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
    """Find the values of one parameter for which hard spheres are valid.

    The parameter is scanned, and every change of the verdict is bisected.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    over : str
        The parameter, as in `granular.sweep`: gap, stiffness, gap[1], law.k, ... Integer parameters are scanned at
        integer values only. Defaults to "gap".
    between : two floats, optional
        First and last value of the scan, in SI units. Defaults to 1e-6 and 1e-2 m for a gap.
    criterion : {"isolated", "error"}
        "isolated": hard spheres are valid if every contact of the soft run is isolated up to the stop condition.
        "error": they are valid if the error of a comparison is at most `error`. Defaults to "isolated".
    error : float
        Maximum error for the criterion "error", in units of the fastest impact. See `granular.Comparison.error`.
        Defaults to 0.01.
    within : float
        Width to which every crossing is bisected, relative to its value. Defaults to 0.01.
    points : int
        Number of values of the scan. Defaults to 40. An interval with another verdict is missed if it lies between two
        neighbouring values.
    spacing : {"log", "linear"}
        Spacing of the values. Defaults to "log".
    run : mapping, optional
        Options of the engines, such as ``{"max_events": 1000}``.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called with the finished fraction of the work, as far as it is known, and the
        number of values tried.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    **fixed
        Other parameters, as in `granular.sweep`.

    Returns
    -------
    Threshold
        All crossings: hard spheres can be valid in several intervals. If a run reaches a limit or raises an exception,
        its value is undecided.

    Raises
    ------
    TypeError, ValueError
        For misuse: an unknown parameter or criterion, ends of the scan that are not in ascending order, or missing
        ends for a parameter other than a gap. Also if the run of every value of the scan raises an exception.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.threshold("three-balls", over="gap", points=9, within=0.1)
    >>> [f"{crossing.value:.1e}" for crossing in found.crossings]
    ['2.7e-03']
    """
    chosen_criterion = THRESHOLD_CRITERIA[check.choice("criterion", criterion, list(THRESHOLD_CRITERIA))]
    check.of_kind("over", over, str, "the name of one parameter, such as 'gap'")
    plan = make_plan(scene, {over: np.zeros(0)}, (), fixed, run)
    if between is None and over.partition("[")[0] not in ("gap", "scene.gap"):
        raise ValueError(f"`between` must give the first and the last value of {over}, such as (0.5, 2), got None.")
    low, high = _checked_interval(
        DEFAULT_GAPS if between is None else between, check.choice("spacing", spacing, list(GRID_SPACINGS))
    )
    count = check.integer("points", points, at_least=2, at_most=MAX_SCAN_VALUES)
    width = check.number("within", within, at_least=1e-12, at_most=0.5)
    limit = check.number("error", error, above=0.0)
    grid = GRID_SPACINGS[spacing](low, high, count)
    grid[[0, -1]] = low, high
    if plan.subject.is_whole(over):
        grid = _nearest_integers(over, grid)
    with progress_callback(progress, on_progress, "values", math.inf) as tell:
        values = _evaluated_values(plan, chosen_criterion, limit, grid.tolist(), width, tell)
    units, judged_by = plan.subject.attributes(over)["units"], limit if criterion == "error" else math.nan
    return Threshold(
        title=plan.subject.title, over=over, units=units, between=(low, high), criterion=criterion, limit=judged_by,
        within=width, points=count, spacing=spacing, fixed=dict(fixed), values=values)


def _checked_interval(between: Any, spacing: str) -> tuple[float, float]:
    """Return the first and the last value of the scan. Raise `ValueError` for misuse."""
    if isinstance(between, str) or not hasattr(between, "__len__") or len(between) != 2:
        raise ValueError(f"`between` must be two numbers, such as (1e-6, 1e-2), got {between!r}.")
    low, high = (check.number(f"between[{i}]", end) for i, end in enumerate(between))
    check.raise_if_true({
        f"`between` must be in ascending order, got ({low!r}, {high!r}).": not low < high,
        f"`between` must be positive for spacing='log', got ({low!r}, {high!r}). Use spacing='linear'.":
            spacing == "log" and not low > 0.0,
    })
    return low, high


def _nearest_integers(over: str, grid: check.Array) -> check.Array:
    """Return the integers nearest to the values of a grid, without repetition."""
    low, high = grid[[0, -1]].tolist()
    if not (low.is_integer() and high.is_integer()):
        raise ValueError(f"`between` must be integers, because {over} is an integer, got ({low!r}, {high!r}).")
    return np.unique(np.round(grid))


def _evaluated_values(
    plan: Plan, criterion: Criterion, limit: float, grid: list[float], within: float,
    report_progress: ProgressCallback | None,
) -> tuple[Value, ...]:
    """Return all values that were tried, in ascending order, with their verdicts."""
    refusal_messages: list[str] = []
    is_integer = plan.subject.is_whole(plan.names[0])

    def judge(number: float) -> Value:
        try:
            return Value(number, *criterion.judge(plan.case((int(number) if is_integer else number,)), limit))
        except CELL_ERRORS as refusal:
            refusal_messages.append(error_sentence(refusal))
            return Value(number, UNDECIDED, math.nan, refusal_messages[-1])

    values: list[Value] = []
    for value in scan_and_bisect(judge, grid, within, is_integer):
        values.append(value)
        if len(values) == len(refusal_messages) == len(grid):
            raise ValueError(refusal_messages[0])
        if report_progress is not None:
            report_progress(min(1.0, len(values) / len(grid)), len(values))
    return tuple(sorted(values, key=lambda value: value.value))


def scan_and_bisect(
    judge: Callable[[float], Value], grid: Sequence[float], within: float, integers_only: bool = False
) -> Iterator[Value]:
    """Yield the verdict of every value of a grid, then bisect changes of the verdict.

    Parameters
    ----------
    judge : callable
        Function of a number that returns a `Value`.
    grid : sequence of float
        Ascending numbers. If neighbours have the same verdict, the interval between them is not examined.
    within : float
        Width of the final intervals relative to the number, or to `ZERO_SHARE` of the scan if that is larger.
    integers_only : bool
        Whether only integers are tried.

    Notes
    -----
    If the midpoint of an interval has a third verdict, both halves are bisected.
    """
    values: list[Value] = []
    min_scale = ZERO_SHARE * (grid[-1] - grid[0])
    next_numbers: Sequence[float] = grid
    while next_numbers:
        for value in next_numbers:
            values.append(judge(value))
            yield values[-1]
        values.sort(key=lambda value: value.value)
        next_numbers = [midpoint(a.value, b.value, integers_only) for a, b in pairwise(values)
                if a.verdict != b.verdict and is_divisible(a.value, b.value, within, min_scale, integers_only)]


def is_divisible(low: float, high: float, within: float, min_scale: float, integers_only: bool) -> bool:
    """Return whether an interval is wider than required and can be divided.

    It must be wider than `within` times its larger end, or times `min_scale` if that is larger.
    """
    return high - low > within * max(abs(low), abs(high), min_scale) and low < midpoint(low, high, integers_only) < high


def midpoint(low: float, high: float, integers_only: bool) -> float:
    """Return the midpoint of an interval.

    It is the geometric mean if both ends are positive and span a factor of more than two, otherwise the mean.
    """
    mean = math.sqrt(low) * math.sqrt(high) if 0.0 < 2.0 * low < high else 0.5 * low + 0.5 * high
    return float(round(mean)) if integers_only else mean
