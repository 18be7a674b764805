"""What is asked of every cell, as a value that travels to other processes.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any

from granular import _check
from granular._kernels import have_numba
from granular.cases import Case, ready
from granular.sweeps.axes import Values
from granular.sweeps.results import RESULTS, Result
from granular.sweeps.subject import Subject, Way, put, subject_of

Ask = str | Callable[[Case], float]


@dataclass(frozen=True)
class Plan:
    """What every cell has in common.

    Attributes
    ----------
    subject : Subject
        What is swept.
    fixed : mapping
        Parameters that all cells share.
    names : tuple of str
        Parameters that vary.
    asked : tuple of str or callable
        Results: names of `granular.sweeps.results.RESULTS`, or functions of the case.
    run : mapping
        Options of the engines.
    at_once : bool
        Whether many cells may be run in one compiled call.
    key : bytes
        Tells plans apart, whatever process they are in.
    """

    subject: Subject
    fixed: Mapping[str, Any]
    names: tuple[str, ...]
    asked: tuple[Ask, ...]
    run: Mapping[str, Any]
    at_once: bool = True
    key: bytes = field(default_factory=lambda: os.urandom(16))

    @property
    def results(self) -> dict[str, Result]:
        """What is asked, by name."""
        return {ask if isinstance(ask, str) else ask.__name__: _result(ask) for ask in self.asked}

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """Paths of the parameters that vary."""
        return tuple(map(self.subject.way, self.names))

    @cached_property
    def root(self) -> Any:
        """The subject with what all cells share."""
        fixed = ((self.subject.way(name), value) for name, value in self.fixed.items())
        return reduce(lambda root, change: put(root, *change), fixed, self.subject.root)

    def parameters(self, values: Sequence[Any]) -> Any:
        """The root of the cell with these `values` of the parameters that vary."""
        return reduce(lambda root, change: put(root, *change), zip(self.ways, values, strict=True), self.root)

    def case(self, values: Sequence[Any]) -> Case:
        """The case of one cell."""
        case = self.subject.make(self.parameters(values))
        return replace(case, run={**case.run, **self.run}) if self.run else case

    def start(self, values: Sequence[Any]) -> Case:
        """The case of one cell; of a ready-made one without its contacts, which many cells share."""
        if not self.subject.ready:
            return self.case(values)
        shapes, _ = self._sides(self.parameters(values))
        return ready.bare(self.subject.ready, shapes, shapes.pop("t_end", None))

    def laws(self, start: Case, values: Sequence[Any]) -> Any:
        """Force laws of one cell."""
        if not self.subject.ready:
            return start.physics("md")
        return ready.touching(self.subject.ready, start, **self._sides(self.parameters(values))[1]).law

    def parted(self, values: Sequence[Any]) -> tuple[Any, Any]:
        """Part the values of a cell: what tells where and for how long it runs, and how its balls touch."""
        if not self.subject.ready:
            return values, ()
        shapes, others = self._sides(dict(zip(self.names, values, strict=True)))
        return tuple(shapes.values()), tuple(others.values())

    def _sides(self, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        sides: tuple[dict[str, Any], dict[str, Any]] = {}, {}
        for name, value in parameters.items():
            sides[name.partition("[")[0] not in self.shapes][name] = value
        return sides

    @cached_property
    def shapes(self) -> set[str]:
        """Names of the parameters of a ready-made case that shape its scene, and its end."""
        return ready.shaping(self.subject.ready) | {"t_end"}


def planned(
    scene: Any, over: Mapping[str, Values], asked: tuple[Ask, ...], fixed: Mapping[str, Any], run: Mapping[str, Any],
) -> Plan:
    """Return the plan, or raise for what no cell could do."""
    for ask in asked:
        if not callable(ask):
            _check.choice("result", ask, list(RESULTS))
        else:
            _check.takes("result", ask, "case")
    plan = Plan(subject_of(scene), dict(fixed), tuple(over), asked, dict(run))
    for name in [*over, *fixed]:
        plan.subject.way(name)  # says what is no parameter
    if twice := [name for name in over if name in fixed]:
        raise ValueError(f"{twice[0]} is both varied and fixed: give it once.")
    return replace(plan, at_once=have_numba() and not run and all(result.many for result in plan.results.values()))


def _result(ask: Ask) -> Result:
    if isinstance(ask, str):
        return RESULTS[ask]
    about = (inspect.getdoc(ask) or ask.__name__).partition("\n")[0]
    return Result("", "", about, lambda answer: ask(answer.case))
