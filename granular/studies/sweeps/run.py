"""`sweep`: results over all combinations of parameters, with bisected boundaries."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from granular._engine import check
from granular._engine.progress import Told, shown
from granular._engine.reports import cores
from granular.cases import Case
from granular.studies.sweeps import schedule
from granular.studies.sweeps.plan import Plan, check_names, dataset, planned, resume, write, xarray_
from granular.studies.sweeps.results import MISUSE_CODE, NOT_RUN, Answers
from granular.studies.sweeps.subject import SceneLike, Values, checked

if TYPE_CHECKING:
    import xarray


DEFAULT_RESULTS = ("contacts", "v_rel", "eps_ratio")
"""Default results."""
SAVE_EVERY = 30.0
"""Time in s between two writes of the file."""
Counts = Callable[[list[Values]], Values]
"""Function that returns contact counts (S, pairs) for columns of parameters."""
Where = tuple[Executor | None, int]
"""An executor, and the number of threads without one."""


@check.face
def sweep(
    scene: SceneLike,
    over: Mapping[str, ArrayLike] | Iterable[str] | str,
    results: str | Callable[[Case], float] | Iterable[str | Callable[[Case], float]] = DEFAULT_RESULTS,
    *,
    run: Mapping[str, Any] | None = None,
    refine: str | None = None,
    precision: float = 1e-6,
    save: str | PathLike[str] | None = None,
    key: str | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> xarray.Dataset:
    """Solve a scene for all combinations of parameter values.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        Name of a ready-made case, a TOML file, a function of the parameters that returns a `granular.Case` (importable
        for other processes), a case itself, or a scene, with `law`, `rule`, `until`, `t_end` as further parameters.
    over : mapping, or text
        Values of the parameters to vary: ``{"gap": [1e-5, 1e-4]}``, or texts such as ``"gap=1e-7:1e-2:300:log"``.
        ``radii[0]`` is one entry of a list of values. Parameters of a file are the numbers in its tables, of a case
        the numbers of its scene, laws and rule: ``mass[1]``, ``gravity``, ``law.k`` (of all pairs), ``law[0].k``,
        ``t_end``; ``gap`` of all pairs of balls, ``restitution`` of all laws (at constant stiffness) and of the rule.
    results : names, or functions of the case that return a number
        Results of every cell in addition to its `status`, see `granular.studies.sweeps.results.RESULTS`.
    run : mapping, optional
        Options of ``simulate``, such as ``{"engine": "plain"}``. Without them, and for laws that are powers of the
        overlap, cells run compiled in one call per batch.
    refine : str, optional
        Parameter along which jumps of the contact counts are bisected. Needs the result "contacts". The jumps are
        `edge`, `edge_contacts` along the dimension "jump". Windows narrower than the spacing of the grid can be missed.
    precision : float
        Relative width to which jumps are bisected.
    save : path, optional
        A netCDF file for the result. It is written every half minute, at the end and on interruption. If it exists,
        only missing cells are solved.
    key : str, optional
        Identifies user-defined functions and classes in the file, such as ``"version 2"``. Change it whenever you
        change them. Without a key, an existing file is refused if the sweep uses a scene, law, rule, wall or result of
        your own.
    executor : concurrent.futures.Executor, optional
        A ``ProcessPoolExecutor``, ``client.get_executor()`` of dask, an ``MPIPoolExecutor``. Defaults to this process.
        The results are bitwise identical.
    workers : int, optional
        Number of threads of this process, without an executor, for cells that run compiled in one call per batch.
        Defaults to one per available core if this is faster. Cells that run one by one need processes to be faster.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called with the share of this call's cells that are solved, and the number of
        all solved cells, including those of a file.
    progress : bool
        Show the progress on standard error after 2 s, as a bar if tqdm is installed.
    **fixed
        Parameters that all cells share.

    Returns
    -------
    xarray.Dataset
        One dimension per parameter, then "pair" or "body". `status` marks cells that were refused (``misuse``) or did
        not end properly. The attribute `refusal` is the first message of a refusal.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter or result, and for a sweep in which all cells are refused.

    Examples
    --------
    >>> import granular as gr
    >>> data = gr.sweep("three-balls", {"restitution": [0.5, 0.7, 0.9]}, "contacts")
    >>> data["contacts"].sel(pair=1).values.tolist()
    [4, 4, 3]
    """
    schedule.checked(executor)
    threads = cores() if workers is None else check.whole("workers", workers, at_least=1)
    xarray_()
    varied = checked(over)
    asked = check.several("results", results, "a name or a function, or several")
    version = check.of_kind("key", key, str | None, "a text or None")
    plan = replace(planned(scene, varied, tuple(asked), fixed, run), version=version)
    check_names(plan, save)
    if refine is not None:
        check.choice("refine", refine, list(varied))
        check.choice("the result to refine by", "contacts", list(plan.results))
        if varied[refine].dtype.kind not in "if":
            raise TypeError(f"`refine` must name a parameter of numbers, got {refine!r} with values "
                            f"{varied[refine].tolist()}.")
    job = _Job(plan, varied, [values.ravel() for values in np.meshgrid(*varied.values(), indexing="ij")], save)
    where = executor, threads
    if executor is not None and progress:
        executor.submit(int)  # its processes start before there is a second thread
    with shown(progress, on_progress, "cells") as tell:
        job.solve(where, tell)
        return job.dataset() if refine is None else job.refined(refine, precision, where)


class _Job:
    """A sweep in progress. `columns` are the parameters of its cells."""

    def __init__(self, plan: Plan, over: dict[str, Values], columns: list[Values], save: Any) -> None:
        self.plan, self.over, self.columns, self.save = plan, over, columns, save
        self.answers = Answers(plan.results, len(columns[0]))
        known, self.notes = resume(save, plan, over) if save is not None else ({}, {})
        self.answers.put(slice(None), known)

    def solve(self, where: Where, tell: Told | None) -> None:
        """Solve the missing cells, and keep finished ones in any case."""
        missing = np.flatnonzero(self.answers.columns["status"] == NOT_RUN)
        known = done = len(self.columns[0]) - len(missing)
        saved = time.monotonic()
        try:
            for places, found in schedule.batches(self.plan, self.columns, missing, *where):
                self.answers.take(places, found)
                done += len(places)
                if tell is not None:
                    tell((done - known) / len(missing), done)
                if time.monotonic() > saved + SAVE_EVERY:
                    self.written(self.dataset())
                    saved = time.monotonic()
        finally:
            if done > known:
                self.written(self.dataset())
        if (self.answers.columns["status"] == MISUSE_CODE).all():
            raise ValueError(self.answers.refusal[1] if self.answers.refusal else self.notes.get(
                "refusal", f"All cells of {self.save!r} were refused, and the file does not say why. Remove the file."))

    def dataset(self) -> xarray.Dataset:
        """Return the results so far."""
        notes = {"refusal": self.answers.refusal[1]} if self.answers.refusal else self.notes
        return dataset(self.plan, self.over, self.answers.columns, notes)

    def written(self, data: xarray.Dataset) -> xarray.Dataset:
        """Write the results so far, if there is a file."""
        if self.save is not None:
            write(data, self.save)
        return data

    def refined(self, name: str, precision: float, where: Where) -> xarray.Dataset:
        """Add the jumps of the contact counts along one parameter."""
        plan = replace(self.plan, asked=("contacts",))
        axis, shape = list(self.over).index(name), tuple(map(len, self.over.values()))

        def counts(columns: list[Values]) -> Values:
            found = Answers(plan.results, len(columns[0]))
            found.put([], {"contacts": self.answers.columns["contacts"][:0]})  # as wide
            for places, part in schedule.batches(plan, columns, np.arange(len(columns[0])), *where):
                found.take(places, part)
            return np.asarray(found.columns["contacts"])

        whole = self.plan.subject.is_whole(name)
        row, ends, sides = edges(axis, self.columns, self.answers.columns["contacts"], shape, counts, precision, whole)
        data = self.dataset()
        about = data[name].attrs | {"comment": f"interval of {name} in which a count jumps"}
        data["edge"] = ("jump", "side"), ends, about
        data["edge_contacts"] = ("jump", "side", "pair"), sides.astype(np.int64), data["contacts"].attrs
        for other, column in zip(self.over, self.columns, strict=True):
            if other != name:
                data[f"edge_{other}"] = "jump", column[row], data[other].attrs
        return self.written(data)


def edges(axis: int, columns: Sequence[Values], grid: Values, shape: tuple[int, ...], counts: Counts,
          precision: float, whole: bool = False) -> tuple[Values, Values, Values]:
    """Bisect every jump between neighbours of the grid along `axis`.

    Jumps are known to a relative `precision`, for a `whole` parameter to two consecutive integers. An interval whose
    midpoint has a third count is cut in two. A window between two points of the grid with equal counts is missed. Cells
    without counts are left out, and an interval whose midpoint has none is not cut.

    Returns
    -------
    row, ends, counts : arrays (j,), (j, 2), (j, 2, pairs)
        For each jump a cell with its values of the other parameters, the interval of this one, and the counts there.
    """
    check.number("precision", precision, at_least=1e-15, at_most=0.1)
    cells = np.moveaxis(np.arange(len(grid)).reshape(shape), axis, -1)
    both = np.stack([cells[..., :-1].ravel(), cells[..., 1:].ravel()], axis=1)
    known: Any = (grid >= 0).any(axis=1)
    both = both[(grid[both[:, 0]] != grid[both[:, 1]]).any(axis=1) & known[both].all(axis=1)]
    row, ends, found = both[:, 0], columns[axis].astype(np.float64)[both], grid[both]
    stuck = np.zeros(len(row), bool)
    while True:
        middle = 0.5 * (ends[:, 0] + ends[:, 1])
        middle = np.floor(middle) if whole else middle
        wide = ~stuck & (np.abs(ends[:, 1] - ends[:, 0]) > precision * np.abs(ends).max(axis=1))
        wide &= (middle != ends[:, 0]) & (middle != ends[:, 1])
        if not wide.any():
            break
        at = middle[wide].astype(np.int64) if whole else middle[wide]
        there = counts([at if k == axis else column[row[wide]] for k, column in enumerate(columns)])
        stuck[wide] = (there < 0).all(axis=1)
        there, wide = there[~stuck[wide]], wide & ~stuck
        halves = [(row[~wide], ends[~wide], found[~wide], stuck[~wide])]
        for side in (0, 1):  # those halves that hold a jump
            end, count = ends[wide].copy(), found[wide].copy()
            end[:, 1 - side], count[:, 1 - side] = middle[wide], there
            holds = (count[:, 0] != count[:, 1]).any(axis=1)
            halves.append((row[wide][holds], end[holds], count[holds], stuck[wide][holds]))
        row, ends, found, stuck = map(np.concatenate, zip(*halves, strict=True))
    order = np.lexsort([ends[:, 0], *[column[row] for k, column in enumerate(columns) if k != axis][::-1]])
    return row[order], ends[order], found[order]
