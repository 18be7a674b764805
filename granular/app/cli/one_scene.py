"""Commands on one scene.

`scenes` prints a scene, `run` runs it with one engine, and `compare` with both engines. `threshold`, `frontier` and
`stability` study it.
"""

from __future__ import annotations

import argparse
import math
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import granular as gr
from granular import cases
from granular._engine.reports import aligned, scene_text
from granular.app.cli import output
from granular.app.cli.parser import Command, add_until_option, case_of, options_from
from granular.cases.case import ENGINE_NAMES, Option, engine_named
from granular.cases.ready import is_file
from granular.comparison.outcome import energy_between_surfaces
from granular.run.trajectory import Status, Trajectory
from granular.scene.pair import body_name

MAX_TABLE_ROWS = 20
"""Maximum number of rows of a table."""
MAX_SENSITIVITY_SIZE = 200
"""Contacts × bodies up to which the full report includes sensitivities.

They take several hundred runs.
"""
SAMPLES_HELP = (
    "States to record: a number of evenly spaced times up to the end of the run, or the word contacts for a few times "
    "before, during and after every contact. Defaults to the first and the last state. The run is solved twice for "
    "contacts, and for a number without --t-end. The last sample of a run that ends early is its final state.")
"""Description of --samples. Python has more values of this option."""
MAX_CONTACTS_READ = 10**6
"""Maximum number of contacts that are read back from the file of --log."""
REST_ENERGY_ROUNDING = 1e-14
"""Relative rounding error of the energy of balls at rest, from sums of heights."""
MAX_STUDY_CONTACTS = 16
"""Maximum number of contacts in a study of a ready-made scene.

A longer scene that has only an end time is shortened, because interpreted solvers take seconds per contact.
"""


class Scenes(Command):
    """List the ready-made scenes, or print one as a TOML file."""

    USAGE = "SCENE"

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        if parsed.target is not None:
            print(cases.dumps(case_of(parsed)), end="")
            return
        print(output.wrap_text(aligned([[name, cases.about(name)] for name in cases.names()], "<")))
        print(output.wrap_text("\ngranular compare SCENE --help lists the parameters of a scene.\n"
                            "granular scenes SCENE prints it as a TOML file."))


class Run(Command):
    """Run a scene with one engine."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        about = "edmd for hard spheres, md for soft spheres [md]"
        parser.add_argument("--engine", choices=ENGINE_NAMES, default="md", help=about)
        parser.add_argument("--watch", action="store_true", help="(--engine edmd only) count the collisions "
                            "whose contacts would overlap in time with a contact of a neighbouring pair under the "
                            "force law of the scene: an estimate, not a proof")
        add_until_option(parser)
        parser.add_argument("--log", metavar="FILE.npy", help="write the contacts to this file during the run")
        output.add_outputs(parser, save="write the trajectory and its contact log; the suffix .nc (netCDF), .csv "
                                  "(contacts) or .extxyz (OVITO) selects another format")
        options_by_engine = {engine: {o.name: o for o in options_from(engine_named(engine))} for engine in ENGINE_NAMES}
        merged: dict[str, Option] = {}
        for engine, other in (ENGINE_NAMES, ENGINE_NAMES[::-1]):
            for name, option in options_by_engine[engine].items():
                prefix = "" if name in options_by_engine[other] else f"(--engine {engine} only) "
                merged[name] = replace(option, about=prefix + option.about)
        return list((merged | {"samples": replace(merged["samples"], about=SAMPLES_HELP)}).values())

    @staticmethod
    def run(parsed: argparse.Namespace) -> list[Trajectory]:
        case = case_of(parsed)
        if parsed.log and (parsed.save or "").endswith(".csv"):
            raise ValueError(f"--save {parsed.save} would write the contacts, which --log writes already. Leave out "
                             "one of the two.")
        options = parsed.run_options | ({"watch": case.physics("md")} if parsed.watch else {}) | (
            {"log": parsed.log} if parsed.log else {})
        trajectory = case.simulate(parsed.engine, **options, progress=True)
        output.print_text(summary(case, with_log(trajectory)))
        if parsed.save is not None:
            trajectory.save(parsed.save)
        return [trajectory]


class Compare(Command):
    """Run a scene with both engines and report where and why they differ."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.add_outputs(parser, plot="draw contacts, forces and paths of both engines, and an enlarged view",
                     film="film both engines: fall, contacts in slow motion, flight; also .mp4",
                     json="write every number of the report")
        parser.add_argument("--remedies", action="store_true", help="compare the remedies for inelastic "
                            "collapse with the soft spheres")
        add_until_option(parser, force=False)
        parser.add_argument("-v", "--verbose", action="store_true", help="print the full report")
        return [option for option in options_from(gr.compare) if option.name != "rule"]

    @staticmethod
    def run(parsed: argparse.Namespace) -> list[Trajectory]:
        case = case_of(parsed)
        options = case.options(gr.compare)
        if unused := [name for name in case.run if name not in options]:
            warnings.warn(f"compare ignores {', '.join(unused)} in [run].", stacklevel=1)
        options |= parsed.run_options
        report = gr.compare(case.scene, case.physics("md"), case.rule, **options, progress=True)
        output.write_report(report, parsed)
        ends, size = report.soft.contacts["t_end"], len(report.soft.contacts) * report.scene.n
        # a sensitivity is that of the located method at the end of the scene's own case
        same_run = parsed.until is None and "max_events" not in parsed.run_options and (
            options.get("dt") is None and options.get("method") in (None, "located"))
        if parsed.verbose and same_run and 0 < size <= MAX_SENSITIVITY_SIZE and not np.isnan(ends).any():
            end = {"t_end": options["t_end"]} if options.get("t_end") else {}
            output.print_text(gr.sensitivity(parsed.target, **parsed.scene_options | end).line,
                              output.text_stream(parsed))
        return [report.soft, report.hard]


