"""`stability`: run the cells of the chosen axes and methods, each within a limit of processor time; verdicts."""

from __future__ import annotations

import math
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from bench.stability import contact, driven, hard, line, long, rest
from bench.stability.cell import ALL_METHODS, FIXED_METHODS, SOFT_METHODS, Cell, Result, Verdict, rerun_function
from bench.stability.report import StabilityReport
from granular import edmd, md
from granular._engine import check
from granular._engine.kernels import have_numba
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import EARLY, Status
from granular.scene import Scene
from granular.scene.walls import Sine

AXES: dict[str, Callable[[], Iterator[Cell]]] = {
    "stiffness": contact.stiffness,
    "damping": contact.damping,
    "mass ratio": contact.mass_ratios,
    "gap": contact.gaps,
    "speed": contact.speeds,
    "start time": contact.starts,
    "exponent": contact.exponents,
    "powers": contact.powers,
    "own laws": contact.kinks,
    "corners": contact.corners,
    "time step": contact.steps,
    "touching": line.touching,
    "chains": line.chains,
    "recorded": line.recorded,
    "rest": rest.rests,
    "counts": line.counts,
    "last row": rest.last_rows,
    "symmetry": line.symmetries,
    "exact sequence": hard.exact_runs,
    "collapse": hard.collapse,
    "ties": hard.ties,
    "float edges": hard.edges,
    "driven": driven.driven,
    "long runs": long.runs,
}
"""The axes and what makes their cells; "symmetry" also makes the cells of "invariants"."""
QUICK_CELLS = 2
"""Cells of an axis and a method in a quick study, which CI runs."""


def stability(
    methods: str | Sequence[str] = ALL_METHODS,
    axes: str | Sequence[str] = tuple(AXES),
    *,
    quick: bool = False,
    seconds: float = 20.0,
    on_progress: Callable[[float, int], object] | None = None,
) -> StabilityReport:
    """Run stiff and extreme cases by every method: does it survive, and does it say so when it does not?

    Parameters
    ----------
    methods : str or sequence of str
        From "located", "edmd", "verlet", "symplectic-euler", "rk4", "gear5".
    axes : str or sequence of str
        From `AXES`, such as "stiffness", "gap", "time step".
    quick : bool
        Only two cells of every axis and method, none of the long ones.
    seconds : float
        Limit of processor time of a cell in s; the verdict is then `limit`. It needs the main thread of a POSIX system.
    on_progress : callable, optional
        ``on_progress(reached, count)`` after each cell: the share of the cells that is done, and their number.

    Returns
    -------
    StabilityReport
        Every cell with its verdict: right (within its tolerance of a closed form, an exact computation, an
        invariant or a symmetry), flagged, silently wrong, crashed, or over the limit; stability limits against
        theory; drift over long runs. Print it for the table.

    Raises
    ------
    ValueError
        For a method or an axis that does not exist.
    """
    who = _named("methods", methods, ALL_METHODS)
    where = _named("axes", axes, tuple(AXES))
    check.callback("on_progress", on_progress, "reached", "count")
    limit = check.number("seconds", seconds, above=0.0)
    if not quick:
        warm_up(who, "driven" in where)
    chosen = [pair for axis in where for pair in _chosen(AXES[axis](), who, quick)]
    results = []
    for done, (cell, method) in enumerate(chosen, 1):
        results.append(run_cell(cell, method, limit, plain=quick))
        if on_progress is not None:
            on_progress(done / len(chosen), done)
    limits = long.limits((1,) if quick else (1, 2, 20), who) if "time step" in where else []
    drifts = long.drifts(who, 10 if quick else 10_000) if "long runs" in where else []
    return StabilityReport(tuple(results), tuple(limits), tuple(drifts), quick)


