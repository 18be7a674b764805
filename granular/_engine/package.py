"""Name, version and extras of this package, and lazy attributes of packages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

NAME = "granular-collisions"
"""Name for pip. The package index has another `granular` with the same folder."""
VERSION = "0.2.0"
CROSS_ROOM_LOADERS: dict[str, Callable[[], Any]] = {}
"""Loaders of functions that a room uses without an import.

They are set by `granular/__init__.py`. `contact_durations` loads `granular.md.isolation.Durations` for hard runs with
the option `watch`.
"""
EXTRAS = {"fast": "numba", "plot": "matplotlib", "sweep": "xarray netCDF4 pandas"}
"""Optional packages, by the extra that installs them."""


def install(extra: str) -> str:
    """Return the command that installs an extra.

    It also holds after an installation from a folder.
    """
    return f"pip install '{NAME}[{extra}]'"


def attributes(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package, which imports names at their first use.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    homes : mapping of str to str
        Names by the module that defines them, separated by spaces, such as {"granular.scene": "Pair Scene"}. The last
        part of a module's own name stands for the module.
    """
    home = {name: module for module, names in homes.items() for name in names.split()}

    def load(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(home[name])
        value = module if home[name].endswith(f".{name}") else getattr(module, name)
        setattr(sys.modules[package], name, value)
        return value

    return load
