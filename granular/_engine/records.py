"""Records for compiled and interpreted kernels, and the event queue.

Records are numpy records in compiled code, and Python objects with the same fields in interpreted code. Kernels read
``pairs[c].gap`` from both kinds, so one source serves both, with bitwise identical results.

The event queue is a tournament tree of records. Each node has the time `due` and the `key` of an event. Node i contains
the earlier event of nodes 2i and 2i + 1, so node 1 contains the next event. If the times are equal, the event with the
lower key comes first. The second half of the tree consists of the leaves, one per owner (such as a pair), in order.
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
"""An array of records (compiled), or a list of Python objects (interpreted)."""
Record = Any
"""A single record of either kind."""
NODE = np.dtype([("due", float), ("key", int)], align=True)
EMPTY_KEY = 1 << 62
"""Key of leaves without an owner, larger than all other keys."""
SMALL_RECORD_COUNT = 64
"""Number of records up to which simple conversion, sorting and caching are used."""


def plain(records: Records) -> list[Any]:
    """Convert an array of records to a list of Python objects with the same fields.

    A list is returned unchanged.
    """
    if isinstance(records, list):
        return records
    if records.ndim > 1:
        return list(map(plain, records))
    make_object = plain_class(records.dtype)
    if len(records) < SMALL_RECORD_COUNT and not make_object.has_rows:
        return list(starmap(make_object, records.tolist()))
    return list(map(make_object, *(records[name].tolist() for name in records.dtype.names)))


def record_array(objects: Records, dtype: np.dtype[Any] | None = None) -> np.ndarray[Any, Any]:
    """Convert a list of Python objects to an array of records.

    An array is returned unchanged. `dtype` is required if the class of the objects does not contain it.
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
    field_tuples = map(_fields_of(type(records[0]).dtype), records) if records else ()
    return [type(records[0])(*(x[:] if isinstance(x, list) else x for x in values)) for values in field_tuples]


def selected(records: Records, numbers: Any) -> Records:
    """Return the records with the indices `numbers`.

    They are copies of the records of an array, or the same objects as in a list.
    """
    return records[numbers] if isinstance(records, np.ndarray) else [records[i] for i in numbers.tolist()]


def as_bytes(records: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a view of records as blocks of bytes, which numpy copies in one step."""
    return records.view(np.dtype((np.void, records.dtype.itemsize)))


def one(records: np.ndarray[Any, Any]) -> Any:
    """Return the only record of an array as a view with fields as attributes.

    Interpreted code is four times as fast with ``record["name"]``, which Python objects support as well. A field must
    not have the name of an attribute of numpy's records, such as ``base`` or ``size``.
    """
    return records.view(_attribute_dtype(records.dtype))[0]


@cache
def _attribute_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return a record type like `dtype` whose fields are attributes.

    Attributes are read four times as fast as with numpy's record type.
    """
    fields = {name: property(itemgetter(name)) for name in dtype.names or ()}
    assert not any(hasattr(np.void, name) for name in fields)
    return np.dtype((type("Record", (np.void,), fields | {"__setattr__": np.void.__setitem__}), dtype))


def column(records: Records, name: str) -> np.ndarray[Any, Any]:
    """Return one field of all records: a view of an array, a copy from a list."""
    if isinstance(records, np.ndarray):
        return records[name]
    return np.fromiter(map(attrgetter(name), records), type(records[0]).dtype[name], len(records))


@cache
def _fields_of(dtype: np.dtype[Any]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that returns all fields of a Python object as a tuple."""
    return attrgetter(*(dtype.names or ()))


@cache
def plain_class(dtype: np.dtype[Any]) -> Any:
    """Return the class of Python objects with the fields of `dtype`."""
    assert dtype.names is not None
    namespace = {"dtype": dtype, "has_rows": any(dtype[name].shape for name in dtype.names),
                 "__getitem__": object.__getattribute__, "__setitem__": object.__setattr__}
    return make_dataclass("Record", dtype.names, namespace=namespace, eq=False, slots=True)



def tournament(n: int) -> np.ndarray[Any, Any]:
    """Return an event queue of `n` owners without events. Keys are their numbers."""
    leaves = 1 << max(0, n - 1).bit_length()
    tree = np.empty(2 * leaves, NODE)
    tree["due"], tree["key"] = math.inf, EMPTY_KEY
    tree["key"][leaves : leaves + n] = np.arange(n)
    return tree


@kernel
def leaf(tree: Records, owner: int) -> Record:
    """Return the leaf of an owner.

    A change must be followed by a call of `update_tournament`.
    """
    return tree[len(tree) // 2 + owner]


@kernel
def set_event_time(tree: Records, owner: int, due: float) -> None:
    """Set the time of the event of an owner, and update the queue, in O(log n)."""
    leaf(tree, owner).due = due
    update_tournament(tree, owner, owner)


@kernel
def update_tournament(tree: Records, first: int, last: int) -> None:
    """Update the event queue after changes of the leaves `first` to `last`.

    The time is O(log n) for few leaves. The code avoids branches, because the processor cannot predict them.
    """
    low, high = (len(tree) // 2 + first) >> 1, (len(tree) // 2 + last) >> 1
    while low < high:
        for node in range(low, high + 1):
            winner, rival = tree[2 * node], tree[2 * node + 1]
            due, key, rival_due, rival_key = winner.due, winner.key, rival.due, rival.key
            key = rival_key if (rival_due < due) | ((rival_due == due) & (rival_key < key)) else key
            tree[node].due, tree[node].key = rival_due if rival_due < due else due, key
        low, high = low >> 1, high >> 1
    node = 2 * low
    due, key = tree[node].due, tree[node].key
    while node > 1:
        rival = tree[node ^ 1]
        rival_due, rival_key = rival.due, rival.key
        key = rival_key if (rival_due < due) | ((rival_due == due) & (rival_key < key)) else key
        due = rival_due if rival_due < due else due
        node >>= 1
        tree[node].due, tree[node].key = due, key
