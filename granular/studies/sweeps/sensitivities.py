"""`sensitivity`: derivatives of outcomes by parameters, and uncertainties.

Derivatives are extrapolated differences of runs with the same order of events.
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

from granular._engine import check
from granular._engine.check import Array
from granular._engine.progress import shown
from granular.cases import Case
from granular.comparison.outcome import ERROR_LIMIT, approach, components
from granular.run.trajectory import EARLY_STATUSES
from granular.studies.sweeps.plan import Ask, Plan, named, planned
from granular.studies.sweeps.results import MISUSE_CODE, STATUS_CODES
from granular.studies.sweeps.run import edges
from granular.studies.sweeps.schedule import Answer, checked, each_done, solve
from granular.studies.sweeps.sensitivity_report import Sensitivity, Start
from granular.studies.sweeps.subject import SceneLike, numbers_in, shared

MAX_DERIVATIVE_ERROR = 1e-8
"""Largest given error of a derivative, as a share of the total sensitivity."""
ZERO_PARAMETERS, JOINED_FIELDS = ("gap", "velocity"), ("breaks", "coefficients")
"""Fields that are parameters even if 0, and fields of a path that fit together."""
FIRST_STEP_EXPONENT, LAST_STEP_EXPONENT = 7, 26
"""Steps are 2^-7 of the parameter, or of its unit, at first, and at least 2^-26."""
NEGLIGIBLE_ERROR = 1e-10
"""Errors below this share of an outcome, per relative change, are small enough."""
NO_ORDER = -2
"""Order of a run that did not end properly, or was refused."""
OUTCOME_ROUNDING = 2.0 * float(np.finfo(float).eps)
"""Relative rounding error of an outcome."""
BORDER_PRECISION = 1e-6
"""Share of the parameter to which a border is known."""
BAD_STATUSES = {MISUSE_CODE, *(STATUS_CODES[status.name] for status in EARLY_STATUSES)}
BORDER_REACH = 4.0 ** np.arange(-8, 1)
"""Range of the scan for borders, in units of a parameter."""
Point = tuple[Array, int]
Evaluate = Callable[[float], Point]
Slope = tuple[Array, Array, str, Array | None]
"""Derivative (m,) by one parameter, its error, reason for nan, and outcomes.

The outcomes (2, m) at both ends of the uncertain interval are None if the order of contacts does not change there.
"""


@check.face
def sensitivity(
    scene: SceneLike,
    results: Ask | Sequence[Ask] = ("v_rel",),
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
        ``on_progress(reached, count)`` is called after each parameter with the share and the number of finished ones.
    progress : bool
        Show the progress on standard error after 2 s, as a bar if tqdm is installed.
    **fixed
        Other parameters, as in `granular.sweep`.

    Returns
    -------
    Sensitivity
        Derivatives with errors, condition numbers, and standard deviations of the outcomes.

    Raises
    ------
    TypeError, ValueError
        For misuse: an unknown parameter or result, a result that is an integer, a scene that is refused.

    Notes
    -----
    Outcomes are smooth while all contacts begin and end in the same order. Derivatives are central differences
    of eight runs of the exact engines, at ± 2⁻⁷ … 2⁻¹⁰ of the parameter, extrapolated (Richardson) to about ten
    digits. Two more runs, much nearer, show whether the order changes at the value itself. Steps are halved until all
    runs have the same order, and further if this reduces the error, which is the difference of two estimates. A gap of
    0 has a derivative to larger gaps, and a parameter beside which scenes are refused one to the other side.

    For thermal walls the random draws are held fixed. For fixed-step methods these are derivatives of the method's
    results, as far as these are smooth.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.sensitivity("three-balls", "v_rel[1]", uncertainty={"restitution": "1%"})
    >>> print(f"{found.gradient['v_rel[1]']['restitution']:.4f} {found.spread['v_rel[1]']:.4f}")
    0.4716 0.0047
    """
    checked(executor)
    plan = _planned(scene, asked := check.several("results", results, "a name such as 'v_rel', or several", 1), fixed)
    answer = Answer(plan.case(()))
    *found, order = (np.ravel(result.of(answer)).astype(float) for result in plan.results.values())
    places = _places(plan, found)
    labels = [check.choice("result", _name(one, ""), list(places)) for one in asked]
    parameters = _parameters(plan, over, uncertainty, answer)
    doubt = _uncertain(uncertainty, parameters)
    size, here = _sizes(plan, answer, found), np.concatenate(found)
    starts = tuple(Start(name, p, _unit(name, parameters), doubt.get(name, 0.0), here, size, int(order[0]))
                   for name, p in parameters.items())
    with shown(progress, on_progress, "parameters") as tell:
        slopes: dict[int, Slope] = {}
        for k, one in each_done(executor, slope, ((plan, start) for start in starts)):
            slopes[k] = one
            if tell is not None:
                tell(len(slopes) / len(starts), len(slopes))
    return _made(plan, starts, [slopes[k] for k in range(len(starts))], {label: places[label] for label in labels})


