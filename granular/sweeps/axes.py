"""What a sweep varies: the names of parameters, their values, and the text form of both."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from granular import _check
from granular.cases.options import Option, unknown

Values = np.ndarray[Any, np.dtype[Any]]

MOST = 10**8
"""Cells that a sweep may have: their results must fit into memory."""

_NAME = re.compile(r"(\w+)(?:\[(\d+)\])?")
_UNIT = re.compile(r"\bin (kg/m³|m/s²|m/s|N/m|kg|m|s|J)(?![\w/])")


def axis(text: str) -> tuple[str, Values]:
    """Read ``name=first:last:count`` or ``name=first:last:count:log`` or ``name=value,value,…``.

    >>> axis("restitution=0.5:1:3")
    ('restitution', array([0.5 , 0.75, 1.  ]))
    """
    name, equals, values = text.partition("=")
    if not equals:
        raise ValueError(f"axis is {text!r}: name=first:last:count[:log] or name=value,value,… is needed.")
    if ":" not in values:
        return name, np.array([_value(word) for word in values.split(",")])
    if values.count(":") not in (2, 3):
        raise ValueError(f"axis is {text!r}: name=first:last:count[:log] is needed, such as {name}=0.5:1:101.")
    first, last, count, *scale = values.split(":")
    a, b = (_check.number(f"{what} of {name}", _value(word)) for what, word in (("first", first), ("last", last)))
    n = _check.whole(f"count of {name}", _value(count), at_least=1, at_most=MOST)
    if scale not in ([], ["log"]):
        raise ValueError(f"axis is {text!r}: after first:last:count only ':log' may follow.")
    if not scale:
        return name, np.linspace(a, b, n)
    if not (a > 0.0 and b > 0.0):
        raise ValueError(f"axis is {text!r}: a logarithmic axis needs positive ends.")
    return name, np.geomspace(a, b, n)


def checked(over: Any) -> dict[str, Values]:
    """Return the axes as arrays; `over` is a mapping of names to values, or texts for `axis`."""
    if isinstance(over, str):
        over = [over]
    pairs = over.items() if isinstance(over, Mapping) else [axis(text) for text in over]
    axes: dict[str, Values] = {}
    for name, values in pairs:
        array = np.asarray(values)
        if array.dtype.kind not in "biufU" or array.ndim != 1 or not len(array):
            raise TypeError(f"values of {name} are {values!r}: a list of numbers or words is needed.")
        if name in axes:
            raise ValueError(f"{name} is given twice: one axis per parameter is needed.")
        if len(np.unique(array)) < len(array):
            raise ValueError(f"values of {name} are not all different: one cell per value is needed.")
        axes[name] = array
    if not axes:
        raise ValueError("over is empty: at least one parameter with its values is needed.")
    cells = math.prod(len(array) for array in axes.values())
    if cells > MOST:
        raise ValueError(f"over has {cells:.3g} cells: at most {MOST:.0e} fit; take fewer values, or several sweeps.")
    return axes


def split(name: str) -> tuple[str, int | None]:
    """Return parameter and index of ``radii[0]``, or the name itself and None."""
    match = _NAME.fullmatch(name)
    if match is None:
        raise ValueError(f"{name!r} is no name of a parameter, such as gap or radii[0].")
    return match[1], None if match[2] is None else int(match[2])


def check_names(names: list[str], options: list[Option], where: str) -> None:
    """Raise if a name is no parameter of the scene, or indexes one that is no sequence."""
    kinds = {option.name: option.kind for option in options} | {"t_end": "float"}
    for name in names:
        plain, index = split(name)
        if wrong := unknown([plain], kinds, f"parameter of {where}"):
            raise TypeError(wrong)
        if index is not None and "Sequence" not in kinds[plain]:
            raise TypeError(f"{name!r} is no parameter of {where}: {plain} is a single value.")


def put(parameters: dict[str, Any], name: str, value: Any) -> None:
    """Set a parameter, or one entry of a sequence of parameters."""
    plain, index = split(name)
    if index is None:
        parameters[plain] = value
        return
    entries = list(parameters[plain])
    if index >= len(entries):
        raise ValueError(f"{name} is asked for, and {plain} has {len(entries)} entries, counted from 0.")
    entries[index] = value
    parameters[plain] = entries


def attributes(name: str, options: list[Option]) -> dict[str, str]:
    """Unit, label for plots and description of a parameter, from the docstring that has them."""
    about = {option.name: option.about for option in options}.get(split(name)[0], "")
    unit = _UNIT.search(about)
    units = unit[1] if unit else "s" if name == "t_end" else "1"
    return {"units": units, "long_name": name.replace("_", " "), "comment": about.partition(". ")[0]}


def _value(text: str) -> Any:
    if text.strip() in ("True", "False"):
        return text.strip() == "True"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text.strip()
