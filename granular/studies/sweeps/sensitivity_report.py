"""`Sensitivity`: derivatives and condition numbers as data and as a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array
from granular._engine.reports import Report, abridged_rows, number, split_table, with_unit
from granular._engine.signature import face

MAX_COLUMNS, MAX_ROWS = 6, 60
"""Maximum numbers of outcomes and of parameters of a table."""
Values = dict[str, Any]
"""A number for each outcome, or an array (pairs,) or (bodies,)."""


class Start(NamedTuple):
    """A parameter and the outcomes at its value.

    Attributes
    ----------
    name : str
        Name of the parameter.
    value, step_unit, uncertainty : float
        Value, unit of the difference steps, and standard uncertainty, in the unit of the parameter.
    outcomes : array (m,)
        Outcomes at this value.
    scales : array (m,)
        Scales of the outcomes for relative changes.
    order : int
        Number that identifies the order of events.
    """

    name: str
    value: float
    step_unit: float
    uncertainty: float
    outcomes: Array
    scales: Array
    order: int


@face
@dataclass(frozen=True, repr=False)
class Sensitivity(Report):
    """Sensitivity of outcomes. Print it, or save it with `to_json`.

    A result with one number per pair or body is an array. A single number, requested as ``"v_rel[1]"``, is a float. nan
    stands for values that do not exist or are not accurate enough.

    Attributes
    ----------
    title : str
        The scene.
    value : dict
        Outcomes by name, in SI units.
    gradient : dict of dicts
        ``gradient["v_rel"]["restitution"]`` is ∂v_rel/∂ln p = p ∂v_rel/∂p, in units of the outcome. For a parameter
        p ≤ 0 it is ∂v_rel/∂p. nan is explained in `why`.
    error : dict of dicts
        Estimated errors of the derivatives, in their units.
    condition : dict
        Σ |∂ln outcome/∂ln p| over all parameters, the amplification of relative errors. An outcome below 1 % of the
        fastest impact of its component is replaced by that impact. Parameters that are 0 add nothing. nan if a
        parameter other than 0 has no derivative.
    spread : dict
        Standard deviation of the outcomes, in their units, for independent uncertain parameters: the root of Σ
        (∂outcome/∂p u)². If the order of contacts changes within the uncertainty of a parameter, its term is the
        square of the larger change of the outcome at p - u and p + u. nan without an uncertainty.
    parameters, uncertainty : dict
        Values of the parameters, and the standard uncertainty u of each, in their units.
    sides : dict of dicts
        ``sides["v_rel"]["restitution"]``: the outcome at p - u and p + u, if the order of contacts changes between
        them, or if a run did not end properly (nan).
    why : dict
        For each parameter with missing derivatives, the reason.
    notes : tuple of str
        Further remarks.
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
    _starts: tuple[Start, ...] = field(compare=False)
    _borders: Callable[[Start], tuple[float, float]] = field(compare=False)
    _units: Mapping[str, str] = field(compare=False)

    @cached_property
    def border(self) -> dict[str, tuple[float, float]]:
        """Values of each parameter, below and above, at which a contact count changes.

        Outcomes can jump there. The values are known to 1e-6 of the parameter. nan if there is no change in the range
        of the scan, which includes 0.5 to 1.5 times the parameter. The first access of the property takes about 50 runs
        per parameter. The values of the scan have distances from the parameter that grow by factors of four. Narrow
        windows can be missed.
        """
        return {start.name: self._borders(start) for start in self._starts}

    def _numbers(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name[0] != "_"}

    @property
    def _headline(self) -> str:
        """Title, and the outcome with the largest condition number.

        For this outcome, the effect of the most important parameter is included.
        """
        finite = {name: condition for name, condition in flat(self.condition).items() if math.isfinite(condition)}
        if not finite:
            return f"{self.title}: no outcome has all its derivatives"
        name = max(finite, key=lambda condition: finite[condition])
        derivatives = {p: self._by(p)[name] for p, at in self.parameters.items() if at > 0.0}
        strongest = max(derivatives, key=lambda p: abs(derivatives[p]), default=None)
        effect = "" if strongest is None else f"; 1 % more {strongest}: {0.01 * derivatives[strongest]:+.3g}"
        return f"{self.title}: {name} = {flat(self.value)[name]:.6g}, condition {finite[name]:.3g}{effect}"

    @property
    def line(self) -> str:
        """Sentence on the outcome with the largest condition number."""
        return f"sensitivity: {self._headline.removeprefix(f'{self.title}: ')} (all: granular sensitivity)"

    def _by(self, parameter: str) -> dict[str, float]:
        """Return the derivatives of all outcomes with respect to one parameter."""
        return flat({name: slopes[parameter] for name, slopes in self.gradient.items()})

    def __str__(self) -> str:
        value = flat(self.value)
        names = [name for name in value if math.isfinite(value[name])][:MAX_COLUMNS]
        parts = {"value": value, "condition": flat(self.condition), "spread": flat(self.spread)}
        table = [[name, "", *(number(part[outcome]) for outcome in names)] for name, part in parts.items()
                 if name != "spread" or any(math.isfinite(part[outcome]) for outcome in names)]
        derivative_rows = [[f"∂/∂ ln {p}" if at > 0.0 else f"∂/∂ {p}", f"at {at:.6g} {self._units.get(p, '')}".rstrip(),
                   *(number(self._by(p)[outcome]) for outcome in names)] for p, at in self.parameters.items()]
        rows = [["", "", *(with_unit(outcome, self._units.get(outcome.partition("[")[0], "")) for outcome in names)],
                *table, *abridged_rows(derivative_rows, MAX_ROWS)]
        return "\n".join([self._headline, "", split_table(rows, "<<>", 2), *self._remarks(names)])

    def _remarks(self, names: list[str]) -> Iterator[str]:
        """Yield remarks that are not in the table, for the outcomes `names`."""
        for p, u in self.uncertainty.items():
            at = {name: sides[p] for name, sides in self.sides.items() if p in sides}
            low, high = (flat({name: ends[side] for name, ends in at.items()}) for side in (0, 1))
            for name in filter(low.__contains__, names):
                missing_sides = " and ".join(
                    side for side, at in (("below", low), ("above", high)) if math.isnan(at[name]))
                reason = f"there is no value {missing_sides}" if missing_sides else "the order of contacts changes"
                yield (f"Within {p} = {self.parameters[p]:.6g} ± {u:.3g} {reason}: {name} is "
                       f"{number(low[name])} below, {number(high[name])} above.")
        for p, ends in vars(self).get("border", {}).items():
            numbers = [number(end, none="none") for end in ends]
            yield f"Nearest changes of a contact count: {p} = {numbers[0]} below, {numbers[1]} above."
        yield from (f"No derivative with respect to {p}: {why}." for p, why in self.why.items())
        yield from self.notes


def flat(values: Mapping[str, Any]) -> dict[str, float]:
    """Return a flat dictionary of numbers, with keys such as "v_rel[1]" for arrays."""
    return {f"{name}[{i[0]}]" if i else name: float(one) for name, value in values.items()
            for i, one in np.ndenumerate(value)}
