"""The derivative of results by one parameter: differences of runs with the same order of events, extrapolated.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from granular._check import Array
from granular.sweeps.plan import Plan
from granular.sweeps.results import CODE, MISUSE
from granular.sweeps.schedule import end_with_parent, solve
from granular.trajectory import EARLY

FIRST, LAST = 7, 26
"""Steps are 2^-7 of the parameter, or of its unit, at first, and 2^-26 at the least."""
FINE = 1e-10
"""Errors below this share of an outcome, per relative change of the parameter, are small enough."""
NOWHERE = -2
"""Order of a run that came to no proper end, or was refused."""
NARROW = 1e-6
"""Share of the parameter, or of its unit, to which a border is known."""
REFUSED, BAD = {MISUSE}, {CODE[status.name] for status in EARLY}
Point = tuple[Array, int]
Ask = Callable[[float], Point]


class Start(NamedTuple):
    """A parameter, its value, what its steps are parts of, how uncertain it is; the outcomes there (m,),
    sizes that they are measured by, and the order of events."""

    name: str
    value: float
    unit: float
    doubt: float
    here: Array
    size: Array
    order: int


class Slope(NamedTuple):
    """The derivative (m,) by one parameter and its error, nan where there is none; why; the outcomes (2, m) at either
    end of what is uncertain, nan where there are none, and whether the order changes there."""

    value: Array
    error: Array
    why: str
    ends: Array
    changes: bool


def point(plan: Plan, name: str, value: float) -> Point:
    """Outcomes (m,) with one parameter changed, and the order of events."""
    found = solve(replace(plan, names=(name,)), [np.array([value])]).columns
    good = int(found["status"][0]) not in REFUSED | BAD
    values = [np.ravel(found[result]) for result in plan.results if result != "order"]
    return np.concatenate(values).astype(float), int(found["order"][0]) if good else NOWHERE


def slope(plan: Plan, start: Start) -> Slope:
    """Find the derivative of all outcomes by one parameter; this may be done in another process."""
    end_with_parent(os.getpid())

    def ask(value: float) -> Point:
        return point(plan, start.name, value)

    ends = [ask(start.value + side * start.doubt) for side in (-1.0, 1.0)] if start.doubt else []
    changes = any(order != start.order for _, order in ends)
    none = np.full_like(start.here, math.nan)
    both = np.array([none if order == NOWHERE else values for values, order in ends] or [none, none])
    one_way = start.value == 0.0 and start.name.startswith("gap")
    value, error = (none, none) if one_way else differences(ask, start, (1.0, -1.0), start.order)
    if np.isfinite(error).any():
        return Slope(value, error, "", both, changes)
    return Slope(*_one_sided(ask, start, (1.0,) if one_way else (1.0, -1.0)), both, changes)


def _one_sided(ask: Ask, start: Start, sides: Sequence[float]) -> tuple[Array, Array, str]:
    """The derivative on the side where there is one; on both, if they agree."""
    none, found = np.full_like(start.here, math.nan), []
    for side in sides:
        order = ask(start.value + side * start.unit * 2.0**-LAST)[1]
        if order != NOWHERE:
            found.append(differences(ask, start, (side,), order))
    if not found:
        return none, none, "scenes beside it are refused, or come to no proper end"
    (value, error), (other, doubt) = found[0], found[-1]
    if not all(np.isfinite(one[1]).any() for one in found):
        return none, none, "the order of contacts changes right there"
    if np.nanmax(np.abs(value - other) - 10.0 * (error + doubt), initial=0.0) > 0.0:
        return none, none, "the order of contacts changes right there, and the derivative is another on either side"
    return value, error, ""


def differences(ask: Ask, start: Start, sides: Sequence[float], order: int) -> tuple[Array, Array]:
    """Extrapolate central differences, or those to one side, of steps that are halved until runs have this `order`.

    Three central ones (five of one side) make an estimate, whose terms up to h⁴ vanish; the next differs by its error.
    Steps are halved further as long as that pays. nan where there is none.
    """
    central, best = len(sides) == 2, np.full((2, len(start.here)), math.nan)
    (count, base), last, slopes = (3, 4.0) if central else (5, 2.0), best[0], list[Array]()
    for k in range(FIRST, LAST):
        h = start.unit * 2.0**-k
        near = [ask(start.value + side * h) for side in sides]
        if any(one != order for _, one in near):
            if k == FIRST and any(ask(start.value + side * start.unit * 2.0**-LAST)[1] != order for side in sides):
                break
            slopes, last = [], np.full_like(last, math.nan)
            continue
        other = near[1][0] if central else start.here
        slopes = [*slopes, (near[0][0] - other) / (sides[0] * h * len(sides))][-count:]
        if len(slopes) < count:
            continue
        now = extrapolated(slopes, base)
        rounding = 2.0 * np.finfo(float).eps * start.size / h
        error, last = np.abs(now - last) + rounding, now
        better = ~(error >= best[1]) & ~np.isnan(error)
        best = np.where(better, [now, error], best)
        if np.isfinite(best[1]).any() and not (better & (error * start.unit > FINE * start.size)).any():
            break
    return best[0], best[1]


def extrapolated(slopes: Sequence[Array], base: float) -> Array:
    """Richardson's extrapolation of values that belong to steps halved again and again: errors go like h² (4) or h (2).
    """
    table = np.array(slopes)
    for j in range(1, len(slopes)):
        table = (base**j * table[1:] - table[:-1]) / (base**j - 1.0)
    return np.asarray(table[0])


def borders(plan: Plan, start: Start) -> tuple[float, float]:
    """The values below and above at which the number of contacts of a pair changes; nan where none was found."""
    hard = [name.startswith("hard_") for name in plan.results if name != "order"]
    asked = ("contacts",) * (not all(hard)) + ("hard_contacts",) * any(hard)
    counting = replace(plan, asked=asked, names=(start.name,))

    def counts(value: float) -> Any:
        found = solve(counting, [np.array([value])]).columns
        refused = int(found["status"][0]) in REFUSED | BAD
        return None if refused else [found[name].tolist() for name in asked]

    here = counts(start.value)
    return _edge(counts, here, start, -start.unit), _edge(counts, here, start, start.unit)


def _edge(counts: Callable[[float], Any], here: Any, start: Start, unit: float) -> float:
    """Scan outwards in steps that grow by factors of four, and bisect the first change."""
    inside, outside = 0.0, math.nan
    for part in (4.0 ** np.arange(-8, 1)).tolist():
        if counts(start.value + part * unit) != here:
            outside = part
            break
        inside = part
    while outside - inside > NARROW:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if counts(start.value + middle * unit) == here else (inside, middle)
    edge = start.value + outside * unit
    return math.nan if math.isnan(edge) or counts(edge) is None else edge
