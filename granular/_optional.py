"""Packages that only some tasks need: loaded when they are, and named where they are missing.
May be skipped: packages, no physics.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def optional(module: str, by: str, install: str = "") -> Any:
    """Return a module of a package that need not be there, or raise `ImportError` that says how to install it.

    Parameters
    ----------
    module : str
        Its name, such as "matplotlib.figure".
    by : str
        What needs it.
    install : str
        What to install, if not the package alone.
    """
    package = module.split(".")[0]
    try:
        return import_module(module)
    except ImportError:
        advice = f"pip install {install or package}"
        raise ImportError(f"{by} needs {package}, which is not installed: {advice}.") from None
