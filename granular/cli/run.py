"""`granular run`: run a scene on one engine.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from granular.cases.case import ENGINES, Option, engine_named
from granular.cli import files
from granular.cli.parser import case_of, offered
from granular.cli.progress import Progress
from granular.cli.summary import summary
from granular.trajectory import Trajectory

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add engine and output; return the options of both engines."""
    parser.add_argument("--engine", choices=ENGINES, default="md", help="hard (edmd) or soft (md) spheres; default md")
    parser.add_argument("--watch", action="store_true", help="(--engine edmd only) count collisions that would overlap "
                        "in time with a neighbour's under the force law of the scene: a warning, not a proof")
    files.offer(parser, save="write the trajectory and its contact log")
    each = {engine: {o.name: o for o in offered(engine_named(engine))} for engine in ENGINES}
    merged: dict[str, Option] = {}
    for engine, other in (ENGINES, ENGINES[::-1]):
        for name, option in each[engine].items():
            only = "" if name in each[other] else f"(--engine {engine} only) "
            merged[name] = replace(option, about=only + option.about)
    return list(merged.values())


def run(given: argparse.Namespace) -> list[Trajectory]:
    """Run the scene and print what became of it."""
    case = case_of(given)
    options = given.run | ({"watch": case.physics("md")} if given.watch else {})
    with Progress(given.run.get("t_end", case.t_end)) as progress:
        trajectory = case.simulate(given.engine, **options, on_progress=progress)
    print(summary(case, trajectory))
    if given.save is not None:
        trajectory.save(given.save)
    return [trajectory]
