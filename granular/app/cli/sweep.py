"""Commands `sweep`, `sensitivity` and `ensemble`, and their pool of processes."""

from __future__ import annotations

import argparse
import math
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children
from typing import Any

import numpy as np

from granular._engine import check
from granular._engine.reports import cores, number, split_table, with_unit
from granular.app.cli import ends, output
from granular.app.cli.parser import Command, options_from
from granular.cases.case import Option
from granular.studies.sweeps.ensembles import COMMON_RESULTS, ensemble
from granular.studies.sweeps.executors import end_with_parent
from granular.studies.sweeps.results import RESULTS, STATUS_NAMES
from granular.studies.sweeps.run import DEFAULT_RESULTS, sweep
from granular.studies.sweeps.sensitivities import sensitivity
from granular.studies.sweeps.subject import axis

MIN_CELLS_FOR_POOL = 20_000
"""Minimum number of cells for which several processes are used by default."""
MAX_WORKERS = 1024
"""Maximum number of processes."""
MAX_TABLE_CELLS = 20
"""Maximum number of cells of a sweep that are printed one by one."""
MAX_PRINTED_JUMPS = 40
"""Maximum number of jumps that are printed."""


class Sweep(Command):
    """Solve a scene for all combinations of parameter values."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("--over", action="append", metavar="NAME=FIRST:LAST:COUNT[:log]", default=[],
                            help="parameter to vary; or NAME=VALUE,VALUE,...; can be repeated")
        parser.add_argument("--result", action="append", choices=list(RESULTS), metavar="NAME", default=[],
                            help=f"result to store for each cell, can be repeated; one of {', '.join(RESULTS)}")
        parser.add_argument("--workers", type=int, metavar="N",
                            help="number of processes [one per core in large sweeps]")
        output.add_outputs(parser, save_as="nc", save="write a netCDF file, or continue an existing file of this sweep")
        return options_from(sweep, "refine", "precision")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        if not parsed.over:
            raise ValueError("sweep requires --over NAME=FIRST:LAST:COUNT, such as --over restitution=0.5:1:101.")
        over = dict(map(axis, parsed.over))
        if len(over) < len(parsed.over):
            raise ValueError("--over must give one axis per parameter, got two of the same parameter.")
        default = cores() if math.prod(map(len, over.values())) >= MIN_CELLS_FOR_POOL else 1
        workers = default if parsed.workers is None else parsed.workers
        check.integer("--workers", workers, at_least=1, at_most=MAX_WORKERS)
        with processes(workers) as executor:
            data = sweep(parsed.target, over, parsed.result or DEFAULT_RESULTS, save=parsed.save, executor=executor,
                         workers=parsed.workers, progress=True, **parsed.scene_options, **parsed.run_options)
        print(output.wrap_text(summary(data)))


class Sensitivity(Command):
    """Compute derivatives, condition numbers and uncertainties of outcomes."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        known = [name for name, result in RESULTS.items() if not isinstance(result.fill, int)]
        parser.add_argument("--result", action="append", metavar="NAME", default=[],
                            help=f"outcome [v_rel], or one of its values such as v_rel[1]; can be repeated; one of "
                                 f"{', '.join(known)}")
        parser.add_argument("--over", action="append", metavar="NAME",
                            help="parameter, can be repeated [all numbers of the scene]")
        parser.add_argument("--uncertainty", nargs="+", metavar="NAME=VALUE", default=[],
                            help="standard uncertainties, such as gap=1e-5 or gap=5%%; 1%% applies to every parameter")
        parser.add_argument("--border", action="store_true",
                            help="find the values below and above each parameter at which a contact count changes")
        parser.add_argument("--workers", type=int, metavar="N", default=1, help="number of processes [1]")
        output.add_outputs(parser, json="write all numbers")
        return options_from(sensitivity, "t_end")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        words = [word.strip().partition("=") for word in parsed.uncertainty]
        is_single = len(words) == 1 and not words[0][1]
        uncertainty = words[0][0] if is_single else {name: value for name, _, value in words}
        check.integer("--workers", parsed.workers, at_least=1, at_most=MAX_WORKERS)
        with processes(parsed.workers) as executor:
            report = sensitivity(parsed.target, parsed.result or ("v_rel",), parsed.over, uncertainty or None,
                                 executor=executor, progress=True, **parsed.scene_options, **parsed.run_options)
        if parsed.border:
            report.border  # noqa: B018  from now on it is among what is printed
        output.write_report(report, parsed)


@contextmanager
def processes(count: int) -> Iterator[Executor | None]:
    """Provide a pool of `count` processes, or None for one process.

    If an exception is raised in the context, the processes are killed immediately. They also end if this process ends.
    """
    if count == 1:
        yield None
        return
    other_processes, threads_before = set(active_children()), set(threading.enumerate())
    with ProcessPoolExecutor(count, initializer=_prepare_worker) as pool:
        try:
            pool.submit(int)  # processes start before there is a second thread
            yield pool
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(active_children()) - other_processes:
                process.kill()
            for thread in set(threading.enumerate()) - threads_before:
                if not thread.daemon:  # a thread of the pool, which would close its pipes at the exit of Python
                    thread.join()
            if isinstance(error, BrokenProcessPool):
                raise ChildProcessError("A process of the sweep was killed, possibly because memory ran out. Use fewer "
                                        "--workers. The file of --save contains the cells solved so far.") from None
            raise


