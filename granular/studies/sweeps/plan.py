"""Plan of a sweep, its data set and its file.

A plan can be sent to other processes.
"""

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
from granular._engine.callables import function_of
from granular._engine.describe import scene_to_json, to_json, with_current_words
from granular._engine.kernels import have_numba
from granular._engine.package import import_optional
from granular.cases import ready
from granular.cases.case import Case, checked_run
from granular.scene import Scene
from granular.studies.sweeps.results import RESULTS, STATUS_NAMES, Result
from granular.studies.sweeps.subject import (
    RESTITUTION_PATH,
    SceneLike,
    Subject,
    Values,
    Way,
    subject_of,
    with_parameter,
)

if TYPE_CHECKING:
    import xarray


RequestedResult = str | Callable[[Case], float]
CLASS_PLACE_PATTERN = re.compile(r'"granular\.(?:\w+\.)+(\w+)"')
"""Pattern of full class names in old files.

Their modules can have other names today."""


@dataclass(frozen=True)
class Plan:
    """Common properties of all cells of a sweep.

    A cell is one combination of parameter values.

    Attributes
    ----------
    subject : Subject
        The subject of the sweep.
    fixed : mapping
        Parameters that have the same value in all cells.
    names : tuple of str
        Parameters that vary.
    asked : tuple of str or callable
        Requested results: names of `granular.studies.sweeps.results.RESULTS`, or functions of the case.
    run : mapping
        Options of the engines.
    at_once : bool
        Whether many cells can run in one compiled call.
    key : bytes
        Identifies the plan in any process.
    version : str or None
        Version of user-defined functions and classes, to identify them in a file.
    """

    subject: Subject
    fixed: Mapping[str, Any]
    names: tuple[str, ...]
    asked: tuple[RequestedResult, ...]
    run: Mapping[str, Any]
    at_once: bool = True
    key: bytes = field(default_factory=lambda: os.urandom(16))
    version: str | None = None

    @property
    def results(self) -> dict[str, Result]:
        """Requested results by name."""
        return {named(result): _result(result) for result in self.asked}

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """Paths of the parameters that vary."""
        return tuple(map(self.subject.way, self.names))

    @cached_property
    def root(self) -> Any:
        """Root of the subject, with the fixed parameters set."""
        return reduce(lambda root, change: with_parameter(root, *change), sorted(self._shared, key=_is_applied_last),
                      self.subject.root)

    @cached_property
    def _shared(self) -> list[tuple[Way, Any]]:
        return [(self.subject.way(name), value) for name, value in self.fixed.items()]

    def parameters(self, values: Sequence[Any]) -> Any:
        """Return the root with the varied parameters set to `values`, for one cell."""
        changes = [*filter(_is_applied_last, self._shared), *zip(self.ways, values, strict=True)]
        ordered = sorted(changes, key=_is_applied_last)
        return reduce(lambda root, change: with_parameter(root, *change), ordered, self.root)

    def case(self, values: Sequence[Any]) -> Case:
        """Return the case of the cell with these `values` of the varied parameters."""
        case = self.subject.make(self.parameters(values))
        return replace(case, run={**case.run, **self.run}) if self.run else case

    def start(self, values: Sequence[Any]) -> Case:
        """Return the case of one cell. A ready-made case is returned without contacts.

        Such a case without contacts is shared by many cells.
        """
        if not self.subject.ready:
            return self.case(values)
        parameters, _ = self._sides(self.parameters(values))
        return ready.case_without_contacts(self.subject.ready, parameters, parameters.pop("t_end", None))

    def laws(self, start: Case, values: Sequence[Any]) -> Any:
        """Return the force laws of one cell, for its case `start`."""
        if not self.subject.ready:
            return start.physics("md")
        return ready.with_contacts(self.subject.ready, start, **self._sides(self.parameters(values))[1]).law

    @cached_property
    def shaping(self) -> tuple[bool, ...]:
        """Whether each varied parameter sets scene or end time, not the contacts."""
        return tuple(
            not self.subject.ready or name.partition("[")[0] in self.scene_and_end_names for name in self.names)

    def _sides(self, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the parameters of scene and end time, and the parameters of the contacts."""
        parts: tuple[dict[str, Any], dict[str, Any]] = {}, {}
        for name, value in parameters.items():
            parts[name.partition("[")[0] not in self.scene_and_end_names][name] = value
        return parts

    @cached_property
    def scene_and_end_names(self) -> set[str]:
        """Names of the parameters of a ready-made case that set its scene or its end time.

        All other parameters set the contacts.
        """
        return ready.scene_option_names(self.subject.ready) | {"t_end"}


def make_plan(
    scene: SceneLike, over: Mapping[str, Values], asked: tuple[RequestedResult, ...], fixed: Mapping[str, Any],
    run: Mapping[str, Any] | None = None,
) -> Plan:
    """Return the plan of a sweep.

    Raises errors that concern all cells, such as an unknown parameter or result.
    """
    for result in asked:
        if callable(result):
            function_of("results", result, "case")
        else:
            check.choice("results", result, list(RESULTS))
    plan = Plan(subject_of(scene), dict(fixed), tuple(over), asked, checked_run({} if run is None else run))
    for name in [*over, *fixed]:
        plan.subject.way(name)  # raises for names that are not parameters
    if repeated := [name for name in over if name in fixed]:
        raise ValueError(f"The parameter {repeated[0]} is both varied and fixed. Give it once.")
    return replace(plan, at_once=have_numba() and not run and all(result.many for result in plan.results.values()))


def _is_applied_last(change: tuple[Way, Any]) -> bool:
    """Return whether a parameter must be set after all others: the restitution."""
    return change[0] == RESTITUTION_PATH


def named(result: RequestedResult) -> str:
    """Return the name of a result: the string, or the name of the function."""
    return result if isinstance(result, str) else str(getattr(result, "__name__", result))


def check_names(plan: Plan, save: Any) -> None:
    """Raise an error for a result whose name a data set or a file cannot have.

    `save` is the path of the file, or None.
    """
    used_names = {*plan.names, "status", "pair", "body", "edge", "edge_contacts", "jump", "side"}
    for result in (result for result in plan.asked if not isinstance(result, str)):
        if not hasattr(result, "__name__"):
            raise TypeError(f"`result` must be a function with a name, got {result!r}. Define a function with def that "
                            "calls it.")
        name, others = named(result), [named(other) for other in plan.asked if other is not result]
        check.raise_if_true({
            f"`result` must be a function whose name is new in the data set, got {name!r}. Rename it.":
                name in used_names or name in others,
            f"`result` must be a function with a name to be saved, got {name!r}. Define it with def.":
                save is not None and not name.isidentifier(),
        })


def _result(function: RequestedResult) -> Result:
    """Return the `Result` of a known name or of a function of the case."""
    if isinstance(function, str):
        return RESULTS[function]
    description = (inspect.getdoc(function) or named(function)).partition("\n")[0]

    def single(answer: Any) -> Any:
        value = function(answer.case)
        if np.size(value) != 1:
            raise TypeError(f"The result {named(function)!r} must be a single number, got {value!r}.")
        return value

    return Result("", "", description, single)


def xarray_() -> Any:
    """Return the module xarray. Raise an error with a hint if it is not installed."""
    return import_optional("xarray", "sweep")


def dataset(plan: Plan, over: dict[str, Values], values: dict[str, Any], notes: dict[str, Any]) -> xarray.Dataset:
    """Return the results of a sweep as a data set with units and provenance.

    There is one dimension per varied parameter, then "pair" or "body".

    Parameters
    ----------
    plan : Plan
        The plan.
    over : dict
        Values of the varied parameters by name.
    values : dict
        Array of each result and of "status", with one row per cell.
    notes : dict
        Further attributes of the data set.
    """
    shape = tuple(map(len, over.values()))
    coordinates: dict[str, Any] = {name: (name, array, plan.subject.attributes(name)) for name, array in over.items()}
    status = {"long_name": "status", "comment": "how the run of the cell ended", **_flags(STATUS_NAMES)}
    variables = {"status": (tuple(over), values["status"].astype(np.int8).reshape(shape), status)}
    for name, result in plan.results.items():
        array = values[name].astype(np.int32) if values[name].dtype.kind == "i" else values[name]
        dims = (*over, result.dim) if result.dim else tuple(over)
        variables[name] = (dims, array.reshape(*shape, *array.shape[1:]),
                           {"units": result.units, "long_name": name.replace("_", " "), "comment": result.about,
                            **(_flags(result.meanings) if result.meanings else {})})
        if result.dim:
            coordinates[result.dim] = result.dim, np.arange(array.shape[1]), {"comment": "counted from the bottom"}
    about = {"title": f"granular sweep of {plan.subject.title}", "question": question(plan)[0],
             "provenance": json.dumps(files.provenance())}
    data: xarray.Dataset = xarray_().Dataset(variables, coordinates, about | notes)
    return data


def _flags(meanings: Mapping[int, str]) -> dict[str, Any]:
    """Return the attributes of a variable whose values are codes."""
    return {"flag_values": list(meanings), "flag_meanings": " ".join(meanings.values())}


def question(plan: Plan) -> tuple[str, list[Any]]:
    """Return a description of the sweep as text, and the user-defined objects in it.

    The text contains case, parameters and requested results. Without user-defined objects, sweeps with equal text and
    axes have equal results.
    """
    user_code: list[Any] = []

    def described(value: Any) -> Any:
        """Return a value that `json.dumps` cannot write, as JSON data.

        User-defined objects are added to `user_code`.
        """
        if isinstance(value, (np.generic, np.ndarray)):
            return value.tolist()
        if isinstance(value, Mapping):
            return dict(value)
        if isinstance(value, Scene):
            user_code.extend(
                motion for motion in value.motions if motion is not None and "fields" not in to_json(motion))
            return scene_to_json(value)
        cls = value if isinstance(value, (type, FunctionType)) else type(value)
        of_package = cls.__module__.partition(".")[0] == "granular"
        if of_package and is_dataclass(value) and cls is not value:
            return [cls.__name__, {entry.name: getattr(value, entry.name) for entry in fields(value)}]
        # functions and classes of granular are known by their name, everything else is user-defined
        user_code.extend([value] * (not of_package or cls is not value))
        return cls.__qualname__

    contents = {"scene": plan.subject.text, "fixed": plan.fixed, "over": plan.names, "results": list(plan.results),
             "run": plan.run}
    user_parts = {"functions": [entry for entry in (plan.subject.source, *plan.asked) if callable(entry)],
                  "key": plan.version}
    contents |= {name: entry for name, entry in user_parts.items() if entry not in ([], None)}
    return json.dumps(contents, sort_keys=True, default=described), user_code


def write(data: xarray.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a data set to a netCDF file, completely or not at all.

    All numbers have checksums, so netCDF does not read numbers that have changed in the file.
    """
    import_optional("netCDF4", "a netCDF file")
    checksums = {name: {"fletcher32": True} for name, values in data.variables.items()
                 if values.ndim and values.dtype.kind in "biuf"}

    def fill(draft: str) -> None:
        try:
            data.to_netcdf(draft, engine="netcdf4", encoding=checksums)
        except (OSError, RuntimeError):  # netCDF reports a full disk as "permission denied" or "HDF error"
            files.check_disk_space(draft, data.nbytes)
            raise

    files.write(path, fill)


def resume(path: str | os.PathLike[str], plan: Plan, over: dict[str, Values]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results and notes that the file `path` contains.

    Without this file, two empty dicts are returned.

    Raises
    ------
    ValueError
        If the file belongs to another sweep or to a later version. Also if the file exists, the sweep uses user-defined
        code, and the argument `key` of `sweep` was not given.
    """
    name = files.checked_path("save", path)
    files.check_suffix(name, ".nc", "save")
    files.check_writable(name)
    if not os.path.isfile(name):
        return {}, {}
    try:
        with xarray_().open_dataset(name, engine="netcdf4", decode_cf=False) as saved:
            return _saved_results(saved, name, plan, over)
    except (OSError, RuntimeError) as error:  # netCDF reports damage as either of them
        if not os.access(name, os.R_OK):
            raise
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"`save` must be a new file or a complete file of a sweep, got {name!r} ({reason}). "
                         "Give another name, or remove the file.") from None


def _saved_results(
    saved: xarray.Dataset, name: str, plan: Plan, over: dict[str, Values]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results and notes of the open file `name`.

    Raises `ValueError` if it is a file of another sweep.
    """
    notes = saved.attrs
    saved_text = CLASS_PLACE_PATTERN.sub(r'"\1"', with_current_words(str(notes.get("question"))))
    files.check_format(name, _format(notes))
    text, user_code = question(plan)
    if user_code and plan.version is None:
        raise ValueError(f"`save` must be a new file, got {name!r}, and {user_code[0]!r} could have changed since. "
                         "Give a key= that changes with your code, give another name, or remove the file.")
    if saved_text != text or not all(_same(saved, axis, array) for axis, array in over.items()):
        raise ValueError(f"`save` must be a new file or a file of the same sweep, got {name!r} of another sweep. "
                         "Give another name, or remove the file.")
    shape = tuple(map(len, over.values()))
    columns = {column: _column(saved, column, shape, plan, name) for column in ("status", *plan.results)}
    return columns, {"refusal": files.plain_text(str(notes["refusal"]))} if "refusal" in notes else {}


def _format(notes: Any) -> Any:
    """Return the format number of a file, None if it cannot be read."""
    try:
        return json.loads(notes.get("provenance", "{}")).get("format", 1)
    except (TypeError, ValueError, AttributeError, RecursionError):
        return None


def _same(saved: Any, axis: str, array: Any) -> bool:
    """Return whether a file has the values `array` of an axis.

    Sizes are compared before the values are read.
    """
    return axis in saved and saved[axis].shape == array.shape and np.array_equal(
        saved[axis].values.astype(array.dtype), array)


def _column(saved: Any, name: str, shape: tuple[int, ...], plan: Plan, path: str) -> Any:
    """Return the values of one result for all cells from a file.

    Raises `ValueError` if type, shape or size differ from the files that this module writes.
    """
    result = plan.results.get(name)
    is_integer, has_dimension = result is None or isinstance(result.fill, int), result is not None and result.dim != ""
    variable = saved.get(name)
    is_valid = (variable is not None and variable.dtype.kind == ("i" if is_integer else "f")
                and variable.nbytes <= os.path.getsize(path))
    if not is_valid or variable.shape[: len(shape)] != shape or variable.ndim != len(shape) + has_dimension:
        raise ValueError(f"`save` must be a file of a sweep of shape {shape}, got {path!r} without a matching {name}. "
                         "Remove the file.")
    values = variable.values
    if result is None and not np.isin(values, list(STATUS_NAMES)).all():
        raise ValueError(
            f"`save` must be a file whose status is one of {', '.join(STATUS_NAMES.values())}, got {path!r} "
            "with other values. Remove the file."
        )
    return values.reshape(math.prod(shape), *values.shape[len(shape):])