def _chosen(cells: Iterable[Cell], methods: Sequence[str], quick: bool) -> list[tuple[Cell, str]]:
    """Pairs of cell and method; a quick study takes some of each, spread over the axis."""
    pairs = [(cell, method) for cell in cells for method in cell.methods if method in methods]
    if not quick:
        return pairs
    kinds: dict[tuple[str, str], list[tuple[Cell, str]]] = {}
    for cell, method in pairs:
        if not cell.slow:
            kinds.setdefault((method, cell.axis), []).append((cell, method))
    return [pair for mine in kinds.values() for pair in mine[:: 1 + len(mine) // QUICK_CELLS]]


def _named(name: str, given: str | Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return the chosen names in order, each checked."""
    chosen = (given,) if isinstance(given, str) else tuple(given)
    if not chosen:
        raise ValueError(f"{name} is empty: at least one of {', '.join(known)} is needed.")
    return tuple(dict.fromkeys(check.choice(name, one, known) for one in chosen))


class OutOfTime(Exception):
    """The limit of processor time was reached."""


def run_cell(cell: Cell, method: str, seconds: float, plain: bool = False) -> Result:
    """Return the verdict on `cell` run by `method`, in at most about `seconds`; `plain`: interpreted, and short."""
    tolerance = cell.loose if method in FIXED_METHODS else cell.tolerance
    error, start, late = math.nan, time.process_time(), f"no end within {seconds:g} s"
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            with deadline(seconds):
                rerun = rerun_function(cell, method, plain)
                run = rerun()
                error = float(cell.truth.error(run, rerun))
            said = f"{run.status.name}: {run.message}"
            early = run.status in EARLY and not (cell.cut and run.status is Status.max_events)
            flagged = early or any(warning.category is RuntimeWarning for warning in heard)
            verdict = Verdict.right if error <= tolerance else Verdict.flagged if flagged else Verdict.wrong
        except OutOfTime:
            verdict, said = Verdict.limit, late
        except Exception as failure:
            a_sentence = type(failure) is ValueError and " is " in str(failure)  # name, value, what is needed
            verdict, said = (Verdict.flagged if a_sentence else Verdict.crashed), f"{type(failure).__name__}: {failure}"
            if time.process_time() - start >= seconds:  # the bell, heard inside a callback that made it its own error
                verdict, said = Verdict.limit, late
    said = "; ".join([said, *sorted({str(warning.message) for warning in heard})])
    taken = time.process_time() - start
    return Result(cell.axis, cell.case, method, cell.truth.words, verdict, error, tolerance, said, taken)


def warm_up(methods: Sequence[str], shaken: bool) -> None:
    """Compile the engines beforehand, also for a floor that is `shaken`: the limit must interrupt neither an
    import nor a compiler."""
    if not have_numba():
        return
    row = Scene([1.0, 1.0, 1.0], [0.1, 0.1, 0.1], [0.0, 0.1], [1.0, 0.0, -1.0])
    plate = Scene([math.inf, 1.0, 1.0], [0.0, 0.1, 0.1], [0.0, 0.1], [0.0, 0.0, -1.0], 9.81, floor=Sine(1e-3, 50.0))
    for scene in (row, plate)[: 1 + shaken]:
        if "edmd" in methods:
            edmd.simulate(scene, ConstantRestitution(0.5), engine="compiled", t_end=0.1, collapse="merge")
        for method in (method for method in SOFT_METHODS if method in methods):
            for law in (LinearDashpot(1e4, 1.0), Hertz(1e4), TsujiHertz(1e4, 0.1), PowerLaw(1e4, 2.0)):
                md.simulate(scene, law, t_end=0.005, method=method, engine="compiled")


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise `OutOfTime` inside the block after `seconds` of processor time: a loaded machine is no failure.

    By the interval timer of the process: in its main thread and where there is one. Elsewhere the limits on the
    amount of work (``max_events``, ``max_steps``) are all that ends a run.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds, 1.0)  # again and again: a foreign callback may swallow it once
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
