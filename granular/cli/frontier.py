"""`granular frontier`: measure the error of every method against its run time, on one scene.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

from granular.cases import Case
from granular.cases.case import Option
from granular.cases.ready import is_file
from granular.cli import files
from granular.cli.parser import case_of, offered
from granular.cli.progress import Progress
from granular.frontiers import frontier
from granular.trajectory import Status

USAGE = "SCENE|FILE.toml [options]"
MOST = 16
"""Contacts of a ready-made scene that only its time would end: the slow solvers take seconds for each, interpreted."""


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add the files to write; return the options of `frontier`."""
    files.offer(parser, plot="draw error over run time", json="write every number, with the machine and all versions")
    return offered(frontier, "methods", "repeats")


def shortened(case: Case) -> Case:
    """Return a case that ends after its first contacts, if it has more than can be measured within a minute, and
    any of them ends: where for the longest time none of the later ones begins or ends."""
    first = case.simulate("md", max_events=MOST)
    if first.status is not Status.max_events:
        return case
    if np.isnan(first.contacts["t_end"]).all():
        return case
    times = np.sort(np.concatenate([first.contacts["t_begin"], first.contacts["t_end"]]))
    times = times[~np.isnan(times)][MOST:]
    i = int(np.diff(times).argmax())
    end = float(0.5 * (times[i] + times[i + 1]))
    print(f"granular: up to t = {end:.6g} s; give --t-end for another end", file=sys.stderr)
    return replace(case, t_end=end)


def run(given: argparse.Namespace) -> None:
    """Measure, print, and write what was asked for."""
    case = case_of(given)
    if case.until is None and "t_end" not in given.run and not is_file(given.target):
        case = shortened(case)
    options = case.options(frontier) | given.run
    with Progress(1.0, things="settings") as progress:
        report = frontier(case.scene, case.physics("md"), **options, on_progress=progress)
    files.deliver(report, given)
