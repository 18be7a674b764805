"""The parameters of a documented function as data: name, type, default, and what its docstring says.
May be skipped: files and the command, no physics.

So that the command line and its help are written once, where the function is.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any


@dataclass(frozen=True, slots=True)
class Option:
    """One parameter of a function.

    Attributes
    ----------
    name, kind, about : str
        The parameter, its annotation as written ("float", "Sequence[float] | None", …), and its description.
    default : object
        Its default value.
    """

    name: str
    kind: str
    default: Any
    about: str


def options_of(function: Callable[..., Any]) -> list[Option]:
    """Return the parameters of `function` that have a default, in order, with their NumPy-style documentation."""
    about = descriptions(function)
    parameters = inspect.signature(function).parameters.values()
    return [Option(p.name, str(p.annotation), p.default, about.get(p.name, ""))
            for p in parameters if p.default is not p.empty]


def whole(function: Callable[..., Any]) -> frozenset[str]:
    """Return the names of the parameters of `function` that are whole numbers, by their annotations."""
    parameters = inspect.signature(function).parameters.values()
    return frozenset(p.name for p in parameters if p.annotation in (int, "int"))


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Return what the Parameters section of a NumPy-style docstring says of each parameter, on one line each.

    A type that lists choices, such as ``{"left", "right"}``, comes first.
    """
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    entry_of_names = r"^(\w[\w, ]*) : (.*)\n((?:[ \t]+.*\n?|\n)*)"
    found: dict[str, str] = {}
    for names, kind, about in re.findall(entry_of_names, section[1] if section else "", re.MULTILINE):
        choices = kind.partition("}")[0] + "}: " if kind.startswith("{") else ""
        found |= dict.fromkeys(names.split(", "), choices + " ".join(about.split()))
    return found


@cache
def summary(function: Callable[..., Any]) -> str:
    """Return the first paragraph of a docstring on one line."""
    return " ".join((inspect.getdoc(function) or "").split("\n\n")[0].split())
