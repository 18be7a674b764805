"""Machine code made once, before anybody has to wait for it: for images, classes, test servers.

A kernel is compiled once for each set of flags that a scene has (`granular._engine.kernels`): the scenes here have all
sets of them that ready-made scenes have.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any

from granular import cases
from granular._engine import check
from granular._engine.kernels import load_numba
from granular.app.cli import info
from granular.app.cli.parser import Command
from granular.cases.case import Option
from granular.laws import Hertz
from granular.laws.rules import ConstantRestitution
from granular.md.located import many

SCENES = ("three-balls", "vibrated-column", "heated-gas", "ring-gas", "pendulum-cradle")
"""Plain; with a driven wall; thermal walls; on a ring; pendula."""
WAYS: dict[str, tuple[str, dict[str, Any]]] = {
    "hard": ("edmd", {}),
    "hard, no log": ("edmd", {"log": False}),
    "soft": ("md", {"samples": 50}),
    "fixed steps": ("md", {"method": "verlet"}),
    "fixed steps, no log": ("md", {"method": "verlet", "log": False}),
    "elastic": ("md", {"method": "verlet"}),
    "elastic, no log": ("md", {"method": "verlet", "log": False})}
"""What has machine code of its own: an engine, and options. Hard balls collapse; elastic ones take fixed steps."""
END: dict[str, Any] = {"t_end": 5.0, "until": None, "max_events": 1000}
"""Enough for a run to call all that it may."""


class Warm(Command):
    """Make the machine code of all runs and maps, so that nobody waits for it later; or that of some scenes."""

    USAGE = "[SCENE ...]"

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("scenes", nargs="*", metavar="SCENE",
                            help=f"code for scenes such as {', '.join(SCENES)} [all of them]")
        return []

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        check.known(given.scenes, SCENES, "scene that code is made for")
        print(f"machine code is kept in {info.kept()}")
        for name in given.scenes or SCENES:
            for kind, make in ways(cases.make(name)).items():
                print(f"{name:16} {kind:20} {made(make)}", flush=True)


def ways(case: cases.Case) -> dict[str, Callable[[], object]]:
    """Return what calls all kernels that runs of a scene need, and maps if they are open to it, by what they are."""
    scene, rule = case.scene, ConstantRestitution(0.1)
    runs: dict[str, Callable[[], object]] = {
        kind: partial(cases.Case(scene, Hertz(1e6) if "elastic" in kind else case.law, rule,
                                 run={"engine": "compiled"} | options).simulate, engine, **END)
        for kind, (engine, options) in WAYS.items()}
    cells = many.Scenes(scene.mass, scene.gap, scene.velocity, [[1e6, 1.0, 1.0, 0.0]], scene.gravity)
    return runs if scene._flags else runs | {"maps": partial(many.solve_many, cells, t_end=END["t_end"])}


def made(make: Callable[[], object]) -> str:
    """Return the processor time that a call takes for which kernels are compiled; or that they were there already."""
    begun = process_time()
    with load_numba().core.event.install_recorder("numba:compile") as recorder:
        make()
    return f"{process_time() - begun:.1f} s" if recorder.buffer else "there already"
