"""What is asked of every cell, as a value that travels to other processes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from granular import _check, cases
from granular.cases import Case, ready
from granular.cases.options import Option, options_of
from granular.scene import Scene
from granular.sweeps import axes
from granular.sweeps.axes import Values
from granular.sweeps.results import RESULTS, Result

Make = Callable[..., Case]
Ask = str | Callable[[Case], float]


@dataclass(frozen=True)
class Plan:
    """What every cell has in common.

    Attributes
    ----------
    make : str or callable
        A ready-made scene's name, or a function of the parameters that returns a `Case`.
    fixed : mapping
        Parameters that all cells share.
    names : tuple of str
        Parameters that vary.
    asked : tuple of str or callable
        Results: names of `granular.sweeps.results.RESULTS`, or functions of the case.
    run : mapping
        Options of the engines.
    """

    make: str | Make
    fixed: Mapping[str, Any]
    names: tuple[str, ...]
    asked: tuple[Ask, ...]
    run: Mapping[str, Any]

    @property
    def title(self) -> str:
        """Name of the scene, or of the function that makes it."""
        return self.make if isinstance(self.make, str) else getattr(self.make, "__qualname__", repr(self.make))

    @property
    def results(self) -> dict[str, Result]:
        """What is asked, by name."""
        return {ask if isinstance(ask, str) else ask.__name__: _result(ask) for ask in self.asked}

    @cached_property
    def options(self) -> list[Option]:
        """Parameters of the scene and its contacts."""
        return cases.options(self.make) if isinstance(self.make, str) else options_of(self.make)

    def parameters(self, values: Sequence[Any]) -> dict[str, Any]:
        """All parameters of the cell with these `values` of the varied ones."""
        known = {option.name: option.default for option in self.options if "Sequence" in option.kind}
        found = dict(self.fixed)
        for name, value in zip(self.names, values, strict=True):
            plain = axes.split(name)[0]
            if plain != name and found.get(plain) is None and known.get(plain) is not None:
                found[plain] = known[plain]
            axes.put(found, name, value.item() if isinstance(value, np.generic) else value)
        return found

    def case(self, values: Sequence[Any]) -> Case:
        """The case of one cell."""
        parameters = self.parameters(values)
        if isinstance(self.make, str):
            return cases.make(self.make, run=self.run, **parameters)
        return self.make(**parameters)

    def scene(self, values: Sequence[Any]) -> tuple[Scene, float | None]:
        """Scene and end time of one cell of a ready-made case; its contacts are made apart, for they are shared."""
        parameters = self.parameters(values)
        kind = ready.TEMPLATES[str(self.make)]
        t_end = parameters.pop("t_end", None)
        scene = kind.make(**{key: parameters[key] for key in parameters if key in self.of_scene})
        return scene, kind.t_end(scene) if t_end is None else _check.number("t_end", t_end, at_least=0.0)

    def laws(self, scene: Scene, values: Sequence[Any]) -> tuple[Any, ...]:
        """Force laws of one cell of a ready-made case."""
        parameters = self.parameters(values)
        chosen = {key: parameters[key] for key in parameters if key not in self.of_scene and key != "t_end"}
        return ready.contact(scene, **(dict(ready.TEMPLATES[str(self.make)].contact) | chosen))[0]

    @cached_property
    def of_scene(self) -> set[str]:
        """Names of the parameters that shape the scene."""
        return set(inspect.signature(ready.TEMPLATES[str(self.make)].make).parameters)

    def bodies(self, columns: Mapping[str, Values]) -> int:
        """Largest number of bodies of any cell, each axis looked at by itself."""
        first = {name: values[0] for name, values in columns.items()}
        kinds = {option.name: option.kind for option in self.options}
        most, refused = 0, None
        for name, values in columns.items():
            sized = not isinstance(self.make, str) or kinds.get(name, "float") != "float"
            for value in values if sized else _spread(values):
                try:
                    case = self.case(list((first | {name: value}).values()))
                except ValueError as error:
                    refused = refused or error
                    continue
                most = max(most, case.scene.n)
        if not most and refused is not None:
            raise refused
        return most


def planned(
    make: str | Make, over: Mapping[str, Values], asked: tuple[Ask, ...], fixed: Mapping[str, Any],
    run: Mapping[str, Any],
) -> Plan:
    """Return the plan, or raise for what no cell could do."""
    if not callable(make):
        _check.choice("scene", make, cases.names())
    for ask in asked:
        if not callable(ask):
            _check.choice("result", ask, list(RESULTS))
    plan = Plan(make, dict(fixed), tuple(over), asked, dict(run))
    if isinstance(make, str):
        axes.check_names([*over, *fixed], plan.options, make)
    if twice := {axes.split(name)[0] for name in over if name in fixed}:
        raise ValueError(f"{twice.pop()} is both varied and fixed: give it once.")
    return plan


def _result(ask: Ask) -> Result:
    if isinstance(ask, str):
        return RESULTS[ask]
    about = (inspect.getdoc(ask) or ask.__name__).partition("\n")[0]
    return Result("", "", about, lambda answer: ask(answer.case))


def _spread(values: Values) -> Values:
    """A few of the values, among them both ends: sizes do not depend on this parameter, but some may be refused."""
    return np.asarray(values[np.unique(np.linspace(0, len(values) - 1, 5).astype(int))])
