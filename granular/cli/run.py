"""`granular run`: one scene on one engine."""

from __future__ import annotations

import argparse

from granular.cases.case import ENGINES, engine_named
from granular.cases.options import Option, options_of
from granular.cli.codes import exit_code
from granular.cli.output import check_writable
from granular.cli.parser import HIDDEN, case_of
from granular.cli.progress import Progress
from granular.cli.summary import summary

USAGE = "SCENE|FILE.toml [options]"


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add engine and output; return the options of both engines."""
    parser.add_argument("--engine", choices=ENGINES, default="md", help="hard (edmd) or soft (md) spheres; default md")
    parser.add_argument("--save", metavar="FILE.npz", help="write the trajectory and its contact log")
    each = {engine: {o.name: o for o in options_of(engine_named(engine))} for engine in ENGINES}
    merged = []
    for name in dict.fromkeys(name for options in each.values() for name in options if name not in HIDDEN):
        having = [engine for engine in ENGINES if name in each[engine]]
        option = each[having[-1]][name]
        only = "" if len(having) == len(ENGINES) else f"(--engine {having[0]} only) "
        merged.append(Option(name, option.kind, option.default, only + option.about))
    return merged


def run(given: argparse.Namespace) -> int:
    """Run the scene and print what became of it."""
    check_writable(given.save)
    case = case_of(given)
    with Progress(given.run.get("t_end", case.t_end)) as progress:
        trajectory = case.simulate(given.engine, **given.run, on_progress=progress)
    print(summary(case, trajectory))
    if given.save is not None:
        trajectory.save(given.save)
    return exit_code(trajectory)
