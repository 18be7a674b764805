"""Commands `info` and `warm`: the installed packages, and compilation in advance.

`info` prints versions for bug reports, and detects another package that overwrote this one. `warm` compiles all
kernels, for example for container images, classes and test servers. A kernel is compiled once for each set of flags of
a scene (`granular._engine.kernels`). The scenes of `WARM_SCENES` have all sets of flags that ready-made scenes have.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import packages_distributions
from pathlib import Path
from time import process_time
from typing import Any

import granular
from granular import cases
from granular._engine import check, files, flight, kernels
from granular._engine.kernels import load_numba
from granular._engine.package import EXTRAS, NAME, VERSION, install
from granular._engine.reports import Report
from granular.app.cli import output
from granular.app.cli.parser import Command
from granular.cases.case import Option
from granular.laws import Hertz
from granular.laws.rules import ConstantRestitution

PACKAGE_FOLDER = Path(__file__).parents[__name__.count(".") - 1]
REINSTALL_HINT = (
    f"Uninstall it and install {NAME} again (--force-reinstall --no-deps), or use a separate environment for each"
)
WARM_SCENES = ("three-balls", "vibrated-column", "heated-gas", "ring-gas", "pendulum-cradle")
"""One scene per flag: none, driven wall, thermal walls, ring, and pendula."""
WARM_RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "hard": ("edmd", {}),
    "hard, no log": ("edmd", {"log": False}),
    "soft": ("md", {"samples": 50}),
    "fixed steps": ("md", {"method": "verlet"}),
    "fixed steps, no log": ("md", {"method": "verlet", "log": False}),
    "elastic": ("md", {"method": "verlet"}),
    "elastic, no log": ("md", {"method": "verlet", "log": False})}
"""Runs that need different kernels: engine and options of each, by name.

The hard runs end in a collapse. The elastic runs have an elastic force law and a fixed-step integrator.
"""
WARM_END: dict[str, Any] = {"t_end": 5.0, "until": None, "max_events": 1000}
"""End of these runs, late enough to call all kernels."""


@dataclass(frozen=True)
class Installation(Report):
    """Location of this package, state of numba, and versions of all dependencies.

    Attributes
    ----------
    folder : str
        Folder of the package.
    numba : str
        Folder of compiled kernels, or the reason why they are not stored.
    extras : dict
        Version of each package of each extra, None if it is missing.
    others : list of str
        Other distributions that install a package `granular`.
    """

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
        return "\n".join(
            lines + [f"{other} installs a package granular too: {REINSTALL_HINT}" for other in self.others]
        )

    def _numbers(self) -> dict[str, Any]:
        return vars(self)


class Info(Command):
    """Print the installed versions, numba's cache folder, and conflicting packages."""

    USAGE = "[--json FILE.json]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.add_outputs(parser, json="write this information")
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        extras = {extra: {name: files.version_of(name) for name in names.split()} for extra, names in EXTRAS.items()}
        output.write_report(Installation(str(PACKAGE_FOLDER), numba(), extras, others()), parsed)
        if getattr(granular, "__version__", None) != VERSION:
            raise ImportError(overwritten_message())


def numba() -> str:
    """Return a sentence on the folder of compiled kernels, or why it is missing."""
    try:
        return f"cached in {compiled_kernels_folder()}, which is writable"
    except (ImportError, OSError) as reason:
        return str(reason)


def compiled_kernels_folder() -> str:
    """Return the folder in which numba stores compiled kernels.

    Raises
    ------
    ImportError
        If numba is not installed or cannot be used.
    OSError
        If numba cannot write to any folder.
    """
    if reason := kernels.missing_compiler_reason():
        raise ImportError(reason)
    try:
        return str(kernels.load_numba().njit(cache=True)(flight.gap_after).stats.cache_path)
    except RuntimeError:
        raise OSError("not cached, every process compiles again, because numba cannot write anywhere; set "
                      "NUMBA_CACHE_DIR to a writable folder") from None


def others() -> list[str]:
    """Return names and versions of other distributions with a package `granular`."""
    names = set(packages_distributions().get("granular", ())) - {NAME}
    return [f"{name} {files.version_of(name)}" for name in sorted(names)]


def overwritten_message() -> str:
    """Return the error message for the case that another package overwrote this one.

    The command uses it if `granular.__version__` is not the version of this package.
    """
    packages = ", ".join(others()) or "another package"
    return (
        f"{PACKAGE_FOLDER / '__init__.py'} does not belong to {NAME} {VERSION}, because {packages} was installed over "
        f"it, or uninstalled. {REINSTALL_HINT}."
    )


class Warm(Command):
    """Compile the numba kernels in advance, all of them or those for given scenes."""

    USAGE = "[SCENE ...]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("scenes", nargs="*", metavar="SCENE",
                            help=f"one or several of {', '.join(WARM_SCENES)} [all of them]")
        return []

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        check.known_names(parsed.scenes, WARM_SCENES, "scene")
        print(f"machine code is cached in {compiled_kernels_folder()}")
        for name in parsed.scenes or WARM_SCENES:
            for kind, make in warm_up_calls(cases.make(name)).items():
                print(f"{name:16} {kind:20} {compile_duration(make)}", flush=True)


def warm_up_calls(case: cases.Case) -> dict[str, Callable[[], object]]:
    """Return functions that call all kernels for runs and maps of a scene, by name."""
    from granular.md.located import many

    scene, rule = case.scene, ConstantRestitution(0.1)
    runs: dict[str, Callable[[], object]] = {
        kind: partial(cases.Case(scene, Hertz(1e6) if "elastic" in kind else case.law, rule,
                                 run={"engine": "compiled"} | options).simulate, engine, **WARM_END)
        for kind, (engine, options) in WARM_RUNS.items()}
    cells = many.Scenes(scene.mass, scene.gap, scene.velocity, [[1e6, 1.0, 1.0, 0.0]], scene.gravity)
    return runs if scene._flags else runs | {"maps": partial(many.solve_many, cells, t_end=WARM_END["t_end"])}


def compile_duration(make: Callable[[], object]) -> str:
    """Call a function, and return the processor time if it compiled kernels.

    The text is "already compiled" if all kernels had been compiled before.
    """
    start = process_time()
    with load_numba().core.event.install_recorder("numba:compile") as recorder:
        make()
    return f"{process_time() - start:.1f} s" if recorder.buffer else "already compiled"
