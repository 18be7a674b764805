"""The derivative of results by one parameter: differences of runs with the same order of events, extrapolated.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from granular._check import Array
from granular.sweeps.plan import Plan
from granular.sweeps.results import CODE, MISUSE
from granular.sweeps.run import edges
from granular.sweeps.schedule import end_with_parent, solve
from granular.trajectory import EARLY

FIRST, LAST = 7, 26
"""Steps are 2^-7 of the parameter, or of its unit, at first, and 2^-26 at the least."""
FINE = 1e-10
"""Errors below this share of an outcome, per relative change of the parameter, are small enough."""
NOWHERE = -2
"""Order of a run that came to no proper end, or was refused."""
NOISE = 2.0 * float(np.finfo(float).eps)
"""Rounding of an outcome, in its size."""
PRECISION = 1e-6
"""Share of the parameter to which a border is known."""
BAD = {MISUSE, *(CODE[status.name] for status in EARLY)}
REACH = 4.0 ** np.arange(-8, 1)
"""Where the scan for borders looks, in units of a parameter."""
Point = tuple[Array, int]
Ask = Callable[[float], Point]
Slope = tuple[Array, Array, str, Array | None]
"""The derivative (m,) by one parameter and its error, nan where there is none; why; the outcomes (2, m) at either end
of what is uncertain, None where no contact changes its turn up to there."""


class Start(NamedTuple):
    """A parameter, its value, what its steps are parts of, how uncertain it is; the outcomes there (m,), the sizes that
    they are measured by, and the order of events."""

    name: str
    value: float
    unit: float
    doubt: float
    here: Array
    size: Array
    order: int


def slope(plan: Plan, start: Start) -> Slope:
    """Find the derivative of all outcomes by one parameter; this may be done in another process."""
    end_with_parent(os.getpid())
    one, none = replace(plan, names=(start.name,)), np.full_like(start.here, math.nan)

    def ask(value: float) -> Point:
        found = solve(one, [np.array([value])]).columns
        if int(found["status"][0]) in BAD:
            return none, NOWHERE
        *values, order = (np.ravel(found[result]) for result in plan.results)
        return np.concatenate(values).astype(float), int(order[0])

    ends = [ask(start.value + side * start.doubt) for side in (-1.0, 1.0) if start.doubt]
    crossed = np.array([values for values, _ in ends]) if {order for _, order in ends} - {start.order} else None
    beside = [ask(start.value + side * start.unit * 2.0**-LAST)[1] for side in (-1.0, 1.0)]
    sides: tuple[float, ...] = (-1.0, 1.0)
    if beside[0] == NOWHERE or (start.value == 0.0 and start.name.startswith("gap")):
        sides, beside[0] = (1.0,), beside[1]
    elif beside[1] == NOWHERE:
        sides, beside[1] = (-1.0,), beside[0]
    if NOWHERE in beside:
        return none, none, "scenes beside it are refused, or come to no proper end", crossed
    if beside[0] != beside[1]:
        return none, none, "the order of contacts is another just below and just above it", crossed
    return *differences(ask, start, sides, beside[0]), "", crossed


def differences(ask: Ask, start: Start, sides: Sequence[float], order: int) -> tuple[Array, Array]:
    """Extrapolate central differences, or those to one side, of steps that are halved until runs have this `order`.

    Three central ones (five of one side) make an estimate, whose terms up to h⁴ vanish; the next differs by its error.
    Steps are halved further as long as that pays. nan where there is none.
    """
    central, best = len(sides) == 2, np.full((2, len(start.here)), math.nan)
    (count, base), last, slopes = (3, 4.0) if central else (5, 2.0), best[0], list[Array]()
    for h in (start.unit * 0.5 ** np.arange(FIRST, LAST)).tolist():
        near = [ask(start.value + side * h) for side in sides]
        if any(one != order for _, one in near):
            slopes, last = [], np.full_like(last, math.nan)
            continue
        first = near[0][0] if central else start.here
        slopes = [*slopes, (near[-1][0] - first) / (sides[-1] * h * len(sides))][-count:]
        if len(slopes) < count:
            continue
        now = extrapolated(slopes, base)
        error, last = np.abs(now - last) + NOISE * start.size / h, now
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
    kind = "hard_contacts" if all(name.startswith("hard_") for name in [*plan.results][:-1]) else "contacts"
    counting = replace(plan, asked=(kind,), names=(start.name,))

    def counts(columns: Sequence[Array]) -> Array:
        return np.asarray(solve(counting, columns).columns[kind])

    grid = start.value + start.unit * np.concatenate([-REACH[::-1], [0.0], REACH])
    found = counts([grid])
    change = np.flatnonzero((found[1:] != found[:-1]).any(axis=1))

    def nearest(k: int) -> tuple[float, float]:
        _, ends, _ = edges(0, [grid[k : k + 2]], found[k : k + 2], (2,), counts, PRECISION)
        return (ends[0, 1], ends[-1, 0]) if len(ends) else (math.nan, math.nan)

    below, above = change[change < len(REACH)][-1:].tolist(), change[change >= len(REACH)][:1].tolist()
    return nearest(below[0])[1] if below else math.nan, nearest(above[0])[0] if above else math.nan
