"""`stability`: run cells by all methods, within a limit of processor time."""

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
from granular._engine.callables import callback
from granular._engine.kernels import have_numba
from granular.laws import Hertz, LinearDashpot, PowerLaw, TsujiHertz
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import EARLY_STATUSES, Status
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
"""Axes, and the functions that create their cells.

"symmetry" also creates the cells of "invariants".
"""
QUICK_CELLS = 2
"""Number of cells per axis and method in a quick study, which CI runs."""


def stability(
    methods: str | Sequence[str] = ALL_METHODS,
    axes: str | Sequence[str] = tuple(AXES),
    *,
    quick: bool = False,
    seconds: float = 20.0,
    on_progress: Callable[[float, int], object] | None = None,
) -> StabilityReport:
    """Run stiff and extreme cases by every method, and return verdicts.

    Parameters
    ----------
    methods : str or sequence of str
        From "located", "edmd", "verlet", "symplectic-euler", "rk4", "gear5".
    axes : str or sequence of str
        From `AXES`, such as "stiffness", "gap", "time step".
    quick : bool
        Run only two cells per axis and method, without the long cells.
    seconds : float
        Limit of processor time per cell in s. A cell above it has the verdict `limit`. The limit needs the main thread
        of a POSIX system.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called after each cell, with the finished share and number of cells.

    Returns
    -------
    StabilityReport
        Every cell with its verdict: right, flagged, silently wrong, crashed, or over the limit. A right cell is within
        its tolerance of a closed form, an exact computation, an invariant or a symmetry. The report also contains
        stability limits compared with theory, and drifts over long runs. Print it for the tables.

    Raises
    ------
    ValueError
        For a method or an axis that does not exist.
    """
    chosen_methods = _named("methods", methods, ALL_METHODS)
    chosen_axes = _named("axes", axes, tuple(AXES))
    callback("on_progress", on_progress, "reached", "count")
    limit = check.number("seconds", seconds, above=0.0)
    if not quick:
        warm_up(chosen_methods, "driven" in chosen_axes)
    chosen = [pair for axis in chosen_axes for pair in _chosen(AXES[axis](), chosen_methods, quick)]
    results = []
    for done, (cell, method) in enumerate(chosen, 1):
        results.append(run_cell(cell, method, limit, plain=quick))
        if on_progress is not None:
            on_progress(done / len(chosen), done)
    limits = long.limits((1,) if quick else (1, 2, 20), chosen_methods) if "time step" in chosen_axes else []
    drifts = long.drifts(chosen_methods, 10 if quick else 10_000) if "long runs" in chosen_axes else []
    return StabilityReport(tuple(results), tuple(limits), tuple(drifts), quick)


def _chosen(cells: Iterable[Cell], methods: Sequence[str], quick: bool) -> list[tuple[Cell, str]]:
    """Pairs of cell and method.

    A quick study takes some pairs of each kind, spread over the axis.
    """
    pairs = [(cell, method) for cell in cells for method in cell.methods if method in methods]
    if not quick:
        return pairs
    kinds: dict[tuple[str, str], list[tuple[Cell, str]]] = {}
    for cell, method in pairs:
        if not cell.slow:
            kinds.setdefault((method, cell.axis), []).append((cell, method))
    return [pair for mine in kinds.values() for pair in mine[:: 1 + len(mine) // QUICK_CELLS]]


def _named(name: str, given: str | Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Chosen names in order, each checked."""
    chosen = (given,) if isinstance(given, str) else tuple(given)
    if not chosen:
        raise ValueError(f"`{name}` must contain at least one of {', '.join(known)}, got none.")
    return tuple(dict.fromkeys(check.choice(name, one, known) for one in chosen))


class OutOfTime(Exception):
    """The limit of processor time was reached."""


def run_cell(cell: Cell, method: str, seconds: float, plain: bool = False) -> Result:
    """Verdict on `cell` by `method`, after at most about `seconds`.

    With `plain` the run is interpreted and short.
    """
    tolerance = cell.loose if method in FIXED_METHODS else cell.tolerance
    error, start, late = math.nan, time.process_time(), f"no end within {seconds:g} s"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with deadline(seconds):
                rerun = rerun_function(cell, method, plain)
                run = rerun()
                error = float(cell.truth.error(run, rerun))
            said = f"{run.status.name}: {run.message}"
            early = run.status in EARLY_STATUSES and not (cell.cut and run.status is Status.max_events)
            flagged = early or any(warning.category is RuntimeWarning for warning in caught)
            verdict = Verdict.right if error <= tolerance else Verdict.flagged if flagged else Verdict.wrong
        except OutOfTime:
            verdict, said = Verdict.limit, late
        except Exception as failure:
            misuse = type(failure) is ValueError and str(failure).endswith(".")  # only our own messages are sentences
            verdict, said = (Verdict.flagged if misuse else Verdict.crashed), f"{type(failure).__name__}: {failure}"
            if time.process_time() - start >= seconds:  # a callback has turned `OutOfTime` into another error
                verdict, said = Verdict.limit, late
    said = "; ".join([said, *sorted({str(warning.message) for warning in caught})])
    taken = time.process_time() - start
    return Result(cell.axis, cell.case, method, cell.truth.words, verdict, error, tolerance, said, taken)


def warm_up(methods: Sequence[str], shaken: bool) -> None:
    """Compile the engines in advance, also for a floor that is `shaken`.

    The limit of processor time must not interrupt an import or a compiler.
    """
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
    """Raise `OutOfTime` inside the block after `seconds` of processor time.

    Wall time is not limited, because a loaded machine must not cause a failure. The limit uses the interval timer of
    the process and needs its main thread. Elsewhere only the limits on work (``max_events``, ``max_steps``) end a run.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds, 1.0)  # repeated, because a callback can suppress one exception
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
