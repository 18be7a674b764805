"""Where run times were measured."""

from __future__ import annotations

from typing import Any


def machine() -> dict[str, Any]:
    """Processor, number of its cores this process may use, system, and versions of what the numbers depend on."""
    import os
    import platform
    from importlib.metadata import PackageNotFoundError, version

    versions = {}
    for name in ("granular", "numpy", "scipy", "numba", "mpmath"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    system = f"{platform.system()} {platform.machine()}"
    return {"processor": _processor(), "cores": cores, "system": system, "python": platform.python_version()} | versions


def _processor() -> str:
    """Name of the processor."""
    import platform
    import re

    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            if found := re.search(r"^model name\s*:\s*(.+)$", file.read(), re.MULTILINE):
                return found[1]
    except OSError:
        pass
    return platform.processor() or platform.machine()