def _prepare_worker() -> None:
    """Prepare a worker process: it ignores end signals, and ends with its parent."""
    for signal_number in ends.END_SIGNALS:
        signal.signal(signal_number, signal.SIG_IGN)
    end_with_parent(os.getpid())


class Ensemble(Command):
    """Run both engines for many random draws of a scene, and compare the means."""

    @staticmethod
    def arguments(parser: argparse.ArgumentParser) -> list[Option]:
        parser.add_argument("--vary", action="append", metavar="NAME=MEAN,SD", default=[],
                            help="parameter with a normal distribution; or NAME alone for a seed; can be repeated")
        parser.add_argument("--draws", type=int, metavar="N", default=100, help="number of draws [100]")
        parser.add_argument(
            "--result",
            action="append",
            metavar="NAME",
            default=[],
            help=f"result to compare, such as v_rel[1], can be repeated; one of {', '.join(COMMON_RESULTS)}",
        )
        output.add_outputs(parser, plot="draw the distributions", json="write all numbers")
        return options_from(ensemble, "margin", "seed", "independent")

    @staticmethod
    def run(parsed: argparse.Namespace) -> None:
        vary: Any = dict(axis(word) if "=" in word else (word, None) for word in parsed.vary)
        output.write_report(ensemble(parsed.target, parsed.draws, vary, parsed.result or "energy_left", progress=True,
                                **parsed.scene_options, **parsed.run_options), parsed)


def summary(data: Any) -> str:
    """Return the text of a sweep: its cells, or the ranges of axes and results.

    Statuses and jumps of the contact counts follow. The cells are printed up to `MAX_TABLE_CELLS`, otherwise the
    ranges.

    Parameters
    ----------
    data : xarray.Dataset
        Result of `granular.sweep`.
    """
    status = data["status"]
    lines = [f"{data.attrs['title']}: {' × '.join(str(data.sizes[name]) for name in status.dims)} cells"]
    names = [name for name in (*status.dims, *data.data_vars) if name != "status" and not name.startswith("edge")]
    if status.size <= MAX_TABLE_CELLS:
        lines += ["", _cell_table(data, names), ""]
        names = []
    for name in names:
        values, about = data[name].values, data[name].attrs
        if values.dtype.kind in "iuf":
            valid = values[values >= 0] if values.dtype.kind == "i" and name in data.data_vars else values  # -1: none
            valid = valid[~np.isnan(valid)]
            text = f"{valid.min():.6g} … {valid.max():.6g}" if valid.size else "no value"
            text = with_unit(text, about.get("units", ""), " ")
            lines.append(f"  {name!s:16} {text:26} {about.get('comment') or about.get('long_name', '')}")
    codes, counts = np.unique(status.values, return_counts=True)
    lines.append(
        "  status           " + ", ".join(f"{n} × {STATUS_NAMES[int(c)]}" for c, n in zip(codes, counts, strict=True))
    )
    if "refusal" in data.attrs:
        lines.append(f"  refused          {data.attrs['refusal']}")
    return "\n".join(lines + (_jump_lines(data) if "edge" in data else []))


def _cell_table(data: Any, names: Sequence[str]) -> str:
    """Return a table with one row per cell and one column per number."""
    axes = data["status"].dims
    columns = {}
    for name in names:
        variable, unit = data[name], data[name].attrs.get("units", "")
        if name in axes:
            columns[with_unit(name, unit)] = variable.broadcast_like(data["status"]).transpose(*axes).values.ravel()
            continue
        inner = [dim for dim in variable.dims if dim not in axes]
        values = variable.transpose(*axes, *inner).values.reshape(data["status"].size, -1)
        columns |= {with_unit(f"{name}[{i}]" if inner else name, unit): values[:, i] for i in range(values.shape[1])}
    codes = data["status"].values.ravel().tolist()
    rows = zip(*columns.values(), (STATUS_NAMES[code] for code in codes), strict=True)
    return split_table([[*columns, "status"], *([value if isinstance(value, str) else number(value) for value in row]
                                           for row in rows)], ">", len(axes))


def _jump_lines(data: Any) -> list[str]:
    """Return the lines on the jumps that a refined sweep has found."""
    edge_names = [str(name) for name in data if str(name).startswith("edge_") and name != "edge_contacts"]
    lines = [f"  {data.sizes['jump']} jumps of the contact counts:"]
    for i in range(min(MAX_PRINTED_JUMPS, data.sizes["jump"])):
        low, high = data["edge"].values[i]
        before, after = map(tuple, data["edge_contacts"].values[i].tolist())
        position = "".join(f", {name[5:]} = {data[name].values[i]:g}" for name in edge_names)
        lines.append(f"    {low:.10g} … {high:.10g}: {before} to {after}{position}")
    return lines + ["    …"] * (data.sizes["jump"] > MAX_PRINTED_JUMPS)
