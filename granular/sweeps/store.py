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
    _files.check_ending(path, ".nc")
    if not os.path.exists(path):
        return {}, {}
    with xarray_().open_dataset(path, engine="netcdf4", decode_cf=False) as stored:
        data = stored.load()
    _files.check_format(path, json.loads(data.attrs.get("provenance", "{}")).get("format", 1))
    same = data.attrs.get("question") == question(plan) and all(
        name in data and np.array_equal(data[name].values.astype(array.dtype), array) for name, array in over.items()
    )
    if not same:
        raise ValueError(f"save is {os.fspath(path)!r}: it holds another sweep; give another name, or remove it.")
    arrays = {name: data[name].values for name in ("status", *plan.results)}
    columns = {name: array.reshape(-1, *array.shape[len(over):]) for name, array in arrays.items()}
    return columns, {key: value for key, value in data.attrs.items() if key == "refusal"}
