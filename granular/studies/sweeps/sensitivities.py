"""`sensitivity`: derivatives of outcomes with respect to parameters.

It also computes uncertainties. Derivatives are extrapolated differences of runs with the same order of events.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from granular._engine import check, signature
from granular._engine.check import Array
from granular._engine.progress import progress_callback
from granular.cases import Case
from granular.comparison.outcome import ERROR_LIMIT, approach, components
from granular.studies.sweeps.derivatives import Slope, slope
from granular.studies.sweeps.executors import checked_executor, run_tasks
from granular.studies.sweeps.plan import Plan, RequestedResult, make_plan, named
from granular.studies.sweeps.run import bisect_jumps
from granular.studies.sweeps.schedule import Answer, solve
from granular.studies.sweeps.sensitivity_report import Sensitivity, Start
from granular.studies.sweeps.subject import SceneLike, common_parameters, numbers_in

MAX_DERIVATIVE_ERROR = 1e-8
"""Maximum error of a reported derivative, relative to the total sensitivity."""
ZERO_PARAMETERS, JOINED_FIELDS = ("gap", "velocity"), ("breaks", "coefficients")
"""Fields that are parameters even if 0, and fields of a wall path that must match."""
BORDER_PRECISION = 1e-6
"""Relative width to which a border is known."""
BORDER_REACH = 4.0 ** np.arange(-8, 1)
"""Distances of the scan for borders from the parameter, in its unit."""


@signature.face
def sensitivity(
    scene: SceneLike,
    results: RequestedResult | Sequence[RequestedResult] = ("v_rel",),
    over: str | Sequence[str] | None = None,
    uncertainty: float | Mapping[str, float | str] | None = None,
    *,
    executor: Executor | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> Sensitivity:
    """Compute derivatives, condition numbers and uncertainties of outcomes.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    results : names, or functions of the case that return a number
        Outcomes: results of `granular.sweep` that are not integers; ``"v_rel"`` of all pairs, ``"v_rel[1]"`` of one.
    over : names of parameters, optional
        As in `granular.sweep`. Defaults to every number of the scene, and of its laws or rule if the outcomes need
        them. Among parameters that are 0, only gaps and velocities are included. Numbers of a `Piecewise` wall path are
        not included, because they must fit together.
    uncertainty : float or mapping, optional
        Standard uncertainties of independent parameters, in their units or relative:
        ``{"restitution": 0.01, "gap": "5%"}``. A single number is the relative uncertainty of every parameter.
    executor : concurrent.futures.Executor, optional
        Executor for one task per parameter. Defaults to this process. The results are bitwise identical.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called after each parameter, with the fraction and the number of finished
        parameters.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    **fixed
        Other parameters, as in `granular.sweep`.

    Returns
    -------
    Sensitivity
        Derivatives with errors, condition numbers, and standard deviations of the outcomes.

    Raises
    ------
    TypeError, ValueError
        For misuse: an unknown parameter or result, a result that is an integer, an invalid scene.

    Notes
    -----
    Outcomes are smooth while all contacts begin and end in the same order. Derivatives are central differences of eight
    runs of the exact engines, at ± 2⁻⁷ … 2⁻¹⁰ of the parameter, extrapolated (Richardson) to about ten digits. Two more
    runs, much closer to the value, show whether the order changes at the value itself. Steps are halved until all runs
    have the same order, and further if this reduces the error. The error is the difference of two estimates.

    At a gap of 0, the derivative is one-sided, towards larger gaps. It is also one-sided if scenes on one side of a
    parameter are invalid.

    For thermal walls the random draws are held fixed. For fixed-step methods these are derivatives of the method's
    results, as far as these are smooth.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.sensitivity("three-balls", "v_rel[1]", uncertainty={"restitution": "1%"})
    >>> print(f"{found.gradient['v_rel[1]']['restitution']:.4f} {found.spread['v_rel[1]']:.4f}")
    0.4716 0.0047
    """
    checked_executor(executor)
    plan = _planned(
        scene, requested := check.several("results", results, "a name such as 'v_rel', or several", 1), fixed)
    answer = Answer(plan.case(()))
    *outcomes, order = (np.ravel(result.of(answer)).astype(float) for result in plan.results.values())
    places = _places_of_results(plan, outcomes)
    labels = [check.choice("results", _result_name(result, ""), list(places)) for result in requested]
    parameters = _parameters(plan, over, uncertainty, answer)
    uncertainties = _standard_uncertainties(uncertainty, parameters)
    scales, outcome_vector = _sizes(plan, answer, outcomes), np.concatenate(outcomes)
    starts = tuple(Start(name, value=p, step_unit=_unit(name, parameters), uncertainty=uncertainties.get(name, 0.0),
                         outcomes=outcome_vector, scales=scales, order=int(order[0])) for name, p in parameters.items())
    with progress_callback(progress, on_progress, "parameters") as tell:
        slopes: dict[int, Slope] = {}
        for k, result in run_tasks(executor, slope, ((plan, start) for start in starts)):
            slopes[k] = result
            if tell is not None:
                tell(len(slopes) / len(starts), len(slopes))
    return _assembled(plan, starts, [slopes[k] for k in range(len(starts))], {label: places[label] for label in labels})


def _result_name(asked: RequestedResult, until: str = "[") -> str:
    """Return the name of a result up to the string `until`: "v_rel" for "v_rel[1]".

    An empty `until` keeps the whole name.
    """
    return named(asked).partition(until)[0] if until else named(asked)


def _planned(scene: SceneLike, requested: Sequence[RequestedResult], fixed: Mapping[str, Any]) -> Plan:
    """Return the plan of all runs, with the order of events as the last result."""
    results = {_result_name(result): result if callable(result) else _result_name(result) for result in requested}
    plan = make_plan(scene, {}, tuple(results.values()), fixed)
    for name in [name for name, result in plan.results.items() if isinstance(result.fill, int)]:
        raise ValueError(f"`results` must be continuous outcomes, got {name!r}, an integer, which has no derivative. "
                         "To find where the number of contacts changes, use granular.sweep(..., refine=).")
    return replace(plan, asked=(*plan.asked, "order"), at_once=False)


def _places_of_results(plan: Plan, outcomes: Sequence[Array]) -> dict[str, Any]:
    """Return the positions of the results in the vector of all outcomes, by name.

    The name of a result with several values, such as "v_rel", stands for the array of their positions. The name of each
    value, such as "v_rel[1]", and the name of a result with a single value stand for one integer.
    """
    places: dict[str, Any] = {}
    ends = np.cumsum([0, *map(len, outcomes)]).tolist()
    for (name, result), begin, end in zip(plan.results.items(), ends, ends[1:], strict=False):
        places |= {f"{name}[{i}]": begin + i for i in range(end - begin)} if result.dim else {}
        places[name] = np.arange(begin, end) if result.dim else begin
    return places


def _parameters(plan: Plan, over: str | Sequence[str] | None, uncertainty: Any, answer: Answer) -> dict[str, float]:
    """Return the values of the parameters by name, including uncertain parameters.

    A name without an index stands for all entries of a list, which must be equal. `answer` contains the runs that the
    outcomes needed.
    """
    all_numbers, computed = numbers_in(plan.subject, plan.root), vars(answer).keys()
    names = [] if over is None else check.several("over", over, "a name, or several")
    if over is None:
        # all numbers, except those of a rule or law that the outcomes do not use, zeros other than gaps and velocities,
        # and the fields of a wall path, which cannot be varied one by one
        unused_parts = ["rule"] * (not computed & {"hard", "report"}) + (
            ["law"] * (not computed & {"soft", "report"} and answer.case.rule is not None))
        names = [name for name, p in all_numbers.items() if (p or name.startswith(ZERO_PARAMETERS))
                 and not name.startswith(tuple(unused_parts)) and not any(word in name for word in JOINED_FIELDS)]
    names += list(uncertainty) if isinstance(uncertainty, Mapping) else []
    # all values of each name: of the entry itself, or of all entries of a list
    values = {name: {p for key, p in all_numbers.items()
                     if name.removeprefix("scene.") in (key, re.sub(r"\[\d+\]", "", key))}
              for name in names}
    # gap and restitution are not fields of a case, but follow from its scene and laws
    if isinstance(plan.root, Case) and not values.keys().isdisjoint(("gap", "restitution")):
        values |= {name: {p} for name, p in common_parameters(answer.case).items() if name in values}
    # a name without a value is not a number, a name with several values is ambiguous
    for name in [name for name, candidates in values.items() if len(candidates) != 1]:
        plan.subject.way(name)
        raise ValueError((
            f"The parameter {name} must have one value, got {len(values[name])} different ones. Give it one value, or "
            "name one entry, such as " if values[name] else
            f"The parameter {name} is not a number that can vary continuously. Name another parameter, such as "
        ) + ", ".join([p for p in all_numbers if p.startswith(f"{name}[") or not values[name]][:3]) + ".")
    if not names:
        raise ValueError(f"`over` must have at least one parameter, such as {', '.join(list(all_numbers)[:1])}, got "
                         "an empty list.")
    return {name: candidates.pop() for name, candidates in values.items()}


def _standard_uncertainties(uncertainty: Any, parameters: Mapping[str, float]) -> dict[str, float]:
    """Return standard uncertainties in the units of the parameters, by name."""
    uncertainties = uncertainty if isinstance(uncertainty, Mapping) else (
        {} if uncertainty is None else dict.fromkeys(parameters, uncertainty))
    result = {}
    for name, entry in uncertainties.items():
        is_relative = uncertainties is not uncertainty or str(entry).endswith("%")
        try:
            value = (float(entry.rstrip("%")) * (0.01 if entry.endswith("%") else 1.0)
                     if isinstance(entry, str) else entry)
        except ValueError:  # `check.number` then raises its message
            value = entry
        value = check.number(f"the uncertainty of {name}", value, at_least=0.0, fix="Write 1 % as '1%'.")
        result[name] = value * (abs(parameters[name]) if is_relative else 1.0)
    return result


def _unit(name: str, parameters: Mapping[str, float]) -> float:
    """Return the power of two that is the unit of difference steps for a parameter.

    It is at most the absolute value of the parameter, and more than half of it. For a parameter that is 0, the largest
    similar parameter is used, such as another gap, or else 1.
    """
    similar = [p for other_name, p in parameters.items() if other_name.partition("[")[0] == name.partition("[")[0]]
    return 2.0 ** math.floor(math.log2(abs(parameters[name]) or max(map(abs, similar)) or 1.0))


def _sizes(plan: Plan, answer: Answer, outcomes: Sequence[Array]) -> Array:
    """Return the scale of each outcome for relative changes, shape (m,).

    It is the absolute value of the outcome. Near 0, it is the fastest impact of the component for speeds, and the
    largest value of the same result for other quantities.
    """
    run = answer.hard if "soft" not in vars(answer) and answer.case.law is None else answer.soft
    parts, speed, sizes = components(run, run), np.zeros(run.scene.n_pairs), []
    np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)
    for values, result in zip(outcomes, plan.results.values(), strict=False):
        component_of = {"pair": parts.of_pair, "body": parts.of_ball}.get(result.dim if result.units == "m s-1" else "")
        largest = np.full(len(values), np.nanmax(np.abs(values), initial=0.0))
        unit = largest if component_of is None else (
            np.where(fastest[component_of] > 0.0, fastest[component_of], largest))
        sizes.append(np.where(np.abs(values) >= ERROR_LIMIT * unit, np.abs(values), unit))
    size = np.concatenate(sizes)
    return np.where(size > 0.0, size, 1.0)


def _assembled(
    plan: Plan, starts: tuple[Start, ...], slopes: Sequence[Slope], places: Mapping[str, Any]
) -> Sensitivity:
    """Return the report of all derivatives. Derivatives with large errors are nan.

    `places` has the positions of the requested results in the vector of outcomes.
    """
    outcomes, scales = starts[0].outcomes, starts[0].scales
    parameter, uncertainty, step_unit = (
        np.array([[getattr(entry, name)] for entry in starts]) for name in ("value", "uncertainty", "step_unit"))
    value, error = (np.array([entry[k] for entry in slopes]) for k in (0, 1))
    relative = step_unit * error / (np.nansum(np.abs(step_unit * value), axis=0) + scales)
    value = np.where(relative <= MAX_DERIVATIVE_ERROR, value, math.nan)
    # p ∂y/∂p = ∂y/∂ln p, or ∂y/∂p for a parameter p ≤ 0
    factor = np.where(parameter > 0.0, parameter, 1.0)
    # standard deviation of each outcome (second axis) due to one parameter (first axis)
    change = np.where(uncertainty > 0.0, uncertainty * np.abs(value), 0.0)
    # Σ |p/y ∂y/∂p| over the parameters
    condition = np.where(parameter == 0.0, 0.0, np.abs(parameter * value)).sum(axis=0) / scales
    sides = {}
    for k, (start, (*_, outcomes_at_limits)) in enumerate(zip(starts, slopes, strict=True)):
        if outcomes_at_limits is not None:
            sides[start.name], change[k] = (
                outcomes_at_limits, np.fmax.reduce(np.abs(outcomes_at_limits - outcomes), axis=0))
    spread = np.sqrt((change**2).sum(axis=0)) if uncertainty.any() else np.full_like(outcomes, math.nan)

    def by_parameter(rows: Mapping[str, Array]) -> dict[str, dict[str, Any]]:
        """Return one vector per parameter as a dict by result, then by parameter."""
        return {name: {entry: _by_result(row, places)[name] for entry, row in rows.items()} for name in places}

    names, heated = [start.name for start in starts], plan.case(()).scene.heated
    return Sensitivity(
        title=plan.subject.title,
        value=_by_result(outcomes, places),
        gradient=by_parameter(dict(zip(names, factor * value, strict=True))),
        error=by_parameter(dict(zip(names, factor * error, strict=True))),
        condition=_by_result(condition, places),
        spread=_by_result(spread, places),
        parameters={start.name: start.value for start in starts},
        uncertainty={start.name: start.uncertainty for start in starts if start.uncertainty},
        sides={name: {varied: tuple(_by_result(end, places)[name] for end in ends) for varied, ends in sides.items()}
               for name in places},
        why=_reasons(starts, slopes, np.isnan(value) & ~np.isnan(outcomes), relative),
        notes=("Draws of thermal walls are held fixed.",) * heated,
        _starts=starts,
        _borders=partial(borders, plan),
        _units=_units(plan, names),
    )


def _by_result(vector: Array, places: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of each requested result from a vector of outcomes."""
    return {name: vector[place] if np.ndim(place) else float(vector[place]) for name, place in places.items()}


