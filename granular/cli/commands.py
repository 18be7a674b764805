"""What the commands do."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

from granular import cases
from granular.cases.case import keyword_options
from granular.cli.codes import ABNORMAL, OK
from granular.cli.output import check_drawable, check_writable, show
from granular.cli.progress import Progress
from granular.cli.summary import summary
from granular.trajectory import Status, Trajectory

UNFINISHED = (Status.unstable, Status.max_events)


def run(arguments: argparse.Namespace) -> int:
    """Do what the command line says; return the exit code."""
    commands = {"scenes": _scenes, "run": _run, "compare": _compare, "sweep": _sweep, "figure": _figure,
                "frontier": _frontier, "stability": _stability,
                "page": _page, "view": _view}
    return commands[arguments.command](arguments)


def _scenes(arguments: argparse.Namespace) -> int:
    if arguments.target is not None:
        print(cases.dumps(_case(arguments)), end="")
        return OK
    width = max(len(name) for name in cases.names())
    for name in cases.names():
        print(f"{name:{width}}  {cases.about(name)}")
    print("\ngranular compare SCENE --help lists a scene's parameters; granular scenes SCENE prints it as a TOML file.")
    return OK


def _run(arguments: argparse.Namespace) -> int:
    check_writable(arguments.save)
    case = _case(arguments)
    t_end = arguments.run.get("t_end", case.t_end)
    with Progress(t_end) as progress:
        trajectory = case.simulate(arguments.engine, **arguments.run, on_progress=progress)
    print(summary(case, trajectory))
    if arguments.save is not None:
        trajectory.save(arguments.save)
    return _exit_code(trajectory)


def _compare(arguments: argparse.Namespace) -> int:
    from granular.comparison import compare

    check_writable(arguments.plot, arguments.json)
    check_drawable(arguments.plot)
    case = _case(arguments)
    known = keyword_options(compare)
    options: dict[str, Any] = {"until": case.until, "t_end": case.t_end}
    options |= {name: value for name, value in case.run.items() if name in known} | arguments.run
    if unused := [name for name in case.run if name not in known]:
        warnings.warn(f"compare makes no use of {', '.join(unused)} in [run].", stacklevel=1)
    with Progress(options["t_end"]) as progress:
        report = compare(case.scene, case.physics("md"), case.rule, **options, on_progress=progress)
    show(report, arguments.json)
    if arguments.plot is not None:
        report.plot(arguments.plot)
    if arguments.json is not None:
        report.to_json(arguments.json)
    return _exit_code(report.soft, report.hard)


def _sweep(arguments: argparse.Namespace) -> int:
    from granular.cli import sweep

    check_writable(arguments.save)
    sweep.run(arguments)
    return OK


def _figure(arguments: argparse.Namespace) -> int:
    from granular.cli import figure

    figure.run(arguments)
    return OK


def _frontier(arguments: argparse.Namespace) -> int:
    from granular.cli import frontier

    check_writable(arguments.plot, arguments.json)
    check_drawable(arguments.plot)
    frontier.run(_case(arguments), arguments)
    return OK


def _stability(arguments: argparse.Namespace) -> int:
    from granular.cli import stability

    check_writable(arguments.json)
    stability.run(arguments)
    return OK


def _page(arguments: argparse.Namespace) -> int:
    from granular.cli import page

    page.run(arguments)
    return OK


def _view(arguments: argparse.Namespace) -> int:
    from granular.cli import view

    view.run(arguments)
    return OK


def _case(arguments: argparse.Namespace) -> cases.Case:
    if arguments.target in cases.names():
        return cases.make(arguments.target, **getattr(arguments, "given", {}))
    return cases.load(arguments.target)


def _exit_code(*trajectories: Trajectory) -> int:
    return ABNORMAL if any(trajectory.status in UNFINISHED for trajectory in trajectories) else OK
