"""What a sweep varies: the values of parameters, and their text form.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular import _check

Values = np.ndarray[Any, np.dtype[Any]]

MOST = 10**8
"""Cells that a sweep may have: their results must fit into memory."""


def axis(text: str) -> tuple[str, Values]:
    """Read ``name=first:last:count`` or ``name=first:last:count:log`` or ``name=value,value,…``.

    >>> axis("restitution=0.5:1:3")
    ('restitution', array([0.5 , 0.75, 1.  ]))
    """
    name, equals, values = text.partition("=")
    if not equals:
        raise ValueError(f"axis is {text!r}: name=first:last:count[:log] or name=value,value,… is needed.")
    if ":" not in values:
        return name, _array(name, [_value(word) for word in values.split(",")])
    if values.count(":") not in (2, 3):
        raise ValueError(f"axis is {text!r}: name=first:last:count[:log] is needed, such as {name}=0.5:1:101.")
    first, last, count, *scale = values.split(":")
    a, b = (_check.number(f"{what} of {name}", _value(word)) for what, word in (("first", first), ("last", last)))
    n = _check.whole(f"count of {name}", _value(count), at_least=1, at_most=MOST)
    if scale not in ([], ["log"]):
        raise ValueError(f"axis is {text!r}: after first:last:count only ':log' may follow.")
    if scale and not (a > 0.0 and b > 0.0):
        raise ValueError(f"axis is {text!r}: a logarithmic axis needs positive ends.")
    return name, (np.geomspace if scale else np.linspace)(a, b, n)


def checked(over: Any) -> dict[str, Values]:
    """Return the axes as arrays; `over` is a mapping of names to values, or texts for `axis`."""
    texts = [over] if isinstance(over, str) else over
    axes: dict[str, Values] = {}
    for name, values in over.items() if isinstance(over, Mapping) else map(axis, texts):
        array = _array(name, values)
        if name in axes:
            raise ValueError(f"{name} is given twice: one axis per parameter is needed.")
        if len(np.unique(array)) < len(array):
            raise ValueError(f"values of {name} are not all different: one cell per value is needed.")
        axes[name] = array
    if not axes:
        raise ValueError("over is empty: at least one parameter with its values is needed.")
    cells = math.prod(map(len, axes.values()))
    if cells > MOST:
        raise ValueError(f"over has {cells:.3g} cells: at most {MOST:.0e} fit; take fewer values, or several sweeps.")
    return axes


def _array(name: str, values: Any) -> Values:
    array = np.asarray(values)
    mixed = array.dtype.kind != "b" and _check.among_numbers(values)
    if array.dtype.kind not in "biufU" or array.ndim != 1 or not len(array) or mixed:
        raise TypeError(f"values of {name} are {values!r}: a list of numbers or words is needed.")
    return array


def _value(text: str) -> Any:
    word = text.strip()
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return {"True": True, "False": False}.get(word, word)
