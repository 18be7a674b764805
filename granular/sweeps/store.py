"""The data set of a sweep, its file, and how an interrupted sweep goes on.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import json
import os
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import _files
from granular._describe import by_words
from granular._optional import optional
from granular.sweeps.axes import Values
from granular.sweeps.plan import Plan
from granular.sweeps.results import STATUS

if TYPE_CHECKING:
    import xarray


def xarray_() -> Any:
    """Return the module xarray."""
    return optional("xarray", "sweep")


def dataset(plan: Plan, over: dict[str, Values], values: dict[str, Any], notes: dict[str, Any]) -> xarray.Dataset:
    """Return the data set: one dimension per axis, then pair or body; units and provenance as attributes."""
    shape = tuple(map(len, over.values()))
    coordinates: dict[str, Any] = {name: (name, array, plan.subject.attributes(name)) for name, array in over.items()}
    status = {"long_name": "how the run of the cell ended", "flag_values": list(STATUS),
              "flag_meanings": " ".join(STATUS.values())}
    variables = {"status": (tuple(over), values["status"].astype(np.int8).reshape(shape), status)}
    for name, result in plan.results.items():
        array = values[name].astype(np.int32) if values[name].dtype.kind == "i" else values[name]
        dims = (*over, result.dim) if result.dim else tuple(over)
        variables[name] = (dims, array.reshape(*shape, *array.shape[1:]),
                           {"units": result.units, "long_name": result.about})
        if result.dim:
            coordinates[result.dim] = result.dim, np.arange(array.shape[1]), {"comment": "counted from the bottom"}
    about = {"title": f"granular sweep of {plan.subject.title}", "question": question(plan),
             "provenance": json.dumps(_files.provenance())}
    data: xarray.Dataset = xarray_().Dataset(variables, coordinates, about | notes)
    return data


def question(plan: Plan) -> str:
    """What is asked, as text: two sweeps with the same question and axes have the same answers."""
    words = {"scene": plan.subject.text, "fixed": plan.fixed, "over": plan.names, "results": list(plan.results),
             "run": plan.run}
    return json.dumps(words, default=repr, sort_keys=True)


def write(data: xarray.Dataset, path: str | PathLike[str]) -> None:
    """Write a data set to a netCDF file, whole or not at all."""
    optional("netCDF4", "a netCDF file")

    def fill(draft: str) -> None:
        try:
            data.to_netcdf(draft, engine="netcdf4")
        except (OSError, RuntimeError):  # of a full disk netCDF says that permission is denied, or "HDF error"
            _files.check_room(draft, data.nbytes)
            raise

    _files.write(path, fill)


def resume(path: str | PathLike[str], plan: Plan, over: dict[str, Values]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the results that a file already has, and its notes; nothing if it is not there.

    Raises
    ------
    ValueError
        If the file holds the answers to another question, or is of a later version.
    """
    name = _files.checked_path("save", path)
    _files.check_ending(name, ".nc")
    if not os.path.isfile(name):
        return {}, {}
    with xarray_().open_dataset(name, engine="netcdf4", decode_cf=False) as stored:
        asked, notes = by_words(str(stored.attrs.get("question"))), stored.attrs
        _files.check_format(name, _format(notes))
        if asked != question(plan) or not all(_same(stored, axis, array) for axis, array in over.items()):
            raise ValueError(f"save is {name!r}: it holds another sweep; give another name, or remove it.")
        shape = tuple(map(len, over.values()))
        columns = {one: _column(stored, one, shape, plan, name) for one in ("status", *plan.results)}
        return columns, {"refusal": _files.plain_text(str(notes["refusal"]))} if "refusal" in notes else {}


def _format(notes: Any) -> Any:
    """Number of the format that a file says it has."""
    try:
        provenance = json.loads(notes.get("provenance", "{}"))
        return provenance.get("format", 1)
    except (TypeError, ValueError, AttributeError, RecursionError):
        return None


def _same(stored: Any, axis: str, array: Any) -> bool:
    """Whether a file has the values of an axis; read only if there are as many."""
    return axis in stored and stored[axis].shape == array.shape and np.array_equal(
        stored[axis].values.astype(array.dtype), array)


def _column(stored: Any, name: str, shape: tuple[int, ...], plan: Plan, path: str) -> Any:
    """The answers of all cells; read only if they are of the kind, shape and size that a file of ours has."""
    result = plan.results.get(name)
    whole, deep = result is None or isinstance(result.fill, int), result is not None and result.dim != ""
    there = stored.get(name)
    good = there is not None and there.dtype.kind == ("i" if whole else "f") and there.nbytes <= os.path.getsize(path)
    if not good or there.shape[: len(shape)] != shape or there.ndim != len(shape) + deep:
        raise ValueError(f"save is {path!r}: it has no {name} as a sweep of shape {shape} has; remove it.")
    values = there.values
    if result is None and not np.isin(values, list(STATUS)).all():
        raise ValueError(f"save is {path!r}: its status is none of {', '.join(STATUS.values())}; remove it.")
    return values.reshape(-1, *values.shape[len(shape):])
