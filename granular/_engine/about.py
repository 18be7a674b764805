"""What this package is called, which version it is, and what its extras install."""

NAME = "granular-collisions"
"""For pip: the package index has another `granular`, which installs a folder of the same name."""
VERSION = "0.2.0"
EXTRAS = {"fast": "numba", "plot": "matplotlib", "sweep": "xarray netCDF4 pandas"}
"""Packages that only some tasks need, by the extra that installs them."""


def install(extra: str) -> str:
    """Return the line that installs an extra, also where this package was installed from a folder."""
    return f"pip install '{NAME}[{extra}]'"
