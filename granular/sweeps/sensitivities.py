"""`sensitivity`: what outcomes answer to, and how uncertain they are where parameters are.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from granular import _check
from granular._check import Array
from granular._progress import shown
from granular.outcome import SAME, approach, components
from granular.sweeps.gradients import Sensitivity
from granular.sweeps.plan import Ask, Plan, planned
from granular.sweeps.results import CODE, Answer
from granular.sweeps.schedule import checked
from granular.sweeps.slopes import Slope, Start, slope
from granular.sweeps.subject import SceneLike, numbers_in
from granular.trajectory import EARLY

TRUSTED = 1e-6
"""Error of a derivative, as a share of all that the outcome answers to, up to which it is given."""
ORDER, JOINED = "order", ("breaks", "coefficients")
"""The result that stands for the order of events; numbers of a wall's path that must fit each other."""


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
    runs of the exact engines, at ± 2⁻⁷ … 2⁻¹⁰ of the parameter, extrapolated (Richardson) to some ten digits. Steps are
    halved until all runs have the same order, and further where that makes the error smaller, which is the difference
    of two estimates. A gap of 0 has its derivative to larger gaps, and so has a parameter beside which scenes are
    refused.

    Beside thermal walls the draws are held fixed. Runs by fixed time steps are no smooth functions: their derivatives
    are mostly not given.

    Examples
    --------
    >>> import granular as gr
    >>> found = gr.sensitivity("three-balls", "v_rel[1]", uncertainty={"restitution": "1%"})
    >>> print(f"{found.gradient['v_rel[1]']['restitution']:.4f} {found.spread['v_rel[1]']:.4f}")
    0.4716 0.0047
    """
    checked(executor)
    asked = [results] if isinstance(results, str) or callable(results) else list(results)
    plan = _planned(scene, asked, fixed)
    answer = Answer(plan.case(()))
    outcomes = {name: np.ravel(result.of(answer)).astype(float) for name, result in plan.results.items()}
    places, here = dict(_places(plan, asked, outcomes)), np.concatenate(list(outcomes.values())[:-1])
    parameters = _parameters(plan, over, uncertainty, answer)
    doubt = _uncertain(uncertainty, parameters)
    size, status = _sizes(plan, answer, outcomes), answer.status(plan.results)
    starts = tuple(Start(name, p, _unit(name, p, parameters), doubt.get(name, 0.0), here, size,
                         int(outcomes[ORDER][0])) for name, p in parameters.items())
    early = next((one for one in EARLY if CODE[one.name] == status), None)
    with shown(progress, on_progress, "parameters") as tell:
        if early is not None:
            none = np.full_like(here, math.nan)
            slopes = [Slope(none, none, f"the run ended early, {early.name}: {early.value}", none, False)] * len(starts)
        else:
            slopes = list(_solved(plan, starts, executor, tell))
    return _made(plan, starts, slopes, places, answer)


def _planned(scene: SceneLike, asked: Sequence[Ask], fixed: Mapping[str, Any]) -> Plan:
    """What is asked of every scene: results, the order of events last."""
    names = [name.partition("[")[0] if isinstance(name, str) else name for name in asked]
    plan = planned(scene, {}, tuple(dict.fromkeys(names)), fixed, {})
    if not names:
        raise ValueError("results is empty: at least one outcome is needed, such as 'v_rel'.")
    for name, result in plan.results.items():
        if isinstance(result.fill, int):
            raise ValueError(f"results has {name!r}, a whole number, which has no derivative but jumps: "
                             "granular.sweep(..., refine=) finds where contacts do.")
    return replace(plan, asked=(*plan.asked, ORDER), at_once=False)


def _places(plan: Plan, asked: Sequence[Ask], outcomes: Mapping[str, Array]) -> Iterator[tuple[str, int | slice]]:
    """Where the numbers of each outcome that was asked for stand among all: a place, or a slice."""
    ends = dict(zip(outcomes, np.cumsum([len(values) for values in outcomes.values()]).tolist(), strict=True))
    for one in asked:
        label = one if isinstance(one, str) else one.__name__
        name, _, index = label.partition("[")
        start, end = ends[name] - len(outcomes[name]), ends[name]
        if not index:
            yield label, slice(start, end) if plan.results[name].dim else start
            continue
        each = [f"{name}[{i}]" for i in range(end - start)] if plan.results[name].dim else [name]
        yield label, start + each.index(_check.choice("result", label, each))


def _parameters(plan: Plan, over: str | Sequence[str] | None, uncertain: Any, answer: Answer) -> dict[str, float]:
    """The parameters by name, with their values; those that are uncertain are among them."""
    known = numbers_in(plan.subject, plan.root)
    names = [over] if isinstance(over, str) else list(over or ())
    if over is None:
        ran = vars(answer)
        idle = {"rule": not {"hard", "report"} & ran.keys(), "law": answer.case.rule and not {"soft", "report"} & ran.keys()}
        names = [name for name, p in known.items() if not idle.get(re.split(r"[.\[]", name)[0])
                 and (p != 0.0 or name.startswith(("gap", "velocity"))) and not any(map(name.__contains__, JOINED))]
    names += list(uncertain) if isinstance(uncertain, Mapping) else []
    if not names:
        raise ValueError(f"over is empty: at least one parameter is needed, such as {next(iter(known), 'gap')}.")
    return {name: _number(plan, name, known) for name in names}


def _number(plan: Plan, name: str, known: Mapping[str, float]) -> float:
    """The value of a parameter; one word for several is one parameter if they are alike."""
    way = plan.subject.way(name)
    ways = {one: plan.subject.way(one) for one in known}
    found = {known[one] for one in known if ways[one] == way} or {
        known[one] for one in known if tuple(step for step in ways[one] if isinstance(step, str)) == way}
    if len(found) > 1:
        raise ValueError(f"{name} stands for numbers that differ: name one of them, such as {name}[0].")
    if not found:
        raise ValueError(f"{name} has no value that can be changed a little: give it one, or name another, such as "
                         f"{', '.join(list(known)[:3])}.")
    return found.pop()


def _uncertain(given: Any, parameters: Mapping[str, float]) -> dict[str, float]:
    """Standard uncertainties in units of the parameters."""
    each = given if isinstance(given, Mapping) else {} if given is None else dict.fromkeys(parameters, given)
    found = {}
    for name, one in each.items():
        text = one.strip() if isinstance(one, str) else ""
        try:
            value = float(text.rstrip("%")) * (0.01 if text.endswith("%") else 1.0) if text else one
        except ValueError:
            value = one
        relative = each is not given or text.endswith("%")
        doubt = _check.number(f"uncertainty of {name}", value, at_least=0.0, fix="of 1 % it is '1%'")
        found[name] = doubt * (abs(parameters[name]) if relative else 1.0)
    return found


def _unit(name: str, value: float, parameters: Mapping[str, float]) -> float:
    """The power of two that steps are parts of: about the parameter; of one that is 0, about the largest beside it."""
    if value == 0.0:
        alike = [abs(p) for other, p in parameters.items() if other.partition("[")[0] == name.partition("[")[0]]
        value = max(alike) or 1.0
    return 2.0 ** math.floor(math.log2(abs(value)))


def _sizes(plan: Plan, answer: Answer, outcomes: Mapping[str, Array]) -> Array:
    """What relative changes of each outcome are relative to: itself, or where it is near 0, the fastest impact of its
    component; for others than speeds, the largest of its kind."""
    run = answer.hard if "soft" not in vars(answer) and answer.case.law is None else answer.soft
    parts, speed, sizes = components(run, run), np.zeros(run.scene.n_pairs), []
    np.maximum.at(speed, run.contacts["pair"], approach(run))
    fastest = np.append(parts.largest(speed), 0.0)
    for name, values in outcomes.items():
        result, most = plan.results[name], float(np.nanmax(np.abs(values), initial=0.0))
        of = {"pair": parts.of_pair, "body": parts.of_ball}.get(result.dim if result.units == "m s-1" else "")
        unit = np.full(len(values), most) if of is None else np.where(fastest[of] > 0.0, fastest[of], most)
        sizes.append(np.where(np.abs(values) >= SAME * unit, np.abs(values), unit))
    size = np.concatenate(sizes[:-1])
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


def _made(
    plan: Plan, starts: tuple[Start, ...], slopes: Sequence[Slope], places: Mapping[str, Any], answer: Answer,
) -> Sensitivity:
    """Put everything together; what is not known well enough is not given."""
    here, size = starts[0].here, starts[0].size
    p, u, unit = (np.array([[getattr(one, name)] for one in starts]) for name in ("value", "doubt", "unit"))
    value, error = (np.array([getattr(one, name) for one in slopes]) for name in ("value", "error"))
    answers = np.nansum(np.abs(unit * value), axis=0) + size
    value = np.where(unit * error <= TRUSTED * answers, value, math.nan)
    logarithmic, scale = np.where(p == 0.0, 0.0, p * value), np.where(p > 0.0, p, 1.0)
    moved = np.where(u > 0.0, u * np.abs(value), 0.0)
    sides, why = {}, {}
    for k, (start, one) in enumerate(zip(starts, slopes, strict=True)):
        if one.changes:
            moved[k] = np.nanmax(np.abs(one.ends - here), axis=0)
            sides[start.name] = one.ends
        if (missing := np.isnan(value[k]) & ~np.isnan(here)).any():
            far = float(np.max((unit[k] * error[k] / answers)[missing]))
            why[start.name] = one.why or f"differences agree to {far:.1g} of what the outcome answers to, no better"
    given, spread = np.abs(logarithmic).sum(axis=0) / size, np.sqrt((moved**2).sum(axis=0))

    def split(of: Array) -> dict[str, Any]:
        return {name: of[place].copy() if isinstance(place, slice) else float(of[place]) for name, place in places.items()}

    def by_name(each: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {name: {one: found[name] for one, found in each.items()} for name in places}

    names = [start.name for start in starts]
    return Sensitivity(
        plan.subject.title, split(here),
        by_name({name: split(one) for name, one in zip(names, scale * value, strict=True)}),
        by_name({name: split(one) for name, one in zip(names, scale * error, strict=True)}),
        split(given), split(spread if u.any() else np.full_like(here, math.nan)),
        {start.name: start.value for start in starts}, {start.name: start.doubt for start in starts if start.doubt},
        {name: {one: tuple(split(end)[name] for end in ends) for one, ends in sides.items()} for name in places},
        why, ("Draws of thermal walls are held fixed.",) * answer.case.scene.heated, plan, starts)
