"""`sensitivity`: what outcomes answer to, and how uncertain they are where parameters are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.progress import shown
from granular.cases import Case
from granular.comparison.outcome import SAME, approach, components
from granular.studies.sweeps import schedule
from granular.studies.sweeps.gradients import Sensitivity, Slope, Start, slope
from granular.studies.sweeps.plan import Ask, Plan, named, planned
from granular.studies.sweeps.results import Answer
from granular.studies.sweeps.subject import SceneLike, numbers_in, shared

TRUSTED = 1e-8
"""Error of a derivative, as a share of all that the outcome answers to, up to which it is given."""
FREE, JOINED = ("gap", "velocity"), ("breaks", "coefficients")
"""Numbers that are parameters also where they are 0; those of a wall's path that must fit each other."""


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
    """Find what outcomes answer to: derivatives by the numbers of a scene, condition numbers, and what is uncertain.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        What to ask about, as in `granular.sweep`.
    results : names, or functions of the case that return a number
        Outcomes: those of `granular.sweep` that are no whole numbers; ``"v_rel"`` of all pairs, ``"v_rel[1]"`` of one.
    over : names of parameters, optional
        As in `granular.sweep`. Default: every number of the scene, and of its laws or rule if the outcomes need them;
        of those that are 0 gaps and velocities only, and none of a wall's path that is `Piecewise`, whose must join.
    uncertainty : float or mapping, optional
        Standard uncertainties of parameters, independent of each other, in their units or relative:
        ``{"restitution": 0.01, "gap": "5%"}``; one number is relative, of every parameter.
    executor : concurrent.futures.Executor, optional
        Where to run, a parameter at a time; default this process. The result is the same, bit for bit.
    on_progress : callable, optional
        ``on_progress(reached, count)`` after each parameter: the share of them that is done, their number.
    progress : bool
        Show how far it is, from 2 s on: on standard error, as a bar where tqdm is installed.
    **fixed
        Other parameters, as in `granular.sweep`.

    Returns
    -------
    Sensitivity

    Raises
    ------
    TypeError, ValueError
        For misuse: an unknown parameter or result, a result that is a whole number, a scene that is refused.

    Notes
    -----
    Outcomes are smooth where all contacts begin and end in the same order. Derivatives are central differences of eight
    runs of the exact engines, at ± 2⁻⁷ … 2⁻¹⁰ of the parameter, extrapolated (Richardson) to some ten digits; two more
    runs, much nearer, tell whether the order changes right there. Steps are halved until all runs have the same order,
    and further where that makes the error smaller, which is the difference of two estimates. A gap of 0 has its
    derivative to larger gaps; a parameter beside which scenes are refused, to the other side.

    Beside thermal walls the draws are held fixed. Of runs by a fixed time step these are the derivatives of what the
    method gives, as far as that is smooth.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.sensitivity("three-balls", "v_rel[1]", uncertainty={"restitution": "1%"})
    >>> print(f"{found.gradient['v_rel[1]']['restitution']:.4f} {found.spread['v_rel[1]']:.4f}")
    0.4716 0.0047
    """
    schedule.checked(executor)
    plan = _planned(scene, asked := check.several("results", results, "an outcome, such as 'v_rel',", 1), fixed)
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
        slopes = list(_solved(plan, starts, executor, tell))
    return _made(plan, starts, slopes, {label: places[label] for label in labels})


def _name(asked: Ask, until: str = "[") -> str:
    """The name of a result, up to which of its numbers is asked for."""
    return named(asked).partition(until)[0] if until else named(asked)


def _planned(scene: SceneLike, asked: Sequence[Ask], fixed: Mapping[str, Any]) -> Plan:
    """What is asked of every scene: results, the order of events last."""
    each = {_name(one): one if callable(one) else _name(one) for one in asked}
    plan = planned(scene, {}, tuple(each.values()), fixed)
    for name in [name for name, result in plan.results.items() if isinstance(result.fill, int)]:
        raise ValueError(f"results has {name!r}, a whole number, which has no derivative but jumps: "
                         "granular.sweep(..., refine=) finds where contacts do.")
    return replace(plan, asked=(*plan.asked, "order"), at_once=False)


def _places(plan: Plan, found: Sequence[check.Array]) -> dict[str, Any]:
    """Where among all numbers each result stands: one place, or one for each pair or body; and each of these."""
    places: dict[str, Any] = {}
    ends = np.cumsum([0, *map(len, found)]).tolist()
    for (name, result), begin, end in zip(plan.results.items(), ends, ends[1:], strict=False):
        places |= {f"{name}[{i}]": begin + i for i in range(end - begin)} if result.dim else {}
        places[name] = np.arange(begin, end) if result.dim else begin
    return places