class Threshold(Command):
    """Find the gap or other parameter value at which hard spheres become valid."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.add_outputs(parser, plot="plot the criterion against the parameter",
                     json="write all values, with the result at each")
        return options_from(gr.threshold, "over", "between", "criterion", "error", "within", "points", "spacing")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        output.write_report(
            gr.threshold(parsed.target, **parsed.scene_options, **parsed.run_options, progress=True), parsed)


class Frontier(Command):
    """Measure error and run time of every method for one scene."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.add_outputs(parser, plot="plot the error against the run time",
                     json="write every number, with the machine and all versions")
        return options_from(gr.frontier, "methods", "repeats")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        case = case_of(parsed)
        if case.until is None and "t_end" not in parsed.run_options and not is_file(parsed.target):
            case = shortened(case)
        output.write_report(
            gr.frontier(case.scene, case.physics("md"), **case.options(gr.frontier) | parsed.run_options,
                        progress=True), parsed)


class Stability(Command):
    """Test all methods on stiff, close, damped and unequal variants of a scene."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        output.add_outputs(parser, plot="draw the table of results", json="write the results of all runs")
        return options_from(gr.stability, "axes", "methods", "error")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        output.write_report(
            gr.stability(parsed.target, **parsed.scene_options, **parsed.run_options, progress=True), parsed)


def with_log(run: Trajectory) -> Trajectory:
    """Return a run with the contacts of its log file in its contact log.

    Runs without a file, or with more than `MAX_CONTACTS_READ` contacts, are returned unchanged.
    """
    if not run.stats.get("log") or _contact_count(run) > MAX_CONTACTS_READ:
        return run
    log = np.concatenate([run.contacts, *run.contact_batches()])
    return replace(run, contacts=log[np.argsort(log["t_begin"], kind="stable")])


def shortened(case: cases.Case) -> cases.Case:
    """Return a case that ends after about `MAX_STUDY_CONTACTS` contacts.

    The end lies in the longest interval in which none of the later contacts that have been computed begins or ends. A
    case with fewer contacts is returned unchanged.
    """
    first = case.simulate("md", max_events=MAX_STUDY_CONTACTS)
    if first.status is not Status.max_events or np.isnan(first.contacts["t_end"]).all():
        return case
    times = np.sort(np.concatenate([first.contacts["t_begin"], first.contacts["t_end"]]))
    times = times[~np.isnan(times)][MAX_STUDY_CONTACTS:]
    i = int(np.diff(times).argmax())
    end = float(0.5 * (times[i] + times[i + 1]))
    print(f"granular: up to t = {end:.6g} s; give --t-end for another end", file=sys.stderr)
    return replace(case, t_end=end)


def summary(case: cases.Case, run: Trajectory) -> str:
    """Return the text of `granular run`: end of the run, contacts, and final state.

    Contacts are listed by pair, the final state by body. Numbers are left out after an unstable or broken run, where
    they have no meaning.
    """
    from granular.comparison import measures
    from granular.md import isolation

    engine = "hard spheres (edmd)" if run.law is None else "soft spheres (md)"
    lines = [*[case.about] * bool(case.about), f"{scene_text(run.scene)}; {engine}"]
    if run.status in (Status.unstable, Status.broken):  # the numbers of such a run have no meaning
        return "\n".join([*lines, f"{run.status.name} at t = {run.time[-1]:.6g} s: {run.message}"])
    lines += [f"ended ({run.status.name}): {run.message}",
              f"final state at t = {run.time[-1]:.9g} s, {_contact_count(run)} contacts",
              *filter(None, [isolation.sentence(run)]), "", *_contact_lines(run), "", *_body_lines(run)]
    if run.scene.fed:
        parts = measures.balance(run)
        terms = (f"{words} {parts[name]:.6g}" for name, words in measures.BALANCE_LABELS.items() if parts[name])
        return "\n".join([*lines, "", "energy, J: " + ", ".join(terms)])
    energy = energy_between_surfaces(run)
    if energy[0] > 0.0 and not math.isnan(energy[-1]):
        fraction_left = energy[-1] / energy[0]
        fraction_left = 0.0 if run.scene.gravity > 0.0 and abs(fraction_left) < REST_ENERGY_ROUNDING else fraction_left
        lines += ["", f"energy left: {100.0 * fraction_left:.6g} % of {energy[0]:.6g} J"]
    return "\n".join(lines)


def _contact_count(run: Trajectory) -> int:
    return len(run.contacts) or sum(map(len, run.contact_batches()))


def _contact_lines(run: Trajectory) -> Iterator[str]:
    """Yield a table of the contacts of each pair, line by line."""
    if _contact_count(run) > len(run.contacts):
        yield f"contacts are in {run.stats['log']}"
        return
    yield f"{'pair':>12} {'contacts':>9} {'first onset / s':>16} {'last onset / s':>16} {'max overlap / m':>16}"
    for pair, row in _table_rows(run.scene.n_pairs):
        log = run.of(pair)
        row = row or f"{run.scene.pairs.name(pair):>12} {len(log):9d}"
        if len(log) and "…" not in row:
            deepest = 0.0 if run.law is None else float(log["xi_max"].max())
            row += f" {log['t_begin'][0]:16.9g} {log['t_begin'][-1]:16.9g} {deepest:16.4g}"
        yield row


def _body_lines(run: Trajectory) -> Iterator[str]:
    yield f"{'body':>12} {'mass / kg':>12} {'position / m':>14} {'velocity / (m/s)':>18}"
    for i, row in _table_rows(run.scene.n):
        mass, x, v = run.scene.mass[i], run.position[-1, i], run.velocity[-1, i]
        yield row or f"{body_name(run.scene, i):>12} {mass:12.6g} {x:14.6g} {v:18.6g}"


def _table_rows(n: int) -> Iterator[tuple[int, str]]:
    """Yield number and replacement text for the printed rows of a table of length `n`.

    The replacement text is empty for normal rows. A table with more than `MAX_TABLE_ROWS` rows is shortened: only its
    first rows and its last row are printed, with one row "… (k more)" between them.
    """
    for i in range(n):
        if i < MAX_TABLE_ROWS - 2 or i == n - 1 or n <= MAX_TABLE_ROWS:
            yield i, ""
        elif i == n - 2:
            yield i, f"{'…':>12} ({n - MAX_TABLE_ROWS + 1} more)"