def _name(asked: Ask, until: str = "[") -> str:
    """Return the name of a result without the index of a single number."""
    return named(asked).partition(until)[0] if until else named(asked)


def _planned(scene: SceneLike, asked: Sequence[Ask], fixed: Mapping[str, Any]) -> Plan:
    """Return the plan of all runs, with the order of events as the last result."""
    each = {_name(one): one if callable(one) else _name(one) for one in asked}
    plan = planned(scene, {}, tuple(each.values()), fixed)
    for name in [name for name, result in plan.results.items() if isinstance(result.fill, int)]:
        raise ValueError(f"`results` must be continuous outcomes, got {name!r}, an integer, which has no derivative. "
                         "Where the number of contacts changes is found by granular.sweep(..., refine=).")
    return replace(plan, asked=(*plan.asked, "order"), at_once=False)


def _places(plan: Plan, found: Sequence[Array]) -> dict[str, Any]:
    """Return the places of each result among all numbers, and the single places."""
    places: dict[str, Any] = {}
    ends = np.cumsum([0, *map(len, found)]).tolist()
    for (name, result), begin, end in zip(plan.results.items(), ends, ends[1:], strict=False):
        places |= {f"{name}[{i}]": begin + i for i in range(end - begin)} if result.dim else {}
        places[name] = np.arange(begin, end) if result.dim else begin
    return places


def _parameters(plan: Plan, over: str | Sequence[str] | None, uncertain: Any, answer: Answer) -> dict[str, float]:
    """Return the parameters by name, with their values.

    Uncertain parameters are included. A name without its index stands for equal entries of a list.
    """
    known, ran = numbers_in(plan.subject, plan.root), vars(answer).keys()
    names = [] if over is None else check.several("over", over, "a name, or several")
    if over is None:
        idle = ["rule"] * (not ran & {"hard", "report"}) + (
            ["law"] * (not ran & {"soft", "report"} and answer.case.rule is not None))
        names = [name for name, p in known.items() if (p or name.startswith(ZERO_PARAMETERS))
                 and not name.startswith(tuple(idle)) and not any(word in name for word in JOINED_FIELDS)]
    names += list(uncertain) if isinstance(uncertain, Mapping) else []
    values = {name: {p for one, p in known.items() if name.removeprefix("scene.") in (one, re.sub(r"\[\d+\]", "", one))}
              for name in names}
    if isinstance(plan.root, Case) and not values.keys().isdisjoint(("gap", "restitution")):
        values |= {name: {p} for name, p in shared(answer.case).items() if name in values}
    for name in [name for name, found in values.items() if len(found) != 1]:
        plan.subject.way(name)
        raise ValueError(f"The parameter {name} must have one value that can vary continuously, got "
                         f"{len(values[name])}. Give it one value, or name another parameter, such as "
                         f"{', '.join(list(known)[:3])}.")
    if not names:
        raise ValueError(f"`over` must have at least one parameter, such as {', '.join(list(known)[:1])}, got an empty "
                         "list.")
    return {name: found.pop() for name, found in values.items()}


def _uncertain(given: Any, parameters: Mapping[str, float]) -> dict[str, float]:
    """Return standard uncertainties in units of the parameters."""
    each = given if isinstance(given, Mapping) else {} if given is None else dict.fromkeys(parameters, given)
    found = {}
    for name, one in each.items():
        share = each is not given or str(one).endswith("%")
        try:
            value = float(one.rstrip("%")) * (0.01 if one.endswith("%") else 1.0) if isinstance(one, str) else one
        except ValueError:
            value = one
        value = check.number(f"the uncertainty of {name}", value, at_least=0.0, fix="Write 1 % as '1%'.")
        found[name] = value * (abs(parameters[name]) if share else 1.0)
    return found