def _reasons(starts: Sequence[Start], slopes: Sequence[Slope], missing: Any, relative: Array) -> dict[str, str]:
    """Return why derivatives are missing, by parameter.

    `missing` marks these derivatives by parameter and outcome. `relative` has the relative errors of all derivatives.
    """
    reasons = {}
    for start, (_, _, reason, _), is_missing, errors in zip(starts, slopes, missing, relative, strict=True):
        if is_missing.any():
            worst = np.fmax.reduce(errors[is_missing])
            reasons[start.name] = reason or ("differences do not agree" if np.isnan(worst) else
                                         f"differences agree to {worst:.1g} of the outcome, no better")
    return reasons


def _units(plan: Plan, parameters: Iterable[str]) -> dict[str, str]:
    """Return the unit of each result and parameter, empty for pure numbers."""
    units = {name: result.units for name, result in plan.results.items()}
    units |= {name: plan.subject.attributes(name)["units"] for name in parameters}
    return {name: "" if unit == "1" else unit for name, unit in units.items()}


def borders(plan: Plan, start: Start) -> tuple[float, float]:
    """Return the parameter values below and above at which a contact count changes.

    They are nan if no count changes within the range of the scan.
    """
    count_name = "hard_contacts" if all(name.startswith("hard_") for name in [*plan.results][:-1]) else "contacts"
    plan_of_counts = replace(plan, asked=(count_name,), names=(start.name,))

    def counts(columns: Sequence[Array]) -> Array:
        return np.asarray(solve(plan_of_counts, columns).columns[count_name])

    grid = start.value + start.step_unit * np.concatenate([-BORDER_REACH[::-1], [0.0], BORDER_REACH])
    counts_on_grid = counts([grid])
    change = np.flatnonzero((counts_on_grid[1:] != counts_on_grid[:-1]).any(axis=1))

    def nearest(k: int) -> tuple[float, float]:
        _, ends, _ = bisect_jumps(0, [grid[k : k + 2]], counts_on_grid[k : k + 2], (2,), counts, BORDER_PRECISION)
        return (ends[0, 1], ends[-1, 0]) if len(ends) else (math.nan, math.nan)

    below, above = change[change < len(BORDER_REACH)][-1:].tolist(), change[change >= len(BORDER_REACH)][:1].tolist()
    return nearest(below[0])[1] if below else math.nan, nearest(above[0])[0] if above else math.nan
