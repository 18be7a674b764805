"""Packages that only some tasks need: loaded when they are, and named where they are missing.
May be skipped: packages, no physics.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

EXTRAS = {"plot": "matplotlib", "sweep": "xarray netCDF4", "peers": "mpmath"}
"""What the extras of this package install."""


def optional(module: str, by: str) -> Any:
    """Return a module of a package that need not be there, or raise `ImportError` that says how to install it.

    Parameters
    ----------
    module : str
        Its name, such as "matplotlib.figure".
    by : str
        What needs it.
    """
    package = module.split(".")[0]
    try:
        return import_module(module)
    except ImportError:
        extra, install = next(item for item in EXTRAS.items() if package in item[1])
        advice = f"pip install {install} (the extra {extra!r})"
        raise ImportError(f"{by} needs {package}, which is not installed: {advice}.") from None