def _unit(name: str, parameters: Mapping[str, float]) -> float:
    """Return the power of two that serves as the unit of difference steps.

    It is near the parameter, or near the largest similar one if the parameter is 0.
    """
    beside = [p for other, p in parameters.items() if other.partition("[")[0] == name.partition("[")[0]]
    return 2.0 ** math.floor(math.log2(abs(parameters[name]) or max(map(abs, beside)) or 1.0))


def _sizes(plan: Plan, answer: Answer, found: Sequence[Array]) -> Array:
    """Return the scales for relative changes of the outcomes.

    They are the outcomes themselves, or near 0 the fastest impact of the component. For other quantities than speeds
    it is the largest one of the kind.
    """
    run = answer.hard if "soft" not in vars(answer) and answer.case.law is None else answer.soft
    parts, speed, sizes = components(run, run), np.zeros(run.scene.n_pairs), []
    np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)
    for values, result in zip(found, plan.results.values(), strict=False):
        of = {"pair": parts.of_pair, "body": parts.of_ball}.get(result.dim if result.units == "m s-1" else "")
        most = np.full(len(values), np.nanmax(np.abs(values), initial=0.0))
        unit = most if of is None else np.where(fastest[of] > 0.0, fastest[of], most)
        sizes.append(np.where(np.abs(values) >= ERROR_LIMIT * unit, np.abs(values), unit))
    size = np.concatenate(sizes)
    return np.where(size > 0.0, size, 1.0)


def _made(plan: Plan, starts: tuple[Start, ...], slopes: Sequence[Slope], places: Mapping[str, Any]) -> Sensitivity:
    """Return the report. Derivatives with large errors are left out."""
    here, size = starts[0].here, starts[0].size
    p, u, unit = (np.array([[getattr(one, name)] for one in starts]) for name in ("value", "doubt", "unit"))
    value, error = (np.array([one[k] for one in slopes]) for k in (0, 1))
    far = unit * error / (np.nansum(np.abs(unit * value), axis=0) + size)
    value = np.where(far <= MAX_DERIVATIVE_ERROR, value, math.nan)
    scale, moved = np.where(p > 0.0, p, 1.0), np.where(u > 0.0, u * np.abs(value), 0.0)
    condition = np.where(p == 0.0, 0.0, np.abs(p * value)).sum(axis=0) / size
    sides, why = {}, {}
    for k, (start, (_, _, reason, ends)) in enumerate(zip(starts, slopes, strict=True)):
        if ends is not None:
            sides[start.name], moved[k] = ends, np.fmax.reduce(np.abs(ends - here), axis=0)
        if (missing := np.isnan(value[k]) & ~np.isnan(here)).any():
            worst = np.fmax.reduce(far[k][missing])
            why[start.name] = reason or ("differences do not agree" if np.isnan(worst) else
                                         f"differences agree to {worst:.1g} of the outcome, no better")
    spread = np.sqrt((moved**2).sum(axis=0)) if u.any() else np.full_like(here, math.nan)

    def split(of: Array) -> dict[str, Any]:
        return {name: of[place] if np.ndim(place) else float(of[place]) for name, place in places.items()}

    def by_parameter(rows: Mapping[str, Array]) -> dict[str, dict[str, Any]]:
        return {name: {one: split(row)[name] for one, row in rows.items()} for name in places}

    names, heated = [start.name for start in starts], plan.case(()).scene.heated
    return Sensitivity(
        plan.subject.title, split(here), by_parameter(dict(zip(names, scale * value, strict=True))),
        by_parameter(dict(zip(names, scale * error, strict=True))), split(condition), split(spread),
        {start.name: start.value for start in starts}, {start.name: start.doubt for start in starts if start.doubt},
        {name: {one: (split(low)[name], split(high)[name]) for one, (low, high) in sides.items()} for name in places},
        why, ("Draws of thermal walls are held fixed.",) * heated, starts, partial(borders, plan), _units(plan, names))


def _units(plan: Plan, parameters: Iterable[str]) -> dict[str, str]:
    """Return the unit of each result and parameter, empty for pure numbers."""
    units = {name: result.units for name, result in plan.results.items()}
    units |= {name: plan.subject.attributes(name)["units"] for name in parameters}
    return {name: "" if unit == "1" else unit for name, unit in units.items()}


