"""Derivatives with respect to one parameter, by extrapolated differences of runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from granular._engine.check import Array
from granular.run.trajectory import EARLY_STATUSES
from granular.studies.sweeps.plan import Plan
from granular.studies.sweeps.results import MISUSE_CODE, STATUS_CODES
from granular.studies.sweeps.schedule import solve
from granular.studies.sweeps.sensitivity_report import Start

FIRST_STEP_EXPONENT, LAST_STEP_EXPONENT = 7, 26
"""Difference steps are 2^-7 of the unit at first, and larger than 2^-26."""
NEGLIGIBLE_ERROR = 1e-10
"""Error of a derivative below which steps are not halved further.

It is multiplied by the unit of the parameter, and relative to the outcome.
"""
NO_ORDER = -2
"""Order of a run that did not end properly or raised an exception."""
OUTCOME_ROUNDING = 2.0 * float(np.finfo(float).eps)
"""Relative rounding error of an outcome."""
BAD_STATUSES = {MISUSE_CODE, *(STATUS_CODES[status.name] for status in EARLY_STATUSES)}
Point = tuple[Array, int]
Evaluate = Callable[[float], Point]
Slope = tuple[Array, Array, str, Array | None]
"""Derivative (m,) for one parameter, its error, reason for nan, and outcomes.

The outcomes (2, m) are the values at both ends of the uncertainty interval. They are None if the order of contacts does
not change there.
"""


def slope(plan: Plan, start: Start) -> Slope:
    """Return the derivatives of all outcomes with respect to the parameter `start`."""
    plan_of_parameter, no_values = replace(plan, names=(start.name,)), np.full_like(start.outcomes, math.nan)

    def evaluate(value: float) -> Point:
        columns = solve(plan_of_parameter, [np.array([value])]).columns
        if int(columns["status"][0]) in BAD_STATUSES:
            return no_values, NO_ORDER
        *values, order = (np.ravel(columns[result]) for result in plan.results)
        return np.concatenate(values).astype(float), int(order[0])

    limits = [evaluate(start.value + side * start.uncertainty) for side in (-1.0, 1.0) if start.uncertainty]
    outcomes_at_limits = (
        np.array([values for values, _ in limits]) if {order for _, order in limits} - {start.order} else None)
    neighbour_orders = [
        evaluate(start.value + side * start.step_unit * 2.0**-LAST_STEP_EXPONENT)[1] for side in (-1.0, 1.0)]
    sides: tuple[float, ...] = (-1.0, 1.0)
    if neighbour_orders[0] == NO_ORDER or (start.value == 0.0 and start.name.startswith("gap")):
        sides, neighbour_orders[0] = (1.0,), neighbour_orders[1]
    elif neighbour_orders[1] == NO_ORDER:
        sides, neighbour_orders[1] = (-1.0,), neighbour_orders[0]
    if NO_ORDER in neighbour_orders:
        reason = "runs at neighbouring values are refused or do not end properly"
        return no_values, no_values, reason, outcomes_at_limits
    if neighbour_orders[0] != neighbour_orders[1]:
        return no_values, no_values, "the order of contacts differs just below and just above it", outcomes_at_limits
    return *differences(evaluate, start, sides, neighbour_orders[0]), "", outcomes_at_limits


def differences(evaluate: Evaluate, start: Start, sides: Sequence[float], order: int) -> tuple[Array, Array]:
    """Return extrapolated derivatives (m,) and their errors (m,).

    Differences are computed for steps h that are halved until all runs have this `order`. Three central differences
    (five one-sided ones) give an estimate without the error terms up to h⁴. Its error is the difference from the
    previous estimate, plus rounding. Steps are halved further while the error decreases.

    Parameters
    ----------
    evaluate : callable
        Function of the parameter that returns outcomes (m,) and order of events.
    start : Start
        The parameter.
    sides : sequence of float
        (-1, 1) for central differences, (1,) or (-1,) for one-sided differences.
    order : int
        Order of events near the value.

    Returns
    -------
    derivative, error : arrays (m,)
        nan where no estimate has an error.
    """
    central, best = len(sides) == 2, np.full((2, len(start.outcomes)), math.nan)
    (count, base), previous_estimate, slopes = (3, 4.0) if central else (5, 2.0), best[0], list[Array]()
    for h in (start.step_unit * 0.5 ** np.arange(FIRST_STEP_EXPONENT, LAST_STEP_EXPONENT)).tolist():
        points = [evaluate(start.value + side * h) for side in sides]
        if any(point_order != order for _, point_order in points):
            slopes, previous_estimate = [], np.full_like(previous_estimate, math.nan)
            continue
        reference = points[0][0] if central else start.outcomes
        slopes = [*slopes, (points[-1][0] - reference) / (sides[-1] * h * len(sides))][-count:]
        if len(slopes) < count:
            continue
        estimate = extrapolated(slopes, base)
        error, previous_estimate = np.abs(estimate - previous_estimate) + OUTCOME_ROUNDING * start.scales / h, estimate
        improved = ~(error >= best[1]) & ~np.isnan(error)
        best = np.where(improved, [estimate, error], best)
        if np.isfinite(best[1]).any() and not (
                improved & (error * start.step_unit > NEGLIGIBLE_ERROR * start.scales)).any():
            break
    return best[0], best[1]


def extrapolated(slopes: Sequence[Array], base: float) -> Array:
    """Return the Richardson extrapolation of differences for halved steps.

    `base` is 4 for errors in powers of h², and 2 for errors in powers of h.
    """
    table = np.array(slopes)
    for j in range(1, len(slopes)):
        table = (base**j * table[1:] - table[:-1]) / (base**j - 1.0)
    return np.asarray(table[0])
