"""Plan of a sweep, which other processes can receive, and its data set and file."""

from __future__ import annotations

import inspect
import json
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property, reduce
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from granular._engine import check, files
from granular._engine.describe import by_words, scene_to_json, to_json
from granular._engine.kernels import have_numba
from granular.cases import ready
from granular.cases.case import Case, checked_run
from granular.scene import Scene
from granular.studies.sweeps.results import RESULTS, STATUS_NAMES, Result
from granular.studies.sweeps.subject import RESTITUTION_PATH, SceneLike, Subject, Values, Way, put, subject_of

if TYPE_CHECKING:
    import xarray


Ask = str | Callable[[Case], float]
CLASS_PLACE_PATTERN = re.compile(r'"granular\.(?:\w+\.)+(\w+)"')
"""Pattern of class places in old files, whose modules may have moved."""


@dataclass(frozen=True)
class Plan:
    """Common properties of all cells.

    Attributes
    ----------
    subject : Subject
        The subject of the sweep.
    fixed : mapping
        Parameters that all cells share.
    names : tuple of str
        Parameters that vary.
    asked : tuple of str or callable
        Results: names of `granular.studies.sweeps.results.RESULTS`, or functions of the case.
    run : mapping
        Options of the engines.
    at_once : bool
        Whether many cells can run in one compiled call.
    key : bytes
        Identifies the plan in any process.
    version : str or None
        Text by which the caller identifies user-defined functions and classes in a file.
    """

    subject: Subject
    fixed: Mapping[str, Any]
    names: tuple[str, ...]
    asked: tuple[Ask, ...]
    run: Mapping[str, Any]
    at_once: bool = True
    key: bytes = field(default_factory=lambda: os.urandom(16))
    version: str | None = None

    @property
    def results(self) -> dict[str, Result]:
        """Requested results, by name."""
        return {named(ask): _result(ask) for ask in self.asked}

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """Paths of the parameters that vary."""
        return tuple(map(self.subject.way, self.names))

    @cached_property
    def root(self) -> Any:
        """The subject with the parameters that all cells share."""
        return reduce(lambda root, change: put(root, *change), sorted(self._shared, key=_late), self.subject.root)

    @cached_property
    def _shared(self) -> list[tuple[Way, Any]]:
        return [(self.subject.way(name), value) for name, value in self.fixed.items()]

    def parameters(self, values: Sequence[Any]) -> Any:
        """Return the root of the cell with these `values` of the varied parameters."""
        changes = [*filter(_late, self._shared), *zip(self.ways, values, strict=True)]
        return reduce(lambda root, change: put(root, *change), sorted(changes, key=_late), self.root)

    def case(self, values: Sequence[Any]) -> Case:
        """Return the case of one cell."""
        case = self.subject.make(self.parameters(values))
        return replace(case, run={**case.run, **self.run}) if self.run else case

    def start(self, values: Sequence[Any]) -> Case:
        """Return the case of one cell, for a ready-made one without its contacts.

        Many cells share it.
        """
        if not self.subject.ready:
            return self.case(values)
        shapes, _ = self._sides(self.parameters(values))
        return ready.bare(self.subject.ready, shapes, shapes.pop("t_end", None))

    def laws(self, start: Case, values: Sequence[Any]) -> Any:
        """Return the force laws of one cell."""
        if not self.subject.ready:
            return start.physics("md")
        return ready.touching(self.subject.ready, start, **self._sides(self.parameters(values))[1]).law

    @cached_property
    def shaping(self) -> tuple[bool, ...]:
        """Which varied parameters determine scene and end of a cell.

        The others determine its contacts.
        """
        return tuple(not self.subject.ready or name.partition("[")[0] in self.shapes for name in self.names)

    def _sides(self, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        sides: tuple[dict[str, Any], dict[str, Any]] = {}, {}
        for name, value in parameters.items():
            sides[name.partition("[")[0] not in self.shapes][name] = value
        return sides

    @cached_property
    def shapes(self) -> set[str]:
        """Names of the parameters of a ready-made case that determine scene and end."""
        return ready.shaping(self.subject.ready) | {"t_end"}


def planned(
    scene: SceneLike, over: Mapping[str, Values], asked: tuple[Ask, ...], fixed: Mapping[str, Any],
    run: Mapping[str, Any] | None = None,
) -> Plan:
    """Return the plan. Raises errors that concern all cells."""
    for ask in asked:
        check.takes("result", ask, "case") if callable(ask) else check.choice("result", ask, list(RESULTS))
    plan = Plan(subject_of(scene), dict(fixed), tuple(over), asked, checked_run({} if run is None else run))
    for name in [*over, *fixed]:
        plan.subject.way(name)  # raises for names that are not parameters
    if twice := [name for name in over if name in fixed]:
        raise ValueError(f"The parameter {twice[0]} is both varied and fixed. Give it once.")
    return replace(plan, at_once=have_numba() and not run and all(result.many for result in plan.results.values()))


def _late(change: tuple[Way, Any]) -> bool:
    """Whether a parameter must be applied last."""
    return change[0] == RESTITUTION_PATH


def named(ask: Ask) -> str:
    """Return the name of a result."""
    return ask if isinstance(ask, str) else str(getattr(ask, "__name__", ask))


def check_names(plan: Plan, save: Any) -> None:
    """Raise an error for results whose names no data set, or no file, can have."""
    taken = {*plan.names, "status", "pair", "body", "edge", "edge_contacts", "jump", "side"}
    for ask in (one for one in plan.asked if not isinstance(one, str)):
        if not hasattr(ask, "__name__"):
            raise TypeError(f"`result` must be a function with a name, got {ask!r}. Define a function with def that "
                            "calls it.")
        name, others = named(ask), [named(other) for other in plan.asked if other is not ask]
        check.refuse({
            f"`result` must be a function whose name is new in the data set, got {name!r}. Rename it.":
                name in taken or name in others,
            f"`result` must be a function with a name to be saved, got {name!r}. Define it with def.":
                save is not None and not name.isidentifier(),
        })


def _result(ask: Ask) -> Result:
    if isinstance(ask, str):
        return RESULTS[ask]
    about = (inspect.getdoc(ask) or named(ask)).partition("\n")[0]

    def single(answer: Any) -> Any:
        value = ask(answer.case)
        if np.size(value) != 1:
            raise TypeError(f"The result {named(ask)!r} must be a single number, got {value!r}.")
        return value

    return Result("", "", about, single)


def xarray_() -> Any:
    """Return the module xarray."""
    return check.optional("xarray", "sweep")


def dataset(plan: Plan, over: dict[str, Values], values: dict[str, Any], notes: dict[str, Any]) -> xarray.Dataset:
    """Return the data set: a dimension per axis, then pair or body, with attributes.

    Attributes contain units and provenance.
    """
    shape = tuple(map(len, over.values()))
    coordinates: dict[str, Any] = {name: (name, array, plan.subject.attributes(name)) for name, array in over.items()}
    status = {"long_name": "status", "comment": "how the run of the cell ended", "flag_values": list(STATUS_NAMES),
              "flag_meanings": " ".join(STATUS_NAMES.values())}
    variables = {"status": (tuple(over), values["status"].astype(np.int8).reshape(shape), status)}
    for name, result in plan.results.items():
        array = values[name].astype(np.int32) if values[name].dtype.kind == "i" else values[name]
        dims = (*over, result.dim) if result.dim else tuple(over)
        variables[name] = (dims, array.reshape(*shape, *array.shape[1:]),
                           {"units": result.units, "long_name": name.replace("_", " "), "comment": result.about})
        if result.dim:
            coordinates[result.dim] = result.dim, np.arange(array.shape[1]), {"comment": "counted from the bottom"}
    about = {"title": f"granular sweep of {plan.subject.title}", "question": question(plan)[0],
             "provenance": json.dumps(files.provenance())}
    data: xarray.Dataset = xarray_().Dataset(variables, coordinates, about | notes)
    return data


def question(plan: Plan) -> tuple[str, list[Any]]:
    """Return the text of case, parameters and results, and the caller's objects in it.

    Without such objects, sweeps with equal text and axes have equal answers.
    """
    own: list[Any] = []

    def described(value: Any) -> Any:
        if isinstance(value, (np.generic, np.ndarray)):
            return value.tolist()
        if isinstance(value, Mapping):
            return dict(value)
        if isinstance(value, Scene):
            own.extend(motion for motion in value.motions if motion is not None and "fields" not in to_json(motion))
            return scene_to_json(value)
        kind = value if isinstance(value, (type, FunctionType)) else type(value)
        of_package = kind.__module__.partition(".")[0] == "granular"
        if of_package and is_dataclass(value) and kind is not value:
            return [kind.__name__, {one.name: getattr(value, one.name) for one in fields(value)}]
        own.extend([value] * (not of_package or kind is not value))
        return kind.__qualname__

    words = {"scene": plan.subject.text, "fixed": plan.fixed, "over": plan.names, "results": list(plan.results),
             "run": plan.run}
    given = {"functions": [one for one in (plan.subject.source, *plan.asked) if callable(one)], "key": plan.version}
    words |= {name: one for name, one in given.items() if one not in ([], None)}
    return json.dumps(words, sort_keys=True, default=described), own


def write(data: xarray.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a data set to a netCDF file, completely or not at all."""
    check.optional("netCDF4", "a netCDF file")

    def fill(draft: str) -> None:
        try:
            data.to_netcdf(draft, engine="netcdf4")
        except (OSError, RuntimeError):  # of a full disk netCDF says that permission is denied, or "HDF error"
            files.check_room(draft, data.nbytes)
            raise

    files.write(path, fill)


def resume(path: str | os.PathLike[str], plan: Plan, over: dict[str, Values]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results and notes of an existing file, or nothing.

    Raises
    ------
    ValueError
        If the file belongs to another sweep or to a later version, or if the sweep uses code of the caller without a
        key.
    """
    name = files.checked_path("save", path)
    files.check_ending(name, ".nc")
    files.check_writable(name)
    if not os.path.isfile(name):
        return {}, {}
    with xarray_().open_dataset(name, engine="netcdf4", decode_cf=False) as stored:
        asked, notes = CLASS_PLACE_PATTERN.sub(r'"\1"', by_words(str(stored.attrs.get("question")))), stored.attrs
        files.check_format(name, _format(notes))
        text, own = question(plan)
        if own and plan.version is None:
            raise ValueError(f"`save` must be a new file, got {name!r}, and {own[0]!r} may have changed since. Give a "
                             "key= that changes with your code, give another name, or remove the file.")
        if asked != text or not all(_same(stored, axis, array) for axis, array in over.items()):
            raise ValueError(f"`save` must be a new file or one of the same sweep, got {name!r} of another sweep. Give "
                             "another name, or remove the file.")
        shape = tuple(map(len, over.values()))
        columns = {one: _column(stored, one, shape, plan, name) for one in ("status", *plan.results)}
        return columns, {"refusal": files.plain_text(str(notes["refusal"]))} if "refusal" in notes else {}


def _format(notes: Any) -> Any:
    """Return the format number of a file."""
    try:
        return json.loads(notes.get("provenance", "{}")).get("format", 1)
    except (TypeError, ValueError, AttributeError, RecursionError):
        return None


def _same(stored: Any, axis: str, array: Any) -> bool:
    """Whether a file has the values of an axis. Sizes are compared before reading."""
    return axis in stored and stored[axis].shape == array.shape and np.array_equal(
        stored[axis].values.astype(array.dtype), array)


def _column(stored: Any, name: str, shape: tuple[int, ...], plan: Plan, path: str) -> Any:
    """Return the answers of all cells.

    Nothing is returned unless they have the kind, shape and size of our files.
    """
    result = plan.results.get(name)
    whole, deep = result is None or isinstance(result.fill, int), result is not None and result.dim != ""
    there = stored.get(name)
    good = there is not None and there.dtype.kind == ("i" if whole else "f") and there.nbytes <= os.path.getsize(path)
    if not good or there.shape[: len(shape)] != shape or there.ndim != len(shape) + deep:
        raise ValueError(f"`save` must be a file of a sweep of shape {shape}, got {path!r} without a fitting {name}. "
                         "Remove the file.")
    values = there.values
    if result is None and not np.isin(values, list(STATUS_NAMES)).all():
        raise ValueError(
            f"`save` must be a file whose status is one of {', '.join(STATUS_NAMES.values())}, got {path!r} "
            "with others. Remove the file."
        )
    return values.reshape(math.prod(shape), *values.shape[len(shape):])
