"""`granular sweep`: parameter maps."""

from __future__ import annotations

import argparse
import math
import os
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from typing import Any

import numpy as np

from granular.cases.options import Option
from granular.cli.codes import OK
from granular.cli.output import check_writable
from granular.cli.progress import Progress
from granular.sweeps import axis, sweep
from granular.sweeps.results import RESULTS, STATUS
from granular.sweeps.run import DEFAULT

USAGE = "SCENE [options]"

WORTH_POOL = 20_000
"""Cells from which on several processes are started."""


def arguments(parser: argparse.ArgumentParser) -> list[Option]:
    """Add what the command takes besides the parameters of the scene."""
    group = parser.add_argument_group("sweep")
    group.add_argument("--over", action="append", metavar="NAME=FIRST:LAST:COUNT[:log]", default=[],
                       help="vary a parameter; or NAME=VALUE,VALUE,...; may be given several times")
    group.add_argument("--result", action="append", choices=list(RESULTS), metavar="NAME", default=[],
                       help=f"what to keep of every cell, may be given several times: {', '.join(RESULTS)}")
    group.add_argument("--refine", metavar="NAME", help="bisect the jumps of contact counts along this parameter")
    group.add_argument("--precision", type=float, default=1e-6, metavar="X", help="relative, of --refine [1e-06]")
    group.add_argument("--save", metavar="FILE.nc", help="write a netCDF file; if it is there, go on from it")
    group.add_argument("--workers", type=int, metavar="N", help="number of processes [one per core in large sweeps]")
    return []


def run(given: argparse.Namespace) -> int:
    """Do the sweep and print what came out of it."""
    check_writable(given.save)
    if not given.over:
        raise ValueError("sweep needs --over NAME=FIRST:LAST:COUNT, such as --over restitution=0.5:1:101.")
    over = dict(axis(text) for text in given.over)
    if len(over) < len(given.over):
        raise ValueError("--over names a parameter twice: one axis per parameter is needed.")
    cells = math.prod(map(len, over.values()))
    if given.workers is not None and given.workers < 1:
        raise ValueError(f"workers is {given.workers}: a number of processes of at least 1 is needed.")
    workers = given.workers or ((os.cpu_count() or 1) if cells >= WORTH_POOL else 1)
    pool: Any = ProcessPoolExecutor(workers) if workers > 1 else nullcontext()
    with pool as executor, Progress(1.0, things="cells") as progress:
        data = sweep(given.target, over, given.result or DEFAULT, refine=given.refine, precision=given.precision,
                     save=given.save, executor=executor, on_progress=progress, **given.given, **given.run)
    print(summary(data))
    return OK


def summary(data: Any) -> str:
    """Axes, results with their ranges, statuses and jumps, in words."""
    shape = " × ".join(str(data.sizes[name]) for name in data["status"].dims)
    lines = [f"{data.attrs['title']}: {shape} cells"]
    for name, array in {**data.coords, **data.data_vars}.items():
        values = array.values[~np.isnan(array.values)] if array.dtype.kind == "f" else array.values
        if array.dtype.kind == "i" and name in data.data_vars:
            values = values[values >= 0]  # -1 stands where there is no such pair, or no result
        if name in ("status", "pair", "body") or str(name).startswith("edge") or array.dtype.kind not in "iuf":
            continue
        text = f"{values.min():.6g} … {values.max():.6g}" if values.size else "no value"
        about = array.attrs.get("comment") or array.attrs.get("long_name", "")
        lines.append(f"  {name!s:16} {text:28} {about}")
    codes, counts = np.unique(data["status"].values, return_counts=True)
    lines.append("  status           " + ", ".join(f"{STATUS[int(c)]} {n}" for c, n in zip(codes, counts, strict=True)))
    if "refusal" in data.attrs:
        lines.append(f"  refused          {data.attrs['refusal']}")
    if "edge" in data:
        lines += _jumps(data)
    return "\n".join(lines)


def _jumps(data: Any, most: int = 40) -> list[str]:
    others = [str(name) for name in data if str(name).startswith("edge_") and name != "edge_contacts"]
    lines = [f"  {data.sizes['jump']} jumps of the contact counts:"]
    for i in range(min(most, data.sizes["jump"])):
        low, high = data["edge"].values[i]
        before, after = (tuple(counts.tolist()) for counts in data["edge_contacts"].values[i])
        where = "".join(f", {name[5:]} = {data[name].values[i]:g}" for name in others)
        lines.append(f"    {low:.10g} … {high:.10g}: {before} to {after}{where}")
    return lines if data.sizes["jump"] <= most else [*lines, "    …"]
