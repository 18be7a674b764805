"""Derivatives of results by parameters: differences of runs with the same order of events, extrapolated; `Sensitivity`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array, face
from granular._engine.reports import Report, abridged, aligned, number
from granular.run.trajectory import EARLY
from granular.studies.sweeps.plan import Plan
from granular.studies.sweeps.results import CODE, MISUSE
from granular.studies.sweeps.run import edges
from granular.studies.sweeps.schedule import end_with_parent, solve

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


COLUMNS, ROWS = 6, 60
"""Outcomes and parameters that a table has at most."""
Values = dict[str, Any]
"""A number for each outcome, or an array (pairs,) or (bodies,)."""


@face
@dataclass(frozen=True, repr=False)
class Sensitivity(Report):
    """What outcomes answer to; print it, save it with `to_json`.

    A result that has one number per pair, or per body, is an array; one of them that was asked for, as ``"v_rel[1]"``,
    is a number. nan is what there is not, or is not given.

    Attributes
    ----------
    title : str
        The scene.
    value : dict
        The outcomes by name, in SI units.
    gradient : dict of dicts
        ``gradient["v_rel"]["restitution"]`` is ∂v_rel/∂ln p = p ∂v_rel/∂p, in units of the outcome; ∂v_rel/∂p for a
        parameter p ≤ 0. nan where it is not given, see `why`.
    error : dict of dicts
        Estimated errors of the derivatives, in their units.
    condition : dict
        Σ |∂ln outcome/∂ln p| over all parameters: how many times as large a relative error comes out as it went in. An
        outcome below 1 % of the fastest impact of its component counts as that impact. Parameters that are 0 add
        nothing; nan if one that is not 0 has no derivative.
    spread : dict
        Standard deviation of the outcomes, in their units, from the `uncertainty` of independent parameters: the root
        of Σ (∂outcome/∂p u)². Of a parameter within whose uncertainty the order of contacts changes, the larger change
        of the outcome at p - u and p + u counts instead. nan without an uncertainty.
    parameters, uncertainty : dict
        Values of the parameters, and the standard uncertainty u of each, in their units.
    sides : dict of dicts
        ``sides["v_rel"]["restitution"]``: the outcome at p - u and p + u, where the order of contacts changes between,
        or there is no proper run at one of them (nan).
    why : dict
        Of parameters that have no derivatives, or not all, the reason.
    notes : tuple of str
        What else to mind.
    """

    title: str
    value: Values
    gradient: dict[str, Values]
    error: dict[str, Values]
    condition: Values
    spread: Values
    parameters: dict[str, float]
    uncertainty: dict[str, float]
    sides: dict[str, Values]
    why: dict[str, str]
    notes: tuple[str, ...]
    _plan: Plan = field(compare=False)
    _starts: tuple[Start, ...] = field(compare=False)

    @cached_property
    def border(self) -> dict[str, tuple[float, float]]:
        """Values of each parameter, below and above, at which a pair has a contact more or less, so that outcomes may
        jump; known to 1e-6 of the parameter. nan where there is none as far as half of it below, once more above.

        Some 50 runs for each parameter, when it is first asked for. A scan goes outwards in steps that grow by factors
        of four: what lies between two of them may be overlooked.
        """
        return {start.name: borders(self._plan, start) for start in self._starts}

    def _numbers(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name[0] != "_"}

    @property
    def _headline(self) -> str:
        """The outcome that answers most, and what it answers to most."""
        known = {name: one for name, one in flat(self.condition).items() if math.isfinite(one)}
        if not known:
            return f"{self.title}: no outcome has all its derivatives"
        name = max(known, key=lambda one: known[one])
        slopes = {p: self._by(p)[name] for p, at in self.parameters.items() if at > 0.0}
        most = max(slopes, key=lambda p: abs(slopes[p]), default=None)
        more = "" if most is None else f"; 1 % more {most}: {0.01 * slopes[most]:+.3g}"
        return f"{self.title}: {name} = {flat(self.value)[name]:.6g}, condition {known[name]:.3g}{more}"

    @property
    def line(self) -> str:
        """What the outcome that answers most answers to most."""
        return f"sensitivity: {self._headline.removeprefix(f'{self.title}: ')} (all: granular sensitivity)"

    def _by(self, parameter: str) -> dict[str, float]:
        """All derivatives by one parameter."""
        return flat({name: slopes[parameter] for name, slopes in self.gradient.items()})

    def __str__(self) -> str:
        value = flat(self.value)
        names = [name for name in value if math.isfinite(value[name])][:COLUMNS]
        parts = {"value": value, "condition": flat(self.condition), "spread": flat(self.spread)}
        table = [[name, "", *(number(part[one]) for one in names)] for name, part in parts.items()]
        slopes = [[f"∂/∂ ln {p}" if at > 0.0 else f"∂/∂ {p}", f"at {at:.6g}",
                   *(number(self._by(p)[one]) for one in names)] for p, at in self.parameters.items()]
        rows = [["", "", *names], *table, *abridged(slopes, ROWS)]
        return "\n".join([self._headline, "", aligned(rows, "<<>"[: 2 + len(names)]), *self._remarks(names)])

    def _remarks(self, names: list[str]) -> Iterator[str]:
        """What the table does not have."""
        for p, u in self.uncertainty.items():
            at = {name: sides[p] for name, sides in self.sides.items() if p in sides}
            low, high = (flat({name: ends[side] for name, ends in at.items()}) for side in (0, 1))
            for name in filter(low.__contains__, names):
                none = " and ".join(side for side, at in (("below", low), ("above", high)) if math.isnan(at[name]))
                says = f"there is no value {none}" if none else "the order of contacts changes"
                yield (f"Within {p} = {self.parameters[p]:.6g} ± {u:.3g} {says}: {name} is "
                       f"{number(low[name])} below, {number(high[name])} above.")
        for p, ends in vars(self).get("border", {}).items():
            words = [number(end, none="nowhere") for end in ends]
            yield f"There is a contact more or less from {p} = {words[0]} downwards, from {words[1]} upwards."
        yield from (f"Not given by {p}: {why}." for p, why in self.why.items())
        yield from self.notes


def flat(values: Mapping[str, Any]) -> dict[str, float]:
    """Numbers by name, those of arrays as name[i]."""
    return {f"{name}[{i[0]}]" if i else name: float(one) for name, value in values.items()
            for i, one in np.ndenumerate(value)}
