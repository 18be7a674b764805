"""`stability`: go through the cells of the chosen axes and methods."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from granular import _check
from granular.stress import contact, hard, line, long, own, recorded, rest, timestep
from granular.stress.cell import METHODS, Cell
from granular.stress.judge import judge, warm_up
from granular.stress.report import StabilityReport

AXES: dict[str, Callable[[], Iterator[Cell]]] = {
    "stiffness": contact.stiffness,
    "damping": contact.damping,
    "mass ratio": contact.mass_ratios,
    "gap": contact.gaps,
    "speed": contact.speeds,
    "start time": contact.starts,
    "exponent": contact.exponents,
    "powers": own.powers,
    "own laws": own.kinks,
    "corners": contact.corners,
    "time step": contact.steps,
    "touching": line.touching,
    "chains": line.chains,
    "recorded": recorded.scenes,
    "rest": rest.rests,
    "counts": line.counts,
    "last row": rest.last_rows,
    "symmetry": line.symmetries,
    "exact sequence": hard.exact_runs,
    "collapse": hard.collapse,
    "ties": hard.ties,
    "float edges": hard.edges,
    "long runs": long.runs,
}
"""The axes and what makes their cells; "symmetry" also makes the cells of "invariants"."""
QUICK = 5
"""Cells of an axis and a method in a quick study."""


def stability(
    methods: str | Sequence[str] = METHODS,
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
        From `granular.stress.AXES`, such as "stiffness", "gap", "time step".
    quick : bool
        Only a few cells of every axis, none of the long ones.
    seconds : float
        Wall-clock limit of a cell in s; the verdict is then `limit`. It needs the main thread of a POSIX system.
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
    who = _named("methods", methods, METHODS)
    where = _named("axes", axes, tuple(AXES))
    _check.callback("on_progress", on_progress)
    limit = _check.number("seconds", seconds, above=0.0)
    if not quick:
        warm_up()
    chosen = [pair for axis in where for pair in _chosen(AXES[axis](), who, quick)]
    results = []
    for done, (cell, method) in enumerate(chosen, 1):
        results.append(judge(cell, method, limit, plain=quick))
        if on_progress is not None:
            on_progress(done / len(chosen), done)
    limits = timestep.limits((1,) if quick else (1, 2, 20), who) if "time step" in where else []
    drifts = long.drifts(who, 10 if quick else 10_000) if "long runs" in where else []
    return StabilityReport(tuple(results), tuple(limits), tuple(drifts), quick)


def _chosen(cells: Iterable[Cell], methods: Sequence[str], quick: bool) -> list[tuple[Cell, str]]:
    """Pairs of cell and method; a quick study takes a few of each method, spread over the axis."""
    pairs = [(cell, method) for cell in cells for method in cell.methods if method in methods]
    if not quick:
        return pairs
    each = ([pair for pair in pairs if pair[1] == method and not pair[0].slow] for method in methods)
    return [pair for mine in each for pair in mine[:: 1 + len(mine) // QUICK]]


def _named(name: str, given: str | Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return the chosen names in order, each checked."""
    chosen = (given,) if isinstance(given, str) else tuple(given)
    if not chosen:
        raise ValueError(f"{name} is empty: at least one of {', '.join(known)} is needed.")
    return tuple(dict.fromkeys(_check.choice(name, one, known) for one in chosen))