def slope(plan: Plan, start: Start) -> Slope:
    """Return the derivative of all outcomes by one parameter."""
    one, none = replace(plan, names=(start.name,)), np.full_like(start.here, math.nan)

    def evaluate(value: float) -> Point:
        found = solve(one, [np.array([value])]).columns
        if int(found["status"][0]) in BAD_STATUSES:
            return none, NO_ORDER
        *values, order = (np.ravel(found[result]) for result in plan.results)
        return np.concatenate(values).astype(float), int(order[0])

    ends = [evaluate(start.value + side * start.doubt) for side in (-1.0, 1.0) if start.doubt]
    crossed = np.array([values for values, _ in ends]) if {order for _, order in ends} - {start.order} else None
    beside = [evaluate(start.value + side * start.unit * 2.0**-LAST_STEP_EXPONENT)[1] for side in (-1.0, 1.0)]
    sides: tuple[float, ...] = (-1.0, 1.0)
    if beside[0] == NO_ORDER or (start.value == 0.0 and start.name.startswith("gap")):
        sides, beside[0] = (1.0,), beside[1]
    elif beside[1] == NO_ORDER:
        sides, beside[1] = (-1.0,), beside[0]
    if NO_ORDER in beside:
        return none, none, "scenes beside it are refused, or come to no proper end", crossed
    if beside[0] != beside[1]:
        return none, none, "the order of contacts is another just below and just above it", crossed
    return *differences(evaluate, start, sides, beside[0]), "", crossed


def differences(evaluate: Evaluate, start: Start, sides: Sequence[float], order: int) -> tuple[Array, Array]:
    """Extrapolate differences of steps that are halved until runs have this `order`.

    Three central differences (five one-sided ones) make an estimate without terms up to h⁴. The next estimate differs
    by its error. Steps are halved further while the error decreases. nan without a result.
    """
    central, best = len(sides) == 2, np.full((2, len(start.here)), math.nan)
    (count, base), last, slopes = (3, 4.0) if central else (5, 2.0), best[0], list[Array]()
    for h in (start.unit * 0.5 ** np.arange(FIRST_STEP_EXPONENT, LAST_STEP_EXPONENT)).tolist():
        near = [evaluate(start.value + side * h) for side in sides]
        if any(one != order for _, one in near):
            slopes, last = [], np.full_like(last, math.nan)
            continue
        first = near[0][0] if central else start.here
        slopes = [*slopes, (near[-1][0] - first) / (sides[-1] * h * len(sides))][-count:]
        if len(slopes) < count:
            continue
        now = extrapolated(slopes, base)
        error, last = np.abs(now - last) + OUTCOME_ROUNDING * start.size / h, now
        better = ~(error >= best[1]) & ~np.isnan(error)
        best = np.where(better, [now, error], best)
        if np.isfinite(best[1]).any() and not (better & (error * start.unit > NEGLIGIBLE_ERROR * start.size)).any():
            break
    return best[0], best[1]


def extrapolated(slopes: Sequence[Array], base: float) -> Array:
    """Richardson extrapolation for halved steps, with errors h² (4) or h (2)."""
    table = np.array(slopes)
    for j in range(1, len(slopes)):
        table = (base**j * table[1:] - table[:-1]) / (base**j - 1.0)
    return np.asarray(table[0])


def borders(plan: Plan, start: Start) -> tuple[float, float]:
    """Return values below and above at which a contact count changes, or nan."""
    kind = "hard_contacts" if all(name.startswith("hard_") for name in [*plan.results][:-1]) else "contacts"
    counting = replace(plan, asked=(kind,), names=(start.name,))

    def counts(columns: Sequence[Array]) -> Array:
        return np.asarray(solve(counting, columns).columns[kind])

    grid = start.value + start.unit * np.concatenate([-BORDER_REACH[::-1], [0.0], BORDER_REACH])
    found = counts([grid])
    change = np.flatnonzero((found[1:] != found[:-1]).any(axis=1))

    def nearest(k: int) -> tuple[float, float]:
        _, ends, _ = edges(0, [grid[k : k + 2]], found[k : k + 2], (2,), counts, BORDER_PRECISION)
        return (ends[0, 1], ends[-1, 0]) if len(ends) else (math.nan, math.nan)

    below, above = change[change < len(BORDER_REACH)][-1:].tolist(), change[change >= len(BORDER_REACH)][:1].tolist()
    return nearest(below[0])[1] if below else math.nan, nearest(above[0])[0] if above else math.nan
