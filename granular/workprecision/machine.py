"""Where run times were measured."""

from __future__ import annotations

from typing import Any

from granular._files import version_of


def machine() -> dict[str, Any]:
    """Processor, number of its cores this process may use, system, and versions of what the numbers depend on."""
    import os
    import platform

    packages = ("granular", "numpy", "scipy", "numba", "mpmath")
    versions = {name: version_of(name) or "not installed" for name in packages}
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
