"""`Sensitivity`: derivatives and condition numbers of outcomes, as numbers and as a printed table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array, face
from granular._engine.reports import Report, abridged, aligned, number

COLUMNS, ROWS = 6, 60
"""Outcomes and parameters that a table has at most."""
Values = dict[str, Any]
"""A number for each outcome, or an array (pairs,) or (bodies,)."""


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
    _starts: tuple[Start, ...] = field(compare=False)
    _borders: Callable[[Start], tuple[float, float]] = field(compare=False)

    @cached_property
    def border(self) -> dict[str, tuple[float, float]]:
        """Values of each parameter, below and above, at which a pair has a contact more or less, so that outcomes may
        jump; known to 1e-6 of the parameter. nan where there is none as far as half of it below, once more above.

        Some 50 runs for each parameter, when it is first asked for. A scan goes outwards in steps that grow by factors
        of four: what lies between two of them may be overlooked.
        """
        return {start.name: self._borders(start) for start in self._starts}

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
