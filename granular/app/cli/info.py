"""What is installed, to look for a fault or to report one; whether another package lies over this one."""

from __future__ import annotations

import argparse
import platform
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import granular
from granular._engine import files, flight, kernels
from granular._engine.about import EXTRAS, NAME, VERSION, install
from granular._engine.reports import Report
from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.cases.case import Option

FOLDER = Path(__file__).parents[__name__.count(".") - 1]
REMEDY = f"uninstall it and install {NAME} again (--force-reinstall --no-deps), or give each an environment of its own"


@dataclass(frozen=True)
class Installation(Report):
    """Where this package lies, what numba does, the versions of the packages of each extra, and who else installs a
    package `granular`."""

    folder: str
    numba: str
    extras: dict[str, dict[str, str | None]]
    others: list[str]

    def __str__(self) -> str:
        core = ", ".join(f"{name} {files.version_of(name)}" for name in ("numpy", "scipy", "sortedcontainers"))
        lines = [f"{NAME} {VERSION}, in {self.folder}", f"Python {platform.python_version()}, {core}"]
        for extra, packages in self.extras.items():
            found = ", ".join(f"{name} {version or 'missing'}" for name, version in packages.items())
            lines.append(f"extra {extra:5}  {found}" + ("" if all(packages.values()) else f": {install(extra)}"))
        lines.append(f"machine code: {self.numba}")
        return "\n".join(lines + [f"{other} installs a package granular too: {REMEDY}" for other in self.others])

    def _numbers(self) -> dict[str, Any]:
        return vars(self)


class Info(Command):
    """Say what is installed: versions, extras, numba's cache, and whether another package lies over this one."""

    USAGE = "[--json FILE.json]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.offer(parser, json="write it")
        return []

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        extras = {extra: {name: files.version_of(name) for name in names.split()} for extra, names in EXTRAS.items()}
        output.deliver(Installation(str(FOLDER), numba(), extras, others()), given)
        if getattr(granular, "__version__", None) != VERSION:
            raise ImportError(overwritten())


def numba() -> str:
    """Return where numba keeps machine code, in its own words; or why there is none."""
    try:
        return f"kept in {kept()}, which can be written"
    except (ImportError, OSError) as why:
        return str(why)


def kept() -> str:
    """Return the folder in which numba keeps machine code; raise if there is no compiler, or no such folder."""
    if why := kernels.no_compiler():
        raise ImportError(why)
    try:
        return str(kernels.load_numba().njit(cache=True)(flight.gap_after).stats.cache_path)
    except RuntimeError:
        raise OSError("nothing is kept, every process compiles anew: numba can write nowhere; "
                      "set NUMBA_CACHE_DIR to a folder that it can") from None


def others() -> list[str]:
    """Return names and versions of other distributions that install a package `granular`."""
    names = set(packages_distributions().get("granular", ())) - {NAME}
    return [f"{name} {files.version_of(name)}" for name in sorted(names)]


def overwritten() -> str:
    """Return what is wrong, and what to do, where Python loads another package's `granular/__init__.py`, or none."""
    who = ", ".join(others()) or "another package"
    return (f"{FOLDER / '__init__.py'} is not that of {NAME} {VERSION}: {who} was installed over it, or uninstalled; "
            f"{REMEDY}.")
