"""What the commands do."""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path
from typing import Any

from granular import _check, cases
from granular.cases.case import keyword_options
from granular.cli import ABNORMAL, OK
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
    _check_writable(arguments.save)
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

    _check_writable(arguments.plot, arguments.json)
    _check_drawable(arguments.plot)
    case = _case(arguments)
    known = keyword_options(compare)
    options: dict[str, Any] = {"until": case.until, "t_end": case.t_end}
    options |= {name: value for name, value in case.run.items() if name in known} | arguments.run
    with Progress(options["t_end"]) as progress:
        report = compare(case.scene, case.physics("md"), case.rule, **options, on_progress=progress)
    print(report)
    if arguments.plot is not None:
        report.plot(arguments.plot)
    if arguments.json is not None:
        report.to_json(arguments.json)
    return _exit_code(report.soft, report.hard)


def _sweep(arguments: argparse.Namespace) -> int:
    from granular.cli import sweep

    _check_writable(arguments.save)
    sweep.run(arguments)
    return OK


def _figure(arguments: argparse.Namespace) -> int:
    from granular.cli import figure

    figure.run(arguments)
    return OK


def _frontier(arguments: argparse.Namespace) -> int:
    from granular.cli import frontier

    _check_writable(arguments.plot, arguments.json)
    _check_drawable(arguments.plot)
    frontier.run(_case(arguments), arguments)
    return OK


def _stability(arguments: argparse.Namespace) -> int:
    from granular.cli import stability

    _check_writable(arguments.json)
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


def _check_writable(*paths: str | None) -> None:
    """Find out before a long run, not after it, that its result cannot be written."""
    for name in paths:
        if name is None:
            continue
        path = Path(name)
        if path.is_dir():
            raise ValueError(f"{name}: is a directory; the name of a file is needed.")
        if not path.parent.is_dir():
            raise ValueError(f"{name}: there is no directory {str(path.parent)!r}; make it first.")
        if path.exists() and not os.access(path, os.W_OK):
            raise ValueError(f"{name}: the file is there and may not be changed.")
        try:
            tempfile.TemporaryFile(dir=path.parent).close()
        except OSError as error:
            raise ValueError(f"{name}: no file can be made in {str(path.parent)!r}: {error.strerror}.") from None


def _check_drawable(name: str | None) -> None:
    """Find out before a long run that its figure cannot be drawn."""
    if name is None:
        return
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError:
        raise ValueError("--plot needs matplotlib, which is not installed: pip install matplotlib.") from None
    endings = sorted(FigureCanvasBase.get_supported_filetypes())
    _check.choice(f"ending of {name}", Path(name).suffix[1:].lower(), endings)
