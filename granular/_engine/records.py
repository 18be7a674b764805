"""Records for compiled and interpreted kernels, and the event queue.

Records are numpy records in compiled code, and plain objects with the same fields in interpreted code. Kernels read
``pairs[c].gap`` from either, so that one source serves both, with bitwise identical results.

The event queue is a tournament tree over such records. Node i holds the earlier one of nodes 2i and 2i + 1, with its
time and its key, and node 1 holds the next event. The leaves are the second half of the tree, in the order of their
owners. Of equal times the lower key comes first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import make_dataclass
from functools import cache
from itertools import starmap
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

from granular._engine.kernels import kernel

Records = Any
"""An array of records (compiled), or a list of plain objects (interpreted)."""
Record = Any
"""A single record."""
NODE = np.dtype([("due", float), ("key", int)], align=True)
EMPTY_KEY = 1 << 62
"""Key of empty leaves, larger than all others."""
SMALL_RECORD_COUNT = 64
"""Number of records up to which simple conversion and sorting are used."""


def plain(records: Records) -> list[Any]:
    """Convert records to plain objects with the same fields. Plain objects stay."""
    if isinstance(records, list):
        return records
    if records.ndim > 1:
        return list(map(plain, records))
    make = plain_class(records.dtype)
    if len(records) < SMALL_RECORD_COUNT and not make.has_rows:
        return list(starmap(make, records.tolist()))
    return list(map(make, *(records[name].tolist() for name in records.dtype.names)))


def packed(objects: Records, dtype: np.dtype[Any] | None = None) -> np.ndarray[Any, Any]:
    """Convert plain objects to an array of records. An array stays.

    `dtype` is needed if the objects do not contain it.
    """
    if isinstance(objects, np.ndarray):
        return objects
    if dtype is None:
        dtype = type(objects[0]).dtype
    return np.array(list(map(_fields_of(dtype), objects)), dtype)


def copied(records: Records) -> Records:
    """Return a deep copy of records of either kind."""
    if isinstance(records, np.ndarray):
        return np.frombuffer(bytearray(records.tobytes()), records.dtype) if records.size else records.copy()
    held = map(_fields_of(type(records[0]).dtype), records) if records else ()
    return [type(records[0])(*(x[:] if isinstance(x, list) else x for x in values)) for values in held]


def taken(records: Records, numbers: Any) -> Records:
    """Return the records with some numbers: copies from an array, not from a list."""
    return records[numbers] if isinstance(records, np.ndarray) else [records[i] for i in numbers.tolist()]


def raw(records: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a view of the records as raw bytes, which numpy copies in one step."""
    return records.view(np.dtype((np.void, records.dtype.itemsize)))


def one(records: np.ndarray[Any, Any]) -> Any:
    """Return the only record of an array, with fields as attributes.

    Interpreted code is four times as fast with ``record["name"]``, which plain objects support as well. No field may
    have a name that records use otherwise, such as ``base`` or ``size``.
    """
    return records.view(_of_one(records.dtype))[0]


@cache
def _of_one(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return a record type whose fields are attributes.

    Access is four times as fast as with numpy's record type.
    """
    fields = {name: property(itemgetter(name)) for name in dtype.names or ()}
    assert not any(hasattr(np.void, name) for name in fields)
    return np.dtype((type("Record", (np.void,), fields | {"__setattr__": np.void.__setitem__}), dtype))


def column(records: Records, name: str) -> np.ndarray[Any, Any]:
    """Return one field of all records: a view of an array, a copy from plain objects."""
    if isinstance(records, np.ndarray):
        return records[name]
    return np.fromiter(map(attrgetter(name), records), type(records[0]).dtype[name], len(records))


@cache
def _fields_of(dtype: np.dtype[Any]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that reads all fields of a plain object."""
    return attrgetter(*(dtype.names or ()))


@cache
def plain_class(dtype: np.dtype[Any]) -> Any:
    """Return the class of plain objects with the fields of `dtype`."""
    assert dtype.names is not None
    namespace = {"dtype": dtype, "has_rows": any(dtype[name].shape for name in dtype.names),
                 "__getitem__": object.__getattribute__, "__setitem__": object.__setattr__}
    return make_dataclass("Record", dtype.names, namespace=namespace, eq=False, slots=True)



def tournament(n: int) -> np.ndarray[Any, Any]:
    """Return the tree of `n` owners with their numbers as keys, without events."""
    leaves = 1 << max(0, n - 1).bit_length()
    tree = np.empty(2 * leaves, NODE)
    tree["due"], tree["key"] = math.inf, EMPTY_KEY
    tree["key"][leaves : leaves + n] = np.arange(n)
    return tree


@kernel
def leaf(tree: Records, owner: int) -> Record:
    """Return the leaf of an owner. Call `replay` after changing it."""
    return tree[len(tree) // 2 + owner]


@kernel
def play(tree: Records, owner: int, due: float) -> None:
    """Set the time of an owner's event, in O(log n)."""
    leaf(tree, owner).due = due
    replay(tree, owner, owner)


@kernel
def replay(tree: Records, first: int, last: int) -> None:
    """Update the tree above the leaves `first` … `last`, in O(log n) for few leaves.

    The outcome of a comparison is unpredictable for the processor. The code therefore avoids branches. Times do not
    depend on keys, so that they are computed first.
    """
    low, high = (len(tree) // 2 + first) >> 1, (len(tree) // 2 + last) >> 1
    while low < high:
        for node in range(low, high + 1):
            winner, rival = tree[2 * node], tree[2 * node + 1]
            due, key, other, number = winner.due, winner.key, rival.due, rival.key
            key = number if (other < due) | ((other == due) & (number < key)) else key
            tree[node].due, tree[node].key = other if other < due else due, key
        low, high = low >> 1, high >> 1
    node = 2 * low
    due, key = tree[node].due, tree[node].key
    while node > 1:
        rival = tree[node ^ 1]
        other, number = rival.due, rival.key
        key = number if (other < due) | ((other == due) & (number < key)) else key
        due = other if other < due else due
        node >>= 1
        tree[node].due, tree[node].key = due, key
