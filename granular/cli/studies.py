"""Commands that ask more of one scene: from where on hard spheres will do, at what price methods are right, and who is
right where the scene becomes extreme.
May be skipped: the command, no physics.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import Any

import numpy as np

import granular as gr
from granular.cases import Case
from granular.cases.case import Option
from granular.cases.ready import is_file
from granular.cli import output
from granular.cli.parser import Command, case_of, offered
from granular.trajectory import Status

MOST = 16
"""Contacts of a ready-made scene that only its time would end: the slow solvers take seconds for each, interpreted."""


class Threshold(Command):
    """Find from which gap, stiffness, … on a scene may be event-driven."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.offer(parser, plot="draw what decides over the values", json="write every value with its verdict")
        return offered(gr.threshold, "over", "between", "criterion", "error", "within", "points", "spacing")

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        with output.Progress(None, things="values") as progress:
            report = gr.threshold(given.target, **given.given, **given.run, on_progress=progress)
        output.deliver(report, given)


class Frontier(Command):
    """Measure the error of every method against its run time, on one scene."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.offer(parser, plot="draw error over run time",
                     json="write every number, with the machine and all versions")
        return offered(gr.frontier, "methods", "repeats")

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        case = case_of(given)
        if case.until is None and "t_end" not in given.run and not is_file(given.target):
            case = shortened(case)
        options: dict[str, Any] = case.options(gr.frontier) | given.run
        with output.Progress(1.0, things="settings") as progress:
            report = gr.frontier(case.scene, case.physics("md"), **options, on_progress=progress)
        output.deliver(report, given)


class Stability(Command):
    """Make a scene stiff, close, damped, unequal: which method is right, flagged, or wrong unseen?"""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.offer(parser, plot="draw the table", json="write every run")
        return offered(gr.stability, "axes", "methods", "error")

    @staticmethod
    def run(given: argparse.Namespace) -> None:
        with output.Progress(1.0, things="runs") as progress:
            report = gr.stability(given.target, **given.given, **given.run, on_progress=progress)
        output.deliver(report, given)


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
