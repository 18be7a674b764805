"""State for two speeds: numpy records for compiled code, plain objects with the same fields for interpreted code;
and who is due next: a tournament tree of such records.

Kernels read ``pairs[c].gap`` from either, so one source serves both, with the same bits.

Node i of a tree holds what wins between nodes 2i and 2i + 1, its time and its key; node 1 holds what is due first. The
leaves are the second half of the tree, in the order of their owners. The earlier time wins; of equal times, the lower
key.
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
"""One of them."""
NODE = np.dtype([("due", float), ("key", int)], align=True)
LAST = 1 << 62
"""Key of the empty leaves, behind all others."""
FEW = 64
"""Records that are made plain, or put in order, without looking whether that can be done better."""


def plain(records: Records) -> list[Any]:
    """Return records as plain objects with the same fields, row by row; those that are plain stay."""
    if isinstance(records, list):
        return records
    if records.ndim > 1:
        return list(map(plain, records))
    make = twin(records.dtype)
    if len(records) < FEW and not make.has_rows:
        return list(starmap(make, records.tolist()))
    return list(map(make, *(records[name].tolist() for name in records.dtype.names)))


def packed(objects: Records, dtype: np.dtype[Any] | None = None) -> np.ndarray[Any, Any]:
    """Return plain objects as an array of records (of `dtype`, if they do not say it); an array stays."""
    if isinstance(objects, np.ndarray):
        return objects
    if dtype is None:
        dtype = type(objects[0]).dtype
    return np.array(list(map(_fields_of(dtype), objects)), dtype)


def copied(records: Records) -> Records:
    """Return a copy of records of either kind, with all that they hold."""
    if isinstance(records, np.ndarray):
        return np.frombuffer(bytearray(records.tobytes()), records.dtype) if records.size else records.copy()
    held = map(_fields_of(type(records[0]).dtype), records) if records else ()
    return [type(records[0])(*(x[:] if isinstance(x, list) else x for x in values)) for values in held]


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
    return records.view(_of_one(records.dtype))[0]


@cache
def _of_one(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of the only record of an array: numpy's own for that takes four times as long."""
    fields = {name: property(itemgetter(name)) for name in dtype.names or ()}
    assert not any(hasattr(np.void, name) for name in fields)
    return np.dtype((type("Record", (np.void,), fields | {"__setattr__": np.void.__setitem__}), dtype))


def column(records: Records, name: str) -> np.ndarray[Any, Any]:
    """Return one field of all records: a view of an array, a copy of what plain objects hold."""
    if isinstance(records, np.ndarray):
        return records[name]
    return np.fromiter(map(attrgetter(name), records), type(records[0]).dtype[name], len(records))


@cache
def _fields_of(dtype: np.dtype[Any]) -> Callable[[Any], tuple[Any, ...]]:
    """Return what reads all fields of a plain object."""
    return attrgetter(*(dtype.names or ()))


@cache
def twin(dtype: np.dtype[Any]) -> Any:
    """Return the class of plain objects with the fields of `dtype`."""
    assert dtype.names is not None
    namespace = {"dtype": dtype, "has_rows": any(dtype[name].shape for name in dtype.names),
                 "__getitem__": object.__getattribute__, "__setitem__": object.__setattr__}
    return make_dataclass("Record", dtype.names, namespace=namespace, eq=False, slots=True)



def tournament(n: int) -> np.ndarray[Any, Any]:
    """Return the tree of `n` owners with their numbers as keys, none of which is ever due."""
    leaves = 1 << max(0, n - 1).bit_length()
    tree = np.empty(2 * leaves, NODE)
    tree["due"], tree["key"] = math.inf, LAST
    tree["key"][leaves : leaves + n] = np.arange(n)
    return tree


@kernel
def leaf(tree: Records, owner: int) -> Record:
    """Return the leaf of an owner; a change of it counts once `replay` is called."""
    return tree[len(tree) // 2 + owner]


@kernel
def play(tree: Records, owner: int, due: float) -> None:
    """Let an owner be due at another time, O(log n)."""
    leaf(tree, owner).due = due
    replay(tree, owner, owner)


@kernel
def replay(tree: Records, first: int, last: int) -> None:
    """Play the matches above the leaves of owners `first` … `last` again, O(log n) if they are few.

    Who wins cannot be foretold, so nothing branches on it; and times, of which the keys wait, wait for no key.
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
