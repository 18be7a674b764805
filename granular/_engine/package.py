"""Name, version, extras and optional imports of this package, and lazy attributes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

NAME = "granular-collisions"
"""Name for pip. Another package on PyPI has the import name `granular`."""
VERSION = "0.3.0"
"""Version, read by the build. `tests/docs/test_citation.py` compares all copies."""
CROSS_ROOM_LOADERS: dict[str, Callable[[], Any]] = {}
"""Loaders of functions of other subpackages that a subpackage must not import.

They are set by `granular/__init__.py`. `contact_durations` returns `granular.md.isolation.Durations`, for runs of hard
spheres with the option `watch`.
"""
EXTRAS = {"fast": "numba", "plot": "matplotlib", "sweep": "xarray netCDF4 pandas"}
"""Names of optional packages, by the extra of pip that installs them."""


def install(extra: str) -> str:
    """Return the command that installs the optional packages of an extra.

    It also works after an installation from a folder.
    """
    return f"pip install '{NAME}[{extra}]'"


def import_optional(module: str, by: str) -> Any:
    """Import and return a module of an optional package.

    Without the package, `ImportError` with the command for its installation is raised.

    Parameters
    ----------
    module : str
        Name of the module, such as "matplotlib.figure".
    by : str
        Feature that requires it, for the message.
    """
    package = module.split(".")[0]
    try:
        return import_module(module)
    except ImportError:
        extra = next((name for name, packages in EXTRAS.items() if package in packages.split()), "plot")
        raise ImportError(f"{by} requires {package}, which is not installed. Install it with: "
                          f"{install(extra)}") from None


def attributes(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a ``__getattr__`` of a package that imports names at their first use.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    homes : mapping of str to str
        Names, separated by spaces, by the module that defines them, such as {"granular.scene": "Pair Scene"}. A name
        that is the last part of the name of its module denotes the module itself.
    """
    module_of = {name: module for module, names in homes.items() for name in names.split()}

    def load(name: str) -> Any:
        """Import and keep the attribute `name` of the package at its first use."""
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(module_of[name])
        value = module if module_of[name].endswith(f".{name}") else getattr(module, name)
        setattr(sys.modules[package], name, value)
        return value

    return load
