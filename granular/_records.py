"""State for two speeds: numpy records for compiled code, plain objects with the same fields for interpreted code.
May be skipped: faster, same results.

Kernels read ``pairs[c].gap`` from either, so one source serves both, with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import make_dataclass
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

Records = Any
"""An array of records (compiled), or a list of plain objects (interpreted)."""
Record = Any
"""One of them."""


def plain(records: Records) -> list[Any]:
    """Return records as plain objects with the same fields, row by row; those that are plain stay."""
    if isinstance(records, list):
        return records
    if records.ndim > 1:
        return list(map(plain, records))
    return list(map(twin(records.dtype), *(records[name].tolist() for name in records.dtype.names)))


def packed(objects: Records, dtype: np.dtype[Any] | None = None) -> np.ndarray[Any, Any]:
    """Return plain objects as an array of records (of `dtype`, if they do not say it); an array stays."""
    if isinstance(objects, np.ndarray):
        return objects
    records = np.empty(len(objects), objects[0].dtype if dtype is None else dtype)
    for name in records.dtype.names if len(records) else ():
        records[name] = list(map(attrgetter(name), objects))
    return records


def copied(records: Records) -> Records:
    """Return a copy of records of either kind."""
    return raw(records).copy().view(records.dtype) if isinstance(records, np.ndarray) else list(map(copy, records))


def taken(records: Records, numbers: Any) -> Records:
    """Return some records: of an array copies, of a list they themselves."""
    return records[numbers] if isinstance(records, np.ndarray) else [records[i] for i in numbers.tolist()]


def raw(records: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a view of the records as so many bytes each, which numpy copies at once and not field by field."""
    return records.view(np.dtype((np.void, records.dtype.itemsize)))


def one(records: np.ndarray[Any, Any]) -> Any:
    """Return the only record of an array: compiled and interpreted code read and write its fields by name.

    What is interpreted in either case does so four times as fast by ``record["name"]``, which plain objects know too.

    No field may have a name that records have for something else, such as ``base`` or ``size``.
    """
    assert _are_free(records.dtype.names or ())
    return records.view(np.recarray)[0]


@cache
def _are_free(names: tuple[str, ...]) -> bool:
    """Return whether records have none of these names for something else."""
    return not any(hasattr(np.record, name) for name in names)


def column(records: Records, name: str) -> np.ndarray[Any, Any]:
    """Return one field of all records: a view of an array, a copy of what plain objects hold."""
    if isinstance(records, np.ndarray):
        return records[name]
    return np.fromiter(map(attrgetter(name), records), type(records[0]).dtype[name], len(records))


@cache
def twin(dtype: np.dtype[Any]) -> Callable[..., Any]:
    """Return the class of plain objects with the fields of `dtype`."""
    assert dtype.names is not None
    namespace = {"dtype": dtype, "__getitem__": object.__getattribute__, "__setitem__": object.__setattr__}
    return make_dataclass("Record", dtype.names, namespace=namespace, eq=False, slots=True)
