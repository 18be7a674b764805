"""Run one cell by one method, within a wall-clock limit, and give the verdict."""

from __future__ import annotations

import math
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from granular import edmd, md
from granular._kernels import have_numba
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz
from granular.rules import ConstantRestitution
from granular.scene import Scene
from granular.stress.cell import FIXED, SOFT, Again, Cell, Result, Verdict
from granular.trajectory import EARLY, Status, Trajectory

SHORT = 5_000
"""Steps at most of an interpreted run."""


class OutOfTime(Exception):
    """The wall-clock limit was reached."""


def judge(cell: Cell, method: str, seconds: float, plain: bool = False) -> Result:
    """Return the verdict on `cell` run by `method`, in at most about `seconds`; `plain`: interpreted, and short."""
    tolerance = cell.loose if method in FIXED else cell.tolerance
    error, start, late = math.nan, time.perf_counter(), f"no end within {seconds:g} s"
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            with deadline(seconds):
                again = repeat(cell, method, plain)
                run = again()
                error = float(cell.truth.error(run, again))
            said = f"{run.status.name}: {run.message}"
            early = run.status in EARLY and not (cell.cut and run.status is Status.max_events)
            flagged = early or any(warning.category is RuntimeWarning for warning in heard)
            verdict = Verdict.right if error <= tolerance else Verdict.flagged if flagged else Verdict.wrong
        except OutOfTime:
            verdict, said = Verdict.limit, late
        except Exception as failure:
            a_sentence = type(failure) is ValueError and " is " in str(failure)  # name, value, what is needed
            verdict, said = (Verdict.flagged if a_sentence else Verdict.crashed), f"{type(failure).__name__}: {failure}"
            if time.perf_counter() - start >= seconds:  # the bell, heard inside a callback that made it its own error
                verdict, said = Verdict.limit, late
    said = "; ".join([said, *sorted({str(warning.message) for warning in heard})])
    taken = time.perf_counter() - start
    return Result(cell.axis, cell.case, method, cell.truth.words, verdict, error, tolerance, said, taken)


def repeat(cell: Cell, method: str, plain: bool = False) -> Again:
    """Return the function that runs `cell` by `method`, with changes if asked for; `plain`: interpreted, and short."""

    def again(**changes: Any) -> Trajectory:
        options = {"scene": cell.scene, "law": cell.law} | dict(cell.options) | changes
        scene, law, most = options.pop("scene"), options.pop("law"), options.pop("max_steps", None)
        if method == "edmd":
            return edmd.simulate(scene, cell.rule, **options | ({"engine": "sorted"} if plain else {}))
        if plain:
            options, most = options | {"engine": "plain"}, min(SHORT, most or SHORT)
        if most is not None:
            options["max_steps"] = most
        if method != "located":
            options = {"method": method, "engine": "compiled" if have_numba() else "plain"} | options
        return md.simulate(scene, law, **options)

    return again


def warm_up() -> None:
    """Compile the engines beforehand: a wall-clock limit must interrupt neither an import nor a compiler."""
    if not have_numba():
        return
    scene = Scene([1.0, 1.0, 1.0], [0.1, 0.1, 0.1], [0.0, 0.1], [1.0, 0.0, -1.0])
    edmd.simulate(scene, ConstantRestitution(0.5), engine="compiled")
    for method in SOFT:
        for law in (LinearDashpot(1e4, 1.0), Hertz(1e4), TsujiHertz(1e4, 0.1), PowerLaw(1e4, 2.0)):
            md.simulate(scene, law, t_end=0.005, method=method, engine="compiled")


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise `OutOfTime` inside the block after `seconds`.

    By the interval timer of the process: in its main thread and where there is one. Elsewhere the limits on the
    amount of work (``max_events``, ``max_steps``) are all that ends a run.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)  # again and again: a foreign callback may swallow it once
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