def _parameters(plan: Plan, over: str | Sequence[str] | None, uncertain: Any, answer: Answer) -> dict[str, float]:
    """The parameters by name, with their values; those that are uncertain are among them. A word without its number
    stands for all of a list that are alike."""
    known, ran = numbers_in(plan.subject, plan.root), vars(answer).keys()
    names = [] if over is None else check.several("over", over, "a name, or several,")
    if over is None:
        idle = ["rule"] * (not ran & {"hard", "report"}) + (
            ["law"] * (not ran & {"soft", "report"} and answer.case.rule is not None))
        names = [name for name, p in known.items() if (p or name.startswith(FREE))
                 and not name.startswith(tuple(idle)) and not any(word in name for word in JOINED)]
    names += list(uncertain) if isinstance(uncertain, Mapping) else []
    values = {name: {p for one, p in known.items() if name.removeprefix("scene.") in (one, re.sub(r"\[\d+\]", "", one))}
              for name in names}
    if isinstance(plan.root, Case) and not values.keys().isdisjoint(("gap", "restitution")):
        values |= {name: {p} for name, p in shared(answer.case).items() if name in values}
    for name in [name for name, found in values.items() if len(found) != 1]:
        plan.subject.way(name)
        raise ValueError(f"{name} has {len(values[name]) or 'no'} values that can be changed a little: one is needed; "
                         f"give it one, or name another, such as {', '.join(list(known)[:3])}.")
    if not names:
        raise ValueError(f"over is empty: at least one parameter is needed, such as {', '.join(list(known)[:1])}.")
    return {name: found.pop() for name, found in values.items()}


def _uncertain(given: Any, parameters: Mapping[str, float]) -> dict[str, float]:
    """Standard uncertainties in units of the parameters."""
    each = given if isinstance(given, Mapping) else {} if given is None else dict.fromkeys(parameters, given)
    found = {}
    for name, one in each.items():
        share = each is not given or str(one).endswith("%")
        try:
            value = float(one.rstrip("%")) * (0.01 if one.endswith("%") else 1.0) if isinstance(one, str) else one
        except ValueError:
            value = one
        value = check.number(f"uncertainty of {name}", value, at_least=0.0, fix="of 1 % it is '1%'")
        found[name] = value * (abs(parameters[name]) if share else 1.0)
    return found


def _unit(name: str, parameters: Mapping[str, float]) -> float:
    """The power of two that steps are parts of: about the parameter; of one that is 0, about the largest beside it."""
    beside = [p for other, p in parameters.items() if other.partition("[")[0] == name.partition("[")[0]]
    return 2.0 ** math.floor(math.log2(abs(parameters[name]) or max(map(abs, beside)) or 1.0))


def _sizes(plan: Plan, answer: Answer, found: Sequence[check.Array]) -> check.Array:
    """What changes of an outcome are relative to: itself, or where it is near 0, the fastest impact of its component;
    for others than speeds, the largest of its kind."""
    run = answer.hard if "soft" not in vars(answer) and answer.case.law is None else answer.soft
    parts, speed, sizes = components(run, run), np.zeros(run.scene.n_pairs), []
    np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)
    for values, result in zip(found, plan.results.values(), strict=False):
        of = {"pair": parts.of_pair, "body": parts.of_ball}.get(result.dim if result.units == "m s-1" else "")
        most = np.full(len(values), np.nanmax(np.abs(values), initial=0.0))
        unit = most if of is None else np.where(fastest[of] > 0.0, fastest[of], most)
        sizes.append(np.where(np.abs(values) >= SAME * unit, np.abs(values), unit))
    size = np.concatenate(sizes)
    return np.where(size > 0.0, size, 1.0)


def _solved(plan: Plan, starts: Sequence[Start], executor: Executor | None, tell: Any) -> Iterator[Slope]:
    """Find all slopes, in this process or others."""
    futures = [executor.submit(slope, plan, start) for start in starts] if executor is not None else []
    try:
        for k, start in enumerate(starts):
            yield futures[k].result() if futures else slope(plan, start)
            if tell is not None:
                tell((k + 1) / len(starts), k + 1)
    finally:
        for future in futures:
            future.cancel()


def _made(plan: Plan, starts: tuple[Start, ...], slopes: Sequence[Slope], places: Mapping[str, Any]) -> Sensitivity:
    """Put everything together; what is not known well enough is not given."""
    here, size = starts[0].here, starts[0].size
    p, u, unit = (np.array([[getattr(one, name)] for one in starts]) for name in ("value", "doubt", "unit"))
    value, error = (np.array([one[k] for one in slopes]) for k in (0, 1))
    far = unit * error / (np.nansum(np.abs(unit * value), axis=0) + size)
    value = np.where(far <= TRUSTED, value, math.nan)
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

    def split(of: check.Array) -> dict[str, Any]:
        return {name: of[place] if np.ndim(place) else float(of[place]) for name, place in places.items()}

    def by_parameter(rows: Mapping[str, check.Array]) -> dict[str, dict[str, Any]]:
        return {name: {one: split(row)[name] for one, row in rows.items()} for name in places}

    names, heated = [start.name for start in starts], plan.case(()).scene.heated
    return Sensitivity(
        plan.subject.title, split(here), by_parameter(dict(zip(names, scale * value, strict=True))),
        by_parameter(dict(zip(names, scale * error, strict=True))), split(condition), split(spread),
        {start.name: start.value for start in starts}, {start.name: start.doubt for start in starts if start.doubt},
        {name: {one: (split(low)[name], split(high)[name]) for one, (low, high) in sides.items()} for name in places},
        why, ("Draws of thermal walls are held fixed.",) * heated, plan, starts)
